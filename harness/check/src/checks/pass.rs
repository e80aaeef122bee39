//! One pass over the leaves, from a directory or from memory: it counts them, checks their order and builds the tree.

use super::{CheckResult, linear};
use contract::digest::{Digest, mix};
use contract::failure::Unusable;
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, Tally, octant_index};
use contract::mesh::{Mesh, NODES_MAX};
use contract::tree::{Builder, Tree};

/// What the pass found.
#[derive(Debug)]
pub(crate) struct Pass {
    pub(crate) tally: Tally,
    /// Number of leaves and digest of each part.
    pub(crate) parts: Vec<(u64, Digest)>,
    pub(crate) linear: CheckResult,
    /// `None` if the tree has more nodes than the limit.
    pub(crate) tree: Option<Tree>,
}

impl Pass {
    /// Reads all leaves; the tree may have at most `nodes_max` distinct nodes.
    ///
    /// # Errors
    /// If a part or the tree cannot be read.
    pub(crate) fn over(mesh: &Mesh, nodes_max: usize) -> Result<Self, Unusable> {
        let mut state = State::new(&mesh.manifest, "", nodes_max);
        mesh.stream(&mut |part, run| {
            state.count(part, run);
            state.order(part, run);
            state.build(run);
            true
        })?;
        Ok(state.finish())
    }

    /// Takes the leaves of a mesh in memory. `prefix` begins every finding.
    pub(crate) fn of(set: &LeafSet, prefix: &'static str) -> Self {
        let mut state = State::new(&set.manifest, prefix, NODES_MAX);
        for (part, words) in set.parts.iter().enumerate() {
            state.count(part, words);
            state.order(part, words);
        }
        state.build(&set.words);
        state.finish()
    }
}

struct State<'a> {
    prefix: &'static str,
    manifest: &'a Manifest,
    root: Root,
    nodes_max: usize,
    /// Number of leaves by the low seven bits of their words, which are level and side.
    by_code: [u64; 128],
    octants: Vec<Digest>,
    parts: Vec<(u64, Digest)>,
    /// The last word of each part so far.
    last_of_part: Vec<Option<u64>>,
    /// The last word that was added to the tree.
    last: u64,
    builder: Builder,
    linear: CheckResult,
}

impl<'a> State<'a> {
    fn new(manifest: &'a Manifest, prefix: &'static str, nodes_max: usize) -> Self {
        Self {
            prefix,
            manifest,
            root: manifest.root,
            nodes_max,
            by_code: [0; 128],
            octants: vec![Digest::default(); contract::manifest::OCTANTS],
            parts: Vec::new(),
            last_of_part: Vec::new(),
            last: 0,
            builder: Builder::default(),
            linear: CheckResult::new(linear::CHECK.name),
        }
    }

    /// Adds to counts and digests. Digests are summed per octant first, because this loop dominates the time of
    /// the pass.
    fn count(&mut self, part: usize, run: &[u64]) {
        if self.parts.len() <= part {
            self.parts.resize(part + 1, (0, Digest::default()));
            self.last_of_part.resize(part + 1, None);
        }
        self.parts[part].0 += run.len() as u64;
        for words in run.chunk_by(|&a, &b| octant_index(a) == octant_index(b)) {
            let mut sum = 0u128;
            for &w in words {
                sum = sum.wrapping_add(mix(w));
                self.by_code[(w & 127) as usize] += 1;
            }
            self.parts[part].1.merge(Digest(sum));
            self.octants[octant_index(words[0])].merge(Digest(sum));
        }
    }

    fn order(&mut self, part: usize, run: &[u64]) {
        let mut before = self.last_of_part[part];
        for &w in run {
            if let Some(before) = before.filter(|&b| b >= w) {
                let file = self.manifest.parts.get(part).map(|part| &part.file);
                let file = file.or(self.manifest.hyper_tree_grid.as_ref());
                let file = format!("{}{}", self.prefix, file.map_or("a part", String::as_str));
                linear::unsorted(&file, before, w, &self.root, &mut self.linear);
            }
            before = Some(w);
        }
        self.last_of_part[part] = before;
    }

    /// Adds to the tree, unless it exceeds the limit: counts and digests continue without it.
    fn build(&mut self, run: &[u64]) {
        if self.builder.nodes() > self.nodes_max {
            return;
        }
        for &w in run {
            match self.builder.push(w) {
                Ok(()) => self.last = w,
                Err(why) => {
                    let (prefix, last) = (self.prefix, self.last);
                    linear::refused(prefix, why, w, last, &self.root, &mut self.linear);
                }
            }
        }
    }

    fn finish(mut self) -> Pass {
        let mut tally = Tally { octants: self.octants, ..Tally::default() };
        for (code, &leaves) in self.by_code.iter().enumerate() {
            tally.count(code as u64, leaves);
        }
        tally.finish();
        self.linear.examined = tally.leaves;
        // A part without leaves gives no run.
        self.parts.resize(self.parts.len().max(self.manifest.parts.len()), (0, Digest::default()));
        let fits = self.builder.nodes() <= self.nodes_max;
        let tree = fits.then(|| self.builder.finish());
        Pass { tally, parts: self.parts, linear: self.linear, tree }
    }
}
