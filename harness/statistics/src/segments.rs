//! Segments of a series with a constant or linear mean and autocorrelated noise, by least squares.
//!
//! The noise is a first-order autoregression with a known coefficient `phi`; 0 is independent noise. Each segment is
//! whitened by itself (Prais and Winsten): its first value is multiplied by sqrt(1 - phi^2), and phi times its
//! predecessor is subtracted from every other value. Prefix sums make the cost of any segment available in constant time.
//!
//! Boundaries are found by seeded binary segmentation (Kovács, Bühlmann, Li and Munk, 2023): of all intervals of a fixed set, each
//! as long as a step may take to be seen, the one that gains most by a division is divided, and those that contain the
//! boundary are discarded. That takes a time proportional to n log n, and finds short excursions in long series.
//!
//! Invariant: costs are never negative, and a linear mean never costs more than a constant one.

use std::f64::consts::SQRT_2;

/// The mean of a segment, with its minimum length: a single value may be an outlier, and a slope needs more values than parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mean {
    /// A level.
    Constant = 2,
    /// A level and a slope.
    Linear = 5,
}

/// Sums over the whitened values 1..=i of a series: value, value squared, time, time squared, time times value.
type Sums = [f64; 5];

/// A series with the prefix sums of its whitened values.
pub(super) struct Series<'a> {
    values: &'a [f64],
    phi: f64,
    sums: Vec<Sums>,
}

/// The least-squares fit of a segment.
pub(super) struct Fit {
    /// Sum of squares of the whitened residuals.
    pub cost: f64,
    level: f64,
    slope: f64,
}

impl Fit {
    /// Returns the mean at an index of the series, which may lie between two values.
    pub fn at(&self, index: f64) -> f64 {
        self.level + self.slope * index
    }
}

impl<'a> Series<'a> {
    /// Prepares a series for noise with autocorrelation `phi`, from 0 to below 1.
    pub fn new(values: &'a [f64], phi: f64) -> Self {
        let (mut sums, mut last) = (Vec::with_capacity(values.len().max(1)), [0.0; 5]);
        sums.push(last);
        for i in 1..values.len() {
            let (z, time) = (values[i] - phi * values[i - 1], i as f64 - phi * (i as f64 - 1.0));
            let terms = [z, z * z, time, time * time, time * z];
            last = std::array::from_fn(|k| last[k] + terms[k]);
            sums.push(last);
        }
        Self { values, phi, sums }
    }

    /// Returns the fit of the values `from..until`, which are at least one.
    #[inline]
    pub fn fit(&self, from: usize, until: usize, mean: Mean) -> Fit {
        let (first, last) = (&self.sums[from], &self.sums[until - 1]);
        let [z, zz, t, tt, tz]: Sums = std::array::from_fn(|k| last[k] - first[k]);
        let (weight, gain) = (1.0 - self.phi * self.phi, 1.0 - self.phi);
        let (y, time, rest) = (self.values[from], from as f64, (until - from - 1) as f64);
        let (ones, values) = (weight + rest * gain * gain, weight * y + gain * z);
        let (squares, level) = (weight * y * y + zz, values / ones);
        let constant = Fit { cost: (squares - values * level).max(0.0), level, slope: 0.0 };
        if mean == Mean::Constant {
            return constant;
        }
        let times = weight * time + gain * t;
        let spread = weight * time * time + tt - times * times / ones;
        if spread <= 0.0 {
            return constant;
        }
        let product = weight * time * y + tz - times * level;
        let slope = product / spread;
        let cost = (constant.cost - product * slope).max(0.0);
        Fit { cost, level: level - slope * times / ones, slope }
    }

    /// Returns at most `count_max` boundaries, the most significant first: indices of the first value of a segment.
    pub fn boundaries(&self, mean: Mean, count_max: usize) -> Vec<usize> {
        let intervals = intervals(self.values.len(), 2 * mean as usize);
        let divided = |within: (usize, usize)| (within, self.divided(within, mean));
        let mut divisions: Vec<_> = intervals.map(divided).collect();
        divisions.sort_by(|(_, a), (_, b)| b.1.total_cmp(&a.1));
        let mut found = Vec::new();
        while found.len() < count_max && !divisions.is_empty() {
            let (_, (at, _)) = divisions[0];
            found.push(at);
            divisions.retain(|((from, until), _)| at <= *from || *until <= at);
        }
        found
    }

    /// Where the division of an interval, of at least two segments' length, reduces the cost most, and by how much.
    fn divided(&self, (from, until): (usize, usize), mean: Mean) -> (usize, f64) {
        let cost = |at| self.fit(from, at, mean).cost + self.fit(at, until, mean).cost;
        let places = from + mean as usize..=until - mean as usize;
        let best = places.map(|at| (cost(at), at)).min_by(|a, b| a.0.total_cmp(&b.0));
        let (cost, at) = best.expect("the interval has room for two segments");
        (at, self.fit(from, until, mean).cost - cost)
    }
}

/// Returns intervals of lengths n, n / sqrt(2), n / 2, ..., each of which overlaps half of its neighbours, and all of length `least`: of two
/// boundaries half of that apart, no other contains the one without the other.
fn intervals(n: usize, least: usize) -> impl Iterator<Item = (usize, usize)> {
    let lengths = std::iter::successors(Some(n as f64), |length| Some(length / SQRT_2));
    let longer = lengths.take_while(move |length| *length > least as f64).flat_map(move |length| {
        let count = 2 * (n as f64 / length).ceil() as usize - 1;
        let step = (n as f64 - length) / (count - 1).max(1) as f64;
        (0..count).map(move |i| {
            let from = i as f64 * step;
            (from as usize, ((from + length).ceil() as usize).min(n))
        })
    });
    longer.chain((least..=n).map(move |until| (until - least, until)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn values(count: usize) -> Vec<f64> {
        let mut random = Random(count as u64);
        (0..count).map(|_| random.below(1000) as f64 / 100.0).collect()
    }

    /// The sum of squares, by the whitened residuals of the fit.
    fn squares(series: &Series, from: usize, until: usize, mean: Mean) -> f64 {
        let fit = series.fit(from, until, mean);
        let plain = |i: usize| series.values[i] - fit.at(i as f64);
        let rest = (from + 1..until).map(|i| (plain(i) - series.phi * plain(i - 1)).powi(2));
        (1.0 - series.phi.powi(2)) * plain(from).powi(2) + rest.sum::<f64>()
    }

    #[test]
    fn the_cost_is_the_sum_of_squares_and_no_other_line_has_less() {
        let values = values(40);
        for phi in [0.0, 0.5, 0.9] {
            let series = Series::new(&values, phi);
            for mean in [Mean::Constant, Mean::Linear] {
                let fit = series.fit(7, 33, mean);
                assert!((fit.cost - squares(&series, 7, 33, mean)).abs() < 1e-6 * fit.cost);
                let shifted: Vec<f64> = (0..40)
                    .map(|i| values[i] - fit.at(i as f64) + if i < 20 { 0.1 } else { -0.1 })
                    .collect();
                let other = Series::new(&shifted, phi).fit(7, 33, mean).cost;
                assert!((other - fit.cost).abs() > 1e-6, "{mean:?}");
            }
        }
    }

    #[test]
    fn intervals_cover_every_place_at_every_length() {
        for n in [4, 5, 33, 300] {
            let all: Vec<(usize, usize)> = intervals(n, 4).collect();
            assert_eq!(all[0], (0, n));
            for &(from, until) in &all {
                assert!(from + 4 <= until && until <= n, "{n}: {from}..{until}");
            }
            let shortest = |at: usize| {
                all.iter().any(|&(from, until)| from < at && at < until && until - from <= 7)
            };
            assert!((1..n).all(shortest), "{n}: {all:?}");
            assert!((4..=n).all(|until| all.contains(&(until - 4, until))), "{n}: {all:?}");
        }
    }

    #[test]
    fn steps_and_short_excursions_are_divided_first_with_and_without_a_slope() {
        for (mean, slope) in [(Mean::Constant, 0.0), (Mean::Linear, 0.5)] {
            let mut values = values(300);
            values[100..].iter_mut().for_each(|value| *value += 60.0);
            values[200..212].iter_mut().for_each(|value| *value -= 40.0);
            values.iter_mut().enumerate().for_each(|(i, value)| *value -= slope * i as f64);
            let mut found = Series::new(&values, 0.3).boundaries(mean, 3);
            found.sort_unstable();
            assert_eq!(found, [100, 200, 212], "{mean:?}");
        }
    }
}
