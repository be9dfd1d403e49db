//! Which texels of a cube face see the sky: exact coverage of the triangles, one ray per texel's centre.
//!
//! The rays of a face share their origin, so the triangles are projected instead. A texel with the direction
//! `d = a·right + b·up + forward` is covered by the triangle ABC (relative to the origin) iff `d·(A×B)`, `d·(B×C)` and
//! `d·(C×A)` all have the sign of `A·(B×C)`: this is the ray–triangle test of Plücker coordinates, it holds for
//! triangles that reach behind the face without clipping, and it is watertight, because both triangles at an edge
//! compute the same plane `±(A×B)` with the same roundings. A centre exactly on an edge is covered. All of it in `f64`
//! from `f32` vertices; there is no other arithmetic on the way to a bit, so the traversal (which boxes are looked at,
//! in which order, on how many threads) cannot change it.
//!
//! What is left open of a face is a mask of rows. Boxes are visited from near to far, and one whose projection holds no
//! open texel is not entered: hidden geometry and triangles between the texels' centres cost nothing. This is the
//! hierarchical visibility of Greene, Kass and Miller 1993, with the mask as the depth buffer: one bit is enough where
//! any hit will do.

use glam::{DVec3, Vec4};

use crate::bvh::{Accept, Bvh, Child, LeafTriangle, Node, WIDTH};
use crate::cube::FACES;

/// Side of a tile of texels: a row is a word.
pub(crate) const TILE: usize = 64;

/// A tile of a face: bit `x` of row `y`.
pub(crate) type Tile = [u64; TILE];

/// Deepest stack of the traversal. PLOC trees of 10⁸ triangles are below 100 levels deep; a deeper one falls back to
/// the heap.
const STACK: usize = 128;

/// Slack of projected boxes in texels: their `f32` projection is off by less than 1e-4 texels of the largest face.
const RECT_SLACK: f32 = 2e-3;

/// Added to a number of small size, leaves its nearest whole number in the low bits (2^23).
const ROUND: f32 = 8_388_608.0;

/// Stands for 1/0 where a box reaches behind the face.
const HUGE: f32 = 1e30;

/// Where rays start and what of them counts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Origin {
    /// In the frame of the BVH.
    pub(crate) position: DVec3,
    /// Hits nearer than this do not count, metres.
    pub(crate) tmin: f64,
    /// Hits farther than this do not count, metres.
    pub(crate) tmax: f64,
}

/// The part of a face that a tile holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Texels along the side of the face.
    pub(crate) size: u32,
    /// First column of the tile.
    pub(crate) x0: u32,
    /// First row of the tile.
    pub(crate) y0: u32,
}

impl Window {
    /// Columns and rows that the tile has.
    pub(crate) fn extent(self) -> u32 {
        self.size.min(TILE as u32)
    }

    /// `a` of a column, `b` of a row (counted within the tile): centres of texels on the face's plane, in (−1, 1).
    /// Exact, as sizes are powers of two.
    #[inline(always)]
    pub(crate) fn column(self, x: u32) -> f64 {
        f64::from(2 * (self.x0 + x) + 1) / f64::from(self.size) - 1.0
    }

    #[inline(always)]
    pub(crate) fn row(self, y: u32) -> f64 {
        f64::from(2 * (self.y0 + y) + 1) / f64::from(self.size) - 1.0
    }
}

/// A triangle as a face sees it.
pub(crate) struct Projected {
    /// Planes through the origin and the edges opposite to the vertices, in the face's axes; inside is positive.
    edge: [[f64; 3]; 3],
    /// Six times the volume of the tetrahedron with the origin; positive.
    volume: f64,
}

impl Projected {
    /// None where the origin lies in the triangle's plane: it is seen edge-on and covers nothing.
    #[inline(always)]
    pub(crate) fn new<const F: usize>(triangle: &LeafTriangle, origin: DVec3) -> Option<Self> {
        let [a, b, c] = triangle.vertices.map(|v| {
            let relative = [0, 1, 2].map(|k| f64::from(v[k]) - origin[k]);
            FACES[F].to_face(relative)
        });
        let mut edge = [cross(b, c), cross(c, a), cross(a, b)];
        let mut volume = dot(a, edge[0]);
        if volume == 0.0 {
            return None;
        }
        if volume < 0.0 {
            volume = -volume;
            for e in &mut edge {
                *e = e.map(|x| -x);
            }
        }
        Some(Self { edge, volume })
    }

    /// The values of the three edges in a direction; all are ≥ 0 inside.
    #[inline(always)]
    pub(crate) fn edges(&self, a: f64, b: f64) -> [f64; 3] {
        self.edge.map(|e| e[0] * a + (e[1] * b + e[2]))
    }

    /// Whether the ray through `(a, b)` meets the triangle within reach.
    #[inline(always)]
    pub(crate) fn covers(&self, a: f64, b: f64) -> bool {
        let [p, q, r] = self.edges(a, b);
        p >= 0.0 && q >= 0.0 && r >= 0.0
    }

    /// Distance of the hit at `(a, b)` in metres, and barycentric weights of the second and third vertex.
    #[inline(always)]
    pub(crate) fn hit(&self, a: f64, b: f64) -> (f64, f64, f64) {
        let [p, q, r] = self.edges(a, b);
        let inverse = 1.0 / (p + q + r);
        let length = (a * a + b * b + 1.0).sqrt();
        (self.volume * inverse * length, q * inverse, r * inverse)
    }
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Bits `x0..=x1` of a row; `x1 < 64`.
#[inline(always)]
pub(crate) fn span(x0: u32, x1: u32) -> u64 {
    (u64::MAX >> (63 - (x1 - x0))) << x0
}

/// Columns `x` of `x0..=x1` where `slope·column(x) + constant ≥ 0`, as bits, exactly as the expression says for each.
///
/// Rounding is monotone, so the columns are a run that ends at one side: its end is estimated, then looked for.
#[inline(always)]
pub(crate) fn half_line(slope: f64, constant: f64, window: Window, x0: u32, x1: u32) -> u64 {
    let inside = |x: u32| slope * window.column(x) + constant >= 0.0;
    let all = span(x0, x1);
    if slope == 0.0 {
        return if constant >= 0.0 { all } else { 0 };
    }
    // column(x) = (2 (x0 + x) + 1)/size − 1.
    let crossing =
        0.5 * ((1.0 - constant / slope) * f64::from(window.size) - 1.0) - f64::from(window.x0);
    let mut x = crossing.clamp(f64::from(x0), f64::from(x1 + 1)) as u32;
    // `x` becomes the first column beyond the crossing.
    let rising = slope > 0.0;
    while x > x0 && inside(x - 1) == rising {
        x -= 1;
    }
    while x <= x1 && inside(x) != rising {
        x += 1;
    }
    let below = if x == x0 { 0 } else { span(x0, x - 1) };
    if rising { all & !below } else { below }
}

/// Texels `x0..=x1`, `y0..=y1` of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rect {
    pub(crate) x0: u8,
    pub(crate) x1: u8,
    pub(crate) y0: u8,
    pub(crate) y1: u8,
}

impl Rect {
    #[inline(always)]
    fn any_open(&self, open: &Tile) -> bool {
        let columns = span(self.x0.into(), self.x1.into());
        open[self.y0 as usize..=self.y1 as usize]
            .iter()
            .any(|row| row & columns != 0)
    }
}

/// Projects boxes onto a tile, four at a time.
struct Projection {
    position: [Vec4; 3],
    half: Vec4,
    /// Shifts of the low and the high end, x and y.
    low: [Vec4; 2],
    high: [Vec4; 2],
    last: Vec4,
}

/// Rectangles of the boxes of a node.
struct Rects {
    /// x0, x1, y0, y1 in the low bits of the numbers.
    ends: [Vec4; 4],
    /// Bit per child: the rectangle holds a texel.
    hit: u32,
    /// Depths of the boxes' middles along the face's axis, times 2.
    depth: Vec4,
}

impl Projection {
    fn new(origin: DVec3, window: Window) -> Self {
        let half = 0.5 * window.size as f32;
        let shift = |first: u32| half - 0.5 - first as f32;
        let shifts = [shift(window.x0), shift(window.y0)];
        Self {
            position: origin.as_vec3().to_array().map(Vec4::splat),
            half: Vec4::splat(half),
            low: shifts.map(|s| Vec4::splat(s - RECT_SLACK)),
            high: shifts.map(|s| Vec4::splat(s + RECT_SLACK)),
            last: Vec4::splat((window.extent() - 1) as f32),
        }
    }

    /// The texels whose centres the boxes may cover.
    #[inline(always)]
    fn rects<const F: usize>(&self, node: &Node) -> Rects {
        let lo = [0, 1, 2].map(|k| node.min[k] - self.position[k]);
        let hi = [0, 1, 2].map(|k| node.max[k] - self.position[k]);
        let (lo, hi) = FACES[F].box_to_face(lo, hi);
        let front = hi[2].cmpgt(Vec4::ZERO);
        let far = Vec4::ONE / hi[2];
        let near = Vec4::select(
            lo[2].cmpgt(Vec4::ZERO),
            Vec4::ONE / lo[2],
            Vec4::splat(HUGE),
        );
        let least = |v: Vec4| v * Vec4::select(v.cmplt(Vec4::ZERO), near, far) * self.half;
        let most = |v: Vec4| v * Vec4::select(v.cmplt(Vec4::ZERO), far, near) * self.half;
        let x0 = least(lo[0]) + self.low[0];
        let y0 = least(lo[1]) + self.low[1];
        let x1 = most(hi[0]) + self.high[0];
        let y1 = most(hi[1]) + self.high[1];
        // Whole numbers above the low and below the high end, left in the low bits by the addition. The slack makes up
        // for halves, which may be rounded either way.
        let round = Vec4::splat(ROUND);
        let half = Vec4::splat(0.5);
        let up = |v: Vec4| (v + half).max(Vec4::ZERO).min(self.last + Vec4::ONE) + round;
        let down = |v: Vec4| (v - half).min(self.last).max(Vec4::NEG_ONE) + round;
        let (x0, y0) = (up(x0), up(y0));
        let (x1, y1) = (down(x1), down(y1));
        Rects {
            hit: (front & x0.cmple(x1) & y0.cmple(y1)).bitmask(),
            ends: [x0, x1, y0, y1],
            depth: lo[2] + hi[2],
        }
    }
}

impl Rects {
    #[inline(always)]
    fn rect(&self, slot: usize) -> Rect {
        let [x0, x1, y0, y1] = self.ends.map(|e| e[slot].to_bits() as u8);
        Rect { x0, x1, y0, y1 }
    }
}

#[derive(Clone, Copy)]
struct Entry {
    child: Child,
    rect: Rect,
    /// The hits in it may be too near or too far.
    bounded: bool,
}

/// Clears the bits of `open` whose rays hit something. Face `F` of [`FACES`].
pub(crate) fn cover<const F: usize>(
    bvh: &Bvh,
    origin: &Origin,
    window: Window,
    accept: &impl Accept,
    open: &mut Tile,
) {
    if bvh.nodes.is_empty() || open.iter().all(|&row| row == 0) {
        return;
    }
    let projection = Projection::new(origin.position, window);
    let mut stack: Vec<Entry> = Vec::with_capacity(STACK);
    let last = (window.extent() - 1) as u8;
    stack.push(Entry {
        child: Child::ROOT,
        rect: Rect {
            x0: 0,
            x1: last,
            y0: 0,
            y1: last,
        },
        bounded: true,
    });
    while let Some(entry) = stack.pop() {
        if !entry.rect.any_open(open) {
            continue;
        }
        let node = match entry.child.get() {
            Ok(triangle) => {
                draw::<F>(
                    &bvh.triangles[triangle],
                    origin,
                    window,
                    entry,
                    accept,
                    open,
                );
                continue;
            }
            Err(node) => &bvh.nodes[node],
        };
        let rects = projection.rects::<F>(node);
        // Sorted from far to near: the nearest is looked at first.
        let mut found = [(0.0_f32, 0_usize); WIDTH];
        let mut count = 0;
        let mut hits = rects.hit;
        while hits != 0 {
            let slot = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            let depth = rects.depth[slot];
            let mut at = count;
            while at > 0 && found[at - 1].0 < depth {
                found[at] = found[at - 1];
                at -= 1;
            }
            found[at] = (depth, slot);
            count += 1;
        }
        for &(_, slot) in &found[..count] {
            stack.push(Entry {
                child: node.child[slot],
                rect: rects.rect(slot),
                bounded: entry.bounded && may_be_out_of_reach(node, slot, origin),
            });
        }
    }
}

/// Whether some point of the child's box may be nearer than `tmin` or farther than `tmax`, with slack for rounding.
#[inline(always)]
fn may_be_out_of_reach(node: &Node, slot: usize, origin: &Origin) -> bool {
    const SLACK: f64 = 1.01;
    let (mut nearest, mut farthest) = (0.0, 0.0);
    for k in 0..3 {
        let lo = f64::from(node.min[k][slot]) - origin.position[k];
        let hi = f64::from(node.max[k][slot]) - origin.position[k];
        let near = lo.max(-hi).max(0.0);
        let far = hi.max(-lo);
        nearest += near * near;
        farthest += far * far;
    }
    let tmin = SLACK * origin.tmin;
    nearest <= tmin * tmin || farthest * (SLACK * SLACK) >= origin.tmax * origin.tmax
}

#[inline(always)]
fn draw<const F: usize>(
    triangle: &LeafTriangle,
    origin: &Origin,
    window: Window,
    entry: Entry,
    accept: &impl Accept,
    open: &mut Tile,
) {
    /// From this many columns on, the run of a row is found from its ends.
    const WIDE: u32 = 8;
    let [x0, x1, y0, y1] = {
        let r = entry.rect;
        [r.x0, r.x1, r.y0, r.y1].map(u32::from)
    };

    let Some(projected) = Projected::new::<F>(triangle, origin.position) else {
        return;
    };
    let columns = span(x0, x1);
    let by_texel = entry.bounded || triangle.is_cut();
    for y in y0..=y1 {
        let row = &mut open[y as usize];
        let mut candidates = *row & columns;
        if candidates == 0 {
            continue;
        }
        let b = window.row(y);
        if x1 - x0 >= WIDE {
            for e in &projected.edge {
                candidates &= half_line(e[0], e[1] * b + e[2], window, x0, x1);
            }
            if !by_texel {
                *row &= !candidates;
                continue;
            }
        }
        while candidates != 0 {
            let x = candidates.trailing_zeros();
            candidates &= candidates - 1;
            let a = window.column(x);
            if projected.covers(a, b)
                && (!by_texel || counts(&projected, a, b, triangle, origin, accept))
            {
                *row &= !(1 << x);
            }
        }
    }
}

/// Whether a hit is within reach and not cut out by alpha.
#[inline(never)]
pub(crate) fn counts(
    projected: &Projected,
    a: f64,
    b: f64,
    triangle: &LeafTriangle,
    origin: &Origin,
    accept: &impl Accept,
) -> bool {
    let (t, u, v) = projected.hit(a, b);
    t > origin.tmin && t < origin.tmax && triangle.covers(accept, u, v)
}

#[cfg(test)]
mod tests;
