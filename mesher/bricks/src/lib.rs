//! Octants of an oct-tree as bits of bricks, 64 to a word. This crate knows no ranks.

pub mod brick;
pub mod brickset;
pub mod digest;
pub mod dilate;
pub mod facet;
pub mod octant;
pub mod tree;
#[cfg(test)]
mod values;
pub mod wide;
