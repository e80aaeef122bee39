//! The invariants of figures, which are asserted before one is drawn.
//!
//! - Names of figures are those of files and differ; axes have labels, and a caption states what is shown.
//! - Numbers are finite; a point is within its interval; on a logarithmic axis it is positive, because it would be missing there.
//! - Bars have a value for each category and segment, and none is negative.
//! - A point above the ideal line has a reason in the caption.

use super::{Axis, Body, Figure, Point, Provenance, Series};
use std::collections::BTreeSet;

/// Asserts the invariants of the figures of a report.
///
/// # Panics
/// If one is violated.
pub fn check_invariants(figures: &[Figure]) {
    let names: BTreeSet<&str> = figures.iter().map(|f| f.id.as_str()).collect();
    assert_eq!(names.len(), figures.len(), "two figures have one name: {names:?}");
    figures.iter().for_each(check_figure);
}

/// Asserts the invariants of one figure.
///
/// # Panics
/// If one is violated.
pub fn check_figure(figure: &Figure) {
    let id = &figure.id;
    assert!(!id.is_empty() && *id == super::file_name(id), "figure {id:?}: not a name of a file");
    for axis in [&figure.x, &figure.y] {
        assert!(!axis.label.is_empty(), "figure {id}: an axis has no label");
    }
    match &figure.body {
        Body::Points { series, marks } => {
            assert!(marks.iter().all(|m| m.x.is_finite()), "figure {id}: a mark is nowhere");
            series.iter().for_each(|s| check_series(figure, s));
            check_ideal(figure, series);
        }
        Body::Bars(bars) => {
            let values = bars.segments.iter().flat_map(|(_, values)| values);
            let levels = bars.references.iter().map(|(_, level)| level);
            let is_length = |v: &f64| v.is_finite() && *v >= 0.0;
            assert!(values.chain(levels).all(is_length), "figure {id}: a bar has no length");
            let count = bars.categories.len();
            let are_complete = bars.segments.iter().all(|(_, values)| values.len() == count);
            assert!(are_complete, "figure {id}: a segment has more or fewer values than {count}");
        }
    }
}

fn check_series(figure: &Figure, s: &Series) {
    let name = format!("figure {}, {}", figure.id, s.name);
    let can_be_drawn = |axis: &Axis, v: f64| v.is_finite() && (!axis.log || v > 0.0);
    for p in &s.points {
        let is_shown = can_be_drawn(&figure.x, p.x) && can_be_drawn(&figure.y, p.y);
        let is_finite = p.low.is_finite() && p.high.is_finite();
        assert!(is_shown && is_finite, "{name}: the axes cannot show {p:?}");
        assert!(p.low <= p.y && p.y <= p.high, "{name}: {p:?} is outside of its interval");
        assert!((0.0..=1.0).contains(&p.coverage), "{name}: a coverage of {}", p.coverage);
    }
}

/// A line through the two ends of the ideal, straight on logarithmic axes.
fn check_ideal(figure: &Figure, series: &[Series]) {
    let ideal = series.iter().find(|s| s.provenance == Provenance::Bound && s.name == "ideal");
    let Some([from, to]) = ideal.map(|s| &s.points[..]) else { return };
    let slope = if to.x > from.x { (to.y / from.y).ln() / (to.x / from.x).ln() } else { 0.0 };
    let is_above = |p: &Point| p.y > 1.0005 * from.y * (p.x / from.x).powf(slope);
    let above = series.iter().flat_map(|s| &s.points).find(|p| is_above(p));
    assert!(
        above.is_none() || figure.caption.contains("above 1"),
        "figure {}: {above:?} is above the ideal line, and the caption gives no reason",
        figure.id
    );
}

#[cfg(test)]
mod tests {
    use super::super::samples::{figure, series};
    use super::super::{Bars, file_name, name_apart};
    use super::*;
    use proptest::prelude::*;

    fn points() -> Figure {
        figure(Body::points(vec![series(Provenance::Measured), series(Provenance::Projected)]))
    }

    fn bars() -> Figure {
        let segments = vec![("refine".to_owned(), vec![1.0, 2.0])];
        let references = vec![("mean".to_owned(), 1.5)];
        let categories = vec!["0".to_owned(), "1".to_owned()];
        figure(Body::Bars(Bars {
            categories,
            segments,
            references,
            provenance: Provenance::Measured,
        }))
    }

    /// Asserts that a change of a figure is noticed, and for the stated reason.
    fn assert_noticed(figure: &Figure, why: &str, change: impl Fn(&mut Figure)) {
        check_figure(figure);
        let mut changed = figure.clone();
        change(&mut changed);
        let caught = std::panic::catch_unwind(|| check_figure(&changed)).unwrap_err();
        let message = caught.downcast_ref::<String>().expect("a message with values");
        assert!(message.contains(why), "{message}");
    }

    fn series_of(figure: &mut Figure) -> &mut Vec<Series> {
        let Body::Points { series, .. } = &mut figure.body else { panic!("no points") };
        series
    }

    fn bars_of(figure: &mut Figure) -> &mut Bars {
        let Body::Bars(bars) = &mut figure.body else { panic!("no bars") };
        bars
    }

    #[test]
    fn planted_wrong_figures_are_noticed() {
        assert_noticed(&points(), "not a name of a file", |f| f.id = "two words".into());
        assert_noticed(&points(), "no label", |f| f.y.label.clear());
        assert_noticed(&points(), "cannot show", |f| series_of(f)[0].points[1].y = f64::NAN);
        assert_noticed(&points(), "cannot show", |f| {
            series_of(f)[1].points[0] = Point::exact(1.0, 0.0)
        });
        assert_noticed(&points(), "outside of its interval", |f| series_of(f)[0].points[1].y = 9.0);
        assert_noticed(&points(), "a coverage of 95", |f| {
            series_of(f)[0].points[1].coverage = 95.0
        });
        assert_noticed(&bars(), "no length", |f| bars_of(f).segments[0].1[0] = -1.0);
        assert_noticed(&bars(), "more or fewer", |f| bars_of(f).categories.truncate(1));
        assert_noticed(&points(), "gives no reason", |f| {
            let ends = [1.0, 4.0].map(|x| Point::exact(x, x / 2.0)).to_vec();
            series_of(f).push(Series::new("ideal", Provenance::Bound, 0, ends));
        });
    }

    proptest! {
        /// Any names of cases, engines and series: file names and references within a drawing stay intact.
        #[test]
        fn names_are_plain_and_differ(names in proptest::collection::vec("[a ./\"é<&-]{0,3}", 1..12)) {
            let mut all: Vec<Figure> =
                names.iter().map(|name| Figure { id: file_name(&format!("phases-{name}")), ..bars() }).collect();
            name_apart(all.iter_mut().map(|figure| &mut figure.id));
            check_invariants(&all);
        }
    }

    #[test]
    #[should_panic(expected = "two figures have one name")]
    fn a_figure_that_would_overwrite_another_is_noticed() {
        check_invariants(&[points(), points()]);
    }
}
