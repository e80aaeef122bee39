//! The answer to a question about a point; JSON of the schema `octree-why/4` when serialised.
//!
//! The size of a leaf is explained by the split of its parent: whatever requires that split requires those of all coarser octants,
//! too. A chain goes from the parent to the parent of a leaf that forces it to split, until T0 or the extra layer splits one. Of the
//! leaves that do, the first one of the finest level is taken, so that chains are short. Levels rise from link to link, so a chain ends.
//!
//! Invariants: the leaf and the leaf of T0 contain the point; the octant that is split is the parent of the leaf. A chain begins
//! with this octant; each leaf is finer and near enough for its rule; each further octant is the parent of
//! the leaf before it, and the cause is one of the last octant. A cause has a facet or a box. Only a point without a leaf is
//! in a deleted part.

use super::Mesh;
pub use super::gradation::Rule;
use super::gradation::parent;
use crate::checks::components::{Component, Decision};
use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::octant::{LEVEL_MAX, Octant, UNITS_PER_CELL};
use contract::word::Side;
use serde::Serialize;

/// Name and version of the JSON form.
const SCHEMA: &str = "octree-why/4";

/// Facets that are listed for a cause; further ones are counted only.
const FACETS_LISTED: usize = 8;

/// An octant with its bounds in the user's units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Place {
    /// The octant.
    #[serde(skip)]
    pub octant: Octant,
    /// The digits from the root to the octant, such as `3.1.4`; `root` for the root.
    pub path: String,
    /// Its level.
    pub level: u8,
    /// Minimum corner, with the decimals that the lattice needs.
    pub min: [f64; 3],
    /// Maximum corner.
    pub max: [f64; 3],
}

impl Place {
    pub(super) fn new(octant: &Octant, root: &Root) -> Self {
        let (low, high) = octant.bounds();
        let [min, max] = [low, high].map(|corner| root.rounded(root.to_user(corner)));
        Self { octant: *octant, path: octant.path(), level: octant.level, min, max }
    }
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// Name and version of the JSON form.
    pub schema: &'static str,
    /// The point, in the user's units.
    pub point: [f64; 3],
    /// The leaf at the point; none if the point lies in a deleted part.
    pub leaf: Option<Place>,
    /// The leaf of T0 at the point; none if the surface is not known.
    pub base_leaf: Option<Place>,
    /// The side of the leaf in the mesh.
    pub side: Option<Side>,
    /// What decides the side; none if the facets are not known.
    pub side_decided_by: Option<SideReason>,
    /// Deleted parts: the rule that deletes the leaf of T0.
    pub deleted_by: Option<String>,
    /// The split of the leaf's parent; none for the root.
    pub split: Option<Split>,
    /// What could not be explained, and why.
    pub left_out: Vec<String>,
    #[serde(skip)]
    layer_cells_min: u32,
}

/// An octant that is split, and why.
#[derive(Clone, Debug, Serialize)]
pub struct Split {
    /// The octant.
    pub octant: Place,
    /// The leaves from the octant to the cause; none if T0 splits the octant.
    pub links: Vec<Link>,
    /// The cause in the inputs; none if no rule requires the split.
    pub cause: Option<Cause>,
}

/// A leaf that forces the previous octant of a chain to split.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Link {
    /// The rule.
    pub rule: Rule,
    /// The octant that is forced to split: that of the chain, or the parent of the previous leaf.
    pub octant: Place,
    /// The leaf that forces it.
    pub leaf: Place,
    /// Distance of leaf and octant in cells of the leaf's level.
    pub distance_cells: i64,
}

/// A cause in the inputs (section 3). Each facet and each box alone is sufficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// The octant that facets cross and boxes meet: the split octant, the parent of the last leaf, or the last leaf itself after
    /// the extra layer.
    pub octant: Place,
    /// The first facets, counted from 0.
    pub facets: Vec<u32>,
    /// Number of facets; 0 if no facet crosses the octant or facets are not known.
    pub facets_count: u64,
    /// Whether the surface is a cause, which is known without facets if crossing leaves are kept.
    pub is_crossed: bool,
    /// Boxes, counted from 0.
    pub boxes: Vec<usize>,
}

/// What decides the side of a leaf (section 4).
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SideReason {
    /// The side.
    pub side: Side,
    /// What decides it, in words.
    pub decision: String,
    /// Number of leaves of the component; none for a crossing leaf.
    pub leaves: Option<u64>,
}

/// The rule in place of one that deletes a leaf.
pub(crate) const LOST: &str = "no rule deletes it: the mesh has lost a leaf";

impl Answer {
    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        let Self { point, leaf, base_leaf, side, deleted_by, split, .. } = self;
        for place in leaf.iter().chain(base_leaf) {
            // The point is rounded to the lattice, and printed coordinates to some decimals.
            let near = |a: usize| {
                let slack = (place.max[a] - place.min[a]) / 128.0;
                (place.min[a] - slack..=place.max[a] + slack).contains(&point[a])
            };
            assert!((0..3).all(near), "{point:?} is not in the {place}");
        }
        if let (Some(leaf), Some(base)) = (leaf, base_leaf) {
            let (leaf, base) = (&leaf.octant, &base.octant);
            let is_nested = leaf.contains(base) || base.contains(leaf);
            assert!(is_nested, "{leaf} is apart from {base} of T0");
        }
        assert_eq!(leaf.is_some(), side.is_some(), "a leaf has a side, and only a leaf");
        let is_apart = deleted_by.is_none() || leaf.is_none();
        assert!(is_apart, "the leaf {leaf:?} was deleted: {deleted_by:?}");
        let end = leaf.as_ref().or(base_leaf.as_ref()).map(|place| place.octant);
        let above = end.filter(|end| end.level > 0).map(|end| parent(&end));
        let octant = split.as_ref().map(|split| split.octant.octant);
        assert_eq!(octant, above, "the split above {end:?}");
        split.iter().for_each(|split| split.check_invariants(self.layer_cells_min));
    }
}

impl Split {
    fn check_invariants(&self, layer_cells_min: u32) {
        let Some(cause) = &self.cause else {
            return assert!(self.links.is_empty(), "a chain of {:?} leads to no cause", self.links);
        };
        let (mut octant, mut is_source, mut ends) = (self.octant.octant, false, false);
        for link in &self.links {
            let leaf = link.leaf.octant;
            assert!(link.octant.octant == octant && !ends, "{link:?} does not follow {octant}");
            let distance = octant.distance(&leaf);
            let reach = i64::from(layer_cells_min - 1) * i64::from(leaf.edge());
            let is_right = match link.rule {
                Rule::Layer => leaf.level > octant.level && distance < reach,
                Rule::Balance => leaf.level > octant.level + 1 && distance == 0,
                Rule::ExtraLayer => distance == 0,
            };
            ends = link.rule == Rule::ExtraLayer;
            // The parent of a source is split before the layer of the source's level is made.
            let is_early = !is_source || leaf.level > octant.level + 1 || ends;
            assert!(is_right && is_early, "{link:?} does not force the split of {octant}");
            assert_eq!(link.distance_cells, distance / i64::from(leaf.edge()), "{link:?}");
            is_source = link.rule == Rule::Layer;
            octant = if ends { leaf } else { parent(&leaf) };
        }
        let Cause { octant: at, facets, facets_count, is_crossed, boxes } = cause;
        assert_eq!(octant, at.octant, "the cause of {octant} is one of {}", at.octant);
        assert!(*is_crossed || !boxes.is_empty(), "{octant} is split without a facet or a box");
        let listed = (*facets_count).min(FACETS_LISTED as u64);
        assert_eq!(facets.len() as u64, listed, "facets of {octant}");
        assert!(*is_crossed || *facets_count == 0, "{facets_count} facets do not cross {octant}");
    }
}

impl Mesh<'_> {
    /// Explains the leaf at a point, in the user's units.
    ///
    /// # Errors
    /// One sentence, if the point lies outside the root or the mesh is invalid.
    pub fn at(&self, point: [f64; 3]) -> Result<Answer, String> {
        let root = &self.terms.root;
        let lattice = root.quantise_seed(point).ok_or_else(|| {
            let (from, to) = (root.origin, root.to_user([UNITS_PER_EDGE; 3]));
            format!("the point {point:?} lies outside the root, which is from {from:?} to {to:?}; give a point inside")
        })?;
        let corner = lattice.map(|q| (q / UNITS_PER_CELL) as u32);
        let leaf = self.tree.locate(corner);
        let cell = Octant { corner, level: LEVEL_MAX };
        let base = self.knows_surface().then(|| self.base_leaf(&cell).expect("never split"));
        let octant = leaf.map(|(octant, _)| octant).or(base).filter(|octant| octant.level > 0);
        let (side_decided_by, deletion) = base.and_then(|base| self.side_of(&base)).unzip();
        let answer = Answer {
            schema: SCHEMA,
            point,
            leaf: leaf.map(|(octant, _)| self.place(&octant)),
            base_leaf: base.map(|base| self.place(&base)),
            side: leaf.map(|(_, kind)| Side::ALL[usize::from(kind)]),
            side_decided_by,
            deleted_by: deletion.filter(|_| leaf.is_none()),
            split: octant.map(|octant| self.split(&parent(&octant))),
            left_out: self.left_out(),
            layer_cells_min: self.terms.layer_cells_min,
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
                links.push(self.link(Rule::ExtraLayer, &at, &leaf));
                break Some(self.cause(&leaf));
            }
            let Some((rule, leaf)) = self.finest_that_forces(&at, is_deep) else { break None };
            links.push(self.link(rule, &at, &leaf));
            // After balance, any leaf may follow that may follow after a layer.
            (at, is_deep) = (parent(&leaf), rule == Rule::Layer);
        };
        Split { octant: self.place(octant), links, cause }
    }

    /// A leaf of the finest possible level that forces the split of an octant, which must be deep or not.
    fn finest_that_forces(&self, octant: &Octant, is_deep: bool) -> Option<(Rule, Octant)> {
        let coarsest = octant.level + if is_deep { 2 } else { 1 };
        let mut found = None;
        (coarsest..=self.level_deepest).rev().find(|&level| {
            self.any_leaf_near(octant, level..=level, &mut |leaf| {
                found = self.rule_of(&leaf, octant).map(|rule| (rule, leaf));
                found.is_some()
            })
        });
        found
    }

    fn link(&self, rule: Rule, octant: &Octant, leaf: &Octant) -> Link {
        let distance_cells = octant.distance(leaf) / i64::from(leaf.edge());
        Link { rule, octant: self.place(octant), leaf: self.place(leaf), distance_cells }
    }

    /// What splits an octant of T0, or makes a leaf of it a crossing one.
    fn cause(&self, octant: &Octant) -> Cause {
        let may_cross = octant.level < self.terms.level_surface || !self.base_splits(octant);
        let is_crossed = may_cross && self.is_crossed(octant);
        let facets = if is_crossed { self.facets_of(octant) } else { Vec::new() };
        let boxes = (0..).zip(&self.terms.boxes);
        let splits = boxes.filter(|(_, b)| b.level > octant.level && b.meets(octant));
        Cause {
            octant: self.place(octant),
            facets_count: facets.len() as u64,
            facets: facets.into_iter().take(FACETS_LISTED).collect(),
            is_crossed,
            boxes: splits.map(|(index, _)| index).collect(),
        }
    }

    /// What decides the side of a leaf of T0, and the rule that deletes it if it was deleted.
    fn side_of(&self, base: &Octant) -> Option<(SideReason, String)> {
        let (_, truth) = self.body?;
        let Some(component) = truth.component_at(base) else {
            let facets = self.facets_of(base);
            let listed = &facets[..facets.len().min(FACETS_LISTED)];
            let decision = format!("{} it", facets_that_cross(listed, facets.len() as u64));
            let rule = match self.terms.keep_crossing {
                false => "keep_crossing is false, so crossing leaves are deleted after gradation",
                true => LOST,
            };
            let reason = SideReason { side: Side::Crossing, decision, leaves: None };
            return Some((reason, format!("section 7: {rule}")));
        };
        let reason = SideReason {
            side: component.side,
            decision: self.decision(component),
            leaves: Some(component.leaves.len() as u64),
        };
        Some((reason, format!("section 5: {}", self.deletion(component))))
    }

    /// What decides the side of a component, as a sentence.
    fn decision(&self, component: &Component) -> String {
        match component.decision {
            Decision::Seed(index) => format!("seed {index} lies in its component"),
            Decision::NoSeed => "no seed lies in its component".to_owned(),
            Decision::Rays(candidate, before) => {
                let parity = if component.side == Side::Inside { "an odd" } else { "an even" };
                let skipped = match before {
                    0 => String::new(),
                    n => format!(", after {n} candidates whose rays disagree"),
                };
                let candidate = self.place(&candidate);
                format!(
                    "each of the six rays of the candidate {candidate} intersects {parity} number of facets{skipped}"
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
        let keep = format!("{:?}", self.terms.keep).to_lowercase();
        if !self.terms.keeps(side as u8) {
            format!("keep is {keep}, so leaves that are {side} are deleted")
        } else if enclosed {
            "enclosed is delete, and no leaf of its component has a face on the root's boundary"
                .to_owned()
        } else {
            LOST.to_owned()
        }
    }

    /// What an answer lacks, and why.
    fn left_out(&self) -> Vec<String> {
        let of_case = match (self.body, self.knows_surface()) {
            (Some(_), _) => None,
            (None, true) => {
                Some("facet numbers and the decision on the side: give the case with --case")
            }
            (None, false) => Some(
                "everything that depends on facets or on crossing leaves, which the mesh does not contain: give the case with --case",
            ),
        };
        let of_base = self.is_base.then_some("gradation: the mesh is a base tree");
        of_case.into_iter().chain(of_base).map(str::to_owned).collect()
    }
}

/// The first of all facets as subject and verb.
pub(super) fn facets_that_cross(facets: &[u32], count: u64) -> String {
    let numbers: Vec<String> = facets.iter().map(ToString::to_string).collect();
    match (count, count - facets.len() as u64) {
        (1, _) => format!("facet {} crosses", numbers[0]),
        (_, 0) => format!("facets {} cross", numbers.join(", ")),
        (_, more) => format!("facets {} and {more} more cross", numbers.join(", ")),
    }
}
