//! One pass over the leaves, from a directory or from memory: it counts them, checks their order and builds the tree.
//!
//! The check `linear`: every word is a leaf, each part is sorted, and no two leaves overlap. Sections 7 and 8 of
//! reference/DEFINITION.md. It does not detect holes (`complete` does), nor wrong sides (`sides` and `crossing` do).

use super::{Check, CheckResult, Subject, always, identical, nothing};
use contract::digest::Digest;
use contract::failure::Unusable;
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, Tally, octant_index};
use contract::mesh::{Mesh, NODES_MAX};
use contract::tree::{Builder, Refusal, Tree};

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
    /// The leaves as a tree.
    pub(crate) fn tree(&self) -> &Tree {
        self.tree.as_ref().expect("without a tree, no check of it runs")
    }

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
    tally: Tally,
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
            tally: Tally::default(),
            parts: Vec::new(),
            last_of_part: Vec::new(),
            last: 0,
            builder: Builder::default(),
            linear: CheckResult::new(CHECK.name),
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
            let digest = Digest::of(words);
            self.parts[part].1.merge(digest);
            self.tally.octants[octant_index(words[0])].merge(digest);
        }
        run.iter().for_each(|&word| self.tally.count(word));
    }

    fn order(&mut self, part: usize, run: &[u64]) {
        let mut before = self.last_of_part[part];
        for &w in run {
            if let Some(before) = before.filter(|&b| b >= w) {
                let file = self.manifest.parts.get(part).map(|part| &part.file);
                let file = file.or(self.manifest.hyper_tree_grid.as_ref());
                let file = format!("{}{}", self.prefix, file.map_or("a part", String::as_str));
                unsorted(&file, before, w, &self.root, &mut self.linear);
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
                    refused(prefix, why, w, last, &self.root, &mut self.linear);
                }
            }
        }
    }

    fn finish(mut self) -> Pass {
        self.tally.finish();
        self.linear.examined = self.tally.leaves;
        // A part without leaves gives no run.
        self.parts.resize(self.parts.len().max(self.manifest.parts.len()), (0, Digest::default()));
        let fits = self.builder.nodes() <= self.nodes_max;
        let tree = fits.then(|| self.builder.finish());
        Pass { tally: self.tally, parts: self.parts, linear: self.linear, tree }
    }
}

pub(super) const CHECK: Check = Check { name: "linear", wanted: always, needs: nothing, run };

/// The pass over the leaves has found what there is to report.
fn run(subject: &Subject, result: &mut CheckResult) {
    *result = subject.pass.linear.clone();
    if let Some((_, base)) = &subject.base {
        result.append(&base.linear);
    }
}

/// Reports a word that is not greater than its predecessor in a part.
fn unsorted(part: &str, before: u64, word: u64, root: &Root, result: &mut CheckResult) {
    result.report_with(|| {
        let (before, word) = (identical::describe(before, root), identical::describe(word, root));
        format!("{part} is not sorted: {word} follows {before}")
    });
}

/// Reports a word that is not a leaf, or overlaps the last valid leaf.
fn refused(
    prefix: &str,
    why: Refusal,
    word: u64,
    last: u64,
    root: &Root,
    result: &mut CheckResult,
) {
    result.report_with(|| {
        let leaf = identical::describe(word, root);
        match why {
            Refusal::Fault(_) => format!("{prefix}not a leaf: {leaf}"),
            Refusal::Overlap => {
                format!(
                    "{prefix}two leaves overlap: {leaf} and {}",
                    identical::describe(last, root)
                )
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::case::Case;
    use contract::leafset::LeafSet;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn the_leaves_of_the_mesh_and_of_the_base_tree_are_examined() {
        let text =
            "spacing_min = 4.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
        let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let (fine, coarse) = (words_of(|o| o.level < 2), words_of(|o| o.level < 1));
        let (mesh, mut base) = (leaf_set(vec![fine]), leaf_set(vec![coarse]));
        let check = |base: &LeafSet| {
            super::super::only(&Subject::new(&case, &mesh).with_base(base), &["linear"]).remove(0)
        };
        let result = check(&base);
        assert_eq!((result.examined, result.findings_total), (64 + 8, 0));
        base.parts[0].swap(2, 3);
        let result = check(&base);
        let [finding] = &result.findings[..] else { panic!("{result}") };
        let text =
            finding.strip_prefix("T0: leaves-00000.npy is not sorted: outside leaf: octant 2 ");
        assert!(
            text.is_some_and(|rest| rest.contains("follows outside leaf: octant 3 ")),
            "{result}"
        );
    }
}
