//! The ends of a path: points of the user, and whether they are in free leaves; or places in the regions that leaked, and seeds.

use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::manifest::Leak;
use contract::octant::{CELLS_PER_EDGE, UNITS_PER_CELL};
use contract::word::{self, Side};

use super::Leaks;
use crate::tree::Point;
use contract::failure::Failure;
use serde::Serialize;

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

/// A point on the lattice.
///
/// # Errors
/// One sentence, if the point is outside the root.
pub fn on_lattice(what: &str, at: [f64; 3], root: &Root) -> Result<Point, String> {
    let inside = |q: &[i64; 3]| q.iter().all(|c| (0..=UNITS_PER_EDGE).contains(c));
    let found = root.quantise(at).filter(inside);
    found.map(|q| Point::from_array(q.map(|c| c as f64))).ok_or_else(|| {
        let far = root.rounded(root.to_user([UNITS_PER_EDGE; 3]));
        format!(
            "{what} {at:?} is outside the root, which extends from {:?} to {far:?}",
            root.rounded(root.origin)
        )
    })
}

/// A point of the lattice in the user's units.
pub fn to_user(root: &Root, at: Point) -> [f64; 3] {
    let unit = root.edge / UNITS_PER_EDGE as f64;
    let [at, low] = [(Point::from(root.origin) + at * unit).to_array(), root.origin];
    let rounded = root.rounded(at);
    // Rounding may lead out of the root.
    std::array::from_fn(|a| rounded[a].clamp(low[a], low[a] + root.edge))
}

/// The leaf that contains a point of the root, among the sorted words of a tree that fills it.
pub fn leaf_at(words: &[u64], at: Point) -> u64 {
    let last = i64::from(CELLS_PER_EDGE) - 1;
    let cell = at.to_array().map(|c| (c as i64 / UNITS_PER_CELL).clamp(0, last) as u32);
    let after = words.partition_point(|&w| word::key(w) <= word::key_of(cell));
    words[after - 1]
}

/// Whether no facet touches a leaf.
pub fn is_free(leaf: u64) -> bool {
    word::side(leaf) != Side::Crossing
}

/// The sentence about an end in a leaf that facets cross, with the nearest centre of a free one.
pub fn crossed(what: &str, at: Point, words: &[u64], root: &Root) -> String {
    let free = words.iter().filter(|&&w| is_free(w)).map(|&w| word::octant(w).centre());
    let distance = |centre: &[i64; 3]| Point::from_array(centre.map(|c| c as f64)).distance(at);
    let nearest = free.min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let place = format!("{what} {:?} is in a leaf that facets cross", to_user(root, at));
    match nearest {
        Some(near) => format!(
            "{place}; the nearest centre of a free leaf is {:?}",
            root.rounded(root.to_user(near))
        ),
        None => format!("{place}, and there are no free leaves: use a smaller spacing_min"),
    }
}

impl<F: FnMut(u8) -> Result<Vec<u64>, Failure>> Leaks<'_, F> {
    /// A point of each region that leaked. One that is closed at several coarser spacings is listed once, with the finest of them.
    ///
    /// # Errors
    /// If a base tree cannot be made.
    pub fn regions(&mut self, leaks: &[Leak]) -> Result<Vec<[f64; 3]>, Failure> {
        let edge = self.case.root.edge;
        let level = |leak: &Leak| (edge / leak.spacing_coarse).log2().round() as u8;
        let Some(finest) = leaks.iter().map(level).max() else { return Ok(Vec::new()) };
        let (of_finest, others): (Vec<&Leak>, Vec<&Leak>) =
            leaks.iter().partition(|leak| level(leak) == finest);
        let mut points: Vec<_> = of_finest.iter().map(|leak| leak.point).collect();
        for leak in others {
            if self.joined(finest, leak.point, &points[..of_finest.len()])?.is_none() {
                points.push(leak.point);
            }
        }
        Ok(points)
    }

    /// The first seed that is joined to an end at the case's spacing, or else the first one; `None` without seeds.
    ///
    /// # Errors
    /// If the end is outside the root, or a base tree cannot be made.
    pub fn seed(&mut self, end: Target) -> Result<Option<[f64; 3]>, Failure> {
        let seeds = &self.case.seeds;
        let joined = match end {
            Target::Point(at) if seeds.len() > 1 => {
                self.joined(self.case.level_surface, at, seeds)?
            }
            _ => None,
        };
        Ok(joined.or_else(|| seeds.first().copied()))
    }

    /// The first of some places that free leaves of the base tree of a level join to an end.
    fn joined(
        &mut self,
        level: u8,
        end: [f64; 3],
        places: &[[f64; 3]],
    ) -> Result<Option<[f64; 3]>, Failure> {
        let root = self.case.root;
        let end = on_lattice("--to", end, &root)?;
        self.make_tree(level)?;
        for &place in places {
            let Ok(at) = on_lattice("--from", place, &root) else { continue };
            let ends = (end, Some(at));
            if self.crossed(level, ends).is_none() && self.search(level, ends, None)? {
                return Ok(Some(place));
            }
        }
        Ok(None)
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
