//! The neighbours of a rank: the owners of octants that touch its own.

use super::Ownership;
use bricks::octant::{Level, morton, position, start57};

/// A step to an octant or one that touches it: -1, 0 or 1 along each axis.
type Step = [i8; 3];

impl Ownership {
    /// The ranks whose octants touch this rank's over a face, an edge or a corner; each with the level-19 code of one of this
    /// rank's octants that it touches.
    pub fn neighbours(&self) -> Vec<(usize, u64)> {
        let mut found = vec![false; self.ranks];
        if let Some(rank) = self.rank {
            found[rank] = true;
        }
        let mut neighbours = Vec::new();
        for (l, code) in self.octants() {
            let p = position(code).map(i64::from);
            let mut add = |owner: usize| {
                if !std::mem::replace(&mut found[owner], true) {
                    neighbours.push((owner, start57(l, code)));
                }
            };
            for step in (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]) {
                let touching: [i64; 3] = std::array::from_fn(|a| p[a] + i64::from(step[a]));
                if touching.iter().all(|c| (0..1 << l).contains(c)) {
                    self.owners_touching(l, morton(touching.map(|c| c as u32)), step, &mut add);
                }
            }
        }
        neighbours
    }

    /// Calls `add` with the owners, other than this rank, of the parts of an octant that touch the octant from which `step` leads to
    /// it.
    fn owners_touching(&self, l: Level, code: u64, step: Step, add: &mut impl FnMut(usize)) {
        if self.own.start <= start57(l, code) && start57(l, code + 1) <= self.own.end {
            return;
        }
        if let Some(owner) = self.sole_owner(l, code) {
            return add(owner);
        }
        // After a step up only the lower children touch, after a step down only the upper ones.
        let touches =
            |child: u64| (0..3).all(|a| step[a] != if child >> a & 1 == 1 { 1 } else { -1 });
        for child in (0..8).filter(|&child| touches(child)) {
            self.owners_touching(l + 1, code << 3 | child, step, add);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{FINE, RANKS, owners, ownership};
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn neighbours_own_octants_that_touch(owners in owners()) {
            let touch = |a: u64, b: u64| {
                let (p, q) = (position(a), position(b));
                (0..3).all(|axis| p[axis].abs_diff(q[axis]) <= 1)
            };
            let octants = 0..1u64 << (3 * FINE);
            let of = |octant: u64| owners[octant as usize];
            for rank in 0..RANKS {
                let mine: Vec<u64> = octants.clone().filter(|&o| of(o) == rank).collect();
                let touched = octants.clone().filter(|&o| mine.iter().any(|&m| touch(m, o)));
                let others: BTreeSet<usize> = touched.map(of).filter(|&o| o != rank).collect();
                let ownership = ownership(rank, &owners);
                let found = ownership.neighbours();
                prop_assert_eq!(found.len(), others.len());
                prop_assert_eq!(found.iter().map(|n| n.0).collect::<BTreeSet<_>>(), others);
                let octants = ownership.octants();
                for (neighbour, start) in found {
                    let place = octants.iter().find(|&&(l, code)| start57(l, code) == start);
                    let &(l, code) = place.expect("an octant of the rank");
                    let fine = |o: &u64| (start57(l, code)..start57(l, code + 1)).contains(&start57(FINE, *o));
                    let mut theirs = (0..1u64 << (3 * FINE)).filter(|&o| of(o) == neighbour);
                    prop_assert!(theirs.any(|o| mine.iter().filter(|m| fine(m)).any(|&m| touch(m, o))));
                }
            }
        }
    }
}
