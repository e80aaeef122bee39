//! Groups of runs in the form that figures and tables need: by case, as points, with provenance and labels.

use crate::figure::{Kind, Point, Provenance, Series};
use bench::experiments::entry::{Comm, Run, Setup};
use bench::experiments::group::{Group, Groups};
use bench::order::{by_key, distinct};
use contract::number::grouped;
use statistics::Median;
use std::fmt;

/// The engine whose name is not in names of files.
pub const OWN: &str = "mesher";

/// What projected times are, as a sentence after others.
pub const PROJECTED: &str = " Projected times are critical paths of medians per rank, which can be below every run; their intervals are of the projections of runs.";

/// How the times of a group were obtained.
pub fn provenance(group: &Group) -> Provenance {
    match group.setup.comm {
        Comm::Sim => Provenance::Projected,
        _ if group.oversubscribed() => Provenance::Oversubscribed,
        _ => Provenance::Measured,
    }
}

/// A median with its confidence interval as a point.
pub fn point(x: f64, m: Median) -> Point {
    Point { x, y: m.value, low: m.low, high: m.high }
}

/// The number of repetitions and the meaning of the error bars, as a sentence.
pub fn repetitions(groups: &[&Group], value: impl Fn(&Group) -> Median) -> String {
    let runs = range(groups, |g| g.time_s.count as u64);
    let covered = groups.iter().map(|g| value(g).per_cent()).filter(|covered| *covered > 0.0);
    let bars = covered.reduce(f64::min).map_or(String::new(), |least| {
        format!("; bars are nonparametric confidence intervals of the median with at least {least} % coverage")
    });
    let is_projected = groups.iter().any(|group| group.setup.comm == Comm::Sim);
    let projected = if is_projected { PROJECTED } else { "" };
    format!("Medians of {runs} runs{bars}.{projected}")
}

/// The clock of each program, as a sentence, if they are not the same.
pub fn clocks<'a>(groups: impl Iterator<Item = &'a Group>) -> Option<String> {
    let runs = groups.filter(|g| g.setup.comm != Comm::Sim).flat_map(|group| &group.runs);
    let of_clock = by_key(runs, |run| match run.time_wall_s == run.time_launch_s {
        true => "the whole process, seen from outside",
        false => "the program's own clock",
    });
    let programs = |of: &[&Run]| distinct(of.iter().map(|run| &*run.setup.engine)).join(", ");
    let clocks = of_clock.iter().map(|(clock, of)| format!("{}: {clock}", programs(of)));
    let clocks = clocks.collect::<Vec<_>>().join("; ");
    (of_clock.len() > 1).then(|| format!("Measured times are of different clocks: {clocks}."))
}

/// The origin of the times of single ranks, as a sentence.
pub fn rank_times(groups: &[&Group]) -> String {
    let n = range(groups, |g| g.time_s.count as u64);
    format!(
        "Times of a rank in a phase are medians of {n} runs where all report them, and otherwise of the run of median time."
    )
}

/// The least and the greatest value, or the only one.
pub fn range(groups: &[&Group], value: impl Fn(&Group) -> u64) -> String {
    let values = || groups.iter().map(|group| value(group));
    distinct([values().min(), values().max()].into_iter().flatten().map(grouped)).join(" to ")
}

/// The groups of an experiment by engine and case, in the order of the record; those of each by ranks.
pub fn by_subject<'a>(groups: &'a Groups, experiment: &str) -> Vec<(Subject<'a>, Vec<&'a Group>)> {
    let of = groups.all.iter().filter(|g| g.setup.experiment == experiment);
    let mut found = by_key(of, |group| Subject::of(&group.setup));
    found.iter_mut().for_each(|(_, of)| of.sort_by_key(|g| g.setup.ranks));
    found
}

/// The program and the case of a figure that shows only one of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subject<'a> {
    /// The program.
    pub engine: &'a str,
    /// The case.
    pub case: &'a str,
    /// Cells that its series of several meshes was asked for.
    pub cells: Option<f64>,
    /// The thickness of layers, unless the experiment varies it.
    pub n: Option<u32>,
}

impl<'a> Subject<'a> {
    /// The program and the case of a run.
    pub fn of(setup: &'a Setup) -> Self {
        let n = (setup.experiment != "layers").then_some(setup.layer_cells_min);
        Self { engine: &setup.engine, case: &setup.case, cells: setup.series_cells, n }
    }

    /// A name for files: the case, and before it the program unless that is the mesher of this repository.
    pub fn file(&self) -> String {
        let size = self.cells.map_or(String::new(), |n| format!("-{}", cells_label(n as u64)));
        match self.engine {
            OWN => format!("{}{size}", self.case),
            engine => format!("{engine}-{}{size}", self.case),
        }
    }

    /// The case and the size of its series, as text.
    pub fn mesh(&self) -> String {
        let size = |n: f64| format!(" (series of {} cells)", grouped(n as u64));
        format!("{}{}", self.case, self.cells.map(size).unwrap_or_default())
    }
}

impl fmt::Display for Subject<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} by {}", self.mesh(), self.engine)
    }
}

/// A number of cells to two digits, for names of files.
pub fn cells_label(cells: u64) -> String {
    let (value, unit) = match cells {
        1_000_000_000.. => (cells as f64 / 1e9, "G"),
        1_000_000.. => (cells as f64 / 1e6, "M"),
        _ => (cells as f64 / 1e3, "k"),
    };
    let text = if value < 9.5 { format!("{value:.1}") } else { format!("{value:.0}") };
    format!("{}{unit}", text.trim_end_matches(".0").replace('.', "p"))
}

/// Whether a case is the counterpart of the paper's UAV, around which its meshes with a run time are.
pub fn is_counterpart(case: &str) -> bool {
    case.starts_with("uav")
}

/// Values of the paper, which are not joined.
pub fn cited(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Series {
    let points = points.into_iter().map(|(x, y)| Point::exact(x, y)).collect();
    Series::new(name, Provenance::Cited, 5, points).drawn_as(Kind::Scattered)
}
