//! A cut through the base tree: its base leaves in Morton order, split further until they suit.

use super::survey::Survey;
use crate::brick;
use crate::octant::{Level, start57};
use crate::share::{BaseLeaf, Ownership};
use crate::tree::{PerLevel, Tree, per_level};
use crate::voxelise::Start;
use std::ops::Range;

/// A base leaf while the tree is cut.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Its level.
    pub level: Level,
    /// Its Morton code.
    pub code: u64,
    /// Whether it is split in T0.
    pub heavy: bool,
    /// Leaves of the mesh to expect in it.
    pub weight: u64,
    /// Its entries in the survey's areas.
    places: Range<usize>,
}

/// Base leaves that tile the root, in Morton order.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The leaves.
    pub pieces: Vec<Piece>,
}

impl Cut {
    /// The root alone.
    pub fn root(survey: &Survey) -> Self {
        let places = survey.places(0, 0);
        let heavy = survey.marks.split[0].contains(0);
        let weight = survey.weight(0, 0, &places);
        Self { pieces: vec![Piece { level: 0, code: 0, heavy, weight, places }] }
    }

    /// Splits pieces that are split in T0 and may be divided, as long as `wanted` asks for some: it is told all
    /// pieces and answers for each.
    pub fn split_while(
        mut self,
        survey: &Survey,
        mut wanted: impl FnMut(&[Piece]) -> Vec<bool>,
    ) -> Self {
        loop {
            let wanted = wanted(&self.pieces);
            let mut divided = Vec::with_capacity(self.pieces.len());
            let mut any = false;
            for (piece, wanted) in self.pieces.into_iter().zip(wanted) {
                if wanted && piece.heavy && survey.may_divide(piece.level, piece.code) {
                    any = true;
                    divided.extend(piece.children(survey));
                } else {
                    divided.push(piece);
                }
            }
            self.pieces = divided;
            if !any {
                return self;
            }
        }
    }

    /// Finds the pieces' entries again after the survey looked deeper.
    pub fn renew(&mut self, survey: &Survey) {
        let mut from = 0;
        for piece in &mut self.pieces {
            piece.places = survey.places_from(from, piece.level, piece.code);
            from = piece.places.end;
        }
    }

    /// Weights of the pieces.
    pub fn weights(&self) -> Vec<u64> {
        self.pieces.iter().map(|p| p.weight).collect()
    }

    /// Level of the deepest pieces.
    pub fn level_base(&self) -> Level {
        self.pieces.iter().map(|p| p.level).max().unwrap_or(0)
    }

    /// The pieces, dealt out.
    pub fn dealt(&self, owners: &[usize]) -> Vec<BaseLeaf> {
        let leaf = |(p, &owner): (&Piece, &usize)| BaseLeaf { level: p.level, code: p.code, owner };
        self.pieces.iter().zip(owners).map(leaf).collect()
    }

    /// A rank's pieces that are split in T0, siblings joined as far up as that goes.
    pub fn starts(&self, owners: &[usize], rank: usize) -> Vec<Start> {
        let mut joined: Vec<(Start, bool)> = Vec::new();
        for (p, _) in self.pieces.iter().zip(owners).filter(|(_, owner)| **owner == rank) {
            joined.push((Start { level: p.level, code: p.code }, p.heavy));
            while let Some(parent) = parent_of_last(&joined) {
                joined.truncate(joined.len() - 8);
                // Who has children is split.
                joined.push((parent, true));
            }
        }
        joined.into_iter().filter(|(_, heavy)| *heavy).map(|(start, _)| start).collect()
    }

    /// T0 in top bricks as far as it is known to all: down to the pieces. What is below a piece, its owner knows.
    pub fn top(&self, marks: &Tree, surface: Level, share: &Ownership) -> Tree {
        let mut top = Tree::default();
        for (l, known) in (0..).zip(self.known()).take(share.level_top() as usize + 1) {
            let mut split = marks.split[l as usize].cursor();
            let mut crossing = marks.crossing[l as usize].cursor();
            for b in known.bricks().filter(|b| share.is_top(l, b.key)) {
                let split = b.bits & split.get(b.key);
                top.split[l as usize].push(b.key, split);
                if l >= surface {
                    // A leaf that one rank's facets cross may be split by another's box or facets.
                    let crossing = b.bits & crossing.get(b.key) & !split;
                    top.crossing[l as usize].push(b.key, crossing);
                }
            }
        }
        top
    }

    /// The pieces and the octants above them.
    fn known(&self) -> PerLevel {
        let mut known = per_level();
        for p in &self.pieces {
            known[p.level as usize].push(p.code >> 6, 1 << (p.code & 63));
        }
        for l in (1..known.len()).rev() {
            let above = known[l].coarsen();
            known[l - 1] = std::mem::take(&mut known[l - 1]).union(above);
        }
        known
    }
}

impl Piece {
    /// An octant of which nothing else is known.
    #[cfg(test)]
    pub fn new(level: Level, code: u64) -> Self {
        Self { level, code, heavy: true, weight: 1, places: 0..0 }
    }

    fn children(self, survey: &Survey) -> [Self; 8] {
        let level = self.level + 1;
        let split = survey.marks.split[level as usize].get(self.code >> 3);
        let split = brick::byte(split, self.code & 7);
        let mut places = self.places;
        std::array::from_fn(|child| {
            let code = self.code << 3 | child as u64;
            let mine = survey.places_within(&places, level, code);
            places.start = mine.end;
            let weight = survey.weight(level, code, &mine);
            Self { level, code, heavy: split >> child & 1 == 1, weight, places: mine }
        })
    }
}

/// The pieces that a cut of the Morton curve into equal shares falls in.
pub fn cut_through(pieces: &[Piece], ranks: usize) -> Vec<bool> {
    let total: u128 = pieces.iter().map(|p| u128::from(p.weight)).sum();
    let share_at = |weight: u128| weight * ranks as u128 / total;
    let mut before = 0;
    let mut falls_in = |p: &Piece| {
        let after = before + u128::from(p.weight);
        let cut = share_at(before) != share_at(after);
        before = after;
        cut
    };
    pieces.iter().map(&mut falls_in).collect()
}

/// The parent of the last eight octants, if they are its children.
fn parent_of_last(joined: &[(Start, bool)]) -> Option<Start> {
    let (last, _) = joined.last()?;
    let eight = joined.len().checked_sub(8).map(|at| &joined[at..])?;
    let one = |(s, _): &(Start, bool)| s.level == last.level && s.code >> 3 == last.code >> 3;
    (last.level > 0 && eight.iter().all(one))
        .then(|| Start { level: last.level - 1, code: last.code >> 3 })
}

/// The Morton codes at level 19 of an octant: where it starts, and where the next one does.
pub fn span(level: Level, code: u64) -> Range<u64> {
    start57(level, code)..start57(level, code + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(level: Level, code: u64, weight: u64) -> Piece {
        Piece { weight, ..Piece::new(level, code) }
    }

    #[test]
    fn cuts_fall_in_the_pieces_that_hold_equal_shares_borders() {
        let pieces: Vec<Piece> = [50, 100, 49, 1, 1, 199].map(|w| piece(1, 0, w)).to_vec();
        // Shares of 100: borders at 100, 200 and 300; what ends at one is not cut by it but begins the next.
        assert_eq!(cut_through(&pieces, 4), [false, true, false, true, false, true]);
        assert_eq!(cut_through(&pieces, 1), [false, false, false, false, false, true]);
    }

    #[test]
    fn siblings_of_one_owner_are_joined_all_the_way_up() {
        let pieces: Vec<Piece> = (0..64).map(|code| piece(2, code, 1)).collect();
        let cut = Cut { pieces };
        let all = cut.starts(&[0; 64], 0);
        assert_eq!(all.iter().map(|s| (s.level, s.code)).collect::<Vec<_>>(), [(0, 0)]);
        let owners: Vec<usize> = (0..64).map(|code| usize::from(code >= 13)).collect();
        let first: Vec<(Level, u64)> =
            cut.starts(&owners, 0).iter().map(|s| (s.level, s.code)).collect();
        assert_eq!(first, [(1, 0), (2, 8), (2, 9), (2, 10), (2, 11), (2, 12)]);
    }
}
