//! Whether a candidate's times differ from a baseline's, on a machine that others use too.
//!
//! A round holds three times: baseline, baseline again, candidate, measured one after the other in random
//! order. If the candidate is no other program than the baseline, the three are exchangeable within
//! their round, whatever the machine was doing then; so the chance of a false alarm is what it is said to
//! be, by counting (a permutation test), without any assumption on how noise is distributed. The
//! machine's own noise is the baseline against itself, from the same rounds.

/// Fewer rounds cannot give a verdict at a small chance of a false alarm.
pub const ROUNDS_LEAST: usize = 8;

/// Draws of each test: a chance of one in ten thousand can just be told from one in a thousand.
const DRAWS: usize = 20_000;

/// Share of the rounds that is cut off at either end before averaging: a burst of somebody else's work
/// falls on some rounds only.
const TRIM: f64 = 0.25;

/// The baseline against itself varies like the difference of two runs, the candidate against the mean of two
/// baselines like less: the square root of (1 + 1/2) / 2.
const SCALE: f64 = 0.866_025_403_784_438_6;

/// Nine times out of ten, for a normal distribution's upper tail.
const POWER_90: f64 = 1.2816;

/// Logarithms of one round's times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// Baseline.
    pub a: f64,
    /// Baseline again.
    pub a_again: f64,
    /// Candidate.
    pub b: f64,
}

/// What rounds say. Effects are ratios of times less one: 0.05 is five percent slower.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Candidate against baseline.
    pub effect: f64,
    /// Chance of an effect at least as large if there were none.
    pub p: f64,
    /// What the baseline against itself reaches with the chance of a false alarm.
    pub floor: f64,
    /// The smallest effect that would be seen nine times out of ten.
    pub visible: f64,
    /// Lower end of the effect's 99 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Compares. The seed makes the draws repeat.
pub fn compare(rounds: &[Round], alpha: f64, seed: u64) -> Comparison {
    let mut random = Random(seed);
    let against = |b: f64, a: f64, c: f64| b - (a + c) / 2.0;
    let differences: Vec<f64> = rounds.iter().map(|r| against(r.b, r.a, r.a_again)).collect();
    let effect = middle(&differences);
    let permuted = |random: &mut Random| {
        let drawn = rounds.iter().map(|r| match random.below(3) {
            0 => against(r.b, r.a, r.a_again),
            1 => against(r.a, r.b, r.a_again),
            _ => against(r.a_again, r.a, r.b),
        });
        middle(&drawn.collect::<Vec<_>>()).abs()
    };
    let as_large = (0..DRAWS).filter(|_| permuted(&mut random) >= effect.abs()).count();
    let itself: Vec<f64> = rounds.iter().map(|r| (r.a_again - r.a) * SCALE).collect();
    let mut null = drawn(DRAWS, || {
        let flipped = itself.iter().map(|d| if random.below(2) == 0 { *d } else { -d });
        middle(&flipped.collect::<Vec<_>>()).abs()
    });
    null.sort_by(f64::total_cmp);
    let resampled = |random: &mut Random| {
        let of = differences.len();
        middle(&(0..of).map(|_| differences[random.below(of)]).collect::<Vec<_>>())
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

/// The mean of what is left when the ends are cut off.
pub fn middle(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = (sorted.len() as f64 * TRIM) as usize;
    let kept = &sorted[cut..sorted.len() - cut];
    kept.iter().sum::<f64>() / kept.len().max(1) as f64
}

/// Of sorted values.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = (share * sorted.len() as f64) as usize;
    sorted[at.min(sorted.len() - 1)]
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (squares / values.len() as f64).sqrt()
}

/// SplitMix64: small, and the same on every machine.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ x >> 31
    }

    /// A number below `end`, which is small: the bias is below one in 2^50.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    /// Puts things into random order.
    pub fn shuffle<T>(&mut self, things: &mut [T]) {
        for i in (1..things.len()).rev() {
            things.swap(i, self.below(i + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine with 2 % noise, a burst that doubles the time of one run in 25, and a drift.
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
    fn the_chance_of_a_false_alarm_is_what_it_is_said_to_be() {
        let found: Vec<f64> = (0..100).map(|s| compare(&rounds(20, 1.0, s), 0.01, s).p).collect();
        let below = |p: f64| found.iter().filter(|&&found| found < p).count();
        assert!((1..=14).contains(&below(0.05)), "{}", below(0.05));
        assert!(below(0.001) <= 1);
    }

    #[test]
    fn what_is_said_to_be_visible_is_seen() {
        let seen = (0..40).filter(|&s| {
            let found = compare(&rounds(30, 1.10, s), 0.001, s);
            found.p < 0.01 && found.effect > 0.0 && (found.low..found.high).contains(&0.10)
        });
        assert!(seen.count() >= 36);
        let found = compare(&rounds(30, 1.0, 5), 0.001, 5);
        assert!(found.visible < 0.10 && found.visible > found.floor, "{found:?}");
    }

    #[test]
    fn faster_is_less_than_nothing() {
        assert!(compare(&rounds(30, 0.8, 1), 0.001, 1).effect < -0.15);
    }

    #[test]
    fn the_same_seed_gives_the_same_answer() {
        let rounds = rounds(10, 1.02, 3);
        assert_eq!(compare(&rounds, 0.001, 9), compare(&rounds, 0.001, 9));
    }

    #[test]
    fn ends_are_cut_off() {
        assert_eq!(middle(&[1.0, 2.0, 3.0, 1000.0]), 2.5);
        assert_eq!(middle(&[7.0]), 7.0);
    }
}
