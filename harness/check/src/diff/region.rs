//! The rules about whole components: the side that seeds give to a leaf, and why its component is kept or deleted.

use super::rule::{Dispute, Mesh};
use crate::checks::components;
use contract::manifest::{Enclosed, Keep};
use contract::word::{self, Leaf, Side};

/// Maximum number of leaves of a mesh whose components are sought: they take 20 bytes and a microsecond per leaf.
const LEAVES_GROUPED: usize = 20_000_000;

/// The component of a leaf in one mesh.
struct Component {
    /// Number of its leaves.
    leaves: usize,
    /// The first seed in it.
    seed: Option<usize>,
    /// Whether it has a face on the root's boundary.
    at_boundary: bool,
}

impl Dispute<'_> {
    /// The side that seeds give to a leaf of a mesh, with the rule; `None` if there are no seeds, or if the mesh is
    /// too large.
    pub(super) fn side_by_seeds(&self, mesh: Mesh, leaf: &Leaf) -> Option<(Side, String)> {
        if self.terms.seeds.is_empty() {
            return None;
        }
        let flow = self.terms.side_of_flow();
        let other = if flow == Side::Inside { Side::Outside } else { Side::Inside };
        let Component { leaves, seed, .. } = self.component(mesh, leaf)?;
        Some(match seed {
            Some(i) => {
                (flow, format!("section 4: seed {i} lies in its component of {leaves} leaves"))
            }
            None => (other, format!("section 4: no seed lies in its component of {leaves} leaves")),
        })
    }

    /// The rule by which the component of a leaf, which only one mesh has, is kept or deleted; `None` if the side of
    /// the leaf decides alone, or if the mesh is too large.
    pub(super) fn kept_or_deleted(&self, mesh: Mesh, leaf: &Leaf) -> Option<String> {
        let (has, lacks) = (mesh.name(), mesh.other().name());
        let keep = format!("{:?}", self.terms.keep).to_lowercase();
        if self.terms.keep != Keep::All
            && let Some((side, why)) = self.side_by_seeds(mesh, leaf)
        {
            return Some(match side == self.terms.side_of_flow() {
                true => format!("{why}, which is flow and kept (section 5): {has} is right"),
                false => format!(
                    "{why}, which is not flow, and keep is {keep} (section 5): {lacks} is right"
                ),
            });
        }
        if leaf.side != Side::Outside || self.terms.keep != Keep::Outside {
            return None;
        }
        if self.terms.enclosed == Enclosed::Keep {
            let kept =
                "section 5: enclosed is keep, so every outside component is kept, enclosed or not";
            return Some(format!("{kept}: {has} is right, if the leaf is outside"));
        }
        let Component { leaves, at_boundary, .. } = self.component(mesh, leaf)?;
        let its = format!("its component of {leaves} outside leaves");
        Some(match (at_boundary, self.far_field()) {
            (true, _) => format!(
                "section 5: {its} has a face on the root's boundary and is kept: {has} is right, if it is outside"
            ),
            (false, true) => format!(
                "section 5: {its} has no face on the root's boundary, so it is enclosed and deleted (enclosed is \
                 delete): {lacks} is right"
            ),
            (false, false) => format!(
                "section 5: {its} is enclosed, but it is kept, because no outside component has a face on the root's \
                 boundary: {has} is right, if it is outside"
            ),
        })
    }

    /// Whether an outside leaf of either mesh has a face on the root's boundary.
    fn far_field(&self) -> bool {
        [self.a, self.b].into_iter().any(|words| {
            let at_boundary = |i: usize| components::touches_boundary(words, &[i as u32]);
            let outside = |w: u64| word::fault(w).is_none() && w & 3 == Side::Outside as u64;
            (0..words.len()).any(|i| outside(words[i]) && at_boundary(i))
        })
    }

    /// The component of a leaf in the mesh that has it.
    fn component(&self, mesh: Mesh, leaf: &Leaf) -> Option<Component> {
        let words = if mesh == Mesh::A { self.a } else { self.b };
        if words.len() > LEAVES_GROUPED {
            return None;
        }
        let index = words.binary_search(&word::encode(leaf)).ok()? as u32;
        let groups = components::groups(words);
        let group = groups.into_iter().find(|group| group.contains(&index))?;
        let holds = |seed: &[i64; 3]| {
            components::leaf_at(words, *seed).is_some_and(|i| group.contains(&(i as u32)))
        };
        Some(Component {
            seed: self.terms.seeds.iter().position(holds),
            at_boundary: components::touches_boundary(words, &group),
            leaves: group.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::Terms;
    use contract::lattice::UNITS_PER_EDGE;
    use contract::manifest::Manifest;
    use contract::testing::{leaf_set, words_with_sides};

    /// 8^3 cells: a cavity of 2^3 outside leaves in the middle, within a wall of crossing leaves.
    fn cavity() -> Vec<u64> {
        words_with_sides(
            |o| o.level < 3,
            |o| {
                let cells = o.corner.map(|c| c >> 16);
                let within = |low, high| cells.iter().all(|c| (low..high).contains(c));
                Some(if within(2, 6) && !within(3, 5) { Side::Crossing } else { Side::Outside })
            },
        )
    }

    fn in_cavity(word: u64) -> bool {
        word::octant(word).corner.iter().all(|&c| (3..5).contains(&(c >> 16)))
    }

    fn rule(a: &[u64], b: &[u64], change: impl Fn(&mut Manifest)) -> String {
        let mut manifest = leaf_set(vec![]).manifest;
        manifest.keep = Keep::Outside;
        change(&mut manifest);
        let terms = Terms::of_manifest(&manifest);
        let first = a.iter().zip(b).take_while(|(x, y)| x == y).count();
        let dispute = Dispute { a, b, terms: &terms, case: None };
        dispute.rule(a.get(first).copied(), b.get(first).copied()).join("\n")
    }

    #[test]
    fn the_component_of_a_missing_leaf_is_kept_or_deleted_by_its_rule() {
        let all = cavity();
        let open: Vec<u64> = all.iter().copied().filter(|&w| !in_cavity(w)).collect();
        let text = rule(&all, &open, |_| ());
        assert!(
            text.contains("component of 8 outside leaves") && text.ends_with("B is right"),
            "{text}"
        );
        let text = rule(&all, &open, |m| m.enclosed = Enclosed::Keep);
        assert!(text.contains("enclosed is keep") && text.contains("A is right"), "{text}");
        let text = rule(&open, &[], |_| ());
        assert!(text.contains("has a face on the root's boundary and is kept: A"), "{text}");
        let closed: Vec<u64> =
            all.iter().copied().filter(|&w| in_cavity(w) || w & 3 == 2).collect();
        let crossing: Vec<u64> = closed.iter().copied().filter(|w| w & 3 == 2).collect();
        let text = rule(&crossing, &closed, |_| ());
        assert!(
            text.contains("no outside component has a face") && text.contains("B is right"),
            "{text}"
        );
    }

    #[test]
    fn seeds_decide_which_component_is_kept_and_which_side_is_right() {
        let (all, centre) = (cavity(), [UNITS_PER_EDGE / 2; 3]);
        let open: Vec<u64> = all.iter().copied().filter(|&w| !in_cavity(w)).collect();
        let closed: Vec<u64> =
            all.iter().copied().filter(|&w| in_cavity(w) || w & 3 == 2).collect();
        let seeded = |m: &mut Manifest| m.seeds = vec![[0; 3], centre];
        let text = rule(&all, &open, seeded);
        assert!(
            text.contains("seed 1 lies in its component of 8 leaves")
                && text.ends_with("A is right")
        );
        let text = rule(&closed, &all, |m| m.seeds = vec![centre]);
        assert!(text.contains("no seed lies") && text.ends_with("A is right"), "{text}");
        let flipped: Vec<u64> = all.iter().map(|&w| if in_cavity(w) { w | 1 } else { w }).collect();
        let text = rule(&flipped, &all, |m| (m.seeds, m.keep) = (vec![[0; 3]], Keep::All));
        assert!(text.contains("no seed lies") && text.ends_with("A is right"), "{text}");
    }
}
