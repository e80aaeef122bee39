//! Change points by E-divisive (Matteson and James, "A Nonparametric Approach for Multiple Change Point
//! Analysis of Multivariate Data", 2014): split where the energy distance between before and after is greatest, as
//! long as a random order of the same values would hardly ever split as clearly.
//!
//! Nothing is assumed about how values are distributed; a counter that repeats exactly and seconds on a busy
//! machine are treated alike. Values are put into random order by a seed, so the answer repeats.

use crate::gate::stats::Random;

/// When a change is one.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Chance of a false change.
    pub alpha: f64,
    /// Random orders tried; the chance cannot be told finer than one in so many.
    pub permutations: usize,
    /// Smaller changes of the median are passed over; a share.
    pub effect_min: f64,
    /// Chooses the orders.
    pub seed: u64,
}

impl Default for Rules {
    fn default() -> Self {
        Self { alpha: 0.01, permutations: 999, effect_min: 0.001, seed: 1 }
    }
}

/// Values on either side of a change: one value could be anything.
const SEGMENT_LEAST: usize = 2;

/// Indices of the first values after each change, with the chance of each, in order.
pub fn change_points(values: &[f64], rules: &Rules) -> Vec<(usize, f64)> {
    let mut random = Random(rules.seed);
    let mut found = Vec::new();
    // Segments still to be looked at, in an order that depends on the values alone, as the draws do.
    let mut segments = Vec::from([(0, values.len())]);
    while let Some((from, until)) = segments.pop() {
        let part = &values[from..until];
        let Some((at, energy)) = best_split(part) else { continue };
        if !large(&part[..at], &part[at..], rules.effect_min) {
            continue;
        }
        let p = chance(part, energy, rules, &mut random);
        if p <= rules.alpha {
            let at = from + at;
            found.push((at, p));
            segments.extend([(from, at), (at, until)]);
        }
    }
    found.sort_by_key(|(at, _)| *at);
    found
}

fn large(before: &[f64], after: &[f64], share: f64) -> bool {
    let (before, after) = (super::median(before), super::median(after));
    (after - before).abs() > share * before.abs()
}

/// Where the energy distance is greatest, and how great. Nothing where there is too little to split, or no
/// difference between any values.
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
        if i + 1 < SEGMENT_LEAST || n - i - 1 < SEGMENT_LEAST {
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

/// How often a random order of the same values splits as clearly.
fn chance(values: &[f64], energy: f64, rules: &Rules, random: &mut Random) -> f64 {
    let mut shuffled = values.to_vec();
    // Sums in another order differ in their last bits.
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
    fn steps_are_found_where_they_are() {
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
    fn noise_hardly_ever_changes() {
        let false_alarms = (0..100).filter(|&seed| !places(&noise(30, seed)).is_empty()).count();
        assert!(false_alarms <= 4, "{false_alarms}");
        assert_eq!(places(&[]), [0usize; 0]);
        assert_eq!(places(&[5.0; 50]), [0usize; 0]);
    }

    /// Against the definition, summed the long way.
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
