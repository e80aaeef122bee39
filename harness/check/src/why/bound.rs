//! Lower bounds of the length of a chain, which direct the search for the shortest one.
//!
//! A link leads from an octant to the parent Q of a leaf S of level l. By layer, S is at most n - 2 cells of level l away; by
//! balance it touches. Q is 2 such cells wide, so a link shortens the distance to a cause by at most n cells of level l, or
//! by 2. As levels rise along a chain, the links are ever shorter, and **a distance needs a number of links**.
//!
//! With n >= 3, **levels need links, too**. Leaves of level m + 1 and of level m - 1 are at least n cells of level m apart for
//! every m < D, and for every m if everything is kept (section 7 of reference/DEFINITION.md). If the leaf after S had a level of
//! l + 2 or more, then with m = l + 1 it would be nearer to S: less than (n - 1)/2 + 2 cells of level m. So levels rise by at most one
//! from link to link. A chain ends in an octant that T0 splits because of level b (D, or that of a box). Its last leaf has level
//! b: a leaf of level b - 1 beside a leaf of level b in the same octant would be within that leaf's layer.
//! Where a box finer than D may look through a thin deleted body, the argument holds up to level D - 1 only.
//! In a mesh that breaks these promises, a chain that is called the shortest may not be.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::Mesh;
use super::leaves::id;
use crate::checks::Terms;
use contract::manifest::{ExtentBox, Keep};
use contract::octant::{CELLS_PER_EDGE, LEVEL_MAX, Octant, UNITS_PER_CELL};

/// No chain is longer, because only a layer after a balance can have the level of the leaf before.
const LINKS_MAX: usize = 2 * (LEVEL_MAX as usize + 1);

/// Levels by which the octants are finer whose distance stands for that of the facets in them.
const LEVELS_FINER: u8 = 3;

/// Lower bounds of the number of links.
#[derive(Debug)]
pub struct Bounds {
    surface: Coverage,
    /// For each box, in the order of the case.
    boxes: Vec<Coverage>,
    /// Least level of the last leaf of a chain.
    level_last_min: u8,
}

/// The longest distances that chains cover.
#[derive(Debug)]
struct Coverage {
    /// In level-19 cells, by links, level of the leaf before, and whether the octant must be deep; `None` if a chain with so few
    /// links does not reach the level of the cause.
    covered: Vec<[[Option<i64>; 2]; LEVEL_MAX as usize + 1]>,
}

impl Coverage {
    /// The distances for layers of `n` cells and chains whose last leaf has level `last` at least.
    fn new(n: u32, last: u8) -> Self {
        let none = std::array::from_fn(|level| [(level >= usize::from(last)).then_some(0); 2]);
        let mut covered = vec![none];
        for links in 0..LINKS_MAX {
            let after = |level: usize, is_deep: bool, cells: u32| {
                let rest: Option<i64> = covered[links].get(level)?[usize::from(is_deep)];
                rest.map(|rest| rest + i64::from(cells) * i64::from(CELLS_PER_EDGE >> level))
            };
            let next = std::array::from_fn(|level| {
                let layer = |level| if n > 1 { after(level, true, n - n % 2) } else { None };
                let finer = layer(level + 1).max(after(level + 1, false, 2));
                [finer.max(layer(level)), finer]
            });
            covered.push(next);
        }
        Self { covered }
    }

    /// Least number of links that cover a distance, and the distance that they cover beyond it.
    fn links(&self, level: u8, is_deep: bool, distance: i64) -> Option<(usize, i64)> {
        let mut lengths = self.covered.iter().enumerate();
        lengths.find_map(|(links, covered)| {
            let covered = covered[usize::from(level)][usize::from(is_deep)]?;
            (covered >= distance).then(|| (links, covered - distance))
        })
    }
}

impl Bounds {
    /// The bounds for a mesh with these requirements.
    pub fn new(terms: &Terms) -> Self {
        let n = terms.layer_cells_min;
        let is_certain = terms.keep == Keep::All || !terms.has_box_finer_than_surface();
        let level_certain = match (n, is_certain) {
            (..3, _) => 0,
            (_, true) => LEVEL_MAX,
            (_, false) => terms.level_surface.saturating_sub(1),
        };
        let last = |level: u8| level.min(level_certain);
        let levels = terms.boxes.iter().map(|extent| last(extent.level));
        Self {
            surface: Coverage::new(n, last(terms.level_surface)),
            boxes: levels.clone().map(|level| Coverage::new(n, level)).collect(),
            level_last_min: levels.fold(last(terms.level_surface), u8::min),
        }
    }

    /// Least number of links after a leaf of this level.
    pub fn links_after(&self, level: u8) -> usize {
        usize::from(self.level_last_min.saturating_sub(level))
    }
}

impl Mesh<'_> {
    /// Least number of links from an octant that T0 does not split to a cause, and the distance in level-19 cells that they
    /// cover beyond it; `None` if no chain reaches a cause. `is_deep` states that the octant must be deep.
    pub(super) fn links_min(&self, octant: &Octant, is_deep: bool) -> Option<(usize, i64)> {
        let level = octant.level + 1;
        let slack = match self.has_deleted_crossing() {
            // The extra layer ends a chain beside the surface.
            true => i64::from(CELLS_PER_EDGE >> self.terms.level_surface),
            false => 0,
        };
        let surface = self
            .distance_of_surface(octant)
            .and_then(|distance| self.bounds.surface.links(level, is_deep, distance - slack));
        let boxes = self.terms.boxes.iter().zip(&self.bounds.boxes);
        let boxes = boxes.filter_map(|(extent, coverage)| {
            coverage.links(level, is_deep, distance_of_box(octant, extent))
        });
        let least = boxes.chain(surface).min_by_key(|&(links, beyond)| (links, Reverse(beyond)));
        least.map(|(links, beyond)| (links.max(1), beyond))
    }

    /// A distance within which no facet is, in level-19 cells; `None` without facets in the root.
    fn distance_of_surface(&self, octant: &Octant) -> Option<i64> {
        let id = id(octant);
        if let Some(&known) = self.known.distances.borrow().get(&id) {
            return known;
        }
        let level_last =
            (octant.level + LEVELS_FINER).min(self.terms.level_surface.saturating_sub(1));
        let mut near = BinaryHeap::from([Reverse((0, Reverse(0), 0))]);
        let mut distance = None;
        while let Some(Reverse((at_least, Reverse(level), key))) = near.pop() {
            let at = Octant { corner: contract::word::corner_of(key), level };
            if !self.is_crossed(&at) {
                continue;
            }
            if level >= level_last {
                distance = Some(at_least);
                break;
            }
            for child in (0..8).map(|digit| at.child(digit)) {
                let key = contract::word::key_of(child.corner);
                near.push(Reverse((octant.distance(&child), Reverse(child.level), key)));
            }
        }
        self.known.distances.borrow_mut().insert(id, distance);
        distance
    }
}

/// Distance of an octant and a box, rounded down to level-19 cells.
fn distance_of_box(octant: &Octant, extent: &ExtentBox) -> i64 {
    let (low, high) = octant.bounds();
    let along = |a: usize| (low[a] - extent.max[a]).max(extent.min[a] - high[a]);
    (0..3).map(along).fold(0, i64::max) / UNITS_PER_CELL
}
