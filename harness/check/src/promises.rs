//! What an engine guarantees about its meshes: the table `[promises]` of an engine file. Exactly what is promised is
//! checked, by every command. `harness/engines/README.md` explains the keys.
//!
//! Invariants: `definition` includes all other promises, so none is given beside it; at least one promise is given.

use serde::Deserialize;

/// The promises of an engine.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Promises {
    /// The mesh is that of the definition, leaf for leaf, sides included, on any number of ranks.
    pub definition: bool,
    /// Exactly the region to be kept is meshed, without holes or overlap.
    pub complete: bool,
    /// Every leaf that the geometry crosses has at least the level of the surface.
    pub surface: Option<Surface>,
    /// Every leaf that meets an extent box has at least the level of the box.
    pub boxes: bool,
    /// Exactly the leaves that facets cross are labelled crossing.
    pub crossing: bool,
    /// Every leaf has its side. Without this promise, the sides in leaf words have no meaning.
    pub sides: Option<Sides>,
    /// Leaves that touch in this way differ in edge length by at most `ratio`.
    pub balance: Option<Touching>,
    /// The ratio of `balance`, a power of two.
    pub ratio: Option<u32>,
    /// Layers are at least `layer_cells_min` cells thick, at every level.
    pub layers: bool,
    /// Two serial runs give the same mesh.
    pub deterministic: bool,
    /// The mesh is the serial one whatever these are.
    pub independent_of: Vec<Independence>,
}

/// The promise of resolution at the surface.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// Depth to which the geometry may reach into a coarser leaf, in cells of the surface level; less than 1.
    pub tolerance_cells: f64,
}

/// The promise of sides.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sides {
    /// Distance from the geometry within which a leaf may have any side, in cells of the surface level.
    pub band_cells: f64,
}

/// How leaves touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Touching {
    /// In part of a face
    #[value(name = "faces", alias = "face")]
    Face,
    /// In part of a face or an edge
    #[value(name = "edges", alias = "edge")]
    Edge,
    /// In a face, an edge or a corner
    #[value(name = "corners", alias = "corner")]
    Corner,
}

/// A circumstance of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Independence {
    /// The number of ranks.
    Ranks,
    /// The partitioner, and the level of the partition.
    Partitioner,
}

impl Promises {
    /// The promise of an engine without a table `[promises]`.
    pub fn of_definition() -> Self {
        Self { definition: true, ..Self::default() }
    }

    /// Whether nothing is promised, as of a mesh that must only equal another one.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether two serial runs must give the same mesh.
    pub fn is_deterministic(&self) -> bool {
        self.definition || self.deterministic
    }

    /// Whether the mesh must be the serial one whatever `circumstance` is.
    pub fn is_independent_of(&self, circumstance: Independence) -> bool {
        self.definition || self.independent_of.contains(&circumstance)
    }

    /// Levels by which touching leaves may differ.
    pub fn levels(&self) -> u8 {
        self.ratio.unwrap_or(2).trailing_zeros() as u8
    }

    /// Why the table is invalid, in one sentence; `None` if it is valid.
    pub fn fault(&self) -> Option<String> {
        let fault = if self.is_empty() {
            "[promises] is empty: state what the meshes guarantee, or `definition = true`"
        } else if self.definition && *self != Self::of_definition() {
            "`definition` includes all other promises: remove it, or remove them"
        } else if self.ratio.is_some() && self.balance.is_none() {
            "`ratio` has no meaning without `balance`: add `balance`, or remove it"
        } else if self.ratio.is_some_and(|ratio| !ratio.is_power_of_two() || ratio < 2) {
            "`ratio` must be a power of two and at least 2"
        } else if self.surface.is_some_and(|s| !(0.0..1.0).contains(&s.tolerance_cells)) {
            "`tolerance_cells` must be at least 0 and less than 1"
        } else if self.sides.is_some_and(|s| !(0.0..=1e6).contains(&s.band_cells)) {
            "`band_cells` must be from 0 to 1e6"
        } else {
            return None;
        };
        Some(fault.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(promises: Promises) -> String {
        promises.fault().unwrap_or_default()
    }

    #[test]
    fn contradictory_promises_have_a_fault() {
        let balanced = Promises { balance: Some(Touching::Face), ..Promises::default() };
        assert_eq!(balanced.fault(), None);
        assert_eq!(Promises::of_definition().fault(), None);
        assert!(fault(Promises::default()).contains("empty"));
        assert!(fault(Promises { definition: true, ..balanced.clone() }).contains("includes all"));
        assert!(fault(Promises { ratio: Some(3), ..balanced.clone() }).contains("power of two"));
        assert!(
            fault(Promises { ratio: Some(2), layers: true, ..Promises::default() })
                .contains("without")
        );
        let surface = Some(Surface { tolerance_cells: f64::NAN });
        assert!(fault(Promises { surface, ..Promises::default() }).contains("tolerance_cells"));
        let sides = Some(Sides { band_cells: -1.0 });
        assert!(fault(Promises { sides, ..Promises::default() }).contains("band_cells"));
    }

    #[test]
    fn the_limits_of_a_promise_are_valid_and_what_is_beyond_is_a_fault() {
        let is_valid = |promises: Promises| promises.fault().is_none();
        let ratio = |ratio| Promises {
            balance: Some(Touching::Corner),
            ratio: Some(ratio),
            ..Promises::default()
        };
        assert_eq!([0, 1, 2, 4, 6].map(|r| is_valid(ratio(r))), [false, false, true, true, false]);
        let surface = |tolerance_cells| Promises {
            surface: Some(Surface { tolerance_cells }),
            ..Promises::default()
        };
        assert_eq!([-0.1, 0.0, 0.9, 1.0].map(|t| is_valid(surface(t))), [false, true, true, false]);
        let sides =
            |band_cells| Promises { sides: Some(Sides { band_cells }), ..Promises::default() };
        assert_eq!([-0.1, 0.0, 1e6, 2e6].map(|b| is_valid(sides(b))), [false, true, true, false]);
    }

    #[test]
    fn the_definition_includes_determinism_and_every_independence() {
        use Independence::{Partitioner, Ranks};
        let independent =
            |promises: &Promises| [Ranks, Partitioner].map(|c| promises.is_independent_of(c));
        let definition = Promises::of_definition();
        assert!(definition.is_deterministic() && independent(&definition) == [true; 2]);
        let none = Promises::default();
        assert!(!none.is_deterministic() && independent(&none) == [false; 2]);
        let some = Promises { deterministic: true, independent_of: vec![Ranks], ..none };
        assert!(some.is_deterministic() && independent(&some) == [true, false]);
    }

    #[test]
    fn a_ratio_is_a_number_of_levels() {
        let levels = |ratio| Promises { ratio, ..Promises::default() }.levels();
        assert_eq!([levels(None), levels(Some(2)), levels(Some(8))], [1, 1, 3]);
    }
}
