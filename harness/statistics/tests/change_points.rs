//! False alarms and power of the change point detector on simulated series. All seeds are fixed.

use statistics::change_points::{Change, change_points};
use statistics::random::Random;

/// Series per kind of noise.
const SERIES: u64 = 200;

fn uniform(random: &mut Random) -> f64 {
    (random.below(1 << 30) as f64 + 0.5) / f64::from(1 << 30)
}

fn normal(random: &mut Random) -> f64 {
    (-2.0 * uniform(random).ln()).sqrt() * (std::f64::consts::TAU * uniform(random)).cos()
}

/// Normal values in which one of twenty is an outlier.
fn contaminated(random: &mut Random) -> f64 {
    let value = normal(random);
    if random.below(20) == 0 { value + 3.0 + 8.0 * uniform(random) } else { value }
}

/// Student's t with three degrees of freedom.
fn heavy_tailed(random: &mut Random) -> f64 {
    let squares: f64 = (0..3).map(|_| normal(random).powi(2)).sum();
    normal(random) / (squares / 3.0).sqrt()
}

/// Independent values around 100.
fn independent(count: usize, seed: u64, draw: impl Fn(&mut Random) -> f64) -> Vec<f64> {
    let mut random = Random(seed * 7919 + count as u64);
    (0..count).map(|_| 100.0 + draw(&mut random)).collect()
}

/// A stationary first-order autoregression around 100.
fn autoregressive(count: usize, seed: u64, phi: f64) -> Vec<f64> {
    let mut random = Random(seed * 104_729 + count as u64);
    let mut value = normal(&mut random) / (1.0 - phi * phi).sqrt();
    let mut next = || {
        value = phi * value + normal(&mut random);
        100.0 + value
    };
    (0..count).map(|_| next()).collect()
}

fn found(values: &[f64]) -> Vec<Change> {
    change_points(values, 0.01)
}

fn places(values: &[f64]) -> Vec<usize> {
    found(values).iter().map(|step| step.at).collect()
}

/// Percentage of series with a step.
fn alarms(series: impl Fn(u64) -> Vec<f64>) -> f64 {
    alarms_of(SERIES, series)
}

fn alarms_of(count: u64, series: impl Fn(u64) -> Vec<f64>) -> f64 {
    let alarms = (0..count).filter(|seed| !places(&series(*seed)).is_empty()).count();
    100.0 * alarms as f64 / count as f64
}

#[test]
fn independent_noise_of_any_kind_rarely_has_a_step() {
    for count in [20, 60] {
        assert!(alarms(|seed| independent(count, seed, normal)) <= 1.0, "normal, {count}");
        assert!(alarms(|seed| independent(count, seed, uniform)) <= 1.0, "uniform, {count}");
        assert!(alarms(|seed| independent(count, seed, heavy_tailed)) <= 1.0, "heavy, {count}");
        // Near the bound, a rate of 200 series is too uncertain.
        let rate = alarms_of(1000, |seed| independent(count, seed, contaminated));
        assert!(rate <= 1.0, "outliers, {count}: {rate} %");
    }
}

/// As a counter has that depends on timing, and a time that is rounded.
#[test]
fn noise_of_few_values_has_no_step_and_hides_none() {
    for (rare, count, most) in [(20, 80, 2.0), (10, 40, 6.0), (10, 80, 1.0), (5, 40, 1.0)] {
        let noise =
            |seed| independent(count, seed, |random| f64::from(u8::from(random.below(rare) == 0)));
        let rate = alarms(noise);
        assert!(rate <= most, "one in {rare} of {count}: {rate} %");
        let found = |seed: &u64| {
            let mut values = noise(*seed);
            values[count - 8..].iter_mut().for_each(|value| *value += 2.0);
            matches!(places(&values)[..], [at] if at.abs_diff(count - 8) <= 1)
        };
        let found = (0..50).filter(found).count();
        assert!(found >= 47, "one in {rare} of {count}: {found} of 50");
    }
    // Levels that return are no noise, nor do old outliers hide a step.
    let after = |parts: &[(f64, usize)]| {
        let values: Vec<f64> = parts.iter().flat_map(|&(x, count)| vec![x; count]).collect();
        places(&values)
    };
    for count in 5..12 {
        let levels = [(100.0, count), (105.0, count), (100.0, count), (105.0, count)];
        assert_eq!(after(&levels), [count, 2 * count, 3 * count]);
    }
    for count in [8, 40] {
        let again = [(1000.0, 30), (1050.0, 4), (1000.0, 4), (1050.0, count)];
        assert_eq!(after(&again), [30, 34, 38]);
    }
    let old = [(100.0, 20), (200.0, 1), (100.0, 30), (200.0, 1), (100.0, 30), (101.0, 20)];
    assert_eq!(after(&old), [82]);
    let many = [&[(100.0, 15), (200.0, 1)].repeat(4)[..], &[(100.0, 15), (120.0, 20)]].concat();
    assert_eq!(after(&many), [79]);
    let fast = [&[(1e5, 20)][..], &[(1e4, 5), (10001.0, 1)].repeat(3), &[(1e4, 12), (12e3, 20)]];
    assert_eq!(after(&fast.concat()), [20, 50]);
    let rate = alarms(|seed| independent(40, seed, |random| (normal(random) / 2.0).round()));
    assert!(rate <= 1.0, "rounded: {rate} %");
}

#[test]
fn autocorrelated_noise_is_no_sequence_of_steps() {
    for count in [30, 100] {
        let rate = alarms(|seed| autoregressive(count, seed, 0.7));
        assert!(rate <= 5.0, "{rate} % of {count} values");
    }
}

#[test]
fn a_drift_is_no_staircase() {
    for slope in [0.02, 0.1, 1.0] {
        let drifting = |seed| {
            let mut values = independent(60, seed, normal);
            values.iter_mut().enumerate().for_each(|(i, value)| *value += slope * i as f64);
            values
        };
        assert!(alarms(drifting) <= 5.0, "slope {slope}");
    }
}

#[test]
fn clear_steps_are_located_to_one_value() {
    let with_step = |seed: u64, size: f64| {
        let mut values = independent(60, seed, normal);
        values[40..].iter_mut().for_each(|value| *value += size);
        values
    };
    let right = |size: f64| {
        let is_right = |seed: &u64| matches!(places(&with_step(*seed, size))[..], [39..=41]);
        (0..50).filter(is_right).count()
    };
    assert!(right(5.0) >= 48, "{}", right(5.0));
    assert!(right(3.0) >= 44, "{}", right(3.0));
}

#[test]
fn several_steps_are_separated_and_outliers_are_not_steps() {
    let mut values = independent(90, 3, normal);
    values[30..].iter_mut().for_each(|value| *value *= 1.1);
    values[65..].iter_mut().for_each(|value| *value *= 0.8);
    for (outlier, size) in [(10, 40.0), (50, -30.0), (89, 60.0)] {
        values[outlier] += size;
    }
    assert_eq!(places(&values), [30, 65]);
}

#[test]
fn an_outlier_beyond_all_others_hides_no_step() {
    for outlier in [1e10, 1e12, u64::MAX as f64] {
        let values = [vec![1000.0; 20], vec![outlier], vec![1000.0; 20], vec![1010.0; 10]].concat();
        assert_eq!(places(&values), [41], "{outlier}");
        let mut noisy = independent(60, 7, normal);
        noisy[30..].iter_mut().for_each(|value| *value *= 1.1);
        noisy[10] = outlier;
        assert_eq!(places(&noisy), [30], "{outlier}");
    }
}

#[test]
fn a_step_within_a_drift_is_found() {
    let mut values = independent(80, 5, normal);
    values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.5 * i as f64);
    values[40..].iter_mut().for_each(|value| *value += 20.0);
    assert_eq!(places(&values), [40]);
}

/// The median of the values after it is less than that of those before.
#[test]
fn a_rise_within_a_fall_is_a_rise() {
    for at in [60, 90, 110] {
        for seed in 0..20 {
            let mut values = independent(120, seed, normal);
            values.iter_mut().enumerate().for_each(|(i, value)| *value -= i as f64 / 6.0);
            values[at..].iter_mut().for_each(|value| *value += 8.0);
            let found = change_points(&values, 0.01);
            for Change { before, after, .. } in found.iter().filter(|of| of.at.abs_diff(at) <= 2) {
                assert!((after - before - 8.0).abs() < 3.0, "{at}, {seed}: {before} to {after}");
            }
            assert!(!found.is_empty(), "{at}, {seed}");
        }
    }
}

#[test]
fn long_histories_rarely_have_a_step_by_chance_and_short_excursions_are_found() {
    let rate = alarms_of(100, |seed| independent(2000, seed, normal));
    assert!(rate <= 1.0, "normal: {rate} %");
    let rate = alarms_of(100, |seed| autoregressive(2000, seed, 0.7));
    assert!(rate <= 5.0, "autocorrelated: {rate} %");
    let found = |seed: &u64| {
        let mut values = independent(3000, *seed, normal);
        values[1000..1010].iter_mut().for_each(|value| *value += 6.0);
        values[2994..].iter_mut().for_each(|value| *value += 8.0);
        matches!(places(&values)[..], [999..=1001, 1009..=1011, 2993..=2995])
    };
    assert!((0..10).filter(found).count() >= 9);
}

#[test]
fn an_exact_counter_needs_few_values_after_the_change() {
    let mut values = vec![7.0; 30];
    values.push(8.0);
    assert_eq!(places(&values), [0usize; 0]);
    values.extend([8.0, 8.0]);
    assert_eq!(places(&values), [30]);
    values.extend([8.0; 30]);
    assert_eq!(places(&values), [30]);
}

/// However few values an exact counter has between them, and beside them.
#[test]
fn steps_close_together_do_not_hide_each_other() {
    for [middle, last] in [[2000.0, 3000.0], [1100.0, 900.0], [2000.0, 1000.0]] {
        for (old, count, new) in (5..=60).flat_map(|old| {
            (2..=4).flat_map(move |count| (2..=10).map(move |new| (old, count, new)))
        }) {
            let levels = [vec![1000.0; old], vec![middle; count], vec![last; new]].concat();
            assert_eq!(places(&levels), [old, old + count], "{middle}, {last}, {new} new values");
        }
        let three = [vec![1000.0; 8], vec![middle; 2], vec![last; 2], vec![7000.0; 2]].concat();
        assert_eq!(places(&three), [8, 10, 12]);
    }
    for last in [
        [2000.0, 3000.0, 4000.0, 5000.0],
        [1100.0, 900.0, 1200.0, 800.0],
        [1100.0, 1300.0, 1200.0, 1500.0],
    ] {
        for (old, count) in [(8, 4), (8, 3), (8, 2), (12, 2), (5, 2), (40, 2)] {
            let levels =
                [vec![1000.0; old], last.map(|level| vec![level; count]).concat()].concat();
            let found: Vec<f64> = found(&levels).iter().map(|step| step.after).collect();
            assert_eq!(found, last, "{count} values of each level after {old}");
        }
    }
}

#[test]
fn other_values_at_the_ends_of_an_exact_counter_are_no_levels_and_hide_none() {
    for first in [&[500.0][..], &[900.0], &[1200.0], &[900.0, 950.0, 1000.0, 990.0]] {
        for count in [10, 20, 60] {
            let old = [first, &vec![1000.0; count]].concat();
            assert_eq!(places(&old), [0usize; 0], "{first:?}, then {count}");
            let new = [&old[..], &[1010.0; 8]].concat();
            assert_eq!(places(&new), [old.len()], "{first:?}, then {count}");
        }
    }
    let after = |last: &[f64]| places(&[&[1000.0; 30], last].concat());
    for last in [&[1300.0, 900.0][..], &[1300.0, 999.0], &[1010.0, 990.0, 1300.0, 900.0]] {
        assert_eq!(after(last), [0usize; 0], "{last:?}");
    }
    // The last value of a level that never repeats one is no level either.
    for last in [[1002.0, 1004.0, 1003.0, 1001.0, 1005.0], [1200.0, 1400.0, 1300.0, 1100.0, 1500.0]]
    {
        assert_eq!(after(&last), [30], "{last:?}");
    }
}

/// A level of 2000 that never repeats a value, after one of 1000 that always does.
#[test]
fn an_exact_counter_that_becomes_inexact_has_a_step() {
    for [old, new] in [[100, 40], [30, 25], [30, 5]] {
        let values: Vec<f64> = (0..old + new)
            .map(|i| if i < old { 1e3 } else { 2e3 + 3.0 * (i - old) as f64 })
            .collect();
        assert_eq!(places(&values), [old], "{new} new values");
    }
}

#[test]
fn short_and_degenerate_series_have_no_changes() {
    for values in [&[][..], &[1.0], &[1.0, 2.0, 3.0], &[5.0; 50], &[0.0; 20], &[f64::NAN; 9]] {
        assert_eq!(found(values), [], "{values:?}");
    }
}
