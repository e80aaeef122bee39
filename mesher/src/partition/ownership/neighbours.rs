//! Who owns what touches what a rank owns.

use super::Ownership;
use crate::octant::{Level, morton, position, start57};

/// A step to an octant beside: down, none, or up along each axis.
type Step = [i8; 3];

impl Ownership {
    /// The other ranks that own something that touches what this rank owns, over a face, an edge or a corner; each with the
    /// level-19 code of an octant of this rank that it touches.
    pub fn neighbours(&self) -> Vec<(usize, u64)> {
        let mut found = vec![false; self.ranks];
        found[self.rank] = true;
        let mut neighbours = Vec::new();
        for (l, code) in self.octants() {
            let p = position(code).map(i64::from);
            let mut tell = |owner: usize| {
                if !std::mem::replace(&mut found[owner], true) {
                    neighbours.push((owner, start57(l, code)));
                }
            };
            for step in (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]) {
                let beside: [i64; 3] = std::array::from_fn(|a| p[a] + i64::from(step[a]));
                if beside.iter().all(|c| (0..1 << l).contains(c)) {
                    self.tell_owners(l, morton(beside.map(|c| c as u32)), step, &mut tell);
                }
            }
        }
        neighbours
    }

    /// Tells who owns what of an octant touches the octant from which the step leads to it, other than this rank.
    fn tell_owners(&self, l: Level, code: u64, step: Step, tell: &mut impl FnMut(usize)) {
        if self.own.start <= start57(l, code) && start57(l, code + 1) <= self.own.end {
            return;
        }
        if let Some(owner) = self.sole_owner(l, code) {
            return tell(owner);
        }
        // After a step up the lower children touch, after one down the upper ones, and after none both.
        let touches =
            |child: u64| (0..3).all(|a| step[a] != if child >> a & 1 == 1 { 1 } else { -1 });
        for child in (0..8).filter(|&child| touches(child)) {
            self.tell_owners(l + 1, code << 3 | child, step, tell);
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
        fn neighbours_own_octants_beside_each_other(owners in owners()) {
            let beside = |a: u64, b: u64| {
                let (p, q) = (position(a), position(b));
                (0..3).all(|axis| p[axis].abs_diff(q[axis]) <= 1)
            };
            let octants = 0..1u64 << (3 * FINE);
            let of = |octant: u64| owners[octant as usize];
            for rank in 0..RANKS {
                let mine: Vec<u64> = octants.clone().filter(|&o| of(o) == rank).collect();
                let touched = octants.clone().filter(|&o| mine.iter().any(|&m| beside(m, o)));
                let others: BTreeSet<usize> = touched.map(of).filter(|&o| o != rank).collect();
                let ownership = ownership(rank, &owners);
                let told = ownership.neighbours();
                prop_assert_eq!(told.len(), others.len());
                prop_assert_eq!(told.iter().map(|t| t.0).collect::<BTreeSet<_>>(), others);
                let octants = ownership.octants();
                for (neighbour, at) in told {
                    let place = octants.iter().find(|&&(l, code)| start57(l, code) == at);
                    let &(l, code) = place.expect("an octant of the rank");
                    let fine = |o: &u64| (start57(l, code)..start57(l, code + 1)).contains(&start57(FINE, *o));
                    let mut theirs = (0..1u64 << (3 * FINE)).filter(|&o| of(o) == neighbour);
                    prop_assert!(theirs.any(|o| mine.iter().filter(|m| fine(m)).any(|&m| beside(m, o))));
                }
            }
        }
    }
}
