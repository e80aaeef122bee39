//! The cells that extent boxes ask for: their volumes, where boxes overlap by the finest of them.

use bricks::octant::{Level, edge};
use mesher::input::lattice::ExtentBox;

/// Boxes above this number are not intersected with each other, which takes the cube of their number.
const INTERSECTED_MAX: usize = 24;

/// Disjoint boxes.
#[derive(Clone, Debug, Default)]
pub struct Volumes {
    parts: Vec<ExtentBox>,
}

impl Volumes {
    /// The disjoint parts of some boxes. Of more than 24 boxes the overlaps are counted repeatedly.
    pub fn new(boxes: &[ExtentBox]) -> Self {
        if boxes.len() > INTERSECTED_MAX {
            return Self { parts: boxes.to_vec() };
        }
        let ends: [Vec<i64>; 3] = std::array::from_fn(|a| {
            let mut ends: Vec<i64> = boxes.iter().flat_map(|b| [b.min[a], b.max[a]]).collect();
            ends.sort_unstable();
            ends.dedup();
            ends
        });
        let mut parts = Vec::new();
        for z in ends[2].windows(2) {
            for y in ends[1].windows(2) {
                for x in ends[0].windows(2) {
                    let (min, max) = ([x[0], y[0], z[0]], [x[1], y[1], z[1]]);
                    let holds =
                        |b: &&ExtentBox| (0..3).all(|a| b.min[a] <= min[a] && max[a] <= b.max[a]);
                    let level = boxes.iter().filter(holds).map(|b| b.level).max();
                    parts.extend(level.map(|level| ExtentBox { min, max, level }));
                }
            }
        }
        Self { parts }
    }

    /// Whether no box has an interior.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The cells in all parts.
    pub fn cells(&self) -> f64 {
        self.parts.iter().map(|part| cells(part, part.min, part.max)).sum()
    }

    /// The cells that the parts ask for in a cube.
    pub fn cells_in(&self, min: [i64; 3], h: i64) -> f64 {
        self.parts.iter().map(|part| cells(part, min, min.map(|c| c + h))).sum()
    }

    /// Whether a part meets the interior of a cube.
    pub fn meet(&self, min: [i64; 3], h: i64) -> bool {
        self.parts.iter().any(|part| part.meets(min, h))
    }
}

/// Cells of a box's level between two corners.
fn cells(part: &ExtentBox, min: [i64; 3], max: [i64; 3]) -> f64 {
    let side = |a: usize| (part.max[a].min(max[a]) - part.min[a].max(min[a])).max(0) as f64;
    let level: Level = part.level;
    (0..3).map(|a| side(a) / edge(level) as f64).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlaps_count_once_and_with_the_finest_level() {
        let h = edge(5);
        let coarse = ExtentBox { min: [0; 3], max: [4 * h; 3], level: 5 };
        let fine = ExtentBox { min: [3 * h; 3], max: [5 * h; 3], level: 6 };
        let volumes = Volumes::new(&[coarse, coarse, fine]);
        assert_eq!(volumes.cells(), 63.0 + 64.0);
        assert_eq!(volumes.cells_in([3 * h; 3], h), 8.0);
        assert!(volumes.meet([4 * h; 3], h) && !volumes.meet([5 * h; 3], h));
        assert_eq!(Volumes::new(&[]).cells(), 0.0);
        assert!(Volumes::new(&[]).is_empty() && !volumes.is_empty());
        let counted = |copies: usize| Volumes::new(&vec![coarse; copies]).cells();
        assert_eq!((counted(24), counted(25)), (64.0, 25.0 * 64.0));
    }
}
