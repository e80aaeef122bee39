//! Diagnosis of a geometry before it is meshed: which of its defects change the mesh's region, and how.
//!
//! - [`input`]: the file, its root and the cell's edge length;
//! - [`edges`]: facets that share vertices and edges; [`shells`], [`openings`], [`junctions`] and [`width`] build on it;
//! - [`facets`]: defects of single facets, and duplicates;
//! - [`boxes`]: a tree of bounding boxes, which [`intersections`] searches;
//! - [`sheets`]: thin sheets; [`opposite`]: when two facets are one; [`patches`]: the tree of their searches, [`settled`],
//!   [`least`] and [`narrowest`]; [`patch`], [`bundles`] and [`pairs`]: what a node implies for its facets;
//! - [`extent`]: the body's position in the root;
//! - [`finding`] and [`report`]: the result as data; [`meaning`]: a sentence per finding; [`text`]: the result for a terminal.
//!
//! Two vertices are the same if their f32 coordinates are equal (-0 equals 0). Decisions that
//! affect the mesh are made exactly, on the lattice of the definition; widths and gaps are f64.

pub mod boxes;
pub mod bundles;
pub mod distance;
pub mod edges;
pub mod extent;
pub mod facets;
pub mod finding;
pub mod input;
pub mod intersections;
pub mod junctions;
pub mod least;
pub mod meaning;
pub mod narrowest;
pub mod openings;
pub mod opposite;
pub mod pairs;
pub mod patch;
pub mod patches;
pub mod report;
pub mod settled;
pub mod sheets;
pub mod shells;
pub mod text;
pub mod width;

use boxes::Boxes;
use edges::Edges;
use finding::Finding;
use input::Input;
use report::Diagnosis;
use shells::Shells;

/// Options of a diagnosis.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Whether to search for self-intersections.
    pub intersections: bool,
    /// Maximum number of places listed per finding.
    pub first: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { intersections: true, first: 5 }
    }
}

/// Diagnoses a geometry. The counts do not depend on the order of the facets or of a facet's vertices.
pub fn diagnose(input: &Input, options: &Options) -> Diagnosis {
    let edges = Edges::new(&input.facets);
    let shells = Shells::new(&edges, &input.lattice);
    let mut findings: Vec<Finding> = Vec::new();
    findings.extend(openings::openings(input, &edges, options.first));
    findings.extend(edges::findings(input, &edges, options.first));
    findings.extend(shells.findings(input, options.first));
    findings.push(facets::duplicates(input, &edges, options.first));
    findings.extend(facets::shapes(input, options.first));
    if options.intersections {
        let boxes = Boxes::new(&input.lattice);
        findings.extend(intersections::intersections(input, &boxes, options.first));
    }
    if let Some(cell) = input.cell {
        findings.extend(sheets::sheets(input, (&edges, &shells), cell, options.first));
    }
    findings.extend(extent::findings(input, options.first));
    Diagnosis::new(input, &edges, &shells.all, findings, options.first)
}
