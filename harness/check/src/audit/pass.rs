//! The pass over the leaves: it counts them, checks their order and builds the tree.

use super::{AuditOptions, CAPACITY};
use crate::checks::{CheckResult, linear};
use contract::digest::{Digest, mix};
use contract::lattice::Root;
use contract::leafset::{Leaves, ReadError};
use contract::manifest::{Tally, octant_index};
use contract::tree::{Builder, Tree};

/// The result of the pass.
pub(super) struct Pass {
    pub(super) tally: Tally,
    /// Number of leaves and digest of each part.
    pub(super) parts: Vec<(u64, Digest)>,
    pub(super) linear: CheckResult,
    /// `None` if the tree exceeds the limit, which `capacity` reports.
    pub(super) tree: Option<Tree>,
    pub(super) capacity: Option<CheckResult>,
}

impl Pass {
    /// Reads all leaves.
    ///
    /// # Errors
    /// If a part or the tree cannot be read.
    pub(super) fn over(leaves: &Leaves, options: &AuditOptions) -> Result<Self, ReadError> {
        let mut state = State::new(leaves);
        let mut fits = true;
        let mut add = |part: usize, run: &[u64]| {
            state.add(part, run);
            // Counts and digests continue without the tree.
            fits &= state.builder.nodes() <= options.nodes_max;
            state.building = fits;
            true
        };
        match leaves {
            Leaves::Words(set) => super::merge::merge(&set.parts, &mut add)
                .map_err(|(part, error)| ReadError::part(&set.parts[part], error))?,
            Leaves::Tree(tree, _) => {
                tree.words(&mut |run| add(0, run)).map_err(|error| ReadError::tree(tree, error))?
            }
        }
        Ok(state.finish(fits, options))
    }

    pub(super) fn nodes(&self) -> usize {
        self.tree.as_ref().map_or(0, Tree::nodes)
    }
}

struct State {
    /// Names of the parts, or of the tree.
    files: Vec<String>,
    root: Root,
    /// Number of leaves by the low seven bits of their words, which are level and side.
    by_code: [u64; 128],
    octants: Vec<Digest>,
    parts: Vec<(u64, Digest)>,
    /// The last word of each part so far.
    last_of_part: Vec<Option<u64>>,
    /// The last word that was added to the tree.
    last: u64,
    builder: Builder,
    building: bool,
    linear: CheckResult,
}

impl State {
    fn new(leaves: &Leaves) -> Self {
        let manifest = leaves.manifest();
        let files: Vec<String> = match leaves {
            Leaves::Words(_) => manifest.parts.iter().map(|part| part.file.clone()).collect(),
            Leaves::Tree(..) => manifest.hyper_tree_grid.iter().cloned().collect(),
        };
        Self {
            root: manifest.root,
            by_code: [0; 128],
            octants: vec![Digest::default(); contract::manifest::OCTANTS],
            parts: vec![(0, Digest::default()); files.len()],
            last_of_part: vec![None; files.len()],
            files,
            last: 0,
            builder: Builder::default(),
            building: true,
            linear: CheckResult::new("linear"),
        }
    }

    /// Adds a run of words of one part.
    fn add(&mut self, part: usize, run: &[u64]) {
        self.count(part, run);
        let mut before = self.last_of_part[part];
        for &w in run {
            if let Some(before) = before.filter(|&b| b >= w) {
                let file = &self.files[part];
                linear::unsorted(file, before, w, &self.root, &mut self.linear);
            }
            before = Some(w);
            if self.building {
                match self.builder.push(w) {
                    Ok(()) => self.last = w,
                    Err(why) => {
                        linear::refused("", why, w, self.last, &self.root, &mut self.linear)
                    }
                }
            }
        }
        self.last_of_part[part] = before;
    }

    /// Adds to counts and digests. Digests are summed per octant first, because this loop dominates the time of
    /// the pass.
    fn count(&mut self, part: usize, run: &[u64]) {
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

    fn finish(mut self, fits: bool, options: &AuditOptions) -> Pass {
        let mut tally = Tally { octants: self.octants, ..Tally::default() };
        for (code, &leaves) in self.by_code.iter().enumerate() {
            tally.count(code as u64, leaves);
        }
        tally.finish();
        self.linear.examined = tally.leaves;
        let capacity = (!fits).then(|| {
            let mut result = CheckResult::new(CAPACITY);
            let nodes = options.nodes_max;
            result.report(format!(
                "the tree has more than {nodes} distinct octants and was not checked; increase the limit"
            ));
            result
        });
        let tree = fits.then(|| self.builder.finish());
        Pass { tally, parts: self.parts, linear: self.linear, tree, capacity }
    }
}
