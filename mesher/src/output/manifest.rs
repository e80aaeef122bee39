//! The manifest of a mesh, `mesh.json`: its inputs, counts, digests and files.

use crate::input::lattice::{Enclosed, ExtentBox, Keep, Root};
use crate::input::quantise::FacetCounts;
use crate::mesh::Mesh;
use crate::output::stream::Counts;
use crate::output::write::{Output, TREE, Written, part_name};
use crate::sides::Summary;
use crate::sides::leaks::Leak;
use bricks::digest::{Digests, hex};
use bricks::octant::{LEVEL_MAX, Level};
use ranks::Comm;
use serde::Serialize;

/// Contents of `mesh.json`. Boxes are in lattice units, the root is in the geometry's unit.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    schema: &'static str,
    program: String,
    tree: &'static str,
    root: Root,
    level_surface: u32,
    layer_cells_min: u32,
    keep: Keep,
    keep_crossing: bool,
    boxes: Vec<ExtentBox>,
    geometry: Geometry,
    leaks: Vec<LeakEntry>,
    leaves: u64,
    leaves_by_level: Vec<u64>,
    leaves_by_side: SideEntry,
    seeds: Vec<[i64; 3]>,
    enclosed: Enclosed,
    components: ComponentsEntry,
    components_ambiguous: AmbiguousEntry,
    digest: String,
    octant_digests: Vec<String>,
    parts: Vec<PartEntry>,
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

#[derive(Clone, Debug, Serialize)]
struct SideEntry {
    outside: u64,
    inside: u64,
    crossing: u64,
}

#[derive(Clone, Debug, Serialize)]
struct ComponentsEntry {
    outside: u64,
    inside: u64,
    enclosed: EnclosedEntry,
}

#[derive(Clone, Debug, Serialize)]
struct EnclosedEntry {
    count: u64,
    leaves: u64,
    example: Option<[f64; 3]>,
}

#[derive(Clone, Debug, Serialize)]
struct AmbiguousEntry {
    count: u64,
    example: Option<[f64; 3]>,
}

#[derive(Clone, Debug, Serialize)]
struct PartEntry {
    file: String,
    leaves: u64,
    digest: String,
}

/// A part: its number of leaves, and the upper and the lower half of its digest.
type PartWords = [u64; 3];

/// The digests by octant and the parts of the mesh, gathered from all ranks. Collective.
pub fn gather(mine: &Written, comm: &dyn Comm) -> (Digests, Vec<PartWords>) {
    let split = |d: u128| [(d >> 64) as u64, d as u64];
    let whole = split(mine.digests.whole());
    let mut words = vec![mine.leaves, whole[0], whole[1]];
    // The leaves of a rank lie in few of the octants.
    let octants = (0..).zip(&mine.digests.octants).filter(|(_, d)| **d != 0);
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

impl Manifest {
    /// The manifest of a mesh with these leaves, digests and parts; parts and tree are named as far as `output` has them.
    pub fn new(
        output: &Output,
        mesh: &Mesh,
        counts: &Counts,
        digests: &Digests,
        parts: &[PartWords],
    ) -> Self {
        let rules = &mesh.rules;
        let Summary { outside, inside, enclosed, ambiguous, .. } = mesh.sides.summary;
        let side = |s: usize| counts.by_level.iter().map(|l| l[s]).sum();
        let entry = |(i, p): (usize, &PartWords)| PartEntry {
            file: part_name(i),
            leaves: p[0],
            digest: hex(u128::from(p[1]) << 64 | u128::from(p[2])),
        };
        Self {
            schema: "octree-leaf-set/1",
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")).into(),
            tree: if mesh.is_base { "base" } else { "final" },
            root: rules.root,
            level_surface: rules.level_surface,
            layer_cells_min: rules.layer_cells_min,
            keep: rules.keep,
            keep_crossing: rules.keep_crossing,
            boxes: rules.boxes.clone(),
            geometry: Geometry::of(&mesh.facets),
            leaks: LeakEntry::of(mesh),
            leaves: counts.total(),
            leaves_by_level: counts.by_level[..=LEVEL_MAX as usize]
                .iter()
                .map(|l| l.iter().sum())
                .collect(),
            leaves_by_side: SideEntry { outside: side(0), inside: side(1), crossing: side(2) },
            seeds: rules.seeds.iter().map(|seed| seed.lattice).collect(),
            enclosed: rules.enclosed,
            components: ComponentsEntry {
                outside,
                inside,
                enclosed: EnclosedEntry {
                    count: enclosed.map_or(0, |e| e.count),
                    leaves: enclosed.map_or(0, |e| e.leaves),
                    example: enclosed.map(|e| rules.root.locate(e.example)),
                },
            },
            components_ambiguous: AmbiguousEntry {
                count: ambiguous.map_or(0, |a| a.count),
                example: ambiguous.map(|a| rules.root.locate(a.example)),
            },
            digest: hex(digests.whole()),
            octant_digests: digests.octants.iter().map(|&d| hex(d)).collect(),
            parts: parts.iter().enumerate().filter(|_| output.words).map(entry).collect(),
            hyper_tree_grid: output.tree.then_some(TREE),
        }
    }
}
