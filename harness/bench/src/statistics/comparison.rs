//! Tests whether a candidate is slower or faster than a baseline on a machine with other load.
//!
//! A round consists of three runs in random order: baseline, baseline again, candidate. If baseline and candidate are
//! the same program, the three times are exchangeable within a round whatever the machine was doing. A permutation test
//! within rounds therefore gives the exact probability of a false alarm without any assumption about the noise. The
//! noise floor is the difference between the two baseline runs of the same rounds.

use super::random::Random;
use super::trimmed_mean::trimmed_mean;

/// Minimum number of rounds: fewer cannot reach a small significance level.
pub const ROUNDS_MIN: usize = 8;

/// Permutations drawn per test: enough to resolve probabilities of 0.001.
const DRAWS: usize = 20_000;

/// Scales the difference of two baseline runs to the variance of candidate minus the mean of two baselines:
/// sqrt((1 + 1/2) / 2).
const SCALE: f64 = 0.866_025_403_784_438_6;

/// The 90 % quantile of the standard normal distribution.
const POWER_90: f64 = 1.2816;

/// Logarithms of one round's times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// Baseline.
    pub a: f64,
    /// Baseline, second run.
    pub a_again: f64,
    /// Candidate.
    pub b: f64,
}

/// The result of a comparison. Effects are ratios of times minus one: 0.05 is five percent slower.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Candidate relative to baseline.
    pub effect: f64,
    /// Probability of an effect at least as large if the programs were equally fast.
    pub p: f64,
    /// Noise floor: the effect between the two baseline runs at significance level `alpha`.
    pub floor: f64,
    /// Minimum detectable effect: one this large is detected with a probability of 90 %.
    pub visible: f64,
    /// Lower end of the effect's 99 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Compares the candidate with the baseline at significance level `alpha`; reproducible for a given seed.
pub fn compare(rounds: &[Round], alpha: f64, seed: u64) -> Comparison {
    let mut random = Random(seed);
    let against = |b: f64, a: f64, c: f64| b - (a + c) / 2.0;
    let differences: Vec<f64> = rounds.iter().map(|r| against(r.b, r.a, r.a_again)).collect();
    let effect = trimmed_mean(&differences);
    let permuted = |random: &mut Random| {
        let drawn = rounds.iter().map(|r| match random.below(3) {
            0 => against(r.b, r.a, r.a_again),
            1 => against(r.a, r.b, r.a_again),
            _ => against(r.a_again, r.a, r.b),
        });
        trimmed_mean(&drawn.collect::<Vec<_>>()).abs()
    };
    let as_large = (0..DRAWS).filter(|_| permuted(&mut random) >= effect.abs()).count();
    let baseline_only: Vec<f64> = rounds.iter().map(|r| (r.a_again - r.a) * SCALE).collect();
    let mut null = drawn(DRAWS, || {
        let flipped = baseline_only.iter().map(|d| if random.below(2) == 0 { *d } else { -d });
        trimmed_mean(&flipped.collect::<Vec<_>>()).abs()
    });
    null.sort_by(f64::total_cmp);
    let resampled = |random: &mut Random| {
        let of = differences.len();
        trimmed_mean(&(0..of).map(|_| differences[random.below(of)]).collect::<Vec<_>>())
    };
    let mut spread = drawn(DRAWS / 4, || resampled(&mut random));
    spread.sort_by(f64::total_cmp);
    let floor = quantile(&null, 1.0 - alpha);
    let ratio = |logarithm: f64| logarithm.exp_m1();
    Comparison {
        effect: ratio(effect),
        p: (1 + as_large) as f64 / (1 + DRAWS) as f64,
        floor: ratio(floor),
        visible: ratio(floor + POWER_90 * deviation(&spread)),
        low: ratio(quantile(&spread, 0.005)),
        high: ratio(quantile(&spread, 0.995)),
    }
}

fn drawn(count: usize, mut draw: impl FnMut() -> f64) -> Vec<f64> {
    (0..count).map(|_| draw()).collect()
}

/// Returns a quantile of values in ascending order.
fn quantile(sorted: &[f64], fraction: f64) -> f64 {
    let index = (fraction * sorted.len() as f64) as usize;
    sorted[index.min(sorted.len() - 1)]
}

/// Returns the standard deviation.
fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (squares / values.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounds on a machine with 2 % noise, a burst that doubles the time of one run in 25, and a drift.
    fn rounds(count: usize, slower: f64, seed: u64) -> Vec<Round> {
        let mut random = Random(seed);
        let mut time = |round: usize, factor: f64| {
            let uniform = |random: &mut Random| random.below(1 << 20) as f64 / f64::from(1 << 20);
            let noise = (0..4).map(|_| uniform(&mut random)).sum::<f64>() - 2.0;
            let burst = if random.below(25) == 0 { 2.0 } else { 1.0 };
            (factor * burst * (1.0 + 0.035 * noise + 0.01 * round as f64)).ln()
        };
        (0..count)
            .map(|i| Round { a: time(i, 1.0), a_again: time(i, 1.0), b: time(i, slower) })
            .collect()
    }

    #[test]
    fn false_alarms_are_as_frequent_as_the_p_value_states() {
        let found: Vec<f64> = (0..100).map(|s| compare(&rounds(20, 1.0, s), 0.01, s).p).collect();
        let below = |p: f64| found.iter().filter(|&&found| found < p).count();
        assert!((1..=14).contains(&below(0.05)), "{}", below(0.05));
        assert!(below(0.001) <= 1);
    }

    #[test]
    fn effects_above_the_detection_limit_are_detected() {
        let detected = (0..40).filter(|&s| {
            let found = compare(&rounds(30, 1.10, s), 0.001, s);
            found.p < 0.01 && found.effect > 0.0 && (found.low..found.high).contains(&0.10)
        });
        assert!(detected.count() >= 36);
        let found = compare(&rounds(30, 1.0, 5), 0.001, 5);
        assert!(found.visible < 0.10 && found.visible > found.floor, "{found:?}");
    }

    #[test]
    fn a_faster_candidate_has_a_negative_effect() {
        assert!(compare(&rounds(30, 0.8, 1), 0.001, 1).effect < -0.15);
    }

    #[test]
    fn the_same_seed_gives_the_same_result() {
        let rounds = rounds(10, 1.02, 3);
        assert_eq!(compare(&rounds, 0.001, 9), compare(&rounds, 0.001, 9));
    }
}
