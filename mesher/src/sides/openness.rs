//! Whether the facets form a closed surface, a sheet, or a body with openings.
//!
//! An edge that belongs to an odd number of facets is on the boundary of the surface. The exclusive or of a hash of every edge of every facet
//! is 0 if there is none, and otherwise only by a chance of 2^-64. All rays from a point off a closed surface have the same parity, and all points of
//! a component have that parity: so a closed surface does not leak. Where every facet appears an even number of times, so does every edge,
//! whatever the openings: each facet counts once, then.
//!
//! A surface that closes the openings of consistently oriented facets has at least the area of the sum of their normals. If that is a
//! large part of their own area, an opening is no tear: the facets are a sheet. Facets that are turned may have such a sum without any
//! large opening. So the loops of the boundary must enclose as much, too, which they do if the facets are oriented consistently.
//!
//! Both are sums over the facets, to which each rank contributes those of its slice.

use bricks::digest::{chained, mix};
use bricks::facet::Facet;
use bytemuck::Pod;
use ranks::{Comm, MessageBuffer, gather, uncounted};
use std::collections::{BTreeMap, BTreeSet};

type Vertex = [i32; 3];

/// A boundary of more edges than this is not searched for loops: a soup of facets without common edges.
const EDGES_MAX: u64 = (1 << 23) / 3;
/// Least ratio of the area of what closes a sheet to that of the sheet: a quarter. A hemisphere has 0.5, a box without one side 0.2.
const SHEET: f64 = 0.25;

/// Whether the facets of all ranks, of which `mine` are this rank's, form a closed surface, and whether each appears an even number of times.
/// Collective.
pub fn closed_and_doubled(mine: &[Facet], comm: &dyn Comm) -> [bool; 2] {
    let xor = |[facets, edges]: [u128; 2], of: [u128; 2]| [facets ^ of[0], edges ^ of[1]];
    let hashes = mine.iter().filter_map(hashes);
    let [facets, edges] = over_ranks(hashes.clone().fold([0; 2], xor), xor, comm);
    if [facets, edges] != [0; 2] {
        return [edges == 0, false];
    }
    // Each facet counts once. All ranks send it to the same rank.
    let entry =
        |of: [u128; 2]| ((of[0] % comm.size() as u128) as usize, bytemuck::cast::<_, [u64; 4]>(of));
    let out = MessageBuffer::of_entries(hashes.map(entry).collect());
    let mut once: Vec<[u64; 4]> = uncounted(comm, || comm.sparse_all_to_all(out)).values();
    once.sort_unstable();
    once.dedup();
    let edges = once.into_iter().map(bytemuck::cast).fold([0; 2], xor);
    [over_ranks(edges, xor, comm)[1] == 0, true]
}

/// A hash of a facet, and the exclusive or of those of its edges; none of one with two equal vertices, whose edges cancel.
fn hashes(f: &Facet) -> Option<[u128; 2]> {
    let [a, b, c] = f.v.map(|v| v.iter().fold(0, |sum, &c| chained(sum, c)));
    let edge = |from: u64, to| mix(from.wrapping_add(to));
    let facet = || [mix(a.wrapping_add(b).wrapping_add(c)), edge(a, b) ^ edge(b, c) ^ edge(c, a)];
    (a != b && b != c && c != a).then(facet)
}

/// The value that `merge` makes of those of all ranks. Collective.
fn over_ranks<T: Pod>(mine: T, merge: impl Fn(T, T) -> T, comm: &dyn Comm) -> T {
    uncounted(comm, || gather(comm, &[mine])).into_iter().reduce(merge).expect("a rank")
}

/// Whether the facets of all ranks, of which `mine` are this rank's, form a sheet. Collective.
pub fn is_sheet(mine: &[Facet], comm: &dyn Comm) -> bool {
    // The sum of the normals, and that of their lengths, each rounded down.
    let mut sums = [0i128; 4];
    for f in mine {
        let normal = f.normal().map(i128::from);
        (0..3).for_each(|a| sums[a] += normal[a]);
        sums[3] += length(normal) as i128;
    }
    let add = |sum: [i128; 4], of: [i128; 4]| std::array::from_fn(|i| sum[i] + of[i]);
    let [x, y, z, area] = over_ranks(sums, add, comm);
    length([x, y, z]).min(enclosed_by_boundary(mine, comm)) >= SHEET * area as f64 && area > 0
}

/// Twice the area that the boundary of the facets of all ranks encloses: of each of its loops, the vector area. Collective.
fn enclosed_by_boundary(mine: &[Facet], comm: &dyn Comm) -> f64 {
    let edges = mine.iter().flat_map(|f| [[0, 1], [1, 2], [2, 0]].map(|ends| ends.map(|i| f.v[i])));
    let entry = |mut ends: [Vertex; 2]| {
        ends.sort_unstable();
        let words: [u64; 3] = bytemuck::cast(ends);
        // All ranks send an edge to the same rank.
        let hash = words.iter().fold(0, |sum, &word| mix(sum ^ word) as u64);
        ((hash % comm.size() as u64) as usize, words)
    };
    let out = edges.filter(|[from, to]| from != to).map(entry).collect();
    let received = uncounted(comm, || comm.sparse_all_to_all(MessageBuffer::of_entries(out)));
    let mut edges: Vec<[u64; 3]> = received.values();
    edges.sort_unstable();
    let odd = edges.chunk_by(|a, b| a == b).filter(|same| same.len() % 2 == 1);
    let odd: Vec<[u64; 3]> = odd.map(|same| same[0]).collect();
    if uncounted(comm, || comm.sum(odd.len() as u64)) > EDGES_MAX {
        return f64::INFINITY;
    }
    enclosed(uncounted(comm, || gather(comm, &odd)).into_iter().map(bytemuck::cast))
}

/// Twice the area that the closed loops of some edges enclose: of each loop, the vector area. An even number of edges meets in every vertex.
fn enclosed(edges: impl Iterator<Item = [Vertex; 2]>) -> f64 {
    let mut ends: BTreeMap<Vertex, BTreeSet<Vertex>> = BTreeMap::new();
    for [from, to] in edges {
        ends.entry(from).or_default().insert(to);
        ends.entry(to).or_default().insert(from);
    }
    let mut total = 0.0;
    let vertices: Vec<Vertex> = ends.keys().copied().collect();
    for start in vertices {
        while let Some(mut to) = ends.get_mut(&start).and_then(BTreeSet::pop_first) {
            let (mut sum, mut from) = ([0; 3], start);
            loop {
                let of = ends.get_mut(&to).expect("every end is a vertex");
                of.remove(&from);
                let normal = Facet { v: [start, from, to] }.normal();
                (0..3).for_each(|a| sum[a] += i128::from(normal[a]));
                if to == start {
                    break;
                }
                from = to;
                to = of.pop_first().expect("an even number of edges meets in a vertex");
            }
            total += length(sum);
        }
    }
    total
}

/// The length of a vector.
fn length(v: [i128; 3]) -> f64 {
    v.iter().map(|&n| (n as f64).powi(2)).sum::<f64>().sqrt()
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

    /// Whether some faces are closed and doubled, and whether they are a sheet; the same on any number of ranks.
    fn kind(faces: &[[Facet; 2]]) -> ([bool; 2], bool) {
        let facets = faces.as_flattened();
        let of = |mine: &[Facet], comm: &dyn Comm| {
            (closed_and_doubled(mine, comm), is_sheet(mine, comm))
        };
        let alone = of(facets, &Solo);
        let slice = |rank: usize| &facets[facets.len() * rank / 3..facets.len() * (rank + 1) / 3];
        let among = sim::run(3, 1, |comm| of(slice(comm.rank()), comm));
        assert_eq!(among, [alone; 3]);
        alone
    }

    #[test]
    fn closed_surfaces_sheets_and_open_bodies_are_distinguished() {
        const CLOSED: ([bool; 2], bool) = ([true, false], false);
        const SHEET: ([bool; 2], bool) = ([false; 2], true);
        const OPEN: ([bool; 2], bool) = ([false; 2], false);
        let cube = cube();
        assert_eq!(kind(&cube), CLOSED);
        let mut many = cube.repeat(31);
        assert_eq!(kind(&many), CLOSED, "31 copies");
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
        let twice = [&cube[..], &turned].concat();
        let point = Facet { v: [[0; 3]; 3] };
        assert_eq!(kind(&[&twice[..], &[[point; 2]]].concat()), ([true; 2], false));
        assert_eq!(
            kind(&[&cube[1..], &turned[1..]].concat()),
            ([false, true], false),
            "without a lid"
        );
        assert_eq!(kind(&[&twice[..], &cube].concat()), CLOSED, "three times");
    }
}
