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
        let mut sums = vec![[0.0; 5]; values.len().max(1)];
        for i in 1..values.len() {
            let (z, time) = (values[i] - phi * values[i - 1], whitened_time(i, phi));
            let terms = [z, z * z, time, time * time, time * z];
            sums[i] = std::array::from_fn(|k| sums[i - 1][k] + terms[k]);
        }
        Self { values: values.to_vec(), phi, sums }
    }

    /// Returns the fit of the values `from..until`, which are at least one.
    pub fn fit(&self, from: usize, until: usize, mean: Mean) -> Fit {
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

    /// Returns for 1, 2, ..., `count_max` segments, as far as they fit: the least total cost and the first indices of
    /// all segments but the first.
    pub fn divisions(&self, mean: Mean, count_max: usize) -> Vec<(f64, Vec<usize>)> {
        let (n, least) = (self.values.len(), mean.length_min());
        // costs[until] is that of the best division of the values before `until`; origins[k][until] is the first index
        // of its last segment.
        let mut costs: Vec<f64> = (0..=n)
            .map(|until| match until >= least {
                true => self.fit(0, until, mean).cost,
                false => f64::INFINITY,
            })
            .collect();
        let mut origins: Vec<Vec<usize>> = vec![vec![0; n + 1]];
        let mut found = vec![(costs[n], Vec::new())];
        while origins.len() < count_max && (origins.len() + 1) * least <= n {
            let mut next = vec![f64::INFINITY; n + 1];
            let mut origin = vec![0; n + 1];
            for until in least * (origins.len() + 1)..=n {
                for from in least * origins.len()..=until - least {
                    // A cost is never negative.
                    if costs[from] < next[until] {
                        let cost = costs[from] + self.fit(from, until, mean).cost;
                        if cost < next[until] {
                            (next[until], origin[until]) = (cost, from);
                        }
                    }
                }
            }
            costs = next;
            origins.push(origin);
            let mut until = n;
            let mut places: Vec<usize> = origins[1..]
                .iter()
                .rev()
                .map(|origin| {
                    until = origin[until];
                    until
                })
                .collect();
            places.reverse();
            found.push((costs[n], places));
        }
        found
    }

    /// Returns the least cost of two segments; `None` if the series is too short for two.
    pub fn halves(&self, mean: Mean) -> Option<f64> {
        let (n, least) = (self.values.len(), mean.length_min());
        let cost = |at: usize| self.fit(0, at, mean).cost + self.fit(at, n, mean).cost;
        (least..(n + 1).saturating_sub(least)).map(cost).min_by(f64::total_cmp)
    }
}

/// The regressor of a slope in the whitened value at index `i`.
fn whitened_time(i: usize, phi: f64) -> f64 {
    i as f64 - phi * (i as f64 - 1.0)
}
