//! What the user should know of an exported mesh: patches, regions, processors.

use contract::word::Side;

use super::directory::Counts;
use super::patches::{CUT, SIDES};
use super::regions::Size;
use crate::mesh::Mesh;
use crate::options;
use crate::selection::Selection;

/// Number of regions whose size is listed.
const REGIONS_LISTED: usize = 5;

/// The lines, for the directories that were written and for all regions of the selected leaves, largest first.
pub fn notes(counts: &[Counts], regions: &[Size], kept: options::Regions) -> Vec<String> {
    let totals = totals(counts);
    let mut notes = vec![patches(&totals)];
    notes.extend(without_faces(&totals));
    notes.extend((counts.len() > 1).then(|| processors(counts)));
    notes.extend((regions.len() > 1).then(|| unconnected(regions, kept)));
    notes
}

/// A warning about exported cells that the geometry crosses.
pub fn crossing(mesh: &Mesh, selection: &Selection) -> Option<String> {
    let is_selected = selection.side.is_none_or(|side| side == Side::Crossing);
    (is_selected && mesh.manifest.leaves_by_side.crossing > 0).then(|| {
        "warning: the geometry crosses cells of this mesh, and a flow passes through walls inside them: mesh with \
         keep_crossing = false for a solver"
            .to_owned()
    })
}

/// The patches of the whole mesh with their numbers of faces, in order.
fn totals(counts: &[Counts]) -> Vec<(&str, u64)> {
    let mut patches: Vec<(&str, u64)> = Vec::new();
    for (name, faces) in counts.iter().flat_map(|counts| &counts.patches) {
        match patches.iter_mut().find(|(known, _)| known == name) {
            Some((_, total)) => *total += faces,
            None => patches.push((name, *faces)),
        }
    }
    patches
}

/// The patches that have faces.
fn patches(totals: &[(&str, u64)]) -> String {
    let listed = totals.iter().filter(|(_, faces)| *faces > 0);
    let listed: Vec<_> = listed.map(|(name, faces)| format!("{name} {faces}")).collect();
    format!("faces of each patch: {}", listed.join(", "))
}

/// A warning about solids without faces.
fn without_faces(totals: &[(&str, u64)]) -> Option<String> {
    let solids = totals.iter().filter(|(name, _)| !SIDES.contains(name) && *name != CUT);
    let empty: Vec<_> = solids.filter(|(_, faces)| *faces == 0).map(|(name, _)| *name).collect();
    (!empty.is_empty()).then(|| {
        format!(
            "warning: patches without faces, which are no walls of this mesh: {}",
            empty.join(", ")
        )
    })
}

fn processors(counts: &[Counts]) -> String {
    let cells = || counts.iter().map(|counts| counts.cells);
    let faces =
        counts.iter().map(|counts| counts.faces_between.iter().map(|(_, n)| n).sum::<u64>());
    format!(
        "{} processors of {} to {} cells, {} faces between them",
        counts.len(),
        cells().min().unwrap_or(0),
        cells().max().unwrap_or(0),
        faces.sum::<u64>() / 2
    )
}

fn unconnected(regions: &[Size], kept: options::Regions) -> String {
    let listed = regions.iter().take(REGIONS_LISTED).map(|size| size.cells.to_string());
    let mut listed = listed.collect::<Vec<_>>().join(", ");
    if regions.len() > REGIONS_LISTED {
        listed.push_str(", ...");
    }
    let outcome = match kept {
        options::Regions::All => "most solvers accept one: --regions largest leaves out the others",
        options::Regions::Largest => "only the first was exported",
    };
    format!("{} regions that no face connects, of {listed} cells: {outcome}", regions.len())
}
