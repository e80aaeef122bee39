//! Geometries: their diagnosis before they are meshed, and [`leak`]s through their openings.
//!
//! - [`input`]: the file, its root, the body's position there, and the cell's edge length;
//! - `edges`: facets that share vertices and edges; `shells` and `openings` build on it;
//! - [`tree`]: facets in a tree of boxes, for `intersections`, `sheets` and leaks;
//! - [`finding`] and [`report`]: the result as data and for a terminal.
//!
//! Two vertices are the same if their f32 coordinates are equal (-0 equals 0). Decisions that
//! affect the mesh are made exactly, on the lattice of the definition; widths and gaps are f64.

mod edges;
pub mod finding;
pub mod input;
mod intersections;
pub mod leak;
mod openings;
pub mod report;
mod sheets;
mod shells;
pub mod tree;

use edges::Edges;
use input::Input;
use report::{Diagnosis, SCHEMA};
use shells::Shells;
use tree::FacetTree;

/// Diagnoses a geometry and lists the first places of each finding. The counts do not depend on the order of the facets or of a facet's vertices.
pub fn diagnose(input: &Input, first: usize) -> Diagnosis {
    let edges = Edges::new(&input.case.facets, &input.case.facets_lattice);
    let (openings, torn) = openings::openings(input, &edges, first);
    let shells = Shells::new(&edges, &input.case.facets_lattice, &torn);
    let mut findings = vec![openings];
    findings.extend(edges::findings(&edges, first));
    findings.extend(shells.findings(input, first));
    let tree = FacetTree::new(&input.case.facets_lattice);
    findings.push(edges::stray(input, first));
    let solids = intersections::inner_solids(input, &tree, &shells);
    findings.push(edges::duplicates(input, &edges, &solids, first));
    findings.push(intersections::intersections(input, &tree, &shells, first));
    findings.push(intersections::overlaps(input, &solids, first));
    if let Some(cell) = input.cell {
        findings.extend(sheets::sheets(input, &tree, &shells, cell));
        findings.push(finding::rounded(input, first));
    }
    findings.extend(finding::at_root(input, first));
    for finding in findings.iter_mut().filter(|finding| finding.count > 0) {
        if finding.kind.changes_region(input) {
            finding.count_changing = finding.count;
        }
        finding.meaning = finding::meaning(finding, input);
    }
    let closed = shells.all.iter().filter(|shell| shell.is_closed).count() as u64;
    let of_shells = shells.of.iter().filter(|&&shell| shell != u32::MAX).count() as u64;
    let diagnosis = Diagnosis {
        schema: SCHEMA,
        facets: input.case.facets.len() as u64,
        vertices: edges.points.len() as u64,
        edges: edges.counts(),
        solids: input.case.solids.clone(),
        shells: report::Shells { count: shells.all.len() as u64, closed, facets: of_shells },
        root: input.case.root,
        cell: input.cell,
        extent: input.extent(),
        changes_region: findings.iter().any(|finding| finding.count_changing > 0),
        findings,
    };
    diagnosis.check_invariants();
    diagnosis
}
