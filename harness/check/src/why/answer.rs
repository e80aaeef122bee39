//! The answer to a question about a point.
//!
//! The size of a leaf is explained by the split of its parent: whatever requires that split requires those of all coarser octants,
//! too. A chain goes from the parent to the parent of a leaf that forces it to split, until T0 or the extra layer splits one. Of the
//! leaves that do, the first one of the finest level is taken, so that chains are short. Levels rise from link to link, so a chain ends.
//!
//! Invariants: the leaf and the leaf of T0 contain the point; the octant that is split is the parent of the leaf. In a chain each leaf is
//! finer than the octant that it forces to split, which is the parent of the leaf before it, and near enough for its rule; the cause is one
//! of the last octant, and has a facet or a box. Only a point without a leaf is in a deleted part.

use super::Mesh;
pub use super::gradation::Rule;
use crate::checks::components::{Component, Decision};
use contract::lattice::{Root, UNITS_PER_EDGE, cell_at};
use contract::octant::{LEVEL_MAX, Octant};
use contract::word::Side;
use std::fmt;

/// Facets that are listed; further ones are counted only.
const FACETS_LISTED: usize = 8;

/// The answer.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The point, in the user's units.
    pub point: [f64; 3],
    /// The leaf at the point, and its side; none if the point lies in a deleted part.
    pub leaf: Option<(Octant, Side)>,
    /// The leaf of T0 at the point; none if the surface is not known.
    pub base_leaf: Option<Octant>,
    /// The side, and what decides it (section 4), in words; none if the facets are not known.
    pub side_decided_by: Option<(Side, String)>,
    /// Deleted parts: the rule that deletes the leaf of T0.
    pub deleted_by: Option<String>,
    /// The split of the leaf's parent; none for the root.
    pub split: Option<Split>,
    root: Root,
    layer_cells_min: u32,
}

/// An octant that is split, and why.
#[derive(Clone, Debug)]
pub struct Split {
    /// The octant.
    pub octant: Octant,
    /// The leaves from the octant to the cause, each with the rule by which it forces the octant before it to split: the one that is
    /// asked about, then the parent of the leaf before. None if T0 splits the octant.
    pub links: Vec<(Rule, Octant)>,
    /// The cause in the inputs; none if no rule requires the split.
    pub cause: Option<Cause>,
}

/// A cause in the inputs (section 3). Each facet and each box alone is sufficient.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// The octant that facets cross and boxes meet: the split octant, the parent of the last leaf, or the last leaf itself after
    /// the extra layer.
    pub octant: Octant,
    /// The facets, counted from 0; none if no facet crosses the octant or facets are not known.
    pub facets: Vec<u32>,
    /// Whether the surface is a cause, which is known without facets if crossing leaves are kept.
    pub is_crossed: bool,
    /// Boxes, counted from 0.
    pub boxes: Vec<usize>,
}

/// The rule in place of one that deletes a leaf.
pub(crate) const LOST: &str = "no rule deletes it: the mesh has lost a leaf";

impl Answer {
    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        let Self { point, leaf, base_leaf, deleted_by, split, root, .. } = self;
        let leaf = leaf.map(|(octant, _)| octant);
        for octant in leaf.iter().chain(base_leaf) {
            let cell = root.quantise(*point).and_then(cell_at);
            let holds = |corner| octant.contains(&Octant { corner, level: LEVEL_MAX });
            assert!(cell.is_some_and(holds), "{point:?} is not in the {octant}");
        }
        let is_apart = deleted_by.is_none() || leaf.is_none();
        assert!(is_apart, "the leaf {leaf:?} was deleted: {deleted_by:?}");
        let end = leaf.or(*base_leaf);
        let above = end.filter(|end| end.level > 0).map(|end| end.parent());
        assert_eq!(split.as_ref().map(|split| split.octant), above, "the split above {end:?}");
        split.iter().for_each(|split| split.check_invariants(self.layer_cells_min));
    }
}

impl Split {
    fn check_invariants(&self, layer_cells_min: u32) {
        let Some(Cause { octant: at, facets, is_crossed, boxes }) = &self.cause else {
            return assert!(self.links.is_empty(), "a chain of {:?} leads to no cause", self.links);
        };
        let (mut octant, mut is_source, mut ends) = (self.octant, false, false);
        for &(rule, leaf) in &self.links {
            let distance = octant.distance(&leaf);
            let reach = i64::from(layer_cells_min - 1) * i64::from(leaf.edge());
            let is_right = match rule {
                Rule::Layer => leaf.level > octant.level && distance < reach,
                Rule::Balance => leaf.level > octant.level + 1 && distance == 0,
                Rule::ExtraLayer => distance == 0,
            };
            assert!(is_right && !ends, "{rule:?} of {leaf} does not force the split of {octant}");
            ends = rule == Rule::ExtraLayer;
            // The parent of a source is split before the layer of the source's level is made.
            let is_early = !is_source || leaf.level > octant.level + 1 || ends;
            assert!(is_early, "{leaf} is too coarse for {octant}");
            is_source = rule == Rule::Layer;
            octant = if ends { leaf } else { leaf.parent() };
        }
        assert_eq!(octant, *at, "the cause of {octant} is one of {at}");
        assert!(*is_crossed || !boxes.is_empty(), "{octant} is split without a facet or a box");
        assert!(*is_crossed || facets.is_empty(), "{facets:?} do not cross {octant}");
    }

    /// The clauses of the chain, from what forces the split to the cause; empty if no rule requires the split.
    pub(crate) fn clauses(&self, root: &Root) -> Vec<String> {
        let Some(cause) = &self.cause else { return Vec::new() };
        let (mut octant, mut subject, mut clauses) = (self.octant, "", Vec::new());
        for (rule, leaf) in &self.links {
            let edges = octant.distance(leaf) / i64::from(leaf.edge());
            let near = match rule {
                Rule::Layer if edges == 0 => ", step 2 (layer): it touches the leaf".to_owned(),
                Rule::Layer => format!(", step 2 (layer): {edges} of its edges away is the leaf"),
                Rule::Balance => {
                    let levels = leaf.level - octant.level;
                    format!(", step 3 (balance): it touches, {levels} levels finer, the leaf")
                }
                Rule::ExtraLayer => " (extra layer): it touches the deleted crossing leaf".into(),
            };
            clauses.push(format!("{subject}by section 6{near} {}", root.place(*leaf)));
            (octant, subject) = (leaf.parent(), "its parent is split ");
        }
        let end = match self.links.last() {
            Some((Rule::ExtraLayer, _)) => "it is crossing by section 4".to_owned(),
            _ => format!("{subject}by section 3"),
        };
        let surface = cause.is_crossed.then(|| that_cross(&cause.facets)).into_iter();
        let boxes = cause.boxes.iter().map(|index| format!("box {index} meets it"));
        let causes: Vec<String> = surface.chain(boxes).collect();
        clauses.push(format!("{end}: {}", causes.join("; ")));
        clauses
    }
}

/// Facets that cross an octant, as a clause; none if they are not known.
fn that_cross(facets: &[u32]) -> String {
    if facets.is_empty() {
        return "the surface crosses it".to_owned();
    }
    let numbers: Vec<String> = facets.iter().take(FACETS_LISTED).map(u32::to_string).collect();
    let more = facets.len() - numbers.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("facets that cross it: {}{more}", numbers.join(", "))
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = |octant: &Octant| self.root.place(*octant);
        let Self { point, leaf, base_leaf, side_decided_by, deleted_by, split, .. } = self;
        let lies_in = match leaf {
            Some((leaf, side)) => format!("the {side} leaf {}", place(leaf)),
            None => "a part of the root that was deleted".to_owned(),
        };
        writeln!(f, "{point:?} lies in {lies_in}")?;
        if let Some(base) = base_leaf.filter(|base| leaf.is_none_or(|(leaf, _)| leaf != *base)) {
            writeln!(f, "  leaf of T0: {}", place(&base))?;
        }
        deleted_by.iter().try_for_each(|rule| writeln!(f, "  deleted by {rule}"))?;
        if let Some(split) = split {
            writeln!(f, "size\n  its parent, {}, is split", place(&split.octant))?;
            let clauses = split.clauses(&self.root);
            clauses.iter().try_for_each(|clause| writeln!(f, "    {clause}"))?;
            if clauses.is_empty() {
                let why = "harness audit --case finds all such splits";
                writeln!(f, "    by no rule that is known ({why})")?;
            }
        }
        match side_decided_by {
            Some((side, decision)) => {
                writeln!(f, "side\n  {side} by section 4: {decision}")?;
                let wrong = leaf.map(|(_, has)| has).filter(|has| has != side);
                wrong
                    .iter()
                    .try_for_each(|has| writeln!(f, "  the mesh is wrong: its leaf is {has}"))
            }
            None => {
                let why = "which the mesh does not contain: give the case with --case";
                writeln!(f, "left out: what depends on facets, {why}")
            }
        }
    }
}

impl Mesh<'_> {
    /// Explains the leaf at a point, in the user's units.
    ///
    /// # Errors
    /// One sentence, if the point lies outside the root.
    pub fn at(&self, point: [f64; 3]) -> Result<Answer, String> {
        let root = self.inputs.root;
        let corner = root.quantise(point).and_then(cell_at).ok_or_else(|| {
            let (from, to) = (root.origin, root.to_user([UNITS_PER_EDGE; 3]));
            format!("the point {point:?} lies outside the root, which is from {from:?} up to, and without, {to:?}; give a point inside")
        })?;
        let leaf = self.tree.locate(corner);
        let leaf = leaf.map(|(octant, kind)| (octant, Side::ALL[usize::from(kind)]));
        let cell = Octant { corner, level: LEVEL_MAX };
        let base_leaf = self.knows_surface().then(|| self.base_leaf(&cell).expect("never split"));
        let octant = leaf.map(|(octant, _)| octant).or(base_leaf).filter(|octant| octant.level > 0);
        let (side_decided_by, deletion) = base_leaf.and_then(|base| self.side_of(&base)).unzip();
        let answer = Answer {
            point,
            leaf,
            base_leaf,
            side_decided_by,
            deleted_by: deletion.filter(|_| leaf.is_none()),
            split: octant.map(|octant| self.split(&octant.parent())),
            root,
            layer_cells_min: self.inputs.layer_cells_min,
        };
        answer.check_invariants();
        Ok(answer)
    }

    /// An octant that is split, with a chain to a cause.
    pub(crate) fn split(&self, octant: &Octant) -> Split {
        let (mut at, mut is_deep, mut links) = (*octant, false, Vec::new());
        let cause = loop {
            if self.base_splits(&at) {
                break Some(self.cause(&at));
            }
            if let Some(leaf) = self.extra_layer(&at) {
                links.push((Rule::ExtraLayer, leaf));
                break Some(self.cause(&leaf));
            }
            // A leaf of the finest possible level.
            let coarsest = at.level + if is_deep { 2 } else { 1 };
            let mut levels = (coarsest..=self.level_deepest).rev();
            let finest = levels.find_map(|level| self.leaf_that_forces(&at, level..=level));
            let Some((rule, leaf)) = finest else { break None };
            links.push((rule, leaf));
            // After balance, any leaf may follow that may follow after a layer.
            (at, is_deep) = (leaf.parent(), rule == Rule::Layer);
        };
        Split { octant: *octant, links, cause }
    }

    /// What splits an octant of T0, or makes a leaf of it a crossing one.
    fn cause(&self, octant: &Octant) -> Cause {
        let may_cross = octant.level < self.inputs.level_surface || !self.base_splits(octant);
        let is_crossed = may_cross && self.is_crossed(octant);
        let boxes = (0..).zip(&self.inputs.boxes);
        let splits = boxes.filter(|(_, b)| b.level > octant.level && b.meets(octant));
        Cause {
            octant: *octant,
            facets: if is_crossed { self.facets_of(octant) } else { Vec::new() },
            is_crossed,
            boxes: splits.map(|(index, _)| index).collect(),
        }
    }

    /// What decides the side of a leaf of T0, and the rule that deletes it if it was deleted.
    fn side_of(&self, base: &Octant) -> Option<((Side, String), String)> {
        let (side, decision, rule) = match self.body?.component_at(base) {
            Some(component) => (component.side, self.decision(component), self.deletion(component)),
            None => {
                let deletes = "keep_crossing is false: crossing leaves are deleted after gradation";
                let rule = if self.inputs.keep_crossing { LOST } else { deletes };
                (Side::Crossing, that_cross(&self.facets_of(base)), format!("section 7: {rule}"))
            }
        };
        Some(((side, decision), rule))
    }

    /// What decides the side of a component, as a sentence.
    fn decision(&self, component: &Component) -> String {
        match component.decision {
            Decision::Stated => "the words of its leaves state it".to_owned(),
            Decision::Seed(index) => format!("seed {index} lies in its component"),
            Decision::NoSeed => "no seed lies in its component".to_owned(),
            Decision::Rays(candidate) => {
                let parity = if component.side == Side::Inside { "an odd" } else { "an even" };
                let candidate = self.inputs.root.place(candidate);
                format!(
                    "each of the six rays of the candidate {candidate} intersects {parity} number of facets"
                )
            }
            Decision::Majority(candidates, odd) => format!(
                "the component is ambiguous: the rays of no candidate agree, and {odd} of the {} rays of {candidates} \
                 candidates are odd",
                6 * candidates
            ),
        }
    }

    /// The rule that deletes the leaves of a component.
    fn deletion(&self, &Component { side, enclosed, .. }: &Component) -> String {
        let keep = format!("{:?}", self.inputs.keep).to_lowercase();
        let why = match (self.inputs.keeps(side as u8), enclosed) {
            (false, _) => format!("keep is {keep}, so leaves that are {side} are deleted"),
            (true, true) => {
                "enclosed is delete, and no leaf of its component has a face on the root's boundary"
                    .to_owned()
            }
            (true, false) => LOST.to_owned(),
        };
        format!("section 5: {why}")
    }
}
