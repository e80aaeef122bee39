//! Shells: components of facets that are connected by shared edges.

use serde::Serialize;

use super::edges::Edges;

/// A shell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Shell {
    /// Index of the first facet.
    pub facet_first: u32,
    /// Number of facets.
    pub facets: u32,
    /// Whether an even number of facets meets at every edge, so that rays agree about the inside.
    pub is_closed: bool,
}

/// All shells, largest first. A facet with a repeated vertex belongs to none.
pub fn shells(edges: &Edges) -> Vec<Shell> {
    let mut parents: Vec<u32> = (0..edges.corners.len() as u32).collect();
    for (_, mut uses) in edges.iter() {
        let Some(first) = uses.next() else { continue };
        uses.for_each(|other| unite(&mut parents, first.facet, other.facet));
    }
    let mut shells: Vec<Shell> = Vec::new();
    let mut index = vec![u32::MAX; parents.len()];
    for (facet, &[a, b, c]) in edges.corners.iter().enumerate() {
        if a == b || b == c || c == a {
            continue;
        }
        let facet = facet as u32;
        let root = find(&mut parents, facet) as usize;
        if index[root] == u32::MAX {
            index[root] = shells.len() as u32;
            shells.push(Shell { facet_first: facet, facets: 0, is_closed: true });
        }
        shells[index[root] as usize].facets += 1;
    }
    for (_, mut uses) in edges.iter() {
        if uses.len() % 2 == 1
            && let Some(first) = uses.next()
        {
            let root = find(&mut parents, first.facet) as usize;
            shells[index[root] as usize].is_closed = false;
        }
    }
    shells.sort_by_key(|shell| (std::cmp::Reverse(shell.facets), shell.facet_first));
    shells
}

/// The representative of a set; halves the path to it.
pub(crate) fn find(parents: &mut [u32], mut of: u32) -> u32 {
    while parents[of as usize] != of {
        let above = parents[parents[of as usize] as usize];
        parents[of as usize] = above;
        of = above;
    }
    of
}

/// Unites the sets of two members under the lower representative.
pub(crate) fn unite(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}
