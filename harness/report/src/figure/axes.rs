//! Ranges of axes, their ticks and labels.

use super::Axis;
use super::canvas::{WIDTH, width};
use bench::order::distinct;
use std::ops::Range;

/// Least space at the left of the data, for ticks and label.
const LEFT: f64 = 190.0;
/// Space at the left of ticks.
const BESIDE_TICKS: f64 = 100.0;
/// Space below the data, for ticks and label.
pub const BELOW: f64 = 140.0;

/// Greatest number of names that have labels.
const NAMES_SHOWN: usize = 12;
/// The digits as exponents.
pub const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];

/// An axis with its ends, and its ticks with their labels.
pub struct Scale {
    pub log: bool,
    pub ends: Range<f64>,
    pub ticks: Vec<(f64, String)>,
}

impl Scale {
    /// That of an axis which shows all `values`, or of names, of which some have labels if they are many.
    pub fn of(axis: &Axis, values: impl IntoIterator<Item = f64>) -> Self {
        if !axis.names.is_empty() {
            let named = (0..).zip(&axis.names).step_by(axis.names.len().div_ceil(NAMES_SHOWN));
            let ticks = named.map(|(i, name)| (f64::from(i), name.clone())).collect();
            return Self { log: false, ends: axis.names.len() as f64 - 0.5..-0.5, ticks };
        }
        let ends = range(axis, values);
        Self { log: axis.log, ticks: labelled(ticks(axis, &ends)), ends }
    }

    /// The place of a value, which is linear on the page.
    pub fn place(&self, value: f64) -> f64 {
        if self.log { value.log10() } else { value }
    }

    /// The places of the ends.
    pub fn places(&self) -> Range<f64> {
        self.place(self.ends.start)..self.place(self.ends.end)
    }

    /// The label of the tick at a place.
    pub fn label(&self, place: f64) -> String {
        let tick = self.ticks.iter().find(|(tick, _)| self.place(*tick) == place);
        tick.map_or_else(String::new, |(_, label)| label.clone())
    }

    /// Space at the left of data, if this is the vertical axis.
    pub fn left(&self) -> f64 {
        self.ticks.iter().map(|(_, label)| BESIDE_TICKS + width(label)).fold(LEFT, f64::max)
    }

    /// Clears the labels that have no room beside others, if this is the horizontal axis, whose places are these on the page.
    pub fn clear_labels(&mut self, on_page: impl Fn(f64) -> f64) {
        let mut taken = 0.0;
        let places: Vec<f64> = self.ticks.iter().map(|(tick, _)| self.place(*tick)).collect();
        for ((_, label), place) in self.ticks.iter_mut().zip(places) {
            let (middle, half) = (on_page(place), width(label) / 2.0);
            if middle - half < taken || middle + half > WIDTH {
                label.clear();
            } else {
                taken = middle + half + 10.0;
            }
        }
    }
}

/// The ends of an axis that shows all `values`. A logarithmic one ignores values that are not positive.
fn range(axis: &Axis, values: impl IntoIterator<Item = f64>) -> Range<f64> {
    if let Some((low, high)) = axis.range {
        return low..high;
    }
    let shown = values.into_iter().filter(|value| axis.shows(*value));
    let (low, high) = shown.fold((f64::INFINITY, -f64::INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    match (axis.log, low <= high) {
        (true, false) => 1.0..10.0,
        (false, false) => 0.0..1.0,
        // A margin keeps markers off the frame, and leaves room for ticks around a single value.
        (true, true) => {
            let margin = if high < 1.1 * low { 1.5 } else { (high / low).max(1.5).powf(0.05) };
            low / margin..high * margin
        }
        (false, true) => low.min(0.0)..if high > 0.0 { high * 1.06 } else { 1.0 },
    }
}

/// The positions of ticks: those that the axis has; else at most eight multiples of 1, 2 or 5 times a power of ten; on a logarithmic axis
/// powers of ten; where there are less than three of them, multiples, or the same steps as on others.
fn ticks(axis: &Axis, range: &Range<f64>) -> Vec<f64> {
    let (low, high) = (range.start, range.end);
    let slack = |v: f64| if axis.log { v.abs() * 1e-9 } else { (high - low) * 1e-9 };
    let inside = |v: &f64| (low - slack(low)..=high + slack(high)).contains(v);
    if !axis.ticks.is_empty() {
        return axis.ticks.iter().copied().filter(inside).collect();
    }
    let equidistant = || -> Vec<f64> {
        let least = (high - low) / 7.0;
        let power = 10f64.powf(least.log10().floor());
        let fits = |factor: &f64| factor * power >= least;
        let step = power * [1.0, 2.0, 5.0].into_iter().find(fits).unwrap_or(10.0);
        let numbers = (low / step).ceil() as i64..=(high / step).floor() as i64;
        numbers.map(|number| number as f64 * step).collect()
    };
    if !axis.log {
        return equidistant();
    }
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let multiples = |factors: &[f64]| -> Vec<f64> {
        let all = decades.clone().flat_map(|d| factors.iter().map(move |f| f * 10f64.powi(d)));
        all.filter(inside).collect()
    };
    let some = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0];
    // The coarsest choice with three ticks, and no more of them than have room.
    let choices = [&[1.0][..], &[1.0, 2.0, 5.0], &some].map(multiples);
    let all = choices.into_iter().find(|c| c.len() > 2).unwrap_or_else(equidistant);
    let every = all.len().div_ceil(8).max(1);
    all.into_iter().step_by(every).collect()
}

/// Ticks with their labels, which have as many digits as distinguish them.
fn labelled(ticks: Vec<f64>) -> Vec<(f64, String)> {
    let is_short = distinct(ticks.iter().map(|tick| tick_label(*tick))).len() == ticks.len();
    let step = ticks.windows(2).map(|w| (w[1] - w[0]).abs()).fold(f64::INFINITY, f64::min);
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let label = |tick| if is_short { tick_label(tick) } else { format!("{tick:.decimals$}") };
    ticks.into_iter().map(|tick| (tick, label(tick))).collect()
}

/// A number for a tick: a decimal where that is short, else with a power of ten.
pub fn tick_label(value: f64) -> String {
    let exponent = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    if (-3..5).contains(&exponent) {
        let scale = 10f64.powi((3 - exponent).max(0));
        // Adding zero turns -0 into 0.
        return ((value * scale).round() / scale + 0.0).to_string();
    }
    // Rounding first: 9.999e8 is 10⁹.
    let rounded = format!("{value:.2e}");
    let (mantissa, exponent) = rounded.split_once('e').unwrap_or((&rounded, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    let raised = |c: char| c.to_digit(10).map_or('⁻', |d| SUPERSCRIPTS[d as usize]);
    let power: String = exponent.chars().map(raised).collect();
    if mantissa == "1" { format!("10{power}") } else { format!("{mantissa}·10{power}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(axis: &Axis, values: &[f64]) -> Vec<f64> {
        ticks(axis, &range(axis, values.iter().copied()))
    }

    #[test]
    fn decades_have_ticks_the_lowest_too_and_the_ends_have_margins() {
        assert_eq!(of(&Axis::log(""), &[1.0, 1000.0, 0.0]), [1.0, 10.0, 100.0, 1000.0]);
        let ends = range(&Axis::log(""), [1.0, 1000.0]);
        assert!(ends.start < 1.0 && ends.end > 1000.0);
    }

    #[test]
    fn axes_of_less_than_a_decade_have_three_ticks() {
        assert_eq!(of(&Axis::log(""), &[10.0, 60.0]), [10.0, 20.0, 50.0]);
        let narrow = of(&Axis::log(""), &[0.15, 0.42]);
        assert_eq!(
            narrow.iter().map(|t| tick_label(*t)).collect::<Vec<_>>(),
            ["0.15", "0.2", "0.25", "0.3", "0.4"]
        );
        assert!((3..9).contains(&of(&Axis::log(""), &[9.0, 10.0]).len()));
        assert!((3..9).contains(&of(&Axis::log(""), &[1e-6, 1e9]).len()));
    }

    #[test]
    fn a_single_value_has_ticks_around_it() {
        for value in [0.73, 1.0, 99_522.0, 1e9] {
            assert!(of(&Axis::log(""), &[value]).len() > 2, "{value}");
        }
    }

    #[test]
    fn a_logarithmic_axis_of_less_than_a_decade_has_equal_steps() {
        let steps = of(&Axis::log(""), &[0.92e9, 1.6e9]);
        assert_eq!(steps, [1.0, 1.2, 1.4, 1.6].map(|step| step * 1e9));
    }

    #[test]
    fn linear_axes_start_at_zero() {
        assert_eq!(range(&Axis::linear(""), [3.0, 9.0]).start, 0.0);
        assert_eq!(of(&Axis::linear(""), &[3.0, 9.0]), [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert!(of(&Axis::linear(""), &[]).len() > 2);
        assert!(ticks(&Axis::linear(""), &(-0.1..0.1)).contains(&0.0));
        for exponent in -9..12 {
            let high = 3.7 * 10f64.powi(exponent);
            let count = ticks(&Axis::linear(""), &(-0.31 * high..high)).len();
            assert!((3..9).contains(&count), "{count} ticks up to {high}");
        }
    }

    #[test]
    fn given_ticks_outside_the_range_are_dropped() {
        let axis = Axis { ticks: vec![1.0, 2.0, 4.0, 512.0], ..Axis::log("") };
        assert_eq!(of(&axis, &[1.0, 4.0]), [1.0, 2.0, 4.0]);
    }

    #[test]
    fn tick_labels_are_short() {
        let numbers =
            [0.0, 1.0, 0.05, 2.5, 1024.0, 1e6, 5e7, 1e-6, 0.001, 1.15, 0.1 + 0.2, 9.999e8, -2.5e7];
        let labels = [
            "0",
            "1",
            "0.05",
            "2.5",
            "1024",
            "10⁶",
            "5·10⁷",
            "10⁻⁶",
            "0.001",
            "1.15",
            "0.3",
            "10⁹",
            "-2.5·10⁷",
        ];
        assert_eq!(numbers.map(tick_label), labels);
    }
}
