//! The cost model: CPU time that sides and gradation take on a rank, predicted from T0.
//!
//! The predicted time is a sum of counts times fitted times, in units of 70 ns. Surfaces oblique to the axes leave more components in a
//! brick; rough ones leave components of a single octant, which branch predictors handle badly. The times were
//! fitted in November 2026 by non-negative least squares on the relative errors of 64 simulated ranks on each of four meshes, and rounded.
//! On two meshes that were not used for a later fit, the median relative error per rank is 4 and 5 %, the greatest 15 and 20 %; a refit is
//! no better there.

use bricks::brick;

/// Time of a brick.
const BRICK: i64 = 2;
/// Time of a local component: a set of non-crossing leaves connected over faces within a brick.
const COMPONENT: i64 = 2;
/// Additional time of a brick with more than one local component.
const COMPONENTS_EXTRA: i64 = 2;
/// Additional time of a local component of a single octant.
const COMPONENT_SINGLE: i64 = 13;

/// The weight of a neighbouring rank: two dozen messages to it and from it, with their payload. The owner of a mostly empty corner of the
/// root has a hundred neighbours, other ranks have two dozen.
pub const WEIGHT_OF_NEIGHBOUR: i64 = 230;

/// The weight of a brick with the non-crossing leaves `open`.
#[inline]
pub fn weight_of_brick(open: u64) -> i64 {
    let (mut components, mut single) = (0, 0);
    for component in brick::components(open) {
        components += 1;
        single += i64::from(component.is_power_of_two());
    }
    let extra = i64::from(components > 1);
    BRICK + COMPONENT * components + COMPONENTS_EXTRA * extra + COMPONENT_SINGLE * single
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_a_brick_are_counted_by_size() {
        // Two opposite corners and half of a face between them.
        let open = 1 | 1 << 63 | brick::SPANS[0][0][0] & brick::SPANS[1][2][2];
        assert_eq!((weight_of_brick(0), weight_of_brick(open)), (2, 2 + 3 * 2 + 2 + 2 * 13));
    }
}
