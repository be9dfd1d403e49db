//! Progress on the terminal or as JSON lines, and Ctrl-C.

use crate::args::{Common, ProgressMode};
use crate::error::CliError;
use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Held while a file is written through a temporary one.
static WRITING: Mutex<()> = Mutex::new(());

/// Keeps a second Ctrl-C waiting until the file that is being written is there whole.
pub fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Lets Ctrl-C and SIGTERM ask the running command to stop. The second one ends the process at once, or as soon as a
/// file that is being written is whole, so that no temporary file stays behind.
pub fn catch_interrupts() {
    // Without a handler, the system's default stays: the process ends. That is no reason not to start.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            let _whole = writing();
            std::process::exit(i32::from(crate::error::INTERRUPTED));
        }
    });
}

/// Whether the user asked to stop.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// An error if the user asked to stop.
///
/// # Errors
/// With the exit code of an interruption.
pub fn check_interrupt() -> Result<(), CliError> {
    if interrupted() {
        Err(CliError::interrupted())
    } else {
        Ok(())
    }
}

/// No JSON line was printed yet.
const NO_LINE: u64 = u64::MAX;

/// Where progress is shown.
pub struct Reporter {
    what: &'static str,
    bar: Option<ProgressBar>,
    json: bool,
    /// Milliseconds since the start at the last JSON line.
    last_line_ms: AtomicU64,
    start: Instant,
}

impl Reporter {
    /// Progress of `what` ("reference").
    pub fn new(what: &'static str, common: &Common) -> Self {
        Self::styled(what, "{prefix} {bar:40} {percent:>3} %  {eta} left", common)
    }

    /// Progress of `what` for [`Reporter::show_phase`].
    pub fn with_phases(what: &'static str, common: &Common) -> Self {
        Self::styled(what, "{prefix:14} {bar:40} {percent:>3} %  {msg}", common)
    }

    fn styled(what: &'static str, template: &str, common: &Common) -> Self {
        let mode = if common.quiet {
            ProgressMode::None
        } else {
            common.progress
        };
        let bar = match mode {
            ProgressMode::Bar => true,
            ProgressMode::Auto => std::io::stderr().is_terminal(),
            ProgressMode::Json | ProgressMode::None => false,
        };
        let bar = bar.then(|| {
            let style = ProgressStyle::with_template(template)
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(0).with_style(style).with_prefix(what)
        });
        Self {
            what,
            bar,
            json: mode == ProgressMode::Json,
            last_line_ms: AtomicU64::new(NO_LINE),
            start: Instant::now(),
        }
    }

    /// Shows `done` of `total`.
    pub fn show(&self, done: u64, total: u64) {
        if let Some(bar) = &self.bar {
            bar.set_length(total);
            bar.set_position(done);
        }
        self.line(
            done,
            total,
            || serde_json::json!({ "task": self.what, "done": done, "total": total }),
        );
    }

    /// Shows `done` of `total` of one phase of the work, and how long the rest of the phase will take.
    pub fn show_phase(&self, phase: &str, done: u64, total: u64, left: Option<Duration>) {
        if let Some(bar) = &self.bar {
            bar.set_length(total);
            bar.set_position(done);
            bar.set_prefix(format!("{} {phase}", self.what));
            let left =
                left.map_or_else(String::new, |left| format!("{} left", HumanDuration(left)));
            bar.set_message(left);
        }
        self.line(done, total, || {
            serde_json::json!({
                "task": self.what, "phase": phase, "done": done, "total": total,
                "seconds_left": left.map(|left| left.as_secs_f64()),
            })
        });
    }

    /// Prints a JSON line, if it is time for one.
    fn line(&self, done: u64, total: u64, content: impl FnOnce() -> serde_json::Value) {
        if self.json {
            /// Between two lines, unless it is the last one.
            const INTERVAL_MS: u64 = 500;
            let now = self.start.elapsed().as_millis() as u64;
            let last = self.last_line_ms.load(Ordering::Relaxed);
            let due = last == NO_LINE || now >= last + INTERVAL_MS || done == total;
            if due
                && self
                    .last_line_ms
                    .compare_exchange(last, now, Ordering::Relaxed, Ordering::Relaxed)
                    .is_ok()
            {
                let mut line = content();
                line["seconds"] = (now as f64 / 1e3).into();
                crate::console::print_note(&line.to_string());
            }
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl akari_bake::Progress for Reporter {
    fn update(&self, status: &akari_bake::Status) {
        let phase = match status.phase {
            akari_bake::Phase::Levels => "levels",
            akari_bake::Phase::Samples => "samples",
            akari_bake::Phase::Writing => "writing",
        };
        self.show_phase(phase, status.done, status.total, status.left);
    }

    fn cancelled(&self) -> bool {
        interrupted()
    }
}

impl akari_reference::Progress for Reporter {
    fn update(&self, done: u64, total: u64) {
        self.show(done, total);
    }

    fn cancelled(&self) -> bool {
        interrupted()
    }
}
