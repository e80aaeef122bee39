//! The result of a diagnosis as data; JSON of the schema `octree-geometry/1` when serialised.

use contract::lattice::Root;
use contract::stl::Solid;
use serde::Serialize;

use super::edges::Edges;
use super::extent::{self, Extent};
use super::finding::{Finding, Kind};
use super::input::Input;
use super::meaning;
use super::shells::Shell;

/// Name and version of the JSON form.
pub const SCHEMA: &str = "octree-geometry/1";

/// The shells in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Shells {
    /// Number of shells.
    pub count: u64,
    /// Number of closed shells.
    pub closed: u64,
    /// The largest shells.
    pub largest: Vec<Shell>,
}

/// The result of a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Number of facets.
    pub facets: u64,
    /// Number of distinct vertices.
    pub vertices: u64,
    /// The solids of the file; none for a generated body.
    pub solids: Vec<Solid>,
    /// The shells.
    pub shells: Shells,
    /// The root cube.
    pub root: Root,
    /// Edge length of the cells at the surface; none if no spacing was given.
    pub cell: Option<f64>,
    /// The body's extent in the root.
    pub extent: Extent,
    /// One finding of every kind that was searched for.
    pub findings: Vec<Finding>,
    /// Whether a finding can change the mesh's region.
    pub changes_region: bool,
}

impl Diagnosis {
    pub(super) fn new(
        input: &Input,
        edges: &Edges,
        shells: &[Shell],
        mut findings: Vec<Finding>,
        first: usize,
    ) -> Self {
        for finding in findings.iter_mut().filter(|finding| finding.count > 0) {
            if meaning::changes_region(finding.kind, input.keep) {
                finding.count_changing = finding.count;
            }
            finding.meaning = meaning::meaning(finding, input);
        }
        let closed = shells.iter().filter(|shell| shell.is_closed).count() as u64;
        let largest = shells.iter().take(first).cloned().collect();
        Self {
            schema: SCHEMA,
            facets: input.facets.len() as u64,
            vertices: edges.vertices.into(),
            solids: input.solids.clone(),
            shells: Shells { count: shells.len() as u64, closed, largest },
            root: input.root,
            cell: input.cell,
            extent: extent::extent(input),
            changes_region: findings.iter().any(|finding| finding.count_changing > 0),
            findings,
        }
    }

    /// The finding of a kind, if this kind was searched for.
    pub fn finding(&self, kind: Kind) -> Option<&Finding> {
        self.findings.iter().find(|finding| finding.kind == kind)
    }
}
