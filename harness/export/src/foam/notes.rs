//! What the user should know of an exported mesh: patches, regions, processors.

use super::poly_mesh::Counts;
use super::regions::Size;
use crate::options;

/// Number of regions whose size is listed.
const REGIONS_LISTED: usize = 5;

/// The lines, for the directories that were written and for all regions of the selected leaves, largest first.
pub fn notes(counts: &[Counts], regions: &[Size], kept: options::Regions) -> Vec<String> {
    let mut notes = vec![patches(counts)];
    notes.extend((counts.len() > 1).then(|| processors(counts)));
    notes.extend((regions.len() > 1).then(|| unconnected(regions, kept)));
    notes
}

/// The patches of the whole mesh that have faces.
fn patches(counts: &[Counts]) -> String {
    let mut patches: Vec<(&str, u64)> = Vec::new();
    for (name, faces) in counts.iter().flat_map(|counts| &counts.patches) {
        match patches.iter_mut().find(|(known, _)| known == name) {
            Some((_, total)) => *total += faces,
            None => patches.push((name, *faces)),
        }
    }
    let listed = patches.iter().filter(|(_, faces)| *faces > 0);
    let listed: Vec<_> = listed.map(|(name, faces)| format!("{name} {faces}")).collect();
    format!("faces of each patch: {}", listed.join(", "))
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
