//! The line that splits a cell best.
//!
//! A split is judged by the variance that is left, Σ n p (1 − p) over its two sides with n texels and the share p of
//! them visible (the Gini impurity of Breiman et al. 1984), because it falls with every split that separates anything.
//! The paper's error E counts the texels on the wrong side, and stays level where a line cuts off a strip of a uniform
//! majority: thin gaps are never found.
//!
//! A line costs one table look-up per row: the texels of a row on one side of a line are a run from one end, and prefix
//! sums over each row, made once per face, tell how many of them matter and how many of those are visible. It does not
//! matter how many texels a row has, nor whether the cell still has them all.
//!
//! The search: 16 angles × up to 16 offsets on a dozen rows of the cell, then the best three of the angles are moved
//! end by end, each time by the step that helps most, halving the step until it is a sixteenth of a texel.

use crate::line::{BORDER_STEPS, IntLine, RowCrossings, UNIT_STEPS};
use crate::mask::FaceMask;

/// Angles of the coarse search.
const ANGLES: u32 = 16;
/// Most offsets of the coarse search, for each angle.
const OFFSETS: usize = 16;
/// Rows of the cell in the coarse search.
const COARSE_ROWS: usize = 12;
/// Angles whose best line is refined.
const STARTS: usize = 3;
/// Finest step of the refinement: this share of a texel.
const FINEST: u32 = 16;

/// Position of the count of visible texels in a sum; that of texels that matter is below it. 256² texels overflow by
/// one, where a line has all of a face on one side and is refused anyway.
const HIGH: u32 = 16;

/// Texels that matter, and how many of them are visible.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) texels: u32,
    pub(crate) visible: u32,
}

impl Counts {
    fn from_sum(sum: u32) -> Self {
        Self {
            texels: sum & ((1 << HIGH) - 1),
            visible: sum >> HIGH,
        }
    }

    fn add(&mut self, other: Self) {
        self.texels += other.texels;
        self.visible += other.visible;
    }
}

/// Prefix sums over the rows of a face.
#[derive(Debug, Default)]
pub(crate) struct Table {
    pub(crate) size: u32,
    /// `size + 1` sums for each row.
    sums: Vec<u32>,
}

/// A convex set of texels: a run of each row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cell {
    /// Row of the first run.
    y0: usize,
    /// First column, and the one after the last; equal where the row has no texel that matters.
    runs: Vec<(u32, u32)>,
    pub(crate) counts: Counts,
}

impl Table {
    pub(crate) fn load(&mut self, mask: &FaceMask) {
        self.size = mask.size();
        self.sums.clear();
        for y in 0..self.size {
            let (cared, visible) = mask.row(y);
            let mut sum = 0_u32;
            self.sums.push(0);
            for (&cared, &visible) in cared.iter().zip(visible) {
                for x in 0..self.size.min(u64::BITS) {
                    sum += (cared >> x & 1) as u32 | ((visible >> x & 1) as u32) << HIGH;
                    self.sums.push(sum);
                }
            }
        }
    }

    fn width(&self) -> usize {
        self.size as usize + 1
    }

    fn run(&self, y: usize, (low, high): (u32, u32)) -> u32 {
        let row = &self.sums[y * self.width()..];
        row[high as usize] - row[low as usize]
    }

    /// Makes `cell` the whole face.
    pub(crate) fn whole(&self, cell: &mut Cell) {
        cell.y0 = 0;
        cell.counts = Counts::default();
        cell.runs.clear();
        cell.runs
            .extend(std::iter::repeat_n((0, self.size), self.size as usize));
        for y in 0..self.size as usize {
            cell.counts.add(Counts::from_sum(self.run(y, (0, self.size))));
        }
        self.trim(cell);
    }

    /// Leaves out rows without texels that matter.
    fn trim(&self, cell: &mut Cell) {
        let mut first = None;
        let mut end = 0;
        for (k, run) in cell.runs.iter_mut().enumerate() {
            let holds = run.0 < run.1 && Counts::from_sum(self.run(cell.y0 + k, *run)).texels > 0;
            if holds {
                first.get_or_insert(k);
                end = k + 1;
            } else {
                run.1 = run.0;
            }
        }
        cell.runs.truncate(end);
        let first = first.unwrap_or(0);
        cell.runs.drain(..first);
        cell.y0 += first;
    }

    /// The parts of a cell on the negative and on the positive side of a line.
    pub(crate) fn cut(&self, cell: &Cell, line: &IntLine, sides: [&mut Cell; 2]) {
        let crossings = line.crossings(self.size);
        let [negative, positive] = sides;
        let (low, high) = if crossings.negative_low {
            (negative, positive)
        } else {
            (positive, negative)
        };
        for side in [&mut *low, &mut *high] {
            side.y0 = cell.y0;
            side.counts = Counts::default();
            side.runs.clear();
        }
        for (k, &(l, h)) in cell.runs.iter().enumerate() {
            let y = cell.y0 + k;
            let c = crossings.column(y as f64, f64::from(l), f64::from(h));
            for (side, run) in [(&mut *low, (l, c)), (&mut *high, (c, h))] {
                side.runs.push(run);
                side.counts.add(Counts::from_sum(self.run(y, run)));
            }
        }
        self.trim(low);
        self.trim(high);
    }
}

/// A row of a cell, as the evaluation of lines wants it.
#[derive(Clone, Copy, Debug)]
struct Row {
    y: f64,
    low: f64,
    high: f64,
    /// Where it begins in the table.
    at: usize,
}

/// Rows of a cell.
#[derive(Debug, Default)]
struct Rows {
    rows: Vec<Row>,
    /// Of the sums at the low ends.
    base: u32,
    all: Counts,
}

impl Rows {
    /// Lists the rows of a cell, `stride` apart.
    fn gather(&mut self, table: &Table, cell: &Cell, stride: usize) {
        self.rows.clear();
        let (mut base, mut all) = (0_u32, 0_u32);
        let first = cell.runs.len().saturating_sub(1) % stride / 2;
        for (k, &(low, high)) in cell.runs.iter().enumerate().skip(first).step_by(stride) {
            if low == high {
                continue;
            }
            let y = cell.y0 + k;
            let at = y * table.width();
            base = base.wrapping_add(table.sums[at + low as usize]);
            all = all.wrapping_add(table.run(y, (low, high)));
            self.rows.push(Row {
                y: y as f64,
                low: f64::from(low),
                high: f64::from(high),
                at,
            });
        }
        self.base = base;
        self.all = Counts::from_sum(all);
    }

    /// Variance that a line leaves which has `sum` at its crossings; lower is better.
    #[inline(always)]
    fn left_by(&self, sum: u32) -> f64 {
        let counts = Counts::from_sum(sum.wrapping_sub(self.base));
        if counts.texels == 0 || counts.texels == self.all.texels {
            return f64::INFINITY;
        }
        let part = |n: u32, v: u32| {
            let (n, v) = (f64::from(n), f64::from(v));
            v - v * v / n
        };
        part(counts.texels, counts.visible)
            + part(
                self.all.texels - counts.texels,
                self.all.visible - counts.visible,
            )
    }
}

/// A line of the coarse search.
#[derive(Clone, Copy)]
struct Start {
    left: f64,
    angle: f64,
    offset: f64,
    step: f64,
}

/// Searches splits. Its memory is kept from cell to cell.
#[derive(Debug, Default)]
pub(crate) struct Search {
    rows: Rows,
    coarse: Rows,
    /// Lines that were evaluated.
    pub(crate) lines: u64,
}

impl Search {
    /// The best line found, if any line has texels on both of its sides.
    pub(crate) fn best(&mut self, table: &Table, cell: &Cell) -> Option<IntLine> {
        self.rows.gather(table, cell, 1);
        let stride = cell.runs.len().div_ceil(COARSE_ROWS).max(1);
        self.coarse.gather(table, cell, stride);
        let mut best: Option<(f64, IntLine)> = None;
        for start in self.starts(table, cell) {
            if start.left == f64::INFINITY {
                break;
            }
            let line = IntLine::ends_of(start.angle, start.offset).and_then(IntLine::new);
            let Some(line) = line else { continue };
            let (left, line) = self.refine(table, line, start.step);
            if left < best.map_or(f64::INFINITY, |b| b.0) {
                best = Some((left, line));
            }
            if left == 0.0 {
                break;
            }
        }
        best.map(|(_, line)| line)
    }

    /// The best lines on a grid of angles and offsets, best first.
    fn starts(&mut self, table: &Table, cell: &Cell) -> [Start; STARTS] {
        let texel = 2.0 / f64::from(table.size);
        let centre = |i: f64| (i + 0.5) * texel - 1.0;
        let mut best = [Start {
            left: f64::INFINITY,
            angle: 0.0,
            offset: 0.0,
            step: 0.0,
        }; STARTS];
        let rows = &self.coarse;
        for k in 0..ANGLES {
            // Not along the axes themselves, where the crossings jump.
            let angle = (f64::from(k) + 0.5) * std::f64::consts::PI / f64::from(ANGLES);
            let (sin, cos) = angle.sin_cos();
            // How far the texels of the cell reach along the normal.
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for (j, &(l, h)) in cell.runs.iter().enumerate() {
                if l < h {
                    let s = sin * centre((cell.y0 + j) as f64);
                    let a = s + cos * centre(f64::from(l));
                    let b = s + cos * centre(f64::from(h - 1));
                    low = low.min(a.min(b));
                    high = high.max(a.max(b));
                }
            }
            let count = ((high - low) / texel).ceil().clamp(2.0, OFFSETS as f64);
            let step = (high - low) / count;
            let count = count as usize;
            let first = RowCrossings::new(cos, sin, -(low + 0.5 * step), table.size);
            let shift = step / cos / texel;
            let mut sums = [0_u32; OFFSETS];
            for row in &rows.rows {
                let mut t = first.at(row.y);
                for sum in &mut sums[..count] {
                    let c = RowCrossings::column_of(t, row.low, row.high);
                    *sum = sum.wrapping_add(table.sums[row.at + c as usize]);
                    t += shift;
                }
            }
            self.lines += count as u64;
            let mut here = Start {
                left: f64::INFINITY,
                angle,
                offset: 0.0,
                step,
            };
            for (i, &sum) in sums[..count].iter().enumerate() {
                let left = rows.left_by(sum);
                if left < here.left {
                    here.left = left;
                    here.offset = low + (i as f64 + 0.5) * step;
                }
            }
            if here.left < best[STARTS - 1].left {
                best[STARTS - 1] = here;
                best.sort_by(|a, b| a.left.total_cmp(&b.left));
            }
        }
        best
    }

    fn evaluate(&mut self, table: &Table, line: &IntLine) -> f64 {
        self.lines += 1;
        let crossings = line.crossings(table.size);
        let mut sum = 0_u32;
        for row in &self.rows.rows {
            let c = crossings.column(row.y, row.low, row.high);
            sum = sum.wrapping_add(table.sums[row.at + c as usize]);
        }
        self.rows.left_by(sum)
    }

    /// Moves the ends of a line as long as that helps. `step` in units of the face.
    fn refine(&mut self, table: &Table, mut line: IntLine, step: f64) -> (f64, IntLine) {
        /// One end, both the same way (a turn, mostly), both in opposite ways (a shift).
        const MOVES: [[i32; 2]; 8] = [
            [1, 0],
            [-1, 0],
            [0, 1],
            [0, -1],
            [1, 1],
            [-1, -1],
            [1, -1],
            [-1, 1],
        ];
        let finest = (2 * UNIT_STEPS / table.size / FINEST).max(1) as i32;
        let mut here = self.evaluate(table, &line);
        let mut step = ((0.5 * step * f64::from(UNIT_STEPS)) as i32).max(finest);
        while step >= finest && here > 0.0 {
            let mut moved = None;
            for by in MOVES {
                let shift = |end: u32, by: i32| {
                    (end as i32 + by * step).rem_euclid(BORDER_STEPS as i32) as u32
                };
                let [p, q] = line.ends();
                let Some(candidate) = IntLine::new([shift(p, by[0]), shift(q, by[1])]) else {
                    continue;
                };
                let left = self.evaluate(table, &candidate);
                if left < here {
                    here = left;
                    moved = Some(candidate);
                }
            }
            match moved {
                Some(candidate) => line = candidate,
                None => step /= 2,
            }
        }
        (here, line)
    }
}
