//! The one pass over the leaves: counting, order, tree.

use super::{AuditOptions, CAPACITY};
use crate::checks::{CheckResult, linear};
use contract::digest::{Digest, mix};
use contract::lattice::Root;
use contract::leafset::{LeafDir, ReadError};
use contract::manifest::{BySide, Tally, octant_index};
use contract::tree::{Builder, Tree};

/// What one pass leaves behind.
pub(super) struct Pass {
    pub(super) tally: Tally,
    /// Leaves and digest of each part.
    pub(super) parts: Vec<(u64, Digest)>,
    pub(super) linear: CheckResult,
    /// Nothing if it would have become too large; `capacity` says so.
    pub(super) tree: Option<Tree>,
    pub(super) capacity: Option<CheckResult>,
}

impl Pass {
    /// Reads all leaves.
    pub(super) fn over(set: &LeafDir, options: &AuditOptions) -> Result<Self, ReadError> {
        let mut state = State::new(set);
        let mut fits = true;
        super::merge::merge(&set.parts, &mut |part, run| {
            state.take(part, run);
            // Counts and digests go on where the tree cannot.
            fits &= state.builder.nodes() <= options.nodes_max;
            state.building = fits;
            true
        })
        .map_err(|(part, e)| {
            let path = set.parts[part].path().to_owned();
            ReadError::Part { path, source: e.into() }
        })?;
        Ok(state.finish(fits, options))
    }

    pub(super) fn nodes(&self) -> usize {
        self.tree.as_ref().map_or(0, Tree::nodes)
    }
}

struct State<'a> {
    set: &'a LeafDir,
    root: Root,
    /// Leaves by the low seven bits of their words: level and side at once.
    by_code: [u64; 128],
    octants: Vec<Digest>,
    parts: Vec<(u64, Digest)>,
    /// Each part's last word, if it had one.
    last_of_part: Vec<Option<u64>>,
    /// Last word that the tree took.
    last: u64,
    builder: Builder,
    building: bool,
    linear: CheckResult,
}

impl<'a> State<'a> {
    fn new(set: &'a LeafDir) -> Self {
        Self {
            set,
            root: set.manifest.root,
            by_code: [0; 128],
            octants: vec![Digest::default(); contract::manifest::OCTANTS],
            parts: vec![(0, Digest::default()); set.parts.len()],
            last_of_part: vec![None; set.parts.len()],
            last: 0,
            builder: Builder::default(),
            building: true,
            linear: CheckResult::new("linear"),
        }
    }

    /// Takes a run of words from one part.
    fn take(&mut self, part: usize, run: &[u64]) {
        self.parts[part].0 += run.len() as u64;
        for stretch in run.chunk_by(|&a, &b| octant_index(a) == octant_index(b)) {
            let mut sum = 0u128;
            for &w in stretch {
                sum = sum.wrapping_add(mix(w));
                self.by_code[(w & 127) as usize] += 1;
            }
            self.parts[part].1.merge(Digest(sum));
            self.octants[octant_index(stretch[0])].merge(Digest(sum));
        }
        let mut before = self.last_of_part[part];
        for &w in run {
            if let Some(before) = before.filter(|&b| b >= w) {
                let file = &self.set.manifest.parts[part].file;
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

    fn finish(mut self, fits: bool, options: &AuditOptions) -> Pass {
        let mut tally = Tally { octants: self.octants, ..Tally::default() };
        for (code, &count) in self.by_code.iter().enumerate() {
            tally.leaves += count;
            if let Some(level) = tally.by_level.get_mut(code >> 2) {
                *level += count;
            }
            let BySide { outside, inside, crossing } = &mut tally.by_side;
            match code & 3 {
                0 => *outside += count,
                1 => *inside += count,
                2 => *crossing += count,
                _ => {}
            }
        }
        tally.close();
        self.linear.examined = tally.leaves;
        let capacity = (!fits).then(|| {
            let mut result = CheckResult::new(CAPACITY);
            let nodes = options.nodes_max;
            result
                .find(format!("more than {nodes} distinct octants: allow more to check the tree"));
            result
        });
        let tree = fits.then(|| self.builder.finish());
        Pass { tally, parts: self.parts, linear: self.linear, tree, capacity }
    }
}
