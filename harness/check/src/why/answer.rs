//! The answer to a question about a point; JSON of the schema `octree-why/3` when serialised.
//!
//! Invariants: the leaf and the leaf of T0 contain the point; every ancestor of the leaf has its split, in order. A chain begins
//! with the octant that is split; each leaf is finer and near enough for its rule; each further octant is the parent of
//! the leaf before it, and the cause is one of the last octant. A cause has a facet or a box. Only a point without a leaf is
//! in a deleted part.

use super::Mesh;
use super::base::Cause;
use super::chain::{Link, Rule};
use crate::checks::components::{Component, Decision};
use contract::lattice::Root;
use contract::manifest::{self, Keep};
use contract::octant::{Octant, UNITS_PER_CELL};
use contract::word::Side;
use serde::Serialize;

/// Name and version of the JSON form.
pub const SCHEMA: &str = "octree-why/3";

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

/// A place as text.
pub(super) fn user_place(place: &Place) -> String {
    let point = |[x, y, z]: [f64; 3]| format!("({x}, {y}, {z})");
    let Place { path, level, min, max, .. } = place;
    format!("octant {path} (level {level}), {} to {}", point(*min), point(*max))
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// The point, in the user's units.
    pub point: [f64; 3],
    /// The leaf at the point; none if the point lies in a deleted part.
    pub leaf: Option<Place>,
    /// The leaf of T0 at the point; none if the surface is not known.
    pub base_leaf: Option<Place>,
    /// The side of the leaf in the mesh.
    pub side: Option<Side>,
    /// What decides the side.
    pub side_decided_by: SideReason,
    /// Deleted parts: the rule that deletes the leaf of T0.
    pub deleted_by: Option<Deletion>,
    /// Every octant from the root to the parent of the leaf, with the cause of its split.
    pub splits: Vec<Split>,
    /// What could not be explained, and why.
    pub left_out: Vec<String>,
    #[serde(skip)]
    pub(super) layer_cells_min: u32,
}

/// An octant that is split, and why.
#[derive(Clone, Debug, Serialize)]
pub struct Split {
    /// The octant.
    pub octant: Place,
    /// The leaves from the octant to the cause; none if T0 splits the octant.
    pub links: Vec<LinkRecord>,
    /// The cause in the inputs; none if no rule requires the split.
    pub cause: Option<CauseRecord>,
}

/// A leaf that forces the previous octant of a chain to split.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkRecord {
    /// The rule: `extra_layer`, `layer` or `balance`.
    pub rule: &'static str,
    /// Section of reference/DEFINITION.md, with the step.
    pub section: &'static str,
    /// The octant that is forced to split: that of the chain, or the parent of the previous leaf.
    pub octant: Place,
    /// The leaf that forces it.
    pub leaf: Place,
    /// Distance of leaf and octant in cells of the leaf's level.
    pub distance_cells: i64,
}

/// A cause in the inputs. Each facet and each box alone is sufficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CauseRecord {
    /// Section of reference/DEFINITION.md.
    pub section: &'static str,
    /// The octant that facets cross and boxes meet: the split octant, a descendant, the parent of the last leaf, or the
    /// last leaf itself after the extra layer.
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

/// What decides the side of a leaf.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SideReason {
    /// Facets cross the leaf of T0.
    Facets {
        /// The first facets, counted from 0.
        facets: Vec<u32>,
        /// Their number.
        facets_count: u64,
    },
    /// The component of the leaf has a side.
    Component {
        /// The side.
        side: Side,
        /// What decides it, in words.
        decision: String,
        /// The candidate whose rays decide.
        candidate: Option<Place>,
        /// For its rays +x, -x, +y, -y, +z, -z: whether the number of facets is odd.
        rays_odd: Option<[bool; 6]>,
        /// The index of the seed that decides.
        seed: Option<usize>,
        /// Number of leaves of the component.
        leaves: u64,
    },
    /// The facets are not known.
    Unknown,
}

/// The rule that deletes a leaf.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Deletion {
    /// Section of reference/DEFINITION.md.
    pub section: &'static str,
    /// The rule in words.
    pub rule: String,
}

/// The rule in place of one that deletes a leaf.
const LOST: &str = "no rule deletes it: the mesh has lost a leaf";

impl Deletion {
    /// Whether no rule deletes the leaf.
    pub fn is_lost(&self) -> bool {
        self.rule == LOST
    }
}

impl Answer {
    /// Panics if an invariant of the answer does not hold.
    pub fn check_invariants(&self) {
        let Self { point, leaf, base_leaf, side, deleted_by, splits, .. } = self;
        for place in leaf.iter().chain(base_leaf) {
            // The point is rounded to the lattice, and printed coordinates to some decimals.
            let near = |a: usize| {
                let slack = (place.max[a] - place.min[a]) / 128.0;
                (place.min[a] - slack..=place.max[a] + slack).contains(&point[a])
            };
            assert!((0..3).all(near), "{point:?} is not in the {}", user_place(place));
        }
        if let (Some(leaf), Some(base)) = (leaf, base_leaf) {
            let (leaf, base) = (&leaf.octant, &base.octant);
            assert!(
                leaf.contains(base) || base.contains(leaf),
                "{leaf} is apart from {base} of T0"
            );
        }
        assert_eq!(leaf.is_some(), side.is_some(), "a leaf has a side, and only a leaf");
        assert!(
            deleted_by.is_none() || leaf.is_none(),
            "the leaf {leaf:?} was deleted: {deleted_by:?}"
        );
        let end = leaf.as_ref().or(base_leaf.as_ref()).map(|place| place.octant);
        assert_eq!(
            splits.len(),
            end.map_or(0, |end| usize::from(end.level)),
            "splits above {end:?}"
        );
        for (split, level) in splits.iter().zip(0..) {
            let octant = &split.octant.octant;
            assert_eq!(
                end.map(|end| end.ancestor(level)),
                Some(*octant),
                "the split of level {level}"
            );
            split.check_invariants(self.layer_cells_min);
        }
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
                "layer" => leaf.level > octant.level && distance < reach,
                "balance" => leaf.level > octant.level + 1 && distance == 0,
                _ => distance == 0,
            };
            // The parent of a source is split before the layer of the source's level is made.
            let is_early =
                !is_source || leaf.level > octant.level + 1 || link.rule == "extra_layer";
            assert!(is_right && is_early, "{link:?} does not force the split of {octant}");
            assert_eq!(link.distance_cells, distance / i64::from(leaf.edge()), "{link:?}");
            (is_source, ends) = (link.rule == "layer", link.rule == "extra_layer");
            octant = if ends { leaf } else { leaf.ancestor(leaf.level - 1) };
        }
        let CauseRecord { octant: at, facets, facets_count, is_crossed, boxes, .. } = cause;
        let is_of_octant = match self.links.is_empty() {
            true => octant.contains(&at.octant),
            false => octant == at.octant,
        };
        assert!(is_of_octant, "the cause of {octant} is one of {}", at.octant);
        assert!(*is_crossed || !boxes.is_empty(), "{octant} is split without a facet or a box");
        assert_eq!(
            facets.len() as u64,
            (*facets_count).min(FACETS_LISTED as u64),
            "facets of {octant}"
        );
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
            let (from, to) = (root.origin, root.to_user([contract::lattice::UNITS_PER_EDGE; 3]));
            format!("the point {point:?} lies outside the root, which is from {from:?} to {to:?}; give a point inside")
        })?;
        let cell = lattice.map(|q| (q / UNITS_PER_CELL) as u32);
        let leaf = self.leaves.leaf_at(cell);
        let base = self.knows_surface().then(|| self.base_leaf_at(cell));
        let octant = leaf.map(|(octant, _)| octant).or(base);
        let mut answer = Answer {
            schema: SCHEMA,
            point,
            leaf: leaf.map(|(octant, _)| self.place(&octant)),
            base_leaf: base.map(|base| self.place(&base)),
            side: leaf.map(|(_, kind)| Side::ALL[usize::from(kind)]),
            side_decided_by: SideReason::Unknown,
            deleted_by: None,
            splits: octant.map_or(Vec::new(), |octant| self.splits_above(&octant)),
            left_out: Vec::new(),
            layer_cells_min: self.terms.layer_cells_min,
        };
        self.explain_side(base, &mut answer);
        self.leave_out(&mut answer);
        answer.check_invariants();
        Ok(answer)
    }

    /// The ancestors of an octant, from the root. All that T0 splits have the cause of the finest of them, because what
    /// crosses or meets an octant does so with its ancestors.
    fn splits_above(&self, octant: &Octant) -> Vec<Split> {
        let ancestors = (0..octant.level).map(|level| octant.ancestor(level));
        let of_base = ancestors.clone().take_while(|ancestor| self.base_splits(ancestor)).count();
        let cause = of_base.checked_sub(1).and_then(|level| {
            self.base_cause(&octant.ancestor(level as u8)).map(|cause| self.cause(&cause))
        });
        let split = |ancestor: Octant| match usize::from(ancestor.level) < of_base {
            true => {
                Split { octant: self.place(&ancestor), links: Vec::new(), cause: cause.clone() }
            }
            false => self.split(&ancestor),
        };
        ancestors.map(split).collect()
    }

    /// An octant that is split, with the chain to a cause.
    pub(crate) fn split(&self, octant: &Octant) -> Split {
        let chain = self.chain(octant);
        let links = chain.iter().flat_map(|chain| &chain.links).map(|link| self.link(link));
        let cause = chain.as_ref().map(|chain| self.cause(&chain.cause));
        Split { octant: self.place(octant), links: links.collect(), cause }
    }

    fn link(&self, link: &Link) -> LinkRecord {
        let (rule, section) = match link.rule {
            Rule::ExtraLayer => ("extra_layer", "6"),
            Rule::Layer => ("layer", "6, step 2"),
            Rule::Balance => ("balance", "6, step 3"),
        };
        LinkRecord {
            rule,
            section,
            octant: self.place(&link.octant),
            leaf: self.place(&link.leaf),
            distance_cells: link.octant.distance(&link.leaf) / i64::from(link.leaf.edge()),
        }
    }

    fn cause(&self, cause: &Cause) -> CauseRecord {
        CauseRecord {
            section: "3",
            octant: self.place(&cause.octant),
            facets: cause.facets.iter().copied().take(FACETS_LISTED).collect(),
            facets_count: cause.facets.len() as u64,
            is_crossed: !cause.facets.is_empty()
                || cause.octant.level < self.terms.level_surface && self.is_crossed(&cause.octant),
            boxes: cause.boxes.clone(),
        }
    }

    /// Adds what decides the side of the leaf of T0 and, if it was deleted, the rule for that.
    fn explain_side(&self, base: Option<Octant>, answer: &mut Answer) {
        let Some((base, (_, truth))) = base.zip(self.body) else { return };
        let facets = self.facets_of(&base);
        if !facets.is_empty() {
            answer.side_decided_by = SideReason::Facets {
                facets_count: facets.len() as u64,
                facets: facets.into_iter().take(FACETS_LISTED).collect(),
            };
            if answer.leaf.is_none() {
                let rule = match self.terms.keep_crossing {
                    false => {
                        "keep_crossing is false, so crossing leaves are deleted after gradation"
                    }
                    true => LOST,
                };
                answer.deleted_by = Some(Deletion { section: "7", rule: rule.to_owned() });
            }
            return;
        }
        let Some(component) = truth.component_at(&base) else { return };
        let side = component.side;
        if answer.leaf.is_none() {
            answer.deleted_by = Some(self.deletion(component));
        }
        let (mut candidate, mut rays_odd, mut seed) = (None, None, None);
        let text = match component.decision {
            Decision::Seed(index) => {
                seed = Some(index);
                format!("seed {index} lies in its component")
            }
            Decision::NoSeed => "no seed lies in its component".to_owned(),
            Decision::Rays(octant, before) => {
                let is_odd = side == Side::Inside;
                (candidate, rays_odd) = (Some(self.place(&octant)), Some([is_odd; 6]));
                let parity = if is_odd { "an odd" } else { "an even" };
                let skipped = match before {
                    0 => String::new(),
                    n => format!(", after {n} candidates whose rays disagree"),
                };
                format!(
                    "each of the six rays of the candidate intersects {parity} number of facets{skipped}"
                )
            }
            Decision::Majority(candidates, odd) => format!(
                "the component is ambiguous: the rays of no candidate agree, and {odd} of the {} rays of {candidates} \
                 candidates are odd",
                6 * candidates
            ),
        };
        answer.side_decided_by = SideReason::Component {
            side,
            decision: text,
            candidate,
            rays_odd,
            seed,
            leaves: component.leaves.len() as u64,
        };
    }

    /// The rule that deletes the leaves of a component.
    fn deletion(&self, &Component { side, enclosed, .. }: &Component) -> Deletion {
        let terms = &self.terms;
        let keep = match terms.keep {
            Keep::Outside => "outside",
            Keep::Inside => "inside",
            Keep::All => "all",
        };
        let rule = if !terms.keeps(side as u8) {
            format!("keep is {keep}, so leaves that are {side} are deleted")
        } else if enclosed {
            "enclosed is delete, and no leaf of its component has a face on the root's boundary"
                .to_owned()
        } else {
            LOST.to_owned()
        };
        Deletion { section: "5", rule }
    }

    /// Adds what the answer lacks, and why.
    fn leave_out(&self, answer: &mut Answer) {
        let mut add = |what: &str| answer.left_out.push(what.to_owned());
        if self.body.is_none() {
            add(match self.knows_surface() {
                true => "facet numbers and the decision on the side: give the case with --case",
                false => {
                    "everything that depends on facets or on crossing leaves, which the mesh does not contain: give \
                     the case with --case"
                }
            });
        }
        if self.manifest.tree == manifest::Tree::Base {
            add("gradation: the mesh is a base tree");
        }
    }
}
