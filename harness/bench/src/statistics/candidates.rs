//! Places at which a long series may be divided.
//!
//! The best division takes a time quadratic in the number of places. A series of at most [`PLACES_MAX`] values may be divided
//! anywhere. A longer one may be divided on an even grid, near its ends, and where the windows before and after a place differ
//! most: eight places for windows of 1, 2, 4, ... values. Choosing them takes a time linear in the number of values.
//!
//! A step that is clear within windows of about the length of its segments is a place to the exact value; of others the grid has
//! one nearby, and [`super::segments::Series::refined`] moves the boundary.

use super::segments::Mean;

/// Greatest number of values that may be divided anywhere.
pub const PLACES_MAX: usize = 128;

/// Number of places per width of the windows.
const PER_WIDTH: usize = 8;

/// Number of places on the even grid.
const GRID: usize = 32;

/// Number of values at either end of which all are places.
const END: usize = 12;

/// Returns the places at which a series may be divided, in ascending order: indices of the first value after a boundary.
pub fn places(values: &[f64], mean: Mean) -> Vec<usize> {
    let n = values.len();
    if n <= PLACES_MAX {
        return (1..n).collect();
    }
    let sums = prefix_sums(values);
    let mut places: Vec<usize> = (1..END).chain(n - END + 1..n).collect();
    places.extend((1..GRID).map(|i| i * n / GRID));
    let mut width = 1;
    while 2 * width * reach(mean) <= n {
        places.extend(strongest(&sums, width, mean));
        width *= 2;
    }
    places.sort_unstable();
    places.dedup();
    places
}

/// Number of windows on either side that a contrast compares.
fn reach(mean: Mean) -> usize {
    match mean {
        Mean::Constant => 1,
        Mean::Linear => 2,
    }
}

fn prefix_sums(values: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let next = |value: &f64| {
        sum += value;
        sum
    };
    std::iter::once(0.0).chain(values.iter().map(next)).collect()
}

/// Returns how much the windows before and after a place differ. For linear means, the mean of the same differences one
/// window earlier and later is subtracted, which is zero for the difference that a slope makes.
fn contrast(sums: &[f64], at: usize, width: usize, mean: Mean) -> f64 {
    #[cfg(test)]
    super::segments::count_evaluation();
    let neighbours = sums[at - width] + sums[at + width];
    let contrast = match mean {
        Mean::Constant => neighbours - 2.0 * sums[at],
        Mean::Linear => {
            let outer = sums[at - 2 * width] + sums[at + 2 * width];
            2.0 * neighbours - 3.0 * sums[at] - 0.5 * outer
        }
    };
    contrast.abs()
}

/// Returns the places with the largest contrasts between windows of `width` values, at least `width` from each other.
fn strongest(sums: &[f64], width: usize, mean: Mean) -> Vec<usize> {
    // The contrast of wide windows changes slowly.
    let step = (width / 8).max(1);
    let margin = width * reach(mean);
    let end = sums.len() - margin;
    let largest_in = |from: usize| {
        let contrasts = (from..end.min(from + width)).step_by(step);
        let contrasts = contrasts.map(|at| (contrast(sums, at, width, mean), at));
        contrasts.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut largest: Vec<(f64, usize)> =
        (margin..end).step_by(width).filter_map(largest_in).collect();
    // Of three blocks in sequence, the largest contrasts of two at least may be too close to each other.
    let enough = 4 * PER_WIDTH;
    if largest.len() > enough {
        largest.select_nth_unstable_by(enough, |a, b| b.0.total_cmp(&a.0));
        largest.truncate(enough);
    }
    largest.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut taken: Vec<usize> = Vec::with_capacity(PER_WIDTH);
    for (_, at) in largest {
        if taken.len() < PER_WIDTH && taken.iter().all(|other| other.abs_diff(at) >= width) {
            taken.push(at);
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values between 0 and 1 that do not repeat within a window.
    fn noise(count: usize) -> Vec<f64> {
        (0..count).map(|i| (i * 7919 % 1009) as f64 / 1009.0).collect()
    }

    #[test]
    fn a_short_series_may_be_divided_anywhere() {
        assert_eq!(places(&noise(PLACES_MAX), Mean::Linear), (1..PLACES_MAX).collect::<Vec<_>>());
        assert!(places(&[1.0], Mean::Constant).is_empty());
    }

    #[test]
    fn the_ends_of_short_segments_are_places_with_and_without_a_slope() {
        for (mean, slope) in [(Mean::Constant, 0.0), (Mean::Linear, 0.5)] {
            for length in [6, 10, 100] {
                let mut values = noise(3000);
                values[1234..1234 + length].iter_mut().for_each(|value| *value += 4.0);
                values.iter_mut().enumerate().for_each(|(i, value)| *value -= slope * i as f64);
                let places = places(&values, mean);
                let found = |at: &usize| places.contains(at);
                assert!([1234, 1234 + length].iter().all(found), "{mean:?}, {length}: {places:?}");
            }
        }
    }

    #[test]
    fn the_number_of_places_grows_with_the_logarithm_of_the_length() {
        for mean in [Mean::Constant, Mean::Linear] {
            let count = |n: usize| places(&noise(n), mean).len();
            assert!(count(3000) <= 160 && count(100_000) <= 220, "{mean:?}");
            assert!(places(&noise(129), mean).iter().all(|at| (1..129).contains(at)));
        }
    }
}
