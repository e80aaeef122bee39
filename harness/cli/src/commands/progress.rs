//! A line of progress on standard error, only if that is a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use run::engine::interrupt;
use std::time::Duration;

/// The line.
pub struct Progress(ProgressBar);

impl Progress {
    /// A line of this template of `indicatif`.
    pub fn new(template: &str) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template(template);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        Self(bar)
    }

    /// Removes the line.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl export::options::Watch for Progress {
    fn progress(&self, done: u64, total: u64) {
        self.0.set_length(total);
        self.0.set_position(done);
    }

    fn is_interrupted(&self) -> bool {
        interrupt::requested()
    }
}

impl geometry::leak::Watch for Progress {
    fn step(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }

    fn is_interrupted(&self) -> bool {
        interrupt::requested()
    }
}
