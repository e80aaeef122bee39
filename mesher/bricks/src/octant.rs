//! Octants: levels, Morton codes, sides and leaf words.
//!
//! Invariants:
//! - the octant of level `l` at integer position `(x, y, z)`, each below `2^l`, has the Morton code
//!   that interleaves the three (x lowest), below `8^l`; codes of one level sort in Morton order;
//! - the parent's code is `code >> 3`, the children's are `code << 3 | child`;
//! - a leaf word is `morton57 << 7 | level << 2 | side`, and sorted words are in Morton order.

/// Number of bisections from the root, which is level 0.
pub type Level = u32;

/// Deepest level of a leaf.
pub const LEVEL_MAX: Level = 19;

/// log2 of the root's edge in lattice units.
pub const ROOT_BITS: u32 = 27;

/// The root's edge in lattice units.
pub const ROOT_EDGE: i64 = 1 << ROOT_BITS;

/// Edge of an octant of level `l`, in lattice units. Voxelisation may test level 20, one level deeper than
/// any leaf.
#[inline]
pub const fn edge(l: Level) -> i64 {
    1 << (ROOT_BITS - l)
}

/// The side of the geometry that a leaf is on. The discriminant is the leaf word's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Side {
    /// Outside the geometry.
    Outside = 0,
    /// Inside the geometry.
    Inside = 1,
    /// A facet crosses the leaf, or the base-tree leaf that contains it.
    Crossing = 2,
}

/// Spreads the low 21 bits of `v` to every third bit.
#[inline]
const fn spread(v: u64) -> u64 {
    let v = v & 0x1f_ffff;
    let v = (v | v << 32) & 0x001f_0000_0000_ffff;
    let v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    let v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    let v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// Inverse of [`spread`].
#[inline]
const fn gather(v: u64) -> u64 {
    let v = v & 0x1249_2492_4924_9249;
    let v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    let v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    let v = (v | v >> 8) & 0x001f_0000_ff00_00ff;
    let v = (v | v >> 16) & 0x001f_0000_0000_ffff;
    (v | v >> 32) & 0x1f_ffff
}

/// Morton code of a position: x in the lowest bit, then y, then z.
#[inline]
pub const fn morton(p: [u32; 3]) -> u64 {
    spread(p[0] as u64) | spread(p[1] as u64) << 1 | spread(p[2] as u64) << 2
}

/// The position of a Morton code: inverse of [`morton`].
#[inline]
pub const fn position(code: u64) -> [u32; 3] {
    [gather(code) as u32, gather(code >> 1) as u32, gather(code >> 2) as u32]
}

/// Level-19 Morton code of the minimum corner of an octant of level `l <= 19`.
#[inline]
pub const fn start57(l: Level, code: u64) -> u64 {
    code << (3 * (LEVEL_MAX - l))
}

/// Minimum corner of an octant, in lattice units.
#[inline]
pub fn corner(l: Level, code: u64) -> [i64; 3] {
    position(code).map(|p| i64::from(p) << (ROOT_BITS - l))
}

/// Code of the neighbour of the same level along `axis` (0, 1, 2), in the positive direction if `up`; none
/// outside the root.
#[inline]
pub fn neighbour(l: Level, code: u64, axis: usize, up: bool) -> Option<u64> {
    let mut p = position(code);
    p[axis] = p[axis].checked_add_signed(if up { 1 } else { -1 }).filter(|&v| v < 1 << l)?;
    Some(morton(p))
}

/// The word of a leaf.
#[inline]
pub const fn word(l: Level, code: u64, side: Side) -> u64 {
    start57(l, code) << 7 | (l as u64) << 2 | side as u64
}

/// The path from the root in child digits, for messages, such as `314`: the code in octal. That of the root is `0`.
pub fn path(l: Level, code: u64) -> String {
    format!("{code:0width$o}", width = l as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_positions_are_inverse_for_all_octants_to_level_four() {
        for l in 0..=4 {
            for code in 0..1u64 << (3 * l) {
                let p = position(code);
                assert!(p.iter().all(|&v| v < 1 << l));
                assert_eq!(morton(p), code);
            }
        }
        assert_eq!(morton([(1 << 19) - 1; 3]), (1 << 57) - 1);
        assert_eq!(position((1 << 57) - 1), [(1 << 19) - 1; 3]);
    }

    #[test]
    fn opposite_neighbours_are_inverse_and_none_is_outside_the_root() {
        for l in 0..=3 {
            for code in 0..1u64 << (3 * l) {
                for axis in 0..3 {
                    match neighbour(l, code, axis, true) {
                        Some(n) => assert_eq!(neighbour(l, n, axis, false), Some(code)),
                        None => assert_eq!(position(code)[axis], (1 << l) - 1),
                    }
                }
            }
        }
    }

    #[test]
    fn paths_start_at_the_root() {
        assert_eq!(path(0, 0), "0");
        assert_eq!((path(3, 0o314), path(4, 0o314)), ("314".into(), "0314".into()));
    }

    #[test]
    fn values_are_those_of_the_proofs() {
        let level = |a: i128| a as Level;
        let p = |code: u64| position(code).map(i128::from).to_vec();
        let numbers = |a: Option<u64>| a.map(i128::from).into_iter().collect();
        crate::values::compare(
            "bricks/src/octant.rs",
            &[
                ("spread", &|a| vec![spread(a[0] as u64).into()]),
                ("gather", &|a| vec![gather(a[0] as u64).into()]),
                ("morton", &|a| vec![morton([0, 1, 2].map(|i| a[i] as u32)).into()]),
                ("position", &|a| p(a[0] as u64)),
                ("start57", &|a| vec![start57(level(a[0]), a[1] as u64).into()]),
                ("corner", &|a| corner(level(a[0]), a[1] as u64).map(i128::from).to_vec()),
                ("edge", &|a| vec![edge(level(a[0])).into()]),
                ("word", &|a| {
                    let side = [Side::Outside, Side::Inside, Side::Crossing][a[2] as usize];
                    vec![word(level(a[0]), a[1] as u64, side).into()]
                }),
                ("neighbour", &|a| {
                    numbers(neighbour(level(a[0]), a[1] as u64, a[2] as usize, a[3] == 1))
                }),
            ],
        );
    }
}
