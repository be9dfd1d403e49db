//! Numbered steps on the terminal, each with the time it took.

use std::time::{Duration, Instant};

use crate::failure::{Context, Result};

/// Steps of a task.
pub struct Steps {
    count: usize,
    current: usize,
    started: Instant,
}

impl Steps {
    pub fn new(count: usize) -> Self {
        Self {
            count,
            current: 0,
            started: Instant::now(),
        }
    }

    /// Announces a step, runs it, and prints its time; a failure names the step.
    pub fn run<T>(&mut self, what: &str, step: impl FnOnce() -> Result<T>) -> Result<T> {
        self.current += 1;
        println!("[{}/{}] {what}", self.current, self.count);
        let started = Instant::now();
        let result =
            step().context(|| format!("step {} of {} ({what})", self.current, self.count))?;
        println!("      done in {}", duration(started.elapsed()));
        Ok(result)
    }

    pub fn total(&self) -> String {
        duration(self.started.elapsed())
    }
}

/// `0.4 s`, `12 s`, `3 min 7 s`.
pub fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 9.95 {
        return format!("{seconds:.1} s");
    }
    let whole = seconds.round() as u64;
    if whole < 60 {
        format!("{whole} s")
    } else {
        format!("{} min {} s", whole / 60, whole % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::Failure;

    #[test]
    fn durations_read_well() {
        for (seconds, text) in [
            (0.04, "0.0 s"),
            (9.96, "10 s"),
            (59.4, "59 s"),
            (59.6, "1 min 0 s"),
            (187.0, "3 min 7 s"),
        ] {
            assert_eq!(duration(Duration::from_secs_f64(seconds)), text);
        }
    }

    #[test]
    fn a_failing_step_is_named() {
        let mut steps = Steps::new(2);
        steps.run("first", || Ok(())).unwrap();
        let failure = steps
            .run("second", || Err::<(), _>(Failure::new("no luck")))
            .unwrap_err();
        assert_eq!(failure.to_string(), "step 2 of 2 (second): no luck");
    }
}
