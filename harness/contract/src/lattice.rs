//! The integer lattice on which every geometric decision is made (reference/DEFINITION.md, section 2).

use crate::octant::{LEVEL_MAX, Octant, UNITS_PER_CELL};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Lattice units along an edge of the root.
pub const UNITS_PER_EDGE: i64 = 1 << 27;

/// A facet on the lattice.
pub type FacetLattice = [[i64; 3]; 3];

/// The vector from `b` to `a`.
pub fn difference(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// The vector product.
pub fn cross(u: [i64; 3], v: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|a| {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        u[b] * v[c] - u[c] * v[b]
    })
}

/// The scalar product.
pub fn dot(a: [i64; 3], b: [i64; 3]) -> i128 {
    (0..3).map(|i| i128::from(a[i]) * i128::from(b[i])).sum()
}

/// The facet's normal, with twice the area as its length; components are at most 2^59 in magnitude. Zero if the facet is degenerate.
pub fn normal(&[a, b, c]: &FacetLattice) -> [i64; 3] {
    cross(difference(b, a), difference(c, a))
}

/// The edges of a facet, each from one corner to the next.
pub fn edges<T: Copy>(&[a, b, c]: &[T; 3]) -> [[T; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The corners of a facet, or others, in order.
pub fn sorted<T: Ord, const N: usize>(mut corners: [T; N]) -> [T; N] {
    corners.sort_unstable();
    corners
}

/// Minimum and maximum corner of the facet's bounding box.
pub fn bounds(&[a, b, c]: &FacetLattice) -> [[i64; 3]; 2] {
    let pick = |f: fn(i64, i64) -> i64| std::array::from_fn(|i| f(f(a[i], b[i]), c[i]));
    [pick(i64::min), pick(i64::max)]
}

/// The level-19 cell whose half-open cube contains a lattice point; `None` outside the root.
pub fn cell_at(point: [i64; 3]) -> Option<[u32; 3]> {
    let is_in_root = point.iter().all(|c| (0..UNITS_PER_EDGE).contains(c));
    is_in_root.then(|| point.map(|c| (c / UNITS_PER_CELL) as u32))
}

/// The root cube, in the user's units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Root {
    /// Minimum corner.
    pub origin: [f64; 3],
    /// Edge length.
    pub edge: f64,
}

impl fmt::Display for Root {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "corner {:?}, edge {}", self.origin, self.edge)
    }
}

impl Root {
    /// The unit cube.
    pub const UNIT: Self = Self { origin: [0.0; 3], edge: 1.0 };

    /// Whether it is a cube: its edge is positive, and all numbers are finite, as are those that are computed with them.
    pub fn is_cube(&self) -> bool {
        (1e-100..1e100).contains(&self.edge) && self.origin.iter().all(|c| c.abs() < 1e100)
    }

    /// A vertex on the lattice; `None` if it is not finite or lies more than one root edge outside the root.
    pub fn quantise(&self, at: [f64; 3]) -> Option<[i64; 3]> {
        let near = -(UNITS_PER_EDGE as f64)..=2.0 * UNITS_PER_EDGE as f64;
        let q = self.units(at);
        q.iter().all(|v| near.contains(v)).then(|| q.map(|v| v as i64))
    }

    /// A corner of an extent box on the lattice, clamped to the root.
    pub fn quantise_clamped(&self, at: [f64; 3]) -> [i64; 3] {
        self.units(at).map(|v| v.clamp(0.0, UNITS_PER_EDGE as f64) as i64)
    }

    /// A seed on the lattice; `None` if it is not finite or lies outside the root, and so in no leaf. Leaves are
    /// half-open, so the root's maximum faces are outside.
    pub fn quantise_seed(&self, at: [f64; 3]) -> Option<[i64; 3]> {
        self.quantise(at).filter(|q| cell_at(*q).is_some())
    }

    /// Lattice coordinates as floating-point numbers.
    fn units(&self, at: [f64; 3]) -> [f64; 3] {
        let scale = UNITS_PER_EDGE as f64 / self.edge;
        std::array::from_fn(|a| ((at[a] - self.origin[a]) * scale).round_ties_even())
    }

    /// A lattice point in the user's units.
    pub fn to_user(&self, at: [i64; 3]) -> [f64; 3] {
        let scale = self.edge / UNITS_PER_EDGE as f64;
        std::array::from_fn(|a| self.origin[a] + at[a] as f64 * scale)
    }

    /// Edge of the cells of a level, in the user's units.
    pub fn edge_of(&self, level: u8) -> f64 {
        self.edge / f64::from(1u32 << level)
    }

    /// A point of the user with as few decimals as its lattice point needs, and without the rounding errors beyond them: what
    /// is printed. A lattice point next to 24900 is printed as 24900.
    pub fn rounded(&self, at: [f64; 3]) -> [f64; 3] {
        let decimals_max = (-(self.edge / UNITS_PER_EDGE as f64).log10().floor()).clamp(0.0, 300.0);
        let exact = self.units(at);
        // Adding 0 makes -0 positive.
        let with_decimals =
            |x: f64, n: usize| format!("{x:.n$}").parse().map_or(x, |rounded: f64| rounded + 0.0);
        std::array::from_fn(|a| {
            let mut shorter = (0..=decimals_max as usize).map(|n| with_decimals(at[a], n));
            shorter.find(|&x| self.units([x; 3])[a] == exact[a]).unwrap_or(at[a])
        })
    }

    /// The coarsest level whose cells are at most `spacing` wide; `None` if it is deeper than 19.
    pub fn level_for(&self, spacing: f64) -> Option<u8> {
        (0..=LEVEL_MAX).find(|&level| self.edge_of(level) <= spacing)
    }

    /// An octant as text: path, level, and bounds in the user's units.
    pub fn place(&self, octant: Octant) -> Place {
        Place(*self, octant)
    }
}

/// An octant in a root, as text. The text takes a while, and is made only if it is shown.
pub struct Place(Root, Octant);

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(root, octant) = self;
        let (low, high) = octant.bounds();
        let [from, to] = [low, high].map(|corner| root.rounded(root.to_user(corner)));
        write!(f, "{octant}, {from:?} to {to:?}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: Root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };

    #[test]
    fn corners_of_the_root_map_to_corners_of_the_lattice() {
        assert_eq!(ROOT.quantise([-1.0, 0.0, 2.0]), Some([0; 3]));
        assert_eq!(ROOT.quantise([3.0, 4.0, 6.0]), Some([UNITS_PER_EDGE; 3]));
        assert_eq!(ROOT.to_user([UNITS_PER_EDGE / 2; 3]), [1.0, 2.0, 4.0]);
    }

    #[test]
    fn vertices_may_lie_up_to_one_root_edge_outside() {
        assert!(ROOT.quantise([-5.0, 0.0, 2.0]).is_some());
        assert!(ROOT.quantise([-5.001, 0.0, 2.0]).is_none());
        assert!(ROOT.quantise([7.0, 0.0, 2.0]).is_some());
        assert!(ROOT.quantise([7.001, 0.0, 2.0]).is_none());
        assert!(ROOT.quantise([f64::NAN, 0.0, 2.0]).is_none());
        assert_eq!(ROOT.quantise_clamped([-9.0, 1.0, 99.0]), [0, 1 << 25, UNITS_PER_EDGE]);
    }

    #[test]
    fn a_seed_lies_in_the_half_open_root() {
        assert_eq!(ROOT.quantise_seed([-1.0, 0.0, 2.0]), Some([0; 3]));
        assert_eq!(ROOT.quantise_seed([2.0, 0.0, 2.0]), Some([3 << 25, 0, 0]));
        for outside in
            [[3.0, 0.0, 2.0], [-1.0, -1e-3, 2.0], [f64::NAN, 0.0, 2.0], [0.0, 1e300, 2.0]]
        {
            assert_eq!(ROOT.quantise_seed(outside), None, "{outside:?}");
        }
        // Rounding comes first, as for a vertex.
        assert_eq!(ROOT.quantise_seed([-1.0 - 1e-9, 0.0, 2.0]), Some([0; 3]));
        assert_eq!(ROOT.quantise_seed([3.0 - 1e-9, 0.0, 2.0]), None);
    }

    #[test]
    fn printed_points_have_the_decimals_of_the_lattice() {
        let at = [0.1 + 0.2, -1e-12, 2.0 / 3.0];
        assert_eq!(ROOT.rounded(at), [0.3, 0.0, 0.666_666_67]);
        assert!(ROOT.rounded(at)[1].is_sign_positive());
        let wide = Root { origin: [0.0; 3], edge: 1e12 };
        assert_eq!(wide.rounded([1234.5678, 0.0, 1e11]), [1235.0, 0.0, 1e11]);
        // The root of a body far from the origin.
        let far = Root { origin: [22191.242, -14722.031, 689.93], edge: 5553.0 };
        let q = far.quantise([24900.0, -12000.0, 3400.0]).unwrap();
        assert_eq!(far.rounded(far.to_user(q)), [24900.0, -12000.0, 3400.0]);
        // Lattice points stay apart.
        for q in [0i64, 1, 99_999_999, UNITS_PER_EDGE - 1] {
            let at = ROOT.rounded(ROOT.to_user([q; 3]));
            assert_eq!(ROOT.quantise(at), Some([q; 3]));
        }
    }

    #[test]
    fn an_octant_is_described_by_path_and_user_coordinates() {
        let text = "octant 3.1 (level 2), [2.0, 2.0, 2.0] to [3.0, 3.0, 3.0]";
        assert_eq!(ROOT.place(Octant::ROOT.child(3).child(1)).to_string(), text);
    }

    #[test]
    fn ties_are_rounded_to_even() {
        let root = Root { origin: [0.0; 3], edge: UNITS_PER_EDGE as f64 };
        assert_eq!(root.quantise([0.5, 1.5, 2.5]), Some([0, 2, 2]));
    }

    #[test]
    fn cells_of_the_level_are_at_most_as_wide_as_the_spacing() {
        assert_eq!(ROOT.level_for(4.0), Some(0));
        assert_eq!(ROOT.level_for(3.9), Some(1));
        assert_eq!(ROOT.level_for(1e-9), None);
    }
}
