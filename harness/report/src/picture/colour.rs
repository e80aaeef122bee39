//! Colours of leaves: the quantity that they show, and the key to them.
//!
//! Invariants: every colour is distinguishable with every kind of colour vision from those it stands beside; finer cells
//! are darker, so that levels can be read in grey too.

use crate::figure::palette::{COLOURS, SHADES, shade};
use contract::lattice::Root;
use contract::word::Side;
use export::mesh::Leaf;
use std::collections::BTreeSet;
use std::fmt;

/// The quantity that colours show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// The level of a leaf.
    Level,
    /// The rank that wrote a leaf.
    Rank,
    /// The side of a leaf.
    Side,
    /// The edge of a leaf in the user's units.
    Spacing,
}

impl fmt::Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Level => "level",
            Self::Rank => "rank",
            Self::Side => "side",
            Self::Spacing => "spacing",
        })
    }
}

/// The colour of one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The value, as [`Colour::value`] returns it.
    pub value: u32,
    /// Its colour.
    pub fill: [u8; 3],
    /// Its name.
    pub name: String,
}

/// Ranks that the legend names one by one.
const RANKS_NAMED: usize = 16;
/// Part of the colour map that is used: lines are not visible on its dark end.
const SHADES_USED: f64 = 0.8;
/// Part of white in the lightest shade, which covers most of a picture.
const LIGHTEST: f64 = 0.5;
/// Parts of white in the tints of a colour; ranks have as many colours as there are tints of all colours.
const TINTS: [f64; 3] = [0.25, 0.6, 0.0];

impl Colour {
    /// The value of a leaf: its level, rank or code of the side.
    pub fn value(self, leaf: &Leaf) -> u32 {
        match self {
            Self::Level | Self::Spacing => u32::from(leaf.octant.level),
            Self::Rank => leaf.part,
            Self::Side => leaf.side as u32,
        }
    }

    /// The colours of the values that occur, in ascending order of the values.
    pub fn key(self, values: &BTreeSet<u32>, root: &Root) -> Vec<Entry> {
        let count = values.len();
        let entry = |(i, &value): (usize, &u32)| match self {
            Self::Level | Self::Spacing => Entry {
                value,
                fill: of_level(i as f64 / (count - 1).max(1) as f64),
                name: match self {
                    Self::Level => value.to_string(),
                    _ => short(root.edge / f64::from(1u32 << value)),
                },
            },
            Self::Rank => Entry { value, fill: of_rank(value), name: value.to_string() },
            Self::Side => {
                let side = Side::ALL[value as usize % 3];
                let fill = match side {
                    Side::Outside => tint(COLOURS[4], 0.5),
                    Side::Inside => tint(COLOURS[5], 0.3),
                    Side::Crossing => COLOURS[6],
                };
                Entry { value, fill, name: side.to_string() }
            }
        };
        values.iter().enumerate().map(entry).collect()
    }

    /// The legend of a key: names with colours, then a remark.
    pub fn legend(self, key: &[Entry]) -> (Vec<(&str, [u8; 3])>, String) {
        if self == Self::Rank && key.len() > RANKS_NAMED {
            return (Vec::new(), format!("{} ranks, coloured in turn", key.len()));
        }
        (key.iter().map(|e| (e.name.as_str(), e.fill)).collect(), String::new())
    }
}

/// The colour of a level, 0 for the coarsest and 1 for the finest.
fn of_level(position: f64) -> [u8; 3] {
    let index = position * SHADES_USED * (SHADES - 1) as f64;
    tint(shade(index as usize), LIGHTEST * (1.0 - position))
}

/// The colour of a rank. Consecutive ranks, which are often neighbours, differ in hue.
fn of_rank(rank: u32) -> [u8; 3] {
    let rank = rank as usize;
    tint(COLOURS[rank % COLOURS.len()], TINTS[rank / COLOURS.len() % TINTS.len()])
}

fn tint(colour: [u8; 3], white: f64) -> [u8; 3] {
    colour.map(|c| (f64::from(c) + (255.0 - f64::from(c)) * white).round() as u8)
}

/// A length with four significant digits.
pub fn short(length: f64) -> String {
    crate::figure::tick_label(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: Root = Root { origin: [0.0; 3], edge: 8.0 };

    #[test]
    fn finer_cells_are_darker() {
        let key = Colour::Spacing.key(&(2..9).collect(), &ROOT);
        assert_eq!(key[0].name, "2");
        let grey = |e: &Entry| e.fill.iter().map(|&c| u32::from(c)).sum::<u32>();
        assert!(key.windows(2).all(|w| grey(&w[0]) > grey(&w[1])), "{key:?}");
    }

    #[test]
    fn twenty_one_ranks_have_different_colours_and_many_ranks_have_no_names() {
        let key = Colour::Rank.key(&(0..21).collect(), &ROOT);
        let fills: BTreeSet<[u8; 3]> = key.iter().map(|e| e.fill).collect();
        assert_eq!(fills.len(), 21);
        assert_eq!(Colour::Rank.legend(&key).1, "21 ranks, coloured in turn");
        assert_eq!(Colour::Rank.legend(&key[..3]).0.len(), 3);
    }
}
