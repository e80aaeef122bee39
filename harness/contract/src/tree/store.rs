//! Distinct nodes, and the hash table that finds equal ones.
//!
//! The table is our own because its entries are indices into `children`: a standard map would store every node
//! twice.

use super::{DELETED, HOLES, Handle, NO_LEAF, Summary};

/// All nodes of a tree.
#[derive(Debug, Default)]
pub(super) struct Store {
    children: Vec<[Handle; 8]>,
    summaries: Vec<Summary>,
    /// Open addressing: node index + 1, or 0 for a free slot. At most half full.
    slots: Vec<u32>,
}

impl Store {
    pub(super) fn len(&self) -> usize {
        self.children.len()
    }

    pub(super) fn all(&self) -> &[[Handle; 8]] {
        &self.children
    }

    pub(super) fn children(&self, of: Handle) -> &[Handle; 8] {
        &self.children[of.index()]
    }

    pub(super) fn summary(&self, of: Handle) -> Summary {
        self.summaries[of.index()]
    }

    /// The node with these children, which is stored if it is new.
    pub(super) fn intern(&mut self, children: [Handle; 8]) -> Handle {
        if self.slots.len() <= 2 * self.children.len() {
            self.grow();
        }
        let slot = self.slot(&children);
        if self.slots[slot] == 0 {
            self.summaries.push(self.summarise(&children));
            self.children.push(children);
            self.slots[slot] = u32::try_from(self.children.len()).expect("fewer than 2^32 nodes");
        }
        Handle::node(self.slots[slot] as usize - 1)
    }

    /// The slot that contains this node, or else the free slot for it.
    fn slot(&self, children: &[Handle; 8]) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = hash(children) as usize & mask;
        loop {
            match self.slots[slot] {
                0 => return slot,
                n if self.children[n as usize - 1] == *children => return slot,
                _ => slot = (slot + 1) & mask,
            }
        }
    }

    fn grow(&mut self) {
        self.slots = vec![0; (2 * self.slots.len()).max(1024)];
        for (i, children) in self.children.iter().enumerate() {
            let slot = self.slot(children);
            self.slots[slot] = i as u32 + 1;
        }
    }

    fn summarise(&self, children: &[Handle; 8]) -> Summary {
        let mut all = Summary { finest: 0, coarsest: NO_LEAF, kinds: 0 };
        for &child in children {
            let below = self.summary_of_child(child);
            all.finest = all.finest.max(below.finest);
            all.coarsest = all.coarsest.min(below.coarsest);
            all.kinds |= below.kinds;
        }
        all
    }

    /// The contribution of a child to its parent's summary, one level deeper.
    fn summary_of_child(&self, child: Handle) -> Summary {
        if child.is_node() {
            let Summary { finest, coarsest, kinds } = self.summary(child);
            let coarsest = if coarsest == NO_LEAF { NO_LEAF } else { coarsest + 1 };
            return Summary { finest: finest + 1, coarsest, kinds };
        }
        match child.as_leaf() {
            Some(DELETED) => Summary { finest: 1, coarsest: NO_LEAF, kinds: 1 << DELETED },
            Some(kind) => Summary { finest: 1, coarsest: 1, kinds: 1 << kind },
            None => Summary { finest: 0, coarsest: NO_LEAF, kinds: HOLES },
        }
    }
}

/// Four multiplications, folded. Equal children are common, so every child must affect every bit.
fn hash(children: &[Handle; 8]) -> u64 {
    let mut h = 0x9e37_79b9_7f4a_7c15u64;
    for pair in children.chunks_exact(2) {
        let both = u64::from(pair[0].0) | u64::from(pair[1].0) << 32;
        h = (h.rotate_left(23) ^ both).wrapping_mul(0xd6e8_feb8_6659_fd93);
    }
    h ^ h >> 32
}
