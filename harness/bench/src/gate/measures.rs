//! The measures of one program: counters, digests, memory, instructions. Recorded, they are a point in the history of `harness track`.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Version of the JSON form.
pub const SCHEMA: &str = "octree-measures/1";
/// The working tree, by name.
pub(crate) const WORKING_TREE: &str = ".";

/// The measures of one program.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// [`SCHEMA`].
    pub schema: String,
    /// The program.
    pub of: Measured,
    /// The machine.
    pub machine: String,
    /// By case.
    pub cases: BTreeMap<String, CaseMeasures>,
}

/// A program that was measured or compared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The name given by the user.
    pub named: String,
    /// The revision it was built from; none of a working tree with changes.
    pub revision: Option<String>,
    /// Digest of the program's files; empty if one cannot be read.
    pub program: String,
}

impl Measured {
    /// Whether it was built from a revision or a working tree.
    pub(crate) fn is_built(&self) -> bool {
        self.revision.is_some() || self.named == WORKING_TREE
    }
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.revision {
            Some(revision) if !revision.starts_with(&self.named) => {
                write!(f, "{} ({})", self.named, &revision[..12.min(revision.len())])
            }
            _ => f.write_str(&self.named),
        }
    }
}

/// The layers, in the order in which they are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LayerName {
    /// The checks of the candidate's meshes.
    Correctness,
    /// Deterministic counters.
    Counters,
    /// Peak memory.
    Memory,
    /// Instructions, counted by valgrind.
    Instructions,
    /// Run times of baseline and candidate in one session.
    Time,
}

impl fmt::Display for LayerName {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(&crate::name_of(self))
    }
}

/// Numbers by metric.
pub type Numbers = BTreeMap<String, u64>;

/// The measures of one case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CaseMeasures {
    /// The mesh's digest.
    pub digest: Option<String>,
    /// Digest of the facets as the program read them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<String>,
    /// Deterministic counters by name.
    pub exact: Numbers,
    /// Peak memory of all ranks together, in bytes.
    #[serde(default)]
    pub memory: Numbers,
    /// Counts by valgrind; deterministic except for hash seeds and addresses.
    pub counted: Numbers,
}

impl CaseMeasures {
    /// The numbers that a layer compares.
    pub fn of_layer(&self, layer: LayerName) -> &Numbers {
        match layer {
            LayerName::Memory => &self.memory,
            LayerName::Instructions => &self.counted,
            _ => &self.exact,
        }
    }
}

impl Measures {
    /// Returns empty measures.
    pub fn of_program(of: Measured) -> Self {
        Self { schema: SCHEMA.to_owned(), of, ..Self::default() }
    }

    /// Parses a record, or the record contained in a gate's report.
    ///
    /// # Errors
    /// One sentence, if it is neither.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        let wrong = |error| format!("not a record of `harness gate`: {error}");
        let mut value: serde_json::Value = serde_json::from_slice(text).map_err(wrong)?;
        let of_report = value.get_mut("candidate_measures").map(serde_json::Value::take);
        let measures: Self = serde_json::from_value(of_report.unwrap_or(value)).map_err(wrong)?;
        let why = format!("schema {:?}, not {SCHEMA:?}", measures.schema);
        if measures.schema == SCHEMA { Ok(measures) } else { Err(why) }
    }
}
