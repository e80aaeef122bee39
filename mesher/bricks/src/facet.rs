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
//!   vertices are at most 3 * 2^27 in magnitude. The brick's corner has coordinates in [0, 2^27]. So
//!   coordinates of vertices relative to it are at most 2^28 in magnitude, and those of the corner of a
//!   square relative to a vertex at most 3 * 2^27, too.
//! - *Edge functions.* `eu * qw - ew * qu` is a difference of two products of such numbers: at most
//!   18 * 2^54 < 2^59 in magnitude, which fits i64.
//! - *Plane.* So are the three components of the normal; the sum of their magnitudes is below 2^60. The
//!   scalar product of the normal with a vertex is computed in i128.
//! - *Scaling.* Octant corners are `h` times small integers (i, j, k), so each test has the form
//!   `h * m + c >= 0` with integers `m` and `c`. As `m` is an integer, this is equivalent to
//!   `m + floor(c / h) >= 0`. Since `h` is a power of two, the floor is an arithmetic shift. Constants are
//!   therefore shifted first, and the lanes evaluate `m + floor(c / h)` in i64 for all octants.

use crate::brick::SPANS;
use crate::octant::{Level, ROOT_BITS};
use bytemuck::{Pod, Zeroable};

/// A facet on the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
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
    let mut half = 0;
    while half < 2 {
        let mut m = 0;
        while m < 256 {
            let mut k = 0;
            while k < 8 {
                if m >> k & 1 == 1 {
                    let (i, j) = (k & 3, 2 * half + (k >> 2));
                    table[half][m] |= u[i][i] & w[j][j];
                }
                k += 1;
            }
            m += 1;
        }
        half += 1;
    }
    table
}

/// Mask of the octants of level `l` that the facet crosses, in the brick with minimum corner `corner`
/// (lattice units).
#[inline]
pub fn crossed(f: &Facet, corner: [i64; 3], l: Level) -> u64 {
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
    if wide < 2 { mask } else { mask & kernel::separated(f, corner, shift) }
}

/// The ten tests by plane and edges, in the widest vectors that the processor supports.
mod kernel {
    use super::{COLUMNS, Facet};

    /// Octants that neither the normal nor a cross product separates from the facet. To be intersected with the
    /// mask of the coordinate axes.
    #[inline]
    pub fn separated(f: &Facet, corner: [i64; 3], shift: u32) -> u64 {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            // SAFETY: the features that the function is compiled for have just been detected.
            return unsafe { avx512::separated(f, corner, shift) };
        }
        generic(f, corner, shift, plane_lanes, edge_lanes)
    }

    /// The tests, with the evaluation of lanes as parameters: all vector widths share the rest.
    #[inline(always)]
    pub fn generic(
        f: &Facet,
        corner: [i64; 3],
        shift: u32,
        plane: impl Fn([i64; 3], i64, i64) -> u64,
        edge: impl Fn(i64, i64, i64) -> [u8; 2],
    ) -> u64 {
        let p = f.v.map(|v| [0, 1, 2].map(|a| i64::from(v[a]) - corner[a]));
        let n = f.normal();
        let mut mask = plane_mask(&p, n, shift, plane);
        for a in 0..3 {
            let (u, w) = ((a + 1) % 3, (a + 2) % 3);
            if n[a] == 0 {
                mask &= degenerate_mask(&p, a, shift, &edge);
                continue;
            }
            let sign = n[a].signum();
            for i in 0..3 {
                let (from, to) = (p[i], p[(i + 1) % 3]);
                mask &= half_plane(
                    from,
                    (to[u] - from[u]) * sign,
                    (to[w] - from[w]) * sign,
                    a,
                    shift,
                    &edge,
                );
            }
        }
        mask
    }

    /// Octants whose projection along `a` meets the closed half-plane left of the directed line through
    /// `from`.
    #[inline(always)]
    fn half_plane(
        from: [i64; 3],
        eu: i64,
        ew: i64,
        a: usize,
        shift: u32,
        edge: &impl Fn(i64, i64, i64) -> [u8; 2],
    ) -> u64 {
        let (u, w) = ((a + 1) % 3, (a + 2) % 3);
        // The edge function eu * (q_w - from_w) - ew * (q_u - from_u), at its greatest over the first square.
        let h = 1i64 << shift;
        let qw = if eu > 0 { h - from[w] } else { -from[w] };
        let qu = if ew < 0 { h - from[u] } else { -from[u] };
        let c = (eu * qw - ew * qu) >> shift;
        let [low, high] = edge(-ew, eu, c);
        COLUMNS[a][0][low as usize] | COLUMNS[a][1][high as usize]
    }

    /// Octants whose projection along `a` meets the line of a projected facet without area. The longest edge
    /// gives the line's direction.
    #[inline(always)]
    fn degenerate_mask(
        p: &[[i64; 3]; 3],
        a: usize,
        shift: u32,
        edge: &impl Fn(i64, i64, i64) -> [u8; 2],
    ) -> u64 {
        let (u, w) = ((a + 1) % 3, (a + 2) % 3);
        let mut best = (0i64, 0i64, p[0]);
        for i in 0..3 {
            let (from, to) = (p[i], p[(i + 1) % 3]);
            let (eu, ew) = (to[u] - from[u], to[w] - from[w]);
            if eu.abs() + ew.abs() > best.0.abs() + best.1.abs() {
                best = (eu, ew, from);
            }
        }
        let (eu, ew, from) = best;
        half_plane(from, eu, ew, a, shift, edge) & half_plane(from, -eu, -ew, a, shift, edge)
    }

    /// Octants that the facet's plane meets.
    #[inline(always)]
    fn plane_mask(
        p: &[[i64; 3]; 3],
        n: [i64; 3],
        shift: u32,
        plane: impl Fn([i64; 3], i64, i64) -> u64,
    ) -> u64 {
        let offset: i128 = (0..3).map(|a| i128::from(n[a]) * i128::from(p[0][a])).sum();
        let up: i64 = n.iter().map(|v| v.max(&0)).sum();
        let down: i64 = n.iter().map(|v| v.min(&0)).sum();
        // In units of h, the scalar product with n ranges over octant (i, j, k) from n.(i, j, k) + down to
        // n.(i, j, k) + up, and is offset / h on the plane. Beyond 4 * (up - down) < 2^62, no octant of the
        // brick meets the plane; so clamping the offset there changes no comparison. The lanes stay
        // below 3 * 2^60 + 2^60 + 2^62 = 2^63 in magnitude.
        let bound = 4 * i128::from(up - down) + 4;
        let clamp = |v: i128| v.clamp(-bound, bound) as i64;
        let floor = clamp(offset >> shift);
        let ceil = clamp(-((-offset) >> shift));
        plane(n, up - ceil, down - floor)
    }

    /// Mask of the octants (i, j, k) where `n.(i, j, k) + most >= 0` and `n.(i, j, k) + least <= 0`.
    #[inline(always)]
    pub fn plane_lanes(n: [i64; 3], most: i64, least: i64) -> u64 {
        // Lanes enumerate the low bits x0, y0, z0 of the octant's index, bytes the high bits x1, y1, z1.
        let mut low = [0i64; 8];
        for i in 0..8usize {
            for a in 0..3 {
                low[i] += n[a] * (i >> a & 1) as i64;
            }
        }
        let mut outside = 0;
        for byte in 0..8usize {
            let base = 2 * low[byte];
            for i in 0..8usize {
                let v = low[i] + base;
                let misses = (v + most < 0) | (v + least > 0);
                outside |= u64::from(misses) << (8 * byte + i);
            }
        }
        !outside
    }

    /// Mask of the squares (i, j), i fastest, where `ci * i + cj * j + c >= 0`, as two bytes.
    #[inline(always)]
    pub fn edge_lanes(ci: i64, cj: i64, c: i64) -> [u8; 2] {
        let mut halves = [0; 2];
        for k in 0..16usize {
            let v = ci * (k & 3) as i64 + cj * (k >> 2) as i64 + c;
            halves[k >> 3] |= u8::from(v >= 0) << (k & 7);
        }
        halves
    }

    /// Eight i64 lanes at a time.
    #[cfg(target_arch = "x86_64")]
    mod avx512 {
        use super::Facet;
        use std::arch::x86_64::*;

        #[target_feature(enable = "avx512f,avx512dq")]
        pub fn separated(f: &Facet, corner: [i64; 3], shift: u32) -> u64 {
            super::generic(
                f,
                corner,
                shift,
                |n, most, least| plane(n, most, least),
                |ci, cj, c| edge(ci, cj, c),
            )
        }

        #[inline]
        #[target_feature(enable = "avx512f,avx512dq")]
        fn plane(n: [i64; 3], most: i64, least: i64) -> u64 {
            let lane = |m: u8, v: i64| _mm512_maskz_set1_epi64(m, v);
            // Lanes enumerate the low bits x0, y0, z0 of the octant's index, bytes the high bits x1, y1, z1.
            let low = _mm512_add_epi64(
                _mm512_add_epi64(lane(0xaa, n[0]), lane(0xcc, n[1])),
                lane(0xf0, n[2]),
            );
            let (most, least) = (
                _mm512_add_epi64(low, _mm512_set1_epi64(most)),
                _mm512_add_epi64(low, _mm512_set1_epi64(least)),
            );
            let mut mask = 0;
            for byte in 0..8i64 {
                let base = 2 * (n[0] * (byte & 1) + n[1] * (byte >> 1 & 1) + n[2] * (byte >> 2));
                // v + most >= 0 and v + least <= 0, with the byte's part of v on the right-hand side.
                let m = _mm512_cmpge_epi64_mask(most, _mm512_set1_epi64(-base));
                let m = _mm512_mask_cmple_epi64_mask(m, least, _mm512_set1_epi64(-base));
                mask |= u64::from(m) << (8 * byte);
            }
            mask
        }

        #[inline]
        #[target_feature(enable = "avx512f,avx512dq")]
        fn edge(ci: i64, cj: i64, c: i64) -> [u8; 2] {
            let step =
                _mm512_setr_epi64(0, ci, 2 * ci, 3 * ci, cj, ci + cj, 2 * ci + cj, 3 * ci + cj);
            let low = _mm512_cmpge_epi64_mask(step, _mm512_set1_epi64(-c));
            let high = _mm512_cmpge_epi64_mask(step, _mm512_set1_epi64(-c - 2 * cj));
            [low, high]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octant::{edge, position};
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
        fn all_vector_widths_agree_on_the_whole_range_of_coordinates(v in [vertex(-(1 << 27)..(1 << 28)), vertex(-(1 << 27)..(1 << 28)), vertex(-(1 << 27)..(1 << 28))], l in 2u32..21, at in 0u64..64) {
            let f = Facet { v };
            let corner = position(at).map(|p| i64::from(p) << 25);
            let shift = ROOT_BITS - l;
            let portable = kernel::generic(&f, corner, shift, kernel::plane_lanes, kernel::edge_lanes);
            prop_assert_eq!(kernel::separated(&f, corner, shift), portable);
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
                    vec![kernel::separated(&facet(a), corner(a), a[12] as u32).into()]
                }),
            ],
        );
    }
}
