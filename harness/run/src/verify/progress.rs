//! The progress line, on a terminal only.

use contract::catalogue::Selected;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::Duration;

/// A line that counts cases and names the current step.
#[derive(Debug)]
pub struct Progress(ProgressBar);

impl Progress {
    /// A line for these cases. It is drawn on standard error, and only if that is a terminal.
    pub fn new(cases: &[Selected]) -> Self {
        let bar =
            ProgressBar::with_draw_target(Some(cases.len() as u64), ProgressDrawTarget::stderr());
        let style =
            ProgressStyle::with_template("{spinner} {pos}/{len} [{elapsed}] {prefix}: {wide_msg}");
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

    /// Shows that a step of the case begins.
    pub fn step(&self, what: impl Into<String>) {
        self.0.set_message(what.into());
    }

    /// Removes the line.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
