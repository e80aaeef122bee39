//! Steps of a series that may have trends, autocorrelated noise and outliers.
//!
//! The model has segments with constant or linear means, and first-order autoregressive noise. Of all numbers
//! of boundaries, kinds of means and autocorrelations, the one with the least penalised likelihood is selected (Davis, Lee and
//! Rodriguez-Yam, 2006), so that a drift is one line rather than many steps, and a slow random fluctuation is noise. The
//! p-value of a step is that of the likelihood ratio without its boundary, times the number of values at which it
//! could have been (Bonferroni). A boundary at which the slope changes but the value does not is no step.
//!
//! Outliers are moved towards the median of nine values first, so that one or two other values among noisy ones, or at their end, are rarely
//! a step (at most 2 %). Three or four often are one, the more values there are: 20 % more at the end, with noise of 1 %, in 5 and 51 % of
//! histories of 15 older values, and in 34 and 76 % of 50. Five are a level. Of a counter that mostly repeats exactly, two values are one,
//! unless values have returned to earlier ones at least four times, of less than 20 values three times: then it is noisy.
//!
//! The penalties were chosen by simulation, so that series without steps rarely get any: `tests/change_points.rs` bounds the rates of false
//! alarms by 1 % on independent noise, with 5 % outliers too (0 to 0.8 % of 1,000 series of 20 to 200 values), and by 5 % on
//! autocorrelated noise and on drifts.

use super::median::{median_of, sorted};
use super::segments::{Fit, Mean, Series};
use serde::Serialize;
use std::f64::consts::SQRT_2;

/// A step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Index of the first value after it.
    pub at: usize,
    /// Median of the values since the previous step; in a drift, what its line has at the step.
    pub before: f64,
    /// The same of the values up to the next step.
    pub after: f64,
    /// The p-value.
    pub p: f64,
}

/// Smaller steps are ignored, also of exact counters; a fraction of the median of all values.
const EFFECT_MIN: f64 = 0.001;

/// Number of values that are a level also where there is noise, and no excursion.
pub const LEVEL_MIN: usize = 5;

/// Minimum number of values: two on either side of a step, and one more to measure the noise.
pub const VALUES_MIN: usize = 5;

/// Values of the autocorrelation that are tried.
const PHIS: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.75, 0.9];

/// Greatest number of segments.
const SEGMENTS_MAX: usize = 16;

/// Penalties of a boundary, a slope and an autocorrelation, in units of the logarithm of the number of values.
const PENALTY_BOUNDARY: f64 = 2.5;
const PENALTY_SLOPE: f64 = 1.5;
const PENALTY_PHI: f64 = 2.0;

/// Least advantage of a model with boundaries over all models without one. In a short series, autocorrelated noise looks
/// like a step: there the advantage must be larger, [`ADVANTAGE_OF_ONE`] over the number of values.
const ADVANTAGE_MAX: f64 = 9.0;

/// Advantage that a series of one value would need.
const ADVANTAGE_OF_ONE: f64 = 300.0;

/// Factor on a p-value, because the model was chosen among several to fit the data: by simulation.
const MODELS_TRIED: f64 = 10.0;

/// Least step between two segments with slopes, in standard deviations of the noise.
const STEP_MIN: f64 = 1.5;

/// No p-value is smaller: noise is normal only near its middle.
const P_MIN: f64 = 1e-9;

/// Returns the steps of a series in ascending order. `alpha` is the greatest probability of a step in a series without one.
pub fn change_points(values: &[f64], alpha: f64) -> Vec<Change> {
    let largest = |of: &[f64]| of.iter().map(|value| value.abs()).fold(0.0, f64::max);
    let all = largest(values);
    if values.len() < VALUES_MIN || all == 0.0 || !all.is_finite() {
        return Vec::new();
    }
    let middle = median_of(values);
    let scaled: Vec<f64> = values.iter().map(|value| (value - middle) / all).collect();
    let (clean, noise) = without_outliers(&scaled);
    // Beside an outlier like 2^64, all steps are small.
    let kept = largest(&clean).max(middle.abs() / all);
    let (size, clean) = (all * kept, clean.iter().map(|value| value / kept).collect::<Vec<_>>());
    let least = EFFECT_MIN * middle.abs() / size;
    // The variance below which noise is not distinguished from none.
    let mut model = Model::select(&clean, (least / 4.0).max(1e-9).max(noise / kept).powi(2));
    let p_values = model.steps(least, alpha);
    let (edges, fits) = (model.edges(), model.fits(&Series::new(&clean, model.phi)));
    let is_level = model.mean == Mean::Constant;
    // The medians of what falls before and after a rise may fall as well.
    let level = |segment: usize, at: usize| {
        let part = &values[edges[segment]..edges[segment + 1]];
        let fitted = middle + size * fits[segment].at(at as f64 - 0.5);
        let sorted = sorted(part.iter().copied());
        if is_level { median_of(part) } else { fitted.clamp(sorted[0], sorted[sorted.len() - 1]) }
    };
    let step = |(before, p): (usize, f64)| {
        let (at, after) = (edges[before + 1], before + 1);
        Change { at, before: level(before, at), after: level(after, at), p }
    };
    p_values.into_iter().enumerate().map(step).collect()
}

/// A model of values without outliers.
struct Model<'a> {
    values: &'a [f64],
    /// A variance that is added to that of the noise, so that numbers that repeat exactly do not have an infinite likelihood.
    floor: f64,
    /// Autocorrelation of the noise.
    phi: f64,
    /// The mean of every segment.
    mean: Mean,
    /// First indices of all segments but the first, in ascending order.
    boundaries: Vec<usize>,
}

impl<'a> Model<'a> {
    /// Selects the model of at least four values.
    fn select(values: &'a [f64], floor: f64) -> Self {
        // Steps of exact counters may be two values apart, also in short series.
        let count_max = (values.len() / 2).clamp(2, SEGMENTS_MAX) - 1;
        let mut models: Vec<(f64, Self)> = Vec::new();
        for (phi, mean) in PHIS.iter().flat_map(|&p| [(p, Mean::Constant), (p, Mean::Linear)]) {
            let series = Series::new(values, phi);
            let found = series.boundaries(mean, count_max);
            models.extend((0..=found.len()).map(|count| {
                let mut boundaries = found[..count].to_vec();
                boundaries.sort_unstable();
                let model = Self { values, floor, phi, mean, boundaries };
                (model.criterion(&series), model)
            }));
        }
        let (divided, whole): (Vec<_>, Vec<_>) =
            models.into_iter().partition(|(_, model)| !model.boundaries.is_empty());
        let best = |of: Vec<(f64, Self)>| of.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let whole = best(whole).expect("no boundary is always tried");
        let advantage = (ADVANTAGE_OF_ONE / values.len() as f64).min(ADVANTAGE_MAX);
        best(divided).filter(|(least, _)| least + advantage < whole.0).unwrap_or(whole).1
    }

    /// Returns twice the negative logarithm of the likelihood, plus penalties that grow where there are few values per parameter;
    /// infinite if there are not enough values.
    fn criterion(&self, series: &Series) -> f64 {
        let (n, [boundaries, segments, slopes, autocorrelated]) =
            (self.values.len() as f64, self.parameters());
        let freedom = self.freedom();
        if freedom < 1.0 {
            return f64::INFINITY;
        }
        let penalty =
            PENALTY_BOUNDARY * boundaries + PENALTY_SLOPE * slopes + PENALTY_PHI * autocorrelated;
        n * self.variance(series).ln() - segments * (1.0 - self.phi.powi(2)).ln()
            + penalty * n.ln() * n / freedom
    }

    /// Returns the numbers of boundaries, levels, slopes and autocorrelations.
    fn parameters(&self) -> [f64; 4] {
        let boundaries = self.boundaries.len() as f64;
        let segments = boundaries + 1.0;
        let slopes = if self.mean == Mean::Linear { segments } else { 0.0 };
        [boundaries, segments, slopes, f64::from(self.phi > 0.0)]
    }

    /// Returns the number of values beyond those that determine the parameters and the variance.
    fn freedom(&self) -> f64 {
        self.values.len() as f64 - self.parameters().iter().sum::<f64>() - 1.0
    }

    /// Returns the variance of the noise, and its floor.
    fn variance(&self, series: &Series) -> f64 {
        let cost: f64 = self.fits(series).iter().map(|fit| fit.cost).sum();
        cost / self.values.len() as f64 + self.floor
    }

    /// Returns the first index of every segment and the index after the last value.
    fn edges(&self) -> Vec<usize> {
        [&[0], &self.boundaries[..], &[self.values.len()]].concat()
    }

    fn fits(&self, series: &Series) -> Vec<Fit> {
        self.edges().windows(2).map(|w| series.fit(w[0], w[1], self.mean)).collect()
    }

    /// Removes the boundaries that are no steps, and returns the p-values of the others.
    fn steps(&mut self, least: f64, alpha: f64) -> Vec<f64> {
        let (series, n) = (Series::new(self.values, self.phi), self.values.len() as f64);
        loop {
            let (ends, fits, variance) = (self.edges(), self.fits(&series), self.variance(&series));
            let least = match self.mean {
                Mean::Constant => least,
                Mean::Linear => least.max(STEP_MIN * variance.sqrt()),
            };
            let p_value = |i: usize| {
                let middle = ends[i + 1] as f64 - 0.5;
                let is_small = (fits[i + 1].at(middle) - fits[i].at(middle)).abs() <= least;
                let one = series.fit(ends[i], ends[i + 2], self.mean).cost;
                let more = (one - fits[i].cost - fits[i + 1].cost).max(0.0);
                let ratio = (variance + more / n) / variance;
                // exp(-x / 2) is the tail of the chi-squared distribution with two degrees of freedom, and above that with one. So this
                // is an upper bound of the probability of the likelihood ratio without the boundary.
                let p = (MODELS_TRIED * ratio.powf(-self.freedom() / 2.0)).clamp(P_MIN, 1.0);
                if is_small { 1.0 } else { (p * n).min(1.0) }
            };
            let p_values: Vec<f64> = (0..self.boundaries.len()).map(p_value).collect();
            match (0..p_values.len()).max_by(|&a, &b| p_values[a].total_cmp(&p_values[b])) {
                Some(worst) if p_values[worst] > alpha => _ = self.boundaries.remove(worst),
                _ => return p_values,
            }
        }
    }
}

/// Greatest distance of a value from the median of its neighbourhood, in standard deviations of the noise.
const OUTLIER: f64 = 2.0;

/// Number of values in a neighbourhood.
const NEIGHBOURHOOD: usize = 9;

/// Moves outliers towards the median of their neighbourhood, to the greatest distance that other values have. In series of
/// which most values equal their predecessor, one that occurs once becomes its predecessor, unless only others follow. If values
/// return to earlier ones again and again, that is noise: returns the standard deviation of what remains of it, too, or 0.
fn without_outliers(values: &[f64]) -> (Vec<f64>, f64) {
    let (n, width) = (values.len(), NEIGHBOURHOOD.min(values.len()));
    let differences: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    // The median of |x - y| of two normal values, in standard deviations.
    let typical = median_of(&differences) / (0.6745 * SQRT_2);
    let middle = |i: usize| {
        let from = i.saturating_sub(width / 2).min(n - width);
        median_of(&values[from..from + width])
    };
    let middles: Vec<f64> = (0..n).map(middle).collect();
    let deviation = |of: &[f64]| {
        (of.iter().zip(&middles).map(|(x, m)| (x - m).powi(2)).sum::<f64>() / n as f64).sqrt()
    };
    let returns = |&i: &usize| values[i] != values[i - 1] && values[..i - 1].contains(&values[i]);
    let most = if n < 20 { 2 } else { 3 };
    let is_noisy = typical == 0.0 && (2..n).filter(returns).nth(most).is_some();
    let limit = OUTLIER * if is_noisy { deviation(values) } else { typical };
    if limit == 0.0 {
        let mut clean = values.to_vec();
        // The first level is that of the first value that is repeated.
        let first = differences.iter().take(LEVEL_MIN).position(|by| *by == 0.0).unwrap_or(0);
        clean[..first].fill(values[first]);
        // One other value is no level if the old one returns, another one begins, or too few follow.
        for i in 1..n {
            let (level, follow) = (clean[i - 1], &values[i + 1..n.min(i + LEVEL_MIN)]);
            let is_repeated = follow.len() > 1 && follow[0] == follow[1];
            let is_new = follow.contains(&values[i]) || follow.len() == LEVEL_MIN - 1;
            let is_too_new = !is_new && i > 1 && clean[i - 2] == level;
            let is_none = follow.contains(&level) || is_repeated || is_too_new;
            if is_none && follow.first() != Some(&values[i]) {
                clean[i] = level;
            }
        }
        return (clean, 0.0);
    }
    let moved = |(x, m): (&f64, &f64)| x.clamp(m - limit, m + limit);
    let clean: Vec<f64> = values.iter().zip(&middles).map(moved).collect();
    let noise = if is_noisy { deviation(&clean) } else { 0.0 };
    (clean, noise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_is_moved_and_a_step_is_not() {
        let mut values: Vec<f64> = (0..20).map(|i| f64::from(i * 7 % 5)).collect();
        values[15..].iter_mut().for_each(|value| *value += 1000.0);
        let clean = |values: &[f64]| without_outliers(values).0;
        assert_eq!(clean(&values), values);
        values[7] = 500.0;
        let moved = clean(&values);
        assert!(moved[7] < 30.0 && moved[8..] == values[8..], "{moved:?}");
        let exact = [7.0, 7.0, 7.0, 9.0, 7.0, 7.0];
        assert_eq!(clean(&exact), [7.0; 6]);
        let levels = [7.0, 7.0, 7.0, 7.0, 9.0, 9.0, 9.0];
        assert_eq!(clean(&levels), levels);
    }

    #[test]
    fn one_other_value_of_an_exact_series_is_no_step_and_five_are_one() {
        for n in [10, 40, 50, 100] {
            let changed = |from: usize, to: usize| -> Vec<(usize, f64, f64)> {
                let value = |i| if (from..to).contains(&i) { 1500.0 } else { 1374.0 };
                let steps = change_points(&(0..n).map(value).collect::<Vec<_>>(), 0.01);
                steps.into_iter().map(|step| (step.at, step.before, step.after)).collect()
            };
            for at in [n / 2, n - 1] {
                assert_eq!(changed(at, at + 1), [], "{at} of {n}");
            }
            assert_eq!(changed(n - 5, n), [(n - 5, 1374.0, 1500.0)], "{n}");
        }
    }

    #[test]
    fn a_line_is_not_a_staircase() {
        let values: Vec<f64> = (0..40).map(|i| f64::from(i) + f64::from(i * 7 % 5)).collect();
        let model = Model::select(&values, 1e-9);
        assert_eq!((model.mean, model.boundaries.len()), (Mean::Linear, 0));
    }
}
