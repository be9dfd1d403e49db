//! CPU instructions of a piece of work, counted in a process of its own.
//!
//! By `perf stat` where the processor's counters can be read, else by `valgrind --tool=cachegrind`, which counts anywhere.
//! Unlike times, counts do not depend on what else the machine does.

use std::process::Command;

/// How instructions are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counter {
    /// Of the processor.
    Perf,
    /// Of an emulated one.
    Valgrind,
}

impl Counter {
    /// Name for a table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Perf => "`perf stat -e instructions:u`",
            Self::Valgrind => "`valgrind --tool=cachegrind`",
        }
    }

    /// The first that works here.
    ///
    /// # Errors
    /// Why none does.
    pub fn find() -> Result<Self, String> {
        let mut faults = Vec::new();
        for counter in [Self::Perf, Self::Valgrind] {
            match counter.count(&Command::new("true")) {
                Ok(_) => return Ok(counter),
                Err(fault) => faults.push(format!("{}: {fault}", counter.name())),
            }
        }
        Err(format!(
            "nothing counts instructions here ({})",
            faults.join("; ")
        ))
    }

    /// Instructions of a whole process in user space.
    ///
    /// # Errors
    /// If it cannot be started, fails, or is not counted.
    pub fn count(self, command: &Command) -> Result<u64, String> {
        let mut counted = match self {
            Self::Perf => Command::new("perf"),
            Self::Valgrind => Command::new("valgrind"),
        };
        match self {
            Self::Perf => counted.args(["stat", "-x", ",", "-e", "instructions:u"]),
            Self::Valgrind => counted.args([
                "--tool=cachegrind",
                "--cache-sim=no",
                "--cachegrind-out-file=/dev/null",
            ]),
        };
        counted.arg(command.get_program()).args(command.get_args());
        // Figures with commas or not, but in English.
        let output = counted
            .env("LC_ALL", "C")
            .output()
            .map_err(|error| error.to_string())?;
        if !output.status.success() {
            return Err(output.status.to_string());
        }
        let text = String::from_utf8_lossy(&output.stderr);
        self.parse(&text).ok_or_else(|| "no count".into())
    }

    fn parse(self, text: &str) -> Option<u64> {
        let figure = match self {
            // `123,,instructions:u,…`, or `<not supported>,,instructions:u,…`.
            Self::Perf => text
                .lines()
                .find(|line| line.contains("instructions"))?
                .split(',')
                .next()?
                .to_owned(),
            // `==1== I   refs:      1,234`
            Self::Valgrind => text
                .lines()
                .find(|line| line.contains("refs:"))?
                .rsplit(':')
                .next()?
                .replace(',', ""),
        };
        figure.trim().parse().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read() {
        let perf = "12345,,instructions:u,100,100.00,,\n";
        assert_eq!(Counter::Perf.parse(perf), Some(12345));
        let none = "<not supported>,,instructions:u,0,100.00,,\n";
        assert_eq!(Counter::Perf.parse(none), None);
        let valgrind = "==7== Cachegrind\n==7== \n==7== I refs:        1,234,567\n";
        assert_eq!(Counter::Valgrind.parse(valgrind), Some(1_234_567));
        assert_eq!(Counter::Valgrind.parse("valgrind: failed"), None);
    }
}
