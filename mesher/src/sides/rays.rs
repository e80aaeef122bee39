//! Parities of axis-parallel rays, exact.
//!
//! A ray along axis `a` counts the facets whose projection along `a` contains the projection of its start
//! point, displaced by +eps along `a + 1` and by +eps^2 along `a + 2` (symbolic perturbation). The displaced
//! ray meets no edge and no vertex, and facets whose projection has no area never count.
//!
//! Exactness: as in [`bricks::facet`]; edge functions are below 2^60 in magnitude, plane values are i128.

use bricks::facet::Facet;
use bricks::octant::{ROOT_BITS, ROOT_EDGE};

/// For each point the parities of its six rays: bit `2 a + 1` is set if the ray in the positive direction of
/// axis `a` meets an odd number of the facets, bit `2 a` if the one in the negative direction does. The
/// points are in the root and on no facet.
pub fn parities(facets: &[Facet], points: &[[i64; 3]]) -> Vec<u8> {
    let mut odd = vec![0; points.len()];
    let grids: [Grid; 3] = std::array::from_fn(|a| Grid::new(points, a));
    for f in facets {
        let extent = std::array::from_fn(|a| f.range(a));
        grids.iter().for_each(|grid| grid.count(f, &extent, points, &mut odd));
    }
    odd
}

/// Points binned by their projection along an axis. There are usually far fewer points than facets.
struct Grid {
    axis: usize,
    /// Squares per side, as a power of two.
    side_log2: u32,
    /// The points, each after its square, sorted.
    members: Vec<(usize, u32)>,
    /// Least and greatest coordinates of the points along both sides.
    reach: [(i64, i64); 2],
}

impl Grid {
    fn new(points: &[[i64; 3]], axis: usize) -> Self {
        let side_log2 = (points.len().max(1).ilog2() / 2).min(10);
        let [u, w] = [1, 2].map(|next| (axis + next) % 3);
        let widen = |(low, high): (i64, i64), c: i64| (low.min(c), high.max(c));
        let reach = [u, w].map(|a| points.iter().map(|p| p[a]).fold((i64::MAX, i64::MIN), widen));
        let grid = Self { axis, side_log2, members: Vec::new(), reach };
        let square = |p: &[i64; 3]| grid.index(p[w]) << side_log2 | grid.index(p[u]);
        let mut members: Vec<_> = points.iter().map(square).zip(0..).collect();
        members.sort_unstable();
        Self { members, ..grid }
    }

    /// Index, along one side, of the square of a lattice coordinate, clamped to the root.
    fn index(&self, c: i64) -> usize {
        (c.clamp(0, ROOT_EDGE - 1) >> (ROOT_BITS - self.side_log2)) as usize
    }

    /// Flips the parities of the points whose rays along the axis meet the facet.
    #[inline]
    fn count(&self, f: &Facet, extent: &[(i64, i64); 3], points: &[[i64; 3]], odd: &mut [u8]) {
        let (u, w) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        let ((u0, u1), (w0, w1)) = (extent[u], extent[w]);
        let [of_u, of_w] = self.reach;
        if u1 < of_u.0 || w1 < of_w.0 || u0 > of_u.1 || w0 > of_w.1 {
            return;
        }
        for row in self.index(w0)..=self.index(w1) {
            let base = row << self.side_log2;
            let (first, last) = (base + self.index(u0), base + self.index(u1));
            let from = self.members.partition_point(|m| m.0 < first);
            for &(_, i) in self.members[from..].iter().take_while(|m| m.0 <= last) {
                let p = &points[i as usize];
                let near = (u0..=u1).contains(&p[u]) && (w0..=w1).contains(&p[w]);
                if near && let Some(up) = meets(f, p, self.axis) {
                    odd[i as usize] ^= 1 << (2 * self.axis + usize::from(up));
                }
            }
        }
    }
}

/// Whether the line along `axis` through the displaced point meets the facet in the positive direction from
/// the point; none if it does not meet the facet.
fn meets(f: &Facet, p: &[i64; 3], axis: usize) -> Option<bool> {
    let n = f.normal();
    if n[axis] == 0 {
        return None;
    }
    let (u, w) = ((axis + 1) % 3, (axis + 2) % 3);
    let v = |i: usize, a: usize| i64::from(f.v[i % 3][a]);
    for i in 0..3 {
        let (eu, ew) = (v(i + 1, u) - v(i, u), v(i + 1, w) - v(i, w));
        let side = eu * (p[w] - v(i, w)) - ew * (p[u] - v(i, u));
        // The displacement by (eps, eps^2) changes the edge function by -ew eps + eu eps^2.
        let side = [side, -ew, eu].into_iter().find(|s| *s != 0)?;
        if (side > 0) != (n[axis] > 0) {
            return None;
        }
    }
    let height: i128 = (0..3).map(|a| i128::from(n[a]) * i128::from(p[a] - v(0, a))).sum();
    Some((height < 0) == (n[axis] > 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of facets from `lo` to `hi`, two per face.
    fn cube(lo: i32, hi: i32) -> Vec<Facet> {
        let mut out = Vec::new();
        for a in 0..3 {
            for at in [lo, hi] {
                let p = |u: i32, w: i32| {
                    let mut v = [at; 3];
                    v[(a + 1) % 3] = u;
                    v[(a + 2) % 3] = w;
                    v
                };
                out.push(Facet { v: [p(lo, lo), p(hi, lo), p(hi, hi)] });
                out.push(Facet { v: [p(lo, lo), p(hi, hi), p(lo, hi)] });
            }
        }
        out
    }

    #[test]
    fn all_six_rays_agree_on_a_cube_even_through_diagonals_and_edges() {
        let (lo, hi) = (1 << 20, 1 << 22);
        let facets = cube(lo, hi);
        let mut points = Vec::new();
        let some = [
            1i64 << 19,
            (1 << 20) - 1,
            (1 << 20) + 1,
            1 << 21,
            (1 << 22) - 1,
            (1 << 22) + 1,
            1 << 23,
        ];
        for x in some {
            for y in some {
                points.extend(some.map(|z| [x, y, z]));
            }
        }
        // In the planes of faces, but off the faces.
        points.extend([
            [1 << 20, 1 << 23, 1 << 21],
            [1 << 22, 1 << 19, 1 << 22],
            [1 << 20, 1 << 20, 1 << 19],
        ]);
        for (p, odd) in points.iter().zip(parities(&facets, &points)) {
            let inside = p.iter().all(|c| (i64::from(lo)..i64::from(hi)).contains(c));
            assert_eq!(odd, if inside { 63 } else { 0 }, "{p:?}");
        }
    }

    #[test]
    fn duplicated_facets_cancel() {
        let mut facets = cube(1 << 20, 1 << 22);
        facets.extend(facets.clone());
        assert_eq!(parities(&facets, &[[1 << 21; 3]]), [0]);
    }

    #[test]
    fn a_facet_meets_the_ray_towards_it_only() {
        let at = |axis: usize, along: i64, u: i64, w: i64| {
            let mut v = [along; 3];
            (v[(axis + 1) % 3], v[(axis + 2) % 3]) = (u, w);
            v
        };
        for axis in 0..3 {
            let v = |u, w| at(axis, 1 << 21, u, w).map(|c| c as i32);
            let corners = [v(0, 0), v(1 << 22, 0), v(0, 1 << 22)];
            for v in [corners, [corners[0], corners[2], corners[1]]] {
                // Within the facet's projection, and on its lower sides.
                for (u, w) in [(1 << 20, 1 << 20), (0, 1 << 20), (1 << 20, 0)] {
                    let points = [1 << 20, 1 << 22].map(|along| at(axis, along, u, w));
                    let below_and_above = parities(&[Facet { v }], &points);
                    assert_eq!(below_and_above, [2 << (2 * axis), 1 << (2 * axis)], "axis {axis}");
                }
            }
        }
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let met = |a: &[i128]| {
            let v = [0, 3, 6].map(|i| [0, 1, 2].map(|axis| a[i + axis] as i32));
            let met = meets(&Facet { v }, &[9, 10, 11].map(|i| a[i] as i64), a[12] as usize);
            met.map(i128::from).into_iter().collect()
        };
        crate::values::compare("src/sides/rays.rs", &[("meets", &met)]);
    }
}
