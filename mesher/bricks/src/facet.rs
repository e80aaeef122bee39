//! Facet-octant intersection: one exact test for the 64 octants of a brick.
//!
//! A closed octant and a closed triangle are disjoint if and only if one of 13 axes separates them: the
//! three coordinate axes, the facet's normal, and the nine cross products of a coordinate axis with
//! an edge of the facet (separating axis theorem; Akenine-Moller, "Fast 3D triangle-box overlap
//! testing", 2001). Each axis gives a 64-bit mask of the octants that it does not separate from the
//! facet; the result is the intersection of the masks. A cross product with coordinate axis `a` is a
//! normal, within the projection along `a`, of an edge of the projected facet. So its test depends
//! on two coordinates only, and is the sign of an edge function at a corner of a square.
//!
//! # Exactness
//! All arithmetic is on integers, and no operation overflows. Let `h` be the octants' edge, at most 2^27.
//! - *Differences.* Vertices are lattice points with coordinates in [-2^27, 2^28], so differences of two
//!   vertices, such as the coefficients of edge functions, are at most 3 * 2^27 in magnitude: they fit i32. The brick's corner has
//!   coordinates in [0, 2^27]. So coordinates of vertices relative to it are at most 2^28 in magnitude.
//! - *Edge functions.* `ci * q_u + cj * q_w + at_origin` is a sum of four products: two of a coefficient and a coordinate of a
//!   vertex, at most 3 * 2^55 in magnitude each, and two of a coefficient and a coordinate of the corner, at most half of that. It is
//!   at most 9 * 2^55 < 2^59 in magnitude, which fits i64.
//! - *Plane.* The components of the normal are at most 18 * 2^54 in magnitude; the sum of their magnitudes is below 2^60. The
//!   scalar product of the normal with a vertex is computed in i128.
//! - *Scaling.* Octant corners are `h` times small integers (i, j, k), so each test has the form
//!   `h * m + c >= 0` with integers `m` and `c`. As `m` is an integer, this is equivalent to
//!   `m + floor(c / h) >= 0`. Since `h` is a power of two, the floor is an arithmetic shift. Constants are
//!   therefore shifted first, and the lanes evaluate `m + floor(c / h)` for all octants: in i64 for the plane.
//! - *Squares.* For edge functions, square (1, 1) is the origin of (i, j). So `m = ci * i + cj * j` is at most
//!   4 * 3 * 2^27 < 2^31 in magnitude, and its lanes are i32. Where `-floor(c / h)` is clamped to i32, all lanes are on one side of it.

use crate::brick::SPANS;
use crate::octant::{Level, ROOT_BITS};
use crate::{widest, with_avx512};
use bytemuck::{Pod, Zeroable};

/// A facet on the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Facet {
    /// Three vertices in lattice units, each coordinate in [-2^27, 2^28].
    pub v: [[i32; 3]; 3],
}

impl Facet {
    /// Least and greatest coordinate along `axis`.
    #[inline]
    pub fn range(&self, axis: usize) -> (i64, i64) {
        let [a, b, c] = [self.v[0][axis], self.v[1][axis], self.v[2][axis]];
        (i64::from(a.min(b).min(c)), i64::from(a.max(b).max(c)))
    }

    /// Normal by the right-hand rule. Its length is twice the facet's area: zero for a degenerate facet.
    #[inline]
    pub fn normal(&self) -> [i64; 3] {
        let d = |i: usize, a: usize| i64::from(self.v[i][a]) - i64::from(self.v[0][a]);
        let cross = |u: usize, w: usize| d(1, u) * d(2, w) - d(1, w) * d(2, u);
        [cross(1, 2), cross(2, 0), cross(0, 1)]
    }
}

/// Extrudes masks of squares along an axis `a`. A mask of 4 x 4 squares over the axes `a + 1` (fastest) and
/// `a + 2` is given as two bytes; `COLUMNS[a][half][byte]` are the brick's octants over these squares.
static COLUMNS: [[[u64; 256]; 2]; 3] = [columns(0), columns(1), columns(2)];

const fn columns(a: usize) -> [[u64; 256]; 2] {
    let (u, w) = (SPANS[(a + 1) % 3], SPANS[(a + 2) % 3]);
    let mut table = [[0; 256]; 2];
    let mut at = 0;
    while at < 2 * 256 * 8 {
        let (half, mask, k) = (at >> 11, at >> 3 & 255, at & 7);
        if mask >> k & 1 == 1 {
            let (i, j) = (k & 3, 2 * half + (k >> 2));
            table[half][mask] |= u[i][i] & w[j][j];
        }
        at += 1;
    }
    table
}

/// Mask of the octants of level `l` that the facet crosses, in the brick with minimum corner `corner`
/// (lattice units).
#[inline]
pub fn crossed(f: &Facet, corner: [i64; 3], l: Level) -> u64 {
    FacetTest::default().octants(f, corner, l, 0)
}

/// A facet, and what its tests against all bricks have in common: its normal and its edges in three projections. By default that of a facet whose
/// vertices are all at the origin.
#[derive(Clone, Copy, Debug, Default)]
pub struct FacetTest {
    facet: Facet,
    normal: [i64; 3],
    /// By axis, the half-planes whose intersection is the projection of the facet along it.
    sides: [[Side; 3]; 3],
}

/// The half-plane on one side of a line, in the projection along an axis: where the edge function `ci * q_u + cj * q_w + at_origin` is at least 0.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    ci: i32,
    cj: i32,
    at_origin: i64,
    /// By how much the function at its greatest over square (1, 1) exceeds that at the corner of square (0, 0), in units of `h`.
    growth: i32,
}

impl FacetTest {
    /// The test of facet `f`, prepared unless the last one was of the same facet. In place: a new value would be copied here.
    #[inline(never)]
    fn prepared(&mut self, f: &Facet) -> &Self {
        // Vertex by vertex, because the compiler calls a function for the comparison of all.
        if (0..3).any(|i| self.facet.v[i] != f.v[i]) {
            (self.facet, self.normal) = (*f, f.normal());
            for a in 0..3 {
                self.sides[a] = sides(&f.v, self.normal[a], a);
            }
        }
        self
    }

    /// The same as [`crossed`], but octants in `known` may be among them or not; faster if the last facet was the same.
    #[inline]
    pub fn octants(&mut self, f: &Facet, corner: [i64; 3], l: Level, known: u64) -> u64 {
        let shift = ROOT_BITS - l;
        let mut wide = 0;
        let mut mask = u64::MAX;
        for axis in 0..3 {
            let (lo, hi) = f.range(axis);
            // Closed octant i is [i h, (i + 1) h].
            let first = (lo - corner[axis] - 1) >> shift;
            let last = (hi - corner[axis]) >> shift;
            if first > 3 || last < 0 {
                return 0;
            }
            mask &= SPANS[axis][first.max(0) as usize][last.min(3) as usize];
            wide += usize::from(first < last);
        }
        // A connected set within one row of octants meets each octant that its extent meets.
        let is_decided = wide < 2 || mask & !known == 0;
        if is_decided { mask } else { mask & separated(self.prepared(f), corner, shift) }
    }
}

/// The half-planes whose intersection is the projection of a facet along `a`. The projection of one without area is a line, which
/// has the direction of the longest edge.
fn sides(v: &[[i32; 3]; 3], normal: i64, a: usize) -> [Side; 3] {
    let (u, w) = ((a + 1) % 3, (a + 2) % 3);
    let edges = [0, 1, 2].map(|i| (v[(i + 1) % 3][u] - v[i][u], v[(i + 1) % 3][w] - v[i][w], v[i]));
    let side = |(eu, ew, from): (i32, i32, [i32; 3]), sign: i32| {
        let (ci, cj) = (-ew * sign, eu * sign);
        let at = |c: i32, axis: usize| i64::from(c) * i64::from(from[axis]);
        let growth = ci + cj + ci.max(0) + cj.max(0);
        Side { ci, cj, at_origin: -at(ci, u) - at(cj, w), growth }
    };
    if normal != 0 {
        return edges.map(|edge| side(edge, normal.signum() as i32));
    }
    let longest = edges.into_iter().max_by_key(|e| e.0.abs() + e.1.abs()).expect("three edges");
    [side(longest, 1), side(longest, -1), side(longest, -1)]
}

widest! {
    /// The ten tests by plane and edges: octants that neither the normal nor a cross product separates from the facet. To be intersected with the
    /// mask of the coordinate axes.
    fn separated(f: &FacetTest, corner: [i64; 3], shift: u32) -> u64 = lanes;
}

#[inline(always)]
fn lanes(f: &FacetTest, corner: [i64; 3], shift: u32) -> u64 {
    let from = [0, 1, 2].map(|a| i64::from(f.facet.v[0][a]) - corner[a]);
    let mask = plane_mask(from, f.normal, shift);
    // Not a loop, in which the half-planes pass through memory: it takes 3 % more of `refine`.
    mask & columns_met(f, corner, shift, 0)
        & columns_met(f, corner, shift, 1)
        & columns_met(f, corner, shift, 2)
}

/// Octants in the columns along an axis that the facet's projection meets.
#[inline(always)]
fn columns_met(f: &FacetTest, corner: [i64; 3], shift: u32, a: usize) -> u64 {
    let at = [corner[(a + 1) % 3], corner[(a + 2) % 3]];
    let [x, y, z] = f.sides[a];
    let sides = [half_plane(x, at, shift), half_plane(y, at, shift), half_plane(z, at, shift)];
    let met = usize::from(squares(sides));
    COLUMNS[a][0][met & 0xff] | COLUMNS[a][1][met >> 8]
}

/// A half-plane in units of h: where `ci * (i - 1) + cj * (j - 1) >= least`, the square (i, j) meets it. Square (0, 0) is at `corner`.
#[inline(always)]
fn half_plane(side: Side, corner: [i64; 2], shift: u32) -> [i32; 3] {
    let (ci, cj) = (i64::from(side.ci), i64::from(side.cj));
    // The edge function at its greatest over square (1, 1), in units of h.
    let most =
        ((side.at_origin + ci * corner[0] + cj * corner[1]) >> shift) + i64::from(side.growth);
    let least = (-most).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
    [side.ci, side.cj, least]
}

with_avx512! {
    /// Mask of the squares, i fastest, that meet three half-planes.
    fn squares(sides: [[i32; 3]; 3]) -> u16 {
        let i = _mm512_setr_epi32(-1, 0, 1, 2, -1, 0, 1, 2, -1, 0, 1, 2, -1, 0, 1, 2);
        let j = _mm512_setr_epi32(-1, -1, -1, -1, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2);
        let times = |c: i32, of: __m512i| _mm512_mullo_epi32(of, _mm512_set1_epi32(c));
        sides.iter().fold(u16::MAX, |mask, &[ci, cj, least]| {
            let at = _mm512_add_epi32(times(ci, i), times(cj, j));
            mask & _mm512_cmpge_epi32_mask(at, _mm512_set1_epi32(least))
        })
    } else {
        // In words as wide as what is compared, which makes it lanes.
        let mut mask = 0;
        for k in 0..16 {
            let [s, t, r] =
                sides.map(|[ci, cj, least]| ci * ((k & 3) - 1) + cj * ((k >> 2) - 1) >= least);
            mask |= u32::from(s & t & r) << k;
        }
        mask as u16
    }
}

/// Octants that the plane through `from` with normal `n` meets.
#[inline(always)]
fn plane_mask(from: [i64; 3], n: [i64; 3], shift: u32) -> u64 {
    let offset: i128 = (0..3).map(|a| i128::from(n[a]) * i128::from(from[a])).sum();
    let up: i64 = n.iter().map(|v| v.max(&0)).sum();
    let down: i64 = n.iter().map(|v| v.min(&0)).sum();
    // In units of h, the scalar product with n ranges over octant (i, j, k) from n.(i, j, k) + down to
    // n.(i, j, k) + up, and is offset / h on the plane. Beyond 4 * (up - down) < 2^62, no octant of the
    // brick meets the plane. The lanes stay below 3 * 2^60 + 2^60 + 2^62 = 2^63 in magnitude.
    let floor = offset >> shift;
    // No branch: the processor could not predict it.
    let is_near = floor.abs() <= 4 * i128::from(up - down);
    let ceil = (offset + ((1 << shift) - 1)) >> shift;
    // Octants (i, j, k) are met where `n.(i, j, k) + most >= 0` and `n.(i, j, k) + least <= 0`.
    let (most, least) = (up.wrapping_sub(ceil as i64), down.wrapping_sub(floor as i64));
    // Without signs, negative numbers are beyond `most - least >= 0`: one comparison for both.
    slab(n, most, most.wrapping_sub(least) as u64) & u64::from(is_near).wrapping_neg()
}

with_avx512! {
    /// Octants (i, j, k) where `n.(i, j, k) + most`, without sign, is at most `span`. Lanes enumerate the low bits x0, y0, z0 of the octant's
    /// index, bytes the high bits x1, y1, z1.
    fn slab(n: [i64; 3], most: i64, span: u64) -> u64 {
        let term = |a: usize, lanes: u8| _mm512_maskz_set1_epi64(lanes, n[a]);
        let low = _mm512_add_epi64(_mm512_add_epi64(term(0, 0xaa), term(1, 0xcc)), term(2, 0xf0));
        let met = |byte: i64| {
            let base = (0..3).fold(most, |sum, a| sum.wrapping_add(2 * n[a] * (byte >> a & 1)));
            let at = _mm512_add_epi64(low, _mm512_set1_epi64(base));
            u16::from(_mm512_cmple_epu64_mask(at, _mm512_set1_epi64(span as i64)))
        };
        let two = |j: i64| u32::from(_mm512_kunpackb(met(2 * j + 1), met(2 * j)));
        let four = |j: i64| u64::from(_mm512_kunpackw(two(2 * j + 1), two(2 * j)));
        _mm512_kunpackd(four(1), four(0))
    } else {
        let mut low = [0i64; 8];
        for i in 0..8usize {
            for a in 0..3 {
                low[i] += n[a] * (i >> a & 1) as i64;
            }
        }
        // A word per lane, which are united in the end.
        let mut met = [0u64; 8];
        for byte in 0..8usize {
            let base = most.wrapping_add(2 * low[byte]);
            for i in 0..8usize {
                met[i] |= u64::from(low[i].wrapping_add(base) as u64 <= span) << (8 * byte + i);
            }
        }
        met.iter().fold(0, |all, of| all | of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::{edge, position};
    use crate::wide::widths;
    use proptest::prelude::*;

    fn vertex(reach: std::ops::Range<i32>) -> impl Strategy<Value = [i32; 3]> {
        [reach.clone(), reach.clone(), reach]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// A wrong sign, rounding or clamp in any test would break this.
        #[test]
        fn crossed_octants_are_the_parents_of_those_one_level_deeper(v in [vertex(-40..3000), vertex(-40..3000), vertex(-40..3000)]) {
            let f = Facet { v };
            let l = 17;
            let h = edge(l);
            let up = crossed(&f, [0; 3], l);
            for j in 0..8 {
                let c = position(j).map(|p| 2 * h * i64::from(p));
                let fine = crossed(&f, c, l + 1);
                prop_assert_eq!(u64::from(crate::brick::parents(fine)), up >> (8 * j) & 0xff);
            }
        }

        #[test]
        fn translation_of_facet_and_brick_together_changes_nothing(v in [vertex(-5000..5000), vertex(-5000..5000), vertex(-5000..5000)], far in vertex(0..(1 << 26))) {
            let f = Facet { v };
            let moved = Facet { v: v.map(|p| [0, 1, 2].map(|a| p[a] + far[a])) };
            prop_assert_eq!(crossed(&f, [0; 3], 17), crossed(&moved, far.map(i64::from), 17));
        }

        #[test]
        fn the_facet_before_changes_nothing_and_known_octants_only_themselves(v in [vertex(-40..3000), vertex(-40..3000), vertex(-40..3000)], w in [vertex(-40..3000), vertex(-40..3000), vertex(-40..3000)], known: u64) {
            let mut tested = FacetTest::default();
            for (f, known) in [(v, 0), (w, known), (v, !known)] {
                let f = Facet { v: f };
                prop_assert_eq!(tested.octants(&f, [0; 3], 17, known) | known, crossed(&f, [0; 3], 17) | known);
            }
        }

        #[test]
        fn all_vector_widths_agree_on_the_whole_range_of_coordinates(v in [vertex(-(1 << 27)..(1 << 28)), vertex(-(1 << 27)..(1 << 28)), vertex(-(1 << 27)..(1 << 28))], l in 2u32..21, at in 0u64..64) {
            let f = Facet { v };
            let corner = position(at).map(|p| i64::from(p) << 25);
            let shift = ROOT_BITS - l;
            let masks = widths(|| separated(FacetTest::default().prepared(&f), corner, shift));
            prop_assert!(masks.iter().all(|mask| mask.1 == masks[0].1), "{:?}", masks);
        }
    }

    #[test]
    fn a_facet_in_a_face_plane_crosses_both_sides() {
        let h = edge(19) as i32;
        let f = Facet { v: [[h, 1, 1], [h, 2, 1], [h, 1, 2]] };
        assert_eq!(crossed(&f, [0; 3], 19).count_ones(), 2);
        let point = Facet { v: [[h, h, h]; 3] };
        assert_eq!(crossed(&point, [0; 3], 19), 0xff);
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let facet =
            |a: &[i128]| Facet { v: [0, 3, 6].map(|i| [0, 1, 2].map(|axis| a[i + axis] as i32)) };
        let corner = |a: &[i128]| [9, 10, 11].map(|i| a[i] as i64);
        crate::values::compare(
            "bricks/src/facet.rs",
            &[
                ("range", &|a| {
                    let (low, high) = facet(a).range(a[9] as usize);
                    vec![low.into(), high.into()]
                }),
                ("normal", &|a| facet(a).normal().map(i128::from).to_vec()),
                ("crossed", &|a| vec![crossed(&facet(a), corner(a), a[12] as Level).into()]),
                ("separated", &|a| {
                    let mut test = FacetTest::default();
                    let prepared = test.prepared(&facet(a));
                    vec![separated(prepared, corner(a), a[12] as u32).into()]
                }),
            ],
        );
    }
}
