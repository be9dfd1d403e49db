//! The line that splits a cell best.
//!
//! A split is judged by Σ √(b v) over its two sides with b blocked and v visible texels: the impurity that makes small
//! trees (Kearns and Mansour 1996, "On the boosting ability of top-down decision tree learning algorithms"). It falls
//! with every split that separates anything, as the variance Σ b v/(b + v) does (Gini, Breiman et al. 1984), and favours
//! pure sides more: measured, 15 % fewer leaves than by the variance at a third less error. The paper's error E counts
//! the texels on the wrong side, and stays level where a line cuts off a strip of a uniform majority: thin gaps are
//! never found.
//!
//! A line costs one table look-up per row: the texels of a row on one side of a line are a run from one end, and prefix
//! sums over each row, made once per face, tell how many of them are blocked and how many visible. It does not matter
//! how many texels a row has, nor how many of them matter.
//!
//! Where one line separates what is visible from what is blocked, it is computed ([`crate::separate`]). Else it is
//! searched: 16 angles × 6 offsets on some rows of the cell, then the best lines of the best six angles are moved
//! end by end, with steps down to a sixteenth of a texel. Measured: finding more starts from a coarser grid and refining
//! all of them gives smaller trees than a finer grid, for the same number of lines.

use glam::DVec2;

use crate::line::{BORDER_STEPS, IntLine, RowCrossings, UNIT_STEPS};
use crate::mask::FaceMask;
use crate::separate::separate;

/// Angles of the coarse search.
const ANGLES: u32 = 16;
/// Most offsets of the coarse search, for each angle.
const OFFSETS: usize = 6;
/// Rows of the cell in the coarse search, at most.
const COARSE_ROWS: usize = 16;
/// Angles whose best line is refined.
const STARTS: usize = 6;
/// Finest step of the refinement: this share of a texel.
const FINEST: u32 = 16;

/// Position of the count of visible texels in a sum; that of blocked ones is below it. Only 256² texels of one kind
/// would be too many, but a cell of one kind is not split.
const HIGH: u32 = 16;

/// Texels that matter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) blocked: u32,
    pub(crate) visible: u32,
}

impl Counts {
    fn from_sum(sum: u32) -> Self {
        Self {
            blocked: sum & ((1 << HIGH) - 1),
            visible: sum >> HIGH,
        }
    }

    fn add(&mut self, other: Self) {
        self.blocked += other.blocked;
        self.visible += other.visible;
    }

    pub(crate) fn texels(self) -> u32 {
        self.blocked + self.visible
    }
}

/// Prefix sums over the rows of a face.
#[derive(Debug, Default)]
pub(crate) struct Table {
    pub(crate) size: u32,
    /// `size + 1` sums for each row.
    sums: Vec<u32>,
    /// Words of each row: visible and blocked texels.
    bits: Vec<[u64; 2]>,
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
        self.bits.clear();
        for y in 0..self.size {
            let (cared, visible) = mask.row(y);
            let mut sum = 0_u32;
            self.sums.push(0);
            for (&cared, &visible) in cared.iter().zip(visible) {
                let blocked = cared & !visible;
                self.bits.push([visible, blocked]);
                for x in 0..self.size.min(u64::BITS) {
                    sum += (blocked >> x & 1) as u32 | ((visible >> x & 1) as u32) << HIGH;
                    self.sums.push(sum);
                }
            }
        }
    }

    /// First and last texel of a kind (0: visible, 1: blocked) in a run of a row.
    fn ends(&self, y: usize, (low, high): (u32, u32), kind: usize) -> Option<(u32, u32)> {
        let words = (self.size as usize).div_ceil(64);
        let mut ends: Option<(u32, u32)> = None;
        for (k, word) in self.bits[y * words..(y + 1) * words].iter().enumerate() {
            let first = 64 * k as u32;
            let (l, h) = (low.max(first), high.min(first + 64));
            if l >= h {
                continue;
            }
            let word = word[kind] & (u64::MAX >> (64 - (h - l))) << (l - first);
            if word != 0 {
                let last = first + 63 - word.leading_zeros();
                let begin = ends.map_or(first + word.trailing_zeros(), |e| e.0);
                ends = Some((begin, last));
            }
        }
        ends
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
            cell.counts
                .add(Counts::from_sum(self.run(y, (0, self.size))));
        }
        self.trim(cell);
    }

    /// Leaves out rows without texels that matter.
    fn trim(&self, cell: &mut Cell) {
        let mut first = None;
        let mut end = 0;
        for (k, run) in cell.runs.iter_mut().enumerate() {
            let holds = run.0 < run.1 && self.run(cell.y0 + k, *run) > 0;
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

    /// Impurity that a line leaves which has `sum` at its crossings; lower is better.
    #[inline(always)]
    fn left_by(&self, sum: u32) -> f64 {
        let low = Counts::from_sum(sum.wrapping_sub(self.base));
        let high = Counts {
            blocked: self.all.blocked - low.blocked,
            visible: self.all.visible - low.visible,
        };
        if low.texels() == 0 || high.texels() == 0 {
            return f64::INFINITY;
        }
        let part = |counts: Counts| {
            let (blocked, visible) = (f64::from(counts.blocked), f64::from(counts.visible));
            (blocked * visible).sqrt()
        };
        part(low) + part(high)
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
    /// The outermost texels of each row, visible and blocked.
    sets: [Vec<DVec2>; 2],
    /// Lines that were evaluated.
    pub(crate) lines: u64,
}

impl Search {
    /// The best line found, if any line has texels on both of its sides.
    pub(crate) fn best(&mut self, table: &Table, cell: &Cell) -> Option<IntLine> {
        self.rows.gather(table, cell, 1);
        if let Some(line) = self.separating(table, cell) {
            return Some(line);
        }
        let stride = cell.runs.len().div_ceil(COARSE_ROWS).max(1);
        let best = self.best_by(table, cell, stride);
        // Some of the rows may hold a single texel.
        if best.is_none() && stride > 1 {
            return self.best_by(table, cell, 1);
        }
        best
    }

    /// A line with all visible texels on one side and all blocked ones on the other.
    fn separating(&mut self, table: &Table, cell: &Cell) -> Option<IntLine> {
        for set in &mut self.sets {
            set.clear();
        }
        for (k, &run) in cell.runs.iter().enumerate() {
            let y = cell.y0 + k;
            let ends = [0, 1].map(|kind| table.ends(y, run, kind));
            if let [Some(a), Some(b)] = ends
                && a.0 < b.1
                && b.0 < a.1
            {
                // One lies among the others.
                return None;
            }
            for (set, ends) in self.sets.iter_mut().zip(ends) {
                if let Some((first, last)) = ends {
                    set.push(DVec2::new(f64::from(first), y as f64));
                    if last > first {
                        set.push(DVec2::new(f64::from(last), y as f64));
                    }
                }
            }
        }
        let (normal, offset) = separate(&self.sets[0], &self.sets[1])?;
        // From columns and rows to units of the face.
        let texel = 2.0 / f64::from(table.size);
        let offset = texel * offset + (0.5 * texel - 1.0) * (normal.x + normal.y);
        let line = IntLine::ends_of(normal.to_angle(), offset).and_then(IntLine::new)?;
        // Where the sets are very near to each other, rounding the ends of the line may be too much.
        (self.evaluate(table, &line) == 0.0).then_some(line)
    }

    fn best_by(&mut self, table: &Table, cell: &Cell, stride: usize) -> Option<IntLine> {
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
        /// What a step is divided by where no move helps.
        const SHRINK: i32 = 3;
        let finest = (2 * UNIT_STEPS / table.size / FINEST).max(1) as i32;
        let mut here = self.evaluate(table, &line);
        let mut step = ((0.5 * step * f64::from(UNIT_STEPS)) as i32).max(finest);
        let (mut next, mut failed) = (0, 0);
        while step >= finest && here > 0.0 {
            let [dp, dq] = MOVES[next];
            let shift =
                |end: u32, by: i32| (end as i32 + by).rem_euclid(BORDER_STEPS as i32) as u32;
            let [p, q] = line.ends();
            let moved = IntLine::new([shift(p, dp * step), shift(q, dq * step)])
                .map(|line| (self.evaluate(table, &line), line))
                .filter(|(left, _)| *left < here);
            if let Some(better) = moved {
                // The same way again.
                (here, line) = better;
                failed = 0;
                continue;
            }
            next = (next + 1) % MOVES.len();
            failed += 1;
            if failed == MOVES.len() {
                step /= SHRINK;
                failed = 0;
            }
        }
        (here, line)
    }
}
