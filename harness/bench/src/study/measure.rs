//! The measures, each a function of the medians of the repetitions of runs.

use crate::experiments::entry::{Audited, Comm, Network, Phase};
use crate::experiments::group::Group;
use crate::experiments::number::grouped;
use crate::experiments::pop;
use crate::statistics::median;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A quantity. Times are wall times by the program's own clock, or projected times for simulated ranks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Cells / time / ranks.
    CellsPerSecondPerCore,
    /// Facets / time / ranks.
    FacetsPerSecondPerCore,
    /// Time.
    Seconds,
    /// The other run's time over this one's.
    SpeedUp,
    /// Cells per second and core over the other run's.
    RateRatio,
    /// Peak resident memory of all ranks together.
    PeakBytes,
    /// Peak resident memory of all ranks per cell.
    BytesPerCell,
    /// Marginal memory per cell: the difference in peak memory from the other run over the difference in cells. The other run has the
    /// same facets on equally many ranks at a coarse spacing, so its memory is that of the program, MPI and the facets.
    BytesPerCellBeyond,
    /// For runs in order: the maximum ratio of time per cell to the minimum of the preceding runs; at most 1 if it never grew.
    TimePerCellGrowth,
    /// Maximum over mean of the cells per rank.
    LambdaCells,
    /// Maximum over mean of the CPU time per rank outside communication calls; the time of a rank is the median over repetitions.
    LambdaCpu,
    /// CPU time per cell of the other run, which is on one rank, over ranks * time per cell. For the same mesh this is the
    /// speed-up over ranks; if cells grow with ranks, it is the weak efficiency.
    Efficiency,
    /// Mean CPU time of the ranks outside communication calls over time: the parallel efficiency of POP.
    ParallelEfficiency,
    /// Time of one or more phases on the slowest rank, including messages, over the time of the run.
    PhaseShare,
    /// 1 if every check of `harness audit` holds, otherwise 0.
    AuditHolds,
    /// Cells over CPU time of `harness audit`.
    AuditCellsPerSecondPerCore,
    /// Peak resident memory of `harness audit`.
    AuditPeakBytes,
}

/// The input of a measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One run.
    Alone,
    /// A run and the run with which it is compared.
    Against,
    /// Runs in order.
    Series,
    /// A mesh on disk.
    Audit,
}

/// The input of a row's measure.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// The runs: one, unless the measure is that of a series.
    pub runs: &'a [&'a Group],
    /// The run with which it is compared.
    pub against: Option<&'a Group>,
    /// The requested phases, if any.
    pub phases: &'a [String],
    /// Latency and bandwidth of messages.
    pub network: &'a Network,
}

impl fmt::Display for Measure {
    /// Its name in a targets file.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&crate::name_of(self))
    }
}

impl Measure {
    /// Returns its input.
    pub fn kind(self) -> Kind {
        match self {
            Self::SpeedUp | Self::RateRatio | Self::BytesPerCellBeyond | Self::Efficiency => {
                Kind::Against
            }
            Self::TimePerCellGrowth => Kind::Series,
            Self::AuditHolds | Self::AuditCellsPerSecondPerCore | Self::AuditPeakBytes => {
                Kind::Audit
            }
            _ => Kind::Alone,
        }
    }

    /// Whether it is an efficiency, which is 1 if nothing is lost.
    pub fn is_efficiency(self) -> bool {
        matches!(self, Self::Efficiency | Self::ParallelEfficiency)
    }

    /// Formats a value with its unit.
    pub fn show(self, value: f64) -> String {
        match self {
            Self::CellsPerSecondPerCore | Self::AuditCellsPerSecondPerCore => {
                format!("{:.2} M cells/s", value / 1e6)
            }
            Self::FacetsPerSecondPerCore => format!("{:.2} M facets/s", value / 1e6),
            Self::Seconds => format!("{value:.3} s"),
            Self::PeakBytes | Self::AuditPeakBytes => gibibytes(value),
            Self::BytesPerCell | Self::BytesPerCellBeyond => format!("{value:.3} B/cell"),
            Self::PhaseShare => format!("{:.2} %", value * 100.0),
            Self::AuditHolds => (if value >= 1.0 { "all holds" } else { "findings" }).to_owned(),
            _ => format!("{value:.3}"),
        }
    }

    /// Returns the value for runs.
    ///
    /// # Errors
    /// One sentence, if the runs do not report it.
    pub fn of(self, sample: &Sample) -> Result<f64, String> {
        let run = *sample.runs.first().ok_or("no run is given")?;
        let other =
            || sample.against.ok_or_else(|| "the run to compare with is missing".to_owned());
        Ok(match self {
            Self::CellsPerSecondPerCore => run.rate(),
            Self::FacetsPerSecondPerCore => facet_rate(run),
            Self::Seconds => run.time_s.value,
            Self::SpeedUp => other()?.time_s.value / run.time_s.value,
            Self::RateRatio => run.rate() / other()?.rate(),
            Self::PeakBytes => peak(run),
            Self::BytesPerCell => run.bytes_per_cell().value,
            Self::BytesPerCellBeyond => beyond(run, other()?)?,
            Self::TimePerCellGrowth => growth(sample.runs),
            Self::LambdaCells => lambda_cells(run)?,
            Self::LambdaCpu => run.typical.useful_s.lambda(run.setup.ranks),
            Self::Efficiency => efficiency(run, other()?, sample.network)?,
            Self::ParallelEfficiency => run.efficiency(run, sample.network).parallel(),
            Self::PhaseShare => share(run, sample.phases, sample.network)?,
            Self::AuditHolds | Self::AuditCellsPerSecondPerCore | Self::AuditPeakBytes => {
                return Err(format!("{self} is measured of a mesh on disk"));
            }
        })
    }

    /// Returns the value for audits.
    ///
    /// # Errors
    /// One sentence, if no audit is given.
    pub fn of_audits(self, audits: &[&Audited]) -> Result<f64, String> {
        let values: Vec<f64> = match self {
            Self::AuditHolds => audits.iter().map(|a| f64::from(u8::from(a.holds))).collect(),
            Self::AuditCellsPerSecondPerCore => {
                audits.iter().map(|a| a.cells as f64 / a.time_cpu_s).collect()
            }
            Self::AuditPeakBytes => audits.iter().map(|a| a.peak_rss_bytes as f64).collect(),
            _ => return Err(format!("{self} is not measured of a mesh on disk")),
        };
        // A single failed audit is a failure.
        if self == Self::AuditHolds {
            return values
                .into_iter()
                .reduce(f64::min)
                .ok_or_else(|| "no audit is given".to_owned());
        }
        median(&values).map(|m| m.value).ok_or_else(|| "no audit is given".to_owned())
    }
}

fn gibibytes(bytes: f64) -> String {
    let gib = bytes / f64::from(1 << 30);
    if gib < 0.1 { format!("{:.1} MiB", gib * 1024.0) } else { format!("{gib:.2} GiB") }
}

fn facet_rate(run: &Group) -> f64 {
    run.runs[0].facets as f64 / run.time_s.value / run.setup.ranks as f64
}

/// Median over repetitions of the sum of the ranks' peaks. Pages that ranks share count for each rank.
fn peak(run: &Group) -> f64 {
    let values: Vec<f64> = run.runs.iter().map(|r| r.peak_rss_bytes.sum).collect();
    median(&values).map_or(f64::NAN, |m| m.value)
}

fn beyond(run: &Group, coarse: &Group) -> Result<f64, String> {
    if run.setup.ranks != coarse.setup.ranks || run.runs[0].facets != coarse.runs[0].facets {
        return Err("the other run must be of the same facets on as many ranks".to_owned());
    }
    if coarse.cells() >= run.cells() {
        let cells = grouped(coarse.cells());
        return Err(format!("the other run must have fewer cells, and has {cells}"));
    }
    Ok((peak(run) - peak(coarse)) / (run.cells() - coarse.cells()) as f64)
}

fn growth(runs: &[&Group]) -> f64 {
    let per_cell = runs.iter().map(|r| r.time_s.value / r.cells().max(1) as f64);
    let (mut least, mut worst) = (f64::INFINITY, 0.0f64);
    for time in per_cell {
        worst = worst.max(time / least);
        least = least.min(time);
    }
    worst
}

fn lambda_cells(run: &Group) -> Result<f64, String> {
    let counters = &run.typical.counters;
    let leaves = counters.get("leaves").ok_or("the program does not count leaves by rank")?;
    Ok(leaves.lambda(run.setup.ranks))
}

fn efficiency(run: &Group, other: &Group, network: &Network) -> Result<f64, String> {
    if other.setup.ranks != 1 {
        return Err(format!("the other run must be on 1 rank, and has {}", other.setup.ranks));
    }
    Ok(run.efficiency(other, network).global())
}

/// The fraction of the time that the named phases take. Missing phases count as zero, but at least one must exist.
fn share(run: &Group, names: &[String], network: &Network) -> Result<f64, String> {
    let typical = &run.typical;
    let selected = typical.phases.iter().filter(|p| names.contains(&p.name));
    let time = |phase: &Phase| match run.setup.comm {
        Comm::Sim => phase.useful_s.max + pop::messages_s(phase, network),
        Comm::Mpi | Comm::Solo => phase.wall_s.max,
    };
    let times: Vec<f64> = selected.map(time).collect();
    if times.is_empty() {
        let there: Vec<&str> = typical.phases.iter().map(|p| p.name.as_str()).collect();
        return Err(format!("it has no phase {}, but {}", names.join(" or "), there.join(", ")));
    }
    Ok(times.iter().sum::<f64>() / pop::time_s(typical, network))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{Entry, Run, Spread};
    use crate::experiments::group::Groups;
    use crate::testing::line;
    use crate::testing::run;

    const FREE: Network = Network { latency_s: 0.0, bandwidth_bytes_per_s: 1e30, measured: true };

    fn group(run: Run) -> Group {
        let lines = [line(Entry::Network(FREE)), line(Entry::Run(Box::new(run)))];
        Groups::of(&lines).all.remove(0)
    }

    fn value(measure: Measure, runs: &[&Group], against: Option<&Group>) -> Result<f64, String> {
        measure.of(&Sample { runs, against, phases: &["b".into()], network: &FREE })
    }

    /// Returns a group with the given ranks, time and cells.
    fn timed(ranks: usize, time_s: f64, cells: u64) -> Group {
        group(run(Comm::Mpi, cells, &[("a", &vec![time_s; ranks])]))
    }

    #[test]
    fn rates_are_per_core() {
        let two = timed(2, 4.0, 800);
        assert_eq!(value(Measure::CellsPerSecondPerCore, &[&two], None), Ok(100.0));
        assert_eq!(value(Measure::FacetsPerSecondPerCore, &[&two], None), Ok(1.5));
        assert_eq!(value(Measure::Seconds, &[&two], None), Ok(4.0));
        let one = timed(1, 7.2, 800);
        assert_eq!(value(Measure::SpeedUp, &[&two], Some(&one)), Ok(1.8));
        assert!((value(Measure::RateRatio, &[&two], Some(&one)).unwrap() - 0.9).abs() < 1e-12);
        assert!(value(Measure::SpeedUp, &[&two], None).is_err());
    }

    #[test]
    fn memory_beyond_the_facets_is_that_of_more_cells() {
        let with = |cells, bytes: &[f64]| {
            let mut r = run(Comm::Mpi, cells, &[("a", &vec![1.0; bytes.len()])]);
            r.peak_rss_bytes = Spread::brief(bytes);
            group(r)
        };
        let (fine, coarse) = (with(1000, &[400.0, 300.0]), with(200, &[150.0, 150.0]));
        assert_eq!(value(Measure::PeakBytes, &[&fine], None), Ok(700.0));
        assert_eq!(value(Measure::BytesPerCell, &[&fine], None), Ok(0.7));
        assert_eq!(value(Measure::BytesPerCellBeyond, &[&fine], Some(&coarse)), Ok(0.5));
        assert!(value(Measure::BytesPerCellBeyond, &[&coarse], Some(&fine)).is_err());
        let alone = with(200, &[150.0]);
        assert!(value(Measure::BytesPerCellBeyond, &[&fine], Some(&alone)).is_err());
    }

    #[test]
    fn growth_is_detected_anywhere_in_a_series() {
        let of = |times: &[f64]| {
            let groups: Vec<Group> = times.iter().map(|&t| timed(1, t, 100)).collect();
            value(Measure::TimePerCellGrowth, &groups.iter().collect::<Vec<_>>(), None).unwrap()
        };
        assert_eq!(of(&[8.0, 4.0, 2.0]), 0.5);
        // Less than the first value, but more than the preceding one.
        assert_eq!(of(&[8.0, 2.0, 3.0]), 1.5);
        // A slow rise accumulates.
        assert!((of(&[1.0, 1.04, 1.08]) - 1.08).abs() < 1e-9);
    }

    #[test]
    fn balance_and_efficiency_of_ranks() {
        let one = group(run(Comm::Sim, 100, &[("a", &[6.0]), ("b", &[2.0])]));
        let mut two = run(Comm::Sim, 100, &[("a", &[3.0, 3.0]), ("b", &[2.0, 1.0])]);
        assert!(value(Measure::LambdaCells, &[&group(two.clone())], None).is_err());
        two.counters.insert("leaves".into(), Spread::brief(&[55.0, 45.0]));
        let two = group(two);
        let close = |measure, against, expected: f64| {
            let found = value(measure, &[&two], against).unwrap();
            assert!((found - expected).abs() < 1e-6, "{measure}: {found} is not {expected}");
        };
        close(Measure::LambdaCells, None, 1.1);
        close(Measure::LambdaCpu, None, 5.0 / 4.5);
        close(Measure::Efficiency, Some(&one), 8.0 / 5.0 / 2.0);
        close(Measure::ParallelEfficiency, None, 4.5 / 5.0);
        close(Measure::PhaseShare, None, 2.0 / 5.0);
        // Twice the cells on two ranks in the same time: nothing is lost.
        let weak = group(run(Comm::Sim, 200, &[("a", &[6.0, 6.0]), ("b", &[2.0, 2.0])]));
        assert!((value(Measure::Efficiency, &[&weak], Some(&one)).unwrap() - 1.0).abs() < 1e-9);
        assert!(value(Measure::Efficiency, &[&weak], Some(&two)).is_err());
        let share = |phases: &[&str]| {
            let phases: Vec<String> = phases.iter().map(|p| (*p).to_owned()).collect();
            let sample = Sample { runs: &[&two], against: None, phases: &phases, network: &FREE };
            Measure::PhaseShare.of(&sample)
        };
        assert_eq!(share(&["a", "b", "c"]), Ok(1.0));
        assert_eq!(share(&["c", "b"]), share(&["b"]));
        assert!(share(&["c"]).unwrap_err().contains("no phase c, but a, b"));
    }

    #[test]
    fn one_failed_audit_is_a_failure() {
        let audited = |holds, time_cpu_s, peak_rss_bytes| Audited {
            setup: timed(1, 1.0, 9).setup,
            command: String::new(),
            cells: 900,
            holds,
            found: Vec::new(),
            time_cpu_s,
            time_wall_s: 50.0,
            peak_rss_bytes,
        };
        let all = [audited(true, 3.0, 10), audited(false, 9.0, 30), audited(true, 2.0, 20)];
        let all: Vec<&Audited> = all.iter().collect();
        assert_eq!(Measure::AuditHolds.of_audits(&all), Ok(0.0));
        assert_eq!(Measure::AuditHolds.of_audits(&all[..1]), Ok(1.0));
        assert_eq!(Measure::AuditCellsPerSecondPerCore.of_audits(&all), Ok(300.0));
        assert_eq!(Measure::AuditPeakBytes.of_audits(&all), Ok(20.0));
        assert!(Measure::AuditHolds.of_audits(&[]).is_err());
        assert!(Measure::Seconds.of_audits(&all).is_err());
    }

    #[test]
    fn measures_have_the_same_names_as_in_a_targets_file() {
        for measure in [Measure::BytesPerCellBeyond, Measure::AuditHolds, Measure::LambdaCpu] {
            let text = format!("measure = \"{measure}\"");
            let table: std::collections::BTreeMap<String, Measure> = toml::from_str(&text).unwrap();
            assert_eq!(table["measure"], measure);
        }
    }
}
