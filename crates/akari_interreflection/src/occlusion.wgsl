#define_import_path akari_interreflection::occlusion

// What opaque meshes hold back of light on its way: segments through a tree of boxes over all of their triangles.

#import akari_math::segment::{segment_box, segment_inverse, segment_triangle}
#import akari_interreflection::types::{BLOCKER_COUNT_BITS, BlockerNode}

// In depth-first order.
@group(1) @binding(0) var<storage, read> blocker_nodes: array<BlockerNode>;
// Three of each triangle, in the order of the leaves.
@group(1) @binding(1) var<storage, read> blocker_corners: array<vec4<f32>>;

// Whether a triangle lies on a segment between two shares of it. The walk of `akari_math::bounds_tree`.
fn held_back(origin: vec3<f32>, segment: vec3<f32>, start: f32, end: f32) -> bool {
    let inverse = segment_inverse(segment);
    let count = arrayLength(&blocker_nodes);
    var index = 0u;
    var triangle = 0u;
    var last = 0u;
    // One loop over nodes and triangles, so that lanes of which some are in a leaf go on together.
    loop {
        if triangle < last {
            let corner = 3u * triangle;
            let share = segment_triangle(
                origin, segment, blocker_corners[corner].xyz, blocker_corners[corner + 1u].xyz,
                blocker_corners[corner + 2u].xyz,
            );
            if share >= start && share <= end {
                return true;
            }
            triangle++;
        } else if index < count {
            let node = blocker_nodes[index];
            if segment_box(origin, inverse, node.low, node.high, start, end) < 0.0 {
                index = node.skip;
            } else {
                index++;
                triangle = node.leaf >> BLOCKER_COUNT_BITS;
                last = triangle + (node.leaf & ((1u << BLOCKER_COUNT_BITS) - 1u));
            }
        } else {
            break;
        }
    }
    return false;
}
