//! Which bricks the levels hold, and which have to be made: the logic of the scrolling clipmap, without a GPU.
//!
//! Cascade c holds a cube of bricks around the camera. When the camera moves, the cube moves by whole bricks: the bricks
//! that stay keep their slots and their content, those that enter are released and, if there is something in them,
//! wait to be made. What changes in the scene makes the bricks wait that it touches; they keep their old content until
//! then. Each frame makes some of those that wait: first the changed, then the entered ones, nearest first, but none
//! waits for ever; never more than a cap.

use crate::types::{
    GpuDirtyBrick, GpuVoxelClipmap, GpuVoxelLevel, MOST_CASCADES, MOST_LEVELS, SMALLEST_TAIL,
};
use akari_math::voxel::brick::{BRICK_EDGE, brick_slot};
use bevy::math::{DVec3, IVec3};

/// Frames over which the bricks that enter at once are spread, so that a camera flight costs the same in each frame.
const SPREAD_FRAMES: usize = 32;
/// Frames of waiting that bring a brick as much as half of its distance.
const AGE_FRAMES: f64 = 8.0;
/// Bricks that are made at least while any wait.
const LEAST_BRICKS: usize = 8;
/// Bricks of the first tail that are made at least in a frame, of those beside which others entered or left: what they
/// hold meanwhile is still so, or is not made yet either.
const LEAST_TAILS: usize = 2;
/// How far, in bricks, the camera may leave the middle before the cube follows: more than half a brick, so that it does
/// not scroll to and fro.
const SLACK: f64 = 0.75;
/// Bricks from the world's origin beyond which nothing is voxelized: their numbers stay exact in 32 bits at each level.
const FARTHEST_BRICK: f64 = 1e8;

/// Sizes of a clipmap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClipmapShape {
    /// Voxels along each axis of a cascade: 32, 64, 128 or 256.
    pub resolution: u32,
    /// Number of cascades, 1 to [`MOST_CASCADES`].
    pub cascades: u32,
    /// Edge of a voxel of the first cascade, metres.
    pub voxel_size: f32,
}

impl ClipmapShape {
    /// The nearest shape that is possible.
    pub fn new(resolution: u32, cascades: u32, voxel_size: f32) -> Self {
        /// Metres: no scene needs less.
        const SMALLEST: f32 = 1e-4;
        const LARGEST: f32 = 1e4;
        Self {
            resolution: resolution.clamp(32, 256).next_power_of_two(),
            cascades: cascades.clamp(1, MOST_CASCADES),
            voxel_size: if voxel_size.is_finite() {
                voxel_size.clamp(SMALLEST, LARGEST)
            } else {
                1.0
            },
        }
    }

    /// Number of levels, tails included.
    pub fn levels(&self) -> u32 {
        self.cascades + (self.resolution / SMALLEST_TAIL).ilog2()
    }

    /// Bricks along each axis of a level.
    pub fn bricks(&self, level: u32) -> u32 {
        let halvings = (level + 1).saturating_sub(self.cascades);
        (self.resolution / BRICK_EDGE) >> halvings
    }

    /// Edge of a voxel of a level, metres.
    pub fn voxel_size(&self, level: u32) -> f64 {
        f64::from(self.voxel_size) * f64::from(1_u32 << level)
    }

    /// Edge of a brick of a level, metres.
    pub fn brick_size(&self, level: u32) -> f64 {
        self.voxel_size(level) * f64::from(BRICK_EDGE)
    }

    /// Slot of the first brick of a level.
    pub fn first_slot(&self, level: u32) -> u32 {
        (0..level).map(|finer| self.bricks(finer).pow(3)).sum()
    }

    /// Bricks of all levels together.
    pub fn slots(&self) -> u32 {
        self.first_slot(self.levels())
    }
}

/// A box of bricks of a level, `high` excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BrickBox {
    /// First brick.
    pub low: IVec3,
    /// One beyond the last.
    pub high: IVec3,
}

impl BrickBox {
    fn cube(origin: IVec3, bricks: u32) -> Self {
        Self {
            low: origin,
            high: origin + IVec3::splat(bricks as i32),
        }
    }

    /// What both hold.
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            low: self.low.max(other.low),
            high: self.high.min(other.high),
        }
    }

    /// Whether there is no brick in it.
    pub fn is_empty(&self) -> bool {
        self.low.cmpge(self.high).any()
    }

    /// Whether it holds a brick.
    pub fn contains(&self, brick: IVec3) -> bool {
        brick.cmpge(self.low).all() && brick.cmplt(self.high).all()
    }

    /// All bricks in it.
    pub fn iter(&self) -> impl Iterator<Item = IVec3> + use<> {
        let (low, high) = (self.low, self.high);
        (low.z..high.z).flat_map(move |z| {
            (low.y..high.y).flat_map(move |y| (low.x..high.x).map(move |x| IVec3::new(x, y, z)))
        })
    }

    /// Up to three boxes that hold what this one holds and `other` does not.
    fn minus(&self, other: &Self) -> Vec<Self> {
        let shared = self.intersection(other);
        if shared.is_empty() {
            return vec![*self];
        }
        let mut rest = *self;
        let mut parts = Vec::new();
        for axis in 0..3 {
            let mut below = rest;
            below.high[axis] = shared.low[axis];
            let mut above = rest;
            above.low[axis] = shared.high[axis];
            parts.extend([below, above].into_iter().filter(|part| !part.is_empty()));
            rest.low[axis] = shared.low[axis];
            rest.high[axis] = shared.high[axis];
        }
        parts
    }
}

/// Bricks that entered a cascade.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entered {
    /// The cascade.
    pub cascade: u32,
    /// The bricks.
    pub bricks: BrickBox,
    /// Whether the whole cascade is new: the camera has arrived from elsewhere, and nothing is spread over frames.
    pub arrived: bool,
}

/// State of the brick in a slot of a cascade.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Waiting {
    /// Frame since which it waits to be made, or 0 if it does not.
    since: u32,
    /// Whether it shows what is no longer so.
    urgent: bool,
    /// Whether it entered during a flight, and may be made in any of the next frames.
    spread: bool,
}

/// What the GPU has to do in a frame.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Work {
    /// Slots to release, with whether something will be made there later (and a coarser level is to be asked).
    pub released: Vec<(u32, bool)>,
    /// Bricks of cascades to make from triangles.
    pub made: Vec<GpuDirtyBrick>,
    /// Bricks of the tails to make from the level below, level after level.
    pub tails: Vec<Vec<GpuDirtyBrick>>,
    /// Bricks that still wait.
    pub waiting: usize,
}

impl Work {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.released.is_empty() && self.made.is_empty() && self.tails.iter().all(Vec::is_empty)
    }
}

/// The clipmap.
#[derive(Debug, Clone)]
pub struct Clipmap {
    shape: ClipmapShape,
    origins: Vec<IVec3>,
    /// Slot of the first brick of each level.
    first_slots: Vec<u32>,
    camera: DVec3,
    placed: bool,
    frame: u32,
    /// By slot, for the cascades.
    waiting: Vec<Waiting>,
    /// Slots that wait, each once.
    queue: Vec<u32>,
    released: Vec<u32>,
    tail_released: Vec<u32>,
    tail_dirty: Vec<IVec3>,
    /// As `tail_dirty`, but not before its turn.
    tail_scrolled: Vec<IVec3>,
}

impl Clipmap {
    /// A clipmap that holds nothing yet.
    pub fn new(shape: ClipmapShape) -> Self {
        Self {
            shape,
            origins: vec![IVec3::ZERO; shape.levels() as usize],
            first_slots: (0..shape.levels())
                .map(|level| shape.first_slot(level))
                .collect(),
            camera: DVec3::ZERO,
            placed: false,
            frame: 1,
            waiting: vec![Waiting::default(); shape.first_slot(shape.cascades) as usize],
            queue: Vec::new(),
            released: Vec::new(),
            tail_released: Vec::new(),
            tail_dirty: Vec::new(),
            tail_scrolled: Vec::new(),
        }
    }

    /// Its sizes.
    pub fn shape(&self) -> &ClipmapShape {
        &self.shape
    }

    /// First brick of a level.
    pub fn origin(&self, level: u32) -> IVec3 {
        self.origins[level as usize]
    }

    /// The bricks that a level holds.
    pub fn held(&self, level: u32) -> BrickBox {
        BrickBox::cube(self.origin(level), self.shape.bricks(level))
    }

    /// Slot of a brick that a level holds.
    pub fn slot(&self, level: u32, brick: IVec3) -> u32 {
        let first = self.first_slots[level as usize];
        first + brick_slot(brick, self.shape.bricks(level))
    }

    /// Moves with the camera (a position in the world, metres). Returns the bricks that entered; whoever knows what is in
    /// them says so by [`Self::touch`].
    pub fn follow(&mut self, camera: DVec3) -> Vec<Entered> {
        if !camera.is_finite() {
            return Vec::new();
        }
        self.camera = camera;
        let first = !self.placed;
        self.placed = true;
        let mut entered = Vec::new();
        let last = self.shape.cascades - 1;
        for cascade in 0..=last {
            let bricks = self.shape.bricks(cascade);
            let half = f64::from(bricks / 2);
            let place = (camera / self.shape.brick_size(cascade))
                .clamp(DVec3::splat(-FARTHEST_BRICK), DVec3::splat(FARTHEST_BRICK));
            let old = self.held(cascade);
            let middle = old.low.as_dvec3() + half;
            if !first && (place - middle).abs().max_element() <= SLACK {
                continue;
            }
            let origin = (place - half).round().as_ivec3();
            if !first && origin == old.low {
                continue;
            }
            self.origins[cascade as usize] = origin;
            let new = self.held(cascade);
            let fresh = if first { vec![new] } else { new.minus(&old) };
            for &part in &fresh {
                for brick in part.iter() {
                    let slot = self.slot(cascade, brick);
                    self.released.push(slot);
                    // What waited in this slot has left.
                    self.waiting[slot as usize].since = 0;
                }
            }
            let arrived = fresh.contains(&new);
            entered.extend(fresh.iter().map(|&bricks| Entered {
                cascade,
                bricks,
                arrived,
            }));
            if cascade == last {
                self.scroll_tails(first, &old, &fresh);
            }
        }
        // Slots whose brick left while it waited are in the queue without a reason.
        let waiting = &self.waiting;
        self.queue.retain(|&slot| waiting[slot as usize].since != 0);
        entered
    }

    /// Moves the tails after the last cascade, which went from `old` and where `fresh` entered.
    fn scroll_tails(&mut self, first: bool, old: &BrickBox, fresh: &[BrickBox]) {
        let last = self.shape.cascades - 1;
        for level in last + 1..self.shape.levels() {
            let before = self.held(level);
            self.origins[level as usize] =
                self.origins[level as usize - 1].div_euclid(IVec3::splat(2));
            let after = self.held(level);
            let parts = if first {
                vec![after]
            } else {
                after.minus(&before)
            };
            for part in parts {
                for brick in part.iter() {
                    let slot = self.slot(level, brick);
                    self.tail_released.push(slot);
                }
            }
        }
        // All that entered or left changes what the tails are made of.
        let left = if first {
            Vec::new()
        } else {
            old.minus(&self.held(last))
        };
        for part in fresh.iter().chain(&left) {
            let parents = BrickBox {
                low: part.low.div_euclid(IVec3::splat(2)),
                high: (part.high - 1).div_euclid(IVec3::splat(2)) + 1,
            };
            self.tail_scrolled.extend(parents.iter());
        }
        let held = self.held(last + 1);
        self.tail_scrolled.retain(|&brick| held.contains(brick));
        self.tail_scrolled
            .sort_unstable_by_key(|brick| brick.to_array());
        self.tail_scrolled.dedup();
        if first {
            self.tail_dirty.append(&mut self.tail_scrolled);
        }
    }

    /// All bricks of the cascades, as if they had entered: for whoever has lost track of what they hold.
    pub fn everything(&self) -> Vec<Entered> {
        (0..self.shape.cascades)
            .map(|cascade| Entered {
                cascade,
                bricks: self.held(cascade),
                arrived: false,
            })
            .collect()
    }

    /// The bricks of a level that a box of the world (metres) reaches, of those that the level holds.
    pub fn reached(&self, level: u32, low: DVec3, high: DVec3) -> BrickBox {
        let size = self.shape.brick_size(level);
        // A triangle is shifted by less than this before it is voxelized, and rounded.
        let margin = DVec3::splat(self.shape.voxel_size(level) * 1e-2);
        let limit = DVec3::splat(FARTHEST_BRICK);
        let brick = |p: DVec3| (p / size).floor().clamp(-limit, limit).as_ivec3();
        let all = BrickBox {
            low: brick(low - margin),
            high: brick(high + margin) + 1,
        };
        all.intersection(&self.held(level))
    }

    /// Something in a box of the world (metres) has changed: makes the bricks that it reaches wait.
    pub fn touch(&mut self, low: DVec3, high: DVec3) {
        self.touch_within(low, high, None);
    }

    /// Something is in a box of the world (metres): makes the bricks that it reaches wait, of those that entered.
    pub fn fill(&mut self, low: DVec3, high: DVec3, entered: &Entered) {
        self.touch_within(low, high, Some(entered));
    }

    fn touch_within(&mut self, low: DVec3, high: DVec3, entered: Option<&Entered>) {
        if !(low.is_finite() && high.is_finite()) {
            return;
        }
        let cascades = entered.map_or(0..self.shape.cascades, |entered| {
            entered.cascade..entered.cascade + 1
        });
        for cascade in cascades {
            let mut reached = self.reached(cascade, low, high);
            if let Some(entered) = entered {
                reached = reached.intersection(&entered.bricks);
            }
            for brick in reached.iter() {
                let slot = self.slot(cascade, brick);
                let waiting = &mut self.waiting[slot as usize];
                if waiting.since == 0 {
                    *waiting = Waiting {
                        since: self.frame,
                        urgent: false,
                        spread: entered.is_some_and(|entered| !entered.arrived),
                    };
                    self.queue.push(slot);
                }
                if entered.is_none() {
                    (waiting.urgent, waiting.spread) = (true, false);
                }
            }
        }
    }

    /// Brick, and index of its cascade, in a slot of a cascade.
    fn brick_of(&self, slot: u32) -> GpuDirtyBrick {
        // The cascades, whose slots alone wait, have the same number of bricks.
        let per_cascade = self.shape.bricks(0).pow(3);
        let level = slot / per_cascade;
        let within = slot % per_cascade;
        let bricks = self.shape.bricks(level);
        GpuDirtyBrick {
            brick: akari_math::voxel::brick::brick_of_slot(within, self.origin(level), bricks),
            level,
        }
    }

    /// Takes the work of a frame: no more than `cap` bricks of the cascades.
    pub fn take(&mut self, cap: u32) -> Work {
        let cap = cap.max(1) as usize;
        let spread = self
            .queue
            .iter()
            .filter(|&&slot| self.waiting[slot as usize].spread)
            .count();
        let share = spread.div_ceil(SPREAD_FRAMES).max(LEAST_BRICKS);
        let count = (self.queue.len() - spread + share)
            .min(cap)
            .min(self.queue.len());
        let mut queue = std::mem::take(&mut self.queue);
        if count < queue.len() && count > 0 {
            let mut ranked: Vec<(u32, u32)> = queue
                .iter()
                .map(|&slot| (self.urgency(slot), slot))
                .collect();
            ranked.select_nth_unstable(count - 1);
            queue = ranked.into_iter().map(|(_, slot)| slot).collect();
        }
        let rest = queue.split_off(count);
        let mut work = Work::default();
        let last = self.shape.cascades - 1;
        for &slot in &queue {
            self.waiting[slot as usize].since = 0;
            let brick = self.brick_of(slot);
            if brick.level == last {
                self.tail_dirty
                    .push(brick.brick.div_euclid(IVec3::splat(2)));
            }
            work.made.push(brick);
        }
        self.queue = rest;
        // In the order of memory, so that a frame is the same whatever the queue's order was.
        work.made
            .sort_unstable_by_key(|brick| (brick.level, brick.brick.to_array()));
        let waiting = &self.waiting;
        work.released = self
            .released
            .drain(..)
            .map(|slot| (slot, waiting[slot as usize].since != 0))
            .chain(self.tail_released.drain(..).map(|slot| (slot, false)))
            .collect();
        work.tails = self.take_tails();
        work.waiting = self.queue.len();
        self.frame = self.frame.wrapping_add(1).max(1);
        work
    }

    /// Bricks of the tails above what was made or scrolled.
    fn take_tails(&mut self) -> Vec<Vec<GpuDirtyBrick>> {
        let mut dirty = std::mem::take(&mut self.tail_dirty);
        let share = self.tail_scrolled.len().div_ceil(SPREAD_FRAMES);
        let rest = self
            .tail_scrolled
            .len()
            .saturating_sub(share.max(LEAST_TAILS));
        dirty.extend(self.tail_scrolled.drain(rest..));
        let mut tails = Vec::new();
        for level in self.shape.cascades..self.shape.levels() {
            let held = self.held(level);
            dirty.sort_unstable_by_key(|brick| brick.to_array());
            dirty.dedup();
            dirty.retain(|&brick| held.contains(brick));
            tails.push(
                dirty
                    .iter()
                    .map(|&brick| GpuDirtyBrick { brick, level })
                    .collect(),
            );
            for brick in &mut dirty {
                *brick = brick.div_euclid(IVec3::splat(2));
            }
        }
        tails
    }

    /// What is made first has less of it: changed content before entered, near before far, long waits before short.
    fn urgency(&self, slot: u32) -> u32 {
        let waiting = self.waiting[slot as usize];
        let brick = self.brick_of(slot);
        let size = self.shape.brick_size(brick.level);
        let middle = (brick.brick.as_dvec3() + 0.5) * size;
        // In bricks of its own: a coarse cascade is as urgent as a fine one at the same place in its cube.
        let distance = middle.distance(self.camera) / size;
        let age = f64::from(self.frame.wrapping_sub(waiting.since));
        /// Steps of the distance that are told apart.
        const STEPS: f64 = 256.0;
        let mut urgency = distance / (1.0 + age / AGE_FRAMES) * STEPS;
        if !waiting.urgent {
            /// Bricks of distance by which entered content stands behind changed content.
            const BEHIND: f64 = 64.0;
            urgency += BEHIND * STEPS / (1.0 + age / AGE_FRAMES);
        }
        urgency as u32
    }

    /// The clipmap as shaders read it, for a pool of `pages`.
    pub fn uniform(&self, pages: u32) -> GpuVoxelClipmap {
        let mut uniform = GpuVoxelClipmap {
            levels: [GpuVoxelLevel::default(); MOST_LEVELS as usize],
            cascades: self.shape.cascades,
            level_count: self.shape.levels(),
            slots: self.shape.slots(),
            pages,
        };
        for (level, target) in (0..self.shape.levels()).zip(&mut uniform.levels) {
            let corner = self.origin(level).as_dvec3() * self.shape.brick_size(level);
            *target = GpuVoxelLevel {
                anchor: (self.camera - corner).as_vec3(),
                voxel_size: self.shape.voxel_size(level) as f32,
                origin: self.origin(level),
                bricks: self.shape.bricks(level),
                first_slot: self.shape.first_slot(level),
                finer: if level < self.shape.cascades {
                    level
                } else {
                    level - 1
                },
                pad_a: 0,
                pad_b: 0,
            };
        }
        uniform
    }

    /// The camera's position, metres.
    pub fn camera(&self) -> DVec3 {
        self.camera
    }
}

#[cfg(test)]
#[path = "clipmap_tests.rs"]
mod tests;
