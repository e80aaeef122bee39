//! `harness gate`: compares a candidate with a baseline in four layers, from deterministic to noisy: correctness, counters,
//! instructions, time.
//!
//! [`rules`] defines cases and tolerances; [`subject`] finds or builds the two programs; [`measures`] holds the exact measures
//! of one; [`counters`], [`instructions`] and [`time`] compare, the last with [`crate::statistics::comparison`]; [`report`] is
//! the result. [`power`] measures which slow-downs the gate finds, with the program [`planted`].
//!
//! Invariant: times of different sessions are never compared.

pub mod build;
pub mod callgrind;
pub mod correctness;
pub mod counters;
pub mod instructions;
pub mod known;
pub mod measures;
pub mod phases;
pub mod planted;
pub mod power;
pub mod quantity;
pub mod report;
pub mod rules;
pub mod subject;
pub mod time;

use measures::Measures;
use report::{Finding, Layer, LayerName, Report, Verdict};
use rules::{Rules, Selected};
use run::engine::interrupt;
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use subject::{Baseline, Subject};

/// The options of a gate.
#[derive(Clone, Debug)]
pub struct Options {
    /// A revision, a program or a record; `None` to record the candidate only.
    pub baseline: Option<String>,
    /// A revision, a program, or `.` for the working tree.
    pub candidate: Option<String>,
    /// The rules' file.
    pub rules: Option<PathBuf>,
    /// Only these cases of the rules.
    pub cases: Vec<String>,
    /// Only these layers.
    pub layers: Vec<LayerName>,
    /// Seed of the order of runs and of the permutations.
    pub seed: u64,
    /// Time limit of every single run.
    pub limit: Duration,
    /// Seconds for timing one case, instead of the rules'.
    pub budget_s: Option<f64>,
    /// The root directory of the repository with the revisions and the working tree.
    pub repository: PathBuf,
    /// Where revisions are built and kept.
    pub cache: PathBuf,
}

/// Why a gate could not start.
#[derive(Debug, thiserror::Error)]
pub enum GateError {
    /// Invalid input.
    #[error("{0}")]
    Input(String),
    /// A required program is missing.
    #[error("{0}")]
    Missing(String),
}

/// The input of every layer.
#[derive(Debug)]
pub struct Bench<'a> {
    /// The options.
    pub options: &'a Options,
    /// Cases and tolerances.
    pub rules: &'a Rules,
    /// The selected cases.
    pub cases: Vec<Selected>,
    /// The programs.
    pub programs: &'a Programs,
    /// The candidate.
    pub candidate: Engine,
    /// Directory for the files of runs.
    pub place: &'a std::path::Path,
}

/// Runs all requested layers and returns the report.
///
/// # Errors
/// If the gate cannot start; later failures are in the report.
pub fn gate(options: &Options, programs: &Programs) -> Result<Report, GateError> {
    let start = Instant::now();
    let rules =
        Rules::read(options.rules.as_deref().unwrap_or(&programs.paths.engines.join("gate.toml")))?;
    let cases = rules.select(&options.cases, programs)?;
    let baseline = Baseline::find(options, &programs.engine)?;
    let candidate = Subject::candidate(options, &programs.engine, &baseline)?;
    let place = tempfile::Builder::new().prefix("harness-gate-").tempdir();
    let place =
        place.map_err(|error| GateError::Input(format!("no directory for runs: {error}")))?;
    let bench = Bench {
        options,
        rules: &rules,
        cases,
        programs,
        candidate: candidate.engine.clone(),
        place: place.path(),
    };
    let mut report = Report::new(baseline.measured(), candidate.measured.clone());
    report.candidate_measures = Measures::of_program(candidate.measured);
    run_layers(&bench, &baseline, &mut report)?;
    report.interrupted = interrupt::requested();
    report.time_s = start.elapsed().as_secs_f64();
    Ok(report)
}

fn run_layers(bench: &Bench, baseline: &Baseline, report: &mut Report) -> Result<(), GateError> {
    // Without a choice of layers, those are requested for which the rules have a case.
    let has_case =
        |name: &LayerName| bench.cases.iter().any(|case| case.rule.layers.contains(name));
    let requested = |name: &LayerName| match bench.options.layers.is_empty() {
        true => has_case(name),
        false => bench.options.layers.contains(name),
    };
    for name in LayerName::ALL.into_iter().filter(requested) {
        if interrupt::requested() {
            break;
        }
        let start = Instant::now();
        crate::announce(&format!("harness gate: {name}"));
        let mut layer = match name {
            LayerName::Correctness => {
                correctness::layer(bench, baseline, &mut report.candidate_measures)?
            }
            LayerName::Counters => counters::layer(bench, baseline, &mut report.candidate_measures),
            LayerName::Instructions => {
                instructions::layer(bench, baseline, &mut report.candidate_measures)
            }
            LayerName::Time => time::layer(bench, baseline),
        };
        layer.findings.extend(bench.left_out_of(name));
        layer.note_nothing_examined();
        layer.time_s = start.elapsed().as_secs_f64();
        report.layers.push(layer);
    }
    Ok(())
}

impl Bench<'_> {
    /// Returns the cases of a layer that can be run.
    fn cases_of(&self, layer: LayerName) -> impl Iterator<Item = &Selected> {
        let of_layer = self.cases.iter().filter(move |case| case.rule.layers.contains(&layer));
        of_layer.filter(|case| case.path.is_ok())
    }

    /// Returns the other cases of a layer as findings with their reasons.
    fn left_out_of(&self, layer: LayerName) -> impl Iterator<Item = Finding> {
        let of_layer = self.cases.iter().filter(move |case| case.rule.layers.contains(&layer));
        of_layer.filter_map(|case| {
            let why = case.path.as_ref().err()?;
            Some(Finding::without_numbers(&case.rule.name, "runs", Verdict::LeftOut, why))
        })
    }

    /// Creates an empty directory for one run.
    fn enter(&self, name: &str) -> Result<PathBuf, String> {
        let place = self.place.join(name);
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir_all(&place).map_err(|error| error.to_string())?;
        Ok(place)
    }
}

/// Returns a skipped layer with the reason.
pub(crate) fn left_out(name: LayerName, why: impl Into<String>) -> Layer {
    Layer { left_out: Some(why.into()), ..Layer::new(name) }
}
