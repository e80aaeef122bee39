//! The leaves of the finished mesh: digests, files and the manifest.

use crate::error::Error;
use crate::mesh::Mesh;
use crate::output::manifest::{self, Manifest};
use crate::output::stream::Counts;
use crate::output::write::{OutDir, Written};
use crate::partition::base_leaves::Heaviest;
use bricks::digest::Digests;
use files::interrupt::stop_at;
use ranks::{Comm, agree};

/// Sums over all ranks.
pub struct Totals {
    /// Leaves by level and side.
    pub counts: Counts,
    /// Digests of the mesh.
    pub digests: Digests,
    /// For each rank the number of its leaves, and the two halves of their digest.
    pub parts: Vec<[u64; 3]>,
}

/// Streams the leaves that this rank owns into the digest, and into its file if words are to be written. Also returns the number of
/// leaves in its heaviest base leaf. Collective.
pub fn emit(
    mesh: &Mesh,
    out: Option<&OutDir>,
    comm: &dyn Comm,
) -> Result<(Counts, Written, u64), Error> {
    // Boundaries are chosen by bricks of split octants, which fill octants of this level.
    let level = mesh.level_base.min(mesh.rules.level_deepest().saturating_sub(3));
    let mut heaviest = Heaviest::new(&mesh.base_starts, level);
    let mut work = || {
        let begin = |out: &OutDir| out.part(comm.rank());
        let mut part = out.filter(|out| out.output.words).map(begin).transpose()?;
        let mut written = Written::default();
        let counts = mesh.leaves().emit(|words| {
            heaviest.add(words);
            written.add(words);
            part.as_mut().map_or(Ok(()), |part| part.add(words))
        })?;
        part.map_or(Ok(()), |part| part.finish(written.leaves))?;
        Ok((counts, written))
    };
    let result: Result<_, Error> = work();
    let (counts, written) = agree(comm, result)?;
    Ok((counts, written, heaviest.max()))
}

/// Sums over the ranks, and writes the manifest if a directory is given. Collective.
pub fn finish(
    mesh: &Mesh,
    counts: &Counts,
    written: &Written,
    out: Option<&OutDir>,
    comm: &dyn Comm,
) -> Result<Totals, Error> {
    let counts = counts.gather(comm);
    let (digests, parts) = manifest::gather(written, comm);
    let publish = || match out {
        Some(out) if comm.rank() == 0 => {
            stop_at(format_args!("manifest:0"));
            out.manifest(&Manifest::new(&out.output, mesh, &counts, &digests, &parts))
        }
        _ => Ok(()),
    };
    agree(comm, publish())?;
    Ok(Totals { counts, digests, parts })
}
