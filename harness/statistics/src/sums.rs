//! A positive quantity as a sum of few known terms, each times a positive coefficient.
//!
//! Errors should be relative, because such quantities range over decades: the terms are then divided by the value, and it is 1. Coefficients must
//! be positive: a difference of two terms fits what was measured, and has no meaning beyond it. Terms are chosen for what the sum is needed for,
//! which is to predict values further on: of all choices, the one is taken that best predicts the values beyond each place in the further half of
//! the data from those up to it. A sum of many terms, and leave-one-out cross-validation, choose what interpolates best. That is for exact values;
//! so few predictions of noisy ones do not distinguish terms, and the sum of all terms is better.

/// Where a value was measured, such as a number of ranks, which is also the weight of its square error; the value; and the
/// values of all terms, none of which is negative.
pub type Row = (f64, f64, Vec<f64>);

/// A sum of terms.
#[derive(Clone, Debug, PartialEq)]
pub struct Sum {
    /// Indices of the terms, ascending, with their coefficients.
    pub terms: Vec<(usize, f64)>,
}

/// Mean square errors below this are none.
const EXACT: f64 = 1e-12;
/// Terms whose columns have an angle with a square sine below this are the same.
const INDEPENDENT: f64 = 1e-9;

impl Sum {
    /// The sum, for the values of all terms.
    pub fn at(&self, terms: &[f64]) -> f64 {
        self.terms.iter().map(|(term, coefficient)| coefficient * terms[*term]).sum()
    }

    /// The sum that extrapolates best of terms of at most so many kinds, the shortest one of several; if it may have all kinds, all terms are
    /// fitted, without those that would be subtracted. `kinds` has the kind of each term, numbered from 0; terms of one kind are chosen together.
    /// `None` without values at three places.
    pub fn fit(rows: &[Row], kinds: &[usize], most: usize) -> Option<Self> {
        let mut places: Vec<f64> = rows.iter().map(|row| row.0).collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        let [_, .., before, last] = places[..] else { return None };
        let (all, count) = (Products::of(rows), kinds.iter().max().map_or(0, |last| last + 1));
        if most >= count {
            return Some(Self::of_terms(&all, (0..kinds.len()).collect()));
        }
        places.retain(|place| (before.min(0.5 * last)..last).contains(place));
        let split = |cut: &f64| {
            let (known, mut further): (Vec<Row>, Vec<Row>) =
                rows.iter().cloned().partition(|row| row.0 <= *cut);
            let known = Products::of(&known);
            // Nothing predicts a value with a term that no value before it has.
            further.retain(|row| {
                row.2.iter().zip(&known.sums).all(|(of, sum)| *of == 0.0 || *sum > 0.0)
            });
            (known, further)
        };
        let mut splits: Vec<(Products, Vec<Row>)> = places.iter().map(split).collect();
        splits.retain(|(_, further)| !further.is_empty());
        let candidate = |chosen: Vec<usize>| {
            let terms = 0..kinds.len();
            let chosen: Vec<usize> = terms.filter(|term| chosen.contains(&kinds[*term])).collect();
            let sum = |of: &Products| Self::of_terms(of, chosen.clone());
            let beyond = |(known, further): &(Products, Vec<Row>)| sum(known).error(further);
            let (found, beyond) = (sum(&all), splits.iter().map(beyond).sum::<f64>());
            // One that predicts exactly by chance does not fit what is known.
            ([beyond, found.error(rows)].map(|error| error.max(EXACT)), found)
        };
        let all = choices(count, most).into_iter().map(candidate);
        all.min_by(|a, b| a.0.partial_cmp(&b.0).expect("finite")).map(|(_, sum)| sum)
    }

    /// The least squares of these terms: while some would be subtracted, the one of which most would be is left out.
    fn of_terms(of: &Products, mut chosen: Vec<usize>) -> Self {
        loop {
            let found = of.least_squares(&chosen);
            let added = |i: usize| found[i] * of.sums[chosen[i]];
            match (0..found.len()).min_by(|i, j| added(*i).total_cmp(&added(*j))) {
                Some(least) if found[least] <= 0.0 => _ = chosen.remove(least),
                _ => return Self { terms: chosen.into_iter().zip(found).collect() },
            }
        }
    }

    /// Mean square of the errors.
    fn error(&self, rows: &[Row]) -> f64 {
        let square = |(weight, value, terms): &Row| weight * (self.at(terms) - value).powi(2);
        rows.iter().map(square).sum::<f64>() / rows.iter().map(|row| row.0).sum::<f64>()
    }
}

/// All choices of one to so many of `count`, the shorter ones first. The bits of a number say which.
fn choices(count: usize, most: usize) -> Vec<Vec<usize>> {
    let choice = |number: u64| (0..count).filter(|i| number >> i & 1 == 1).collect();
    let mut all: Vec<Vec<usize>> = (1..1 << count).map(choice).collect();
    all.retain(|of| of.len() <= most);
    all.sort_by_key(Vec::len);
    all
}

/// What least squares need of rows, all weighted.
struct Products {
    /// The sum of each column.
    sums: Vec<f64>,
    /// The scalar product of each two columns, the last of which is the value.
    of: Vec<Vec<f64>>,
}

impl Products {
    fn of(rows: &[Row]) -> Self {
        let count = rows.first().map_or(0, |row| row.2.len());
        let column = |row: &Row, i: usize| row.2.get(i).copied().unwrap_or(row.1);
        let sum = |of: &dyn Fn(&Row) -> f64| rows.iter().map(|row| row.0 * of(row)).sum::<f64>();
        let product = |i: usize, j: usize| sum(&|row| column(row, i) * column(row, j));
        Self {
            sums: (0..count).map(|i| sum(&|row| column(row, i))).collect(),
            of: (0..=count).map(|i| (0..=count).map(|j| product(i, j)).collect()).collect(),
        }
    }

    /// The coefficients of the chosen terms whose sums have the least square errors; 0 for one that is the same as those before it. The normal
    /// equations are solved by Gauss-Jordan elimination.
    fn least_squares(&self, chosen: &[usize]) -> Vec<f64> {
        let columns = || chosen.iter().copied().chain([self.sums.len()]);
        let equation = |i: &usize| columns().map(|j| self.of[*i][j]).collect();
        let mut equations: Vec<Vec<f64>> = chosen.iter().map(equation).collect();
        for (i, term) in chosen.iter().enumerate() {
            let pivot = equations[i][i];
            let scale = if pivot > INDEPENDENT * self.of[*term][*term] { 1.0 / pivot } else { 0.0 };
            let scaled: Vec<f64> = equations[i].iter().map(|entry| scale * entry).collect();
            for equation in &mut equations {
                let factor = equation[i];
                equation.iter_mut().zip(&scaled).for_each(|(entry, of)| *entry -= factor * of);
            }
            equations[i] = scaled;
        }
        equations.iter().map(|equation| equation[chosen.len()]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Terms 1, x, x^2, 1/x, relative to the value.
    fn rows(all: &[[f64; 2]]) -> Vec<Row> {
        let row = |[x, value]: &[f64; 2]| {
            (*x, 1.0, [1.0, *x, x * x, 1.0 / x].map(|term| term / value).to_vec())
        };
        all.iter().map(row).collect()
    }

    proptest! {
        #[test]
        fn a_sum_of_three_terms_is_found_again(of in prop::array::uniform4(1e-2..1e2f64), absent in 0..4usize) {
            let mut rows = rows(&[1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0].map(|x| [x, 1.0]));
            for row in &mut rows {
                let value: f64 = (0..4).filter(|i| *i != absent).map(|i| of[i] * row.2[i]).sum();
                row.2.iter_mut().for_each(|term| *term /= value);
            }
            let sum = Sum::fit(&rows, &[0, 1, 2, 3], 3).unwrap();
            // A term is left out only if the others predict as well.
            for (_, value, terms) in &rows {
                prop_assert!((sum.at(terms) - value).abs() < 1e-3, "{sum:?}");
            }
        }
    }

    #[test]
    fn a_sum_that_predicts_exactly_by_chance_is_not_taken_for_one_that_fits() {
        // A constant and x^2 predict the last value from those before it to 1e-6, and miss the first by 14 %.
        let value =
            |x: f64| 9.656798264658295 * x + 30.846609909791557 * x * x + 86.03330934449222 / x;
        let rows = rows(&[1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0].map(|x| [x, value(x)]));
        let sum = Sum::fit(&rows, &[0, 1, 2, 3], 3).unwrap();
        assert!(rows.iter().all(|row| (sum.at(&row.2) - 1.0).abs() < 1e-3), "{sum:?}");
    }

    #[test]
    fn errors_are_weighted() {
        let row = |place: f64, value: f64| (place, 1.0, vec![1.0 / value]);
        // Of 2, of 4 twice and of 4 thrice, by a constant c: (c/2 - 1)^2 + 5 (c/4 - 1)^2 is least at c = 28/9.
        let sum = Sum::fit(&[row(1.0, 2.0), row(2.0, 4.0), row(3.0, 4.0)], &[0], 1).unwrap();
        assert!((sum.at(&[1.0]) - 28.0 / 9.0).abs() < 1e-12, "{sum:?}");
    }

    #[test]
    fn a_term_that_fits_a_disturbance_but_predicts_worse_is_left_out() {
        // Falls as 1/x but for the last values, to which a second term brings the sum nearer; of those up to 16, it predicts the one at 32 worse.
        let factors = [(1.0, 1.0), (2.0, 1.0), (4.0, 1.0), (8.0, 1.0), (16.0, 1.08), (32.0, 1.05)];
        let sum =
            Sum::fit(&rows(&factors.map(|(x, factor)| [x, factor / x])), &[0, 1, 2, 3], 2).unwrap();
        assert_eq!(sum.terms.iter().map(|term| term.0).collect::<Vec<_>>(), [3]);
    }

    #[test]
    fn a_value_with_a_term_that_none_before_it_has_chooses_no_terms() {
        // 3/x, and elsewhere 5/x, which was measured at the last place only. The third term is a constant.
        let first = |x: f64| (x, 1.0, vec![1.0 / 3.0, 0.0, x / 3.0]);
        let mut rows = [4.0, 8.0, 16.0, 32.0, 64.0].map(first).to_vec();
        rows.extend([64.0; 20].map(|x| (x, 1.0, vec![0.0, 1.0 / 5.0, x / 5.0])));
        let sum = Sum::fit(&rows, &[0, 0, 1], 1).unwrap();
        let off = |at: &[f64], value: f64| (sum.at(at) - value).abs();
        assert!(off(&[1.0, 0.0, 1.0], 3.0).max(off(&[0.0, 1.0, 1.0], 5.0)) < 1e-9, "{sum:?}");
    }

    #[test]
    fn too_few_values_and_differences_are_no_sum() {
        assert_eq!(Sum::fit(&rows(&[[1.0, 1.0], [2.0, 2.0], [2.0, 2.0]]), &[0, 1, 2, 3], 2), None);
        // Nothing falls from 9 by 1 with these terms but a sum with 1/x; none is subtracted.
        let rows = rows(&[[1.0, 9.0], [2.0, 8.0], [3.0, 7.0], [4.0, 6.0]]);
        let sum = Sum::fit(&rows, &[0, 1, 2, 3], 2).unwrap();
        assert!(sum.terms.iter().all(|(_, coefficient)| *coefficient > 0.0), "{sum:?}");
    }

    #[test]
    fn a_sum_of_all_terms_has_none_that_is_subtracted() {
        // 3 + 2x, but for 0.5/x that is missing at one end.
        let rows = rows(&[[1.0, 4.5], [2.0, 7.0], [4.0, 11.0], [8.0, 19.0], [16.0, 35.0]]);
        let sum = Sum::fit(&rows, &[0, 1, 2, 3], 4).unwrap();
        assert!(sum.terms.iter().all(|(_, coefficient)| *coefficient > 0.0), "{sum:?}");
        assert!(rows.iter().all(|row| (sum.at(&row.2) - 1.0).abs() < 0.1), "{sum:?}");
        let exact = Sum::fit(&rows[1..], &[0, 1, 2, 3], 4).unwrap();
        assert!(exact.terms.iter().all(|(i, of)| (of - [3.0, 2.0, 0.0, 0.0][*i]).abs() < 1e-6));
        assert_eq!(Sum::fit(&[], &[], 4), None);
    }

    #[test]
    fn choices_are_all_of_any_length_and_the_shorter_ones_come_first() {
        let mut all = choices(4, 3);
        assert_eq!(all[..4], [[0], [1], [2], [3]]);
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 4 + 6 + 4);
    }

    #[test]
    fn a_term_that_is_the_same_as_another_one_has_no_coefficient() {
        let rows = [[1.0, 5.0], [2.0, 7.0], [4.0, 11.0]];
        let rows = rows.map(|[x, value]: [f64; 2]| (x, value, vec![1.0, x, 3.0 - x]));
        let found = Products::of(&rows).least_squares(&[0, 1, 2]);
        assert!((found[0] - 3.0).abs() + (found[1] - 2.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found[2], 0.0);
    }
}
