//! One leaf as exports see it.

use contract::octant::Octant;
use contract::word::Side;

/// A leaf of a mesh on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaf {
    /// Its octant.
    pub octant: Octant,
    /// Its side.
    pub side: Side,
    /// The rank that owns it: the index of its part; 0 in a tree.
    pub rank: u32,
    /// Index among all leaves of the mesh, in Morton order.
    pub index: u64,
}
