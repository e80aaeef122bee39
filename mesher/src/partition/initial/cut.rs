//! A cut through the base tree: its base leaves in Morton order, split further until they suit.

use super::survey::Survey;
use crate::brick;
use crate::octant::{Level, start57};
use crate::partition::ownership::BaseLeaf;
use std::ops::Range;

/// A base leaf while the tree is cut.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Its level.
    pub level: Level,
    /// Its Morton code.
    pub code: u64,
    /// Whether it is split in T0, as far as that is known.
    heavy: bool,
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
        let heavy = survey.split[0].contains(0);
        let weight = survey.weight(0, 0, &places);
        Self { pieces: vec![Piece { level: 0, code: 0, heavy, weight, places }] }
    }

    /// Splits pieces that are split in T0 and may be divided, as long as `wanted` asks for some.
    pub fn split_while(mut self, survey: &Survey, wanted: impl Fn(&Piece) -> bool) -> Self {
        loop {
            let before = self.pieces.len();
            let mut divided = Vec::with_capacity(before);
            for piece in self.pieces {
                if piece.heavy && piece.level < survey.level() && wanted(&piece) {
                    divided.extend(piece.children(survey));
                } else {
                    divided.push(piece);
                }
            }
            self.pieces = divided;
            if self.pieces.len() == before {
                return self;
            }
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
}

impl Piece {
    /// An octant of which nothing else is known.
    #[cfg(test)]
    pub fn new(level: Level, code: u64) -> Self {
        Self { level, code, heavy: true, weight: 1, places: 0..0 }
    }

    fn children(self, survey: &Survey) -> [Self; 8] {
        let level = self.level + 1;
        let split = survey.split[level as usize].get(self.code >> 3);
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

/// The Morton codes at level 19 of an octant: where it starts, and where the next one does.
pub fn span(level: Level, code: u64) -> Range<u64> {
    start57(level, code)..start57(level, code + 1)
}
