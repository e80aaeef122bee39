//! Colours of leaves: the quantity that they show, and the key to them.
//!
//! Invariants: every colour is distinguishable with every kind of colour vision from those it stands beside; finer cells
//! are darker, so that levels can be read in grey too.

use crate::figure::canvas::COLOURS;
use contract::mesh::Leaf;
use contract::word::Side;
use std::collections::{BTreeMap, BTreeSet};

/// The quantity that colours show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Colour {
    /// Level of a cell
    Level,
    /// Rank that made a cell
    Rank,
    /// Outside, inside or crossing
    Side,
}

/// The names and colours of values, as [`Colour::value`] returns them.
pub type Key = BTreeMap<u32, (String, [u8; 3])>;

/// Ranks that the legend names one by one.
const RANKS_NAMED: usize = 16;
/// Part of cividis, from its light end on, that levels have: on its dark end, lines are not visible. It looks alike with and without
/// deficiencies of colour vision, and larger values are darker in grey too.
const CIVIDIS: f64 = 0.8;
/// Part of white in the lightest shade, which covers most of a picture.
const LIGHTEST: f64 = 0.5;
/// Tints of a colour, as [`tint`] takes them; ranks have as many colours as there are tints of all colours. The second is dark:
/// a light one of the first colour would look like the fifth.
const TINTS: [f64; 3] = [0.35, -0.4, 0.15];

impl Colour {
    /// The name of the quantity.
    pub fn name(self) -> &'static str {
        ["level", "rank", "side"][self as usize]
    }

    /// The value of a leaf: its level, rank or code of the side.
    pub fn value(self, leaf: &Leaf) -> u32 {
        match self {
            Self::Level => u32::from(leaf.octant.level),
            Self::Rank => leaf.rank,
            Self::Side => leaf.side as u32,
        }
    }

    /// The key to the values that occur.
    pub fn key(self, values: &BTreeSet<u32>) -> Key {
        let finest = (values.len() - 1).max(1) as f64;
        let entry = |(i, &value): (usize, &u32)| {
            let side = Side::ALL[value as usize % 3];
            let (fill, name) = match (self, side) {
                (Self::Level, _) => (of_level(i as f64 / finest), value.to_string()),
                (Self::Rank, _) => (of_rank(value), value.to_string()),
                (Self::Side, Side::Outside) => (tint(COLOURS[4], 0.5), side.to_string()),
                (Self::Side, Side::Inside) => (tint(COLOURS[5], 0.3), side.to_string()),
                (Self::Side, Side::Crossing) => (COLOURS[6], side.to_string()),
            };
            (value, (name, fill))
        };
        values.iter().enumerate().map(entry).collect()
    }

    /// The legend of a key: names with colours, and its title.
    pub fn legend(self, key: &Key) -> (Vec<(String, [u8; 3])>, String) {
        if self == Self::Rank && key.len() > RANKS_NAMED {
            return (Vec::new(), format!("{} ranks, coloured in turn", key.len()));
        }
        (key.values().cloned().collect(), self.name().to_owned())
    }
}

/// The colour of a level, 0 for the coarsest and 1 for the finest.
fn of_level(position: f64) -> [u8; 3] {
    let shade = colorous::CIVIDIS.eval_continuous(1.0 - CIVIDIS * position);
    tint([shade.r, shade.g, shade.b], LIGHTEST * (1.0 - position))
}

/// The colour of a rank. Consecutive ranks, which are often neighbours, differ in hue.
fn of_rank(rank: u32) -> [u8; 3] {
    let rank = rank as usize;
    tint(COLOURS[rank % COLOURS.len()], TINTS[rank / COLOURS.len() % TINTS.len()])
}

/// A colour with a part of white or, if it is negative, of black.
fn tint(colour: [u8; 3], part: f64) -> [u8; 3] {
    let end = if part < 0.0 { 0.0 } else { 255.0 };
    colour.map(|c| (f64::from(c) + (end - f64::from(c)) * part.abs()).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finer_cells_are_darker_in_grey_too() {
        let key = Colour::Level.key(&(0..20).collect());
        let grey = |(_, fill): &(String, [u8; 3])| {
            let [r, g, b] = fill.map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let greys: Vec<f64> = key.values().map(grey).collect();
        assert!(greys.windows(2).all(|w| w[0] > w[1] + 2.0), "{key:?}");
    }

    /// A colour in CIE Lab, as seen with a matrix of colour vision on linear RGB.
    fn lab(colour: [u8; 3], vision: &[[f64; 3]; 3]) -> [f64; 3] {
        let linear = colour.map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        let times = |m: &[[f64; 3]; 3], v: [f64; 3]| {
            m.map(|row| (0..3).map(|i| row[i] * v[i]).sum::<f64>())
        };
        let seen = times(vision, linear).map(|c| c.clamp(0.0, 1.0));
        let xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        let [x, y, z] = times(&xyz, seen);
        let [x, y, z] = [x / 0.9505, y, z / 1.089]
            .map(|v| if v > 0.008856 { v.cbrt() } else { 7.787 * v + 16.0 / 116.0 });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    #[test]
    fn sixteen_ranks_are_distinguishable_with_every_colour_vision() {
        // Normal; protanopia and deuteranopia after Machado, Oliveira and Fernandes (2009).
        let visions = [
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [
                [0.152286, 1.052583, -0.204868],
                [0.114503, 0.786281, 0.099216],
                [-0.003882, -0.048116, 1.051998],
            ],
            [
                [0.367322, 0.860646, -0.227968],
                [0.280085, 0.672501, 0.047413],
                [-0.011820, 0.042940, 0.968881],
            ],
        ];
        for vision in &visions {
            let seen: Vec<[f64; 3]> = (0..16).map(|r| lab(of_rank(r), vision)).collect();
            for (i, a) in seen.iter().enumerate() {
                for (j, b) in seen[..i].iter().enumerate() {
                    let difference = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
                    // A difference of 2.3 is just noticeable.
                    assert!(difference > 8.0, "ranks {i} and {j}: {difference}");
                }
            }
        }
    }

    #[test]
    fn twenty_one_ranks_have_different_colours_and_many_ranks_have_no_names() {
        let key = Colour::Rank.key(&(0..21).collect());
        let fills: BTreeSet<[u8; 3]> = key.values().map(|(_, fill)| *fill).collect();
        assert_eq!(fills.len(), 21);
        assert_eq!(Colour::Rank.legend(&key).1, "21 ranks, coloured in turn");
        assert_eq!(Colour::Rank.legend(&key.into_iter().take(3).collect()).0.len(), 3);
    }
}
