//! Control of the false discovery rate among many tests (Benjamini and Hochberg, 1995; valid for positively dependent
//! tests too).

/// Returns for every p-value the least rate of false discoveries at which its test counts as a discovery, among all tests
/// together. If nothing has changed, the probability of any discovery at rate q is at most q.
pub fn adjusted(p_values: &[f64]) -> Vec<f64> {
    let count = p_values.len() as f64;
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|a, b| p_values[*b].total_cmp(&p_values[*a]));
    let mut adjusted = vec![1.0; p_values.len()];
    let mut least: f64 = 1.0;
    for (i, index) in order.into_iter().enumerate() {
        least = least.min(p_values[index] * count / (count - i as f64));
        adjusted[index] = least;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn the_published_example_has_four_discoveries() {
        // Benjamini and Hochberg (1995), section 3.2: 15 tests at q = 0.05.
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262,
            0.5719, 0.6528, 0.7590, 1.0,
        ];
        let found = adjusted(&p);
        assert_eq!(found.iter().filter(|q| **q <= 0.05).count(), 4);
        assert!(found.windows(2).all(|pair| pair[0] <= pair[1]));
        assert!(adjusted(&[]).is_empty() && adjusted(&[0.3]) == [0.3]);
    }

    #[test]
    fn without_any_effect_a_discovery_is_as_rare_as_the_rate() {
        let mut random = Random(1);
        let mut run = || {
            let p: Vec<f64> =
                (0..20).map(|_| random.below(1 << 20) as f64 / f64::from(1 << 20)).collect();
            adjusted(&p).iter().any(|q| *q <= 0.05)
        };
        let alarms = (0..2000).filter(|_| run()).count();
        assert!((60..=140).contains(&alarms), "{alarms}");
    }
}
