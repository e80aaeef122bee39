//! The measures, each a function of the medians of the repetitions of runs. reports/README.md defines them.

use crate::experiments::group::Group;
use crate::experiments::pop::{self, UNKNOWN};
use crate::refuse;
use Input::{Against, Alone, Phases, Series};
use contract::number::grouped;
use serde::de::{Deserialize, Deserializer, Error};

/// A quantity. Times are wall times by the program's own clock, or projected times for simulated ranks.
#[derive(Debug)]
pub struct Measure {
    /// Its name in a study file.
    pub name: &'static str,
    /// What it is measured of.
    pub(super) input: Input,
    /// How a value is shown.
    unit: Unit,
    /// The value, or in one sentence what the runs do not report.
    pub(super) of: Value,
}

type Value = fn(&Sample) -> Result<f64, String>;

/// The input of a measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Input {
    /// One run.
    Alone,
    /// A run and the run with which it is compared.
    Against,
    /// Runs in order.
    Series,
    /// Phases of a run.
    Phases,
}

/// The input of a row's measure.
pub(super) struct Sample<'a> {
    /// The first run.
    pub run: &'a Group,
    /// The runs: one, unless the measure is that of a series.
    pub runs: &'a [&'a Group],
    /// The run with which it is compared, or itself.
    pub against: &'a Group,
    /// The requested phases, if any.
    pub phases: &'a [String],
}

/// A factor, a number of decimals, and what follows the number.
type Unit = (f64, usize, &'static str);
const PLAIN: Unit = (1.0, 3, "");
const RATE: Unit = (1e-6, 2, " M cells/s");
const PER_CELL: Unit = (1.0, 3, " B/cell");

const fn measure(name: &'static str, input: Input, unit: Unit, of: Value) -> Measure {
    Measure { name, input, unit, of }
}

/// All measures.
pub static MEASURES: [Measure; 15] = [
    measure("cells_per_second_per_core", Alone, RATE, |s| Ok(s.run.rates().value * 1e6)),
    measure("facets_per_second_per_core", Alone, (1e-6, 2, " M facets/s"), |s| {
        let run = s.run;
        Ok(run.runs[0].facets as f64 / run.time_s.value / run.setup.ranks as f64)
    }),
    measure("seconds", Alone, (1.0, 3, " s"), |s| Ok(s.run.time_s.value)),
    measure("speed_up", Against, PLAIN, |s| match [s.against.cells(), s.run.cells()] {
        [before, cells] if before != cells => {
            let [before, cells] = [before, cells].map(grouped);
            Err(format!("the runs are of different meshes, of {before} and {cells} cells"))
        }
        _ => Ok(s.against.time_s.value / s.run.time_s.value),
    }),
    measure("rate_ratio", Against, PLAIN, |s| Ok(s.run.rates().value / s.against.rates().value)),
    measure("peak_bytes", Alone, (1.0 / (1u64 << 30) as f64, 2, " GiB"), |s| peak(s.run)),
    measure("bytes_per_cell", Alone, PER_CELL, |s| reported(s.run.bytes_per_cell())),
    measure("bytes_per_cell_beyond", Against, PER_CELL, |s| beyond(s.run, s.against)),
    measure("time_per_cell_growth", Series, PLAIN, |s| Ok(growth(s.runs))),
    measure("lambda_cells", Alone, PLAIN, |s| lambda_cells(s.run)),
    measure("lambda_cells_ratio", Against, PLAIN, |s| {
        Ok(lambda_cells(s.run)? / lambda_cells(s.against)?)
    }),
    measure("lambda_cpu", Alone, PLAIN, |s| Ok(pop::imbalance(&s.run.typical).ok_or(UNKNOWN)?)),
    measure("efficiency", Against, PLAIN, |s| match s.against.setup.ranks {
        1 => Ok(s.run.global_efficiency(s.against)),
        ranks => Err(format!("the other run must be on 1 rank, and has {ranks}")),
    }),
    measure("parallel_efficiency", Alone, PLAIN, |s| {
        Ok(s.run.efficiency(s.run).ok_or(UNKNOWN)?.parallel())
    }),
    measure("phase_share", Phases, (100.0, 2, " %"), share),
];

impl Measure {
    /// A value with its unit.
    pub fn show(&self, value: f64) -> String {
        let (factor, decimals, unit) = self.unit;
        let value = value * factor;
        // At least two digits.
        let small = if value == 0.0 { 0.0 } else { 1.0 - value.abs().log10().floor() };
        let decimals = decimals.max(small as usize);
        format!("{value:.decimals$}{unit}")
    }

    /// Whether it is an efficiency, which is 1 if nothing is lost.
    pub(super) fn is_efficiency(&self) -> bool {
        self.name.ends_with("efficiency")
    }
}

/// Reads the name of a measure.
pub(super) fn named<'a, D: Deserializer<'a>>(from: D) -> Result<&'static Measure, D::Error> {
    let name = String::deserialize(from)?;
    MEASURES.iter().find(|measure| measure.name == name).ok_or_else(|| {
        let all: Vec<&str> = MEASURES.iter().map(|measure| measure.name).collect();
        D::Error::custom(format!("unknown variant `{name}`, expected one of {}", all.join(", ")))
    })
}

/// Median over repetitions of the sum of the ranks' peaks. Pages that ranks share count for each rank.
fn peak(run: &Group) -> Result<f64, String> {
    reported(run.median_of(|run| Some(run.peak_rss_bytes.sum).filter(|bytes| *bytes > 0.0)))
}

fn reported(memory: Option<statistics::Median>) -> Result<f64, String> {
    memory.map(|median| median.value).ok_or("no memory of each rank is reported".to_owned())
}

fn lambda_cells(run: &Group) -> Result<f64, String> {
    run.lambda_cells().ok_or("the program does not count leaves by rank".to_owned())
}

/// Marginal memory per cell. The other run has the same facets on equally many ranks at a coarse spacing, so its memory is that of the
/// program, MPI and the facets.
fn beyond(run: &Group, coarse: &Group) -> Result<f64, String> {
    let of = |group: &Group| (group.setup.ranks, group.runs[0].facets);
    let cells = grouped(coarse.cells());
    let many = format!("the other run must have fewer cells, and has {cells}");
    refuse(&[
        (of(run) != of(coarse), "the other run must be of the same facets on as many ranks"),
        (coarse.cells() >= run.cells(), &many),
    ])?;
    Ok((peak(run)? - peak(coarse)?) / (run.cells() - coarse.cells()) as f64)
}

/// The greatest ratio of a time per cell to the least before it.
fn growth(runs: &[&Group]) -> f64 {
    let per_cell = |run: &&Group| run.time_s.value / run.cells().max(1) as f64;
    let times: Vec<f64> = runs.iter().map(per_cell).collect();
    let least = |times: &[f64]| times.iter().copied().fold(f64::INFINITY, f64::min);
    (1..times.len()).map(|i| times[i] / least(&times[..i])).fold(0.0, f64::max)
}

/// The fraction of the time that the named phases take, of which each must exist.
fn share(sample: &Sample) -> Result<f64, String> {
    let (run, network) = (&sample.run.typical, &sample.run.network);
    let names = sample.phases;
    let there: Vec<&str> = run.phases.iter().map(|p| p.name.as_str()).collect();
    if let Some(absent) = names.iter().find(|name| !there.contains(&name.as_str())) {
        return Err(format!("it has no phase {absent}, but {}", there.join(", ")));
    }
    let selected = run.phases.iter().filter(|p| names.contains(&p.name));
    let times = selected.map(|phase| pop::phase_s(run, phase, network));
    Ok(times.sum::<f64>() / pop::time_s(run, network))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{ASSUMED, Comm, Entry, Network, Run, Spread};
    use crate::experiments::group::Groups;
    use crate::testing::line;
    use crate::testing::run;

    const FREE: Network =
        Network { latency_s: 0.0, bandwidth_bytes_per_s: 1e30, measured: true, ..ASSUMED };

    fn group(run: Run) -> Group {
        let lines = [line(Entry::Network(FREE)), line(Entry::Run(Box::new(run)))];
        Groups::of(&lines).all.remove(0)
    }

    fn named(name: &str) -> &'static Measure {
        MEASURES.iter().find(|measure| measure.name == name).unwrap()
    }

    fn value(name: &str, runs: &[&Group], against: Option<&Group>) -> Result<f64, String> {
        let phases = &["b".into()];
        (named(name).of)(&Sample {
            run: runs[0],
            runs,
            against: against.unwrap_or(runs[0]),
            phases,
        })
    }

    /// Returns a group with the given ranks, time and cells.
    fn timed(ranks: usize, time_s: f64, cells: u64) -> Group {
        group(run(Comm::Mpi, cells, &[("a", &vec![time_s; ranks])]))
    }

    #[test]
    fn values_have_at_least_two_digits() {
        for (value, text) in [(0.0, "0.000 s"), (0.0004, "0.00040 s"), (12.3456, "12.346 s")] {
            assert_eq!(named("seconds").show(value), text);
        }
    }

    #[test]
    fn rates_are_per_core() {
        let two = timed(2, 4.0, 800);
        assert_eq!(value("cells_per_second_per_core", &[&two], None), Ok(100.0));
        assert_eq!(value("facets_per_second_per_core", &[&two], None), Ok(1.5));
        assert_eq!(value("seconds", &[&two], None), Ok(4.0));
        let one = timed(1, 7.2, 800);
        assert_eq!(value("speed_up", &[&two], Some(&one)), Ok(1.8));
        assert!((value("rate_ratio", &[&two], Some(&one)).unwrap() - 0.9).abs() < 1e-12);
    }

    #[test]
    fn memory_beyond_the_facets_is_that_of_more_cells() {
        let with = |cells, bytes: &[f64]| {
            let mut r = run(Comm::Mpi, cells, &[("a", &vec![1.0; bytes.len()])]);
            r.peak_rss_bytes = Spread::brief(bytes);
            group(r)
        };
        let (fine, coarse) = (with(1000, &[400.0, 300.0]), with(200, &[150.0, 150.0]));
        assert_eq!(value("peak_bytes", &[&fine], None), Ok(700.0));
        assert_eq!(value("bytes_per_cell", &[&fine], None), Ok(0.7));
        assert_eq!(value("bytes_per_cell_beyond", &[&fine], Some(&coarse)), Ok(0.5));
        assert!(value("bytes_per_cell_beyond", &[&coarse], Some(&fine)).is_err());
        // A program that does not report it is within no bound.
        let unknown = with(1000, &[0.0, 0.0]);
        for name in ["peak_bytes", "bytes_per_cell"] {
            assert!(value(name, &[&unknown], None).unwrap_err().contains("no memory of each rank"));
        }
        let alone = with(200, &[150.0]);
        assert!(value("bytes_per_cell_beyond", &[&fine], Some(&alone)).is_err());
    }

    #[test]
    fn growth_is_detected_anywhere_in_a_series() {
        let of = |times: &[f64]| {
            let groups: Vec<Group> = times.iter().map(|&t| timed(1, t, 100)).collect();
            value("time_per_cell_growth", &groups.iter().collect::<Vec<_>>(), None).unwrap()
        };
        assert_eq!(of(&[8.0, 4.0, 2.0]), 0.5);
        // Less than the first value, but more than the preceding one.
        assert_eq!(of(&[8.0, 2.0, 3.0]), 1.5);
        // A slow rise accumulates.
        assert!((of(&[1.0, 1.04, 1.08]) - 1.08).abs() < 1e-9);
    }

    #[test]
    fn useful_times_that_nobody_reports_meet_no_target() {
        let without_phases = |times: &[f64]| {
            let mut run = run(Comm::Mpi, 100, &[("a", times)]);
            (run.phases, run.useful_s) = (Vec::new(), Spread::default());
            group(run)
        };
        let (one, two) = (without_phases(&[3.0]), without_phases(&[2.0, 2.0]));
        for name in ["lambda_cpu", "parallel_efficiency"] {
            assert!(value(name, &[&two], None).unwrap_err().contains("no phases"), "{name}");
        }
        assert_eq!(value("efficiency", &[&two], Some(&one)), Ok(0.75));
        assert_eq!(value("speed_up", &[&two], Some(&one)), Ok(1.5));
    }

    #[test]
    fn balance_and_efficiency_of_ranks() {
        let one = group(run(Comm::Sim, 100, &[("a", &[6.0]), ("b", &[2.0])]));
        let mut two = run(Comm::Sim, 100, &[("a", &[3.0, 3.0]), ("b", &[2.0, 1.0])]);
        assert!(value("lambda_cells", &[&group(two.clone())], None).is_err());
        two.counters.insert("leaves".into(), Spread::brief(&[55.0, 45.0]));
        let two = group(two);
        let close = |measure, against, expected: f64| {
            let found = value(measure, &[&two], against).unwrap();
            assert!((found - expected).abs() < 1e-6, "{measure}: {found} is not {expected}");
        };
        close("lambda_cells", None, 1.1);
        close("lambda_cpu", None, 5.0 / 4.5);
        close("efficiency", Some(&one), 8.0 / 5.0 / 2.0);
        close("parallel_efficiency", None, 4.5 / 5.0);
        close("phase_share", None, 2.0 / 5.0);
        // Twice the cells on two ranks in the same time: nothing is lost.
        let weak = group(run(Comm::Sim, 200, &[("a", &[6.0, 6.0]), ("b", &[2.0, 2.0])]));
        assert!((value("efficiency", &[&weak], Some(&one)).unwrap() - 1.0).abs() < 1e-9);
        assert!(value("efficiency", &[&weak], Some(&two)).is_err());
        let share = |phases: &[&str]| {
            let phases: Vec<String> = phases.iter().map(|p| (*p).to_owned()).collect();
            let sample = Sample { run: &two, runs: &[&two], against: &two, phases: &phases };
            (named("phase_share").of)(&sample)
        };
        assert_eq!(share(&["a", "b"]), Ok(1.0));
        assert!(share(&["b", "c"]).unwrap_err().contains("no phase c, but a, b"));
    }
}
