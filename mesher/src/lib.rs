//! Off-body hexahedral oct-tree meshes around facets, on any number of ranks, after O'Connell and
//! Karman, "Advances in Parallelization For Large Scale Oct-Tree Mesh Generation".
//!
//! [`mesh()`] runs ten phases, each in a module: 1 read, 2 quantise, 3 partition, 4 refine, 5 repartition after refinement, 6 sides,
//! 7 gradation, 8 repartition after gradation, 9 leaves, 10 finish. Each phase ends with a check of the invariants of what
//! it has made ([`check`]). The mesh is a function of the facets and the rules alone (see
//! `reference/DEFINITION.md`), not of the ranks, the partitioner or the base level.

#![deny(missing_docs)]

pub mod agreement;
pub mod brick;
pub mod brickset;
pub mod case;
pub mod check;
pub mod comm;
pub mod digest;
pub mod dilate;
pub mod error;
pub mod exposed;
pub mod facet;
pub mod grade;
pub mod htg;
pub mod ingest;
pub mod kept;
pub mod lattice;
pub mod leaves;
mod mesh;
pub mod octant;
pub mod partition;
pub mod quantise;
pub mod record;
pub mod refine;
pub mod report;
pub mod sides;
pub mod stl;
pub mod stream;
pub mod tree;
pub mod voxelise;
mod wide;
pub mod write;

pub use mesh::{Mesh, Options};

use case::Case;
use check::debug_check;
use comm::Comm;
use error::Error;
use kept::Kept;
use partition::base_leaves::cells_heaviest;
use partition::initial::{self, Partition};
use partition::repartition::{self, LeafCounts, Sets};
use record::Recorder;
use report::{Counters, Report};
use voxelise::BinnedFacets;
use write::OutDir;

/// Meshes a case: all ten phases. The recorder keeps this rank's times; the report is the same on all ranks. Collective.
///
/// # Errors
/// The same on all ranks. Then nothing is left in the output directory.
pub fn mesh(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Report, Error> {
    let out = options.out.as_ref().map(|output| OutDir::claim(output, comm)).transpose()?;
    let report = mesh_into(out.as_ref(), case, options, comm, record)?;
    if let Some(out) = out {
        out.keep();
    }
    Ok(report)
}

fn mesh_into(
    out: Option<&OutDir>,
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Report, Error> {
    let mut counters = Counters::default();
    let mesh = make(case, options, comm, record, &mut counters)?;

    // 9. Leaves: streamed in Morton order into the digest, and to disk on request; and the tree, level by level.
    let (counts, written) = record.phase("leaves", comm, || leaves::emit(&mesh, out, comm))?;
    debug_check(options, comm, || check::leaves(&mesh, &counts, &written, comm));

    if let Some(out) = out.filter(|out| out.output.tree) {
        record.phase("tree file", comm, || htg::write(&mesh, out, out.output.cell_ranks, comm))?;
    }

    // 10. Finish: sums over the ranks, and the manifest.
    let totals =
        record.phase("finish", comm, || leaves::finish(&mesh, &counts, &written, out, comm))?;
    counters.leaves = written.leaves;
    // The number of rays is a sum over the ranks, the same on all.
    counters.rays = if comm.rank() == 0 { mesh.sides.rays } else { 0 };
    counters.add_traffic(comm.traffic());
    debug_check(options, comm, || check::totals(&totals, &written, comm));
    Ok(Report::gather(&mesh, &totals, &counters, record, comm))
}

/// The leaf words that this rank owns, in order, and a summary of the components: phases 1 to 8, and no report.
/// Collective.
pub fn words(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
) -> Result<(Vec<u64>, sides::Summary), Error> {
    let mesh = make(case, options, comm, &mut Recorder::default(), &mut Counters::default())?;
    let mut words = Vec::new();
    mesh.leaves().emit(|w| {
        words.extend_from_slice(w);
        Ok::<(), Error>(())
    })?;
    Ok((words, mesh.sides.summary))
}

/// Phases 1 to 8, which make the tree. Collective.
fn make(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
    counters: &mut Counters,
) -> Result<Mesh, Error> {
    let division = &options.division;
    let is_parallel = comm.size() > 1;

    // 1. Read: each rank reads its slice of the facets.
    let slice = record.phase("read", comm, || ingest::read(&case.source, comm))?;
    debug_check(options, comm, || check::slices(&slice, comm));
    let facets_total = slice.total;

    // 2. Quantise: the facets and the rules on the lattice.
    let (rules, facets) =
        record.phase("quantise", comm, || quantise::quantise(case, slice, comm))?;
    debug_check(options, comm, || check::rules(&rules, comm));

    // 3. Partition: the owner of every octant, by an estimate of the number of leaves.
    let mark = |level| {
        let (tree, work) = refine::refine_top(&facets, &rules, level);
        counters.add_voxelised(&work);
        tree.split
    };
    let Partition { mut ownership, base_leaves, level_base } = match is_parallel {
        false => Partition::solo(),
        true => record.phase("base tree", comm, || {
            initial::partition(&facets, &rules, division, mark, comm)
        })?,
    };
    debug_check(options, comm, || check::ownership(&ownership, comm));

    // 4. Refine: the facets go to the owners of the octants that they reach, which refine down to T0.
    let routed = is_parallel
        .then(|| record.phase("route", comm, || refine::route(&facets, &ownership, comm)));
    if let Some(routed) = &routed {
        debug_check(options, comm, || check::facets(&facets, routed, &ownership, comm));
    }
    let (mut tree, work) = record.phase("refine", comm, || {
        let binned = BinnedFacets::new(routed.as_ref().unwrap_or(&facets));
        drop(routed);
        if check::is_on(options) {
            binned.check_invariants();
        }
        refine::refine(&binned, &rules, &ownership)
    });
    counters.add_voxelised(&work);

    // 5. Repartition after refinement: by the predicted work on T0. Replicas of bricks become equal.
    if is_parallel {
        let name = if division.repartitions() { "rebalance" } else { "share top" };
        record.phase(name, comm, || {
            if division.repartitions() {
                ownership = repartition::after_refinement(&tree, &ownership, level_base, comm);
            }
            ownership.synchronise_replicas(&mut [&mut tree.split, &mut tree.crossing], comm);
        });
    }
    debug_check(options, comm, || {
        check::ownership(&ownership, comm);
        check::base_tree(&tree, &rules, &ownership, comm);
    });

    // 6. Sides: inside or outside, for every component of non-crossing leaves; and which of them are kept.
    let sides = record.phase("sides", comm, || {
        sides::decide(&tree, &ownership, &facets, &rules, options.ungraded, comm)
    })?;
    debug_check(options, comm, || check::sides(&sides, &tree, &ownership, comm));
    drop(facets);
    let tree::Tree { split, crossing } = tree;
    let mut mesh = Mesh {
        facets: facets_total,
        rules,
        ownership,
        level_base,
        split,
        crossing,
        sides,
        is_base: options.ungraded,
    };
    if options.ungraded {
        return Ok(mesh);
    }

    // 7. Gradation: layers and 2:1 balance, from the deepest level up.
    let base = check::is_on(options).then(|| mesh.split.clone());
    let (split, work) = record.phase("grade", comm, || {
        let split = std::mem::take(&mut mesh.split);
        let kept = Kept::new(&mesh.sides.deleted);
        grade::grade(split, &mesh.crossing, &kept, &mesh.rules, &mesh.ownership, comm)
    });
    mesh.split = split;
    counters.add_graded(&work);
    debug_check(options, comm, || check::graded(&mesh, base.as_ref(), comm));

    // 8. Repartition after gradation: by the number of leaves, and of exposed faces on request.
    if !(is_parallel && division.is_of_curve()) {
        counters.base_leaf_cells_max =
            cells_heaviest(&mesh.split, &mesh.sides.deleted, &base_leaves);
    } else if !division.repartitions() {
        counters.base_leaf_cells_max = repartition_by_leaves(&mut mesh, false, None, comm);
    } else {
        let weighted = options.weight_exposed.filter(|&weight| weight > 0).map(|weight| {
            let faces = record.phase("exposed", comm, || exposed::faces(&mesh, comm));
            (faces, weight)
        });
        counters.base_leaf_cells_max = record
            .phase("rebalance", comm, || repartition_by_leaves(&mut mesh, true, weighted, comm));
    }
    if is_parallel && division.is_of_curve() {
        debug_check(options, comm, || {
            check::ownership(&mesh.ownership, comm);
            check::graded(&mesh, None, comm);
        });
    }
    if options.weight_exposed.is_some() {
        let faces = record.phase("exposed", comm, || exposed::faces(&mesh, comm));
        counters.exposed_faces = Some(faces.iter().map(|brick| u64::from(brick.faces)).sum());
    }
    Ok(mesh)
}

/// Counts the leaves by octants of the base level, and repartitions by these counts if `moves` is true, with the exposed faces and the weight of
/// each if given. Returns the greatest count of leaves. Collective.
fn repartition_by_leaves(
    mesh: &mut Mesh,
    moves: bool,
    weighted: Option<(Vec<exposed::InBrick>, u32)>,
    comm: &dyn Comm,
) -> u64 {
    let (inside, deleted) = (&mut mesh.sides.inside, &mut mesh.sides.deleted);
    let sets = Sets { split: &mut mesh.split, crossing: &mut mesh.crossing, inside, deleted };
    let with_crossing = mesh.rules.keep_crossing;
    let mut counts = LeafCounts::new(&sets, &mesh.ownership, mesh.level_base, with_crossing);
    let max = counts.max();
    if let Some((faces, weight)) = weighted {
        let weights =
            faces.iter().map(|b| (b.level, b.key, u64::from(b.faces) * u64::from(weight)));
        counts.add(weights, &mesh.ownership, mesh.level_base);
    }
    if moves {
        mesh.ownership = counts.after_gradation(sets, &mesh.ownership, comm);
    }
    max
}
