//! The rules that concern single figures.

use super::{Ruling, Verdict};
use crate::figure::{Body, Figure, Provenance};

/// The findings about a figure.
pub fn findings(f: &Figure) -> Vec<Ruling> {
    let mut out = Vec::new();
    let mut check = |rule, holds: bool, kept: &str, broken: &str| {
        let (verdict, why) = if holds { (Verdict::Kept, kept) } else { (Verdict::Broken, broken) };
        out.push(Ruling::new(rule, &f.id, verdict, why));
    };
    if f.claims.shows_ratios {
        let base_case = f.claims.base_case.as_deref();
        check(
            1,
            base_case.is_some_and(|base| f.caption.contains(base)),
            "the caption states the base case and its absolute performance",
            "the caption does not state the base case and its absolute performance",
        );
    }
    if let (true, Body::Points { series, .. }) = (f.claims.shows_scaling, &f.body) {
        let bound = series.iter().any(|s| s.provenance == Provenance::Bound);
        check(11, bound, "an ideal line is drawn", "no ideal line is drawn");
    }
    if let Body::HeatMap(_) = f.body {
        let stated =
            ["ranks", "simulated", "ollective calls"].iter().all(|w| f.caption.contains(w));
        check(
            9,
            stated,
            "the caption states that ranks are simulated and that collective calls are not included",
            "the caption does not state that ranks are simulated and which messages are counted",
        );
    }
    let (holds, why) = intervals(f);
    check(5, holds, &why, &why);
    if f.claims.compares {
        check(
            7,
            f.claims.deterministic,
            "the values compared repeat exactly",
            "values that vary are compared without a test",
        );
    }
    let joined = match &f.body {
        Body::Points { series, .. } => {
            series.iter().any(|s| s.joined && s.provenance == Provenance::Cited)
        }
        _ => false,
    };
    let kept = match f.body {
        Body::HeatMap(_) => "nothing is joined; zero has no colour, and larger values are darker",
        _ => "lines join members of one family only",
    };
    check(12, !joined, kept, "points of different origin are joined");
    out
}

/// Rule 5: whether there are enough repetitions for intervals with 95 % coverage, and the reason.
fn intervals(f: &Figure) -> (bool, String) {
    if f.claims.deterministic {
        return (true, "the values repeat exactly".to_owned());
    }
    let stated = f.caption.contains("median");
    if let Body::Bars(_) = f.body {
        return (
            stated,
            "bars are of medians per rank or of the run of median time; they have no intervals"
                .to_owned(),
        );
    }
    let is_ours = |p: Provenance| !matches!(p, Provenance::Cited | Provenance::Bound);
    let points: Vec<_> = f.points().into_iter().filter(|(p, _)| is_ours(*p)).map(|p| p.1).collect();
    if points.iter().all(|p| p.coverage == 0.0) && stated && f.claims.shows_ratios {
        let why = "the values are of medians per rank or of the run of median time, whose interval is in the speedup figure";
        return (true, why.to_owned());
    }
    let poor = points.iter().filter(|p| p.coverage < 0.95).count();
    let runs_min = points.iter().map(|p| p.count).min().unwrap_or(0);
    match poor {
        0 => (true, format!("all {} points have intervals with 95 % coverage", points.len())),
        _ => (
            false,
            format!(
                "{poor} of {} points have fewer than the six runs that an interval with 95 % coverage needs (minimum: {runs_min})",
                points.len()
            ),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::samples::{figure, heat_map, series};
    use crate::figure::{Claims, Point};

    fn speedup() -> Figure {
        let mut bound = series(Provenance::Bound);
        bound.points = vec![Point::exact(1.0, 1.0)];
        let base_case = Some("serial, 2.500 s".to_owned());
        let claims =
            Claims { base_case, shows_ratios: true, shows_scaling: true, ..Claims::default() };
        let body = Body::points(vec![series(Provenance::Measured), bound]);
        Figure { caption: "over serial, 2.500 s. Medians.".into(), claims, ..figure(body) }
    }

    fn broken(figure: &Figure) -> Vec<usize> {
        let broken = findings(figure).into_iter().filter(|f| f.verdict == Verdict::Broken);
        broken.map(|f| f.rule).collect()
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
}
