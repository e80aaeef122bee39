//! A positive quantity as a sum of few known terms, each times a positive coefficient.
//!
//! Errors are relative, because such quantities range over decades. Coefficients must be positive: a difference of two terms fits what was
//! measured, and has no meaning beyond it. Of all choices of terms, the one is taken that best predicts each value from the others
//! (leave-one-out cross-validation; its errors follow from the leverages of one fit: Allen, "The relationship between variable selection and
//! data augmentation and a method for prediction", 1974).

/// A sum of terms.
#[derive(Clone, Debug, PartialEq)]
pub struct Sum {
    /// Indices of the terms, ascending, with their coefficients.
    pub terms: Vec<(usize, f64)>,
    /// Root mean square of the relative errors of values that are left out.
    error: f64,
}

/// A further term must reduce the error to this part.
const GAIN: f64 = 0.7;
/// Errors below this are none.
const EXACT: f64 = 1e-9;
/// Terms whose columns have an angle with a square sine below this are the same.
const INDEPENDENT: f64 = 1e-9;

impl Sum {
    /// The sum, for the values of all terms.
    pub fn at(&self, terms: &[f64]) -> f64 {
        self.terms.iter().map(|(term, coefficient)| coefficient * terms[*term]).sum()
    }

    /// The sum of at most two terms that predicts positive values best; `None` if there are fewer than two values more than terms.
    /// A row has the weight of a square error, the value, and the values of all terms, none of which is negative.
    pub fn fit(rows: &[(f64, f64, Vec<f64>)]) -> Option<Self> {
        let terms = rows.first().map_or(0, |(_, _, terms)| terms.len());
        let mut best: Option<Self> = None;
        let pairs = (0..terms).flat_map(|a| (a + 1..terms).map(move |b| vec![a, b]));
        for chosen in (0..terms).map(|a| vec![a]).chain(pairs) {
            let Some(sum) = of_terms(rows, &chosen) else { continue };
            let needed = best.as_ref().map_or(f64::INFINITY, |best| match best.terms.len() {
                fewer if fewer < chosen.len() => GAIN * best.error,
                _ => best.error,
            });
            if sum.error < needed {
                best = Some(sum);
            }
        }
        best
    }
}

/// The least squares of these one or two terms, whose sum relative to the value should be 1 in every row.
fn of_terms(rows: &[(f64, f64, Vec<f64>)], chosen: &[usize]) -> Option<Sum> {
    if rows.len() < chosen.len() + 2 {
        return None;
    }
    // Relative to the value; a single term is a pair whose second one is 0.
    let pair = |(weight, value, terms): &(f64, f64, Vec<f64>)| {
        let second = chosen.get(1).map_or(0.0, |term| terms[*term]);
        (*weight, terms[chosen[0]] / value, second / value)
    };
    let pairs: Vec<(f64, f64, f64)> = rows.iter().map(pair).collect();
    let total = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        pairs.iter().map(|(weight, a, b)| weight * of(*a, *b)).sum()
    };
    let [aa, ab, bb] = [total(&|a, _| a * a), total(&|a, b| a * b), total(&|_, b| b * b)];
    let [a1, b1] = [total(&|a, _| a), total(&|_, b| b)];
    // The inverse of the normal equations' matrix.
    let [ia, iab, ib] = match (chosen.len(), aa * bb - ab * ab) {
        (1, _) => [1.0 / aa, 0.0, 0.0],
        (_, determinant) if determinant <= INDEPENDENT * aa * bb => return None,
        (_, determinant) => [bb, -ab, aa].map(|entry| entry / determinant),
    };
    let coefficients = [ia * a1 + iab * b1, iab * a1 + ib * b1];
    let left_out = pairs.iter().map(|(weight, a, b)| {
        let leverage = weight * (ia * a * a + 2.0 * iab * a * b + ib * b * b);
        let error = 1.0 - coefficients[0] * a - coefficients[1] * b;
        weight * (error / (1.0 - leverage).max(INDEPENDENT)).powi(2)
    });
    let error = (left_out.sum::<f64>() / pairs.iter().map(|pair| pair.0).sum::<f64>()).sqrt();
    let terms: Vec<(usize, f64)> = chosen.iter().copied().zip(coefficients).collect();
    let is_sum = terms.iter().all(|(_, coefficient)| *coefficient > 0.0);
    (is_sum && error.is_finite()).then_some(Sum { terms, error: error.max(EXACT) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Terms 1, x, x^2, 1/x.
    fn rows(all: &[[f64; 2]]) -> Vec<(f64, f64, Vec<f64>)> {
        all.iter().map(|[x, value]| (1.0, *value, vec![1.0, *x, x * x, 1.0 / x])).collect()
    }

    proptest! {
        #[test]
        fn a_sum_of_two_terms_is_found_again(a in 1e-3..1e3f64, b in 1e-3..1e3f64, first in 0..4usize, second in 0..4usize) {
            prop_assume!(first != second);
            let mut rows = rows(&[1.0, 2.0, 4.0, 8.0, 16.0, 32.0].map(|x| [x, 0.0]));
            for row in &mut rows {
                row.1 = a * row.2[first] + b * row.2[second];
            }
            let sum = Sum::fit(&rows).unwrap();
            // A single term is taken only if it predicts as well.
            for (_, value, terms) in &rows {
                prop_assert!((sum.at(terms) / value - 1.0).abs() < 1e-3, "{sum:?}");
            }
        }
    }

    #[test]
    fn errors_are_relative_and_weighted() {
        let row = |weight: f64, value: f64| (weight, value, vec![1.0]);
        // Of 2, and of 4 twice, by a constant c: (c/2 - 1)^2 + 2 (c/4 - 1)^2 is least at c = 8/3.
        for rows in [
            vec![row(1.0, 2.0), row(1.0, 4.0), row(1.0, 4.0)],
            vec![row(1.0, 2.0), row(1.0, 4.0), row(0.5, 4.0), row(0.5, 4.0)],
        ] {
            let sum = Sum::fit(&rows).unwrap();
            assert!((sum.at(&[1.0]) - 8.0 / 3.0).abs() < 1e-12, "{sum:?}");
        }
    }

    #[test]
    fn too_few_values_and_differences_are_no_sum() {
        assert_eq!(Sum::fit(&rows(&[[1.0, 1.0], [2.0, 2.0]])), None);
        // Nothing falls from 9 by 1 with these terms but a sum with 1/x; none is subtracted.
        let sum = Sum::fit(&rows(&[[1.0, 9.0], [2.0, 8.0], [3.0, 7.0], [4.0, 6.0]])).unwrap();
        assert!(sum.terms.iter().all(|(_, coefficient)| *coefficient > 0.0), "{sum:?}");
    }
}
