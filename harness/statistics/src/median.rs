//! Medians with confidence intervals that assume no distribution.
//!
//! The interval lies between two order statistics. The true median lies below the k-th smallest of n independent values with
//! the probability that a fair coin shows heads fewer than k times in n throws (Le Boudec, "Performance Evaluation",
//! theorem 2.1; Hoefler and Belli, SC15, rule 5).

/// Desired coverage of the interval.
const COVERAGE: f64 = 0.95;

/// A median with its confidence interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Median {
    /// Middle value, or the mean of the two middle values.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Probability that the interval contains the true median: at least 95 % for six values or more. For fewer values
    /// the interval is their whole range, and its coverage is less.
    pub coverage: f64,
    /// Number of values.
    pub count: usize,
}

impl Median {
    /// Returns the coverage in per cent, rounded down.
    pub fn per_cent(&self) -> f64 {
        (100.0 * self.coverage).floor()
    }

    /// Returns the median of a quantity that falls as this one rises.
    pub fn falling(self, of: impl Fn(f64) -> f64) -> Self {
        Self { value: of(self.value), low: of(self.high), high: of(self.low), ..self }
    }
}

/// Returns the median with its interval, or `None` for no values.
pub fn median(values: &[f64]) -> Option<Median> {
    let sorted = sorted(values.iter().copied());
    let n = sorted.len();
    let last = n.checked_sub(1)?;
    // The narrowest interval with the desired coverage; the whole range if none has it.
    let cut = (0..n.div_ceil(2)).rev().find(|&k| coverage(n, k) >= COVERAGE).unwrap_or(0);
    let (low, high) = (sorted[cut], sorted[last - cut]);
    Some(Median { value: middle(&sorted), low, high, coverage: coverage(n, cut), count: n })
}

/// Returns the median of a non-empty slice.
pub fn median_of(values: &[f64]) -> f64 {
    middle(&sorted(values.iter().copied()))
}

/// Returns values in ascending order.
pub(super) fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

/// Returns the median of values in ascending order.
fn middle(sorted: &[f64]) -> f64 {
    let n = sorted.len();
    (sorted[(n - 1) / 2] + sorted[n / 2]) * 0.5
}

/// Returns the probability that the true median lies between the order statistics `cut` places from either end.
fn coverage(n: usize, cut: usize) -> f64 {
    // By its logarithm: of more than a thousand values, the first term is smaller than any number.
    let (mut log2, mut below) = (-(n as f64), 0.0);
    for k in 0..=cut {
        below += log2.exp2();
        log2 += ((n - k) as f64 / (k + 1) as f64).log2();
    }
    (1.0 - 2.0 * below).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_match_the_published_table() {
        // Le Boudec, table A.1: the 95 % interval's order statistics, from 1.
        for (n, low, high, covers) in [
            (6, 1, 6, 0.969),
            (8, 1, 8, 0.992),
            (9, 2, 8, 0.961),
            (15, 4, 12, 0.965),
            (31, 10, 22, 0.971),
        ] {
            let values: Vec<f64> = (1..=n).map(f64::from).collect();
            let m = median(&values).unwrap();
            assert_eq!((m.low, m.high), (f64::from(low), f64::from(high)), "n = {n}");
            assert!((m.coverage - covers).abs() < 1e-3, "n = {n}: {}", m.coverage);
        }
    }

    #[test]
    fn few_values_give_their_range_and_its_low_coverage() {
        let m = median(&[3.0, 1.0, 2.0]).unwrap();
        assert_eq!((m.value, m.low, m.high, m.coverage, m.count), (2.0, 1.0, 3.0, 0.75, 3));
        let one = median(&[5.0]).unwrap();
        assert_eq!((one.low, one.high, one.coverage), (5.0, 5.0, 0.0));
        assert_eq!(median(&[4.0, 2.0]).unwrap().value, 3.0);
        assert!(median(&[]).is_none());
        assert_eq!((median_of(&[3.0, 1.0, 2.0]), median_of(&[4.0, 1.0, 2.0, 3.0])), (2.0, 2.5));
    }

    #[test]
    fn the_interval_of_many_values_has_a_width() {
        for n in [1000, 1074, 1075, 3000] {
            let values: Vec<f64> = (1..=n).map(f64::from).collect();
            let m = median(&values).unwrap();
            // Of the normal distribution with the standard deviation sqrt(n) / 2.
            let off = (m.high - m.low) / f64::from(n).sqrt() / 1.96;
            assert!((off - 1.0).abs() < 0.05 && (0.95..0.96).contains(&m.coverage), "{n}: {m:?}");
        }
    }

    #[test]
    fn the_interval_contains_the_median_as_often_as_stated() {
        // Uniform values from a fixed generator; the true median is one half.
        let mut state = 1u64;
        let mut draw = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let rounds = 4000;
        let holds = |m: Median| m.low <= 0.5 && 0.5 <= m.high;
        let hits = (0..rounds).filter(|_| {
            let values: Vec<f64> = (0..9).map(|_| draw()).collect();
            holds(median(&values).unwrap())
        });
        let fraction = hits.count() as f64 / f64::from(rounds);
        assert!((fraction - 0.961).abs() < 0.015, "{fraction}");
    }
}
