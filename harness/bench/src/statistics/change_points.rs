//! Change points by E-divisive (Matteson and James, "A Nonparametric Approach for Multiple Change Point Analysis of
//! Multivariate Data", 2014). The series is split where the energy distance between the two sides is greatest, as long as
//! a permutation test finds the split significant.
//!
//! The method assumes no distribution, so it treats exact counters and noisy times alike. Permutations are drawn from a
//! seed: the result is reproducible.

use super::median::median_of;
use super::random::Random;

/// Criteria for a change point.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Significance level: the probability of a false change point.
    pub alpha: f64,
    /// Number of permutations; the p-value has a resolution of one over this number.
    pub permutations: usize,
    /// Smaller changes of the median are ignored; a fraction.
    pub effect_min: f64,
    /// Seed of the permutations.
    pub seed: u64,
}

impl Default for Rules {
    fn default() -> Self {
        Self { alpha: 0.01, permutations: 999, effect_min: 0.001, seed: 1 }
    }
}

/// Minimum number of values on either side of a change: a single value may be an outlier.
const SEGMENT_MIN: usize = 2;

/// Returns the index of the first value after each change and its p-value, in ascending order.
pub fn change_points(values: &[f64], rules: &Rules) -> Vec<(usize, f64)> {
    let mut random = Random(rules.seed);
    let mut found = Vec::new();
    // A stack of segments, so that the order of the random draws depends on the values alone.
    let mut segments = Vec::from([(0, values.len())]);
    while let Some((from, until)) = segments.pop() {
        let part = &values[from..until];
        let Some((at, energy)) = best_split(part) else { continue };
        if !large(&part[..at], &part[at..], rules.effect_min) {
            continue;
        }
        let p = p_value(part, energy, rules, &mut random);
        if p <= rules.alpha {
            let at = from + at;
            found.push((at, p));
            segments.extend([(from, at), (at, until)]);
        }
    }
    found.sort_by_key(|(at, _)| *at);
    found
}

/// Whether the medians differ by more than a fraction of the first.
fn large(before: &[f64], after: &[f64], fraction: f64) -> bool {
    let (before, after) = (median_of(before), median_of(after));
    (after - before).abs() > fraction * before.abs()
}

/// Returns the split with the greatest energy distance, and that distance; `None` if the series is too short or
/// constant.
fn best_split(values: &[f64]) -> Option<(usize, f64)> {
    let n = values.len();
    let distances =
        |from: &[f64], to: f64| from.iter().map(|value| (value - to).abs()).sum::<f64>();
    // Moving one value from after to before changes the three sums by its distances alone.
    let (mut within_before, mut between) = (0.0, 0.0);
    let mut within_after: f64 = (0..n).map(|i| distances(&values[i + 1..], values[i])).sum();
    let mut best: Option<(usize, f64)> = None;
    for i in 0..n {
        let (to_before, to_after) =
            (distances(&values[..i], values[i]), distances(&values[i + 1..], values[i]));
        within_before += to_before;
        within_after -= to_after;
        between += to_after - to_before;
        let (b, a) = ((i + 1) as f64, (n - i - 1) as f64);
        if i + 1 < SEGMENT_MIN || n - i - 1 < SEGMENT_MIN {
            continue;
        }
        let pairs = |count: f64| count * (count - 1.0) / 2.0;
        let distance = 2.0 * between / (a * b) - within_before / pairs(b) - within_after / pairs(a);
        let energy = a * b / (a + b) * distance;
        if energy > best.map_or(0.0, |(_, energy)| energy) {
            best = Some((i + 1, energy));
        }
    }
    best
}

/// Returns the p-value: the fraction of permutations whose best split has at least this energy distance.
fn p_value(values: &[f64], energy: f64, rules: &Rules, random: &mut Random) -> f64 {
    let mut shuffled = values.to_vec();
    // Sums in a different order differ in their last bits.
    let enough = energy * (1.0 - 1e-9);
    let as_clear = (0..rules.permutations).filter(|_| {
        random.shuffle(&mut shuffled);
        best_split(&shuffled).is_some_and(|(_, other)| other >= enough)
    });
    (1 + as_clear.count()) as f64 / (1 + rules.permutations) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: usize, seed: u64) -> Vec<f64> {
        let mut random = Random(seed);
        (0..count).map(|_| 100.0 + random.below(1000) as f64 / 200.0).collect()
    }

    fn places(values: &[f64]) -> Vec<usize> {
        change_points(values, &Rules::default()).into_iter().map(|(at, _)| at).collect()
    }

    #[test]
    fn steps_are_located_exactly() {
        let mut values = noise(60, 1);
        values[20..].iter_mut().for_each(|value| *value *= 1.1);
        values[45..].iter_mut().for_each(|value| *value *= 0.8);
        assert_eq!(places(&values), [20, 45]);
    }

    #[test]
    fn an_exact_counter_needs_two_values_after_the_change() {
        let mut values = vec![7.0; 30];
        values.push(8.0);
        assert_eq!(places(&values), [0usize; 0]);
        values.push(8.0);
        assert_eq!(places(&values), [30]);
    }

    #[test]
    fn noise_rarely_gives_a_change_point() {
        let false_alarms = (0..100).filter(|&seed| !places(&noise(30, seed)).is_empty()).count();
        assert!(false_alarms <= 4, "{false_alarms}");
        assert_eq!(places(&[]), [0usize; 0]);
        assert_eq!(places(&[5.0; 50]), [0usize; 0]);
    }

    /// Compares with the definition, summed naively.
    #[test]
    fn the_split_is_the_one_with_the_greatest_energy_distance() {
        for seed in 0..20 {
            let values = noise(12, seed);
            let mean = |x: &[f64], y: &[f64], pairs: f64| {
                x.iter().flat_map(|a| y.iter().map(move |b| (a - b).abs())).sum::<f64>() / pairs
            };
            let energy = |at: usize| {
                let (x, y) = values.split_at(at);
                let (m, n) = (x.len() as f64, y.len() as f64);
                let distance =
                    2.0 * mean(x, y, m * n) - mean(x, x, m * (m - 1.0)) - mean(y, y, n * (n - 1.0));
                m * n / (m + n) * distance
            };
            let greatest = (2..=10).map(energy).fold(0.0, f64::max);
            match best_split(&values) {
                Some((at, found)) => {
                    assert!((found - energy(at)).abs() < 1e-9 && (found - greatest).abs() < 1e-9)
                }
                None => assert!(greatest <= 0.0),
            }
        }
    }
}
