//! When to turn which knob: the rule alone, without a GPU or a clock.

use super::ladders::Ladder;
use std::collections::VecDeque;
use std::fmt;

/// Frames that a decision looks at. Nine tell a load from a spike of one or two frames.
const WINDOW: usize = 9;
/// Of them, so many must be over the budget before anything is lowered: with less, the scatter of a load that just fits
/// would lower it.
const OVER: usize = 8;
/// Frames after a change that are not looked at: buffers are made anew, pipelines compiled.
const SETTLE: u32 = 3;
/// Share of the budget that lowering aims at.
const AIM: f32 = 0.97;
/// Share of the budget that a raise may be expected to reach. The gap to [`AIM`] is the hysteresis.
const RAISE: f32 = 0.92;
/// Frames for which a raise must have been possible before it is made.
const PATIENCE: u32 = 60;
/// Frames after a raise within which having to lower again means that it was wrong.
const PROBATION: u64 = 240;
/// Share by which the rest of the load must have fallen before a wrong raise is tried again.
const RELIEF: f32 = 0.1;
/// Below it, milliseconds, a time is the clock's grain: no ratio is learnt from it.
const LEAST_MS: f32 = 0.001;

/// What one frame took.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameCost {
    /// All that the budget is for, milliseconds.
    pub total_ms: f32,
    /// The part of each ladder's effect, milliseconds, in the order of the ladders; 0 where it did not run.
    pub effect_ms: Vec<f32>,
}

/// One effect went from one rung to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// Number of the ladder.
    pub ladder: usize,
    /// Rung before.
    pub from: usize,
    /// Rung after.
    pub to: usize,
}

/// What was decided and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Frame of the decision, counted from the controller's start.
    pub frame: u64,
    /// The effects that changed.
    pub steps: Vec<Step>,
    /// Median of the frames that were looked at, milliseconds.
    pub measured_ms: f32,
    /// The budget, milliseconds.
    pub budget_ms: f32,
    /// What the frame is expected to take from now on, milliseconds.
    pub expected_ms: f32,
    /// Why, in words.
    pub reason: Reason,
}

/// Why settings were changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// Most of the frames took longer than the budget.
    OverBudget,
    /// There is time for something better.
    RoomToSpare,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let why = match self.reason {
            Reason::OverBudget => "over the budget",
            Reason::RoomToSpare => "room to spare",
        };
        write!(
            f,
            "{why}: {:.2} of {:.2} ms, {:.2} ms expected",
            self.measured_ms, self.budget_ms, self.expected_ms
        )
    }
}

#[derive(Debug, Clone)]
struct State {
    /// Costs relative to one another, as far as known: from measurements elsewhere at first, then from here.
    costs: Vec<f32>,
    /// Whether a cost was measured here, relative to another that was.
    measured: Vec<bool>,
    errors: Vec<f32>,
    at: usize,
    /// For each rung: the load of all else when it turned out to be too much.
    too_much: Vec<Option<f32>>,
}

/// What the next full window is held against.
#[derive(Debug, Clone)]
struct Lesson {
    steps: Vec<Step>,
    before_ms: Vec<f32>,
}

/// Holds a time by moving effects along their ladders.
///
/// It lowers when nearly all frames of a window are over the budget, by as many rungs as the known ratios of costs say are
/// needed, dearest error last; it raises by one rung when that has been expected to fit for a while. The ratios are
/// corrected by what each change turned out to save. A rung that proved too dear is left alone until the rest of the load
/// has fallen.
#[derive(Debug, Clone)]
pub struct Controller {
    budget_ms: f32,
    states: Vec<State>,
    window: VecDeque<FrameCost>,
    settling: u32,
    possible_for: u32,
    frame: u64,
    last_raise: Option<(u64, Step)>,
    lesson: Option<Lesson>,
}

impl Controller {
    /// Starts on the top rungs. `budget_ms` must be positive.
    pub fn new(budget_ms: f32, ladders: &[Ladder]) -> Self {
        let states = ladders
            .iter()
            .map(|ladder| State {
                costs: ladder.rungs.iter().map(|rung| rung.cost).collect(),
                measured: vec![false; ladder.rungs.len()],
                errors: ladder.rungs.iter().map(|rung| rung.error).collect(),
                at: ladder.rungs.len().saturating_sub(1),
                too_much: vec![None; ladder.rungs.len()],
            })
            .collect();
        Self {
            budget_ms,
            states,
            window: VecDeque::with_capacity(WINDOW),
            settling: 0,
            possible_for: 0,
            frame: 0,
            last_raise: None,
            lesson: None,
        }
    }

    /// The budget, milliseconds.
    pub fn budget_ms(&self) -> f32 {
        self.budget_ms
    }

    /// Changes the budget; rungs that were too dear for the old one are no longer held to be.
    pub fn set_budget_ms(&mut self, budget_ms: f32) {
        if budget_ms != self.budget_ms {
            self.budget_ms = budget_ms;
            self.possible_for = 0;
            for state in &mut self.states {
                state.too_much.fill(None);
            }
        }
    }

    /// The rung that each effect stands on.
    pub fn rungs(&self) -> impl Iterator<Item = usize> + '_ {
        self.states.iter().map(|state| state.at)
    }

    /// Puts an effect on a rung by hand.
    pub fn place(&mut self, ladder: usize, rung: usize) {
        let state = &mut self.states[ladder];
        state.at = rung.min(state.costs.len().saturating_sub(1));
        self.start_window();
    }

    /// Takes a frame's times, and says what is to change. Times that are no numbers are passed over.
    pub fn update(&mut self, cost: &FrameCost) -> Option<Change> {
        self.frame += 1;
        let finite = cost.total_ms.is_finite() && cost.effect_ms.iter().all(|ms| ms.is_finite());
        if !finite || cost.effect_ms.len() != self.states.len() {
            return None;
        }
        if self.settling > 0 {
            self.settling -= 1;
            return None;
        }
        if self.window.len() == WINDOW {
            self.window.pop_front();
        }
        self.window.push_back(cost.clone());
        if self.window.len() < WINDOW {
            return None;
        }
        let total_ms = median(self.window.iter().map(|frame| frame.total_ms));
        let effect_ms: Vec<f32> = (0..self.states.len())
            .map(|i| median(self.window.iter().map(|frame| frame.effect_ms[i])))
            .collect();
        self.learn(&effect_ms);
        let over = self
            .window
            .iter()
            .filter(|frame| frame.total_ms > self.budget_ms)
            .count();
        let change = if over >= OVER {
            self.possible_for = 0;
            self.lower(total_ms, &effect_ms)
        } else {
            self.raise(total_ms, &effect_ms)
        };
        if let Some(change) = &change {
            self.lesson = Some(Lesson {
                steps: change.steps.clone(),
                before_ms: effect_ms,
            });
            self.start_window();
        }
        change
    }

    fn start_window(&mut self) {
        self.window.clear();
        self.settling = SETTLE;
        self.possible_for = 0;
    }

    /// Corrects the ratio of two rungs' costs by what the step between them did. Rungs beyond, of which nothing is known
    /// from here, keep their ratio to the one that was reached.
    fn learn(&mut self, effect_ms: &[f32]) {
        let Some(lesson) = self.lesson.take() else {
            return;
        };
        for step in &lesson.steps {
            let (before, after) = (lesson.before_ms[step.ladder], effect_ms[step.ladder]);
            if before > LEAST_MS && after > LEAST_MS {
                let state = &mut self.states[step.ladder];
                let reached = state.costs[step.from] * after / before;
                let correction = reached / state.costs[step.to];
                let beyond = if step.to > step.from {
                    step.to + 1..state.costs.len()
                } else {
                    0..step.to
                };
                for rung in beyond {
                    if !state.measured[rung] {
                        state.costs[rung] *= correction;
                    }
                }
                state.costs[step.to] = reached;
                state.measured[step.to] = true;
                state.measured[step.from] = true;
            }
        }
    }

    /// Milliseconds that an effect would save (or cost, if negative) on another rung.
    fn saving(&self, ladder: usize, to: usize, effect_ms: f32) -> f32 {
        let state = &self.states[ladder];
        let ratio = state.costs[to] / state.costs[state.at].max(f32::MIN_POSITIVE);
        effect_ms * (1.0 - ratio)
    }

    fn lower(&mut self, total_ms: f32, effect_ms: &[f32]) -> Option<Change> {
        if let Some((frame, step)) = self.last_raise.take()
            && self.frame - frame <= PROBATION
        {
            self.states[step.ladder].too_much[step.to] = Some(total_ms - effect_ms[step.ladder]);
        }
        let before: Vec<usize> = self.rungs().collect();
        let mut effect_ms = effect_ms.to_vec();
        let mut expected = total_ms;
        while expected > AIM * self.budget_ms {
            // Of all steps down that save anything, the one that costs the least error a millisecond.
            let mut best: Option<(f32, usize, usize, f32)> = None;
            for (ladder, (state, effect_ms)) in self.states.iter().zip(&effect_ms).enumerate() {
                for to in 0..state.at {
                    let saved = self.saving(ladder, to, *effect_ms);
                    if saved <= 0.0 {
                        continue;
                    }
                    let worse = (state.errors[to] / state.errors[state.at].max(f32::MIN_POSITIVE))
                        .max(1.0)
                        .ln();
                    let price = worse / saved;
                    if best.is_none_or(|(cheapest, ..)| price < cheapest) {
                        best = Some((price, ladder, to, saved));
                    }
                }
            }
            let Some((_, ladder, to, saved)) = best else {
                break;
            };
            self.states[ladder].at = to;
            effect_ms[ladder] -= saved;
            expected -= saved;
        }
        let steps: Vec<Step> = self.steps_since(&before);
        (!steps.is_empty()).then_some(Change {
            frame: self.frame,
            steps,
            measured_ms: total_ms,
            budget_ms: self.budget_ms,
            expected_ms: expected,
            reason: Reason::OverBudget,
        })
    }

    fn raise(&mut self, total_ms: f32, effect_ms: &[f32]) -> Option<Change> {
        let mut best: Option<(f32, Step, f32)> = None;
        for (ladder, state) in self.states.iter().enumerate() {
            // Nothing is known of an effect that does not run.
            if effect_ms[ladder] <= LEAST_MS {
                continue;
            }
            let rest = total_ms - effect_ms[ladder];
            for to in state.at + 1..state.costs.len() {
                if state.too_much[to].is_some_and(|load| rest > load * (1.0 - RELIEF)) {
                    continue;
                }
                let expected = total_ms - self.saving(ladder, to, effect_ms[ladder]);
                if expected > RAISE * self.budget_ms {
                    continue;
                }
                let better = (state.errors[state.at] / state.errors[to].max(f32::MIN_POSITIVE))
                    .max(1.0)
                    .ln();
                if best.as_ref().is_none_or(|(most, ..)| better > *most) {
                    let step = Step {
                        ladder,
                        from: state.at,
                        to,
                    };
                    best = Some((better, step, expected));
                }
            }
        }
        let Some((_, step, expected_ms)) = best else {
            self.possible_for = 0;
            return None;
        };
        self.possible_for += 1;
        if self.possible_for < PATIENCE {
            return None;
        }
        self.states[step.ladder].at = step.to;
        self.last_raise = Some((self.frame, step));
        Some(Change {
            frame: self.frame,
            steps: vec![step],
            measured_ms: total_ms,
            budget_ms: self.budget_ms,
            expected_ms,
            reason: Reason::RoomToSpare,
        })
    }

    fn steps_since(&self, before: &[usize]) -> Vec<Step> {
        self.rungs()
            .zip(before)
            .enumerate()
            .filter(|(_, (to, from))| to != *from)
            .map(|(ladder, (to, from))| Step {
                ladder,
                from: *from,
                to,
            })
            .collect()
    }
}

/// Middle of an odd number of values, upper middle of an even one.
fn median(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
