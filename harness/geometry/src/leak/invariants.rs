//! What an answer satisfies before it is printed. No tree of boxes and no cell of the search is used: facets are compared with the
//! path one by one, and leaves are found by their words.
//!
//! - The path lies in the root, starts and ends where it says, and its length is the sum of its legs.
//! - Every leg lies in a free leaf; or, in a leaf that facets cross, a ball of the least width passes along it.
//! - No facet is nearer to a leg that counts than half of the least width, and none meets any leg.
//! - The narrowest place is a point of the path; its width lies between its bounds, is no more than that of any point that counts, and is
//!   twice the distance to the nearest facet, which is one of the rim.
//! - Levels that join the ends, the level that closes or opens, and the existence of a path agree.

use super::ends::{is_free, leaf_at};
use super::report::{Destination, Passage, Report};
use crate::tree::{Point, from_edges, from_point, triangle};
use contract::case::Case;
use contract::lattice::{FacetLattice, Root, UNITS_PER_EDGE};
use parry3d_f64::query::{Ray, RayCast};
use parry3d_f64::shape::Segment;

/// Exceeds the rounding of printed points, in lattice units.
const ROUNDING: f64 = 2.0;

impl Report {
    /// Asserts the invariants, with the sorted words of the base tree that the path leads through.
    ///
    /// # Panics
    /// If one is violated, which is a bug.
    pub fn check_invariants(&self, case: &Case, words: &[u64]) {
        let level = self.spacing.level;
        let joins = |l: u8| self.levels.iter().find(|m| m.spacing.level == l).map(|m| m.is_joined);
        assert_eq!(
            joins(level),
            Some(self.is_leak),
            "the case's level was searched with another result"
        );
        for (other, is_coarser) in [(self.closes, true), (self.opens, false)] {
            let Some(other) = other else { continue };
            assert_eq!(
                (other.level < level, self.is_leak),
                (is_coarser, is_coarser),
                "{other:?} for level {level}"
            );
            assert_eq!(
                joins(other.level),
                Some(!is_coarser),
                "{other:?} was searched with another result"
            );
            let between = self.levels.iter().filter(|m| {
                let l = m.spacing.level;
                (level.min(other.level) < l && l < level.max(other.level))
                    && m.is_joined != is_coarser
            });
            assert_eq!(between.count(), 0, "{other:?} is not the level nearest to {level}");
        }
        let known = [self.opens.is_some(), self.is_separated, self.limit.is_some()];
        let reasons = known.iter().filter(|&&is| is).count();
        assert_eq!(
            reasons,
            usize::from(!self.is_leak),
            "one reason ends a search for an opening: {known:?}"
        );
        assert_eq!(
            self.passage.is_some(),
            self.is_leak || self.opens.is_some(),
            "a path exists iff a level joins the ends"
        );
        if let Some(passage) = &self.passage {
            assert_eq!(
                joins(passage.spacing.level),
                Some(true),
                "the path leads through a level that joins the ends"
            );
            passage.check_ends(&case.root, self.from, self.to);
            passage.check_legs(case, words);
            passage.check_narrowest(case);
        }
    }
}

/// Two positions or lengths on the lattice are equal but for rounding.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING + 1e-9 * b.abs()
}

fn units(root: &Root) -> f64 {
    UNITS_PER_EDGE as f64 / root.edge
}

impl Passage {
    fn on_lattice(&self, root: &Root) -> Vec<Point> {
        let origin = Point::from(root.origin);
        self.points.iter().map(|p| (Point::from(p.at) - origin) * units(root)).collect()
    }

    fn check_ends(&self, root: &Root, from: [f64; 3], to: Destination) {
        let edge = UNITS_PER_EDGE as f64;
        let points = self.on_lattice(root);
        let origin = Point::from(root.origin);
        for (point, printed) in points.iter().zip(&self.points) {
            let is_inside =
                point.min_element() >= -ROUNDING && point.max_element() <= edge + ROUNDING;
            assert!(is_inside, "{:?} of the path is outside the root", printed.at);
        }
        let ends_at = |index: usize, at: [f64; 3]| {
            points[index].distance((Point::from(at) - origin) * units(root)) <= ROUNDING
        };
        let last = points.len() - 1;
        assert!(ends_at(0, from), "the path starts at {:?}, not at {from:?}", self.points[0].at);
        let at = self.points[last].at;
        match to {
            Destination::Point(to) => {
                assert!(ends_at(last, to), "the path ends at {at:?}, not at {to:?}")
            }
            Destination::Far(_) => {
                let end = points[last];
                let margin = end.min_element().min(edge - end.max_element());
                assert!(margin <= ROUNDING, "the path ends at {at:?}, not on the root's boundary");
            }
        }
        let sum: f64 = points.windows(2).map(|leg| leg[0].distance(leg[1])).sum();
        let length = self.length * units(root);
        assert!(
            (sum - length).abs() <= 1e-6 * sum + ROUNDING,
            "length {length} of legs of {sum} units"
        );
    }

    fn check_legs(&self, case: &Case, words: &[u64]) {
        let points = self.on_lattice(&case.root);
        let (first, last) = self.inner;
        assert!(
            first <= last && last < points.len(),
            "{:?} of {} points",
            self.inner,
            points.len()
        );
        let least = self.narrowest.width_min / 2.0 * units(&case.root);
        let legs: Vec<(Segment, f64)> = points
            .windows(2)
            .enumerate()
            .map(|(i, leg)| {
                let is_inner = (first..last).contains(&i);
                let is_free = is_free(leaf_at(words, leg[0].midpoint(leg[1])));
                assert!(
                    is_inner || is_free,
                    "leg {i} of the path runs through a leaf that facets cross"
                );
                (Segment::new(leg[0], leg[1]), if is_inner { least } else { 0.0 })
            })
            .collect();
        // Legs in groups, most of which are far from a facet.
        const GROUP: usize = 32;
        let bounds = |legs: &[(Segment, f64)]| {
            let ends = || legs.iter().flat_map(|(leg, _)| [leg.a, leg.b]);
            let fold = |f: fn(Point, Point) -> Point| ends().reduce(f).expect("a group has legs");
            (fold(Point::min) - least, fold(Point::max) + least)
        };
        let groups: Vec<_> = legs.chunks(GROUP).map(|legs| (bounds(legs), legs)).collect();
        for (number, facet) in case.facets_lattice.iter().enumerate() {
            let [a, b, c] = facet.map(|v| Point::from_array(v.map(|c| c as f64)));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            for ((from, to), legs) in &groups {
                if low.cmple(*to).all() && high.cmpge(*from).all() {
                    legs.iter().for_each(|leg| check_leg(leg, facet, number));
                }
            }
        }
    }

    fn check_narrowest(&self, case: &Case) {
        let narrowest = &self.narrowest;
        let (at, scale) = (narrowest.at, units(&case.root));
        let (first, last) = self.inner;
        assert_eq!(
            Some(at),
            self.points.get(narrowest.index).map(|p| p.at),
            "the narrowest place is a point of the path"
        );
        let [min, width, max] =
            [narrowest.width_min, narrowest.width, narrowest.width_max].map(|w| w * scale);
        assert!(
            0.0 < min && min <= width && width <= max + ROUNDING,
            "width {width} is not between {min} and {max} units"
        );
        let counted = self.points[first..=last].iter().map(|p| p.width * scale);
        let least = counted.fold(f64::INFINITY, f64::min);
        assert!(
            is_near(least, width),
            "a point has the width {least}, the narrowest place {width} units"
        );
        assert!(
            (first..=last).contains(&narrowest.index),
            "point {} does not count",
            narrowest.index
        );
        // A path to the far field counts to its end.
        let ends = if last + 1 == self.points.len() { vec![first] } else { vec![first, last] };
        let is_end = ends.iter().any(|&end| self.points[end].width <= 1.05 * narrowest.width);
        assert_eq!(
            narrowest.is_end, is_end,
            "ends {ends:?} of {:?} with {narrowest:?}",
            self.points
        );
        let centre = (Point::from(at) - Point::from(case.root.origin)) * scale;
        let from = |facet: &FacetLattice| 2.0 * from_point(centre, &triangle(facet));
        let nearest = case.facets_lattice.iter().map(from).fold(f64::INFINITY, f64::min);
        assert!(
            is_near(nearest, width),
            "the nearest facet leaves a width of {nearest}, not {width} units"
        );
        let rim = narrowest.facets.first().map(|&facet| from(&case.facets_lattice[facet as usize]));
        assert!(
            rim.is_some_and(|rim| is_near(rim, nearest)),
            "the nearest facet is not at the rim"
        );
        let direction = Point::from(narrowest.direction).length();
        assert!((direction - 1.0).abs() < 1e-9, "the direction has the length {direction}");
    }
}

/// Asserts that a facet is no nearer to a leg than the leg's clearance, and does not meet it.
fn check_leg((leg, clearance): &(Segment, f64), facet: &FacetLattice, number: usize) {
    let facet = triangle(facet);
    let along = leg.b - leg.a;
    let is_met = facet.intersects_local_ray(&Ray::new(leg.a, along), 1.0);
    let of_ends = from_point(leg.a, &facet).min(from_point(leg.b, &facet));
    let distance = if is_met { -1.0 } else { of_ends.min(from_edges(leg, &facet)) };
    assert!(
        distance >= clearance - ROUNDING,
        "facet {number} is {distance} units from a leg of the path, which has a clearance of {clearance}"
    );
}

#[cfg(test)]
mod tests {
    use super::super::ends::Target;
    use super::super::report::Spacing;
    use super::super::{Leaks, Watch};
    use super::*;
    use contract::testing::base_tree;
    use contract::word::Side;
    use geometries::{Generator, Shape};
    use std::convert::Infallible;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    struct Silent;

    impl Watch for Silent {
        fn step(&self, _: &str) {}

        fn is_interrupted(&self) -> bool {
            false
        }
    }

    /// A sphere without one of its facets, and the answer for its centre.
    fn torn() -> (Case, Report, Vec<u64>) {
        let mut facets = Generator::new(Shape::Sphere, 320).facets().unwrap();
        facets.remove(77);
        let text = "spacing_min = 0.015625\n[root]\norigin = [-0.99, -1.03, -1.01]\nedge = 2.0";
        let case = Case::from_parts(text, facets).unwrap();
        let tree = |level| Ok::<_, Infallible>(base_tree(&case.facets_lattice, level));
        let mut leaks = Leaks::new(&case, tree, 1_000_000, &Silent).unwrap();
        let report = leaks.answers(&[([0.01; 3], Target::Far)]).unwrap().examined.remove(0);
        let words = leaks.words(report.passage.as_ref().unwrap()).to_vec();
        drop(leaks);
        (case, report, words)
    }

    #[test]
    fn wrong_answers_are_noticed() {
        let (case, right, words) = torn();
        right.check_invariants(&case, &words);
        type Plant<'a> = (&'a str, &'a dyn Fn(&mut Report, &mut Passage));
        let through_a_facet = |_: &mut Report, p: &mut Passage| {
            // From the start straight to the boundary on the side without an opening.
            let far = Point::from(p.points[p.points.len() - 1].at);
            let across = if far.x.abs() > 0.9 { [0.01, -1.03, 0.01] } else { [-0.99, 0.01, 0.01] };
            let end = super::super::report::Point { at: across, width: 2.0 };
            p.points.truncate(p.inner.0 + 1);
            p.points.push(end);
            (p.inner.1, p.narrowest.index) = (p.points.len() - 1, p.inner.0);
            p.length = p
                .points
                .windows(2)
                .map(|l| Point::from(l[0].at).distance(Point::from(l[1].at)))
                .sum();
        };
        let plants: [Plant; 16] = [
            ("a point outside the root", &|_, p| p.points[1].at[0] = 1398.0),
            ("another start", &|_, p| p.points[0].at[1] += 0.1),
            ("an end off the boundary", &|_, p| p.points.truncate(p.points.len() - 1)),
            ("a longer path", &|_, p| p.length *= 3.0),
            ("a leg through a facet", &through_a_facet),
            ("a wider opening than there is", &|_, p| {
                let n = &mut p.narrowest;
                (n.width_min, n.width, n.width_max) =
                    (1.1 * n.width_min, 1.1 * n.width, 1.1 * n.width_max);
            }),
            ("a width above its bound", &|_, p| p.narrowest.width_max = 0.9 * p.narrowest.width),
            ("a width below its bound", &|_, p| p.narrowest.width_min = 1.1 * p.narrowest.width),
            ("another narrowest place", &|_, p| p.narrowest.index -= 1),
            ("facets far from the rim", &|_, p| p.narrowest.facets = vec![300]),
            ("an end that is wider", &|_, p| p.narrowest.is_end = true),
            ("no direction", &|_, p| p.narrowest.direction = [0.0; 3]),
            ("a path through another tree", &|_, p| p.spacing = Spacing { level: 1, ..p.spacing }),
            ("no leak with a path", &|r, _| r.is_leak = false),
            ("a level that closes and is open", &|r, _| {
                r.closes = Some(r.levels[1].spacing);
                r.levels[1].is_joined = true;
            }),
            ("a leak of separated places", &|r, _| r.is_separated = true),
        ];
        for (what, plant) in plants {
            let mut wrong = right.clone();
            let mut passage = wrong.passage.take().unwrap();
            plant(&mut wrong, &mut passage);
            wrong.passage = Some(passage);
            let noticed = catch_unwind(AssertUnwindSafe(|| wrong.check_invariants(&case, &words)));
            assert!(noticed.is_err(), "{what} is not noticed");
        }
        let crossing: Vec<u64> = words.iter().map(|w| w & !3 | Side::Crossing as u64).collect();
        let noticed = catch_unwind(AssertUnwindSafe(|| right.check_invariants(&case, &crossing)));
        assert!(noticed.is_err(), "an approach through leaves that facets cross is not noticed");
    }
}
