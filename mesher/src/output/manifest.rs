//! The manifest of a mesh, `mesh.json`: its inputs, counts, digests and files.

use crate::input::lattice::{Enclosed, ExtentBox, Keep, Root};
use crate::input::quantise::FacetCounts;
use crate::mesh::Mesh;
use crate::output::report::Report;
use crate::output::write::{Output, TREE, part_name};
use crate::sides::leaks::Leak;
use bricks::digest::{Digests, hex};
use bricks::octant::{LEVEL_MAX, Level};
use ranks::Comm;
use serde::Serialize;
use serde_json::{Value, json};

/// Contents of `mesh.json`. Boxes are in lattice units, the root is in the geometry's unit.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest<'a> {
    schema: &'static str,
    program: &'static str,
    tree: &'static str,
    root: Root,
    level_surface: u32,
    layer_cells_min: u32,
    keep: Keep,
    keep_crossing: bool,
    boxes: &'a [ExtentBox],
    geometry: &'a Geometry,
    leaks: &'a [LeakEntry],
    leaves: u64,
    leaves_by_level: &'a [u64],
    leaves_by_side: Value,
    seeds: Vec<[i64; 3]>,
    enclosed: Enclosed,
    components: Value,
    components_ambiguous: Value,
    digest: &'a str,
    octant_digests: Vec<String>,
    parts: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    hyper_tree_grid: Option<&'static str>,
}

/// The facets as read, in manifest and report.
#[derive(Clone, Debug, Serialize)]
pub struct Geometry {
    /// Their number.
    pub facets: u64,
    /// Their digest on the lattice.
    pub digest: String,
}

impl Geometry {
    /// The facets of all ranks.
    pub fn of(facets: &FacetCounts) -> Self {
        Self { facets: facets.total, digest: hex(facets.digest) }
    }
}

/// A leak, in manifest and report, in the unit of the geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LeakEntry {
    /// The spacing at which the region is closed.
    pub spacing_coarse: f64,
    /// The spacing of the mesh.
    pub spacing_fine: f64,
    /// The region's volume at the coarser spacing.
    pub volume: f64,
    /// A point in it.
    pub point: [f64; 3],
}

impl LeakEntry {
    /// The leaks of a mesh.
    pub fn of(mesh: &Mesh) -> Vec<Self> {
        let Root { edge, .. } = mesh.rules.root;
        let edge_of = |l: Level| edge / f64::from(1u32 << l);
        let entry = |leak: &Leak| Self {
            spacing_coarse: edge_of(leak.level),
            spacing_fine: edge_of(mesh.rules.level_surface),
            volume: leak.volume as f64 * edge_of(LEVEL_MAX).powi(3),
            point: mesh.rules.root.locate(leak.first.centroid()),
        };
        mesh.leaks.0.iter().map(entry).collect()
    }
}

/// A part: its number of leaves, and the upper and the lower half of its digest.
pub type PartWords = [u64; 3];

/// The digests by octant and the parts of the mesh, gathered from all ranks. Collective.
pub fn gather(leaves: u64, mine: &Digests, comm: &dyn Comm) -> (Digests, Vec<PartWords>) {
    let split = |d: u128| [(d >> 64) as u64, d as u64];
    let whole = split(mine.whole());
    let mut words = vec![leaves, whole[0], whole[1]];
    // The leaves of a rank lie in few of the octants.
    let octants = (0..).zip(&mine.octants).filter(|(_, d)| **d != 0);
    words.extend(octants.flat_map(|(i, &d)| [i, split(d)[0], split(d)[1]]));
    let mut digests = Digests::default();
    let mut parts = Vec::new();
    for (_, theirs) in comm.all_gather(&words).messages() {
        let (whole, octants) = theirs.split_at(3);
        parts.push([whole[0], whole[1], whole[2]]);
        let octants = octants.chunks_exact(3);
        digests.merge(octants.map(|w| (w[0] as usize, u128::from(w[1]) << 64 | u128::from(w[2]))));
    }
    (digests, parts)
}

impl<'a> Manifest<'a> {
    /// The manifest of a mesh with these numbers, digests and parts; parts and tree are named as far as `output` has them.
    pub fn new(
        output: &Output,
        mesh: &'a Mesh,
        report: &'a Report,
        digests: &Digests,
        parts: &[PartWords],
    ) -> Self {
        let rules = &mesh.rules;
        let [outside, inside, crossing] = report.cells_by_side;
        let part = |(rank, &[leaves, high, low]): (usize, &PartWords)| {
            let digest = hex(u128::from(high) << 64 | u128::from(low));
            json!({ "file": part_name(rank), "leaves": leaves, "digest": digest })
        };
        Self {
            schema: "octree-leaf-set/1",
            program: report.program,
            tree: if mesh.is_base { "base" } else { "final" },
            root: rules.root,
            level_surface: rules.level_surface,
            layer_cells_min: rules.layer_cells_min,
            keep: rules.keep,
            keep_crossing: rules.keep_crossing,
            boxes: &rules.boxes,
            geometry: &report.geometry,
            leaks: &report.leaks,
            leaves: report.cells,
            leaves_by_level: &report.cells_by_level,
            leaves_by_side: json!({ "outside": outside, "inside": inside, "crossing": crossing }),
            seeds: rules.seeds.iter().map(|seed| seed.lattice).collect(),
            enclosed: rules.enclosed,
            components: json!({
                "outside": report.components_outside,
                "inside": report.components_inside,
                "enclosed": {
                    "count": report.components_enclosed,
                    "leaves": report.enclosed_leaves,
                    "example": report.enclosed_example,
                },
            }),
            components_ambiguous: json!({
                "count": report.components_ambiguous,
                "example": report.ambiguous_example,
            }),
            digest: &report.digest,
            octant_digests: digests.octants.iter().map(|&d| hex(d)).collect(),
            parts: parts.iter().enumerate().filter(|_| output.words).map(part).collect(),
            hyper_tree_grid: output.tree.then_some(TREE),
        }
    }
}
