//! The cost model: CPU time that sides and gradation take on a rank, predicted from T0.
//!
//! The predicted time is a sum of counts times the times of [`FITTED`]. Surfaces oblique to the axes leave more components in a
//! brick; rough ones leave components of a single octant, which branch predictors handle badly. The times were
//! fitted in November 2026 by non-negative least squares on the relative errors of 64 simulated ranks on each of four meshes.

use crate::partition::ownership::Ownership;
use bricks::brick;
use bricks::octant::Level;
use bricks::tree::Tree;

/// CPU times of the [`Counts`] on one rank, in units of 70 ns. Fitted to the CPU times of the ranks in several meshes, and rounded. On two
/// meshes that were not used for a later fit, the median relative error per rank is 4 and 5 %, the greatest 15 and 20 %; a refit is no
/// better there.
const FITTED: Counts =
    Counts { bricks: 2, components: 2, components_extra: 2, components_single: 13 };

/// The weight of a neighbouring rank: two dozen messages to it and from it, with their payload. The owner of a mostly empty corner of the
/// root has a hundred neighbours, other ranks have two dozen.
pub const WEIGHT_OF_NEIGHBOUR: i64 = 230;

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
}

impl Counts {
    /// Adds a brick with the non-crossing leaves `open`.
    #[inline]
    fn add_brick(&mut self, open: u64) {
        let before = self.components;
        for component in brick::components(open) {
            self.components += 1;
            self.components_single += u64::from(component.is_power_of_two());
        }
        self.bricks += 1;
        self.components_extra += u64::from(self.components > before + 1);
    }

    /// The counts of a rank: those of the bricks of T0 that it owns.
    pub fn of_rank(tree: &Tree, ownership: &Ownership) -> Self {
        let mut counts = Self::default();
        for l in 1..tree.split.len() as Level {
            let mut split = tree.split[l as usize].cursor();
            let mut crossing = tree.crossing[l as usize].cursor();
            for b in Tree::exists(&tree.split, l).filter(|b| ownership.owns(l, b.key)) {
                counts.add_brick(b.bits & !split.get(b.key) & !crossing.get(b.key));
            }
        }
        counts
    }

    /// The predicted CPU time.
    #[inline]
    fn weight(&self) -> i64 {
        let weight = FITTED.bricks * self.bricks
            + FITTED.components * self.components
            + FITTED.components_extra * self.components_extra
            + FITTED.components_single * self.components_single;
        weight as i64
    }
}

/// The weight of a brick with the non-crossing leaves `open`.
#[inline]
pub fn weight_of_brick(open: u64) -> i64 {
    let mut counts = Counts::default();
    counts.add_brick(open);
    counts.weight()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_a_brick_are_counted_by_size() {
        // Two opposite corners and half of a face between them.
        let open = 1 | 1 << 63 | brick::X[0] & brick::Y[2];
        let mut counts = Counts::default();
        counts.add_brick(0);
        counts.add_brick(open);
        let want = Counts { bricks: 2, components: 3, components_extra: 1, components_single: 2 };
        assert_eq!(counts, want);
        assert_eq!((weight_of_brick(0), weight_of_brick(open)), (2, 2 + 3 * 2 + 2 + 2 * 13));
    }
}
