//! Division of a series into segments with a constant or linear mean and autocorrelated noise, by least squares.
//!
//! The noise is a first-order autoregression with a known coefficient `phi`; 0 is independent noise. Each segment is
//! whitened by itself (Prais and Winsten): its first value is multiplied by sqrt(1 - phi^2), and phi times its
//! predecessor is subtracted from every other value. Prefix sums make the cost of any segment available in constant
//! time, so the best division into any number of segments takes quadratic time (Bellman, 1961).
//!
//! Invariant: costs are never negative, and a linear mean never costs more than a constant one.

/// The mean of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mean {
    /// A level.
    Constant,
    /// A level and a slope.
    Linear,
}

impl Mean {
    /// Number of parameters.
    pub fn parameters(self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear => 2,
        }
    }

    /// Minimum length of a segment: a single value may be an outlier, and a slope needs more values than parameters.
    pub fn length_min(self) -> usize {
        match self {
            Self::Constant => 2,
            Self::Linear => 5,
        }
    }
}

/// Sums over the whitened values 1..=i of a series: value, value squared, time, time squared, time times value.
type Sums = [f64; 5];

/// A series with the prefix sums of its whitened values.
#[derive(Clone, Debug)]
pub struct Series {
    values: Vec<f64>,
    phi: f64,
    sums: Vec<Sums>,
}

/// The least-squares fit of a segment.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// Sum of squares of the whitened residuals.
    pub cost: f64,
    /// Mean at index 0 of the series.
    pub level: f64,
    /// Change of the mean per value.
    pub slope: f64,
}

impl Fit {
    /// Returns the mean at an index of the series, which may lie between two values.
    pub fn at(&self, index: f64) -> f64 {
        self.level + self.slope * index
    }
}

impl Series {
    /// Prepares a series for noise with autocorrelation `phi`, from 0 to below 1.
    pub fn new(values: &[f64], phi: f64) -> Self {
        let mut sums = Vec::with_capacity(values.len().max(1));
        let mut last = [0.0; 5];
        sums.push(last);
        for i in 1..values.len() {
            let (z, time) = (values[i] - phi * values[i - 1], whitened_time(i, phi));
            let terms = [z, z * z, time, time * time, time * z];
            last = std::array::from_fn(|k| last[k] + terms[k]);
            sums.push(last);
        }
        Self { values: values.to_vec(), phi, sums }
    }

    /// Returns the fit of the values `from..until`, which are at least one.
    #[inline]
    pub fn fit(&self, from: usize, until: usize, mean: Mean) -> Fit {
        #[cfg(test)]
        count_evaluation();
        let (first, last) = (&self.sums[from], &self.sums[until - 1]);
        let [z, zz, t, tt, tz]: Sums = std::array::from_fn(|k| last[k] - first[k]);
        let (weight, gain) = (1.0 - self.phi * self.phi, 1.0 - self.phi);
        let (y, time, rest) = (self.values[from], from as f64, (until - from - 1) as f64);
        let ones = weight + rest * gain * gain;
        let values = weight * y + gain * z;
        let squares = weight * y * y + zz;
        let level = values / ones;
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

    /// Returns the whitened residuals of the values `from..until`.
    pub fn residuals(&self, from: usize, until: usize, mean: Mean) -> Vec<f64> {
        let fit = self.fit(from, until, mean);
        let plain = |i: usize| self.values[i] - fit.at(i as f64);
        let first = (1.0 - self.phi * self.phi).sqrt() * plain(from);
        let rest = (from + 1..until).map(|i| plain(i) - self.phi * plain(i - 1));
        std::iter::once(first).chain(rest).collect()
    }

    /// Returns the values with these whitened residuals and mean 0: the inverse of [`Self::residuals`].
    pub fn coloured(residuals: &[f64], phi: f64) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(residuals.len());
        for residual in residuals {
            values.push(match values.last() {
                Some(last) => phi * last + residual,
                None => residual / (1.0 - phi * phi).sqrt(),
            });
        }
        values
    }

    /// Returns for 1, 2, ... segments between ascending places, as far as they fit: the least total cost, and the first
    /// indices of all segments but the first. Each takes a time quadratic in the number of places when it is requested.
    pub fn divisions(
        &self,
        mean: Mean,
        places: &[usize],
    ) -> impl Iterator<Item = (f64, Vec<usize>)> + use<> {
        let n = self.values.len();
        let edges: Vec<usize> = [&[0], places, &[n]].concat();
        let (last, least) = (edges.len() - 1, mean.length_min());
        let of_segments = self.costs(&edges, mean);
        // costs[until] is that of the best division of the values before edges[until]; origins[k][until] is the edge at which
        // the last of k + 1 segments begins.
        let mut costs: Vec<f64> = Vec::new();
        let mut origins: Vec<Vec<usize>> = Vec::new();
        std::iter::from_fn(move || {
            let segments = origins.len() + 1;
            if segments * least > n.max(least) {
                return None;
            }
            let mut next = vec![f64::INFINITY; edges.len()];
            let mut origin = vec![0; edges.len()];
            for (until, of) in of_segments.iter().enumerate() {
                if segments == 1 {
                    next[until] = of.first().copied().unwrap_or(f64::INFINITY);
                } else {
                    for (from, (before, cost)) in costs.iter().zip(of).enumerate() {
                        if before + cost < next[until] {
                            (next[until], origin[until]) = (before + cost, from);
                        }
                    }
                }
            }
            costs = next;
            origins.push(origin);
            Some((costs[last], boundaries(&origins, &edges)))
        })
    }

    /// Returns for every edge the costs of the segments that end there and begin at an edge before it, as far as they are long
    /// enough.
    fn costs(&self, edges: &[usize], mean: Mean) -> Vec<Vec<f64>> {
        let ending_at = |until: &usize| {
            let long_enough = edges.iter().take_while(|from| **from + mean.length_min() <= *until);
            long_enough.map(|from| self.fit(*from, *until, mean).cost).collect()
        };
        edges.iter().map(ending_at).collect()
    }

    /// Moves each boundary in turn to the best place between its neighbours, until none moves, at most four times.
    pub fn refined(&self, mean: Mean, mut boundaries: Vec<usize>) -> Vec<usize> {
        let (n, least) = (self.values.len(), mean.length_min());
        for _ in 0..SWEEPS_MAX {
            let before = boundaries.clone();
            for i in 0..boundaries.len() {
                let from = if i == 0 { 0 } else { boundaries[i - 1] };
                let until = boundaries.get(i + 1).copied().unwrap_or(n);
                let cost =
                    |at: usize| self.fit(from, at, mean).cost + self.fit(at, until, mean).cost;
                let costs = (from + least..=until - least).map(|at| (cost(at), at));
                let best = costs.min_by(|a, b| a.0.total_cmp(&b.0));
                boundaries[i] = best.map_or(boundaries[i], |(_, at)| at);
            }
            if boundaries == before {
                break;
            }
        }
        boundaries
    }

    /// Returns the least cost of two segments; `None` if the series is too short for two. Far from the ends the boundaries that
    /// are tried are a 64th of the distance apart, so their number grows with the logarithm of the length.
    pub fn halves(&self, mean: Mean) -> Option<f64> {
        let (n, least) = (self.values.len(), mean.length_min());
        let cost = |at: usize| self.fit(0, at, mean).cost + self.fit(at, n, mean).cost;
        let next = |at: &usize| Some(at + 1 + (*at).min(n.saturating_sub(*at)) / 64);
        let places = std::iter::successors(Some(least), next);
        places.take_while(|at| at + least <= n).map(cost).min_by(f64::total_cmp)
    }
}

/// Greatest number of times that all boundaries are moved.
const SWEEPS_MAX: usize = 4;

/// Follows the origins of the last segments from the end of the series.
fn boundaries(origins: &[Vec<usize>], edges: &[usize]) -> Vec<usize> {
    let mut until = edges.len() - 1;
    let mut places: Vec<usize> = Vec::with_capacity(origins.len() - 1);
    for origin in origins[1..].iter().rev() {
        until = origin[until];
        places.push(edges[until]);
    }
    places.reverse();
    places
}

/// The regressor of a slope in the whitened value at index `i`.
fn whitened_time(i: usize, phi: f64) -> f64 {
    i as f64 - phi * (i as f64 - 1.0)
}

#[cfg(test)]
thread_local! {
    static EVALUATIONS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

/// Counts a fit or contrast of this thread.
#[cfg(test)]
pub fn count_evaluation() {
    EVALUATIONS.set(evaluations() + 1);
}

/// Returns the number of fits and contrasts of this thread so far.
#[cfg(test)]
pub fn evaluations() -> usize {
    EVALUATIONS.get()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::random::Random;

    fn values(count: usize) -> Vec<f64> {
        let mut random = Random(count as u64);
        (0..count).map(|_| random.below(1000) as f64 / 100.0).collect()
    }

    /// The sum of squares, by the residuals of the fit.
    fn squares(series: &Series, from: usize, until: usize, mean: Mean) -> f64 {
        series.residuals(from, until, mean).iter().map(|r| r * r).sum()
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
    fn coloured_residuals_give_the_values_back() {
        let values = values(30);
        let series = Series::new(&values, 0.6);
        let fit = series.fit(0, 30, Mean::Linear);
        let coloured = Series::coloured(&series.residuals(0, 30, Mean::Linear), 0.6);
        for (i, value) in coloured.iter().enumerate() {
            assert!((value + fit.at(i as f64) - values[i]).abs() < 1e-9);
        }
    }

    /// Compares with all divisions into three segments.
    #[test]
    fn the_best_division_is_found() {
        let values = values(16);
        let series = Series::new(&values, 0.3);
        let anywhere: Vec<usize> = (1..16).collect();
        let (cost, places) = series.divisions(Mean::Constant, &anywhere).nth(2).unwrap();
        let of = |a: usize, b: usize| {
            [(0, a), (a, b), (b, 16)]
                .iter()
                .map(|(from, until)| series.fit(*from, *until, Mean::Constant).cost)
                .sum::<f64>()
        };
        let all = (2..=12).flat_map(|a| (a + 2..=14).map(move |b| (a, b)));
        let least = all.map(|(a, b)| of(a, b)).fold(f64::INFINITY, f64::min);
        assert!((cost - least).abs() < 1e-9 && (of(places[0], places[1]) - least).abs() < 1e-9);
        let halves = series.halves(Mean::Constant).unwrap();
        assert_eq!(series.divisions(Mean::Constant, &anywhere).nth(1).unwrap().0, halves);
        assert_eq!(series.divisions(Mean::Linear, &anywhere).count(), 3);
    }
    #[test]
    fn boundaries_near_the_best_ones_are_moved_there() {
        let mut values = values(300);
        values[100..].iter_mut().for_each(|value| *value += 20.0);
        values[200..].iter_mut().for_each(|value| *value -= 30.0);
        let series = Series::new(&values, 0.3);
        assert_eq!(series.refined(Mean::Constant, vec![90, 215]), [100, 200]);
        let (_, few) = series.divisions(Mean::Constant, &[90, 150, 215]).nth(2).unwrap();
        assert_eq!(few, [90, 215]);
    }
}
