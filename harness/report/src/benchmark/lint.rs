//! Checks figures and record by the twelve rules of Hoefler and Belli, "Scientific Benchmarking of Parallel Computing
//! Systems" (SC15).

use crate::figure::{Body, Figure, Provenance};
use bench::experiments::entry::{Entry, Line, Session};

/// A rule that a figure or the record breaks.
#[derive(Clone, Debug, PartialEq)]
pub struct Broken {
    /// Number of the rule, 1 to 12.
    pub rule: usize,
    /// Identifier of the figure, or "record".
    pub about: String,
    /// The reason in a sentence.
    pub why: String,
}

/// The rules in short, and how a report keeps them that does not break them.
pub const RULES: [(&str, &str); 12] = [
    (
        "speedup: state the base case and its absolute performance",
        "the captions state the base case and its absolute performance",
    ),
    (
        "state the reason for using a part of a benchmark or of a system only",
        "the record has every run that was started, on all cores; runs with more ranks than cores are marked",
    ),
    (
        "summarise costs by the arithmetic and rates by the harmonic mean",
        "costs are summarised by medians; rates are cells over a median time",
    ),
    ("do not average ratios", "ratios are ratios of medians; none is an average of ratios"),
    (
        "state whether values are deterministic; give confidence intervals if not",
        "values repeat exactly, have intervals with 95 % coverage, or are of medians per rank or of the run of median time, whose interval \
         is in the speedup figure",
    ),
    (
        "do not assume normality without a test",
        "intervals are order statistics of the median and assume no distribution",
    ),
    ("compare nondeterministic values by sound statistics", "the values compared repeat exactly"),
    (
        "choose mean, median or another quantile by the question",
        "users of a batch program wait for its median run time; ranks are summarised by maximum and mean, because the slowest rank determines the time",
    ),
    (
        "document all factors and the whole setup",
        "the record has processor, memory, kernel, compiler and commit; captions state which messages are counted",
    ),
    (
        "state how parallel time was measured and summarised",
        "run time is that of the slowest rank from reading to the last leaf, without barriers between phases; useful time is CPU time outside communication",
    ),
    ("show upper bounds of performance", "an ideal line is drawn in figures of scaling"),
    (
        "plot what interpretation needs; join points only where interpolation is valid",
        "lines join members of one family only; in a matrix zero has no colour, and larger values are darker",
    ),
];

/// The rules that figures and record break, in the order of the rules.
pub fn lint(figures: &[Figure], lines: &[Line]) -> Vec<Broken> {
    let of_figure = |f: &Figure| {
        let about = f.id.clone();
        figure(f).into_iter().map(move |(rule, why)| Broken { rule, about: about.clone(), why })
    };
    let of_record = |(rule, why)| Broken { rule, about: "record".to_owned(), why };
    let mut all: Vec<Broken> = figures.iter().flat_map(of_figure).collect();
    all.extend(record(lines).into_iter().map(of_record));
    all.sort_by_key(|broken| broken.rule);
    all
}

/// The rules that a figure breaks.
fn figure(f: &Figure) -> Vec<(usize, String)> {
    let mut broken: Vec<(usize, String)> = Vec::new();
    let mut require = |rule, holds: bool, why: &str| {
        if !holds {
            broken.push((rule, why.to_owned()));
        }
    };
    let series = match &f.body {
        Body::Points { series, .. } => &series[..],
        _ => &[],
    };
    let base_case = f.claims.base_case.as_deref();
    let states_base = base_case.is_some_and(|base| f.caption.contains(base));
    let why = "the caption does not state the base case and its absolute performance";
    require(1, !f.claims.shows_ratios || states_base, why);
    let poor = intervals(f);
    require(5, poor.is_none(), poor.as_deref().unwrap_or_default());
    let is_sound = !f.claims.compares || f.claims.deterministic;
    require(7, is_sound, "values that vary are compared without a test");
    let states = |words: &[&str]| words.iter().all(|word| f.caption.contains(word));
    let is_counted = states(&["ranks", "simulated", "ollective calls"]);
    let why = "the caption does not state that ranks are simulated and which messages are counted";
    require(9, !matches!(f.body, Body::HeatMap(_)) || is_counted, why);
    let scales = f.claims.shows_scaling && matches!(f.body, Body::Points { .. });
    let bound = series.iter().any(|s| s.provenance == Provenance::Bound);
    require(11, !scales || bound, "no ideal line is drawn");
    let joined = series.iter().any(|s| s.joined && s.provenance == Provenance::Cited);
    require(12, !joined, "points of different origin are joined");
    broken
}

/// Why values of a figure lack intervals with 95 % coverage; `None` if they do not, or need none.
fn intervals(f: &Figure) -> Option<String> {
    let stated = f.caption.contains("median");
    if f.claims.deterministic {
        return None;
    }
    if let Body::Bars(_) = f.body {
        return (!stated).then(|| "the caption does not state that bars are of medians".to_owned());
    }
    let is_ours = |p: Provenance| !matches!(p, Provenance::Cited | Provenance::Bound);
    let points: Vec<_> = f.points().into_iter().filter(|(p, _)| is_ours(*p)).map(|p| p.1).collect();
    if points.iter().all(|p| p.coverage == 0.0) && stated && f.claims.shows_ratios {
        return None;
    }
    let poor = points.iter().filter(|p| p.coverage < 0.95).count();
    let runs_min = points.iter().map(|p| p.count).min().unwrap_or(0);
    (poor > 0).then(|| {
        format!(
            "{poor} of {} points have fewer than the six runs that an interval with 95 % coverage needs (minimum: {runs_min})",
            points.len()
        )
    })
}

/// The rules that a record breaks.
fn record(lines: &[Line]) -> Vec<(usize, String)> {
    let mut broken = Vec::new();
    let failures = lines.iter().filter(|l| matches!(l.entry, Entry::Failure(_))).count();
    if failures > 0 {
        broken.push((2, format!("{failures} runs failed and are missing in the figures")));
    }
    let session = |line: &'_ Line| match &line.entry {
        Entry::Session(session) => Some((**session).clone()),
        _ => None,
    };
    let sessions: Vec<Session> = lines.iter().filter_map(session).collect();
    let is_documented = |s: &Session| {
        let m = &s.machine;
        [&m.cpu, &m.kernel, &m.compiler, &m.commit].iter().all(|v| !v.is_empty())
            && m.memory_bytes > 0
    };
    if sessions.is_empty() || !sessions.iter().all(is_documented) {
        broken.push((9, "machine, compiler or commit are missing in the record".to_owned()));
    }
    if sessions.iter().any(|s| s.machine.commit.ends_with("-dirty")) {
        broken.push((9, "a session ran with files that differ from its commit".to_owned()));
    }
    if let Some(s) = sessions.iter().find(|s| s.load_average > 0.5 * s.machine.cores as f64) {
        let why = format!(
            "other processes may have disturbed a session: the load average was {:.1} on {} cores",
            s.load_average, s.machine.cores
        );
        broken.push((9, why));
    }
    broken
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::samples::{figure as sample, heat_map, series};
    use crate::figure::{Claims, Point};
    use bench::experiments::entry::Machine;
    use bench::testing::line;

    fn speedup() -> Figure {
        let mut bound = series(Provenance::Bound);
        bound.points = vec![Point::exact(1.0, 1.0)];
        let base_case = Some("serial, 2.500 s".to_owned());
        let claims =
            Claims { base_case, shows_ratios: true, shows_scaling: true, ..Claims::default() };
        let body = Body::points(vec![series(Provenance::Measured), bound]);
        Figure { caption: "over serial, 2.500 s. Medians.".into(), claims, ..sample(body) }
    }

    fn broken(f: &Figure) -> Vec<usize> {
        figure(f).into_iter().map(|(rule, _)| rule).collect()
    }

    /// The speedup figure with its first series modified.
    fn with_series(modify: impl Fn(&mut crate::figure::Series)) -> Figure {
        let mut figure = speedup();
        let Body::Points { series, .. } = &mut figure.body else { panic!("not points") };
        modify(&mut series[0]);
        figure
    }

    #[test]
    fn a_complete_figure_breaks_no_rule() {
        assert_eq!(broken(&speedup()), [0; 0]);
    }

    #[test]
    fn every_flaw_breaks_its_rule() {
        let no_base_case = Figure { caption: "faster".into(), ..speedup() };
        assert_eq!(broken(&no_base_case), [1]);
        let no_bound =
            Figure { body: Body::points(vec![series(Provenance::Measured)]), ..speedup() };
        assert_eq!(broken(&no_bound), [11]);
        let few_runs = with_series(|s| {
            s.points.iter_mut().for_each(|p| (p.count, p.coverage) = (3, 0.75));
        });
        assert_eq!(broken(&few_runs), [5]);
        let joined = with_series(|s| s.provenance = Provenance::Cited);
        assert_eq!(broken(&joined), [12]);
        let mut compared = speedup();
        compared.claims.compares = true;
        assert_eq!(broken(&compared), [7]);
    }

    #[test]
    fn the_caption_of_a_matrix_must_state_which_messages_are_counted() {
        assert_eq!(broken(&heat_map()), [0; 0]);
        assert_eq!(broken(&Figure { caption: "On 3 ranks.".into(), ..heat_map() }), [9]);
    }

    fn session(load_average: f64, commit: &str) -> Line {
        let machine = Machine {
            cpu: "c".into(),
            cores: 2,
            memory_bytes: 1,
            kernel: "k".into(),
            mpi: String::new(),
            compiler: "r".into(),
            commit: commit.into(),
        };
        let (command, lacks) = (vec![], Default::default());
        line(Entry::Session(Box::new(Session { command, machine, load_average, lacks })))
    }

    #[test]
    fn a_disturbed_machine_and_uncommitted_files_break_rule_9_and_so_does_a_record_without_sessions()
     {
        let is_broken = |lines: &[Line]| record(lines).iter().any(|(rule, _)| *rule == 9);
        assert!(!is_broken(&[session(0.1, "abc")]));
        assert!(is_broken(&[session(1.9, "abc")]));
        assert!(is_broken(&[session(0.1, "abc-dirty")]));
        assert!(is_broken(&[]));
    }
}
