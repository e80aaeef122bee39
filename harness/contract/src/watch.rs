//! What a long computation reports to the user, who may interrupt it.

/// A user who watches.
pub trait Watch: Sync {
    /// A step begins.
    fn step(&self, _what: &str) {}

    /// `done` of `total` leaves are written.
    fn progress(&self, _done: u64, _total: u64) {}

    /// Whether the user has interrupted it.
    fn is_interrupted(&self) -> bool;
}
