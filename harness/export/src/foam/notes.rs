//! What the user should know of an exported mesh: patches, regions, processors.

use contract::word::Side;

use super::Mesh;
use super::directory::Directory;
use super::patches::{CUT, SIDES};
use super::regions::Size;
use crate::mesh;
use crate::options;
use crate::selection::Selection;

/// Number of regions whose size is listed.
const REGIONS_LISTED: usize = 5;

/// The lines, for the directories that were written and for all regions of the selected leaves, largest first.
pub fn notes(mesh: &Mesh, parts: &[Directory], regions: &[Size]) -> Vec<String> {
    let faces = mesh.faces.starts.windows(2).map(|ends| ends[1] - ends[0]);
    let totals: Vec<(&str, usize)> =
        mesh.patches.names.iter().map(String::as_str).zip(faces).collect();
    let (with, without): (Vec<_>, Vec<_>) = totals.into_iter().partition(|(_, faces)| *faces > 0);
    let with: Vec<_> = with.iter().map(|(name, faces)| format!("{name} {faces}")).collect();
    let mut notes = vec![format!("faces of each patch: {}", with.join(", "))];
    let is_solid = |name: &&str| !SIDES.contains(name) && *name != CUT;
    let empty: Vec<_> = without.into_iter().map(|(name, _)| name).filter(is_solid).collect();
    if !empty.is_empty() {
        notes.push(format!(
            "warning: patches without faces, which are no walls of this mesh: {}",
            empty.join(", ")
        ));
    }
    notes.extend((regions.len() > 1).then(|| unconnected(regions, mesh.options.foam.regions)));
    if parts.len() > 1 && !mesh.has_addressing() {
        notes.push("no addressing for reconstructPar: 32-bit labels cannot number the faces of the whole mesh".to_owned());
    }
    notes
}

/// A warning about exported cells that the geometry crosses.
pub fn crossing(mesh: &mesh::Mesh, selection: &Selection) -> Option<String> {
    let is_selected = selection.side.is_none_or(|side| side == Side::Crossing);
    (is_selected && mesh.manifest.leaves_by_side.crossing > 0).then(|| {
        "warning: the geometry crosses cells of this mesh, and a flow passes through walls inside them: mesh with \
         keep_crossing = false for a solver"
            .to_owned()
    })
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
