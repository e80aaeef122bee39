//! Leaks between spacings: regions that are closed at a coarser spacing and open at that of the mesh.
use crate::case_file::Keep;
use crate::lattice::{Facet, Input, location};
use crate::octant::{LEVEL_MAX, Side};
use crate::sides::{self, Component, leaf_at};
use crate::tree::{Index, Tree};
use serde::Serialize;
use std::collections::HashSet;
use std::hash::Hash;

/// A region that has leaked, in the user's unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leak {
    /// The spacing at which the region is closed.
    pub spacing_coarse: f64,
    /// The spacing of the mesh.
    pub spacing_fine: f64,
    /// The region's volume at the coarser spacing.
    pub volume: f64,
    /// The centroid of its first leaf at that spacing.
    pub point: [f64; 3],
}

/// The leaks of T0, which is `tree` with its sides.
#[must_use]
pub fn find(tree: &Tree, input: &Input) -> Vec<Leak> {
    // Without seeds this follows from the rays.
    if !input.seeds.is_empty() && is_closed(&input.facets) {
        return Vec::new();
    }
    (1..=input.level_surface.min(2)).flat_map(|k| between(tree, input, k)).collect()
}

/// Whether every edge belongs to an even number of facets. Each facet counts once where all appear an even number of times.
fn is_closed(facets: &[Facet]) -> bool {
    let (mut once, mut odd, mut odd_edges) = (HashSet::new(), HashSet::new(), HashSet::new());
    let sorted = facets.iter().copied().map(|mut facet| {
        facet.sort_unstable();
        facet
    });
    let facets: Vec<Facet> = sorted.filter(|[a, b, c]| a != b && b != c).collect();
    for &facet in &facets {
        once.insert(facet);
        toggle(&mut odd, facet);
    }
    let counted = if odd.is_empty() { once.into_iter().collect() } else { facets };
    for edge in counted.into_iter().flat_map(|[a, b, c]| [[a, b], [b, c], [a, c]]) {
        toggle(&mut odd_edges, edge);
    }
    odd_edges.is_empty()
}

/// Inserts what is not in the set, and removes what is.
fn toggle<T: Eq + Hash>(set: &mut HashSet<T>, value: T) {
    if !set.remove(&value) {
        set.insert(value);
    }
}

/// The leaks between T0/k and T0.
fn between(tree: &Tree, input: &Input, k: u32) -> Vec<Leak> {
    let level = input.level_surface - k;
    let mut coarse = tree.cut(level);
    // If a seed lies in a crossing leaf of T0/k, rays decide.
    let by_seeds = sides::assign(&mut coarse, input, &input.seeds);
    let Ok(components) = by_seeds.or_else(|_| sides::assign(&mut coarse, input, &[])) else {
        unreachable!("only seeds can be unusable");
    };
    let leaked = |coarse: Side, fine: Side| match (coarse, fine) {
        (Side::Inside, Side::Outside) => input.seeds.is_empty() || input.keep != Keep::Inside,
        (Side::Outside, Side::Inside) => input.keep == Keep::Inside,
        _ => false,
    };
    let seeds = input.seeds.iter();
    let seeded: Vec<Index> = seeds.filter_map(|seed| leaf_at(&coarse, seed.point)).collect();
    let has_seed = |region: &Component| seeded.iter().any(|leaf| region.leaves.contains(leaf));
    let mut leaks = Vec::new();
    for component in components {
        let first = coarse.octant(component.leaves[0]);
        // All leaves of T0 within a leaf of T0/k that no facet crosses have one side.
        let within = leaf_at(tree, first.extent().min).expect("a point of the root");
        if leaked(component.side, tree.side(within)) && !has_seed(&component) {
            let edge = |level: u32| input.root.edge / f64::from(1_u32 << level);
            let volume = |level: u32| 1_u64 << (3 * (LEVEL_MAX - level));
            let levels = component.leaves.iter().map(|&leaf| coarse.octant(leaf).level);
            let leak = Leak {
                spacing_coarse: edge(level),
                spacing_fine: edge(input.level_surface),
                volume: levels.map(volume).sum::<u64>() as f64 * edge(LEVEL_MAX).powi(3),
                point: location(&input.root, first.centroid()),
            };
            leaks.push((first.coarsest_first(), leak));
        }
    }
    leaks.sort_by_key(|(first, _)| *first);
    leaks.into_iter().map(|(_, leak)| leak).collect()
}
