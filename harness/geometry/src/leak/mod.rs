//! Leaks: does a path of free leaves of the base tree join two places, how wide is it, and at which spacing does it
//! close? Ends of paths are points of the user in free leaves, places in the regions that leaked, or seeds.
//!
//! - `space`: the cells of a base tree and the widest path through them; `passage`: its width, to 5 %;
//! - [`report`]: the answer as data and for a terminal; `invariants`: what it satisfies.
//!
//! A leaf is free if no facet touches it; two free leaves are joined if they share part of a face. A ball as wide as the
//! narrower of the two passes from one to the other, so an opening that joins leaves of edge e is at least e wide. An
//! opening wider than 2 sqrt(3) e always joins leaves of edge e: the leaf that contains the centre of the ball is free.

mod invariants;
mod passage;
pub mod report;
mod space;

use std::collections::BTreeMap;

use crate::tree::{FacetTree, Point};
use contract::case::Case;
use contract::failure::{Failure, Result, progress};
use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::manifest::Leak;
use contract::word::{self, Side};
use report::{Answers, Closes, Report, SCHEMA, Spacing};
use serde::Serialize;
use space::Space;

/// Where a path ends, in the user's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Target {
    /// The far field: any leaf at the root's boundary.
    Far,
    /// The leaf that contains a point.
    #[serde(untagged)]
    Point([f64; 3]),
}

impl Target {
    /// The point on the lattice, if it is one.
    fn on_lattice(self, root: &Root) -> Result<Option<Point>, String> {
        match self {
            Self::Far => Ok(None),
            Self::Point(at) => on_lattice("--to", at, root).map(Some),
        }
    }
}

/// The ends of a path on the lattice; the second is `None` for the far field.
type Ends = (Point, Option<Point>);

/// A case whose openings are searched.
pub struct Leaks<'a, F> {
    case: &'a Case,
    facets: FacetTree,
    /// Makes the sorted leaf words of the case's base tree at a surface level.
    make: F,
    /// Those that were made.
    trees: BTreeMap<u8, Vec<u64>>,
}

impl<'a, F: FnMut(u8) -> Result<Vec<u64>>> Leaks<'a, F> {
    /// A case; `make` returns the sorted leaf words of its base tree at another surface level.
    ///
    /// # Errors
    /// If the case has no facets.
    pub fn new(case: &'a Case, make: F) -> Result<Self> {
        let why = "the case has no facets, so nothing separates places";
        Failure::unless(!case.facets.is_empty(), why)?;
        let facets = FacetTree::new(&case.facets_lattice);
        Ok(Self { case, facets, make, trees: BTreeMap::new() })
    }

    /// Answers for pairs of places, with their invariants checked.
    ///
    /// # Errors
    /// If an end is outside the root or in a crossing leaf, if a base tree cannot be made, or if the user interrupts.
    pub fn answers(&mut self, ends: &[([f64; 3], Target)]) -> Result<Answers> {
        let examined =
            ends.iter().map(|&(from, to)| self.answer(from, to)).collect::<Result<_, _>>()?;
        let case = self.case;
        let facets = case.facets.len() as u64;
        Ok(Answers { schema: SCHEMA, case: case.name.clone(), facets, root: case.root, examined })
    }

    fn answer(&mut self, from: [f64; 3], to: Target) -> Result<Report> {
        let (root, level) = (&self.case.root, self.case.level_surface);
        let start = on_lattice("--from", from, root)?;
        let ends = (start, to.on_lattice(root)?);
        self.make_tree(level)?;
        if let Some((what, at)) = self.crossed(level, ends) {
            return Err(Failure::input(why_crossed(what, at, &self.trees[&level], root)));
        }
        let spacing = Spacing::of(level, root);
        let (widest, outside) = self.leaks(level, ends)?;
        let (is_leak, closes, passage) = (widest.is_some(), None, None);
        let is_outside = |words: &[u64]| word::side(leaf_at(words, start)) == Side::Outside;
        let is_by_rays = to == Target::Far && self.case.seeds.is_empty();
        let is_apart = is_by_rays && !is_leak && is_outside(&self.trees[&level]);
        let is_cut = is_apart && !is_outside(&self.without_cut(level)?);
        let is_enclosed = is_apart && !is_cut;
        let mut found = Report { from, to, spacing, is_leak, is_enclosed, is_cut, closes, passage };
        if let Some(finest) = widest {
            // The widest opening is as wide as the leaves of a path, or 4 times those two levels below. There its ball's centre lies in
            // free leaves: no finer tree has a wider path. The coarsest tree that joins the ends may do so through the finer cells of a
            // box, and close a wider opening.
            let outside = outside.as_deref();
            found.closes = self.coarsen(ends, outside, finest)?;
            for measured in level.min(finest + 2)..=level {
                self.make_tree(measured)?;
                progress("measuring the width");
                let words = &self.trees[&measured];
                let space = Space::new(words, &self.facets, outside)?;
                let passage = passage::widest((self.case, measured), space, ends)?;
                // Otherwise, a narrow place at the start, which no opening is, may hide a wider path.
                if measured == level || passage.is_widest() {
                    passage.check_invariants(self.case, (words, outside), (from, to));
                    // The cells of a finer box stay as they are, and so does the opening among them, whatever facets cross at the ends.
                    let cell = passage.narrowest.cell_of_boxes;
                    found.closes.take_if(|at| at.is_end_crossed && cell < at.spacing.spacing);
                    found.passage = Some(passage);
                    break;
                }
            }
        }
        Ok(found)
    }

    /// What [`Self::search`] finds in a base tree; and the words whose outside is the far field, if that is not all of the root's boundary.
    fn leaks(&mut self, level: u8, ends: Ends) -> Result<(Option<u8>, Option<Vec<u64>>)> {
        let joined = self.search(level, ends, None)?;
        let is_far = joined.is_some() && ends.1.is_none();
        let outside = if is_far { self.closed(ends.0)? } else { None };
        let Some(far) = &outside else { return Ok((joined, None)) };
        Ok((self.search(level, ends, Some(far))?, outside))
    }

    fn make_tree(&mut self, level: u8) -> Result<()> {
        if !self.trees.contains_key(&level) {
            progress(&format!("meshing the base tree of level {level}"));
            self.trees.insert(level, (self.make)(level)?);
        }
        Ok(())
    }

    /// An end of which facets cross the leaf in a base tree.
    fn crossed(&self, level: u8, (from, to): Ends) -> Option<(&'static str, Point)> {
        let is_crossed = |end: &(_, Point)| word::is_crossing(leaf_at(&self.trees[&level], end.1));
        [Some(("--from", from)), to.map(|to| ("--to", to))].into_iter().flatten().find(is_crossed)
    }

    /// A point of each space that is outside at the case's spacing, and that the root cuts off the far field.
    ///
    /// # Errors
    /// If the base tree cannot be made.
    pub fn cut(&mut self) -> Result<Vec<[f64; 3]>> {
        self.make_tree(self.case.level_surface)?;
        let (root, words) = (&self.case.root, &self.trees[&self.case.level_surface]);
        let leaf = |cell: u32| word::octant(words[cell as usize]);
        let largest = |of: Vec<u32>| of.into_iter().map(leaf).min_by_key(|leaf| leaf.level);
        let largest = Space::new(words, &self.facets, None)?.cut().into_iter().filter_map(largest);
        Ok(largest.map(|leaf| root.rounded(root.to_user(leaf.centre()))).collect())
    }

    /// The words of a base tree, in which all that is outside at the root's boundary but the largest space is inside: the root may cut others
    /// off the far field, such as the cavity of a half model.
    fn without_cut(&mut self, level: u8) -> Result<Vec<u64>> {
        self.make_tree(level)?;
        let mut words = self.trees[&level].clone();
        let cut = Space::new(&words, &self.facets, None)?.cut();
        cut.iter().flatten().for_each(|&cell| words[cell as usize] |= Side::Inside as u64);
        Ok(words)
    }

    /// The words of the finest coarser base tree in which the start is inside, and part of the root's boundary outside: the root may cut the
    /// body, so only that part is the far field. Without one, those of the finest tree in which the root cuts the start off the far field.
    fn closed(&mut self, start: Point) -> Result<Option<Vec<u64>>> {
        let is_inside = |words: &[u64]| word::side(leaf_at(words, start)) == Side::Inside;
        let is_far = |&w: &u64| word::side(w) == Side::Outside && word::octant(w).is_at_boundary();
        for level in (0..self.case.level_surface).rev() {
            self.make_tree(level)?;
            let words = &self.trees[&level];
            if is_inside(words) && words.iter().any(is_far) {
                return Ok(Some(words.clone()));
            }
        }
        for level in (0..=self.case.level_surface).rev() {
            let words = self.without_cut(level)?;
            if is_inside(&words) && !is_inside(&self.trees[&level]) {
                return Ok(Some(words));
            }
        }
        Ok(None)
    }

    /// The level of the finest leaves on the path that joins the ends through the coarsest free leaves of a base tree; none if no path does.
    /// The ends lie in free leaves. The far field is what is outside by the words `outside`, if there are any.
    fn search(&self, level: u8, ends: Ends, outside: Option<&[u64]>) -> Result<Option<u8>> {
        progress(&format!("searching the base tree of level {level}"));
        let mut space = Space::new(&self.trees[&level], &self.facets, outside)?;
        let edge = |space: &mut Space, cell: u32| space.cells[cell as usize].edge();
        let widest = space.widest(ends, f32::INFINITY, edge)?;
        Ok(widest.map(|(_, edge)| (UNITS_PER_EDGE as f32 / edge).log2() as u8))
    }

    /// Coarsens the surface until the ends are not joined; at the case's spacing, leaves of the level `depth` or coarser join them. If facets
    /// then cross only the leaves of the ends, and finer ones joined them before, those of a box, no spacing closes the opening.
    fn coarsen(
        &mut self,
        ends: Ends,
        far: Option<&[u64]>,
        mut depth: u8,
    ) -> Result<Option<Closes>> {
        for level in (0..self.case.level_surface).rev() {
            self.make_tree(level)?;
            let is_end_crossed = self.crossed(level, ends).is_some();
            let joined = if is_end_crossed { None } else { self.search(level, ends, far)? };
            let Some(leaves) = joined else {
                let at = Closes { spacing: Spacing::of(level, &self.case.root), is_end_crossed };
                return Ok((!is_end_crossed || depth <= level + 1).then_some(at));
            };
            depth = leaves;
        }
        Ok(None)
    }

    /// A point of each region that leaked. One that is closed at several coarser spacings is listed once, with the finest of them.
    ///
    /// # Errors
    /// If a base tree cannot be made.
    pub fn regions(&mut self, leaks: &[Leak]) -> Result<Vec<[f64; 3]>> {
        let level = |leak: &Leak| (self.case.root.edge / leak.spacing_coarse).log2().round() as u8;
        let Some(finest) = leaks.iter().map(level).max() else { return Ok(Vec::new()) };
        let (of_finest, others): (Vec<&Leak>, Vec<&Leak>) =
            leaks.iter().partition(|leak| level(leak) == finest);
        let mut points: Vec<_> = of_finest.iter().map(|leak| leak.point).collect();
        for leak in others {
            let of_finest = &points[..of_finest.len()];
            if self.joined(finest, Target::Point(leak.point), of_finest)?.is_none() {
                points.push(leak.point);
            }
        }
        Ok(points)
    }

    /// The first seed that is joined to an end at the case's spacing, or else the first one; `None` without seeds.
    ///
    /// # Errors
    /// If the end is outside the root, or a base tree cannot be made.
    pub fn seed(&mut self, end: Target) -> Result<Option<[f64; 3]>> {
        let seeds = &self.case.seeds;
        let [first, _, ..] = seeds[..] else { return Ok(seeds.first().copied()) };
        Ok(self.joined(self.case.level_surface, end, seeds)?.or(Some(first)))
    }

    /// The first of some places that free leaves of the base tree of a level join to an end.
    fn joined(&mut self, level: u8, end: Target, places: &[[f64; 3]]) -> Result<Option<[f64; 3]>> {
        let root = self.case.root;
        let end = end.on_lattice(&root)?;
        self.make_tree(level)?;
        for &place in places {
            let Ok(at) = on_lattice("--from", place, &root) else { continue };
            // A search from the smaller of two places ends sooner: that of a leak, not that of a flow.
            let ends = end.map_or((at, None), |end| (end, Some(at)));
            if self.crossed(level, ends).is_none() && self.leaks(level, ends)?.0.is_some() {
                return Ok(Some(place));
            }
        }
        Ok(None)
    }
}

/// A point on the lattice.
///
/// # Errors
/// One sentence, if the point is outside the root.
fn on_lattice(what: &str, at: [f64; 3], root: &Root) -> Result<Point, String> {
    let inside = |q: &[i64; 3]| q.iter().all(|c| (0..=UNITS_PER_EDGE).contains(c));
    let found = root.quantise(at).filter(inside);
    found.map(|q| Point::from_array(q.map(|c| c as f64))).ok_or_else(|| {
        let ends = [root.origin, root.to_user([UNITS_PER_EDGE; 3])];
        let [low, high] = ends.map(|end| root.rounded(end));
        format!("{what} {at:?} is outside the root, which extends from {low:?} to {high:?}")
    })
}

/// A point of the lattice in the user's units.
fn to_user(root: &Root, at: Point) -> [f64; 3] {
    let unit = root.edge / UNITS_PER_EDGE as f64;
    let [at, low] = [(Point::from(root.origin) + at * unit).to_array(), root.origin];
    let rounded = root.rounded(at);
    // Rounding may lead out of the root.
    std::array::from_fn(|a| rounded[a].clamp(low[a], low[a] + root.edge))
}

/// The leaf that contains a point of the root, among the sorted words of a tree that fills it.
fn leaf_at(words: &[u64], at: Point) -> u64 {
    let at = at.to_array().map(|c| (c as i64).clamp(0, UNITS_PER_EDGE - 1));
    words[word::leaf_at(words, at).expect("the leaves fill the root")]
}

/// The sentence about an end in a leaf that facets cross, with the nearest centre of a free one.
fn why_crossed(what: &str, at: Point, words: &[u64], root: &Root) -> String {
    let free = words.iter().filter(|&&w| !word::is_crossing(w)).map(|&w| word::octant(w).centre());
    let distance = |centre: &[i64; 3]| Point::from_array(centre.map(|c| c as f64)).distance(at);
    let nearest = free.min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let place = format!("{what} {:?} is in a leaf that facets cross", to_user(root, at));
    match nearest.map(|centre| root.rounded(root.to_user(centre))) {
        Some(centre) => format!("{place}; the nearest centre of a free leaf is {centre:?}"),
        None => format!("{place}, and there are no free leaves: use a smaller spacing_min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_of_the_root_is_printed_within_the_root() {
        let (low, edge) = (-1.4997306168079376, 2.9994612336158752);
        let root = Root { origin: [low; 3], edge };
        for at in [0, UNITS_PER_EDGE] {
            let printed = to_user(&root, Point::splat(at as f64));
            assert!(printed.iter().all(|x| (low..=low + edge).contains(x)), "{printed:?}");
        }
    }
}
