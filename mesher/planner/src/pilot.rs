//! Pilot runs: what the case needs at a coarser spacing, and what it therefore needs at its own.
//!
//! Coarsening every spacing by a power of two shifts the whole mesh by that many levels. Let x be the number of levels to which
//! a mesh is refined further. What the boxes fill grows like 8^x and is known from their volumes. The remainder is a shell around
//! surfaces, n cells thick at every level: it grows like 4^x with the areas, with a term in 2^x for curvature, edges and layers that
//! overlap, and with slower terms for the far field. Two pilot runs give the first term and one for all others, whose base lies
//! between 2 and 1 for the slower ones.

use crate::volumes::Volumes;
use bricks::brickset::ones;
use bricks::octant::{Level, corner, edge};
use bricks::tree::{PerLevel, Tree};
use bytemuck::{Pod, Zeroable};
use mesher::input::lattice::{ExtentBox, Rules};
use mesher::partition::cost::Counts;
use mesher::{Job, Mesh};

/// Number of quantities in [`Amounts`].
pub const AMOUNTS: usize = 10;

/// What one rank needs for a mesh, or all ranks together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Amounts {
    /// Leaves.
    pub cells: f64,
    /// Leaves that the boxes would ask for, where the geometry has deleted them, at the case's own spacing.
    pub cells_boxed_deleted: f64,
    /// Tests and visits of bricks in refinement.
    pub tests: f64,
    /// Bricks and local components of the base tree.
    pub components: f64,
    /// Bytes of the sets, nodes and components while sides are decided.
    pub bytes_sides: f64,
    /// Bytes of the sets in gradation.
    pub bytes_graded: f64,
    /// CPU time of refinement, in seconds.
    pub time_refine_s: f64,
    /// CPU time of sides.
    pub time_sides_s: f64,
    /// CPU time of gradation, leaves and what moves them.
    pub time_leaves_s: f64,
    /// CPU time of the other phases, most of which is spent on facets.
    pub time_fixed_s: f64,
}

impl Amounts {
    /// The sums of several ranks' amounts.
    pub fn sum(of: impl Iterator<Item = Self>) -> Self {
        let add = |a: [f64; AMOUNTS], b: Self| {
            let b: [f64; AMOUNTS] = bytemuck::cast(b);
            std::array::from_fn(|i| a[i] + b[i])
        };
        bytemuck::cast(of.fold([0.0; AMOUNTS], add))
    }

    /// CPU time of all phases, in seconds.
    pub fn time_cpu_s(&self) -> f64 {
        self.time_refine_s + self.time_sides_s + self.time_leaves_s + self.time_fixed_s
    }

    /// The greater of the bytes that sets take in any phase.
    pub fn bytes(&self) -> f64 {
        self.bytes_sides.max(self.bytes_graded)
    }
}

/// Bytes of a brick in a set: half a key and 64 bits.
const BRICK: f64 = 12.0;
/// Bytes of a brick in `sides`: its first component; and its split octants and first child if its level has any.
const NODE: [f64; 2] = [4.0, 12.0];
/// Bytes of a local component: its octants, its parent in the union-find and its class.
const COMPONENT: f64 = 13.0;
/// Copies of the graded sets that exist at a time in gradation: the sets, and for one level also the octants reached and the union that
/// replaces the set. Measured on a sphere with layers of 4 to 30 cells.
const COPIES_GRADED: f64 = 1.75;
/// Visits of bricks without facets that take as long as one test of a facet against a brick.
const VISITS_PER_TEST: f64 = 5.0;

/// Factor per level of what does not grow with the area. Best on average for cases with layers of 1 to 30 cells.
const BASE_BELOW_AREA: f64 = 1.85;

/// The rules of a pilot: every spacing coarser by `shift` levels.
pub fn coarser(rules: &Rules, shift: Level) -> Rules {
    let boxes = rules.boxes.iter();
    Rules {
        level_surface: rules.level_surface.saturating_sub(shift),
        boxes: boxes.map(|b| ExtentBox { level: b.level.saturating_sub(shift), ..*b }).collect(),
        ..rules.clone()
    }
}

/// What this rank needs for the base tree, before its sides are decided.
pub fn of_base_tree(tree: &Tree, counts: &Counts) -> Amounts {
    let linked: usize = (0..tree.depth()).map(|l| Tree::exists(&tree.split, l).count()).sum();
    Amounts {
        components: (counts.bricks + counts.components) as f64,
        bytes_sides: BRICK * (bricks(&tree.split) + bricks(&tree.crossing))
            + NODE[0] * counts.bricks as f64
            + NODE[1] * linked as f64
            + COMPONENT * counts.components as f64,
        ..Amounts::default()
    }
}

fn bricks(sets: &PerLevel) -> f64 {
    sets.iter().map(|s| s.len() as f64).sum()
}

/// What this rank needs for a pilot run: the `base` tree's amounts, and those of the mesh.
pub fn of_mesh(base: Amounts, mesh: &Mesh, cells: u64, job: &Job, volumes: &Volumes) -> Amounts {
    let stored = bricks(&mesh.crossing) + bricks(&mesh.sides.stored);
    let time = |of: &[&str]| -> f64 {
        let phases = job.record.phases().iter();
        phases.filter(|p| of.contains(&p.name)).map(|p| p.time_cpu_s).sum()
    };
    let all: f64 = job.record.phases().iter().map(|p| p.time_cpu_s).sum();
    let [refine, sides] = [time(&["refine"]), time(&["sides", "leaks"])];
    let leaves = time(&["grade", "rebalance", "share top", "leaves"]);
    Amounts {
        cells: cells as f64,
        cells_boxed_deleted: deleted_in(volumes, mesh),
        tests: job.counters.facet_brick_tests as f64
            + job.counters.bricks_voxelised as f64 / VISITS_PER_TEST,
        bytes_graded: BRICK * (stored + COPIES_GRADED * bricks(&mesh.split)),
        time_refine_s: refine,
        time_sides_s: sides,
        time_leaves_s: leaves,
        time_fixed_s: all - refine - sides - leaves,
        ..base
    }
}

/// The cells that the boxes ask for in deleted leaves that this rank owns.
fn deleted_in(volumes: &Volumes, mesh: &Mesh) -> f64 {
    if volumes.is_empty() {
        return 0.0;
    }
    let mut cells = 0.0;
    for (l, deleted) in (0..).zip(mesh.sides.deleted()) {
        for brick in deleted.bricks().filter(|b| mesh.ownership.owns(l, b.key)) {
            if !volumes.meet(corner(l, brick.key << 6), 4 * edge(l)) {
                continue;
            }
            let at = |bit| corner(l, brick.key << 6 | u64::from(bit));
            cells += ones(brick.bits).map(|bit| volumes.cells_in(at(bit), edge(l))).sum::<f64>();
        }
    }
    cells
}

/// Pilot runs of a case, and their extrapolation.
#[derive(Clone, Debug)]
pub struct Pilots {
    /// The finest, and by how many levels it is coarser than the case.
    pub fine: (Level, Amounts),
    /// A coarser one; none if the finest is the case itself, or as coarse as can be.
    pub coarse: Option<(Level, Amounts)>,
    /// Cells in the boxes at the case's own spacing.
    pub cells_boxed: f64,
}

/// Cells of a box that one brick holds, about: the bytes of a region of uniform cells are those of its bricks and their ancestors.
const BYTES_PER_CELL_BOXED: [f64; 2] = [0.36, 0.05];
/// A visit of each brick of 64 cells.
const TESTS_PER_CELL_BOXED: f64 = 1.0 / (64.0 * VISITS_PER_TEST);

impl Pilots {
    /// The amounts of a mesh that is coarser than the case by `shift` levels.
    pub fn at(&self, shift: Level) -> Amounts {
        let (shift_fine, fine) = self.fine;
        if shift == shift_fine {
            return fine;
        }
        let boxed = |shift: Level| {
            (self.cells_boxed - fine.cells_boxed_deleted).max(0.0) / 8f64.powi(shift as i32)
        };
        let further = f64::from(shift_fine) - f64::from(shift);
        // Extrapolates one quantity, of which a cell in a box has `per_cell`.
        let grown = |of: fn(&Amounts) -> f64, per_cell: f64| {
            let shell = |(at, amounts): (Level, Amounts)| {
                (of(&amounts) - per_cell * boxed(at)).max(0.05 * of(&amounts))
            };
            let fine = shell(self.fine);
            let coarse = self.coarse.map(|c| (f64::from(c.0 - shift_fine), shell(c)));
            shell_at(further, fine, coarse) + per_cell * boxed(shift)
        };
        let cells = grown(|a| a.cells, 1.0);
        let [per_cell_sides, per_cell_graded] = BYTES_PER_CELL_BOXED;
        let components = grown(|a| a.components, 2.0 / 56.0);
        let tests = grown(|a| a.tests, TESTS_PER_CELL_BOXED);
        Amounts {
            cells,
            cells_boxed_deleted: fine.cells_boxed_deleted,
            tests,
            components,
            bytes_sides: grown(|a| a.bytes_sides, per_cell_sides),
            bytes_graded: grown(|a| a.bytes_graded, per_cell_graded),
            time_refine_s: fine.time_refine_s * tests / fine.tests.max(1.0),
            time_sides_s: fine.time_sides_s * components / fine.components.max(1.0),
            time_leaves_s: fine.time_leaves_s * cells / fine.cells.max(1.0),
            time_fixed_s: fine.time_fixed_s,
        }
    }
}

/// A quantity of a shell around surfaces, `further` levels finer than a mesh for which it is `fine`. A mesh that is coarser by some
/// levels has `coarse`.
fn shell_at(further: f64, fine: f64, coarse: Option<(f64, f64)>) -> f64 {
    let [by_area, by_length] = [4.0, BASE_BELOW_AREA].map(|base: f64| base.powf(further));
    let Some((gap, coarse)) = coarse else { return fine * by_area };
    let [area, length] = [4.0, BASE_BELOW_AREA].map(|base: f64| base.powf(-gap));
    let of_area = ((fine * length - coarse) / (length - area)).max(0.0);
    of_area * by_area + (fine - of_area) * by_length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shells_and_boxes_grow_as_their_dimensions() {
        let amounts = |shift: i32| {
            let x = -f64::from(shift);
            let shell = 5e9 * 4f64.powf(x) + 7e6 * BASE_BELOW_AREA.powf(x);
            Amounts {
                cells: shell + 9e9 * 8f64.powf(x),
                cells_boxed_deleted: 1e9,
                components: 1.0,
                ..Amounts::default()
            }
        };
        let pilots =
            Pilots { fine: (4, amounts(4)), coarse: Some((6, amounts(6))), cells_boxed: 10e9 };
        for shift in 0..4 {
            let error = pilots.at(shift).cells / amounts(shift as i32).cells - 1.0;
            assert!(error.abs() < 1e-9, "{shift}: {error}");
        }
    }

    fn amounts(all: [f64; AMOUNTS]) -> Amounts {
        bytemuck::cast(all)
    }

    fn as_array(amounts: Amounts) -> [f64; AMOUNTS] {
        bytemuck::cast(amounts)
    }

    /// The expected numbers are those of another program for the same formulas.
    #[test]
    fn every_amount_is_extrapolated_by_its_own_law() {
        let fine = amounts([9e6, 2e6, 3e5, 4e5, 8e6, 9e6, 2.0, 3.0, 5.0, 7.0]);
        let coarse = amounts([1.5e6, 3e6, 1.2e5, 9e4, 1.6e6, 1.7e6, 0.5, 1.0, 1.25, 6.0]);
        // Fewer tests than components, and more time for sides than the finer one.
        let odd = amounts([5e5, 0.0, 5e4, 6e5, 3e4, 1e4, 1.0, 9.0, 2.0, 3.0]);
        let tiny = amounts([0.5, 0.0, 0.25, 0.5, 40.0, 50.0, 1.0, 1.0, 1.0, 1.0]);
        #[rustfmt::skip]
        let expected = [
            ((2, fine), Some((4, coarse)), 6e7, 0, [133836269.53125, 2000000.0, 1198307.37304688, 4311091.76897321, 82586557.03125, 83769188.4765625, 7.9887158203125, 32.3331882672991, 74.3534830729167, 7.0]),
            ((2, fine), Some((4, coarse)), 6e7, 2, as_array(fine)),
            ((2, fine), Some((4, coarse)), 6e7, 3, [3376352.16346154, 2000000.0, 160985.338365709, 180095.605349512, 3370016.69337607, 3685911.62526709, 1.07323558910473, 1.35071704012134, 1.87575120192308, 7.0]),
            ((2, fine), None, 6e7, 0, [187500000.0, 2000000.0, 4935937.5, 7953571.42857143, 143660000.0, 146175000.0, 32.90625, 59.6517857142857, 104.166666666667, 7.0]),
            ((2, fine), None, 6e7, 3, [2136718.75, 2000000.0, 74645.99609375, 95954.2410714286, 1959218.75, 2244335.9375, 0.497639973958333, 0.719656808035714, 1.18706597222222, 7.0]),
            ((3, fine), Some((4, odd)), 1e6, 0, [923351375.0, 2000000.0, 24162162.5, 2532650.0, 903018405.0, 1020609760.0, 161.081083333333, 18.994875, 512.972986111111, 7.0]),
            ((1, tiny), None, 0.0, 0, [2.0, 0.0, 1.0, 2.0, 160.0, 200.0, 1.0, 2.0, 2.0, 1.0]),
            ((1, coarse), Some((2, fine)), 4e6, 0, [3543750.0, 3000000.0, 224402.34375, 193955.357142857, 3236750.0, 3183437.5, 0.935009765625, 2.15505952380952, 2.953125, 6.0]),
            ((1, coarse), Some((2, fine)), 4e6, 4, [217407.980871382, 3000000.0, 18891.5492699765, 13518.0023571288, 245680.451776363, 267518.573880203, 0.078714788624902, 0.15020002619032, 0.181173317392819, 6.0]),
            ((2, fine), Some((4, coarse)), 6e9, 0, [6002633125.0, 2000000.0, 18795087.5, 214282735.714286, 2160649000.0, 314664878.90625, 125.300583333333, 1607.12051785714, 3334.79618055556, 7.0]),
            ((2, fine), Some((4, coarse)), 6e9, 3, [11886638.6217949, 2000000.0, 44716.9948268581, 429198.087596525, 4433559.96621622, 2917667.86317568, 0.298113298845721, 3.21898565697394, 6.60368812321937, 7.0]),
        ];
        for (fine, coarse, cells_boxed, shift, want) in expected {
            let got = as_array(Pilots { fine, coarse, cells_boxed }.at(shift));
            let near = |(got, want): (&f64, &f64)| (got - want).abs() <= 1e-12 * want;
            assert!(got.iter().zip(&want).all(near), "{got:?} for {want:?}");
        }
    }

    #[test]
    fn times_are_added_and_the_greater_bytes_count() {
        let all = amounts([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0]);
        assert_eq!((all.time_cpu_s(), all.bytes()), (960.0, 32.0));
    }
}
