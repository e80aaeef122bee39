//! Vertices and edges that facets share, by sorting.
//!
//! Facets with a repeated vertex are left out: they add an even number of facets to the one edge that they have, and no ray counts
//! them. So are slivers, which have no area on the lattice, if another sliver has the same vertices, or if at most one of their edges has
//! other facets: their edges lie on one another.

use contract::case::Facet;
use contract::lattice::{self, FacetLattice, normal, sorted};
use serde::Serialize;
use std::cell::LazyCell;
use std::collections::{BTreeMap, HashMap, HashSet};

use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::tree::{Aabb, FacetTree, Point, TOUCHING, from_point};

/// One facet at an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Use {
    /// The vertices of the edge, lower first.
    pub ends: [u32; 2],
    /// The facet.
    pub facet: u32,
    /// Whether the facet traverses the edge from its higher to its lower vertex.
    pub is_down: bool,
}

/// The edges by the number of their facets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct EdgeCounts {
    /// All edges.
    pub all: u64,
    /// With one facet.
    pub open: u64,
    /// With two facets of consistent winding.
    pub paired: u64,
    /// With two facets of opposite winding.
    pub flipped: u64,
    /// With three, five, ... facets.
    pub odd: u64,
    /// With four, six, ... facets.
    pub even: u64,
    /// Facets at edges with more than two.
    pub facets_non_manifold: u64,
}

/// Vertices by number, and the facets at every edge.
pub struct Edges {
    /// Vertex numbers of every facet, in ascending order of coordinate bits; none of one that is left out.
    pub corners: Vec<Option<[u32; 3]>>,
    /// Coordinates of the vertices, in the user's units.
    pub points: Vec<[f64; 3]>,
    /// Sorted.
    uses: Vec<Use>,
}

impl Edges {
    /// Numbers the vertices and sorts the edges of at most 2^31 / 3 finite facets, which are also given on the lattice.
    pub fn new(facets: &[Facet], lattice: &[FacetLattice]) -> Self {
        let (numbers, points) = number(facets);
        let is_sliver = |facet: u32| normal(&lattice[facet as usize]) == [0; 3];
        // One of the copies is not left out: whichever the order of the facets, one that winds upward, if there is any.
        let winds_down = |&[a, b, c]: &[u32; 3]| (a < b) ^ (b < c) ^ (c < a);
        let slivers = numbers.iter().zip(0..).filter(|(_, facet)| is_sliver(*facet));
        let mut slivers: Vec<_> =
            slivers.map(|(at, facet)| (sorted(*at), winds_down(at), facet)).collect();
        slivers.sort_unstable();
        slivers.dedup_by_key(|(at, ..)| *at);
        let mut queue: Vec<u32> = slivers.into_iter().map(|(.., facet)| facet).collect();
        let first: HashSet<u32> = queue.iter().copied().collect();
        let mut corners = vec![None; facets.len()];
        let mut uses = Vec::with_capacity(3 * facets.len());
        for (&[a, b, c], facet) in numbers.iter().zip(0..) {
            if a == b || b == c || c == a || is_sliver(facet) && !first.contains(&facet) {
                continue;
            }
            corners[facet as usize] = Some([a, b, c]);
            for ends in lattice::edges(&[a, b, c]) {
                uses.push(Use { ends: sorted(ends), facet, is_down: ends[0] > ends[1] });
            }
        }
        // At the edges of slivers: the number of facets, and the exclusive or of their numbers, which is the last one of them.
        let of_slivers = uses.iter().filter(|one| is_sliver(one.facet));
        let mut left: HashMap<_, (u32, u32)> = of_slivers.map(|one| (one.ends, (0, 0))).collect();
        for one in &uses {
            let of_sliver = left.entry(one.ends);
            of_sliver.and_modify(|(count, of)| (*count, *of) = (*count + 1, *of ^ one.facet));
        }
        // A sliver that is left out leaves edges to others.
        while let Some(facet) = queue.pop() {
            let Some(at) = corners[facet as usize] else { continue };
            let ends = lattice::edges(&at).map(sorted);
            if ends.iter().filter(|ends| left[*ends].0 == 1).count() < 2 {
                continue;
            }
            corners[facet as usize] = None;
            for ends in ends {
                let (count, of) = left[&ends];
                left.insert(ends, (count - 1, of ^ facet));
                queue.extend(Some(of ^ facet).filter(|other| count == 2 && is_sliver(*other)));
            }
        }
        uses.retain(|one| corners[one.facet as usize].is_some());
        uses.sort_unstable();
        Self { corners, points, uses }
    }

    /// The facets at every edge.
    pub fn iter(&self) -> impl Iterator<Item = &[Use]> {
        self.uses.chunk_by(|a, b| a.ends == b.ends)
    }

    /// The edges by the number of their facets.
    pub fn counts(&self) -> EdgeCounts {
        let mut counts = EdgeCounts::default();
        for uses in self.iter() {
            let facets = uses.len();
            let down = uses.iter().filter(|facet| facet.is_down).count();
            counts.all += 1;
            *match facets {
                1 => &mut counts.open,
                2 if down == 1 => &mut counts.paired,
                2 => &mut counts.flipped,
                _ if facets % 2 == 1 => &mut counts.odd,
                _ => &mut counts.even,
            } += 1;
            counts.facets_non_manifold += if facets > 2 { facets as u64 } else { 0 };
        }
        counts
    }
}

/// Numbers the distinct vertices, in their order. Returns the numbers of every facet's corners, and the vertices.
fn number(facets: &[Facet]) -> (Vec<[u32; 3]>, Vec<[f64; 3]>) {
    // Adding zero turns -0 into 0.
    let bits = facets.as_flattened().iter().map(|v| v.map(|x| (x + 0.0).to_bits()));
    let mut sorted: Vec<([u32; 3], u32)> = bits.zip(0..).collect();
    sorted.sort_unstable();
    let (mut numbers, mut points) = (vec![[0; 3]; facets.len()], Vec::new());
    for same in sorted.chunk_by(|a, b| a.0 == b.0) {
        let number = points.len() as u32;
        same.iter().for_each(|&(_, corner)| numbers.as_flattened_mut()[corner as usize] = number);
        points.push(same[0].0.map(|bits| f32::from_bits(bits).into()));
    }
    (numbers, points)
}

/// Edges with an odd number of facets, more than one, and pairs of neighbours with inconsistent winding.
pub fn findings(edges: &Edges, first: usize) -> [Finding; 2] {
    let mut findings = [Kind::NonManifoldOdd, Kind::Winding].map(Finding::new);
    for uses in edges.iter() {
        let at = match uses {
            [a, b] if a.is_down == b.is_down => 1,
            [_, _, _, ..] if uses.len() % 2 == 1 => 0,
            _ => continue,
        };
        findings[at].add(first, || {
            let [p, q] = uses[0].ends.map(|v| edges.points[v as usize]);
            let middle = std::array::from_fn(|a| (p[a] + q[a]) / 2.0);
            Place::new(uses.iter().map(|u| u.facet).collect(), middle)
        });
    }
    findings
}

/// Facets without area with a corner, or the middle of an edge, on no facet with area, as where a strip of triangles continues elsewhere. One
/// on the others, as of a T-junction, changes nothing.
pub fn stray(input: &Input, first: usize) -> Finding {
    let has_area = |facet: &&FacetLattice| normal(facet) != [0; 3];
    let all = &input.case.facets_lattice;
    // Without slivers, of which any number may lie on one another.
    let tree =
        LazyCell::new(|| FacetTree::new(&all.iter().filter(has_area).copied().collect::<Vec<_>>()));
    let is_off = |[p, q]: [[i64; 3]; 2]| {
        let middle = Point::from_array([0, 1, 2].map(|a| (p[a] + q[a]) as f64 / 2.0));
        let around = Aabb::from_half_extents(middle, Point::splat(TOUCHING));
        !tree.in_box(&around).any(|facet| from_point(middle, tree.triangle(facet)) <= TOUCHING)
    };
    Finding::at(Kind::Stray, input, first, |facet| {
        let corners = &all[facet as usize];
        let mut ends = lattice::edges(corners).into_iter().chain(corners.map(|at| [at, at]));
        !has_area(&corners) && ends.any(is_off)
    })
}

/// Facets with the vertices of an earlier facet. Rays pass an odd number of them like one. Two with a solid behind each, by the numbers of
/// `solids`, are where solids touch: a wall. A facet that is left out of the edges is no duplicate.
pub fn duplicates(input: &Input, of: &Edges, solids: &BTreeMap<u32, i64>, first: usize) -> Finding {
    let mut finding = Finding::new(Kind::Duplicates);
    let mut copies: HashMap<_, Vec<u32>> = HashMap::new();
    for (corners, facet) in of.corners.iter().zip(0u32..) {
        let Some(corners) = corners.map(sorted) else { continue };
        let copies = copies.entry(corners).or_default();
        copies.push(facet);
        if copies[0] != facet {
            finding.add(first, || Place::new(vec![copies[0], facet], input.centroid(facet)));
        }
    }
    let is_within = |facet: &u32| solids.get(facet).is_some_and(|count| count % 2 == 1);
    let touch = |copies: &[u32]| copies.len() == 2 && copies.iter().all(&is_within);
    let are_rays_counted = input.are_seeds_beyond != Some(true);
    let is_meshed = |copies: &[u32]| input.are_walls_meshed() || are_rays_counted && !touch(copies);
    let changing = copies.values().filter(|copies| copies.len() % 2 == 0 && is_meshed(copies));
    finding.count_changing = changing.map(|copies| copies.len() as u64 - 1).sum();
    finding
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: [f32; 3] = [0.0; 3];
    const B: [f32; 3] = [1.0, 0.0, 0.0];
    const C: [f32; 3] = [0.0, 1.0, 0.0];
    const D: [f32; 3] = [0.0, 0.0, 1.0];

    fn edges(facets: &[Facet]) -> Edges {
        let lattice = facets.iter().map(|facet| facet.map(|v| v.map(|c| c as i64)));
        Edges::new(facets, &lattice.collect::<Vec<_>>())
    }

    fn sizes(facets: &[Facet]) -> Vec<usize> {
        let mut sizes: Vec<usize> = edges(facets).iter().map(<[Use]>::len).collect();
        sizes.sort_unstable();
        sizes
    }

    #[test]
    fn facets_share_edges_in_either_direction() {
        assert_eq!(sizes(&[[A, C, B], [A, B, D], [A, D, C], [B, C, D]]), [2; 6]);
        assert_eq!(sizes(&[[A, B, C], [A, B, D], [B, A, [0.0, -1.0, 0.0]]]), [1, 1, 1, 1, 1, 1, 3]);
    }

    #[test]
    fn the_two_zeros_are_one_vertex() {
        let edges = edges(&[[A, B, C], [[-0.0, 0.0, -0.0], C, D]]);
        let first = |facet: usize| edges.corners[facet].map(|corners| corners[0]);
        assert_eq!((edges.points.len(), first(0)), (4, first(1)));
    }

    #[test]
    fn a_facet_with_a_repeated_vertex_has_no_edges() {
        assert!(sizes(&[[A, B, A], [C, C, C]]).is_empty());
    }

    /// Copies of a sliver, and chains of slivers, lie on the edge at their end.
    #[test]
    fn slivers_that_end_at_one_edge_have_no_edges() {
        let [p, q, r] = [4.0, 6.0, 8.0].map(|x| [x, 0.0, 0.0]);
        let (sliver, chained) = ([A, p, r], [p, r, q]);
        let solid = [[A, C, r], [A, r, D], [A, D, C], [r, C, D]];
        for slivers in
            [&[sliver][..], &[sliver; 4], &[sliver, chained], &[chained, chained, sliver]]
        {
            assert_eq!(sizes(&[&solid[..], slivers].concat()), [2; 6], "{slivers:?}");
        }
        // One between a facet's edge and its parts stays, but not its copy nor what ends at it; a fin at a part of one has three facets.
        let stitched = [[A, C, r], [A, p, D], [p, r, D], [A, D, C], [r, C, D]];
        assert_eq!(sizes(&[&stitched[..], &[sliver, sliver, chained]].concat()), [2; 9]);
        let fin = sizes(&[&solid[..], &[sliver, [p, r, [0.0, 0.0, -9.0]]]].concat());
        assert_eq!(fin[fin.len() - 1], 3);
    }
}
