//! A set of lattice points, numbered.
//!
//! A [brick](crate::brick) has one bit per point that is in the set. A mesh is mostly uniform, so most bricks are nearly full, a point takes about 0.85 bytes, and finding its
//! number is one look into a table that is small enough to stay in the cache.

use std::hash::BuildHasher;

use hashbrown::HashTable;
use hashbrown::hash_table::Entry;
use rustc_hash::FxBuildHasher;

pub use crate::brick::Point;
use crate::brick::{place, point};

/// The set.
#[derive(Debug, Default)]
pub struct Points {
    /// Indices of the bricks by their keys.
    index: HashTable<u32>,
    bricks: Vec<Brick>,
    /// Bitwise or of all coordinates: its lowest bit is the finest grid that has a point.
    bits: u32,
}

/// Points of a set, renumbered in the order in which they are first asked for.
#[derive(Debug)]
pub struct Own {
    /// One more than the new number of each point of the set; 0 if it has none.
    numbers: Vec<u32>,
    /// The numbers that the points have in the set, in the order of their new numbers.
    pub points: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Brick {
    key: u64,
    mask: u64,
    /// Number of the first point.
    first: u64,
}

fn hash(key: u64) -> u64 {
    FxBuildHasher.hash_one(key)
}

impl Points {
    /// Adds a point. Numbers are valid after [`Self::number`].
    pub fn insert(&mut self, point: Point) {
        self.bits |= point[0] | point[1] | point[2];
        let (key, bit) = place(point);
        let Self { index, bricks, .. } = self;
        let is_equal = |&brick: &u32| bricks[brick as usize].key == key;
        let brick = match index.entry(hash(key), is_equal, |&b| hash(bricks[b as usize].key)) {
            Entry::Occupied(entry) => *entry.get(),
            Entry::Vacant(entry) => {
                bricks.push(Brick { key, mask: 0, first: 0 });
                *entry.insert(bricks.len() as u32 - 1).get()
            }
        };
        bricks[brick as usize].mask |= 1 << bit;
    }

    /// Numbers the points: bricks in the order of their first points, within a brick x fastest.
    pub fn number(&mut self) {
        let mut first = 0;
        for brick in &mut self.bricks {
            brick.first = first;
            first += u64::from(brick.mask.count_ones());
        }
    }

    /// Whether there may be points halfway along an edge of this length, a power of two, between points of its grid.
    pub fn may_halve(&self, length: u32) -> bool {
        length > 1 && self.bits & (length - 1) != 0
    }

    /// Number of points.
    pub fn count(&self) -> u64 {
        self.bricks.last().map_or(0, |last| last.first + u64::from(last.mask.count_ones()))
    }

    /// The number of a point; `None` if it is not in the set.
    pub fn find(&self, point: Point) -> Option<u64> {
        let (key, bit) = place(point);
        let is_equal = |&brick: &u32| self.bricks[brick as usize].key == key;
        let brick = self.bricks[*self.index.find(hash(key), is_equal)? as usize];
        let before = brick.mask & ((1 << bit) - 1);
        (brick.mask >> bit & 1 == 1).then(|| brick.first + u64::from(before.count_ones()))
    }

    /// The point with a number.
    pub fn point(&self, number: u64) -> Point {
        let brick = &self.bricks[self.bricks.partition_point(|brick| brick.first <= number) - 1];
        let before = (brick.first..number).fold(brick.mask, |mask, _| mask & (mask - 1));
        point(brick.key, before.trailing_zeros())
    }

    /// The points in the order of their numbers.
    pub fn iter(&self) -> impl Iterator<Item = Point> + '_ {
        self.bricks.iter().flat_map(|brick| {
            (0..64).filter(|bit| brick.mask >> bit & 1 == 1).map(|bit| point(brick.key, bit))
        })
    }
}

impl Own {
    /// No points of a set that has been numbered.
    pub fn new(all: &Points) -> Self {
        Self { numbers: vec![0; all.count() as usize], points: Vec::new() }
    }

    /// The new number of the point that has the number `of_all` in the set.
    pub fn number(&mut self, of_all: u64) -> u64 {
        let number = &mut self.numbers[of_all as usize];
        if *number == 0 {
            self.points.push(u32::try_from(of_all).expect("the numbers fit in memory"));
            *number = self.points.len() as u32;
        }
        u64::from(*number) - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::octant::CELLS_PER_EDGE;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn points_have_distinct_numbers_in_the_order_of_iteration(
            seeds in prop::collection::vec((any::<[u32; 3]>(), 0u32..20), 0..200), near in any::<bool>()
        ) {
            let edge = CELLS_PER_EDGE + 1;
            let aligned = |(p, zeros): &(Point, u32)| p.map(|c| {
                (c % if near { 9 } else { edge }) >> zeros << zeros
            });
            let expected: BTreeSet<Point> = seeds.iter().map(aligned).chain([[0; 3], [CELLS_PER_EDGE; 3]]).collect();
            let mut points = Points::default();
            seeds.iter().map(aligned).for_each(|p| points.insert(p));
            [[0; 3], [CELLS_PER_EDGE; 3]].into_iter().for_each(|p| points.insert(p));
            points.number();
            prop_assert_eq!(points.count(), expected.len() as u64);
            for (number, point) in points.iter().enumerate() {
                prop_assert_eq!(points.find(point), Some(number as u64));
                prop_assert_eq!(points.point(number as u64), point);
            }
            prop_assert_eq!(points.iter().collect::<BTreeSet<_>>(), expected.clone());
            let absent = [1, 2, 3].map(|c| c + CELLS_PER_EDGE / 2);
            prop_assert_eq!(points.find(absent).is_some(), expected.contains(&absent));
        }
    }
}
