//! P-values by permutation: how often a statistic is as large as observed if the residuals are in random order.

use super::random::Random;

/// Number of operations on segments for one test; the number of permutations is reduced to fit.
const WORK_MAX: usize = 20_000_000;

/// Least number of permutations.
const PERMUTATIONS_MIN: usize = 199;

/// Number of exceedances after which a p-value is known well enough.
const EXCEEDANCES_MAX: usize = 50;

/// Number of permutations after which a p-value is known well enough if it is below [`P_CLEAR`].
const EARLY: usize = 99;

/// A p-value this small decides every test, whatever more permutations would add. A statistic that follows the tail is so
/// extreme by chance, with the uncertainty of a tail of 9 gains, with a probability of 1e-4.
const P_CLEAR: f64 = 1e-6;

/// Smallest p-value: no extrapolation is better than this.
const P_MIN: f64 = 1e-9;

/// Fraction of the gains to which the tail is fitted.
const TAIL: f64 = 0.1;

/// Permutations that are drawn from a seed.
pub struct Permutations {
    random: Random,
    count_max: usize,
}

impl Permutations {
    /// Prepares tests of at most `count_max` permutations each.
    pub fn new(seed: u64, count_max: usize) -> Self {
        Self { random: Random(seed), count_max }
    }

    /// Returns the fraction of random orders of the residuals for which `draw` is at least `observed`, counting the
    /// observed order. Sampling ends early when that fraction is clearly large (Besag and Clifford, 1991) or clearly small. If no
    /// order reaches the observed one, the fraction is extrapolated: the logarithm of a gain, like that of a likelihood ratio,
    /// has an exponential tail. `work` is the number of operations of one `draw`.
    pub fn p_value(
        &mut self,
        observed: f64,
        mut residuals: Vec<f64>,
        work: usize,
        draw: impl Fn(&[f64]) -> f64,
    ) -> f64 {
        let permutations = (WORK_MAX / work.max(1)).max(PERMUTATIONS_MIN).min(self.count_max);
        // Sums in a different order differ in their last bits.
        let enough = observed * (1.0 - 1e-9);
        let mut gains = Vec::with_capacity(permutations);
        let mut as_clear = 1;
        for drawn in 1..=permutations {
            self.random.shuffle(&mut residuals);
            gains.push(draw(&residuals));
            as_clear += usize::from(gains[drawn - 1] >= enough);
            if as_clear > EXCEEDANCES_MAX {
                return as_clear as f64 / (drawn + 1) as f64;
            }
            if drawn == EARLY && as_clear == 1 {
                let p = tail(&mut gains, observed);
                if p < P_CLEAR {
                    return p;
                }
            }
        }
        let counted = as_clear as f64 / (permutations + 1) as f64;
        if as_clear > 1 { counted } else { counted.min(tail(&mut gains, observed)) }
    }
}

/// Returns the probability of a gain of at least `observed`, from an exponential distribution fitted to the logarithms of
/// the largest gains.
fn tail(gains: &mut [f64], observed: f64) -> f64 {
    gains.sort_by(f64::total_cmp);
    let largest = &gains[gains.len() - ((gains.len() as f64 * TAIL) as usize).max(1)..];
    let start = largest[0].max(1.0).ln();
    let excess = largest.iter().map(|gain| gain.max(1.0).ln() - start).sum::<f64>();
    let mean = (excess / largest.len() as f64).max(1e-9);
    (TAIL * (-(observed.ln() - start) / mean).exp()).max(P_MIN)
}
