//! Selection of a model of a series: how many segments, constant or linear means, and how autocorrelated the noise is.
//!
//! The selected model minimises a penalised likelihood (Davis, Lee and Rodriguez-Yam, 2006, without their pruned search). A
//! drift is then one line rather than many steps, and a slow random fluctuation is noise rather than steps. The penalties
//! were chosen by simulation, so that series without steps rarely get any; see the tests of `change_points`.

use super::candidates::{PLACES_MAX, places};
use super::median::median_of;
use super::segments::{Mean, Series};

/// Values of the autocorrelation that are tried.
const PHIS: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.75, 0.9];

/// Greatest number of segments.
const SEGMENTS_MAX: usize = 16;

/// Numbers of segments in sequence that are no improvement, after which larger ones are not tried.
const PATIENCE: usize = 4;

/// Penalty of a boundary, in units of the logarithm of the number of values.
const PENALTY_BOUNDARY: f64 = 2.5;

/// Penalty of a slope, in the same unit.
const PENALTY_SLOPE: f64 = 1.5;

/// Penalty of an autocorrelation, in the same unit.
const PENALTY_PHI: f64 = 2.0;

/// Least advantage of a model with boundaries over all models without one. In a short series, autocorrelated noise looks
/// like a step: there the advantage must be larger, [`ADVANTAGE_OF_ONE`] over the number of values.
const ADVANTAGE_MAX: f64 = 9.0;

/// Advantage that a series of one value would need.
const ADVANTAGE_OF_ONE: f64 = 300.0;

/// A model.
#[derive(Clone, Debug)]
pub struct Model {
    /// Autocorrelation of the noise.
    pub phi: f64,
    /// The mean of every segment.
    pub mean: Mean,
    /// First indices of all segments but the first.
    pub boundaries: Vec<usize>,
}

impl Model {
    /// Returns the first index of every segment and the index after the last value.
    pub fn edges(&self, count: usize) -> Vec<usize> {
        std::iter::once(0).chain(self.boundaries.iter().copied()).chain([count]).collect()
    }
}

/// Selects the model of at least four values without outliers. `floor` is a variance that is added to that of the noise,
/// so that numbers that repeat exactly do not have an infinite likelihood.
pub fn select(values: &[f64], floor: f64) -> Model {
    let count_max = (values.len() / 5).clamp(2, SEGMENTS_MAX);
    let constant = Model { phi: 0.0, mean: Mean::Constant, boundaries: Vec::new() };
    let mut whole = (f64::INFINITY, constant.clone());
    let mut divided = (f64::INFINITY, constant);
    let means = [Mean::Constant, Mean::Linear].map(|mean| (mean, places(values, mean)));
    for phi in PHIS {
        let series = Series::new(values, phi);
        for (mean, places) in &means {
            let (mean, mut least, mut worse) = (*mean, f64::INFINITY, 0);
            for (cost, boundaries) in series.divisions(mean, places).take(count_max) {
                let best = if boundaries.is_empty() { &mut whole } else { &mut divided };
                let model = Model { phi, mean, boundaries };
                let criterion = criterion(&model, cost, values.len() as f64, floor);
                worse = if criterion < least { 0 } else { worse + 1 };
                least = least.min(criterion);
                if criterion < best.0 {
                    *best = (criterion, model);
                }
                if worse == PATIENCE {
                    break;
                }
            }
        }
    }
    let advantage = ADVANTAGE_MAX.min(ADVANTAGE_OF_ONE / values.len() as f64);
    if divided.0 + advantage < whole.0 { refined(divided.1, values) } else { whole.1 }
}

/// Moves the boundaries of a model to the best places, if not all were tried.
fn refined(mut model: Model, values: &[f64]) -> Model {
    if values.len() > PLACES_MAX {
        model.boundaries = Series::new(values, model.phi).refined(model.mean, model.boundaries);
    }
    model
}

/// Returns twice the negative logarithm of the likelihood, plus penalties that grow where there are few values per parameter;
/// infinite if there are not enough values.
fn criterion(model: &Model, cost: f64, n: f64, floor: f64) -> f64 {
    let boundaries = model.boundaries.len() as f64;
    let segments = boundaries + 1.0;
    let autocorrelated = f64::from(model.phi > 0.0);
    let slopes = segments * (model.mean.parameters() - 1) as f64;
    let freedom = n - (segments + slopes + boundaries + autocorrelated) - 1.0;
    if freedom < 1.0 || !cost.is_finite() {
        return f64::INFINITY;
    }
    let penalty =
        PENALTY_BOUNDARY * boundaries + PENALTY_SLOPE * slopes + PENALTY_PHI * autocorrelated;
    n * (cost / n + floor).ln() - segments * (1.0 - model.phi.powi(2)).ln()
        + penalty * n.ln() * n / freedom
}

/// Greatest distance of a value from the median of its neighbourhood, in standard deviations of the noise.
const OUTLIER: f64 = 3.5;

/// Number of values in a neighbourhood.
const NEIGHBOURHOOD: usize = 7;

/// Moves outliers towards the median of their neighbourhood, to the greatest distance that other values have. Series of
/// which most values equal their predecessor are returned unchanged.
pub fn without_outliers(values: &[f64]) -> Vec<f64> {
    let (n, width) = (values.len(), NEIGHBOURHOOD.min(values.len()));
    let differences: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    // The median of |x - y| of two normal values, in standard deviations.
    let deviation = median_of(&differences) / (0.6745 * std::f64::consts::SQRT_2);
    let limit = OUTLIER * deviation;
    if limit == 0.0 {
        return values.to_vec();
    }
    let moved = |i: usize| {
        let from = i.saturating_sub(width / 2).min(n - width);
        let near = &values[from..from + width];
        // The median is far from the value only if half of the others are far on the same side.
        let above = near.iter().filter(|other| **other - values[i] > limit).count();
        let below = near.iter().filter(|other| values[i] - **other > limit).count();
        if 2 * above.max(below) < width {
            return values[i];
        }
        let middle = median_of(near);
        values[i].clamp(middle - limit, middle + limit)
    };
    (0..n).map(moved).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_is_moved_and_a_step_is_not() {
        let mut values: Vec<f64> = (0..20).map(|i| f64::from(i * 7 % 5)).collect();
        values[15..].iter_mut().for_each(|value| *value += 1000.0);
        let clean = without_outliers(&values);
        assert_eq!(clean, values);
        values[7] = 500.0;
        let clean = without_outliers(&values);
        assert!(clean[7] < 30.0 && clean[8..] == values[8..], "{clean:?}");
        let exact = [7.0, 7.0, 7.0, 9.0, 7.0, 7.0];
        assert_eq!(without_outliers(&exact), exact);
    }

    #[test]
    fn a_line_is_not_a_staircase() {
        let values: Vec<f64> = (0..40).map(|i| f64::from(i) + f64::from(i * 7 % 5)).collect();
        let model = select(&values, 1e-9);
        assert_eq!((model.mean, model.boundaries.len()), (Mean::Linear, 0));
    }
}
