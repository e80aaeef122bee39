//! Off-body hexahedral oct-tree meshes around facets, on any number of ranks, after O'Connell and
//! Karman, "Advances in Parallelization For Large Scale Oct-Tree Mesh Generation".
//!
//! [`mesh`] reads like the paper: ingest, base tree and partition, refinement, inside and outside,
//! gradation, leaves. The mesh is a function of the facets and the rules alone (see
//! `reference/DEFINITION.md`), not of ranks, partitioner or base level.

#![deny(missing_docs)]

pub mod brick;
pub mod brickset;
pub mod case;
pub mod comm;
pub mod digest;
pub mod dilate;
pub mod error;
pub mod facet;
pub mod grade;
pub mod ingest;
pub mod kept;
pub mod lattice;
pub mod octant;
pub mod partition;
pub mod record;
pub mod report;

pub mod sides;
pub mod stl;
pub mod stream;
pub mod tree;
pub mod voxelise;
mod wide;
pub mod write;

use case::Case;
use comm::{Comm, agree};
use error::Error;
use lattice::{Bounds, Rules};
use partition::initial::{self as base, Division};
use partition::ownership::{self, Ownership};
use partition::repartition as rebalance;
use record::{Recorder, check_interrupt};
use report::{Counters, Report};
use sides::Sides;
use std::path::PathBuf;
use stream::{Counts, Leaves};
use tree::{PerLevel, Tree};
use write::{Manifest, OutDir, Written};

/// What to do besides meshing.
#[derive(Clone, Debug)]
pub struct Options {
    /// How to divide the work among ranks.
    pub division: Division,
    /// Stop after sides: the mesh is the base tree T0, with all its leaves.
    pub ungraded: bool,
    /// Directory to write the mesh to.
    pub out: Option<PathBuf>,
}

/// Meshes a case. Collective; `Recorder` keeps this rank's times, the report is the same on all ranks.
pub fn mesh(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Report, Error> {
    let out = agree(comm, make_out(options, comm))?;
    let result = mesh_into(case, options, out.as_ref(), comm, record);
    if let (Err(_), Some(out)) = (&result, &out) {
        // Ranks first clear their own files, then the one that made the directory removes it.
        if comm.rank() != 0 {
            out.discard(comm.rank());
        }
        comm.sum(0);
        if comm.rank() == 0 {
            out.discard(0);
        }
    }
    result
}

fn make_out(options: &Options, comm: &dyn Comm) -> Result<Option<OutDir>, Error> {
    let path = options.out.as_ref();
    path.map(|p| if comm.rank() == 0 { OutDir::create(p) } else { Ok(OutDir::open(p)) }).transpose()
}

fn mesh_into(
    case: &Case,
    options: &Options,
    out: Option<&OutDir>,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Report, Error> {
    let (meshed, mut counters) = build(case, options, comm, record)?;
    let (counts, written) = record.phase("leaves", comm, || emit(&meshed, out, comm))?;
    let Meshed { rules, sides, .. } = &meshed;
    let finished = record.phase("finish", comm, || {
        finish(rules, options.ungraded, counts, &written, sides, out, comm)
    });
    let (counts, digests, parts) = finished?;
    counters.sides(sides, comm.rank());
    counters.traffic(comm.traffic());
    Ok(Report::gather(
        meshed.facets,
        rules,
        &counts,
        &digests,
        &parts,
        sides,
        meshed.refined.level_base,
        record,
        &counters,
        comm,
    ))
}

/// The leaf words that this rank answers for, in order, and the components decided by majority: the
/// whole result without a report. Collective.
pub fn words(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
) -> Result<(Vec<u64>, Option<sides::Ambiguous>), Error> {
    let (meshed, _) = build(case, options, comm, &mut Recorder::default())?;
    let mut words = Vec::new();
    meshed.leaves().emit(|w| {
        words.extend_from_slice(w);
        Ok::<(), Error>(())
    })?;
    Ok((words, meshed.sides.ambiguous))
}

/// A mesh that has not been written out.
struct Meshed {
    facets: u64,
    rules: Rules,
    refined: Refined,
    sides: Sides,
    /// The graded tree's splits; none for the base tree.
    graded: Option<PerLevel>,
}

impl Meshed {
    fn leaves(&self) -> Leaves<'_> {
        Leaves {
            split: self.graded.as_ref().unwrap_or(&self.refined.tree.split),
            crossing: &self.refined.tree.crossing,
            sides: &self.sides,
            ownership: &self.refined.ownership,
            all_leaves: self.graded.is_none(),
            rules: &self.rules,
        }
    }
}

/// The phases up to the finished tree. Collective.
fn build(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<(Meshed, Counters), Error> {
    let mut counters = Counters::default();
    let geometry = record.phase("read", comm, || ingest::read(&case.source, comm))?;
    let (rules, facets, total) =
        record.phase("quantise", comm, || quantise(case, geometry, comm))?;
    let mut refined = refine(&facets, &rules, &options.division, comm, record, &mut counters)?;
    comm.agree(check_interrupt())?;

    let mut sides = record.phase("sides", comm, || {
        sides::decide(&refined.tree, &refined.ownership, &facets, rules.keep, comm)
    });
    drop(facets);
    comm.agree(check_interrupt())?;

    let graded = (!options.ungraded).then(|| {
        let kept = kept::Kept::new(&sides.deleted);
        // From here on the base tree is known by its crossing and deleted leaves.
        let split = std::mem::take(&mut refined.tree.split);
        let (split, work) = record.phase("grade", comm, || {
            grade::grade(split, &refined.tree.crossing, &kept, &rules, &refined.ownership, comm)
        });
        counters.grade(&work);
        split
    });
    comm.agree(check_interrupt())?;
    let graded = graded.map(|mut split| {
        counters.base_leaf(match refined.level_cut {
            None => base::cells_heaviest(&split, &sides.deleted, &refined.dealt),
            Some(level) => {
                let anew = options.division.rebalances();
                let mut deal =
                    || deal_leaves(level, anew, &mut split, &mut refined, &mut sides, &rules, comm);
                if anew { record.phase("rebalance", comm, deal) } else { deal() }
            }
        });
        split
    });
    Ok((Meshed { facets: total, rules, refined, sides, graded }, counters))
}

/// The rules, this rank's facets on the lattice, and the number of all. Collective.
fn quantise(
    case: &Case,
    geometry: ingest::Share,
    comm: &dyn Comm,
) -> Result<(Rules, Vec<facet::Facet>, u64), Error> {
    let ingest::Share { facets, first, total } = geometry;
    let mine = Bounds::of(&facets);
    let words: Vec<u64> = mine.lo.iter().chain(&mine.hi).map(|c| c.to_bits()).collect();
    let bounds = comm.all_gather(&words).messages().fold(Bounds::EMPTY, |b, (_, w)| {
        let at = |i: usize| f64::from_bits(w[i]);
        b.union(Bounds { lo: [at(0), at(1), at(2)], hi: [at(3), at(4), at(5)] })
    });
    let rules = case.rules(&bounds)?;
    let facets = agree(comm, rules.root.facets(facets, &mine, first))?;
    Ok((rules, facets, total))
}

/// The base tree T0 as this rank holds it.
struct Refined {
    tree: Tree,
    ownership: Ownership,
    /// This rank's base leaves as they were dealt out, if there are any.
    dealt: Vec<ownership::BaseLeaf>,
    level_base: octant::Level,
    /// Level of the octants between which the Morton curve is cut, if it is.
    level_cut: Option<octant::Level>,
}

/// Base tree, partition, and refinement of this rank's part. Collective.
fn refine(
    facets: &[facet::Facet],
    rules: &Rules,
    division: &Division,
    comm: &dyn Comm,
    record: &mut Recorder,
    counters: &mut Counters,
) -> Result<Refined, Error> {
    let depth = voxelise::Depth { surface: rules.level_surface, boxes: rules.boxes.clone() };
    if comm.size() == 1 {
        let root = [voxelise::SubtreeRoot { level: 0, code: 0 }];
        let (tree, work) = record.phase("refine", comm, || {
            voxelise::refine(&voxelise::BinnedFacets::new(facets), &depth, &root)
        });
        counters.voxelise(&work);
        let (ownership, dealt) = (Ownership::solo(), vec![ownership::BaseLeaf::ROOT]);
        return Ok(Refined { tree, dealt, ownership, level_base: 0, level_cut: None });
    }
    let base = record.phase("base tree", comm, || base::build(facets, rules, division, comm))?;
    counters.voxelise(&base.work);
    let base::Base { mut ownership, dealt, level_base, .. } = base;
    let filed = record.phase("route", comm, || {
        voxelise::BinnedFacets::new(&base::route(facets, &ownership, comm))
    });
    let (mut tree, work) = record
        .phase("refine", comm, || voxelise::refine(&filed, &depth, &base::starts(&ownership)));
    counters.voxelise(&work);
    let level_cut = division.is_of_curve().then_some(level_base);
    let synchronise_replicas = if division.rebalances() { "rebalance" } else { "share top" };
    record.phase(synchronise_replicas, comm, || {
        if division.rebalances() {
            ownership = rebalance::of_base_tree(&tree, &ownership, level_base, comm);
        }
        // What several ranks hold of T0, each knows as far as its own octants ask for it.
        ownership.synchronise_replicas(&mut [&mut tree.split, &mut tree.crossing], comm);
    });
    Ok(Refined { tree, ownership, dealt, level_base, level_cut })
}

/// Weighs the leaves of the finished tree by octants of a level, and deals them out `anew` or not. Returns how many are in
/// the octant that has most. Collective.
fn deal_leaves(
    level: octant::Level,
    anew: bool,
    split: &mut PerLevel,
    refined: &mut Refined,
    sides: &mut Sides,
    rules: &Rules,
    comm: &dyn Comm,
) -> u64 {
    let Refined { tree, ownership, .. } = refined;
    let (crossing, inside, deleted) = (&mut tree.crossing, &mut sides.inside, &mut sides.deleted);
    let parts = rebalance::Parts { split, crossing, inside, deleted };
    let weighed = rebalance::Weighed::new(&parts, ownership, level, rules.keep_crossing);
    let heaviest = weighed.heaviest();
    if anew {
        *ownership = weighed.deal(parts, ownership, comm);
    }
    heaviest
}

/// Streams the leaves into the digest, and to disk if asked. Collective.
fn emit(
    meshed: &Meshed,
    out: Option<&OutDir>,
    comm: &dyn Comm,
) -> Result<(Counts, Written), Error> {
    let work = || match out {
        None => {
            let mut written = Written::default();
            let counts = meshed.leaves().emit(|words| {
                written.leaves += words.len() as u64;
                written.digests.add(words);
                check_interrupt()
            })?;
            Ok((counts, written))
        }
        Some(out) => {
            let mut part = out.part(comm.rank())?;
            let counts = meshed.leaves().emit(|words| {
                check_interrupt()?;
                part.add(words)
            })?;
            Ok((counts, part.finish()?))
        }
    };
    agree(comm, work())
}

/// Sums over the ranks, and writes the manifest. Collective.
fn finish(
    rules: &Rules,
    base: bool,
    counts: Counts,
    written: &Written,
    sides: &Sides,
    out: Option<&OutDir>,
    comm: &dyn Comm,
) -> Result<(Counts, digest::Digests, Vec<[u64; 3]>), Error> {
    let counts = counts.gather(comm);
    let (digests, parts) = write::gather(written, comm);
    let publish = || match out {
        Some(out) if comm.rank() == 0 => {
            out.manifest(&Manifest::new(rules, base, &counts, sides.ambiguous, &digests, &parts))
        }
        _ => Ok(()),
    };
    comm.agree(publish())?;
    Ok((counts, digests, parts))
}
