//! The integer lattice on which all geometric tests are exact, and the rules that define the mesh.
//!
//! The root cube has 2^27 lattice units along an edge, 256 for each cell of level 19. Vertices and extent
//! boxes are rounded to the lattice once; no later step rounds.

use crate::error::Error;
use bricks::brick::{SPANS, valid};
use bricks::facet::Facet;
use bricks::octant::{LEVEL_MAX, Level, ROOT_BITS, ROOT_EDGE};
use bricks::widest;
use bytemuck::{Pod, Zeroable};

/// The root cube, in the unit of the geometry.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Root {
    /// Minimum corner.
    pub origin: [f64; 3],
    /// Edge length, finite and positive.
    pub edge: f64,
}

/// Bounding box of a set of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// Least coordinates; greater than `hi` if there are no vertices.
    pub lo: [f64; 3],
    /// Greatest coordinates.
    pub hi: [f64; 3],
}

impl Bounds {
    /// Bounds of facets. Their coordinates must be finite.
    pub fn of(facets: &[geometries::Facet]) -> Self {
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for v in facets.as_flattened() {
            // One instruction each, unlike `min` and `max`, which consider what is not a number.
            lo = [0, 1, 2].map(|a| if v[a] < lo[a] { v[a] } else { lo[a] });
            hi = [0, 1, 2].map(|a| if v[a] > hi[a] { v[a] } else { hi[a] });
        }
        Self { lo: lo.map(f64::from), hi: hi.map(f64::from) }
    }

    /// Bounds of the union of both sets.
    pub fn union(self, other: Self) -> Self {
        Self {
            lo: std::array::from_fn(|a| self.lo[a].min(other.lo[a])),
            hi: std::array::from_fn(|a| self.hi[a].max(other.hi[a])),
        }
    }
}

impl Root {
    /// The cube whose edge is `scale` times the longest edge of the bounds, centred on them. The order of the
    /// floating-point operations is part of the mesh's definition.
    ///
    /// # Errors
    /// If the bounds have no extent.
    pub fn around(bounds: &Bounds, scale: f64) -> Result<Self, Error> {
        let longest = (0..3).map(|a| bounds.hi[a] - bounds.lo[a]).fold(0.0, f64::max);
        if longest <= 0.0 {
            return Err(Error::input(
                "the geometry has no extent, so root_scale defines no root: set [root] with origin and edge",
            ));
        }
        let edge = scale * longest;
        let origin = std::array::from_fn(|a| (bounds.lo[a] + bounds.hi[a]) * 0.5 - edge * 0.5);
        Ok(Self { origin, edge })
    }

    /// The nearest lattice point, ties to even; saturates.
    pub fn nearest(&self, p: [f64; 3]) -> [i64; 3] {
        let scale = ROOT_EDGE as f64 / self.edge;
        std::array::from_fn(|a| rounded(p[a], self.origin[a], scale) as i64)
    }

    /// Coordinates of a lattice point in the unit of the geometry.
    pub fn locate(&self, q: [i64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.origin[a] + q[a] as f64 * (self.edge / ROOT_EDGE as f64))
    }

    /// The edge of octants of a level, in the user's units.
    pub fn edge_of(&self, level: Level) -> f64 {
        self.edge / f64::from(1u32 << level)
    }

    /// The level of a spacing: the shallowest whose cells are that size or smaller. `what` names the spacing in
    /// errors.
    ///
    /// # Errors
    /// If cells of level 19 are larger.
    pub fn level_of(&self, spacing: f64, what: &str) -> Result<Level, Error> {
        (0..=LEVEL_MAX).find(|&l| self.edge_of(l) <= spacing).ok_or_else(|| {
            Error::input(format!(
                "{what} {spacing} is too small for a root of edge {}: level {LEVEL_MAX} has cells of {}; choose a larger spacing or a smaller root",
                self.edge,
                self.edge_of(LEVEL_MAX)
            ))
        })
    }

    /// Rounds facets to the lattice, in place. `bounds` are their bounds; `first` is the index of the first one in the
    /// whole geometry, for errors.
    ///
    /// # Errors
    /// If a vertex is more than one root edge outside the root.
    pub fn facets(
        &self,
        mut facets: Vec<geometries::Facet>,
        bounds: &Bounds,
        first: u64,
    ) -> Result<Vec<Facet>, Error> {
        let (origin, scale) = (self.origin, ROOT_EDGE as f64 / self.edge);
        let limit = ROOT_EDGE as f64 * 1.5;
        // False for a product with an infinite scale that is not a number.
        let near = |c: f64, a: usize| off_centre(rounded(c, origin[a], scale)) <= limit;
        // Rounding is monotonic, so no vertex is too far if the bounds are not.
        if !facets.is_empty() && !(0..3).all(|a| near(bounds.lo[a], a) && near(bounds.hi[a], a)) {
            let is_far = |v: &[f32; 3]| !(0..3).all(|a| near(f64::from(v[a]), a));
            let vertices = facets.as_flattened();
            let far = vertices.iter().position(is_far).expect("the bounds are those of vertices");
            let [x, y, z] = vertices[far];
            return Err(Error::input(format!(
                "facet {} has a vertex at ({x}, {y}, {z}), more than one root edge outside the root: enlarge or move the root",
                first + far as u64 / 3
            )));
        }
        quantise(&mut facets, &origin, scale);
        Ok(bytemuck::allocation::cast_vec(facets))
    }
}

/// The lattice coordinate nearest to `c`.
#[inline(always)]
fn rounded(c: f64, origin: f64, scale: f64) -> f64 {
    ((c - origin) * scale).round_ties_even()
}

/// Distance from the root's centre: the allowed range is symmetric about it.
fn off_centre(c: f64) -> f64 {
    (c - ROOT_EDGE as f64 * 0.5).abs()
}

widest! {
    /// Replaces the coordinates by the bit patterns of their lattice coordinates, as i32.
    fn quantise(facets: &mut [geometries::Facet], origin: &[f64; 3], scale: f64) = quantise_lanes;
}

#[inline(always)]
fn quantise_lanes(facets: &mut [geometries::Facet], origin: &[f64; 3], scale: f64) {
    // All nine coordinates of a facet at a time, to fill the vector lanes.
    let origins: [f64; 9] = std::array::from_fn(|i| origin[i % 3]);
    for f in facets {
        let c: [f32; 9] = bytemuck::cast(*f);
        let whole: &mut [i32; 9] = bytemuck::cast_mut(f);
        *whole = std::array::from_fn(|i| rounded(f64::from(c[i]), origins[i], scale) as i32);
    }
}

/// An extent box on the lattice, clamped to the root.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct ExtentBox {
    /// Minimum corner.
    pub min: [i64; 3],
    /// Maximum corner. A box for which it equals `min` on an axis has no interior and no effect.
    pub max: [i64; 3],
    /// Minimum level of the leaves whose interior meets the interior of the box.
    pub level: Level,
}

impl ExtentBox {
    /// Whether the interiors of the box and of the cube with minimum corner `corner` and edge `h` meet.
    #[inline]
    pub fn meets(&self, corner: [i64; 3], h: i64) -> bool {
        (0..3).all(|a| self.min[a].max(corner[a]) < self.max[a].min(corner[a] + h))
    }
}

/// Mask of the octants of level `l`, in the brick with minimum corner `corner`, whose interior meets the
/// interior of the box.
pub fn box_mask(b: &ExtentBox, corner: [i64; 3], l: Level) -> u64 {
    let shift = ROOT_BITS - l;
    let mut mask = u64::MAX;
    for axis in 0..3 {
        let first = (b.min[axis] - corner[axis]) >> shift;
        let last = (b.max[axis] - corner[axis] - 1) >> shift;
        if first > 3 || last < 0 || b.min[axis] >= b.max[axis] {
            return 0;
        }
        mask &= SPANS[axis][first.max(0) as usize][last.min(3) as usize];
    }
    mask & valid(l)
}

/// The parameters that, with the facets, define the mesh.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Rules {
    /// The root cube.
    pub root: Root,
    /// Surface level D.
    pub level_surface: Level,
    /// Minimum thickness n of a layer, in cells.
    pub layer_cells_min: u32,
    /// The side that is kept.
    pub keep: Keep,
    /// Whether crossing leaves are part of the final mesh.
    pub keep_crossing: bool,
    /// The extent boxes.
    pub boxes: Vec<ExtentBox>,
    /// Points that lie in the flow; if there are none, rays decide the sides.
    pub seeds: Vec<Seed>,
    /// The treatment of outside components that do not reach the root's boundary.
    pub enclosed: Enclosed,
}

/// A point that lies in the flow. In JSON, the lattice point.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(transparent)]
pub struct Seed {
    /// Its coordinates in the unit of the geometry.
    #[serde(skip)]
    pub given: [f64; 3],
    /// The nearest lattice point, which may lie outside the root.
    pub lattice: [i64; 3],
}

impl Seed {
    /// Whether the point lies in the root, whose upper faces do not belong to it.
    pub fn is_in_root(&self) -> bool {
        self.lattice.iter().all(|c| (0..ROOT_EDGE).contains(c))
    }
}

/// The treatment of outside components that do not reach the root's boundary, such as sealed cavities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Enclosed {
    /// They are deleted if the outside is kept, no seeds are given, and another component reaches the boundary.
    #[default]
    Delete,
    /// They are kept.
    Keep,
}

/// The side of the geometry that the mesh keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// External flow: outside and crossing leaves.
    Outside,
    /// Internal flow: inside and crossing leaves.
    Inside,
    /// Everything.
    All,
}

impl Rules {
    /// Deepest level that a rule asks for.
    pub fn level_deepest(&self) -> Level {
        let has_volume = |b: &&ExtentBox| (0..3).all(|a| b.min[a] < b.max[a]);
        let levels = self.boxes.iter().filter(has_volume).map(|b| b.level);
        levels.fold(self.level_surface, Level::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_vector_widths_round_facets_alike() {
        let mut random = 7u32;
        let mut draw = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) as f32 / 1e6 - 3.0
        };
        let facets: Vec<geometries::Facet> =
            (0..500).map(|_| [0; 3].map(|_| [0; 3].map(|_| draw()))).collect();
        let root = Root { origin: [-5.0, -4.5, -7.25], edge: 24.0 };
        let all = bricks::wide::widths(|| {
            let bounds = Bounds::of(&facets);
            (bounds, root.facets(facets.clone(), &bounds, 0).unwrap())
        });
        for (width, (bounds, quantised)) in &all {
            assert_eq!((bounds, quantised), (&all[0].1.0, &all[0].1.1), "{width:?}");
            let naive = facets.as_flattened().iter().fold(f32::INFINITY, |m, v| m.min(v[1]));
            assert_eq!(bounds.lo[1], f64::from(naive));
            let c = (f64::from(facets[9][2][0]) + 5.0) * (ROOT_EDGE as f64 / 24.0);
            assert_eq!(quantised[9].v[2][0], c.round_ties_even() as i32);
        }
    }

    #[test]
    fn cells_have_the_spacing_or_are_smaller() {
        let root = Root { origin: [0.0; 3], edge: 8.0 };
        for (s, l) in [(9.0, 0), (8.0, 0), (7.9, 1), (1.0, 3), (0.99, 4), (8.0 / 524_288.0, 19)] {
            assert_eq!(root.level_of(s, "spacing").unwrap(), l, "{s}");
        }
        assert!(
            root.level_of(1e-6, "spacing_min").unwrap_err().to_string().contains("spacing_min")
        );
    }

    #[test]
    fn ties_round_to_even_and_errors_name_the_facet_that_is_too_far_out() {
        let root = Root { origin: [0.0; 3], edge: (ROOT_EDGE * 2) as f64 };
        assert_eq!(root.nearest([1.0, 3.0, 5.0]), [0, 2, 2]);
        let near = [[0.0f32; 3]; 3];
        let far = [[0.0; 3], [0.0; 3], [0.0, 3.1 * ROOT_EDGE as f32 * 2.0, 0.0]];
        assert_eq!(root.facets(vec![near], &Bounds::of(&[near]), 0).unwrap().len(), 1);
        assert!(
            root.facets(vec![near, far], &Bounds::of(&[near, far]), 40)
                .unwrap_err()
                .to_string()
                .contains("facet 41")
        );
    }

    #[test]
    fn vertices_may_be_one_root_edge_outside_the_root() {
        let root = Root { origin: [0.0; 3], edge: 8.0 };
        let at = |x: f32| {
            let facet = [[1.0; 3], [2.0, 1.0, 1.0], [1.0, x, 1.0]];
            root.facets(vec![facet], &Bounds::of(&[facet]), 7)
        };
        let found = |x: f32| at(x).unwrap()[0].v[2][1];
        assert_eq!((found(-8.0), found(16.0)), (-(1 << 27), 1 << 28));
        for (x, shown) in [(-8.000001, "-8.000001"), (16.000002, "16.000002")] {
            assert_eq!(
                at(x).unwrap_err().to_string(),
                format!(
                    "facet 7 has a vertex at (1, {shown}, 1), more than one root edge outside the root: enlarge or move the root"
                )
            );
        }
        assert_eq!(
            Root { origin: [1.0, 2.0, -4.0], edge: 8.0 }.locate([1 << 26, 1 << 27, 1 << 25]),
            [5.0, 10.0, -2.0]
        );
        let deepest = root.level_of(1e-9, "spacing").unwrap_err().to_string();
        assert!(deepest.contains("level 19 has cells of 0.0000152587890625;"), "{deepest}");
    }

    #[test]
    fn a_root_too_small_for_the_lattice_is_refused() {
        let root = Root { origin: [0.0; 3], edge: 1e-310 };
        let at_origin = [[0.0f32; 3]; 3];
        assert!(root.facets(vec![at_origin], &Bounds::of(&[at_origin]), 0).is_err());
    }

    #[test]
    fn boxes_meet_by_interiors_only() {
        let b = ExtentBox { min: [0, 0, 0], max: [4, 4, 4], level: 3 };
        assert!(b.meets([3, 3, 3], 4) && !b.meets([4, 0, 0], 4));
        let flat = ExtentBox { max: [4, 4, 0], ..b };
        assert!(!flat.meets([0, 0, 0], 4));
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let point = |a: &[i128], i: usize| [i, i + 1, i + 2].map(|i| a[i] as i64);
        let extent = |a: &[i128]| ExtentBox { min: point(a, 0), max: point(a, 3), level: 0 };
        // Numbers of f64 are in quarters.
        let quarters = |a: i128| a as f64 / 4.0;
        crate::values::compare(
            "src/input/lattice.rs",
            &[
                ("meets", &|a| vec![extent(a).meets(point(a, 6), a[9] as i64).into()]),
                ("box_mask", &|a| vec![box_mask(&extent(a), point(a, 6), a[9] as Level).into()]),
                ("rounded", &|a| {
                    vec![(rounded(quarters(a[0]), quarters(a[1]), quarters(a[2])) * 4.0) as i128]
                }),
                ("off_centre", &|a| vec![(off_centre(quarters(a[0])) * 4.0) as i128]),
            ],
        );
    }
}
