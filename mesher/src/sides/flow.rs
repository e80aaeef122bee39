//! The flow: components with a seed, whatever rays would say, so that a hole in the geometry joins to the flow what lies beyond it;
//! and the far field, every outside component with a face on the root's boundary.
//!
//! The paper floods from one cell that rays find outside, and deletes what the flood does not reach. Here outside components that the
//! far field does not reach are *enclosed*, such as sealed cavities and the overlap of two solids, which is outside by the parity of
//! rays.

use super::global::Label;
use super::nodes::open_bricks;
use super::vote::{Candidate, FirstLeaf};
use super::{Base, Components, EnclosedComponents, Verdict};
use crate::error::Error;
use crate::input::lattice::{Enclosed, Keep};
use bricks::brickset::ones;
use bricks::octant::{LEVEL_MAX, Level, ROOT_BITS, ROOT_EDGE, morton};
use bricks::tree::LEVELS;
use ranks::{all_gather_reduced, gather};
use std::collections::{HashMap, HashSet};

/// The seeds that lie in leaves that do not cross, by number, each with the component that it lies in. Collective; the same on all ranks.
pub(super) fn find(base: &Base, components: &Components) -> HashMap<u64, Label> {
    let mut mine = Vec::new();
    for (number, seed) in (0..).zip(&base.rules.seeds).filter(|(_, seed)| seed.is_in_root()) {
        let code = morton(seed.lattice.map(|c| (c >> (ROOT_BITS - LEVEL_MAX)) as u32));
        // The owner of a part of a leaf holds the leaf's brick.
        if base.ownership.owner_at(code) == base.comm.rank() {
            let found = |c| mine.push([number, components.label(c)]);
            components.nodes.find(LEVEL_MAX, code >> 6, 1 << (code & 63), found);
        }
    }
    gather(base.comm, &mine).into_iter().map(|[number, label]| (number, label)).collect()
}

/// The components that have a seed, of seeds that were [found](find). Collective; the same on all ranks.
///
/// # Errors
/// If a seed is outside the root or in a crossing leaf.
pub fn of_seeds(found: &HashMap<u64, Label>, base: &Base) -> Result<HashSet<Label>, Error> {
    let mut seeds = (0..).zip(&base.rules.seeds);
    if let Some((number, seed)) = seeds.find(|(number, _)| !found.contains_key(number)) {
        let problem = match seed.is_in_root() {
            true => "lies in a leaf that the geometry crosses",
            false => "lies outside the root",
        };
        let near = seed.lattice.map(|c| c.clamp(0, ROOT_EDGE));
        let nearest = gather(base.comm, nearest(base, near).as_slice()).into_iter().min();
        let advice = match nearest {
            Some([_, leaf]) => {
                let [x, y, z] = base.rules.root.locate(Candidate(leaf).centroid());
                format!("the nearest centroid of a leaf that it does not cross is ({x}, {y}, {z})")
            }
            None => "the geometry crosses all leaves: decrease spacing_min".to_owned(),
        };
        let [x, y, z] = seed.given;
        return Err(Error::input(format!("seed {number} at ({x}, {y}, {z}) {problem}; {advice}")));
    }
    Ok(found.values().copied().collect())
}

/// The non-crossing leaf, in bricks that this rank holds, whose centroid is nearest to a lattice point: its squared distance
/// and its [`Candidate`]. Of leaves at the same distance the first, by level and Morton code.
fn nearest(base: &Base, point: [i64; 3]) -> Option<[u64; 2]> {
    let mut best = None;
    for l in 0..LEVELS as Level {
        for b in open_bricks(base.tree, base.ownership, l) {
            for bit in ones(b.open) {
                let leaf = Candidate::new(l, b.key << 6 | u64::from(bit));
                let centroid = leaf.centroid();
                let squared = |a: usize| (centroid[a] - point[a]).pow(2) as u64;
                let found = [(0..3).map(squared).sum(), leaf.0];
                best = Some(best.map_or(found, |best: [u64; 2]| best.min(found)));
            }
        }
    }
    best
}

/// The sides of all components: the flow is on the side that is kept, outside if everything is.
pub fn decide(components: &[FirstLeaf], flow: HashSet<Label>, keep: Keep) -> Verdict {
    let inside = match keep {
        Keep::Inside => flow,
        Keep::Outside | Keep::All => {
            components.iter().map(|c| c.0).filter(|label| !flow.contains(label)).collect()
        }
    };
    Verdict { inside, ..Verdict::default() }
}

impl Verdict {
    /// Compares the components with those at the root's boundary. Collective.
    pub(super) fn compare_with_boundary(&mut self, base: &Base, components: &Components) {
        let (rules, all) = (base.rules, &components.all);
        let outside = all.iter().map(|c| c.0).filter(|label| !self.inside.contains(label));
        let outside: HashSet<Label> = outside.collect();
        let by_rays = rules.seeds.is_empty();
        let matters = match rules.keep {
            // A single outside component either reaches the boundary or is the only one and kept.
            Keep::Outside if by_rays => rules.enclosed == Enclosed::Delete && outside.len() > 1,
            Keep::Outside => true,
            Keep::Inside => !self.inside.is_empty(),
            Keep::All => false,
        };
        if !matters {
            return;
        }
        let mine = components.at_boundary.iter().map(|&c| [components.label(c), 0]).collect();
        let far_field = all_gather_reduced(mine, u64::min, base.comm);
        let far_field: HashSet<Label> = far_field.into_iter().map(|[label, _]| label).collect();
        match rules.keep {
            Keep::Inside => {
                self.summary.inside_reaches_boundary = !self.inside.is_disjoint(&far_field);
            }
            _ if !by_rays => self.summary.flow_misses_boundary = outside.is_disjoint(&far_field),
            _ if outside.is_disjoint(&far_field) => {}
            _ => self.enclosed = outside.difference(&far_field).copied().collect(),
        }
    }

    /// The enclosed components in numbers, of whose leaves this rank owns `leaves`. Collective.
    pub fn enclosed_components(
        &self,
        components: &[FirstLeaf],
        leaves: u64,
        base: &Base,
    ) -> EnclosedComponents {
        let enclosed = components.iter().filter(|(label, _)| self.enclosed.contains(label));
        let first = enclosed.map(|&(_, first)| first).min();
        EnclosedComponents {
            count: self.enclosed.len() as u64,
            leaves: first.map_or(0, |_| base.comm.sum(leaves)),
            example: first.map(|leaf| base.rules.root.locate(leaf.centroid())),
        }
    }
}
