//! How a run is distributed over ranks, on which its mesh does not depend, and the files and limits of the run.

use super::service::Services;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The number of ranks and their kind.
///
/// The JSON form is the number alone: only runs on MPI are recorded with their layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "usize", from = "usize")]
pub enum Ranks {
    /// One rank, without messages.
    Serial,
    /// Ranks within one process, scheduled in an order that the seed determines.
    Simulated {
        /// Number of ranks.
        ranks: usize,
        /// Seed of the schedule.
        seed: u64,
    },
    /// Processes on MPI.
    Mpi(usize),
}

impl Ranks {
    /// Number of ranks.
    pub fn count(self) -> usize {
        match self {
            Self::Serial => 1,
            Self::Simulated { ranks, .. } | Self::Mpi(ranks) => ranks,
        }
    }
}

impl From<Ranks> for usize {
    fn from(ranks: Ranks) -> Self {
        ranks.count()
    }
}

impl From<usize> for Ranks {
    fn from(ranks: usize) -> Self {
        Self::Mpi(ranks)
    }
}

impl fmt::Display for Ranks {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Serial => f.write_str("serial"),
            Self::Simulated { ranks, seed } => write!(f, "{ranks} simulated ranks, seed {seed}"),
            Self::Mpi(1) => f.write_str("1 rank"),
            Self::Mpi(ranks) => write!(f, "{ranks} ranks"),
        }
    }
}

/// Ranks, and the choices that determine which rank owns which part of the mesh. A choice that is `None` is left to
/// the engine, and an engine that does not offer a choice ignores it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Layout {
    /// The ranks.
    pub ranks: Ranks,
    /// `metis` or `morton`.
    pub partitioner: Option<String>,
    /// `auto` or the level of the partition.
    pub level_base: Option<String>,
    /// The weights of base leaves in the partition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
}

impl Layout {
    /// These ranks, with every choice left to the engine.
    pub const fn on(ranks: Ranks) -> Self {
        Self { ranks, partitioner: None, level_base: None, weights: None }
    }

    /// The number of ranks of a run on several; `None` for a serial run.
    pub fn rank_count(&self) -> Option<usize> {
        (self.ranks != Ranks::Serial).then(|| self.ranks.count())
    }
}

/// The layout of a serial run.
pub static SERIAL: Layout = Layout::on(Ranks::Serial);

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}", self.ranks)?;
        let choices =
            [("", &self.partitioner), ("base ", &self.level_base), ("weights ", &self.weights)];
        for (label, choice) in choices {
            if let Some(choice) = choice {
                write!(f, ", {label}{choice}")?;
            }
        }
        Ok(())
    }
}

/// Files, choices and limits of a run.
#[derive(Clone, Copy, Debug)]
pub struct RunOptions<'a> {
    /// Existing directory for the run report, the status and the logs; no other run may use it at the same time.
    pub place: &'a Path,
    /// Time after which the run is killed.
    pub limit: Duration,
    /// Leaf-set directory to write. An engine without a run report writes its mesh even if this is `None`, to `mesh`
    /// in `place`.
    pub mesh: Option<&'a Path>,
    /// Write a run report. Without one, cells and digest are read from the mesh.
    pub report: bool,
    /// Keep the ranks' activity on disk, to report it if the run hangs.
    pub status: bool,
    /// Stop at the base tree.
    pub ungraded: bool,
    /// Sample the memory of an engine that does not report it.
    pub sample_memory: bool,
    /// Where runs on MPI use the engine's service, if it has one.
    pub services: Option<&'a Services>,
}

impl<'a> RunOptions<'a> {
    /// A run that writes a run report and nothing else.
    pub fn new(place: &'a Path, limit: Duration) -> Self {
        Self {
            place,
            limit,
            mesh: None,
            report: true,
            status: false,
            ungraded: false,
            sample_memory: false,
            services: None,
        }
    }

    pub(super) fn report_path(&self) -> PathBuf {
        self.place.join("run.json")
    }

    pub(super) fn status_path(&self) -> PathBuf {
        self.place.join("status")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_on_mpi_has_a_label_and_a_json_form() {
        let layout = Layout {
            partitioner: Some("metis".into()),
            level_base: Some("auto".into()),
            ..Layout::on(Ranks::Mpi(3))
        };
        assert_eq!(layout.to_string(), "3 ranks, metis, base auto");
        let json = serde_json::to_string(&layout).unwrap();
        assert_eq!(json, r#"{"ranks":3,"partitioner":"metis","level_base":"auto"}"#);
        assert_eq!(serde_json::from_str::<Layout>(&json).unwrap(), layout);
    }
}
