//! Pilot runs: what the case needs at a coarser spacing, and what it therefore needs at its own.
//!
//! Coarsening every spacing by a power of two shifts the whole mesh by that many levels. Let x be the number of levels to which
//! a mesh is refined further. What the boxes fill grows like 8^x and is known from their volumes. The remainder is a shell around
//! surfaces, n cells thick at every level: it grows like 4^x with the areas, with a term in 2^x for curvature, edges and layers that
//! overlap, and with slower terms for the far field. Two pilot runs give the first term and one for all others, whose base lies
//! between 2 and 1 for the slower ones.

use bricks::brick::{self, Brick};
use bricks::brickset::BrickSet;
use bricks::octant::{Level, corner, edge};
use bytemuck::{Pod, Zeroable};
use mesher::input::lattice::{ExtentBox, Rules};
use mesher::{Job, Mesh};

/// Number of quantities in [`Amounts`].
pub const AMOUNTS: usize = 8;

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
    /// Bytes of the sets, nodes and components while sides are decided.
    pub bytes_sides: f64,
    /// Bytes of the sets in gradation.
    pub bytes_graded: f64,
    /// CPU time of refinement, in seconds.
    pub time_refine_s: f64,
    /// CPU time of sides, gradation, leaves and what moves them.
    pub time_cells_s: f64,
    /// CPU time of the other phases, most of which is spent on facets.
    pub time_fixed_s: f64,
}

impl Amounts {
    /// The sums of several ranks' amounts.
    pub fn sum(of: impl Iterator<Item = Self>) -> Self {
        let all = of.map(bytemuck::cast::<Self, [f64; AMOUNTS]>);
        bytemuck::cast(all.fold([0.0; AMOUNTS], |a, b| std::array::from_fn(|i| a[i] + b[i])))
    }

    /// CPU time of all phases, in seconds.
    pub fn time_cpu_s(&self) -> f64 {
        self.time_refine_s + self.time_cells_s + self.time_fixed_s
    }

    /// The greater of the bytes that sets take in any phase.
    pub fn bytes(&self) -> f64 {
        self.bytes_sides.max(self.bytes_graded)
    }
}

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

/// What this rank needs for a pilot run of some cells of a case with some boxes.
pub fn amounts(mesh: &Mesh, cells: u64, job: &Job, boxes: &[ExtentBox]) -> Amounts {
    let stored: usize = mesh.crossing.iter().chain(&mesh.sides.stored).map(BrickSet::bytes).sum();
    let time = |of: &[&str]| -> f64 {
        job.record.phases.iter().filter(|p| of.contains(&p.name)).map(|p| p.time_cpu_s).sum()
    };
    let all: f64 = job.record.phases.iter().map(|p| p.time_cpu_s).sum();
    let time_refine_s = time(&["refine"]);
    let time_cells_s = time(&["sides", "leaks", "grade", "rebalance", "share top", "leaves"]);
    Amounts {
        cells: cells as f64,
        cells_boxed_deleted: boxed_in_deleted(boxes, mesh),
        tests: job.counters.facet_brick_tests as f64
            + job.counters.bricks_voxelised as f64 / VISITS_PER_TEST,
        bytes_sides: mesh.sides.bytes as f64,
        bytes_graded: (stored + mesh.bytes_graded) as f64,
        time_refine_s,
        time_cells_s,
        time_fixed_s: all - time_refine_s - time_cells_s,
    }
}

/// A pilot run of a case and its extrapolation.
pub struct Pilot {
    /// By how many levels it is coarser than the case.
    pub shift: Level,
    /// What all ranks need for it.
    pub amounts: Amounts,
    /// The same for a run that is coarser by another level; none if the pilot is the case itself.
    pub coarser: Option<Amounts>,
    /// Cells in the boxes at the case's own spacing.
    pub cells_boxed: f64,
    /// The part of them that are in boxes which ask for the finest leaves of the mesh.
    pub part_deepest: f64,
}

/// Bytes per cell of a box while sides are decided, if it is kept and if it is deleted: of boxes that are coarser than some leaves, and of
/// others. The set of a level with finer ones has full bricks.
const BYTES_PER_CELL_BOXED: [[f64; 2]; 2] = [[0.38, 0.19], [0.36, 0.24]];
/// The same in gradation, which makes no deleted ones.
const BYTES_PER_CELL_GRADED: f64 = 0.05;
/// A visit of each brick of 64 cells.
const TESTS_PER_CELL_BOXED: f64 = 1.0 / (64.0 * VISITS_PER_TEST);

impl Pilot {
    /// The amounts of a mesh that is coarser than the case by `shift` levels.
    pub fn at(&self, shift: Level) -> Amounts {
        let fine = self.amounts;
        if shift == self.shift {
            return fine;
        }
        let deleted = fine.cells_boxed_deleted.min(self.cells_boxed);
        let kept = self.cells_boxed - deleted;
        let further = self.shift as i32 - shift as i32;
        // Extrapolates one quantity, of which the boxes have so much at the case's own spacing.
        let grown = |of: fn(&Amounts) -> f64, of_boxes: f64| {
            let boxed = |shift: Level| of_boxes / 8f64.powi(shift as i32);
            let shell = |at, all: &Amounts| (of(all) - boxed(at)).max(0.05 * of(all));
            let coarse = self.coarser.map(|c| shell(self.shift + 1, &c));
            shell_at(further, shell(self.shift, &fine), coarse) + boxed(shift)
        };
        let cells = grown(|a| a.cells, kept);
        let tests = grown(|a| a.tests, self.cells_boxed * TESTS_PER_CELL_BOXED);
        let mixed = |[other, deepest]: [f64; 2]| other + (deepest - other) * self.part_deepest;
        let [of_kept, of_deleted] = BYTES_PER_CELL_BOXED.map(mixed);
        Amounts {
            cells,
            tests,
            bytes_sides: grown(|a| a.bytes_sides, kept * of_kept + deleted * of_deleted),
            bytes_graded: grown(|a| a.bytes_graded, kept * BYTES_PER_CELL_GRADED),
            time_refine_s: fine.time_refine_s * tests / fine.tests.max(1.0),
            time_cells_s: fine.time_cells_s * cells / fine.cells.max(1.0),
            ..fine
        }
    }
}

/// A quantity of a shell around surfaces, `further` levels finer than a mesh for which it is `fine`. A mesh that is coarser by one level has
/// `coarse`.
fn shell_at(further: i32, fine: f64, coarse: Option<f64>) -> f64 {
    let [by_area, by_length] = [4.0, BASE_BELOW_AREA].map(|base: f64| base.powi(further));
    let Some(coarse) = coarse else { return fine * by_area };
    let [area, length] = [1.0 / 4.0, 1.0 / BASE_BELOW_AREA];
    let of_area = ((fine * length - coarse) / (length - area)).max(0.0);
    of_area * by_area + (fine - of_area) * by_length
}

/// Deepest level of the octants in which overlapping boxes are distinguished.
const LEVEL_OVERLAP: Level = 6;

/// The boxes that meet a cube.
fn near(boxes: &[ExtentBox], min: [i64; 3], h: i64) -> Vec<ExtentBox> {
    boxes.iter().filter(|b| b.meets(min, h)).copied().collect()
}

/// The cells that boxes ask for in an octant; where boxes overlap, the finest of them.
pub fn boxed_in(boxes: &[ExtentBox], l: Level, code: u64) -> f64 {
    let (min, h) = (corner(l, code), edge(l));
    let near = near(boxes, min, h);
    let finest = near.iter().map(|b| b.level).max();
    let fills = |b: &ExtentBox| (0..3).all(|a| b.min[a] <= min[a] && min[a] + h <= b.max[a]);
    let is_one = near.iter().any(|b| Some(b.level) == finest && fills(b));
    if near.len() > 1 && !is_one && l < LEVEL_OVERLAP {
        return (code << 3..).take(8).map(|child| boxed_in(&near, l + 1, child)).sum();
    }
    let cells = |b: &ExtentBox| -> f64 {
        let span = |a: usize| b.max[a].min(min[a] + h) - b.min[a].max(min[a]);
        (0..3).map(|a| span(a) as f64 / edge(b.level) as f64).product()
    };
    let all = finest.map_or(0.0, |finest| (h as f64 / edge(finest) as f64).powi(3));
    near.iter().map(cells).sum::<f64>().min(all)
}

/// The cells that boxes ask for in deleted leaves that this rank owns.
fn boxed_in_deleted(boxes: &[ExtentBox], mesh: &Mesh) -> f64 {
    let of_brick = |l: Level, b: Brick| {
        let near = near(boxes, brick::min_corner(l, b.key), 4 * edge(l));
        match b.bits {
            // A full brick is one octant.
            u64::MAX => boxed_in(&near, l - 2, b.key),
            _ => b.codes().map(|code| boxed_in(&near, l, code)).sum::<f64>(),
        }
    };
    let bricks_of = |l, deleted| mesh.ownership.owned(l, deleted).map(move |b| of_brick(l, b));
    (0..).zip(mesh.sides.deleted()).flat_map(|(l, deleted)| bricks_of(l, deleted)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::morton;

    #[test]
    fn shells_and_boxes_grow_as_their_dimensions() {
        let amounts = |shift: i32| {
            let x = -f64::from(shift);
            let shell = 5e9 * 4f64.powf(x) + 7e6 * BASE_BELOW_AREA.powf(x);
            let cells = shell + 9e9 * 8f64.powf(x);
            Amounts { cells, cells_boxed_deleted: 1e9, ..Amounts::default() }
        };
        let (shift, cells_boxed) = (4, 10e9);
        let (amounts_fine, coarser) = (amounts(4), Some(amounts(5)));
        let pilot = Pilot { shift, amounts: amounts_fine, coarser, cells_boxed, part_deepest: 1.0 };
        for shift in 0..4 {
            let error = pilot.at(shift).cells / amounts(shift as i32).cells - 1.0;
            assert!(error.abs() < 1e-9, "{shift}: {error}");
        }
    }

    /// The expected numbers are those of another program for the same formulas.
    #[test]
    fn every_amount_is_extrapolated_by_its_own_law() {
        let amounts = |all: [f64; AMOUNTS]| -> Amounts { bytemuck::cast(all) };
        let fine = [9e6, 2e6, 3e5, 8e6, 9e6, 2.0, 5.0, 7.0];
        let coarse = [3e6, 3e6, 2e5, 3.2e6, 3.4e6, 0.5, 1.25, 6.0];
        // More tests and less memory than the finer one.
        let odd = [5e6, 0.0, 9e5, 3e4, 1e4, 1.0, 2.0, 3.0];
        let tiny = [0.5, 0.0, 0.25, 40.0, 50.0, 1.0, 1.0, 1.0];
        #[rustfmt::skip]
        let expected = [
            (2, fine, Some(coarse), 6e7, 0, [150128554.6875, 2000000.0, 1204223.14453125, 89324384.6679687, 96146302.734375, 8.028154296875, 83.4047526041667, 7.0]),
            (2, fine, Some(coarse), 6e7, 2, [9000000.0, 2000000.0, 300000.0, 8000000.0, 9000000.0, 2.0, 5.0, 7.0]),
            (2, fine, Some(coarse), 6e7, 3, [3000000.0, 2000000.0, 160944.758234797, 3200000.0, 3400000.0, 1.07296505489865, 1.66666666666667, 7.0]),
            (2, fine, None, 6e7, 0, [187500000.0, 2000000.0, 4940625.0, 142958750.0, 146175000.0, 32.9375, 104.166666666667, 7.0]),
            (3, fine, Some(odd), 1000000.0, 0, [56984625.0, 2000000.0, 1902573.85482788, 903291163.656006, 1020609760.0, 12.6838256988525, 31.658125, 7.0]),
            (1, tiny, None, 0.0, 0, [2.0, 0.0, 1.0, 160.0, 200.0, 1.0, 2.0, 1.0]),
            (1, coarse, Some(fine), 4000000.0, 4, [454313.98841289, 3000000.0, 31343.7423388245, 479613.342483976, 536012.049093912, 0.0783593558470612, 0.189297495172038, 6.0]),
            (2, fine, Some(coarse), 6e9, 0, [6003576625.0, 2000000.0, 18801337.5, 1998797600.0, 314664878.90625, 125.34225, 3335.32034722222, 7.0]),
            (2, fine, Some(coarse), 6e9, 3, [11864843.75, 2000000.0, 44729.2018581081, 4056474.609375, 2917667.86317568, 0.298194679054054, 6.59157986111111, 7.0]),
        ];
        for (shift, fine, coarser, cells_boxed, at, expected) in expected {
            let coarser = coarser.map(amounts);
            let amounts = amounts(fine);
            let pilot = Pilot { shift, amounts, coarser, cells_boxed, part_deepest: 0.25 };
            let found: [f64; AMOUNTS] = bytemuck::cast(pilot.at(at));
            for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                let error = (found - expected).abs() / expected.abs().max(1.0);
                assert!(error < 1e-9, "amount {i} at {at}: {found} for {expected}");
            }
        }
    }

    #[test]
    fn times_are_added_and_the_greater_bytes_count() {
        let all: Amounts = bytemuck::cast([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0]);
        assert_eq!((all.time_cpu_s(), all.bytes()), (224.0, 16.0));
    }

    #[test]
    fn overlaps_count_once_and_with_the_finest_level() {
        let h = edge(5);
        let coarse = ExtentBox { min: [0; 3], max: [4 * h; 3], level: 5 };
        let fine = ExtentBox { min: [3 * h; 3], max: [5 * h; 3], level: 6 };
        let boxes = [coarse, coarse, fine];
        assert_eq!(boxed_in(&boxes, 0, 0), 63.0 + 64.0);
        assert_eq!(boxed_in(&boxes, 5, morton([3; 3])), 8.0);
        assert_eq!(boxed_in(&boxes, 5, morton([5; 3])), 0.0);
        assert_eq!(boxed_in(&[], 0, 0), 0.0);
        // Below the level to which overlaps are resolved, boxes add up.
        let h = edge(LEVEL_OVERLAP + 1);
        let [low, high] = [[0; 3], [h; 3]].map(|min| ExtentBox {
            min,
            max: min.map(|c| c + h),
            level: LEVEL_OVERLAP + 1,
        });
        assert_eq!((boxed_in(&[low], 0, 0), boxed_in(&[low, high], 0, 0)), (1.0, 2.0));
        assert_eq!(boxed_in(&[low; 9], 0, 0), 8.0, "no more than the octant has");
    }
}
