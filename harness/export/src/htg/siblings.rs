//! Siblings that contain the leaves of a mesh, from the leaves in Morton order.

use contract::octant::LEVEL_MAX;
use contract::word::{self, Side};
use vtkhdf::tree::Siblings;

use crate::leaf::Leaf;
use contract::failure::Failure;

/// The eight children of an octant, or the root in place of the first of them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Family {
    pub(super) level: u8,
    pub(super) siblings: Siblings,
    /// The parts of those that are leaves.
    pub(super) parts: [i32; 8],
}

impl Family {
    /// Number of siblings that are neither split nor masked.
    pub(super) fn leaves(&self) -> u32 {
        let siblings = !(self.siblings.split | self.siblings.deleted);
        if self.level == 0 { u32::from(siblings & 1) } else { siblings.count_ones() }
    }
}

/// The families that contain the last leaf, or the octants that contain it: one for each level down to its own.
#[derive(Debug, Default)]
pub(super) struct Open {
    families: Vec<Family>,
    /// Morton code of the last leaf.
    key: u64,
}

impl Open {
    /// Adds a leaf, which follows the last one, and passes on the families that end before it.
    pub(super) fn push(
        &mut self,
        leaf: &Leaf,
        take: &mut dyn FnMut(Family) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let (key, level) = (word::key_of(leaf.octant.corner), leaf.octant.level);
        // The families of the common ancestors stay open, and that of the first octants that differ.
        let shared =
            (self.key ^ key).checked_ilog2().map_or(LEVEL_MAX, |bit| LEVEL_MAX - bit as u8 / 3 - 1);
        self.close(usize::from(shared) + 2, take)?;
        self.key = key;
        while self.families.len() <= usize::from(level) {
            if let Some(above) = self.families.last_mut() {
                let bit = 1 << digit(key, above.level);
                above.siblings.split |= bit;
                above.siblings.deleted &= !bit;
            }
            let siblings = Siblings { deleted: 0xff, ..Siblings::default() };
            let level = self.families.len() as u8;
            self.families.push(Family { level, siblings, ..Family::default() });
        }
        let Family { siblings, parts, .. } = &mut self.families[usize::from(level)];
        let digit = digit(key, level);
        siblings.deleted &= !(1 << digit);
        match leaf.side {
            Side::Crossing => siblings.crossing |= 1 << digit,
            Side::Inside => siblings.inside |= 1 << digit,
            Side::Outside => {}
        }
        parts[digit] = leaf.rank as i32;
        Ok(())
    }

    /// Passes on all families that are still open.
    pub(super) fn finish(
        mut self,
        take: &mut dyn FnMut(Family) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.close(0, take)
    }

    /// Passes on families until at most `count` are open.
    fn close(
        &mut self,
        count: usize,
        take: &mut dyn FnMut(Family) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        while self.families.len() > count {
            self.families.pop().map_or(Ok(()), &mut *take)?;
        }
        Ok(())
    }
}

/// Which of its siblings contains a level-19 cell, among octants of this level; 0 for the root.
fn digit(key: u64, level: u8) -> usize {
    if level == 0 { 0 } else { ((key / word::span(level)) & 7) as usize }
}
