//! The layer of instructions: instructions and allocations of a serial run under valgrind, of all its processes. They do not depend on the load of the
//! machine, so a difference of a percent is significant.

use super::callgrind::Profile;
use super::measures::{CaseMeasures, Measures};
use super::report::{Finding, Layer, LayerName, Verdict};
use super::rules::Selected;
use super::subject::Baseline;
use super::{Bench, left_out};
use run::engine::interrupt;
use run::engine::layout::SERIAL;
use run::engine::options::RunOptions;
use run::engine::paths::on_path;
use run::engine::process::{self, Watch};
use run::engine::runner::Engine;
use std::path::Path;
use std::process::Command;

const VALGRIND: &str = "valgrind";

/// Number of functions named if instructions grew.
const FUNCTIONS_SHOWN: usize = 3;

/// Compares the instructions of candidate and baseline.
pub fn layer(bench: &Bench, baseline: &Baseline, measures: &mut Measures) -> Layer {
    if on_path(VALGRIND).is_none() {
        return left_out(LayerName::Instructions, "valgrind is not on the PATH");
    }
    let mut layer = Layer::new(LayerName::Instructions);
    for case in bench.cases_of(LayerName::Instructions) {
        if interrupt::requested() {
            break;
        }
        let name = &case.rule.name;
        let finding = |verdict, why: String| {
            vec![Finding::without_numbers(name, "instructions", verdict, why)]
        };
        layer.findings.extend(match count(bench, &bench.candidate, case) {
            Ok(new) => {
                measures.case(name).counted = numbers(&new).into();
                match baseline {
                    Baseline::None => Vec::new(),
                    Baseline::Record(_, record) => match record.cases.get(name) {
                        Some(old) if !old.counted.is_empty() => {
                            against_record(bench, case, old, &new)
                        }
                        _ => finding(
                            Verdict::Inconclusive,
                            "the record does not contain them".into(),
                        ),
                    },
                    Baseline::Program(subject) => match count(bench, &subject.engine, case) {
                        Ok(old) => against_program(bench, case, &old, &new),
                        Err(why) => {
                            finding(Verdict::Inconclusive, format!("the baseline has none: {why}"))
                        }
                    },
                }
            }
            Err(why) => finding(Verdict::Inconclusive, why),
        });
    }
    layer
}

fn numbers(profile: &Profile) -> [(String, u64); 2] {
    [("instructions".into(), profile.instructions), ("allocations".into(), profile.allocations())]
}

fn against_record(
    bench: &Bench,
    case: &Selected,
    old: &CaseMeasures,
    new: &Profile,
) -> Vec<Finding> {
    let numbers = numbers(new);
    let both =
        numbers.iter().filter_map(|(metric, new)| Some((metric, *old.counted.get(metric)?, *new)));
    both.map(|(metric, old, new)| within_tolerance(bench, case, metric, old, new)).collect()
}

fn against_program(bench: &Bench, case: &Selected, old: &Profile, new: &Profile) -> Vec<Finding> {
    let both = numbers(old).into_iter().zip(numbers(new));
    let mut findings: Vec<Finding> = both
        .map(|((metric, old), (_, new))| within_tolerance(bench, case, &metric, old, new))
        .collect();
    if matches!(findings[0].verdict, Verdict::Regression | Verdict::Improvement) {
        let grown = new.grown_since(old).into_iter().take(FUNCTIONS_SHOWN);
        let functions: Vec<String> = grown.map(|(name, by)| format!("{by:+} in {name}")).collect();
        let note = &mut findings[0].note;
        note.push_str(&format!(
            "{}mostly {}",
            if note.is_empty() { "" } else { "; " },
            functions.join(", ")
        ));
    }
    findings
}

/// A change within the tolerance counts as unchanged: hash seeds and addresses vary the count slightly.
fn within_tolerance(bench: &Bench, case: &Selected, metric: &str, old: u64, new: u64) -> Finding {
    let rules = &bench.rules.tolerance;
    let tolerance = rules.of_metric(&case.rule, metric, rules.instructions);
    let found = Finding::exact(&case.rule.name, metric, old, new, tolerance);
    match found.change_percent {
        Some(change) if change.abs() <= tolerance => {
            Finding { verdict: Verdict::Unchanged, note: String::new(), ..found }
        }
        _ => found,
    }
}

fn count(bench: &Bench, engine: &Engine, case: &Selected) -> Result<Profile, String> {
    let path = case.path.clone()?;
    let place = bench.enter("instructions")?;
    let path = engine.prepare(&path, &place.join("case"))?;
    // Without output files, the count is that of meshing alone.
    let options = RunOptions { report: false, ..RunOptions::new(&place, bench.options.limit) };
    let plain = engine.command(&path, &SERIAL, &options).map_err(|why| why.to_string())?;
    let mut command = Command::new(VALGRIND);
    // The program may be started by a script, and may start others.
    command.args(["--tool=callgrind", "--compress-pos=no", "--trace-children=yes"]);
    command.arg(format!("--callgrind-out-file={}.%p", place.join(PROFILE).display()));
    command.arg(plain.get_program()).args(plain.get_args());
    command.envs(plain.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let watch = Watch::new(VALGRIND, bench.options.limit, &place);
    process::run(&mut command, &watch).map_err(|failure| failure.to_string())?;
    profile_of_all(&place)
}

/// Beginning of the names of the profiles.
const PROFILE: &str = "callgrind.out";

/// The sum of the profiles of all processes.
fn profile_of_all(place: &Path) -> Result<Profile, String> {
    let wrong = |error: std::io::Error| format!("{}: {error}", place.display());
    let mut sum = Profile::default();
    for entry in std::fs::read_dir(place).map_err(wrong)? {
        let entry = entry.map_err(wrong)?;
        if entry.file_name().to_string_lossy().starts_with(PROFILE) {
            sum.add(&Profile::parse(&std::fs::read_to_string(entry.path()).map_err(wrong)?));
        }
    }
    match sum.instructions {
        0 => Err("valgrind wrote no profile with costs".into()),
        _ => Ok(sum),
    }
}
