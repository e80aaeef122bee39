//! The manifest of a mesh, `mesh.json`: its inputs, counts, digests and files.

use crate::input::lattice::{Enclosed, ExtentBox, Keep, Root};
use crate::mesh::Mesh;
use crate::output::report::leaks::LeakEntry;
use crate::output::report::{Geometry, Report};
use crate::output::write::{Output, TREE, part_name};
use bricks::digest::{Digests, hex};
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
