//! Whether the facets form a closed surface, a sheet, or a body with openings.
//!
//! An edge that belongs to an odd number of facets is on the boundary of the surface. The exclusive or of a hash of every edge of every facet
//! is 0 if there is none, and otherwise only by a chance of 2^-64. All rays from a point off a closed surface have the same parity, and all points of
//! a component have that parity: so a closed surface does not leak.
//!
//! A surface that closes the openings of consistently oriented facets has at least the area of the sum of their normals. If that is a
//! large part of their own area, an opening is no tear: the facets are a sheet. Facets that are oriented at random may have such a sum without
//! any opening. But a boundary of length L is closed by an area of at most L^2 / 4 pi, which must be as large, too; for consistently oriented
//! facets it is.
//!
//! Both are sums over the facets, to which each rank contributes those of its slice.

use bricks::digest::{chained, mix};
use bricks::facet::Facet;
use bricks::widest;
use ranks::{Comm, MessageBuffer, uncounted};
use std::f64::consts::PI;

/// Least ratio of the area of what closes a sheet to that of the sheet: a quarter. A hemisphere has 0.5, a box without one side 0.2.
const SHEET: f64 = 0.25;

widest! {
    /// Exclusive or of the hashes of all edges.
    fn boundary(facets: &[Facet]) -> u128 = boundary_lanes;
}

/// Many facets at a time, as the digest of the geometry.
#[inline(always)]
fn boundary_lanes(facets: &[Facet]) -> u128 {
    let (mut high, mut low) = (0, 0);
    for chunk in facets.chunks(64) {
        let mut vertices = [[0; 64]; 3];
        for (i, words) in vertices.iter_mut().enumerate() {
            for a in 0..3 {
                for (w, f) in words.iter_mut().zip(chunk) {
                    *w = chained(*w, f.v[i][a]);
                }
            }
        }
        for [from, to] in [[0, 1], [1, 2], [2, 0]] {
            for (from, to) in vertices[from].iter().zip(&vertices[to]) {
                let edge = mix(from.wrapping_add(*to));
                // An edge without length is none; so are those beyond the last facet.
                let is_edge = u64::from(from != to).wrapping_neg();
                high ^= (edge >> 64) as u64 & is_edge;
                low ^= edge as u64 & is_edge;
            }
        }
    }
    u128::from(high) << 64 | u128::from(low)
}

/// Whether the facets of all ranks, of which `mine` are this rank's, form a closed surface. Collective.
pub fn is_closed(mine: &[Facet], comm: &dyn Comm) -> bool {
    let mine = boundary(mine);
    let all = uncounted(comm, || comm.all_gather(&[(mine >> 64) as u64, mine as u64]));
    all.words().as_chunks().0.iter().fold([0; 2], |[a, b], [c, d]| [a ^ c, b ^ d]) == [0; 2]
}

/// Whether the facets of all ranks, of which `mine` are this rank's, form a sheet. Collective.
pub fn is_sheet(mine: &[Facet], comm: &dyn Comm) -> bool {
    // The sum of the normals, and that of their lengths, each rounded down.
    let mut sums = [0i128; 4];
    for f in mine {
        let normal = f.normal();
        let length = normal.iter().map(|&n| (n as f64).powi(2)).sum::<f64>().sqrt();
        (0..3).for_each(|a| sums[a] += i128::from(normal[a]));
        sums[3] += length as i128;
    }
    let words: [u64; 8] = bytemuck::cast(sums);
    let all = uncounted(comm, || comm.all_gather(&words));
    let [x, y, z, area] = all.words().as_chunks::<8>().0.iter().fold([0; 4], |sum, words| {
        let of_rank: [i128; 4] = bytemuck::cast(*words);
        std::array::from_fn(|i| sum[i] + of_rank[i])
    });
    let closing = [x, y, z].iter().map(|&n| (n as f64).powi(2)).sum::<f64>().sqrt();
    // Normals are twice as long as the areas.
    let closed_by_boundary = boundary_length(mine, comm).powi(2) / (2.0 * PI);
    closing.min(closed_by_boundary) >= SHEET * area as f64
}

/// Length of the boundary of the facets of all ranks. Collective.
fn boundary_length(mine: &[Facet], comm: &dyn Comm) -> f64 {
    let edges = mine.iter().flat_map(|f| [[0, 1], [1, 2], [2, 0]].map(|ends| ends.map(|i| f.v[i])));
    let entry = |mut ends: [[i32; 3]; 2]| {
        ends.sort_unstable();
        let words: [u64; 3] = bytemuck::cast(ends);
        // All ranks send an edge to the same rank.
        let of_all = words.iter().fold(0, |sum, &word| mix(sum ^ word) as u64);
        ((of_all % comm.size() as u64) as usize, words)
    };
    let out = MessageBuffer::of_entries(edges.map(entry).collect());
    let received = uncounted(comm, || comm.sparse_all_to_all(out));
    let mut edges: Vec<[u64; 3]> = received.values().collect();
    edges.sort_unstable();
    let on_boundary = edges.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1);
    let length = |same: &[[u64; 3]]| {
        let [from, to]: [[i32; 3]; 2] = bytemuck::cast(same[0]);
        (0..3).map(|a| (f64::from(to[a]) - f64::from(from[a])).powi(2)).sum::<f64>().sqrt() as u64
    };
    uncounted(comm, || comm.sum(on_boundary.map(length).sum())) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use ranks::{Solo, sim};

    /// Two facets of a parallelogram, whose normal is the cross product of `a` and `b`.
    fn pair(at: [i32; 3], a: [i32; 3], b: [i32; 3]) -> [Facet; 2] {
        let sum = |p: [i32; 3], q: [i32; 3]| std::array::from_fn(|i| p[i] + q[i]);
        let (pa, pb) = (sum(at, a), sum(at, b));
        let far = sum(pa, b);
        [Facet { v: [at, pa, far] }, Facet { v: [at, far, pb] }]
    }

    /// The six faces of a cube, outwards.
    fn cube() -> Vec<[Facet; 2]> {
        let e = 1 << 20;
        let axes = [[e, 0, 0], [0, e, 0], [0, 0, e]];
        let face = |a: usize| {
            let (u, w) = (axes[(a + 1) % 3], axes[(a + 2) % 3]);
            [pair(axes[a], u, w), pair([0; 3], w, u)]
        };
        [0, 1, 2].into_iter().flat_map(face).collect()
    }

    /// Whether some faces are closed, and whether they are a sheet; the same on any number of ranks and in all vector widths.
    fn kind(faces: &[[Facet; 2]]) -> (bool, bool) {
        let facets = faces.as_flattened();
        let of = |mine: &[Facet], comm: &dyn Comm| (is_closed(mine, comm), is_sheet(mine, comm));
        let alone = of(facets, &Solo);
        let slice = |rank: usize| &facets[facets.len() * rank / 3..facets.len() * (rank + 1) / 3];
        let among = sim::run(3, 1, |comm| of(slice(comm.rank()), comm));
        assert_eq!(among, [alone; 3]);
        let widths = bricks::wide::widths(|| boundary(facets));
        assert!(widths.iter().all(|(_, found)| *found == widths[0].1));
        alone
    }

    #[test]
    fn closed_surfaces_sheets_and_open_bodies_are_distinguished() {
        const CLOSED: (bool, bool) = (true, false);
        const SHEET: (bool, bool) = (false, true);
        const OPEN: (bool, bool) = (false, false);
        let cube = cube();
        assert_eq!(kind(&cube), CLOSED);
        let mut many = cube.repeat(31);
        assert_eq!(kind(&many), CLOSED, "more than fit into a chunk");
        many.pop();
        assert_eq!(kind(&many), OPEN);
        for missing in 0..6 {
            let mut faces = cube.clone();
            faces.remove(missing);
            assert_eq!(kind(&faces), OPEN, "a box without a lid");
            assert_eq!(kind(&cube[missing..=missing]), SHEET);
            let lid = cube[missing][0];
            faces.push([lid, Facet { v: [lid.v[0]; 3] }]);
            assert_eq!(kind(&faces), OPEN, "one facet is missing, and one is a point");
        }
        assert_eq!(kind(&cube[..4]), OPEN, "the normals of a tube's ends cancel");
        let mut turned = cube.clone();
        turned[2][0].v.swap(0, 1);
        assert_eq!(kind(&turned), CLOSED, "whatever the orientation");
        let mut torn = cube.clone();
        torn[0][1] = Facet { v: [[0; 3]; 3] };
        torn[2].iter_mut().for_each(|f| f.v.swap(0, 1));
        assert_eq!(kind(&torn), OPEN, "a side is turned, and the tear is small");
    }
}
