//! The leaves of the finished mesh: digests, files and the manifest.

use crate::error::Error;
use crate::mesh::Mesh;
use crate::output::manifest::{MeshEntry, gather, manifest};
use crate::output::stream::{Counts, total};
use crate::output::write::{OutDir, Part, part_name};
use bricks::digest::Digests;
use bricks::octant::{LEVEL_MAX, Level};
use files::interrupt::stop_at;
use ranks::{Comm, agree};
use std::io;

/// Streams the leaves that this rank owns into the digest, and into its file if words are to be written. Also returns the number of
/// leaves in its heaviest base leaf. Collective.
pub fn emit(
    mesh: &Mesh,
    out: Option<&OutDir>,
    comm: &dyn Comm,
) -> Result<(Counts, Digests, u64), Error> {
    // Boundaries are chosen by bricks of split octants, which fill octants of this level.
    let level = mesh.level_base.min(mesh.rules.level_deepest().saturating_sub(3));
    let mut heaviest = Heaviest::new(level);
    let name = part_name(comm.rank());
    let mut work = || {
        let begin = |out: &OutDir| Part::new(out.file(&name)?);
        let mut part = out.filter(|out| out.output.words).map(begin).transpose()?;
        let mut digests = Digests::default();
        let counts = mesh.emit(|words| {
            heaviest.add(words);
            digests.add(words);
            part.as_mut().map_or(Ok(()), |part| part.add(words))
        })?;
        part.map_or(Ok(()), |part| part.finish(total(&counts)))?;
        Ok((counts, digests))
    };
    let failed = |e: io::Error| out.expect("only files can fail").failed(&name)(e);
    let (counts, digests) = agree(comm, work().map_err(failed))?;
    Ok((counts, digests, heaviest.max))
}

/// Sums over the ranks, and writes the manifest if a directory is given. Returns the mesh in numbers. Collective.
pub fn finish(
    mesh: &Mesh,
    counts: &Counts,
    digests: &Digests,
    out: Option<&OutDir>,
    comm: &dyn Comm,
) -> Result<MeshEntry, Error> {
    let (digests, parts) = gather(total(counts), digests, comm);
    let by_level = comm.sums(counts.as_flattened());
    let entry = MeshEntry::new(mesh, by_level.as_chunks().0, &digests);
    let publish = || match out {
        Some(out) if comm.rank() == 0 => {
            stop_at(format_args!("manifest:0"));
            out.manifest(&manifest(&out.output, &entry, &digests, &parts))
        }
        _ => Ok(()),
    };
    agree(comm, publish())?;
    Ok(entry)
}

/// The number of leaves in this rank's heaviest octant of a level, as they are streamed in Morton order. It bounds the load balance of
/// any partition between such octants.
struct Heaviest {
    /// Bits of a leaf's code within an octant.
    shift: u32,
    /// The current octant, and its leaves so far.
    octant: u64,
    leaves: u64,
    max: u64,
}

impl Heaviest {
    fn new(level: Level) -> Self {
        Self { shift: 3 * (LEVEL_MAX - level), octant: 0, leaves: 0, max: 0 }
    }

    /// Counts the next leaves. One that is larger than an octant counts for the first in it.
    fn add(&mut self, mut words: &[u64]) {
        while let Some(octant) = words.first().map(|w| w >> 7 >> self.shift) {
            if octant != self.octant {
                (self.octant, self.leaves) = (octant, 0);
            }
            let count = words.partition_point(|w| w >> 7 >> self.shift <= octant);
            self.leaves += count as u64;
            self.max = self.max.max(self.leaves);
            words = &words[count..];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::{Side, word};

    #[test]
    fn leaves_are_counted_by_octant_whatever_the_pieces() {
        let of = |l, codes: &[u64]| -> Vec<u64> {
            codes.iter().map(|c| word(l, *c, Side::Outside)).collect()
        };
        let words =
            [of(2, &[1, 3]), of(1, &[1]), of(3, &[128, 129, 130, 200]), of(2, &[32, 63])].concat();
        for (level, want) in [(1, 3), (0, 9), (2, 3)] {
            for piece in 1..=words.len() {
                let mut heaviest = Heaviest::new(level);
                words.chunks(piece).for_each(|piece| heaviest.add(piece));
                assert_eq!(heaviest.max, want, "level {level}, pieces of {piece}");
            }
        }
    }
}
