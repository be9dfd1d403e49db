#define_import_path akari_area_light::shadow_trees

// The light in the trees of one sample, face by face: what `akari_visibility::query` leaves to its caller.

#import akari_visibility::query::{
    Traversal, traversal_close, traversal_enter, traversal_is_piece, traversal_new, traversal_next, traversal_push,
    traversal_split, traversal_visibility, traversal_word,
}
#import akari_area_light::types::AreaLight
#import akari_area_light::shadow_types::{ShadowParams, Slot}

@group(1) @binding(0) var<uniform> params: ShadowParams;
@group(1) @binding(1) var<storage, read> slots: array<Slot>;
@group(1) @binding(2) var<storage, read> nodes: array<u32>;

// Corners of one part of a light: a traversal holds 16.
const PART_CORNERS: u32 = 16u;
const FACES: u32 = 6u;

// A light of many corners is visited as a fan about its first corner: its parts. Areas of a fan have signs, and so
// have the integrals over them, so that concave lights come out right.
fn light_parts(corner_count: u32) -> u32 {
    return (max(corner_count, 3u) - 2u + PART_CORNERS - 3u) / (PART_CORNERS - 2u);
}

// Corners of a part.
fn part_size(corner_count: u32, part: u32) -> u32 {
    return min(corner_count - part * (PART_CORNERS - 2u), PART_CORNERS);
}

// Index of corner `i` of a part among those of the light.
fn part_corner(part: u32, i: u32) -> u32 {
    return select(part * (PART_CORNERS - 2u) + i, 0u, i == 0u);
}

// Goes on to the next piece, through all faces of a slot; false at the end. Begin with `face` 0 and a closed traversal.
fn next_piece(t: ptr<function, Traversal>, face: ptr<function, u32>, slot: u32) -> bool {
    loop {
        if !traversal_next(t) {
            if *face == FACES {
                return false;
            }
            traversal_enter(t, *face, slots[slot].trees[*face]);
            *face += 1u;
        } else if traversal_is_piece(t) {
            return true;
        } else {
            let word = traversal_word(t);
            traversal_split(t, nodes[word], nodes[word + 1u]);
        }
    }
    return false;
}
