//! Bounds on the positions, normals and heights of some patches, and what they imply for the pairs of each with another patch.
//!
//! A patch is some facets; `N` patches are compared with another one at once, in f32 and in loops over `N` that compilers turn into
//! vector instructions. Upper bounds on rounding errors are part of the stored bounds.

use super::opposite::COSINE;

/// Upper bound on the relative rounding errors of squares and of cosines.
const ROUNDING: f32 = 1e-5;

/// Squared cosines that decide whether a line may be and must be within 60 degrees of a normal.
const COSINES_SQUARED: [f32; 2] = {
    let cosine = COSINE as f32;
    [cosine * cosine * (1.0 - 4.0 * ROUNDING), cosine * cosine * (1.0 + 4.0 * ROUNDING)]
};

/// Bounds of `N` patches. Of each array over axes, the last index is the patch.
#[derive(Clone, Copy, Debug)]
pub struct Bundle<const N: usize> {
    /// The middles of the bounding boxes, relative to that of all facets.
    pub centre: [[f32; N]; 3],
    /// Half the lengths of the bounding boxes.
    pub half: [[f32; N]; 3],
    /// Vectors in the middle of the unit normals.
    pub normal: [[f32; N]; 3],
    /// Greatest differences of the components of the unit normals from those of `normal`.
    pub spread: [[f32; N]; 3],
    /// Least scalar products of `normal` and a vertex, relative to `centre`.
    pub low: [f32; N],
    /// Greatest scalar products of `normal` and a vertex, relative to `centre`.
    pub high: [f32; N],
}

/// What the bounds of `N` patches and another one imply for walls, and for gaps.
#[derive(Clone, Copy, Debug)]
pub struct Verdicts<const N: usize> {
    /// Positive if facets of either may be opposite within the limits.
    pub may: [[f32; N]; 2],
    /// Positive if all facets of either are opposite within the limits, unless their shells prevent it.
    pub must: [[f32; N]; 2],
    /// Lower bounds on their squared distances.
    pub squared_min: [f32; N],
    /// Upper bounds on their squared distances.
    pub squared_max: [f32; N],
}

impl<const N: usize> Bundle<N> {
    /// No patches.
    pub const EMPTY: Self = Self {
        centre: [[0.0; N]; 3],
        half: [[0.0; N]; 3],
        normal: [[0.0; N]; 3],
        spread: [[0.0; N]; 3],
        low: [0.0; N],
        high: [0.0; N],
    };

    /// One of the patches.
    pub fn one(&self, i: usize) -> Bundle<1> {
        let of = |values: &[[f32; N]; 3]| [0, 1, 2].map(|a| [values[a][i]]);
        Bundle {
            centre: of(&self.centre),
            half: of(&self.half),
            normal: of(&self.normal),
            spread: of(&self.spread),
            low: [self.low[i]],
            high: [self.high[i]],
        }
    }

    /// Replaces one of the patches.
    pub fn set(&mut self, i: usize, one: &Bundle<1>) {
        for a in 0..3 {
            self.centre[a][i] = one.centre[a][0];
            self.half[a][i] = one.half[a][0];
            self.normal[a][i] = one.normal[a][0];
            self.spread[a][i] = one.spread[a][0];
        }
        self.low[i] = one.low[0];
        self.high[i] = one.high[0];
    }

    /// What is known of the pairs of a facet of each patch and a facet of another patch, nearer than the squared limits. With a limit
    /// of 0 there are none.
    #[inline(always)]
    pub fn verdicts(&self, other: &Bundle<1>, limits: [f64; 2]) -> Verdicts<N> {
        let limits = [limits[0] as f32, limits[1] as f32];
        let mut sums = [[0.0; N]; 2];
        let mut squared = [[0.0; N]; 2];
        // Of the middle of the other patch over these, and of these over the other.
        let mut middles = [[0.0; N]; 2];
        let mut boxes = [[0.0; N]; 2];
        let mut turned = [[0.0; N]; 2];
        let mut slacks = [[0.0; N]; 2];
        for a in 0..3 {
            let [centre, half] = [other.centre[a][0], other.half[a][0]];
            let [normal, spread] = [other.normal[a][0], other.spread[a][0]];
            for i in 0..N {
                let to = centre - self.centre[a][i];
                let (apart, halves) = (to.abs(), half + self.half[a][i]);
                let gap = greater(apart - halves, 0.0);
                let reach = apart + halves;
                squared[0][i] += gap * gap;
                squared[1][i] += reach * reach;
                let turn = normal + self.normal[a][i];
                let spreads = spread + self.spread[a][i];
                let (least, greatest) = (greater(turn.abs() - spreads, 0.0), turn.abs() + spreads);
                sums[0][i] += least * least;
                sums[1][i] += greatest * greatest;
                middles[0][i] += self.normal[a][i] * to;
                middles[1][i] -= normal * to;
                boxes[0][i] += self.normal[a][i].abs() * half;
                boxes[1][i] += normal.abs() * self.half[a][i];
                turned[0][i] += turn.abs() * half;
                turned[1][i] += turn.abs() * self.half[a][i];
                slacks[0][i] += self.spread[a][i] * reach;
                slacks[1][i] += spread * reach;
            }
        }
        let [mut squared_min, mut squared_max] = squared;
        let [mut walls_may, mut gaps_may, mut walls_must, mut gaps_must] = [[0.0; N]; 4];
        for i in 0..N {
            // The heights of a vertex of one patch over one of the other, along any normal of the latter. The one patch lies in its
            // bounding box, and is perhaps thinner along its own normals, which are nearly opposite.
            let low = middles[0][i] + greater(-boxes[0][i], -turned[0][i] - other.high[0]);
            let high = middles[0][i] + less(boxes[0][i], turned[0][i] - other.low[0]);
            let (low, high) =
                (low - self.high[i] - slacks[0][i], high - self.low[i] + slacks[0][i]);
            let low_back = middles[1][i] + greater(-boxes[1][i], -turned[1][i] - self.high[i]);
            let high_back = middles[1][i] + less(boxes[1][i], turned[1][i] - self.low[i]);
            let low_back = low_back - other.high[0] - slacks[1][i];
            let high_back = high_back - other.low[0] + slacks[1][i];
            squared_min[i] *= 1.0 - ROUNDING;
            squared_max[i] *= 1.0 + ROUNDING;
            // Normals differ by at least 120 degrees iff their sum is no longer than 1.
            let [may_avert, must_avert] =
                [1.0 + ROUNDING - sums[0][i], 1.0 - ROUNDING - sums[1][i]];
            // Each is below the other in walls, and above it in gaps. The least and the greatest of both heights, and the greatest of
            // the least.
            let walls =
                [less(-high, -high_back), less(-low, -low_back), greater(-high, -high_back)];
            let gaps = [less(low, low_back), less(high, high_back), greater(low, low_back)];
            let may = |[_, upper, nearest]: [f32; 3], limit: f32| {
                let nearest = greater(nearest, 0.0);
                let nearest =
                    less(limit - squared_min[i], limit - nearest * nearest * (1.0 - ROUNDING));
                less(
                    less(may_avert, nearest),
                    less(upper, upper * upper - COSINES_SQUARED[0] * squared_min[i]),
                )
            };
            let must = |[lower, ..]: [f32; 3], limit: f32| {
                let along = lower * lower - COSINES_SQUARED[1] * squared_max[i];
                less(less(must_avert, limit - squared_max[i]), less(lower, along))
            };
            walls_may[i] = may(walls, limits[0]);
            gaps_may[i] = may(gaps, limits[1]);
            walls_must[i] = must(walls, limits[0]);
            gaps_must[i] = must(gaps, limits[1]);
        }
        Verdicts {
            may: [walls_may, gaps_may],
            must: [walls_must, gaps_must],
            squared_min,
            squared_max,
        }
    }
}

impl Bundle<1> {
    /// The sum of the lengths of a bounding box.
    pub fn size(&self) -> f32 {
        self.half[0][0] + self.half[1][0] + self.half[2][0]
    }

    /// The distance of the middles of two bounding boxes, along the axes.
    pub fn distance_of_middles(&self, other: &Self) -> f32 {
        (0..3).map(|a| (self.centre[a][0] - other.centre[a][0]).abs()).sum()
    }
}

/// The lesser of two numbers, neither NaN; unlike `min` one instruction.
pub fn less<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// The greater of two numbers, neither NaN; unlike `max` one instruction.
pub fn greater<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}
