//! A line of progress on standard error, only if that is a terminal.

use crate::engine::interrupt;
use contract::watch::Watch;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::Duration;

/// The line.
#[derive(Debug)]
pub struct Progress(ProgressBar);

impl Progress {
    /// A line of this template of `indicatif`, for this number of cases if it counts them.
    pub fn new(template: &str, cases: Option<usize>) -> Self {
        let cases = cases.map(|count| count as u64);
        let bar = ProgressBar::with_draw_target(cases, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template(template);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Self(bar)
    }

    /// Shows that a case begins.
    pub fn case(&self, name: &str) {
        if !self.0.prefix().is_empty() {
            self.0.inc(1);
        }
        self.0.set_prefix(name.to_owned());
    }

    /// Removes the line.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Watch for Progress {
    fn step(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }

    fn progress(&self, done: u64, total: u64) {
        self.0.set_length(total);
        self.0.set_position(done);
    }

    fn is_interrupted(&self) -> bool {
        interrupt::requested()
    }
}
