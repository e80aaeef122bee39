//! Groups of runs as figures need them: by case, as points, with how they were measured.

use super::figure::{How, Point};
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::statistics::Median;

/// How a group's times were come by.
pub fn how(group: &Group) -> How {
    match group.setup.comm {
        Comm::Sim => How::Projected,
        _ if group.oversubscribed() => How::Oversubscribed,
        _ => How::Measured,
    }
}

/// A median as a point.
pub fn point(x: f64, m: Median) -> Point {
    Point { x, y: m.value, low: m.low, high: m.high, count: m.count, coverage: m.coverage }
}

/// "n = 6, bars: 95 % or more" and the like, for a caption.
pub fn repetitions(groups: &[&Group]) -> String {
    let counts: Vec<usize> = groups.iter().map(|g| g.time_s.count).collect();
    let (least, most) =
        (counts.iter().min().copied().unwrap_or(0), counts.iter().max().copied().unwrap_or(0));
    let covered = groups.iter().map(|g| g.time_s.coverage).fold(1.0, f64::min);
    let n = if least == most { format!("{least}") } else { format!("{least} to {most}") };
    format!(
        "Medians of {n} runs; bars are nonparametric intervals that contain the true median with at least {:.0} % probability{}",
        covered * 100.0,
        if groups.iter().any(|g| g.by_rank && g.setup.comm == Comm::Sim) {
            "; where projected, medians are taken rank by rank, and bars are of the runs' own projections"
        } else {
            ""
        }
    )
}

/// Cases, in the order in which they come, with the groups of an experiment.
pub fn by_case<'a>(groups: &'a Groups, experiment: &str) -> Vec<(&'a str, Vec<&'a Group>)> {
    let mut out: Vec<(&str, Vec<&Group>)> = Vec::new();
    for group in groups.all.iter().filter(|g| g.setup.experiment == experiment) {
        match out.iter_mut().find(|(case, _)| *case == group.setup.case) {
            Some((_, all)) => all.push(group),
            None => out.push((&group.setup.case, vec![group])),
        }
    }
    out
}
