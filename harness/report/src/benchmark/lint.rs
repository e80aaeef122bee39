//! Figures and record against the twelve rules of Hoefler and Belli, "Scientific Benchmarking of Parallel
//! Computing Systems" (SC15): which ones are broken, and by what.

use super::figure::{Body, Figure, How};
use bench::experiments::entry::{Line, What};

/// What a rule says of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is kept.
    Kept,
    /// It is broken.
    Broken,
}

/// One finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Number of the rule, 1 to 12.
    pub rule: usize,
    /// The figure's id; "record" for what concerns all.
    pub about: String,
    /// Whether it is kept.
    pub verdict: Verdict,
    /// By what, in a sentence.
    pub why: String,
}

/// The rules in short.
pub const RULES: [&str; 12] = [
    "speedup: tell the base case and its absolute performance",
    "tell why only part of a benchmark or of a system is used",
    "arithmetic mean for costs, harmonic for rates",
    "do not average ratios",
    "tell whether values are deterministic; intervals where not",
    "assume no normality without a check",
    "compare nondeterministic values in a statistically sound way",
    "ask whether mean or median is what matters",
    "document all factors and the whole setup",
    "tell how parallel time was measured and summarised",
    "show upper bounds",
    "plot what interpretation needs; join only where interpolation is valid",
];

/// Checks every figure, and what a record tells of its machine.
pub fn lint(figures: &[Figure], lines: &[Line]) -> Vec<Finding> {
    let mut out = Vec::new();
    for figure in figures {
        out.extend(of_figure(figure));
    }
    out.extend(setup(lines));
    out.extend(whole(lines));
    // By construction of this report, for every figure alike.
    let kept = [
        (3, "costs are summarised by medians; rates are cells over a median time"),
        (4, "ratios are ratios of medians; none is an average of ratios"),
        (6, "intervals are order statistics of the median and assume no distribution"),
        (
            8,
            "the median of a batch program's run time is what a user waits; single ranks are told by maximum and mean, as the slowest decides",
        ),
        (
            10,
            "run time is the slowest rank's from reading to the last leaf; phases are not separated by barriers; a rank's useful time is CPU time outside calls",
        ),
    ];
    out.extend(kept.map(|(rule, why)| finding(rule, "all figures", Verdict::Kept, why.to_owned())));
    out.sort_by_key(|f| f.rule);
    out
}

fn finding(rule: usize, about: &str, verdict: Verdict, why: String) -> Finding {
    Finding { rule, about: about.to_owned(), verdict, why }
}

fn of_figure(f: &Figure) -> Vec<Finding> {
    let mut out = Vec::new();
    let mut check = |rule, holds: bool, kept: &str, broken: &str| {
        let (verdict, why) = if holds { (Verdict::Kept, kept) } else { (Verdict::Broken, broken) };
        out.push(finding(rule, &f.id, verdict, why.to_owned()));
    };
    if f.claims.shows_ratios {
        let told = f.claims.base_case.as_ref().is_some_and(|base| {
            f.caption.contains(base.as_str()) || base_seconds(base, &f.caption)
        });
        check(
            1,
            told,
            "the caption tells the base case and its time",
            "the caption does not tell the base case and its time",
        );
    }
    if f.claims.shows_scaling && !matches!(f.body, Body::Bars(_)) {
        let bound = matches!(&f.body, Body::Points(all) if all.iter().any(|s| s.how == How::Bound));
        check(11, bound, "an ideal line is drawn", "no ideal line is drawn");
    }
    if let Body::Heat(_) = f.body {
        let told = ["ranks", "simulated", "ollective calls"].iter().all(|w| f.caption.contains(w));
        check(
            9,
            told,
            "the caption tells the ranks, that they are simulated, and that collective calls are left out",
            "the caption does not tell whose messages are counted, and which",
        );
    }
    let (holds, why) = intervals(f);
    check(5, holds, &why, &why);
    if f.claims.compares {
        check(
            7,
            f.claims.deterministic,
            "what is compared repeats exactly",
            "values that vary are compared by eye",
        );
    }
    let joined_names =
        matches!(&f.body, Body::Points(all) if all.iter().any(|s| s.joined && s.how == How::Cited));
    let kept = match f.body {
        Body::Heat(_) => "nothing is joined; what was not sent has no colour, and more is darker",
        _ => "lines join neighbours of one family only",
    };
    check(12, !joined_names, kept, "points of different origin are joined");
    out
}

/// Whether the seconds of a base case are in the caption.
fn base_seconds(base: &str, caption: &str) -> bool {
    base.split(' ')
        .any(|word| word.contains('.') && word.parse::<f64>().is_ok() && caption.contains(word))
}

/// Rule 5: enough repetitions for intervals at 95 %.
fn intervals(f: &Figure) -> (bool, String) {
    if f.claims.deterministic {
        return (true, "the values repeat exactly".to_owned());
    }
    if let Body::Bars(_) = f.body {
        let told = f.caption.contains("median");
        return (told, "bars are one run, that of median time; they have no intervals".to_owned());
    }
    let own = f.points().into_iter().filter(|(how, _)| !matches!(how, How::Cited | How::Bound));
    let points: Vec<_> = own.map(|(_, p)| p).collect();
    let with_interval: Vec<_> = points.iter().filter(|p| p.coverage > 0.0).collect();
    if with_interval.is_empty() && f.caption.contains("median") && f.claims.shows_ratios {
        return (
            true,
            "values are of the run of median time, whose interval the speedup figure shows"
                .to_owned(),
        );
    }
    let poor = points.iter().filter(|p| p.coverage < 0.95).count();
    let least = points.iter().map(|p| p.count).min().unwrap_or(0);
    match poor {
        0 => (true, format!("all {} points have intervals of 95 % or more", points.len())),
        _ => (
            false,
            format!(
                "{poor} of {} points have fewer than the six runs that a 95 % interval needs (fewest: {least})",
                points.len()
            ),
        ),
    }
}

/// Rule 9: machine and software are told.
fn setup(lines: &[Line]) -> Vec<Finding> {
    let sessions: Vec<_> = lines
        .iter()
        .filter_map(|l| match &l.what {
            What::Session(s) => Some(s),
            _ => None,
        })
        .collect();
    let mut out = Vec::new();
    let complete = !sessions.is_empty()
        && sessions.iter().all(|s| {
            let m = &s.machine;
            [&m.cpu, &m.kernel, &m.compiler, &m.commit].iter().all(|v| !v.is_empty())
                && m.memory_bytes > 0
        });
    let why = if complete {
        "processor, memory, kernel, compiler and commit are on record"
    } else {
        "machine, compiler or commit are missing in the record"
    };
    out.push(finding(
        9,
        "record",
        if complete { Verdict::Kept } else { Verdict::Broken },
        why.to_owned(),
    ));
    if sessions.iter().any(|s| s.machine.commit.ends_with("-dirty")) {
        out.push(finding(
            9,
            "record",
            Verdict::Broken,
            "a session ran with files that differ from its commit".to_owned(),
        ));
    }
    if let Some(s) = sessions.iter().find(|s| s.load_average > 0.5 * s.machine.cores as f64) {
        let why = format!(
            "other work may have disturbed a session: the load average was {:.1} on {} cores",
            s.load_average, s.machine.cores
        );
        out.push(finding(9, "record", Verdict::Broken, why));
    }
    out
}

/// Rule 2: what was left out.
fn whole(lines: &[Line]) -> Vec<Finding> {
    let failures = lines.iter().filter(|l| matches!(l.what, What::Failure(_))).count();
    let crowded = lines.iter().any(|l| matches!(&l.what, What::Run(r) if r.oversubscribed));
    let why =
        if crowded { "; more ranks than cores are marked, as the machine has no more" } else { "" };
    vec![match failures {
        0 => finding(
            2,
            "record",
            Verdict::Kept,
            format!("every run that was begun is in the record, all cores were used{why}"),
        ),
        n => finding(
            2,
            "record",
            Verdict::Broken,
            format!("{n} runs failed and are missing in the figures{why}"),
        ),
    }]
}

#[cfg(test)]
mod tests {
    use super::super::figure::{Claims, Point};
    use super::super::paint::tests::{figure, series};
    use super::*;
    use bench::experiments::entry::{Machine, SCHEMA, Session};

    fn verdict(findings: &[Finding], rule: usize, about: &str) -> Verdict {
        let found = findings
            .iter()
            .find(|f| f.rule == rule && f.about == about && f.verdict == Verdict::Broken);
        found.map_or(Verdict::Kept, |f| f.verdict)
    }

    fn speedup() -> Figure {
        let mut bound = series(How::Bound);
        bound.points = vec![Point::bare(1.0, 1.0)];
        let base_case = Some("serial, 2.500 s".to_owned());
        let claims =
            Claims { base_case, shows_ratios: true, shows_scaling: true, ..Claims::default() };
        let body = Body::Points(vec![series(How::Measured), bound]);
        Figure { caption: "over serial, 2.500 s. Medians.".into(), claims, ..figure(body) }
    }

    #[test]
    fn a_good_figure_breaks_nothing() {
        let findings = lint(&[speedup()], &[]);
        let broken: Vec<_> = findings
            .iter()
            .filter(|f| f.about == "speedup" && f.verdict == Verdict::Broken)
            .collect();
        assert!(broken.is_empty(), "{broken:?}");
    }

    #[test]
    fn every_flaw_is_found() {
        let mut silent = speedup();
        silent.caption = "faster".into();
        assert_eq!(verdict(&lint(&[silent], &[]), 1, "speedup"), Verdict::Broken);

        let mut boundless = speedup();
        boundless.body = Body::Points(vec![series(How::Measured)]);
        assert_eq!(verdict(&lint(&[boundless], &[]), 11, "speedup"), Verdict::Broken);

        let mut few = speedup();
        if let Body::Points(all) = &mut few.body {
            all[0].points.iter_mut().for_each(|p| (p.count, p.coverage) = (3, 0.75));
        }
        assert_eq!(verdict(&lint(&[few], &[]), 5, "speedup"), Verdict::Broken);

        let mut joined = speedup();
        if let Body::Points(all) = &mut joined.body {
            all[0].how = How::Cited;
        }
        assert_eq!(verdict(&lint(&[joined], &[]), 12, "speedup"), Verdict::Broken);

        let mut rivals = speedup();
        rivals.claims.compares = true;
        assert_eq!(verdict(&lint(&[rivals], &[]), 7, "speedup"), Verdict::Broken);
    }

    #[test]
    fn a_matrix_must_tell_whose_messages_it_counts() {
        let mut matrix = super::super::heat::tests::figure();
        assert_eq!(
            verdict(&lint(std::slice::from_ref(&matrix), &[]), 9, "messages"),
            Verdict::Kept
        );
        assert_eq!(
            verdict(&lint(std::slice::from_ref(&matrix), &[]), 5, "messages"),
            Verdict::Kept
        );
        matrix.caption = "On 3 ranks.".into();
        assert_eq!(verdict(&lint(&[matrix], &[]), 9, "messages"), Verdict::Broken);
    }

    #[test]
    fn a_disturbed_machine_and_a_changed_commit_are_told() {
        let machine = Machine {
            cpu: "c".into(),
            cores: 2,
            memory_bytes: 1,
            kernel: "k".into(),
            mpi: String::new(),
            compiler: "r".into(),
            commit: "abc".into(),
        };
        let line = |load_average, commit: &str| Line {
            schema: SCHEMA.into(),
            session: "s".into(),
            time_utc: "t".into(),
            what: What::Session(Box::new(Session {
                command: vec![],
                machine: Machine { commit: commit.into(), ..machine.clone() },
                load_average,
            })),
        };
        assert_eq!(verdict(&lint(&[], &[line(0.1, "abc")]), 9, "record"), Verdict::Kept);
        assert_eq!(verdict(&lint(&[], &[line(1.9, "abc")]), 9, "record"), Verdict::Broken);
        assert_eq!(verdict(&lint(&[], &[line(0.1, "abc-dirty")]), 9, "record"), Verdict::Broken);
        assert_eq!(verdict(&lint(&[], &[]), 9, "record"), Verdict::Broken);
    }
}
