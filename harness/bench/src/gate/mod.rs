//! `harness gate`: compares a candidate with a baseline in five layers, from deterministic to noisy: correctness, counters,
//! memory, instructions, time.
//!
//! `rules` defines cases, ranks and tolerances; `subject` finds or builds the two programs; [`measures`] holds the exact
//! measures of one; `correctness`, [`numbers`] and `time` compare, the last with [`statistics::comparison`];
//! [`report`] is the result, which cannot hold without a comparison of every case.
//!
//! Invariant: times of different sessions are never compared.

mod correctness;
pub mod measures;
pub mod numbers;
pub mod report;
pub mod rules;
mod subject;
pub mod time;

use crate::emptied;
use crate::experiments::machine::{self, digest_of};
use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use contract::failure::{Failure, Result};
use measures::{LayerName, Measures};
use report::{GateFinding, GateReport, Layer, Verdict};
use rules::GateCase;
pub use rules::Rules;
use run::engine::failure::Failure as Ended;
use run::engine::interrupt;
use run::engine::paths::Input;
use run::engine::runner::{Engine, Programs};
use run::verify::options::whole_seconds;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use subject::{Counted, Subject, top_level};

/// The options of a gate, as on the command line.
#[derive(Args, Clone, Debug)]
pub struct GateOptions {
    /// A revision (built), or a program [default: none; the candidate is only measured]
    #[arg(long, value_name = "REVISION|FILE")]
    pub baseline: Option<String>,
    /// A revision, a program, or `.` for the working tree [default: `.` against a revision, else --mesher]
    #[arg(long, value_name = "REVISION|FILE", conflicts_with = "mesher")]
    pub candidate: Option<String>,
    /// Cases, tolerances, rounds [default: harness/engines/gate.toml]
    #[arg(long, value_name = "FILE")]
    pub rules: Option<Input>,
    /// Only these cases of the rules
    #[arg(long, value_delimiter = ',')]
    pub case: Vec<String>,
    /// Only these layers [default: those for which the rules have a case]
    #[arg(long, value_delimiter = ',')]
    pub layers: Vec<LayerName>,
    /// Exit code 3 if a layer or a case of it was left out
    #[arg(long)]
    pub require_layers: bool,
    /// Accept that meshes differ from the baseline's: of cases whose correctness is compared, nothing else must be, and the gate may hold
    #[arg(long, requires = "baseline")]
    pub accept_meshes: bool,
    /// Seed of the order of runs and of the permutation tests
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value = "600", value_parser = whole_seconds)]
    pub timeout: Duration,
    /// Time for one case in the layer of time, serially and on each number of ranks [default: from the rules]
    #[arg(long, value_name = "SECONDS", value_parser = whole_seconds)]
    pub budget: Option<Duration>,
    /// The repository of the revisions and of the working tree [default: that of the current directory]
    #[arg(long, value_name = "DIR", default_value = ".", hide_default_value = true, value_parser = PathBufValueParser::new().map(|path| top_level(&path)))]
    pub repository: PathBuf,
}

/// The input of every layer.
struct Bench<'a> {
    options: &'a GateOptions,
    rules: &'a Rules,
    cases: Vec<GateCase>,
    programs: &'a Programs,
    candidate: Subject,
    /// What the candidate is compared with; `None` if it is only measured.
    baseline: Option<Subject>,
    /// Directory for the files of runs.
    place: &'a Path,
}

/// Runs all requested layers and returns the report.
///
/// # Errors
/// If the gate cannot start, or a program was replaced meanwhile; other failures are in the report.
pub fn gate(options: &GateOptions, programs: &Programs) -> Result<GateReport> {
    let start = Instant::now();
    let default = programs.paths.root.join("harness/engines/gate.toml");
    let why = "the rules of the repository are missing: give --rules FILE, or set HARNESS_ROOT to the repository";
    Failure::unless(options.rules.is_some() || default.is_file(), why)?;
    let rules = Rules::read(options.rules.as_deref().unwrap_or(&default))?;
    let cases = rules.select(&options.case, programs)?;
    let engine = &programs.engine;
    let baseline = options.baseline.as_ref().map(|named| Subject::find(named, options, engine));
    let baseline = baseline.transpose()?;
    let candidate = Subject::candidate(options, engine, baseline.as_ref())?;
    let place = tempfile::Builder::new().prefix("harness-gate-").tempdir()?;
    let machine = machine::describe(&programs.paths.mpirun, &options.repository, "").label();
    let measures = Measures { machine, ..Measures::of_program(candidate.measured.clone()) };
    let of_baseline = baseline.as_ref().map(|subject| subject.measured.clone());
    let mut report = GateReport::new(of_baseline, measures);
    let (rules, place) = (&rules, place.path());
    let bench = Bench { options, rules, cases, programs, candidate, baseline, place };
    report.require_layers = options.require_layers;
    run_layers(&bench, &mut report)?;
    report.interrupted = interrupt::requested();
    for Subject { engine, measured, .. } in bench.baseline.iter().chain([&bench.candidate]) {
        let is_same = report.interrupted || digest_of(engine.files()) == measured.program;
        let why = format!("{} was replaced while it was measured: repeat the gate", measured.named);
        Failure::unless(is_same, why)?;
    }
    report.time_s = start.elapsed().as_secs_f64();
    report.check_invariants();
    Ok(report)
}

fn run_layers(bench: &Bench, report: &mut GateReport) -> Result<()> {
    // Without a choice of layers, those are requested for which the rules have a case.
    let given = &bench.options.layers;
    let is_asked = |name: &LayerName| given.is_empty() && bench.asked(*name).next().is_some();
    let requested = |name: &LayerName| given.contains(name) || is_asked(name);
    let names = LayerName::value_variants().iter().copied().filter(requested);
    for name in names.take_while(|_| !interrupt::requested()) {
        let start = Instant::now();
        crate::announce(&format!("harness gate: {name}"));
        let cases = bench.asked(name).map(|case| case.name.clone()).collect();
        let (mut layer, measures) = (Layer::new(name, cases), &mut report.candidate_measures);
        match name {
            LayerName::Correctness => correctness::layer(bench, &mut layer)?,
            LayerName::Time => time::layer(bench, &mut layer),
            _ => numbers::layer(bench, measures, &mut layer),
        }
        let on_ranks = name != LayerName::Instructions && layer.left_out.is_none();
        for case in bench.asked(name) {
            let no_mpi = case.no_mpi.as_ref().filter(|_| on_ranks && case.absent.is_none());
            let notes = [("runs", case.absent.as_ref()), ("ranks on MPI", no_mpi)];
            layer.findings.extend(notes.into_iter().filter_map(|(metric, why)| {
                Some(GateFinding::noted(&case.name, metric, Verdict::LeftOut, why?))
            }));
        }
        layer.time_s = start.elapsed().as_secs_f64();
        report.push(layer);
    }
    let measured = report.candidate_measures.cases.values();
    let numbers = measured.flat_map(|of| [&of.exact, &of.memory, &of.counted]);
    let names: Vec<&String> = numbers.flat_map(BTreeMap::keys).collect();
    let is_compared =
        |found: &GateFinding| !matches!(found.verdict, Verdict::LeftOut | Verdict::Missing);
    let is_made = |of: &Layer| of.left_out.is_none() && of.findings.iter().all(is_compared);
    let is_whole = given.is_empty() && bench.options.case.is_empty() && !interrupt::requested();
    let is_whole = is_whole && report.layers.iter().all(is_made);
    for name in bench.rules.tolerance.unused(&names).into_iter().filter(|_| is_whole) {
        let why = "no quantity that was measured has this name";
        crate::announce(&format!("harness gate: the tolerance of {name:?} is not used: {why}"));
    }
    Ok(())
}

impl Bench<'_> {
    /// Returns the cases for which the rules ask a layer.
    fn asked(&self, layer: LayerName) -> impl Iterator<Item = &GateCase> {
        self.cases.iter().filter(move |case| case.layers.contains(&layer))
    }

    /// Returns the cases of a layer that can be run, until the user interrupts it.
    fn cases_of(&self, layer: LayerName) -> impl Iterator<Item = &GateCase> {
        let runs = self.asked(layer).filter(|case| case.absent.is_none());
        runs.take_while(|_| !interrupt::requested())
    }

    /// Returns what a layer measures of a program on a case; counters and memory are of the same runs.
    fn measured(&self, subject: &Subject, case: &GateCase, layer: LayerName) -> Counted {
        if layer == LayerName::Instructions {
            return numbers::instructions(self, &subject.engine, case);
        }
        let count = || numbers::count(self, &subject.engine, case);
        subject.counted.borrow_mut().entry(case.name.clone()).or_insert_with(count).clone()
    }

    /// Returns the file of a case in a form that an engine reads.
    fn prepare(&self, engine: &Engine, case: &GateCase, name: &str) -> Result<PathBuf, Ended> {
        let place = emptied(self.place.join(name), engine)?.join("case");
        engine.prepare(&case.file, &place).map_err(|failure| engine.unusable(failure.why))
    }
}
