//! The leaves of a mesh on disk, found by bisection in the mapped part files.
//!
//! Only pages that a search touches are read. The words of each part are assumed to be sorted; if they are not, a
//! search may miss leaves, but it ends, because every octant is at most 19 levels deep.

use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::path::Path;
use std::rc::Rc;

use contract::leafset::{self, ReadError};
use contract::manifest::Manifest;
use contract::npy::MappedPart;
use contract::octant::{LEVEL_MAX, Octant};
use contract::word::{self, Leaf, Side};
use rustc_hash::FxHashMap;

/// Octants with more words keep the ranges of their words, so that bisection below them is short.
const WORDS_FEW: usize = 4096;

/// A mesh on disk.
#[derive(Debug)]
pub struct Leaves {
    /// The manifest.
    pub manifest: Manifest,
    parts: Vec<MappedPart>,
    spans: RefCell<FxHashMap<u64, Rc<[Span]>>>,
    nodes: RefCell<FxHashMap<u64, Node>>,
    /// A word that is not a leaf or overlaps another one.
    invalid: Cell<Option<u64>>,
}

/// The words of an octant in one part.
#[derive(Clone, Debug)]
struct Span {
    part: usize,
    range: Range<usize>,
}

/// The children of an octant, one bit per digit. A child that is in neither set has no leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Node {
    /// Children that are leaves.
    pub leaves: u8,
    /// Children that are split.
    pub split: u8,
}

impl Node {
    /// Whether the octant has leaves below it.
    pub fn is_split(self) -> bool {
        self.leaves | self.split != 0
    }
}

/// A number that identifies an octant.
pub fn id(octant: &Octant) -> u64 {
    word::key_of(octant.corner) << 5 | u64::from(octant.level)
}

/// The parent of an octant other than the root.
pub fn parent(octant: &Octant) -> Octant {
    octant.ancestor(octant.level - 1)
}

impl Leaves {
    /// Opens a leaf-set directory. No leaf is read.
    ///
    /// # Errors
    /// If the directory is not a leaf set.
    pub fn open(dir: &Path) -> Result<Self, ReadError> {
        let set = leafset::open(dir)?;
        let map = |part| contract::npy::PartFile::map(part).map_err(|e| ReadError::part(part, e));
        let parts = set.parts.iter().map(map).collect::<Result<Vec<_>, _>>()?;
        let all = parts.iter().enumerate().map(|(part, p)| Span { part, range: 0..p.len() });
        let spans = FxHashMap::from_iter([(id(&Octant::ROOT), all.collect())]);
        Ok(Self {
            manifest: set.manifest,
            parts,
            spans: RefCell::new(spans),
            nodes: RefCell::default(),
            invalid: Cell::new(None),
        })
    }

    /// Announces that few words will be read, at random places, so that the system does not read ahead of them.
    pub fn expect_few_reads(&self) {
        self.parts.iter().for_each(MappedPart::expect_few_reads);
    }

    /// A word that was found and that no correct mesh contains.
    pub fn invalid(&self) -> Option<u64> {
        self.invalid.get()
    }

    /// The leaf that contains a level-19 cell.
    pub fn leaf_at(&self, cell: [u32; 3]) -> Option<Leaf> {
        let key = word::key_of(cell);
        let before = |part: &MappedPart| {
            let after = part.lower_bound(0..part.len(), (key << 7) | 127);
            after.checked_sub(1).map(|i| part.word(i))
        };
        let cell = Octant { corner: cell, level: LEVEL_MAX };
        let leaves = self.parts.iter().filter_map(before).filter_map(|w| word::decode(w).ok());
        leaves.into_iter().find(|leaf| leaf.octant.contains(&cell))
    }

    /// The children of an octant; the empty node if the octant is a leaf, part of a leaf, or without leaves.
    pub fn node(&self, octant: &Octant) -> Node {
        let id = id(octant);
        if let Some(&node) = self.nodes.borrow().get(&id) {
            return node;
        }
        let node = self.find_node(octant);
        self.nodes.borrow_mut().insert(id, node);
        node
    }

    fn find_node(&self, octant: &Octant) -> Node {
        let mut node = Node::default();
        if octant.level == LEVEL_MAX {
            return node;
        }
        let spans = self.spans(octant);
        for digit in 0..8 {
            let child = octant.child(digit);
            for Span { part, range } in spans.iter() {
                let range = self.within(*part, range.clone(), &child);
                if range.is_empty() {
                    continue;
                }
                let first = self.parts[*part].word(range.start);
                let level = word::level(first);
                if word::fault(first).is_some() {
                    self.invalid.set(Some(first));
                } else if level == child.level {
                    node.leaves |= 1 << digit;
                } else if level > child.level {
                    node.split |= 1 << digit;
                }
            }
        }
        // A leaf beside leaves that it contains is not a tree.
        if node.leaves & node.split != 0 {
            let first = spans.first().map(|s| self.parts[s.part].word(s.range.start));
            self.invalid.set(first);
        }
        node
    }

    /// Number of leaves in an octant.
    pub fn count(&self, octant: &Octant) -> u64 {
        let within = |s: &Span| self.within(s.part, s.range.clone(), octant).len() as u64;
        self.spans(octant).iter().map(within).sum()
    }

    /// Whether an octant contains a crossing leaf. All its words are read if it does not.
    pub fn has_crossing(&self, octant: &Octant) -> bool {
        self.spans(octant).iter().any(|s| {
            let mut range = self.within(s.part, s.range.clone(), octant);
            range.any(|i| self.parts[s.part].word(i) & 3 == Side::Crossing as u64)
        })
    }

    /// The part of a range of words that lies in an octant.
    fn within(&self, part: usize, range: Range<usize>, octant: &Octant) -> Range<usize> {
        let (key, part) = (word::key_of(octant.corner), &self.parts[part]);
        let start = part.lower_bound(range.clone(), key << 7);
        // One past the last octant does not fit a word.
        let end = (key + word::span(octant.level)).checked_mul(128);
        start..end.map_or(range.end, |end| part.lower_bound(start..range.end, end))
    }

    /// Ranges that contain all words of an octant: its own, or those of its finest ancestor with many words.
    fn spans(&self, octant: &Octant) -> Rc<[Span]> {
        let stored = |o: &Octant| self.spans.borrow().get(&id(o)).cloned();
        let mut spans = stored(&Octant::ROOT).expect("the root is stored first");
        for level in 1..=octant.level {
            if spans.iter().map(|s| s.range.len()).sum::<usize>() <= WORDS_FEW {
                break;
            }
            let ancestor = octant.ancestor(level);
            spans = stored(&ancestor).unwrap_or_else(|| {
                let within = |s: &Span| {
                    let range = self.within(s.part, s.range.clone(), &ancestor);
                    (!range.is_empty()).then_some(Span { part: s.part, range })
                };
                let found: Rc<[Span]> = spans.iter().filter_map(within).collect();
                self.spans.borrow_mut().insert(id(&ancestor), found.clone());
                found
            });
        }
        spans
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::testing::{leaf_set, octants_of, words_of, words_with_sides};
    use std::collections::HashSet;

    /// With so many words, the ranges of octants are stored.
    #[test]
    fn the_leaves_of_an_octant_are_those_among_all_words_of_all_parts() {
        let side = |o: &Octant| match o.path().len() % 3 {
            _ if o.corner == [5 << 15; 3] => Some(Side::Crossing),
            0 => Some(Side::Outside),
            _ => (!o.corner[1].is_multiple_of(3)).then_some(Side::Inside),
        };
        let words = words_with_sides(
            |o| {
                o.level < 4
                    || o.level < 5 && o.corner[0] < 1 << 18
                    || o.corner == [0; 3] && o.level < 9
            },
            side,
        );
        assert!(words.len() > 3 * WORDS_FEW, "{}", words.len());
        let mut parts = vec![Vec::new(); 3];
        words.iter().for_each(|&w| parts[(w >> 50) as usize % 3].push(w));
        let dir = tempfile::tempdir().unwrap();
        leaf_set(parts).write(dir.path()).unwrap();
        let leaves = Leaves::open(dir.path()).unwrap();
        let octants: HashSet<Octant> = words.iter().map(|&w| word::octant(w)).collect();
        let within = |octant: &Octant| {
            let (first, key) = (word::key_of(octant.corner), |w: &u64| word::key(*w));
            let from = words.partition_point(|w| key(w) < first);
            let until = words.partition_point(|w| key(w) < first + word::span(octant.level));
            &words[from..until]
        };
        for octant in octants_of(&words) {
            if octants.contains(&octant) {
                assert_eq!(leaves.node(&octant), Node::default(), "{octant}");
                let cell = octant.corner.map(|c| c + octant.edge() - 1);
                assert_eq!(leaves.leaf_at(cell).map(|leaf| leaf.octant), Some(octant));
                continue;
            }
            let children: Vec<Octant> = (0..8).map(|digit| octant.child(digit)).collect();
            let set = |fit: &dyn Fn(&Octant) -> bool| {
                (0..8).filter(|&d| fit(&children[d])).map(|d| 1u8 << d).sum()
            };
            let expected = Node {
                leaves: set(&|child| octants.contains(child)),
                split: set(&|child| !octants.contains(child) && !within(child).is_empty()),
            };
            assert_eq!(leaves.node(&octant), expected, "{octant}");
            assert_eq!(leaves.count(&octant), within(&octant).len() as u64, "{octant}");
            let crossing = within(&octant).iter().any(|&w| word::side(w) == Side::Crossing);
            assert_eq!(leaves.has_crossing(&octant), crossing, "{octant}");
        }
        assert_eq!(leaves.invalid(), None);
    }

    #[test]
    fn octants_have_ids_of_their_own() {
        let octants =
            octants_of(&words_of(|o| o.level < 3 || o.level < LEVEL_MAX && o.corner == [0; 3]));
        let ids: HashSet<u64> = octants.iter().map(id).collect();
        assert_eq!(ids.len(), octants.len());
    }
}
