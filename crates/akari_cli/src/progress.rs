//! Progress on the terminal or as JSON lines, and Ctrl-C.

use crate::args::{Common, ProgressMode};
use crate::error::CliError;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

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
            let style =
                ProgressStyle::with_template("{prefix} {bar:40} {percent:>3} %  {eta} left")
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
                let line = serde_json::json!({
                    "task": self.what, "done": done, "total": total, "seconds": now as f64 / 1e3,
                });
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

impl akari_reference::Progress for Reporter {
    fn update(&self, done: u64, total: u64) {
        self.show(done, total);
    }

    fn cancelled(&self) -> bool {
        interrupted()
    }
}
