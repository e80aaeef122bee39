//! Bricks: lattice points in groups of neighbours.
//!
//! A point belongs to the coarsest grid that has it. Four by four by four points of a grid are a brick.

use contract::octant::LEVEL_MAX;

/// A point, in level-19 cells from the root's minimum corner: up to `CELLS_PER_EDGE`, inclusive.
pub type Point = [u32; 3];

/// Bits of each coordinate of a brick.
const BITS: u32 = 18;

/// The key of a point's brick, and the point's index there, below 64.
pub fn place(point: Point) -> (u64, u32) {
    let [x, y, z] = point;
    let zeros = (x | y | z).trailing_zeros().min(u32::from(LEVEL_MAX));
    let at = |c: u32| u64::from(c >> zeros >> 2);
    let bit = |c: u32| c >> zeros & 3;
    let key = at(x) | at(y) << BITS | at(z) << (2 * BITS) | u64::from(zeros) << (3 * BITS);
    (key, bit(x) | bit(y) << 2 | bit(z) << 4)
}

/// The inverse of [`place`].
pub fn point(key: u64, index: u32) -> Point {
    let zeros = (key >> (3 * BITS)) as u32;
    std::array::from_fn(|a| {
        let at = key >> (BITS * a as u32) & ((1 << BITS) - 1);
        ((at as u32) << 2 | index >> (2 * a) & 3) << zeros
    })
}
