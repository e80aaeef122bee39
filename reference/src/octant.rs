//! Octants on the lattice: geometry, intersection, and the word of a leaf.
//!
//! The root is the cube [0, 2^27]^3. An octant of level l is closed, has edge 2^(27-l), and its
//! corners are multiples of that edge. No octant is narrower than 256 lattice units.

/// The level of the finest octants.
pub const LEVEL_MAX: u32 = 19;

/// The edge of the root, in lattice units.
pub const ROOT_EDGE: i64 = 1 << 27;

/// The position of a leaf relative to the facets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The rays or seeds found its component outside.
    Outside = 0,
    /// The rays or seeds found its component inside.
    Inside = 1,
    /// A facet crosses the leaf or the leaf of T0 from which it descends.
    Crossing = 2,
}

/// A box with corners on the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// The minimum corner.
    pub min: [i64; 3],
    /// The maximum corner.
    pub max: [i64; 3],
}

impl Extent {
    /// The least box that contains three points.
    pub fn around([p, q, r]: &[[i64; 3]; 3]) -> Extent {
        let min = std::array::from_fn(|a| p[a].min(q[a]).min(r[a]));
        let max = std::array::from_fn(|a| p[a].max(q[a]).max(r[a]));
        Extent { min, max }
    }

    /// Whether the two interiors share a point. A box without volume has no interior.
    #[must_use]
    pub fn interiors_meet(&self, other: &Extent) -> bool {
        (0..3).all(|a| self.min[a].max(other.min[a]) < self.max[a].min(other.max[a]))
    }

    /// Whether two cubes that touch have an area in common, part of a face or of their interiors:
    /// they do unless they lie side by side along two axes.
    pub fn share_area(&self, other: &Extent) -> bool {
        let side_by_side = |&a: &usize| self.max[a] == other.min[a] || self.min[a] == other.max[a];
        (0..3).filter(side_by_side).count() < 2
    }

    /// The box enlarged by `margin` on every side.
    ///
    /// Because corners are integers, a box with volume touches this one if and only if its interior
    /// meets the interior of this one enlarged by 1.
    #[must_use]
    pub fn enlarged(&self, margin: i64) -> Extent {
        Extent { min: self.min.map(|x| x - margin), max: self.max.map(|x| x + margin) }
    }
}

/// A cube of the oct-tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Octant {
    /// The minimum corner.
    pub min: [i32; 3],
    /// Number of bisections of the root that lead to this octant.
    pub level: u32,
}

impl Octant {
    /// The octant of level 0.
    pub const ROOT: Octant = Octant { min: [0; 3], level: 0 };

    /// The order of candidates, and of octants that are reported as examples: coarsest first, then by key.
    #[must_use]
    pub fn coarsest_first(&self) -> (u32, u64) {
        (self.level, self.key())
    }

    /// The edge, in lattice units.
    #[must_use]
    pub fn edge(&self) -> i64 {
        ROOT_EDGE >> self.level
    }

    /// The octant's closed cube.
    #[must_use]
    pub fn extent(&self) -> Extent {
        let min = self.min.map(i64::from);
        Extent { min, max: min.map(|x| x + self.edge()) }
    }

    /// The centre, a lattice point.
    #[must_use]
    pub fn centroid(&self) -> [i64; 3] {
        self.min.map(|x| i64::from(x) + self.edge() / 2)
    }

    /// Child `index`: bit 0 selects the upper half in x, bit 1 in y, bit 2 in z.
    #[must_use]
    pub fn child(&self, index: usize) -> Octant {
        let half = (self.edge() / 2) as i32;
        let min = std::array::from_fn(|a| self.min[a] + half * (index >> a & 1) as i32);
        Octant { min, level: self.level + 1 }
    }

    /// The indices of the children whose interior meets that of `extent`, for an octant whose
    /// interior does.
    pub fn children_meeting(self, extent: Extent) -> impl DoubleEndedIterator<Item = usize> {
        let middle = self.centroid();
        let [x, y, z] = std::array::from_fn(|a| {
            usize::from(extent.min[a] >= middle[a])..1 + usize::from(extent.max[a] > middle[a])
        });
        let columns = z.flat_map(move |k| y.clone().map(move |j| k << 2 | j << 1));
        columns.flat_map(move |column| x.clone().map(move |i| column | i))
    }

    /// The Morton key: the interleaved coordinates of the minimum corner in level-19 cells, with x
    /// in the lowest bit.
    #[must_use]
    pub fn key(&self) -> u64 {
        let mut key = 0;
        for bit in 0..LEVEL_MAX {
            for a in 0..3 {
                let cell = (self.min[a] >> (27 - LEVEL_MAX)) as u64;
                key |= (cell >> bit & 1) << (3 * bit + a as u32);
            }
        }
        key
    }

    /// The leaf word of this octant with `side`.
    #[must_use]
    pub fn word(&self, side: Side) -> u64 {
        self.key() << 7 | u64::from(self.level) << 2 | side as u64
    }
}
