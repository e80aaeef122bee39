//! Warnings: meshes that follow the rules and are probably not what the user wants.

use crate::Mesh;
use crate::input::lattice::{Keep, Rules};
use crate::sides::leaks::Leak;
use crate::sides::{Ambiguous, Summary};
use bricks::octant::ROOT_EDGE;

const FLOW: &str = "the flow reaches the root's boundary: right if the root cuts the geometry on purpose, such as the open ends of a duct; otherwise a \
    seed lies beyond the body, or it leaks through an opening that is wider than a cell: move the seed, close the openings that `harness leak CASE --from X,Y,Z` finds from a point in the flow, increase spacing_min, or choose a root that holds the geometry or cuts its open ends";
const FLOW_WITHOUT_FAR_FIELD: &str = "keep = outside, and the flow of no seed reaches the root's boundary: the seeds may lie in the solid or in a cavity; move a seed \
    to the far field, or set keep = inside if the flow is internal";
const BOXES_WITHOUT_EFFECT: &str =
    "an extent box ([[box]]) has no volume within the root: correct its corners or their unit";
const NO_FACETS: &str = "the geometry has no facets: the mesh is that of the boxes alone; export the body again unless that is meant";
const BODY_CUT: &str = "facets lie wholly or partly beyond the root, which cuts the body: enlarge or move the root unless that is meant";

const ROUNDED: &str = "coordinates of STL files are f32 numbers, which are more than half a cell apart so far from the origin, so that the body may have steps: move \
    it to the origin before its vertices are rounded";

/// A sentence for each warning: what was found, and what to try. Nothing is deleted from T0 yet, so it has those of its inputs, rays and leaks
/// only.
pub fn of(mesh: &Mesh, case_name: &str) -> Vec<String> {
    let (leaks, is_final, keep) = (of_leaks(mesh, case_name), !mesh.is_base, mesh.rules.keep);
    let summary = &mesh.sides.summary;
    let empty = empty_region(keep, summary);
    let flow_at_boundary = is_final && keep == Keep::Inside && summary.inside_reaches_boundary;
    let at_boundary = FLOW.replace("CASE", case_name);
    // These two already advise to enlarge the root.
    let explains_cut = flow_at_boundary || empty.is_some() && keep == Keep::Outside;
    let empty = empty.filter(|_| is_final && leaks.is_none());
    let others = [
        (flow_at_boundary, &at_boundary[..]),
        (is_final && summary.flow_misses_boundary, FLOW_WITHOUT_FAR_FIELD),
        (!mesh.rules.boxes.iter().all(|b| b.meets([0; 3], ROOT_EDGE)), BOXES_WITHOUT_EFFECT),
        (mesh.facets.total == 0, NO_FACETS),
        (mesh.facets.margin < 0 && !explains_cut, BODY_CUT),
        (
            2.0 * f64::from(mesh.facets.rounding)
                > mesh.rules.root.edge_of(mesh.rules.level_deepest()),
            ROUNDED,
        ),
    ];
    let Ambiguous { count, example } = summary.ambiguous;
    let ambiguous = example.map(|[x, y, z]| {
        format!(
            "the rays of {count} components disagree, for example at ({x}, {y}, {z}), so their sides are those of the majority: close \
             holes and remove single sheets there, or give seeds if the root cuts the geometry on purpose"
        )
    });
    let is_new = |(is_so, what): &(bool, &str)| *is_so && leaks.as_deref() != Some(what);
    let others: Vec<_> =
        others.into_iter().filter(is_new).map(|(_, what)| what.to_owned()).collect();
    leaks.into_iter().chain(empty).chain(ambiguous).chain(others).collect()
}

/// The warning of a geometry that leaks, that is open and bounds nothing, or of which what is kept is empty or cannot be the flow asked for.
pub fn of_leaks(mesh: &Mesh, case_name: &str) -> Option<String> {
    // A region that is closed at two coarser spacings has the most of its volume at the finer one, which comes first.
    let Some(largest) = mesh.leaks.0.iter().rev().max_by_key(|leak| leak.octants) else {
        let Mesh { rules, facets, sides, .. } = mesh;
        let empty = empty_region(rules.keep, &sides.summary).filter(|_| rules.keep != Keep::All);
        // Nothing but an opening joins what surrounds all facets with what rays take for the inside, unless a seed lies there.
        let is_around = facets.margin > 0 && sides.summary.inside_reaches_boundary;
        return match mesh.bounds_nothing {
            _ if is_around && rules.seeds.is_empty() => Some(format!(
                "the geometry leaks: the space around it is inside, because an opening joins it with that in the body: close what \
                 `harness leak {case_name} --from X,Y,Z` finds from a point in the body, or increase spacing_min"
            )),
            _ if is_around && rules.keep == Keep::Inside => Some(FLOW.replace("CASE", case_name)),
            _ if empty.is_some() => empty,
            true => Some(bounds_nothing(rules, case_name)),
            false => sides.summary.flow_misses_boundary.then(|| FLOW_WITHOUT_FAR_FIELD.to_owned()),
        };
    };
    let &Leak { spacing_coarse, spacing_fine, volume, point: [x, y, z], is_inside, .. } = largest;
    let has_seeds = !mesh.rules.seeds.is_empty();
    let (before, after) = match is_inside {
        _ if has_seeds && mesh.rules.keep != Keep::All => ("deleted", "kept"),
        true => ("outside", "inside"),
        false => ("inside", "outside"),
    };
    // A search starts in the flow if that is known.
    let end = if has_seeds { "to" } else { "from" };
    Some(format!(
        "the geometry leaks: a region with a volume of {volume:.4e} at ({x}, {y}, {z}), {before} at a spacing of {spacing_coarse}, became \
         {after} at {spacing_fine}: close what `harness leak {case_name} --{end} {x},{y},{z}` finds, or increase the spacing there (spacing_min, or that of a box)"
    ))
}

fn bounds_nothing(rules: &Rules, case_name: &str) -> String {
    let spacing = rules.root.edge_of(rules.level_surface);
    let [twice, four_times] = [2.0, 4.0].map(|times| times * spacing);
    format!(
        "the facets bound no inside at spacings of {spacing}, {twice} and {four_times}, and are no sheet: close the openings that `harness leak {case_name} \
         --from X,Y,Z` finds from a point in the body, remove the facets that appear twice (`harness geometry`), or refine a thin body"
    )
}

fn empty_region(keep: Keep, summary: &Summary) -> Option<String> {
    let &Summary { outside, inside, enclosed, .. } = summary;
    let (kept, warning) = match keep {
        Keep::Outside => (
            outside - enclosed.count,
            "nothing is outside the geometry, so the mesh of an outer flow has at most crossing leaves: enlarge the root, decrease spacing_min, \
             or set keep = inside",
        ),
        Keep::Inside => (
            inside,
            "nothing is inside the geometry, so the mesh of an inner flow has at most crossing leaves: close openings wider than a cell \
             (`harness leak`), remove facets that appear twice (`harness geometry`), change spacing_min, or set keep = outside",
        ),
        Keep::All => (outside + inside, "the geometry crosses all leaves: decrease spacing_min"),
    };
    (kept == 0).then(|| warning.to_owned())
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
            enclosed: EnclosedComponents { count, leaves: 9, example: Some([0.0; 3]) },
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
    }
}
