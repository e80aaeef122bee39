//! The leaks of T0: regions that are closed at a coarser spacing and open at that of the mesh (section 4 of reference/DEFINITION.md).

use super::components::{self, Component};
use super::facets::Facets;
use super::truth::Truth;
use crate::oracle::is_watertight;
use contract::case::Case;
use contract::manifest::Manifest;
use contract::manifest::{Keep, Leak};
use contract::octant::{LEVEL_MAX, Octant};
use contract::word::{self, Side};

/// The leaks of a case with this T0.
pub(super) fn find(case: &Case, facets: &Facets, terms: &Manifest, truth: &Truth) -> Vec<Leak> {
    if !terms.seeds.is_empty() && is_watertight(&case.facets_lattice) {
        return Vec::new();
    }
    let levels = (1..=2).filter_map(|k| terms.level_surface.checked_sub(k));
    levels.flat_map(|level| between(case, facets, terms, truth, level)).collect()
}

/// The leaks between T0 cut at a level, and T0.
fn between(case: &Case, facets: &Facets, terms: &Manifest, truth: &Truth, level: u8) -> Vec<Leak> {
    let mut cut = Manifest { level_surface: level, ..terms.clone() };
    cut.boxes.iter_mut().for_each(|b| b.level = b.level.min(level));
    let make = |terms: &Manifest| {
        let coarse = Truth::new(facets, &case.facets_lattice, terms);
        coarse.expect("T0 that is cut has no more leaves than T0")
    };
    let mut coarse = make(&cut);
    let seeded = components::seeded_leaves(&coarse.words, terms);
    let is_crossing =
        |&(leaf, _): &(u32, usize)| word::side(coarse.words[leaf as usize]) == Side::Crossing;
    if seeded.iter().any(is_crossing) {
        coarse = make(&Manifest { seeds: Vec::new(), ..cut });
    }
    let edge = |level: u8| terms.root.edge / f64::from(1u32 << level);
    let leak = |component: &Component| {
        let octants =
            component.leaves.iter().map(|&leaf| word::octant(coarse.words[leaf as usize]));
        let units: u64 = octants.map(|octant: Octant| 1 << (3 * (LEVEL_MAX - octant.level))).sum();
        Leak {
            spacing_coarse: edge(level),
            spacing_fine: edge(terms.level_surface),
            volume: units as f64 * edge(LEVEL_MAX).powi(3),
            point: terms.root.to_user(component.first.centre()),
        }
    };
    let has_leaked = |component: &&Component| {
        // All leaves of T0 within a leaf that no facet crosses have one side.
        let fine = truth.component_at(&component.first).map(|fine| fine.side);
        let leaks = match (component.side, fine) {
            (Side::Inside, Some(Side::Outside)) => {
                terms.seeds.is_empty() || terms.keep != Keep::Inside
            }
            (Side::Outside, Some(Side::Inside)) => terms.keep == Keep::Inside,
            _ => false,
        };
        leaks && components::seed_in(&component.leaves, &seeded).is_none()
    };
    let mut leaked: Vec<&Component> = coarse.components.iter().filter(has_leaked).collect();
    leaked.sort_by_key(|component| (component.first.level, word::key_of(component.first.corner)));
    leaked.into_iter().map(leak).collect()
}
