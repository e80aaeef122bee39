//! A line of progress on standard error, only if that is a terminal.

use crate::engine::interrupt;
use contract::watch::Watch;
use std::io::{IsTerminal, Write, stderr};
use std::sync::atomic::{AtomicU64, Ordering};

/// The line.
#[derive(Debug)]
pub struct Progress {
    is_shown: bool,
    percent: AtomicU64,
}

impl Progress {
    /// An empty line.
    #[expect(clippy::new_without_default, reason = "it depends on the terminal")]
    pub fn new() -> Self {
        Self { is_shown: stderr().is_terminal(), percent: AtomicU64::new(0) }
    }

    fn show(&self, text: &str) {
        if self.is_shown {
            let _ = write!(stderr().lock(), "\r\x1b[K{text}");
        }
    }

    /// Removes the line.
    pub fn finish(&self) {
        self.show("");
    }
}

impl Watch for Progress {
    fn step(&self, what: &str) {
        self.show(what);
    }

    fn progress(&self, done: u64, total: u64) {
        let percent = 100 * done / total.max(1);
        if self.percent.swap(percent, Ordering::Relaxed) != percent {
            self.show(&format!("{percent} %"));
        }
    }

    fn is_interrupted(&self) -> bool {
        interrupt::requested()
    }
}
