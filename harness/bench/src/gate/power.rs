//! The power of the gate: how often each layer finds a slow-down of known size, and names the phase that has it.
//!
//! The program under test is [`super::planted`], started by a shell script, as many meshers are. Without a slow-down, what
//! is found is a false alarm.

use super::planted::{Kind, PHASES};
use super::report::{Layer, LayerName, Report, Verdict};
use super::{GateError, Options, gate};
use clap::ValueEnum;
use run::engine::interrupt;
use run::engine::programs::{Given, Programs};
use std::fmt::Write;
use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// The engine file of the programs.
const ENGINE: &str = r#"
about = "a program with planted slow-downs"
program = "{here}/baseline"
reports_memory = true
[run]
serial = ["{program}", "{case}"]
out = ["--out", "{out}"]
json = ["--json", "{json}"]
[takes]
generator = true
"#;

/// The rules. The few allocations are those of reading the arguments, which differ.
const RULES: &str = r#"
[tolerance]
instructions = 0.2
[tolerance.of]
allocations = 2.0
[[case]]
name = "case.toml"
layers = ["counters", "instructions", "time"]
"#;

/// The layers that can find a slow-down.
const LAYERS: [LayerName; 3] = [LayerName::Counters, LayerName::Instructions, LayerName::Time];

/// How often a layer found a slow-down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rate {
    /// Number of gates.
    pub tried: usize,
    /// Gates in which the layer had a regression.
    pub found: usize,
    /// Of these, gates in which it named the right phase and no other.
    pub named: usize,
}

/// The rates for slow-downs of one kind and size.
#[derive(Clone, Debug)]
pub struct Row {
    /// The kind; `None` without a slow-down.
    pub kind: Option<Kind>,
    /// The size, in percent of the time of the whole program.
    pub percent: f64,
    /// By layer, in the order of [`LayerName::ALL`] without correctness.
    pub rates: [Rate; 3],
}

/// Runs the gate `trials` times on slow-downs of every kind and of these sizes, in percent; 0 is none. Trials take turns
/// with the phases, and exact layers are run at most once for every phase. `options` has seed, limits, and the layers to test.
///
/// # Errors
/// If the gate cannot run.
pub fn power(
    sizes: &[f64],
    trials: usize,
    options: &Options,
    harness: &Path,
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<Row>, GateError> {
    let place = tempfile::Builder::new().prefix("harness-power-").tempdir();
    let place =
        place.map_err(|error| GateError::Input(format!("no directory for runs: {error}")))?;
    let test = Test { place: place.path(), harness, options };
    test.write_files().map_err(|error| GateError::Input(error.to_string()))?;
    let mut rows = Vec::new();
    let kinds = Kind::value_variants();
    let all = sizes.iter().flat_map(|&percent| {
        let some = if percent > 0.0 { kinds.len() } else { 0 };
        let none = (percent <= 0.0).then_some((None, 0.0));
        none.into_iter().chain(kinds[..some].iter().map(move |kind| (Some(*kind), percent)))
    });
    for (kind, percent) in all {
        let mut row = Row { kind, percent, rates: Default::default() };
        for trial in 0..trials {
            if interrupt::requested() {
                return Ok(rows);
            }
            progress(&format!("{}, trial {}", described(kind, percent), trial + 1));
            test.trial(&mut row, trial)?;
        }
        rows.push(row);
    }
    Ok(rows)
}

/// The files of the test.
struct Test<'a> {
    place: &'a Path,
    harness: &'a Path,
    options: &'a Options,
}

impl Test<'_> {
    fn write_files(&self) -> io::Result<()> {
        fs::write(self.place.join("engine.toml"), ENGINE)?;
        fs::write(self.place.join("case.toml"), "# The programs do not read it.\n")?;
        self.script("baseline", &arguments(None, 0, 0.0))
    }

    /// Writes a script that starts the program with these arguments.
    fn script(&self, name: &str, arguments: &str) -> io::Result<()> {
        let harness = self.harness.to_string_lossy();
        let harness = shlex::try_quote(&harness).map_err(io::Error::other)?;
        let path = self.place.join(name);
        fs::write(&path, format!("#!/bin/sh\nexec {harness} planted {arguments} \"$@\"\n"))?;
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755))
    }

    /// Runs the gate once and adds the outcome to the row.
    fn trial(&self, row: &mut Row, trial: usize) -> Result<(), GateError> {
        let phase = trial % PHASES.len();
        let arguments = arguments(row.kind, phase, row.percent);
        let wrong = |error: io::Error| GateError::Input(error.to_string());
        self.script("candidate", &arguments).map_err(wrong)?;
        let requested = &self.options.layers;
        let layers: Vec<LayerName> = LAYERS
            .into_iter()
            .filter(|layer| requested.is_empty() || requested.contains(layer))
            .filter(|layer| *layer == LayerName::Time || trial < PHASES.len())
            .collect();
        if layers.is_empty() {
            return Ok(());
        }
        let report = self.gate(layers, trial)?;
        for (rate, name) in row.rates.iter_mut().zip(LAYERS) {
            let layer = report.layers.iter().find(|layer| layer.name == name);
            if let Some(layer) = layer.filter(|layer| layer.left_out.is_none()) {
                rate.tried += 1;
                rate.found += usize::from(layer.verdict() == Verdict::Regression);
                rate.named += usize::from(names(layer, PHASES[phase]));
            }
        }
        Ok(())
    }

    fn gate(&self, layers: Vec<LayerName>, trial: usize) -> Result<Report, GateError> {
        let text = |name: &str| self.place.join(name).to_string_lossy().into_owned();
        let rules = self.place.join("gate.toml");
        fs::write(&rules, RULES).map_err(|error| GateError::Input(error.to_string()))?;
        let options = Options {
            baseline: Some(text("baseline")),
            candidate: Some(text("candidate")),
            rules: Some(rules),
            cases: Vec::new(),
            layers,
            seed: self.options.seed + trial as u64,
            cache: PathBuf::from(self.place),
            ..self.options.clone()
        };
        let programs = Programs::find_with_engine(&text("engine.toml"), Given::default())
            .map_err(GateError::Input)?;
        gate(&options, &programs)
    }
}

/// The arguments of the program. Without a slow-down there are as many, so that reading them costs the same.
fn arguments(kind: Option<Kind>, phase: usize, percent: f64) -> String {
    let kind = kind.unwrap_or(Kind::Counted).to_possible_value().expect("no kind is hidden");
    format!("--kind {} --phase {phase} --percent {percent}", kind.get_name())
}

/// Whether the regressions of a layer name this phase and no other.
fn names(layer: &Layer, guilty: &str) -> bool {
    let bad = layer.findings.iter().filter(|finding| finding.verdict == Verdict::Regression);
    let text: String =
        bad.map(|finding| format!("{} {}\n", finding.metric, finding.note)).collect();
    PHASES.iter().all(|phase| text.contains(phase) == (*phase == guilty))
}

fn described(kind: Option<Kind>, percent: f64) -> String {
    match kind {
        None => "no slow-down".to_owned(),
        Some(Kind::Counted) => format!("{percent} % more operations, counted"),
        Some(Kind::Uncounted) => format!("{percent} % more operations, not counted"),
        Some(Kind::Waiting) => format!("{percent} % waiting"),
    }
}

/// Returns the rates as a table. Waiting is in no phase.
pub fn table(rows: &[Row]) -> String {
    let mut out = format!("{:<42}", "gates that found it, and named its phase");
    for layer in LAYERS {
        let _ = write!(out, " {:>17}", layer.to_string());
    }
    out.push('\n');
    for row in rows {
        let _ = write!(out, "{:<42}", described(row.kind, row.percent));
        for rate in row.rates {
            let text = match (rate.tried, row.kind) {
                (0, _) => "left out".to_owned(),
                (tried, None | Some(Kind::Waiting)) => format!("{} of {tried}", rate.found),
                (tried, _) => format!("{} of {tried}, {} named", rate.found, rate.named),
            };
            let _ = write!(out, " {text:>17}");
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::report::Finding;

    #[test]
    fn the_guilty_phase_must_be_named_alone() {
        let finding = |metric: &str, verdict| Finding::without_numbers("c", metric, verdict, "");
        let mut layer = Layer::new(LayerName::Time);
        layer.findings.push(finding("CPU time", Verdict::Regression));
        assert!(!names(&layer, PHASES[1]));
        layer.findings.push(finding("CPU time in planted_second", Verdict::Regression));
        layer.findings.push(finding("CPU time in planted_third", Verdict::Improvement));
        assert!(names(&layer, PHASES[1]) && !names(&layer, PHASES[0]));
        layer.findings.push(finding("CPU time in planted_first", Verdict::Regression));
        assert!(!names(&layer, PHASES[1]));
    }

    #[test]
    fn a_table_has_a_row_per_slow_down() {
        let rate = Rate { tried: 10, found: 9, named: 8 };
        let row =
            Row { kind: Some(Kind::Counted), percent: 0.3, rates: [rate, Rate::default(), rate] };
        let none = Row { kind: None, percent: 0.0, ..row.clone() };
        let text = table(&[none, row]);
        assert!(text.contains("no slow-down") && text.contains("left out"), "{text}");
        assert!(
            text.contains("0.3 % more operations, counted") && text.contains("9 of 10, 8 named"),
            "{text}"
        );
    }
}
