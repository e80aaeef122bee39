//! One pass over the leaves, from a directory or from memory: it counts them, checks their order and builds the tree.
//!
//! The check `linear`: every word is a leaf, each part is sorted, and no two leaves overlap. Sections 7 and 8 of
//! reference/DEFINITION.md. It does not detect holes (`complete` does), nor wrong sides (`sides` does).

use super::CheckResult;
use super::identical::Named;
use contract::failure::Result;
use contract::htg::Block;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, Part};
use contract::mesh::{Mesh, NODES_MAX};
use contract::tree::{Builder, Tree};
use contract::word;

/// What the pass found.
pub(crate) struct Pass {
    /// The manifest's entries about leaves, as they should be; of others it has the root alone.
    pub(crate) tally: Manifest,
    pub(crate) linear: CheckResult,
    /// `None` if the tree has more nodes than the limit.
    pub(crate) tree: Option<Tree>,
}

impl Pass {
    /// Reads all leaves; the tree may have at most `nodes_max` distinct nodes.
    ///
    /// # Errors
    /// If a part or the tree cannot be read.
    pub(crate) fn over(mesh: &Mesh, nodes_max: usize) -> Result<Self> {
        let mut state = State::new(&mesh.manifest, nodes_max);
        mesh.stream(&mut |part, run| {
            state.count(part, run);
            state.build(run);
            true
        })?;
        Ok(state.finish())
    }

    /// Takes the leaves of a mesh in memory.
    pub(crate) fn of(set: &LeafSet) -> Self {
        let mut state = State::new(&set.manifest, NODES_MAX);
        let blocks = |words: &[u64]| -> Vec<Block> {
            words.iter().map(|&first| Block { first, depth: 0 }).collect()
        };
        (0..).zip(&set.parts).for_each(|(part, words)| state.count(part, &blocks(words)));
        state.build(&blocks(&set.words));
        state.finish()
    }
}

struct State {
    nodes_max: usize,
    tally: Manifest,
    linear: CheckResult,
    /// The last word of each part so far.
    last_of_part: Vec<Option<u64>>,
    /// The last word that was added to the tree.
    last: u64,
    builder: Builder,
}

impl State {
    fn new(manifest: &Manifest, nodes_max: usize) -> Self {
        // Of a mesh without parts, the tree is the only one.
        let part = |file: &String| Part { file: file.clone(), ..Part::default() };
        let parts: Vec<Part> = manifest.names().map(part).collect();
        let last_of_part = vec![None; parts.len()];
        let mut tally = Manifest { root: manifest.root, parts, ..Manifest::default() };
        tally.clear_leaves();
        let (linear, builder) = (CheckResult::new(super::LINEAR), Builder::default());
        Self { nodes_max, tally, linear, last_of_part, last: 0, builder }
    }

    /// Adds to counts and digests, and checks the order.
    fn count(&mut self, part: usize, run: &[Block]) {
        let (last, root) = (&mut self.last_of_part[part], self.tally.root);
        for block in run {
            let (of_block, word) = (self.tally.add_block(block), block.first);
            let Part { file, leaves, digest } = &mut self.tally.parts[part];
            digest.merge(of_block);
            *leaves += block.leaves();
            if let Some(before) = last.replace(word).filter(|&before| before >= word) {
                let [before, word] = [before, word].map(|word| Named(Some(word), root));
                self.linear.report(format_args!("{file} is not sorted: {word} follows {before}"));
            }
        }
    }

    /// Adds to the tree, unless it exceeds the limit: counts and digests continue without it.
    fn build(&mut self, run: &[Block]) {
        if self.builder.nodes() > self.nodes_max {
            return;
        }
        for block in run {
            if self.builder.push_block(block).is_ok() {
                self.last = block.first;
                continue;
            }
            let root = self.tally.root;
            let [leaf, last] = [block.first, self.last].map(|word| Named(Some(word), root));
            match word::check(block.first) {
                Err(_) => self.linear.report(format_args!("not a leaf: {leaf}")),
                Ok(()) => self.linear.report(format_args!("two leaves overlap: {leaf} and {last}")),
            }
        }
    }

    fn finish(mut self) -> Pass {
        self.linear.examined = self.tally.leaves;
        let tree = (self.builder.nodes() <= self.nodes_max).then(|| self.builder.finish());
        Pass { tally: self.tally, linear: self.linear, tree }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::Subject;
    use contract::testing::{leaf_set, words_of};

    #[test]
    fn every_leaf_is_examined_and_one_that_is_not_sorted_is_found() {
        let mut mesh = leaf_set(vec![words_of(|o| o.level < 1)]);
        let check = |mesh: &LeafSet| {
            let results = super::super::all(&Subject::new(None, mesh.manifest.tree, mesh));
            results.into_iter().find(|result| result.name == super::super::LINEAR).unwrap()
        };
        let result = check(&mesh);
        assert_eq!((result.examined, result.findings_total), (8, 0));
        mesh.parts[0].swap(2, 3);
        let result = check(&mesh);
        let [finding] = &result.findings[..] else { panic!("{result}") };
        let text = finding.strip_prefix("leaves-00000.npy is not sorted: outside leaf: octant 2 ");
        assert!(
            text.is_some_and(|rest| rest.contains("follows outside leaf: octant 3 ")),
            "{result}"
        );
    }
}
