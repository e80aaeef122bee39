//! One pass over the leaves, from a directory or from memory: it counts them, checks their order and builds the tree.
//!
//! The check `linear`: every word is a leaf, each part is sorted, and no two leaves overlap. Sections 7 and 8 of
//! reference/DEFINITION.md. It does not detect holes (`complete` does), nor wrong sides (`sides` and `crossing` do).

use super::{Check, CheckResult, always, identical, nothing};
use contract::digest::Digest;
use contract::failure::Failure;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, octant_index};
use contract::mesh::{Mesh, NODES_MAX};
use contract::tree::{Builder, Tree};
use contract::word;

/// What the pass found.
#[derive(Debug)]
pub(crate) struct Pass {
    /// The manifest's entries about leaves, as they should be; it has no others.
    pub(crate) tally: Manifest,
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
    pub(crate) fn over(mesh: &Mesh, nodes_max: usize) -> Result<Self, Failure> {
        let mut state = State::new(&mesh.manifest, "", nodes_max);
        mesh.stream(&mut |part, run| {
            state.count(part, run);
            state.build(run);
            true
        })?;
        Ok(state.finish())
    }

    /// Takes the leaves of a mesh in memory. `prefix` begins every finding.
    pub(crate) fn of(set: &LeafSet, prefix: &'static str) -> Self {
        let mut state = State::new(&set.manifest, prefix, NODES_MAX);
        (0..).zip(&set.parts).for_each(|(part, words)| state.count(part, words));
        state.build(&set.words);
        state.finish()
    }
}

struct State<'a> {
    prefix: &'static str,
    manifest: &'a Manifest,
    nodes_max: usize,
    /// What was found so far, without counts and tree.
    pass: Pass,
    /// Number of leaves by the low seven bits of their words, which are level and side.
    by_code: [u64; 128],
    /// The last word of each part so far.
    last_of_part: Vec<Option<u64>>,
    /// The last word that was added to the tree.
    last: u64,
    builder: Builder,
}

impl<'a> State<'a> {
    fn new(manifest: &'a Manifest, prefix: &'static str, nodes_max: usize) -> Self {
        // A part without leaves gives no run.
        let parts = manifest.parts.len();
        let mut tally = Manifest::default();
        tally.clear_leaves();
        let pass = Pass {
            tally,
            parts: vec![(0, Digest::default()); parts],
            linear: CheckResult::new(CHECK.name),
            tree: None,
        };
        let (last_of_part, builder) = (vec![None; parts], Builder::default());
        Self {
            prefix,
            manifest,
            nodes_max,
            pass,
            last_of_part,
            last: 0,
            builder,
            by_code: [0; 128],
        }
    }

    /// Adds to counts and digests, and checks the order. Digests are summed per octant first, because this loop dominates the
    /// time of the pass.
    fn count(&mut self, part: usize, run: &[u64]) {
        let Pass { tally, parts, linear, .. } = &mut self.pass;
        if parts.len() <= part {
            parts.resize(part + 1, (0, Digest::default()));
            self.last_of_part.resize(part + 1, None);
        }
        parts[part].0 += run.len() as u64;
        for words in run.chunk_by(|&a, &b| octant_index(a) == octant_index(b)) {
            let digest = Digest::of(words);
            parts[part].1.merge(digest);
            tally.octant_digests[octant_index(words[0])].merge(digest);
        }
        let mut last = self.last_of_part[part];
        for &word in run {
            self.by_code[(word & 127) as usize] += 1;
            if let Some(before) = last.replace(word).filter(|&before| before >= word) {
                linear.report_with(|| {
                    let [before, word] =
                        [before, word].map(|w| identical::describe(w, &self.manifest.root));
                    let file = self.manifest.parts.get(part).map(|part| &part.file);
                    let file = file.or(self.manifest.hyper_tree_grid.as_ref());
                    let file = file.map_or("a part", String::as_str);
                    format!("{}{file} is not sorted: {word} follows {before}", self.prefix)
                });
            }
        }
        self.last_of_part[part] = last;
    }

    /// Adds to the tree, unless it exceeds the limit: counts and digests continue without it.
    fn build(&mut self, run: &[u64]) {
        if self.builder.nodes() > self.nodes_max {
            return;
        }
        for &word in run {
            if self.builder.push(word).is_ok() {
                self.last = word;
                continue;
            }
            self.pass.linear.report_with(|| {
                let [leaf, last] =
                    [word, self.last].map(|word| identical::describe(word, &self.manifest.root));
                match word::fault(word) {
                    Some(_) => format!("{}not a leaf: {leaf}", self.prefix),
                    None => format!("{}two leaves overlap: {leaf} and {last}", self.prefix),
                }
            });
        }
    }

    fn finish(mut self) -> Pass {
        (0..).zip(self.by_code).for_each(|(code, leaves)| self.pass.tally.count(code, leaves));
        self.pass.tally.finish();
        self.pass.linear.examined = self.pass.tally.leaves;
        let fits = self.builder.nodes() <= self.nodes_max;
        Pass { tree: fits.then(|| self.builder.finish()), ..self.pass }
    }
}

/// The pass over the leaves has found what there is to report.
pub(super) const CHECK: Check = Check {
    name: "linear",
    wanted: always,
    needs: nothing,
    run: |subject, result| {
        *result = subject.pass.linear.clone();
        if let Some((_, base)) = &subject.base {
            result.append(&base.linear);
        }
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::Subject;
    use contract::case::Case;
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
