//! Phases 3 to 8: from facets and rules on the lattice to the tree.

use crate::check;
use crate::error::{Error, agree};
use crate::grade::Gradation;
use crate::input::lattice::{Keep, Rules};
use crate::input::quantise::{FacetCounts, Quantised};
use crate::mesh::Mesh;
use crate::output::warnings;
use crate::partition::initial::{self, Estimate, Partition};
use crate::partition::ownership::Ownership;
use crate::partition::{Division, PAPER_DEPTH, Partitioner, metis, repartition};
use crate::record::{Job, Options, Recorder};
use crate::refine::{self, BinnedFacets};
use crate::sides::{self, Base, Decided, leaks, openness};
use bricks::facet::Facet;
use bricks::octant::{Level, Side};
use bricks::tree::Tree;
use ranks::{Comm, Solo, gather, uncounted};
use std::borrow::Borrow;
use std::convert::Infallible;

/// Phases 3 to 8: from the facets and the rules on the lattice to the tree. Collective.
///
/// # Errors
/// The same on all ranks.
pub fn grow<F: Borrow<[Facet]>>(quantised: Quantised<F>, job: &mut Job) -> Result<Mesh, Error> {
    let Quantised { rules, facets, counts } = quantised;
    let (options, comm) = (job.options, job.comm);
    let division = &options.division;
    let all = || uncounted(comm, || gather(comm, facets.borrow()));
    let all_facets = if options.checks() { all() } else { Vec::new() };
    let is_parallel = comm.size() > 1;

    // 3. Partition: the owner of every octant, by an estimate of the number of leaves.
    let Partition { mut ownership, level_base, partitioner } = match is_parallel {
        false => Partition { ownership: Ownership::solo(), level_base: 0, partitioner: None },
        true => job.phase("base tree", |comm| match division.partitioner {
            Partitioner::Paper => of_base_mesh((facets.borrow(), counts), &rules, division, comm),
            _ => Estimate { facets: facets.borrow(), rules: &rules, comm }.partition(division),
        })?,
    };
    job.check(|comm| check::ownership(&ownership, comm));

    // 4. Refine: the facets go to the owners of the octants that they reach, which refine down to T0.
    let routed = is_parallel
        .then(|| job.phase("route", |comm| refine::route(facets.borrow(), &ownership, comm)));
    if let Some(routed) = &routed {
        job.check(|_| check::splits::routed(routed, &all_facets, &ownership));
    }
    let (mut tree, work) = job.phase("refine", |_| {
        let binned = BinnedFacets::new(routed.as_deref().unwrap_or(facets.borrow()));
        drop(routed);
        if options.checks() {
            binned.check_invariants();
        }
        refine::refine(&binned, &rules, &ownership.intervals().collect::<Vec<_>>())
    });
    job.counters = work;

    // 5. Repartition after refinement: by the number of leaves of T0. Replicas of bricks become equal.
    if is_parallel {
        let name = if division.repartitions() { "rebalance" } else { "share top" };
        job.phase(name, |comm| {
            if division.repartitions() {
                ownership = repartition::by_leaves(&tree.split, &[], &ownership, level_base, comm);
            }
            ownership.synchronise_replicas(&mut [&mut tree.split, &mut tree.crossing], comm);
        });
    }
    let slice = facets.borrow();
    let base = Base { tree: &tree, ownership: &ownership, facets: slice, rules: &rules, comm };
    job.check(|comm| {
        check::ownership(&ownership, comm);
        check::base_tree(&Base { facets: &all_facets, ..base });
    });
    drop(all_facets);
    let is_whole = check::is_whole(options, &tree.split, comm);

    // 6. Sides: inside or outside, for every component of non-crossing leaves; and which of them are kept.
    let [is_closed, is_doubled] =
        job.phase("leaks", |comm| openness::closed_and_doubled(slice, comm));
    let decided = job.phase("sides", |_| sides::decide(&base, options, is_closed))?;
    job.check(|_| {
        check::sides::components(&decided, &base);
        check::sides(&decided.sides, &base);
        if is_whole {
            check::sides::agree_over_faces(&decided.sides, &base);
        }
    });
    let Decided { sides, regions, .. } = decided;
    let (leaks, bounds_nothing) = job.phase("leaks", |comm| {
        let wants_all = options.strict || options.ungraded || sides.summary.inside == 0;
        let leaks = leaks::find(&base, regions, !wants_all);
        let bounds_nothing = (sides.summary.inside, leaks.0.len()) == (0, 0)
            && counts.total > 0
            && (is_doubled || !is_closed && !openness::is_sheet(slice, comm));
        (leaks, bounds_nothing)
    });
    drop(facets);
    let Tree { split, crossing } = tree;
    let mut mesh = Mesh {
        facets: counts,
        rules,
        ownership,
        level_base,
        partitioner,
        split,
        crossing,
        sides,
        leaks,
        bounds_nothing,
        bytes_graded: 0,
        is_base: options.ungraded,
    };
    if options.strict
        && let Some(warning) = warnings::of_leaks(&mesh, &options.case_name)
    {
        return Err(Error::leak(warning));
    }
    if options.ungraded {
        return Ok(mesh);
    }

    // 7. Gradation: layers and 2:1 balance, from the deepest level up.
    let base = is_whole.then(|| mesh.split.clone());
    let split = std::mem::take(&mut mesh.split);
    let Mesh { crossing, sides, rules, ownership, .. } = &mesh;
    let (deleted, counters) = (sides.deleted(), job.counters);
    let start = Gradation { split, crossing, deleted, rules, ownership, comm, counters, bytes: 0 };
    let graded = job.phase("grade", |_| start.graded());
    (mesh.split, job.counters, mesh.bytes_graded) = (graded.split, graded.counters, graded.bytes);
    let mut fingerprint = 0;
    job.check(|comm| {
        check::graded(&mesh, comm);
        base.iter().for_each(|base| check::splits::gradation(&mesh, base, comm));
        fingerprint = check::fingerprint(&mesh, comm);
    });
    drop(base);

    // 8. Repartition after gradation: by the number of leaves.
    if is_parallel && division.repartitions() {
        job.phase("rebalance", |comm| repartition_by_leaves(&mut mesh, comm));
        job.check(|comm| {
            check::ownership(&mesh.ownership, comm);
            check::graded(&mesh, comm);
            let moved = check::fingerprint(&mesh, comm);
            assert_eq!(moved, fingerprint, "moving octants must not change the mesh");
        });
    }
    Ok(mesh)
}

/// The paper's partition (section III). Every rank makes the same base mesh, T0 down to a fixed depth, deletes the leaves on the
/// side that is not kept, and calls METIS for the others. The facets, which the paper's ranks read, are gathered. Collective.
fn of_base_mesh(
    (facets, counts): (&[Facet], FacetCounts),
    rules: &Rules,
    division: &Division,
    comm: &dyn Comm,
) -> Result<Partition, Error> {
    let depth =
        division.level_base.unwrap_or(PAPER_DEPTH).clamp(1, initial::level_last(rules).max(1));
    let level_surface = depth.min(rules.level_surface);
    // A leaf of the base mesh with a seed may cross.
    let mut base = Rules { level_surface, seeds: Vec::new(), ..rules.clone() };
    base.boxes.iter_mut().for_each(|b| b.level = b.level.min(depth));
    let options = Options { ungraded: true, ..Options::default() };
    let mut record = Recorder::default();
    let quantised = Quantised { rules: base, facets: gather(comm, facets), counts };
    // An error is the same on all ranks, as they grow the same mesh.
    let mesh = grow(quantised, &mut Job::new(&options, &Solo, &mut record))?;
    let gone = match rules.keep {
        Keep::Outside => Some(Side::Inside as u64),
        Keep::Inside => Some(Side::Outside as u64),
        Keep::All => None,
    };
    let mut leaves = Vec::new();
    let Ok(_) = mesh.emit(|words| {
        let kept = words.iter().filter(|&word| Some(word & 3) != gone);
        leaves.extend(kept.map(|word| (word >> 7, (word >> 2 & 31) as Level)));
        Ok::<(), Infallible>(())
    });
    drop(mesh);
    let boundaries = metis::assign_equal(&leaves, comm.size());
    let ownership = Ownership::along(comm.rank(), comm.size(), agree(comm, boundaries)?);
    Ok(Partition { ownership, level_base: depth, partitioner: Some(Partitioner::Paper) })
}

/// Repartitions by the numbers of leaves. Collective.
fn repartition_by_leaves(mesh: &mut Mesh, comm: &dyn Comm) {
    let Mesh { split, crossing, sides, ownership, level_base, rules, .. } = mesh;
    let gone = [sides.deleted(), &*crossing];
    let gone = &gone[..if rules.keep_crossing { 1 } else { 2 }];
    let new = repartition::by_leaves(split, gone, ownership, *level_base, comm);
    repartition::migrate([split, crossing, &mut sides.stored], ownership, &new, comm);
    *ownership = new;
}
