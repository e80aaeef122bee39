//! The cost model: CPU time that sides and gradation take on a rank, predicted from T0.
//!
//! The predicted time is a sum of counts times the times of [`FITTED`]. Surfaces oblique to the axes leave more components in a
//! brick; rough ones leave components of a single octant, which branch predictors handle badly. `mesher/cost-model/README.md` has
//! the program that fits the times, the data, and the prediction errors.

use crate::partition::ownership::Ownership;
use bricks::brick;
use bricks::octant::Level;
use bricks::tree::Tree;
use std::ops::AddAssign;

/// CPU times on one rank, in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CostModel {
    /// Per brick.
    pub brick_ns: u64,
    /// Per local component.
    pub component_ns: u64,
    /// Per brick with more than one local component.
    pub component_extra_ns: u64,
    /// Per local component of a single octant.
    pub component_single_ns: u64,
    /// Per neighbouring rank: two dozen messages to it and from it, with their payload. The owner of a mostly empty corner of
    /// the root has a hundred neighbours, other ranks have two dozen.
    pub neighbour_ns: u64,
}

/// Fitted to the CPU times of the ranks in several meshes, and rounded to multiples of 70 ns. On two meshes that were not used
/// for a later fit, the median relative error per rank is 4 and 5 %, the greatest 15 and 20 %; a refit is no better there.
pub const FITTED: CostModel = CostModel {
    brick_ns: 140,
    component_ns: 140,
    component_extra_ns: 140,
    component_single_ns: 910,
    neighbour_ns: 16_100,
};

/// Nanoseconds in a unit of weight.
const UNIT_NS: u64 = 70;

// Weights are exact.
const _: () = {
    let CostModel { brick_ns, component_ns, component_extra_ns, component_single_ns, neighbour_ns } =
        FITTED;
    assert!(brick_ns % UNIT_NS == 0 && component_ns % UNIT_NS == 0);
    assert!(component_extra_ns % UNIT_NS == 0 && component_single_ns % UNIT_NS == 0);
    assert!(neighbour_ns % UNIT_NS == 0);
};

/// The counts that the model multiplies by its times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Bricks.
    pub bricks: u64,
    /// Local components: sets of non-crossing leaves connected over faces within a brick.
    pub components: u64,
    /// Bricks with more than one local component.
    pub components_extra: u64,
    /// Local components of a single octant.
    pub components_single: u64,
    /// Neighbouring ranks.
    pub neighbours: u64,
}

impl Counts {
    /// The counts of a brick with the non-crossing leaves `open`.
    #[inline]
    fn of_brick(open: u64) -> Self {
        let (mut components, mut components_single) = (0, 0);
        for component in brick::components(open) {
            components += 1;
            components_single += u64::from(component.is_power_of_two());
        }
        let components_extra = u64::from(components > 1);
        Self { bricks: 1, components, components_extra, components_single, neighbours: 0 }
    }

    /// The counts of a rank: the bricks of T0 that it owns, and its neighbours.
    pub fn of_rank(tree: &Tree, ownership: &Ownership) -> Self {
        let neighbours = ownership.neighbours().len() as u64;
        let mut counts = Self { neighbours, ..Self::default() };
        for l in 1..tree.split.len() as Level {
            let mut split = tree.split[l as usize].cursor();
            let mut crossing = tree.crossing[l as usize].cursor();
            for b in Tree::exists(&tree.split, l).filter(|b| ownership.owns(l, b.key)) {
                counts += Self::of_brick(b.bits & !split.get(b.key) & !crossing.get(b.key));
            }
        }
        counts
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.bricks += other.bricks;
        self.components += other.components;
        self.components_extra += other.components_extra;
        self.components_single += other.components_single;
        self.neighbours += other.neighbours;
    }
}

impl CostModel {
    /// The predicted CPU time, in nanoseconds.
    #[inline]
    pub fn time_ns(&self, counts: &Counts) -> u64 {
        self.brick_ns * counts.bricks
            + self.component_ns * counts.components
            + self.component_extra_ns * counts.components_extra
            + self.component_single_ns * counts.components_single
            + self.neighbour_ns * counts.neighbours
    }
}

/// The weight of a brick with the non-crossing leaves `open`.
#[inline]
pub fn weight_of_brick(open: u64) -> i64 {
    (FITTED.time_ns(&Counts::of_brick(open)) / UNIT_NS) as i64
}

/// The weight of a neighbouring rank.
pub const WEIGHT_OF_NEIGHBOUR: i64 = (FITTED.neighbour_ns / UNIT_NS) as i64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_a_brick_are_counted_by_size() {
        // Two opposite corners and half of a face between them.
        let open = 1 | 1 << 63 | brick::X[0] & brick::Y[2];
        let counts = Counts::of_brick(open);
        let want = Counts {
            bricks: 1,
            components: 3,
            components_extra: 1,
            components_single: 2,
            neighbours: 0,
        };
        assert_eq!(counts, want);
        assert_eq!(FITTED.time_ns(&counts), 140 + 3 * 140 + 140 + 2 * 910);
        assert_eq!(weight_of_brick(0), 2);
    }
}
