//! The interquartile mean: robust against the few rounds that other processes disturb.

/// Fraction of the values discarded at either end.
const TRIM: f64 = 0.25;

/// Returns the mean of the middle half of the values.
pub fn trimmed_mean(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = (sorted.len() as f64 * TRIM) as usize;
    let kept = &sorted[cut..sorted.len() - cut];
    kept.iter().sum::<f64>() / kept.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_at_either_end_are_discarded() {
        assert_eq!(trimmed_mean(&[1.0, 2.0, 3.0, 1000.0]), 2.5);
        assert_eq!(trimmed_mean(&[7.0]), 7.0);
    }
}
