//! A line of progress on standard error, only if that is a terminal.

use crate::engine::interrupt;
use contract::failure::Watch;
use std::io::{IsTerminal, Write, stderr};

/// The line, which is empty at first.
pub struct Progress;

impl Progress {
    fn show(&self, text: &str) {
        if stderr().is_terminal() {
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
        self.show(&format!("{} %", 100 * done / total.max(1)));
    }

    fn is_interrupted(&self) -> bool {
        interrupt::requested()
    }
}
