//! The leaves of the finished mesh: digests, files, and the manifest `mesh.json` with what it has in common with the report of the run,
//! the mesh in numbers.

use crate::Mesh;
use crate::error::{Error, agree};
use crate::input::lattice::Rules;
use crate::output::stream::{Counts, total};
use crate::output::write::{OutDir, Output, Part, TREE, part_name};
use crate::sides::leaks::Leak;
use crate::sides::{Ambiguous, Summary};
use bricks::digest::{Digests, hex};
use bricks::octant::LEVEL_MAX;
use files::interrupt::stop_at;
use ranks::Comm;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io;
use std::iter::once;

/// The leaves that a rank has streamed: their number, their digests, and the number of leaves in its heaviest base leaf.
pub type Emitted = (Counts, Digests, u64);

/// Streams the leaves that this rank owns into the digest, and into its file if words are to be written. Collective.
pub fn emit(mesh: &Mesh, out: Option<&OutDir>, comm: &dyn Comm) -> Result<Emitted, Error> {
    // Boundaries are chosen by bricks of split octants, which fill octants of this level.
    let level = mesh.level_base.min(mesh.rules.level_deepest().saturating_sub(3));
    let shift = 3 * (LEVEL_MAX - level);
    let mut heaviest = Heaviest { shift, ..Heaviest::default() };
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
    let published = out.filter(|_| comm.rank() == 0).map_or(Ok(()), |out| {
        stop_at(format_args!("manifest:0"));
        out.manifest(&entry.manifest(&out.output, &digests, &parts))
    });
    agree(comm, published)?;
    Ok(entry)
}

/// The number of leaves in this rank's heaviest octant of a level, as they are streamed in Morton order. It bounds the load balance of
/// any partition between such octants.
#[derive(Default)]
struct Heaviest {
    /// Bits of a leaf's code within an octant.
    shift: u32,
    /// The current octant, and its leaves so far.
    octant: u64,
    leaves: u64,
    max: u64,
}

impl Heaviest {
    /// Counts the next leaves. One that is larger than an octant counts for the first in it.
    fn add(&mut self, mut words: &[u64]) {
        while let Some(octant) = words.first().map(|w| w >> 7 >> self.shift) {
            if octant != self.octant {
                (self.octant, self.leaves) = (octant, 0);
            }
            let is_within = |w: &u64| w >> 7 >> self.shift <= octant;
            // Far from the surface most leaves are larger than an octant: a search of all words would take longer than making the leaf.
            let near = (1..).map(|k| 1 << k).find(|&k| words.get(k).is_none_or(|w| !is_within(w)));
            let near = near.map_or(words.len(), |k| words.len().min(k));
            let count = words[..near].partition_point(is_within);
            self.leaves += count as u64;
            self.max = self.max.max(self.leaves);
            words = &words[count..];
        }
    }
}

/// The sides of leaves, in the order of their numbers.
pub const SIDES: [&str; 3] = ["outside", "inside", "crossing"];

/// A mesh in numbers: its rules, its leaves and its components. Boxes and seeds are in lattice units, everything else is in the
/// geometry's unit.
#[derive(Clone, Debug, Serialize)]
pub struct MeshEntry {
    program: &'static str,
    tree: &'static str,
    /// The rules.
    #[serde(flatten)]
    pub rules: Rules,
    geometry: Value,
    /// What is closed at a coarser spacing, and open at that of the mesh; left out if not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leaks: Option<Vec<Leak>>,
    /// Leaves of the mesh.
    pub leaves: u64,
    /// Leaves by level, 0 to 19.
    pub leaves_by_level: Vec<u64>,
    /// Leaves by side.
    pub leaves_by_side: BTreeMap<&'static str, u64>,
    /// The components of the base tree.
    pub components: Summary,
    components_ambiguous: Ambiguous,
    /// The mesh's digest.
    pub digest: String,
}

impl MeshEntry {
    /// The mesh with these numbers of leaves on all ranks, by level and side.
    pub fn new(mesh: &Mesh, by_level: &[[u64; 3]], digests: &Digests) -> Self {
        let Mesh { rules, sides, .. } = mesh;
        let leaves = by_level.as_flattened().iter().sum();
        let by_level = &by_level[..=LEVEL_MAX as usize];
        let by_side = [0, 1, 2].map(|side| by_level.iter().map(|l| l[side]).sum());
        Self {
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")),
            tree: if mesh.is_base { "base" } else { "final" },
            rules: rules.clone(),
            geometry: json!({ "facets": mesh.facets.total, "digest": hex(mesh.facets.digest) }),
            leaks: mesh.leaks.1.then(|| mesh.leaks.0.clone()),
            leaves,
            leaves_by_level: by_level.iter().map(|l| l.iter().sum()).collect(),
            leaves_by_side: SIDES.into_iter().zip(by_side).collect(),
            components: sides.summary,
            components_ambiguous: sides.summary.ambiguous,
            digest: hex(digests.whole()),
        }
    }

    /// Contents of `mesh.json`: this mesh with these digests and parts; parts and tree are named as far as `output` has them.
    fn manifest(&self, output: &Output, digests: &Digests, parts: &[PartEntry]) -> Value {
        let part = |(rank, &(leaves, digest)): (usize, &PartEntry)| json!({ "file": part_name(rank), "leaves": leaves, "digest": hex(digest) });
        let parts = parts.iter().enumerate().filter(|_| output.words).map(part);
        let mut manifest = json!(self);
        manifest["schema"] = "octree-leaf-set/1".into();
        manifest["octant_digests"] = digests.octants.iter().map(|&d| hex(d)).collect();
        manifest["parts"] = parts.collect();
        if output.tree {
            manifest["hyper_tree_grid"] = TREE.into();
        }
        manifest
    }
}

/// A part: its number of leaves and its digest.
pub type PartEntry = (u64, u128);

/// The digests by octant and the parts of the mesh, gathered from all ranks. Collective.
pub fn gather(leaves: u64, mine: &Digests, comm: &dyn Comm) -> (Digests, Vec<PartEntry>) {
    let words = |number: u64, digest: u128| [number, (digest >> 64) as u64, digest as u64];
    let read = |&[n, high, low]: &[u64; 3]| (n, u128::from(high) << 64 | u128::from(low));
    // The leaves of a rank lie in few of the octants.
    let octants = (0..).zip(&mine.octants).filter(|(_, d)| **d != 0).map(|(i, d)| words(i, *d));
    let mine: Vec<[u64; 3]> = once(words(leaves, mine.whole())).chain(octants).collect();
    let (mut digests, mut parts) = (Digests::default(), Vec::new());
    for (_, theirs) in comm.all_gather(mine.as_flattened()).messages() {
        let mut theirs = theirs.as_chunks().0.iter().map(read);
        parts.extend(theirs.next());
        digests.merge(theirs.map(|(octant, digest)| (octant as usize, digest)));
    }
    (digests, parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Job;
    use bricks::octant::{Side, word};
    use ranks::sim;

    #[test]
    fn more_leaves_than_2_to_the_37th_are_added_and_written() {
        let entries = sim::run(3, 1, |comm| {
            let (options, mut record) = (crate::tests::options(), Default::default());
            let job = &mut Job::new(&options, comm, &mut record);
            let quantised = crate::quantised(&crate::tests::case(), job).expect("a good case");
            let mesh = crate::grow(quantised, job).expect("a good case");
            let mut counts = Counts::default();
            counts[19] = [1 << 37, 3 << 32, 5 + comm.rank() as u64];
            let digests = Digests::default();
            let entry = finish(&mesh, &counts, &digests, None, comm).expect("nothing is written");
            let output = Output { directory: "mesh".into(), words: true, tree: true };
            let parts = [(total(&counts), 1)];
            (entry.leaves, entry.manifest(&output, &digests, &parts))
        });
        let [outside, inside, crossing] = [3_u64 << 37, 9 << 32, 5 + 6 + 7];
        for (rank, (leaves, manifest)) in (0..).zip(entries) {
            assert_eq!(leaves, outside + inside + crossing);
            assert_eq!(manifest["leaves_by_level"][19], leaves);
            let by_side = json!({ "outside": outside, "inside": inside, "crossing": crossing });
            assert_eq!(manifest["leaves_by_side"], by_side);
            assert_eq!(manifest["parts"][0]["leaves"], (1_u64 << 37) + (3 << 32) + 5 + rank);
        }
    }

    #[test]
    fn leaves_are_counted_by_octant_whatever_the_pieces() {
        let of = |l, codes: &[u64]| -> Vec<u64> {
            codes.iter().map(|c| word(l, *c, Side::Outside)).collect()
        };
        let words =
            [of(2, &[1, 3]), of(1, &[1]), of(3, &[128, 129, 130, 200]), of(2, &[32, 63])].concat();
        for (level, want) in [(1, 3), (0, 9), (2, 3)] {
            for piece in 1..=words.len() {
                let shift = 3 * (LEVEL_MAX - level);
                let mut heaviest = Heaviest { shift, ..Heaviest::default() };
                words.chunks(piece).for_each(|piece| heaviest.add(piece));
                assert_eq!(heaviest.max, want, "level {level}, pieces of {piece}");
            }
        }
    }
}
