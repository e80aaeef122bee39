//! The options of a run.

use crate::output::write::Output;
use crate::partition::Division;

/// Options that have no effect on the mesh, but for `ungraded`.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How to divide the work among ranks.
    pub division: Division,
    /// Stop after sides: the mesh is the base tree T0, with all its leaves.
    pub ungraded: bool,
    /// What to write, and where.
    pub out: Option<Output>,
    /// Check invariants after each phase, which debug builds do in any case.
    pub check: bool,
    /// Fail if the geometry leaks.
    pub strict: bool,
    /// What to call the case in advice to the user.
    pub case_name: String,
}

impl Options {
    /// Whether checks run: in debug builds, and in release builds on request.
    pub fn checks(&self) -> bool {
        cfg!(debug_assertions) || self.check
    }
}
