//! Cases and tolerances of a gate: `engines/gate.toml`, or a user's file of the same format.

use super::measures::LayerName;
use crate::{read_toml, refuse};
use contract::case::Case;
use contract::failure::{Failure, Result};
use run::engine::layout::Ranks;
use run::engine::runner::Programs;
use serde::Deserialize;
use statistics::comparison::rounds_min;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The content of the file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rules {
    /// Tolerances of all cases.
    pub tolerance: Tolerance,
    /// How times are compared.
    pub time: TimeRules,
    /// The cases.
    #[serde(rename = "case")]
    pub cases: Vec<GateCase>,
}

/// Tolerated growth, in percent.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tolerance {
    /// Default for counters.
    pub counters: f64,
    /// Default for instructions.
    pub instructions: f64,
    /// Default for peak memory.
    pub memory: f64,
    /// By metric.
    pub of: BTreeMap<String, f64>,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self { counters: 0.0, instructions: 1.0, memory: 10.0, of: BTreeMap::new() }
    }
}

/// How times are compared.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TimeRules {
    /// Minimum number of rounds, regardless of the time.
    pub rounds_min: usize,
    /// Maximum number of rounds.
    pub rounds_max: usize,
    /// Time for one case, serially and on each number of ranks, in seconds; what looks like a change is measured twice.
    pub budget_s: f64,
    /// Greatest rate of false discoveries among all quantities of all cases; the probability of a false alarm per run.
    pub alpha: f64,
    /// Smaller effects are ignored; percent.
    pub effect_min: f64,
    /// "Unchanged" requires that an effect of this size would have been detected; percent.
    pub effect_wanted: f64,
}

impl Default for TimeRules {
    fn default() -> Self {
        let (rounds_min, rounds_max, budget_s) = (15, 120, 20.0);
        let (alpha, effect_min, effect_wanted) = (0.001, 1.0, 10.0);
        Self { rounds_min, rounds_max, budget_s, alpha, effect_min, effect_wanted }
    }
}

/// A case.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GateCase {
    /// Name in the catalogue. The file may have the path of a case file here, whose stem becomes the name: records must not depend on the
    /// directory of a checkout.
    pub name: String,
    /// Layers that include the case.
    pub layers: Vec<LayerName>,
    /// Numbers of simulated ranks on which counters and memory are also compared; ranks on MPI for an engine without them.
    #[serde(default)]
    pub ranks: Vec<usize>,
    /// Numbers of ranks on MPI on which correctness, counters, memory and time are also compared.
    #[serde(default)]
    pub mpi: Vec<usize>,
    /// Its file; empty for one of the catalogue until it is selected.
    #[serde(skip)]
    pub file: PathBuf,
    /// Why it cannot be run: its geometry is missing, or the engine does not support it.
    #[serde(skip)]
    pub absent: Option<String>,
    /// Why it is not run on ranks of MPI although the rules ask for them.
    #[serde(skip)]
    pub no_mpi: Option<String>,
}

impl GateCase {
    /// The ranks on which it is counted: serially, then those of the rules.
    pub fn layouts(&self) -> impl Iterator<Item = Ranks> {
        let simulated = self.ranks.iter().map(|&ranks| Ranks::Simulated { ranks, seed: SEED });
        let real = self.mpi.iter().copied().map(Ranks::Mpi);
        std::iter::once(Ranks::Serial).chain(simulated).chain(real)
    }

    /// Finds what this machine and an engine lack to run it; ranks that the engine cannot simulate become ranks on MPI.
    fn find(mut self, programs: &Programs) -> Result<Self> {
        if self.file.as_os_str().is_empty() {
            let found = programs.paths.catalogue.named(&self.name)?;
            (self.file, self.absent) = (found.path, found.absent);
        }
        self.file = std::path::absolute(&self.file)?;
        let engine = &programs.engine.description;
        // Only a geometry that has to be fetched may be missing.
        if self.absent.is_none() {
            self.absent = engine.declines(&Case::read(&self.file)?);
        }
        if engine.run.simulated.is_empty() {
            let unknown = |ranks: &usize| !self.mpi.contains(ranks);
            let more: Vec<usize> = self.ranks.drain(..).filter(unknown).collect();
            self.mpi.extend(more);
        }
        self.no_mpi = programs.engine.lacks_mpi().filter(|_| !self.mpi.is_empty());
        if self.no_mpi.is_some() {
            self.mpi.clear();
        }
        Ok(self)
    }
}

/// Seed of the schedule of simulated ranks: counters must not depend on it.
const SEED: u64 = 1;

impl Rules {
    /// Reads a file of rules.
    ///
    /// # Errors
    /// If the file is missing or invalid.
    pub fn read(path: &Path) -> Result<Self> {
        let mut rules: Self = read_toml(path)?;
        for case in rules.cases.iter_mut().filter(|case| case.name.ends_with(".toml")) {
            let file = path.with_file_name(&case.name);
            case.name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            case.file = file;
        }
        rules.check().map_err(|why| Failure::about(path, why))?;
        Ok(rules)
    }

    /// Checks that there are cases, each with a name of its own and something to compare, and that times can be compared.
    fn check(&self) -> Result<(), String> {
        let TimeRules { alpha, rounds_min: fewest, rounds_max, .. } = self.time;
        let TimeRules { effect_min, effect_wanted, budget_s, .. } = &self.time;
        let is_level = (1e-6..0.5).contains(&alpha);
        let least = if is_level { rounds_min(alpha) } else { 0 };
        let few = format!(
            "rounds_min must be at least {least} for this alpha, and rounds_max at least rounds_min"
        );
        let Tolerance { counters, instructions, memory, of } = &self.tolerance;
        let numbers = [counters, instructions, memory, effect_min, effect_wanted, budget_s];
        let are_ordinary = numbers.into_iter().chain(of.values()).all(|n| (0.0..=1e6).contains(n));
        refuse(&[
            (!is_level, "alpha must be at least 1e-6 and less than 0.5"),
            (fewest < least || rounds_max < fewest, &few),
            (self.cases.is_empty(), "it has no [[case]], so there is nothing to compare"),
            (!are_ordinary, "tolerances, effects and budget_s must be between 0 and 1000000"),
        ])?;
        for (i, case) in self.cases.iter().enumerate() {
            let is_second = self.cases[..i].iter().any(|other| other.name == case.name);
            let has_one = case.ranks.iter().chain(&case.mpi).any(|ranks| *ranks < 2);
            refuse(&[
                (case.layers.is_empty(), "has no layers"),
                (is_second, "is there twice"),
                (has_one, "has ranks below 2: the serial run is always there"),
            ])
            .map_err(|why| format!("case {} {why}", case.name))?;
        }
        Ok(())
    }

    /// Returns the named cases, or all if no name is given.
    ///
    /// # Errors
    /// If a name is missing from the rules or the catalogue, or a case cannot be read.
    pub fn select(&self, names: &[String], programs: &Programs) -> Result<Vec<GateCase>> {
        let known: Vec<&str> = self.cases.iter().map(|case| case.name.as_str()).collect();
        if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
            let known = known.join(", ");
            return Err(format!("no case {name} in the gate's rules, which have {known}").into());
        }
        let named = |case: &&GateCase| names.is_empty() || names.contains(&case.name);
        self.cases.iter().filter(named).map(|case| case.clone().find(programs)).collect()
    }
}

impl Tolerance {
    /// Returns the names in `of` that none of these metrics has: a misspelt name leaves its quantity with the tolerance of its layer.
    pub fn unused(&self, metrics: &[&String]) -> Vec<&str> {
        let has = |name: &str| metrics.iter().any(|of| *of == name || plain(of) == name);
        self.of.keys().map(String::as_str).filter(|name| !has(name)).collect()
    }

    /// Returns the tolerated growth of a metric in percent: its own, else that of the layer.
    pub fn of_metric(&self, metric: &str, layer: LayerName) -> f64 {
        let own = self.of.get(metric).or_else(|| self.of.get(plain(metric)));
        own.copied().unwrap_or(match layer {
            LayerName::Memory => self.memory,
            LayerName::Instructions => self.instructions,
            _ => self.counters,
        })
    }
}

/// "4 ranks/messages" is also known as "messages".
fn plain(metric: &str) -> &str {
    metric.rsplit('/').next().unwrap_or(metric)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    fn read(text: &str) -> Result<Rules, String> {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("gate.toml");
        std::fs::write(&path, text).unwrap();
        Rules::read(&path).map_err(|failure| failure.why)
    }

    #[test]
    fn the_rules_of_this_repository_are_valid() {
        let text = include_str!("../../../engines/gate.toml");
        let rules = read(text).unwrap();
        let all = LayerName::value_variants();
        assert!(all.iter().all(|l| rules.cases.iter().any(|c| c.layers.contains(l))));
    }

    #[test]
    fn the_tolerance_of_a_metric_precedes_that_of_the_layer() {
        let text = "[tolerance.of]\nmessages = 5.0\n'2 ranks/rays' = 1.0\n[[case]]\nname = 'a'\nlayers = ['counters']\n";
        let rules = read(text).unwrap();
        let of = |metric| rules.tolerance.of_metric(metric, LayerName::Memory);
        assert_eq!([of("4 ranks/messages"), of("2 ranks/rays"), of("rays")], [5.0, 1.0, 10.0]);
        let measured = ["4 ranks/messages", "3 ranks/rays", "rays"].map(str::to_owned);
        let unused = rules.tolerance.unused(&measured.each_ref());
        assert_eq!(unused, ["2 ranks/rays"]);
    }

    /// Records of two checkouts continue each other.
    #[test]
    fn a_case_is_named_by_its_file_wherever_that_is() {
        let of = |cases: &str| {
            let place = tempfile::tempdir().unwrap();
            let path = place.path().join("gate.toml");
            let cases = cases.replace("HERE", place.path().to_str().unwrap());
            std::fs::write(&path, cases).unwrap();
            Rules::read(&path).map(|rules| rules.cases[0].name.clone())
        };
        let case = |name: &str| format!("[[case]]\nname = '{name}'\nlayers = ['counters']\n");
        for name in ["HERE/mesh/ring.toml", "../mesh/ring.toml", "ring.toml", "ring"] {
            assert_eq!(of(&case(name)).unwrap(), "ring", "{name}");
        }
        let two = of(&(case("a/ring.toml") + &case("b/ring.toml"))).unwrap_err();
        assert!(two.why.contains("case ring is there twice"), "{two}");
    }

    #[test]
    fn invalid_rules_are_rejected() {
        let case = "[[case]]\nname = 'a'\nlayers = ['time']\n";
        let wrong = |text: &str| read(&format!("{text}\n{case}")).unwrap_err();
        assert!(wrong("[time]\nrounds_min = 3").contains("rounds_min"));
        assert!(wrong("[time]\nalpha = 1e-7").contains("alpha"));
        // An effect that none exceeds would make every time unchanged.
        for key in
            ["effect_min = inf", "effect_wanted = nan", "effect_min = -1.0", "budget_s = nan"]
        {
            assert!(wrong(&format!("[time]\n{key}")).contains("effects and budget_s"), "{key}");
        }
        assert!(wrong(case).contains("case a is there twice"));
        assert!(wrong(&format!("{}ranks = [1]", case.replace("'a'", "'b'"))).contains("below 2"));
        assert!(wrong("[[case]]\nname = 'b'\nlayers = []").contains("case b has no layers"));
        assert!(read("").unwrap_err().contains("no [[case]]"));
        assert!(read("[[case]]\nname = 'a'\nlayers = ['luck']").unwrap_err().contains("luck"));
    }
}
