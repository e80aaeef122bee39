//! What is being done, on a terminal; silence elsewhere.

use contract::catalogue::Selected;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::Duration;

/// One line that counts cases and names the step.
#[derive(Debug)]
pub struct Progress(ProgressBar);

impl Progress {
    /// Over the given cases. Draws on standard error, and only where that is a terminal.
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

    /// A case begins.
    pub fn case(&self, name: &str) {
        if !self.0.prefix().is_empty() {
            self.0.inc(1);
        }
        self.0.set_prefix(name.to_owned());
    }

    /// A step of the case begins.
    pub fn step(&self, what: impl Into<String>) {
        self.0.set_message(what.into());
    }

    /// All is done; the line goes.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
