//! Off-body hexahedral oct-tree meshes around facets, on any number of ranks, after O'Connell and
//! Karman, "Advances in Parallelization For Large Scale Oct-Tree Mesh Generation".
//!
//! [`mesh()`] runs ten phases, each in a module: 1 read, 2 quantise, 3 partition, 4 refine, 5 repartition after refinement, 6 sides,
//! 7 gradation, 8 repartition after gradation, 9 leaves, 10 finish; 3 to 8 are called in `grow.rs`. Each phase ends with a
//! check of the invariants of what it has made ([`check`]). The mesh is a function of the facets and the rules alone (see
//! `reference/DEFINITION.md`), not of the ranks, the partitioner or the base level.

pub mod check;
pub mod error;
pub mod grade;
mod grow;
/// Phases 1 and 2: the case, its geometry, and both on the lattice.
pub mod input {
    pub mod case;
    pub mod ingest;
    pub mod lattice;
    pub mod quantise;
    pub mod stl;
}
/// Phases 9 and 10: the leaves in order, files, manifest and report.
pub mod output {
    pub mod htg;
    pub mod leaves;
    pub mod report;
    pub mod stream;
    pub(crate) mod warnings;
    pub mod write;
}
mod mesh;
pub mod partition;
pub mod record;
pub mod refine;
pub mod sides;
#[cfg(test)]
#[path = "../bricks/src/values.rs"]
mod values;

pub use grow::grow;
pub use mesh::Mesh;
pub use record::{Job, Options};

use error::{Error, agree};
use files::interrupt::stop_at;
use input::case::Case;
use input::quantise::Quantised;
use input::{ingest, quantise};
use output::leaves::MeshEntry;
use output::report::Report;
use output::write::OutDir;
use output::{htg, leaves, stream};

/// Meshes a case, the same on all ranks: all ten phases, if `may_run` has no error on any rank after phase 2: it sees the facets and the
/// rules on the lattice. The report is the same on all ranks. Collective.
///
/// # Errors
/// The same on all ranks. Then nothing is left in the output directory.
pub fn mesh(
    case: &Case,
    job: &mut Job,
    may_run: impl FnOnce(&Quantised, &Job) -> Result<(), Error>,
) -> Result<Report, Error> {
    let out = job.options.out.as_ref().map(|output| OutDir::claim(output, job.comm)).transpose()?;
    let quantised = quantised(case, job)?;
    let answer = may_run(&quantised, job);
    ranks::uncounted(job.comm, || agree(job.comm, answer))?;
    let (mesh, entry) = made(quantised, out.as_ref(), job)?;
    let report = Report::new(&mesh, entry, job);
    stop_at(format_args!("complete:{}", job.comm.rank()));
    if let Some(out) = out {
        out.claim.keep();
    }
    Ok(report)
}

/// Phases 1 and 2. Collective.
///
/// # Errors
/// The same on all ranks.
pub fn quantised(case: &Case, job: &mut Job) -> Result<Quantised, Error> {
    // 1. Read: each rank reads its slice of the facets.
    let slice = job.phase("read", |comm| ingest::read(&case.source, comm))?;
    job.check(|comm| check::slices(&slice, comm));

    // 2. Quantise: the facets and the rules on the lattice.
    let given = if job.options.checks() { slice.facets.clone() } else { Vec::new() };
    let quantised = job.phase("quantise", |comm| quantise::quantise(case, slice, comm))?;
    job.check(|comm| check::lattice(&given, case, &quantised, comm));
    Ok(quantised)
}

/// Phases 3 to 10, on a simulated rank twice if so asked; the times are those of the last time. Collective.
fn made(
    quantised: Quantised,
    out: Option<&OutDir>,
    job: &mut Job,
) -> Result<(Mesh, MeshEntry), Error> {
    let (comm, alone, read) = (job.comm, job.options.time_alone, job.record.phases.len());
    let (mut given, mut made) = (Some(quantised), None);
    let mut make = || {
        let quantised = if alone { given.clone() } else { given.take() };
        let first = made.take().map(|_| job.counters);
        job.record.phases.truncate(read);
        made = quantised.map(|quantised| {
            let mesh = grow(quantised, job)?;
            let entry = finish(&mesh, out, job)?;
            Ok((mesh, entry))
        });
        let is_same = first.is_none_or(|first| first == job.counters);
        assert!(is_same, "a rank alone must do the same work: {first:?}, then {:?}", job.counters);
    };
    match alone {
        true => comm.repeat_alone(&mut make),
        false => make(),
    }
    made.expect("phases 3 to 10 have run")
}

/// Phases 9 and 10. Collective.
fn finish(mesh: &Mesh, out: Option<&OutDir>, job: &mut Job) -> Result<MeshEntry, Error> {
    // 9. Leaves: streamed in Morton order into the digest, and to disk on request; and the tree, level by level.
    let (counts, digests, heaviest) = job.phase("leaves", |comm| leaves::emit(mesh, out, comm))?;
    job.check(|comm| check::leaves(mesh, &counts, comm));
    if let Some(out) = out.filter(|out| out.output.tree) {
        job.phase("tree file", |comm| htg::write(mesh, out, comm))?;
    }

    // 10. Finish: sums over the ranks, and the manifest.
    let entry = job.phase("finish", |comm| leaves::finish(mesh, &counts, &digests, out, comm))?;
    job.counters.leaves = stream::total(&counts);
    job.counters.base_leaf_cells_max = heaviest;
    // The number of rays is a sum over the ranks, the same on all.
    job.counters.rays = if job.comm.rank() == 0 { mesh.sides.rays } else { 0 };
    let traffic = job.comm.traffic();
    (job.counters.messages, job.counters.message_bytes) = (traffic.messages, traffic.bytes);
    Ok(entry)
}

#[cfg(test)]
extern crate self as mesher;
#[cfg(test)]
#[path = "../tests/support/cases.rs"]
mod tests;
