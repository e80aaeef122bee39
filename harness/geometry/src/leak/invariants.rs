//! What an answer satisfies before it is printed. No tree of boxes and no cell of the search is used: facets are compared with the
//! path one by one, and leaves are found by their words.
//!
//! - The path lies in the root, as its printed numbers say, starts and ends where it says; at the far field, what is outside if the body is
//!   closed.
//! - Every leg lies in a free leaf; or, in a leaf that facets cross, a ball of the least width passes along it.
//! - No facet is nearer to a leg that counts than half of the least width, and none meets any leg.
//! - A path of a coarser base tree than the case's is so wide that this tree has free leaves on every wider one.
//! - The narrowest place is a point of the path; its width lies between its bounds, is no more than that of any point that counts, and is
//!   twice the distance to the nearest facet, which is one of the rim.

use super::report::{Passage, Point as Stop};
use super::{Target, leaf_at};
use crate::tree::{Point, from_edges, from_point, met, triangle};
use contract::case::Case;
use contract::lattice::{FacetLattice, UNITS_PER_EDGE};
use contract::word::{self, Side};
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::query::Ray;
use parry3d_f64::shape::Segment;

/// Exceeds the rounding of printed points, in lattice units.
const ROUNDING: f64 = 2.0;

impl Passage {
    /// Asserts the invariants of a path between two ends, with the sorted words of the base tree that it leads through, and of that whose
    /// outside has the far field.
    pub fn check_invariants(
        &self,
        case: &Case,
        (words, outside): (&[u64], Option<&[u64]>),
        (from, to): ([f64; 3], Target),
    ) {
        let (edge, scale) = (UNITS_PER_EDGE as f64, UNITS_PER_EDGE as f64 / case.root.edge);
        let lattice = |at: [f64; 3]| (Point::from(at) - Point::from(case.root.origin)) * scale;
        let points: Vec<Point> = self.points.iter().map(|point| lattice(point.at)).collect();
        let margin = |at: &Point| at.min_element().min(edge - at.max_element());
        let ends = case.root.origin.map(|low| low..=low + case.root.edge);
        let is_beyond = |p: &&Stop| (0..3).any(|a| !ends[a].contains(&p.at[a]));
        let beyond = self.points.iter().find(is_beyond);
        assert_eq!(beyond, None, "a point of the path is outside the root");
        let end = points[points.len() - 1];
        let is_end = match to {
            Target::Point(to) => end.distance(lattice(to)) <= ROUNDING,
            Target::Far => {
                let is_outside = |words| word::side(leaf_at(words, end)) == Side::Outside;
                margin(&end) <= ROUNDING && outside.is_none_or(is_outside)
            }
        };
        let is_start = points[0].distance(lattice(from)) <= ROUNDING;
        assert!(is_start && is_end, "the path leads from {} to {end}", points[0]);
        let (first, last) = self.inner;
        assert!(first <= last && last < points.len(), "{:?} of {}", self.inner, points.len());
        let is_widest = self.spacing.level == case.level_surface || self.is_widest();
        assert!(is_widest, "cells of {:?} may close a wider path", self.spacing);
        self.check_legs(case, words, &points, self.narrowest.width_min / 2.0 * scale);
        self.check_narrowest(case, lattice(self.narrowest.at), scale);
    }

    /// Whether no base tree of a finer spacing has a wider path: an opening wider than the diagonals of two cells is open at their spacing. An
    /// end may be narrower, as no opening is.
    pub fn is_widest(&self) -> bool {
        self.narrowest.is_end || self.narrowest.width_max >= 12f64.sqrt() * self.spacing.spacing
    }

    /// Compares the legs with all facets; `least` is the clearance of those that count.
    fn check_legs(&self, case: &Case, words: &[u64], points: &[Point], least: f64) {
        let leg = |(i, ends): (usize, &[Point])| {
            let is_inner = (self.inner.0..self.inner.1).contains(&i);
            let is_free = !word::is_crossing(leaf_at(words, ends[0].midpoint(ends[1])));
            assert!(is_inner || is_free, "leg {i} leads through a leaf that facets cross");
            let leg = Segment::new(ends[0], ends[1]);
            let clearance = if is_inner { least } else { 0.0 };
            (leg, clearance, leg.local_aabb().loosened(clearance))
        };
        let legs: Vec<(Segment, f64, Aabb)> = points.windows(2).enumerate().map(leg).collect();
        for (number, facet) in case.facets_lattice.iter().map(triangle).enumerate() {
            let around = facet.local_aabb();
            for (leg, clearance, _) in legs.iter().filter(|leg| leg.2.intersects(&around)) {
                let is_met = met(&facet, &Ray::new(leg.a, leg.b - leg.a), 1.0).is_some();
                let of_ends = from_point(leg.a, &facet).min(from_point(leg.b, &facet));
                let distance = if is_met { -1.0 } else { of_ends.min(from_edges(leg, &facet)) };
                let is_clear = distance >= clearance - ROUNDING;
                assert!(is_clear, "facet {number} is {distance} from {leg:?}, not {clearance}");
            }
        }
    }

    fn check_narrowest(&self, case: &Case, centre: Point, scale: f64) {
        let (narrowest, (first, last)) = (&self.narrowest, self.inner);
        let is_point = self.points.get(narrowest.index).is_some_and(|p| p.at == narrowest.at);
        let is_counted = (first..=last).contains(&narrowest.index);
        assert!(is_point && is_counted, "point {} of {:?}", narrowest.index, self.inner);
        let [min, width, max] =
            [narrowest.width_min, narrowest.width, narrowest.width_max].map(|w| w * scale);
        let is_between = 0.0 < min && min <= width && width <= max + ROUNDING;
        assert!(is_between, "width {width} is not between {min} and {max} units");
        let counted = self.points[first..=last].iter().map(|p| p.width * scale);
        let from = |facet: &FacetLattice| 2.0 * from_point(centre, &triangle(facet));
        let nearest = case.facets_lattice.iter().map(from).fold(f64::INFINITY, f64::min);
        let rim = narrowest.facets.first().map(|&facet| from(&case.facets_lattice[facet as usize]));
        let widths = [Some(counted.fold(f64::INFINITY, f64::min)), Some(nearest), rim];
        let is_near = |w: f64| (w - width).abs() <= ROUNDING + 1e-9 * width.abs();
        let are_near = widths.iter().all(|w| w.is_some_and(is_near));
        assert!(are_near, "width {width}; of all points, to all facets, at the rim {widths:?}");
    }
}

#[cfg(test)]
mod tests {
    use super::super::Leaks;
    use super::super::report::Spacing;
    use super::*;
    use contract::failure::Failure;
    use contract::testing::base_tree;
    use geometries::{Generator, Shape};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// A sphere without one of its facets, the path out of its centre, and the base tree that this leads through.
    fn torn() -> (Case, Passage, Vec<u64>) {
        let mut facets = Generator::new(Shape::Sphere, 320).facets().unwrap();
        facets.remove(77);
        let text = "spacing_min = 0.015625\n[root]\norigin = [-0.99, -1.03, -1.01]\nedge = 2.0";
        let case = Case::from_parts(text, facets).unwrap();
        let tree = |level| Ok::<_, Failure>(base_tree(&case.facets_lattice, |_| level));
        let mut leaks = Leaks::new(&case, tree).unwrap();
        let report = leaks.answers(&[([0.01; 3], Target::Far)]).unwrap().examined.remove(0);
        let passage = report.passage.unwrap();
        let words = leaks.trees[&passage.spacing.level].clone();
        drop(leaks);
        (case, passage, words)
    }

    #[test]
    fn wrong_answers_are_noticed() {
        let (case, right, words) = torn();
        let check = |passage: &Passage, words: &[u64]| {
            passage.check_invariants(&case, (words, None), ([0.01; 3], Target::Far));
        };
        check(&right, &words);
        type Plant<'a> = (&'a str, &'a dyn Fn(&mut Passage));
        let through_a_facet = |p: &mut Passage| {
            // From the start straight to the boundary on the side without an opening.
            let far = Point::from(p.points[p.points.len() - 1].at);
            let across = if far.x.abs() > 0.9 { [0.01, -1.03, 0.01] } else { [-0.99, 0.01, 0.01] };
            let end = super::super::report::Point { at: across, width: 2.0 };
            p.points.truncate(p.inner.0 + 1);
            p.points.push(end);
            (p.inner.1, p.narrowest.index) = (p.points.len() - 1, p.inner.0);
        };
        let plants: [Plant; 10] = [
            ("a point outside the root", &|p| p.points[1].at[0] = 1398.0),
            ("another start", &|p| p.points[0].at[1] += 0.1),
            ("an end off the boundary", &|p| p.points.truncate(p.points.len() - 1)),
            ("a leg through a facet", &through_a_facet),
            ("a wider opening than there is", &|p| {
                let n = &mut p.narrowest;
                (n.width_min, n.width, n.width_max) =
                    (1.1 * n.width_min, 1.1 * n.width, 1.1 * n.width_max);
            }),
            ("a width above its bound", &|p| p.narrowest.width_max = 0.9 * p.narrowest.width),
            ("a width below its bound", &|p| p.narrowest.width_min = 1.1 * p.narrowest.width),
            ("another narrowest place", &|p| p.narrowest.index -= 1),
            ("cells that may close a wider path", &|p| p.spacing = Spacing::of(1, &case.root)),
            ("facets far from the rim", &|p| p.narrowest.facets = vec![300]),
        ];
        for (what, plant) in plants {
            let mut wrong = right.clone();
            plant(&mut wrong);
            let noticed = catch_unwind(AssertUnwindSafe(|| check(&wrong, &words)));
            assert!(noticed.is_err(), "{what} is not noticed");
        }
        let crossing: Vec<u64> = words.iter().map(|w| w & !3 | Side::Crossing as u64).collect();
        let noticed = catch_unwind(AssertUnwindSafe(|| check(&right, &crossing)));
        assert!(noticed.is_err(), "an approach through leaves that facets cross is not noticed");
    }
}
