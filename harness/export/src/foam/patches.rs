//! The patches of a mesh: the root's sides, the body or its solids, and the cut.

use std::collections::HashMap;

use contract::case::Case;
use contract::octant::UNITS_PER_CELL;
use geometry::tree::{FacetTree, Point};

use crate::leaves::{Content, Square};

/// Patches of the root's sides.
pub const SIDES: [&str; 6] = ["xMin", "xMax", "yMin", "yMax", "zMin", "zMax"];
/// Patch of the faces beyond which there is no leaf, of a body without named solids.
const BODY: &str = "body";
/// Patch of the faces beyond which there is a leaf that is not exported.
pub const CUT: &str = "cut";

/// The patches: [`SIDES`], the solids of the body, and, if leaves were left out, the cut.
pub struct Patches {
    /// The names, unique.
    pub names: Vec<String>,
    has_cut: bool,
    /// Patch of each facet, if there are several.
    of_facet: Vec<usize>,
    facets: Option<FacetTree>,
}

impl Patches {
    /// The patches of a mesh. Without a case, its body is one patch.
    pub fn new(case: Option<&Case>, has_cut: bool) -> Self {
        let mut names = SIDES.map(str::to_owned).to_vec();
        let (mut of_facet, mut patch_of) = (Vec::new(), HashMap::new());
        let solids = case.iter().flat_map(|case| &case.solids);
        for solid in solids.filter(|solid| solid.facets > 0) {
            let patch = *patch_of.entry(&solid.name).or_insert_with(|| {
                let name = patch_name(solid.name.as_deref().unwrap_or_default());
                let numbered = (2..).map(|number| format!("{name}_{number}"));
                let mut choices = std::iter::once(name.clone()).chain(numbered);
                names.extend(choices.find(|name| !names.contains(name)));
                names.len() - 1
            });
            of_facet.extend(std::iter::repeat_n(patch, solid.facets));
        }
        let several = case.filter(|_| names.len() > SIDES.len() + 1);
        let facets = several.map(|case| FacetTree::new(&case.facets_lattice));
        if names.len() == SIDES.len() {
            names.push(BODY.to_owned());
        }
        names.extend(has_cut.then(|| CUT.to_owned()));
        Self { names, has_cut, of_facet, facets }
    }

    /// The type of a patch.
    pub fn type_of(&self, patch: usize) -> &'static str {
        let is_body = patch >= SIDES.len() && !(self.has_cut && patch + 1 == self.names.len());
        if is_body { "wall" } else { "patch" }
    }

    /// The patch of a face that no cell is across.
    pub fn of(&self, square: &Square) -> usize {
        match square.across {
            Content::Outside => 2 * square.axis + usize::from(square.is_high),
            Content::Cut => self.names.len() - 1,
            _ => self.nearest(square),
        }
    }

    /// The patch of the solid with the facet nearest to the centre of a face.
    fn nearest(&self, square: &Square) -> usize {
        let Some(facets) = &self.facets else { return SIDES.len() };
        let [low, _, high, _] = square.corners(true);
        let units = UNITS_PER_CELL as f64 / 2.0;
        let centre = [0, 1, 2].map(|a| (f64::from(low[a]) + f64::from(high[a])) * units);
        let centre = Point::from(centre);
        // Half a lattice unit more, for rounding.
        let nearest = facets.within(centre, facets.distance(centre) + 0.5);
        self.of_facet[nearest[0].0 as usize]
    }
}

/// The name of a solid as a patch: characters that OpenFOAM's words may not have become underscores. Another solid whose name becomes the
/// same has a number at its end.
fn patch_name(solid: &str) -> String {
    let allowed = |c: char| c.is_alphanumeric() || "_-.+:".contains(c);
    let name: String = solid.chars().map(|c| if allowed(c) { c } else { '_' }).collect();
    let is_taken = SIDES.contains(&&*name) || name == CUT || name.starts_with("procBoundary");
    match name.as_str() {
        "" => BODY.to_owned(),
        _ if is_taken || !name.starts_with(|c: char| c.is_alphabetic() || c == '_') => {
            format!("{BODY}_{name}")
        }
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_solids_become_words() {
        for (solid, patch) in [
            ("wing", "wing"),
            ("", "body"),
            ("left wing (v2)", "left_wing__v2_"),
            ("a;b\"c{d}", "a_b_c_d_"),
            ("xMin", "body_xMin"),
            ("cut", "body_cut"),
            ("procBoundary0to1", "body_procBoundary0to1"),
            ("2nd", "body_2nd"),
        ] {
            assert_eq!(patch_name(solid), patch);
        }
    }
}
