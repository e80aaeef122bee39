//! `harness gate`: compares a candidate with a baseline in five layers, from deterministic to noisy: correctness, counters,
//! memory, instructions, time.
//!
//! [`rules`] defines cases, ranks and tolerances; [`subject`] finds or builds the two programs; [`measures`] holds the exact
//! measures of one; [`correctness`], [`numbers`] and [`time`] compare, the last with [`crate::statistics::comparison`];
//! [`report`] is the result, which cannot hold without a comparison of every case.
//!
//! Invariant: times of different sessions are never compared.

pub mod build;
pub mod callgrind;
pub mod correctness;
pub mod known;
pub mod measures;
pub mod numbers;
pub mod phases;
pub mod report;
pub mod rules;
pub mod subject;
pub mod time;

use crate::experiments::machine;
use build::top_level;
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use measures::Measures;
use numbers::Measurement;
use report::{GateFinding, GateReport, Layer, LayerName, Verdict};
use rules::{Rules, Selected};
use run::engine::failure::Failure;
use run::engine::interrupt;
use run::engine::launcher::Launcher;
use run::engine::layout::Ranks;
use run::engine::programs::Programs;
use run::engine::runner::Engine;
use run::verify::options::whole_seconds;
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use subject::{Baseline, Subject};

/// Seed of the schedule of simulated ranks: counters must not depend on it.
const SEED: u64 = 1;

/// The options of a gate, as on the command line.
#[derive(Args, Clone, Debug)]
pub struct GateOptions {
    /// A revision (built and kept), a program, or a record of --record [default: none; the candidate is only measured]
    #[arg(long, value_name = "REVISION|FILE")]
    pub baseline: Option<String>,
    /// A revision, a program, or `.` for the working tree [default: `.` against a revision, else --mesher]
    #[arg(long, value_name = "REVISION|FILE")]
    pub candidate: Option<String>,
    /// Cases, tolerances, rounds [default: harness/engines/gate.toml]
    #[arg(long, value_name = "FILE", value_parser = PathBufValueParser::new().try_map(input))]
    pub rules: Option<PathBuf>,
    /// Only these cases of the rules
    #[arg(long, value_delimiter = ',')]
    pub case: Vec<String>,
    /// Only these layers [default: those for which the rules have a case]
    #[arg(long, value_delimiter = ',')]
    pub layers: Vec<LayerName>,
    /// Exit code 3 if a layer or a case of it was left out
    #[arg(long)]
    pub require_layers: bool,
    /// Seed of the order of runs and of the permutation tests
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = whole_seconds)]
    pub timeout: u64,
    /// Time for one case in the layer of time [default: from the rules]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub budget: Option<f64>,
    /// The repository of the revisions and of the working tree [default: that of the current directory]
    #[arg(long, value_name = "DIR", default_value = ".", hide_default_value = true, value_parser = PathBufValueParser::new().map(|path| top_level(&path)))]
    pub repository: PathBuf,
    /// Where revisions are built and kept [default: target/gate in the repository]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

impl GateOptions {
    /// Where revisions are built and kept.
    fn cache(&self) -> PathBuf {
        self.cache.clone().unwrap_or_else(|| self.repository.join("target/gate"))
    }

    /// Time limit of every single run.
    fn limit(&self) -> Duration {
        Duration::from_secs(self.timeout)
    }
}

/// Parses a time in seconds: more than 0, and at most a week.
fn seconds(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|n| *n > 0.0 && *n <= 604_800.0);
    number.ok_or_else(|| "give a number greater than 0 and at most 604800".to_owned())
}

/// A file that is read, and must not be written.
fn input(path: PathBuf) -> std::io::Result<PathBuf> {
    files::register_input(&path).map(|()| path)
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
    options: &'a GateOptions,
    rules: &'a Rules,
    cases: Vec<Selected>,
    programs: &'a Programs,
    candidate: Engine,
    /// Directory for the files of runs.
    place: &'a std::path::Path,
    /// Why there are no ranks on MPI.
    no_mpi: Option<String>,
    /// Counters and memory, of which each layer takes its own, by program and case.
    counted: RefCell<HashMap<(PathBuf, String), Result<Measurement, Failure>>>,
}

/// Runs all requested layers and returns the report.
///
/// # Errors
/// If the gate cannot start; later failures are in the report.
pub fn gate(options: &GateOptions, programs: &Programs) -> Result<GateReport, GateError> {
    let start = Instant::now();
    let rules =
        Rules::read(options.rules.as_deref().unwrap_or(&programs.paths.engines.join("gate.toml")))?;
    let cases = rules.select(&options.case, programs)?;
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
        no_mpi: no_mpi(&candidate.engine, programs),
        candidate: candidate.engine.clone(),
        place: place.path(),
        counted: RefCell::default(),
    };
    let mpirun = &programs.paths.mpirun;
    let measures = Measures {
        machine: machine::describe(mpirun, &options.repository).label(),
        ..Measures::of_program(candidate.measured)
    };
    let mut report = GateReport::new(baseline.measured(), measures);
    report.require_layers = options.require_layers;
    run_layers(&bench, &baseline, &mut report)?;
    report.interrupted = interrupt::requested();
    report.time_s = start.elapsed().as_secs_f64();
    report.check_invariants();
    Ok(report)
}

/// Returns why an engine cannot be run on MPI.
fn no_mpi(engine: &Engine, programs: &Programs) -> Option<String> {
    let mpirun = &programs.paths.mpirun;
    if !Launcher::mpirun(mpirun).is_found() {
        return Some("mpirun is not on the PATH (ci/setup installs it)".to_owned());
    }
    let description = engine.description();
    let why = || format!("the description of {} has no command for ranks on MPI", description.name);
    description.run.parallel.is_none().then(why)
}

fn run_layers(
    bench: &Bench,
    baseline: &Baseline,
    report: &mut GateReport,
) -> Result<(), GateError> {
    // Without a choice of layers, those are requested for which the rules have a case.
    let requested = |name: &LayerName| match bench.options.layers.is_empty() {
        true => bench.asked(*name).next().is_some(),
        false => bench.options.layers.contains(name),
    };
    for name in LayerName::ALL.into_iter().filter(requested) {
        if interrupt::requested() {
            break;
        }
        let start = Instant::now();
        crate::announce(&format!("harness gate: {name}"));
        let cases = bench.asked(name).map(|case| case.rule.name.clone()).collect();
        let mut layer = Layer::new(name, cases);
        let measures = &mut report.candidate_measures;
        match name {
            LayerName::Correctness => correctness::layer(bench, baseline, measures, &mut layer)?,
            LayerName::Time => time::layer(bench, baseline, &mut layer),
            _ => numbers::layer(bench, baseline, measures, &mut layer),
        }
        layer.findings.extend(bench.cases_left_out(name));
        layer.time_s = start.elapsed().as_secs_f64();
        report.layers.push(layer);
    }
    Ok(())
}

impl Bench<'_> {
    /// Returns the cases for which the rules ask a layer.
    fn asked(&self, layer: LayerName) -> impl Iterator<Item = &Selected> {
        self.cases.iter().filter(move |case| case.rule.layers.contains(&layer))
    }

    /// Returns the cases of a layer that can be run.
    fn cases_of(&self, layer: LayerName) -> impl Iterator<Item = &Selected> {
        self.asked(layer).filter(|case| case.path.is_ok())
    }

    /// Returns the other cases of a layer as findings with their reasons.
    fn cases_left_out(&self, layer: LayerName) -> impl Iterator<Item = GateFinding> {
        self.asked(layer).filter_map(|case| {
            let why = case.path.as_ref().err()?;
            Some(GateFinding::noted(&case.rule.name, "runs", Verdict::LeftOut, why))
        })
    }

    /// Returns the real ranks of a case: those of the rules, and those that the engine cannot simulate.
    fn ranks_on_mpi(&self, case: &Selected) -> Vec<usize> {
        if self.no_mpi.is_some() {
            return Vec::new();
        }
        let simulates = self.candidate.description().run.simulated.is_some();
        let instead =
            case.rule.ranks.iter().filter(|ranks| !simulates && !case.rule.mpi.contains(ranks));
        case.rule.mpi.iter().chain(instead).copied().collect()
    }

    /// Returns the reason for which a case is not run on its real ranks, as a finding.
    fn ranks_left_out(&self, case: &Selected) -> Option<GateFinding> {
        let simulates = self.candidate.description().run.simulated.is_some();
        let asks = !case.rule.mpi.is_empty() || !case.rule.ranks.is_empty() && !simulates;
        let why = self.no_mpi.as_ref().filter(|_| asks)?;
        Some(GateFinding::noted(&case.rule.name, "ranks on MPI", Verdict::LeftOut, why))
    }

    /// Returns the ranks on which a case is counted.
    fn layouts(&self, case: &Selected) -> Vec<Ranks> {
        let simulates = self.candidate.description().run.simulated.is_some();
        let simulated = case.rule.ranks.iter().filter(|_| simulates);
        let simulated = simulated.map(|&ranks| Ranks::Simulated { ranks, seed: SEED });
        let real = self.ranks_on_mpi(case).into_iter().map(Ranks::Mpi);
        std::iter::once(Ranks::Serial).chain(simulated).chain(real).collect()
    }

    /// Returns what a layer measures of a program on a case; counters and memory are of the same runs.
    fn measured(
        &self,
        engine: &Engine,
        case: &Selected,
        layer: LayerName,
    ) -> Result<Measurement, Failure> {
        if layer == LayerName::Instructions {
            return numbers::instructions(self, engine, case);
        }
        let key = (engine.program().to_owned(), case.rule.name.clone());
        if let Some(known) = self.counted.borrow().get(&key) {
            return known.clone();
        }
        let counted = numbers::count(self, engine, case);
        self.counted.borrow_mut().insert(key, counted.clone());
        counted
    }

    /// Creates an empty directory for one run.
    fn enter(&self, name: &str) -> Result<PathBuf, String> {
        let place = self.place.join(name);
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir_all(&place).map_err(|error| error.to_string())?;
        Ok(place)
    }
}
