//! Warnings: meshes that follow the rules and are probably not what the user wants.

use crate::input::lattice::{ExtentBox, Keep};
use crate::mesh::Mesh;
use crate::output::report::leaks::LeakEntry;
use crate::sides::Summary;
use bricks::octant::ROOT_EDGE;

/// A sentence for each warning: what was found, and what to try.
pub fn of(mesh: &Mesh) -> Vec<String> {
    if mesh.is_base {
        return Vec::new();
    }
    let has_seeds = !mesh.rules.seeds.is_empty();
    let summary = &mesh.sides.summary;
    let empty = empty_region(mesh.rules.keep, summary);
    // These two already advise to enlarge the root.
    let explains_cut = empty.is_some() || summary.inside_reaches_boundary;
    let facets_cut = if explains_cut { 0 } else { mesh.facets.beyond_root };
    let has_effect = |b: &&ExtentBox| b.meets([0; 3], ROOT_EDGE);
    let without_effect = mesh.rules.boxes.iter().filter(|b| !has_effect(b)).count();
    let leaks = of_leaks(mesh);
    let empty = empty.filter(|warning| leaks.as_ref() != Some(warning));
    let warnings = [
        leaks,
        (without_effect > 0).then(|| boxes_without_effect(without_effect)),
        empty,
        summary.inside_reaches_boundary.then(|| flow_at_boundary(has_seeds)),
        summary.flow_misses_boundary.then(flow_without_far_field),
        (facets_cut > 0).then(|| body_cut(facets_cut, mesh.facets.total)),
    ];
    warnings.into_iter().flatten().collect()
}

/// The warning of a geometry that leaks, or that is open and bounds nothing.
pub fn of_leaks(mesh: &Mesh) -> Option<String> {
    // Each region counts once, with the finest spacing that closes it: there it has the most of its volume.
    let leaks = LeakEntry::of(mesh);
    let regions = || leaks.iter().zip(&mesh.leaks.0).filter(|(_, of)| !of.is_part);
    let Some((largest, of)) = regions().max_by_key(|(_, of)| of.volume) else {
        let empty = empty_region(mesh.rules.keep, &mesh.sides.summary);
        let is_inner = mesh.rules.keep == Keep::Inside;
        return match mesh.bounds_nothing {
            true => empty.or_else(|| Some(bounds_nothing(mesh))),
            false => empty.filter(|_| is_inner),
        };
    };
    let (count, volume) =
        regions().fold((0, 0.0), |sum, (leak, _)| (sum.0 + 1, sum.1 + leak.volume));
    let number = if count == 1 { "a region".to_owned() } else { format!("{count} regions") };
    // They are in the order of their spacings.
    let mut spacings: Vec<f64> = regions().map(|(leak, _)| leak.spacing_coarse).collect();
    spacings.dedup();
    let coarse = match spacings[..] {
        [finer, coarser] => format!("spacings of {finer} and {coarser}"),
        _ => format!("a spacing of {}", spacings[0]),
    };
    let (case, [x, y, z], fine) = (&mesh.case_name, largest.point, largest.spacing_fine);
    let has_seeds = !mesh.rules.seeds.is_empty();
    let (before, after) = match of.is_inside {
        _ if has_seeds && mesh.rules.keep != Keep::All => ("deleted", "kept"),
        true => ("outside", "inside"),
        false => ("inside", "outside"),
    };
    // A search starts in the flow if that is known.
    let end = if has_seeds { "to" } else { "from" };
    Some(format!(
        "the geometry leaks: {number} with a volume of {volume:.4e}, the largest at ({x}, {y}, {z}), {before} at {coarse}, \
         became {after} at {fine}: close what `harness leak {case} --{end} {x},{y},{z}` finds, or increase spacing_min"
    ))
}

fn bounds_nothing(mesh: &Mesh) -> String {
    let (case, rules) = (&mesh.case_name, &mesh.rules);
    let spacing = rules.root.edge / f64::from(1u32 << rules.level_surface);
    format!(
        "the facets bound no inside at spacings of {spacing}, {} and {}, and are no sheet: either the flow fills the body through \
         openings, which `harness leak {case} --from X,Y,Z` finds from a point in the body, or every facet appears twice, as \
         `harness geometry` states, or the body is thinner than its cells; close the openings, remove the copies, or change spacing_min",
        2.0 * spacing,
        4.0 * spacing
    )
}

fn empty_region(keep: Keep, summary: &Summary) -> Option<String> {
    let &Summary { outside, inside, enclosed, .. } = summary;
    let kept = match keep {
        Keep::Outside => outside - enclosed.map_or(0, |e| e.count),
        Keep::Inside => inside,
        Keep::All => outside + inside,
    };
    let warning = match keep {
        _ if kept > 0 => return None,
        Keep::Inside => {
            "nothing is inside the geometry, so the mesh has at most crossing leaves: close inlets, outlets and holes that are \
             wider than a cell (`harness leak` finds them), remove facets that appear twice (`harness geometry`), change spacing_min, or \
             set keep = outside"
        }
        Keep::Outside => {
            "nothing is outside the geometry, so the mesh has at most crossing leaves: enlarge the root, decrease spacing_min, \
             or set keep = inside"
        }
        Keep::All => "the geometry crosses all leaves: decrease spacing_min",
    };
    Some(warning.to_owned())
}

fn flow_at_boundary(has_seeds: bool) -> String {
    let warning = match has_seeds {
        true => {
            "the flow reaches the root's boundary from its seeds: right if the root cuts an open end of a duct; otherwise it leaks \
             through an opening that is wider than a cell: close the openings that `harness leak` finds, increase spacing_min, or \
             choose a root that cuts the open ends"
        }
        false => {
            "a component that is inside by its rays reaches the root's boundary: right if the root cuts the geometry on purpose; \
             otherwise close the openings that `harness leak` finds, increase spacing_min, or enlarge the root if the geometry \
             extends beyond it"
        }
    };
    warning.to_owned()
}

fn flow_without_far_field() -> String {
    "keep = outside, and the flow of no seed reaches the root's boundary: the seeds may lie in the solid or in a cavity; move a seed \
     to the far field, or set keep = inside if the flow is internal"
        .to_owned()
}

fn boxes_without_effect(count: usize) -> String {
    let boxes =
        if count == 1 { "an extent box".to_owned() } else { format!("{count} extent boxes") };
    format!(
        "{boxes} ([[box]]) without volume within the root: nothing is refined there; correct the corners or their unit"
    )
}

fn body_cut(facets: u64, total: u64) -> String {
    let verb = if facets == 1 { "lies" } else { "lie" };
    format!(
        "{facets} of {total} facets {verb} wholly or partly beyond the root, which cuts the body at its boundary: enlarge or move the \
         root unless the body is meant to extend beyond it"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sides::EnclosedComponents;

    #[test]
    fn a_region_without_components_is_empty() {
        let summary = |outside, inside, count| Summary {
            outside,
            inside,
            enclosed: Some(EnclosedComponents { count, leaves: 9, example: [0; 3] }),
            ..Summary::default()
        };
        for (keep, empty, not_empty) in [
            (Keep::Outside, summary(2, 1, 2), summary(2, 0, 1)),
            (Keep::Inside, summary(2, 0, 0), summary(0, 1, 0)),
            (Keep::All, summary(0, 0, 0), summary(0, 1, 0)),
        ] {
            assert!(empty_region(keep, &empty).is_some(), "{keep:?}");
            assert_eq!(empty_region(keep, &not_empty), None, "{keep:?}");
        }
        assert_eq!(empty_region(Keep::All, &summary(1, 0, 0)), None);
        let says = |keep, word: &str| {
            assert!(empty_region(keep, &Summary::default()).is_some_and(|w| w.contains(word)));
        };
        says(Keep::Outside, "enlarge the root");
        says(Keep::Inside, "set keep = outside");
        says(Keep::All, "crosses all leaves");
        assert!(flow_at_boundary(true).starts_with("the flow reaches"));
        assert!(flow_at_boundary(false).starts_with("a component that is inside"));
    }
}
