//! Tests whether a candidate is slower or faster than a baseline on a machine that also runs other processes.
//!
//! A round consists of three runs in random order: baseline, baseline again, candidate. If baseline and candidate are
//! the same program, the three times are exchangeable within a round whatever the machine was doing, because their order
//! is random. A permutation test within rounds therefore has a valid significance level for any noise; `p` is estimated
//! from random permutations. The noise floor is the largest effect that noise alone produces at that level, estimated by
//! random sign changes of the differences between the two baseline runs.

use super::median::sorted;
use super::random::Random;

/// Minimum number of rounds for significance level `alpha`. With n rounds, a quarter of which the trimmed mean ignores at
/// each end, no p-value is below 3^-(n - n/4): relabelling an ignored round does not change the effect. At least 8.
pub fn rounds_min(alpha: f64) -> usize {
    let p_min = |n: &usize| 3f64.powi((n / 4) as i32 - *n as i32);
    let least = (8..).find(|n| p_min(n) < alpha);
    least.expect("p-values decrease without limit, and alpha is positive")
}

/// Sign patterns for the noise floor: enough to resolve probabilities of 0.001. The interval takes a quarter as many
/// bootstrap samples.
const SAMPLES: usize = 20_000;

/// Number of random permutations for `p`, unless many tests at a small level need more.
const PERMUTATIONS: usize = 50_000;

/// Number of permutations with a larger effect after which `p` is known well enough (Besag and Clifford, 1991).
const EXCEEDANCES_MAX: usize = 100;

/// Factor that gives the difference of two baseline runs the variance of the candidate minus the mean of two baselines:
/// sqrt((1 + 1/2) / 2).
const SCALE_BASELINE_DIFFERENCE: f64 = 0.866_025_403_784_438_6;

/// The 95 % quantile of the standard normal distribution: two measurements both find what each finds in 95 of 100 cases in 90.
const NORMAL_QUANTILE_95: f64 = 1.6449;

/// Its 99.5 % quantile: the interval of the second measurement lies beyond 0 if the effect is that many deviations from it.
const NORMAL_QUANTILE_995: f64 = 2.5758;

/// Natural logarithms of the times of one round: baseline, baseline again, candidate.
pub type Round = [f64; 3];

/// The result of a comparison. Effects are ratios of times minus one: 0.05 is five percent slower.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Candidate relative to baseline.
    pub effect: f64,
    /// Probability of an effect at least as large in magnitude if the programs are equally fast.
    pub p: f64,
    /// Noise floor: the effect that noise alone exceeds with probability `alpha`, from the baseline runs.
    pub floor: f64,
    /// Minimum detectable effect: one this large is found among all tests, and confirmed, with a probability of 90 %.
    pub visible: f64,
    /// Lower limit of the 99 % bootstrap percentile interval of the effect.
    pub low: f64,
    /// Upper limit.
    pub high: f64,
}

/// Compares the candidate with the baseline at significance level `alpha`, as one of so many tests; reproducible for a given seed.
pub fn compare(rounds: &[Round], alpha: f64, tests: usize, seed: u64) -> Comparison {
    let mut random = Random(seed);
    let difference = |of: usize, r: &Round| r[of] - (r[(of + 1) % 3] + r[(of + 2) % 3]) / 2.0;
    let differences: Vec<f64> = rounds.iter().map(|r| difference(2, r)).collect();
    let effect = trimmed_mean(differences.iter().copied());
    let mut permuted_effect =
        || trimmed_mean(rounds.iter().map(|r| difference((random.below(3) + 2) % 3, r))).abs();
    let resolving = (2.0 * tests as f64 / alpha) as usize;
    let (mut as_large, mut drawn) = (0, 0);
    while drawn < resolving.max(PERMUTATIONS) && as_large < EXCEEDANCES_MAX {
        as_large += usize::from(permuted_effect() >= effect.abs());
        drawn += 1;
    }
    let permuted = sorted((0..resolving.max(SAMPLES / 4)).map(|_| permuted_effect()));
    let of_baseline = rounds.iter().map(|r| (r[1] - r[0]) * SCALE_BASELINE_DIFFERENCE);
    let of_baseline: Vec<f64> = of_baseline.collect();
    let null_effects = sorted((0..SAMPLES).map(|_| {
        trimmed_mean(of_baseline.iter().map(|d| if random.below(2) == 0 { *d } else { -d })).abs()
    }));
    let bootstrap_effects = sorted((0..SAMPLES / 4).map(|_| {
        trimmed_mean(differences.iter().map(|_| differences[random.below(differences.len())]))
    }));
    let (floor, spread) = (quantile(&null_effects, 1.0 - alpha), deviation(&bootstrap_effects));
    let as_one_of_all = quantile(&permuted, 1.0 - alpha / tests as f64);
    let needed = as_one_of_all.max(NORMAL_QUANTILE_995 * spread);
    // Of logarithms.
    Comparison {
        effect: effect.exp_m1(),
        p: (1 + as_large) as f64 / (1 + drawn) as f64,
        floor: floor.exp_m1(),
        visible: (needed + NORMAL_QUANTILE_95 * spread).exp_m1(),
        low: quantile(&bootstrap_effects, 0.005).exp_m1(),
        high: quantile(&bootstrap_effects, 0.995).exp_m1(),
    }
}

/// Returns a quantile of values in ascending order.
fn quantile(sorted: &[f64], fraction: f64) -> f64 {
    let index = (fraction * sorted.len() as f64) as usize;
    sorted[index.min(sorted.len() - 1)]
}

/// Returns the population standard deviation.
fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

/// Fraction of the values discarded at either end.
const TRIM: f64 = 0.25;

/// Returns the mean of the middle half of the values: robust against the few rounds that other processes disturb.
pub fn trimmed_mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let sorted = sorted(values);
    let cut = (sorted.len() as f64 * TRIM) as usize;
    let kept = &sorted[cut..sorted.len() - cut];
    kept.iter().sum::<f64>() / kept.len().max(1) as f64
}

/// Control of the false discovery rate among many tests (Benjamini and Hochberg, 1995; valid for positively dependent
/// tests too).
///
/// Returns for every p-value the least rate of false discoveries at which its test counts as a discovery, among all tests
/// together. If nothing has changed, the probability of any discovery at rate q is at most q.
pub fn adjusted(p_values: &[f64]) -> Vec<f64> {
    let count = p_values.len() as f64;
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|a, b| p_values[*b].total_cmp(&p_values[*a]));
    let mut adjusted = vec![1.0; p_values.len()];
    let mut least: f64 = 1.0;
    for (i, index) in order.into_iter().enumerate() {
        least = least.min(p_values[index] * count / (count - i as f64));
        adjusted[index] = least;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounds on a machine with 2 % noise, bursts that double the time of one run in 25 on average, and a drift.
    fn rounds(count: usize, slower: f64, seed: u64) -> Vec<Round> {
        let mut random = Random(seed);
        let mut time = |round: usize, factor: f64| {
            let uniform = |random: &mut Random| random.below(1 << 20) as f64 / f64::from(1 << 20);
            let noise = (0..4).map(|_| uniform(&mut random)).sum::<f64>() - 2.0;
            let burst = if random.below(25) == 0 { 2.0 } else { 1.0 };
            (factor * burst * (1.0 + 0.035 * noise + 0.01 * round as f64)).ln()
        };
        (0..count).map(|i| [time(i, 1.0), time(i, 1.0), time(i, slower)]).collect()
    }

    #[test]
    fn false_alarms_are_as_frequent_as_the_p_value_states() {
        let found: Vec<f64> =
            (0..100).map(|s| compare(&rounds(20, 1.0, s), 0.01, 1, s).p).collect();
        let below = |p: f64| found.iter().filter(|&&found| found < p).count();
        assert!((1..=14).contains(&below(0.05)), "{}", below(0.05));
        assert!(below(0.001) <= 1);
    }

    #[test]
    fn effects_above_the_detection_limit_are_detected() {
        let detected = (0..40).filter(|&s| {
            let found = compare(&rounds(30, 1.10, s), 0.001, 1, s);
            found.p < 0.01 && found.effect > 0.0 && (found.low..found.high).contains(&0.10)
        });
        assert!(detected.count() >= 36);
        let found = compare(&rounds(30, 1.0, 5), 0.001, 1, 5);
        assert!(found.visible < 0.10 && found.visible > found.floor, "{found:?}");
    }

    /// In the first measurement among ten tests, at the square root of 0.001, and in the second by its interval.
    #[test]
    fn an_effect_of_the_limit_is_mostly_found_and_confirmed() {
        let (level, tests) = (0.001_f64.sqrt(), 10);
        let limit = |seed| compare(&rounds(60, 1.0, seed), level, tests, seed).visible;
        let effect = (0..8).map(limit).sum::<f64>() / 8.0;
        let with_effect = |seed| compare(&rounds(60, 1.0 + effect, seed), level, tests, seed);
        let is_found = |of: &Comparison| of.p * tests as f64 <= level && of.effect > of.floor;
        let both = |s: &u64| is_found(&with_effect(*s)) && with_effect(1000 + s).low > 0.0;
        let found = (0..40).filter(both).count();
        assert!(found >= 32, "{found} of 40 effects of {effect}");
    }

    #[test]
    fn a_faster_candidate_has_a_negative_effect() {
        assert!(compare(&rounds(30, 0.8, 1), 0.001, 1, 1).effect < -0.15);
    }

    #[test]
    fn the_same_seed_gives_the_same_result() {
        let rounds = rounds(10, 1.02, 3);
        assert_eq!(compare(&rounds, 0.001, 1, 9), compare(&rounds, 0.001, 1, 9));
    }

    #[test]
    fn outliers_at_either_end_are_discarded() {
        assert_eq!(trimmed_mean([1.0, 2.0, 3.0, 1000.0]), 2.5);
        assert_eq!(trimmed_mean([7.0]), 7.0);
    }

    #[test]
    fn the_published_example_has_four_discoveries() {
        // Benjamini and Hochberg (1995), section 3.2: 15 tests at q = 0.05.
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262,
            0.5719, 0.6528, 0.7590, 1.0,
        ];
        let found = adjusted(&p);
        assert_eq!(found.iter().filter(|q| **q <= 0.05).count(), 4);
        assert!(found.windows(2).all(|pair| pair[0] <= pair[1]));
        assert!(adjusted(&[]).is_empty() && adjusted(&[0.3]) == [0.3]);
    }

    #[test]
    fn without_any_effect_a_discovery_is_as_rare_as_the_rate() {
        let mut random = Random(1);
        let mut run = || {
            let p: Vec<f64> =
                (0..20).map(|_| random.below(1 << 20) as f64 / f64::from(1 << 20)).collect();
            adjusted(&p).iter().any(|q| *q <= 0.05)
        };
        let alarms = (0..2000).filter(|_| run()).count();
        assert!((60..=140).contains(&alarms), "{alarms}");
    }
}
