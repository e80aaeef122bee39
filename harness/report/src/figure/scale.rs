//! Ranges and ticks of axes.
//!
//! The ticks are our own because plotters 0.3 places those of a logarithmic axis from the first power of ten upwards
//! (`LogCoord::key_points`): run times between 0.2 s and 0.9 s would have none.

use super::Axis;

/// An axis with both ends; it maps values to the interval from 0 to 1.
#[derive(Clone, Debug)]
pub struct Scale {
    low: f64,
    high: f64,
    log: bool,
    /// Positions of ticks with labels.
    pub ticks: Vec<f64>,
    /// Positions of ticks without labels.
    pub minor: Vec<f64>,
}

impl Scale {
    /// A scale that contains all `values`. A logarithmic one ignores values that are not positive.
    pub fn of(axis: &Axis, values: impl IntoIterator<Item = f64>) -> Self {
        let usable = values.into_iter().filter(|v| v.is_finite() && (!axis.log || *v > 0.0));
        let (low, high) = axis.range.unwrap_or_else(|| {
            usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
        });
        let (low, high) = if low <= high { (low, high) } else { (1.0, 10.0) };
        if axis.log { Self::log(axis, low, high) } else { Self::linear(axis, low, high) }
    }

    fn log(axis: &Axis, low: f64, high: f64) -> Self {
        // A margin keeps markers off the frame.
        let margin = (high / low).max(1.5).powf(0.05);
        let (low, high) =
            if axis.range.is_some() { (low, high) } else { (low / margin, high * margin) };
        let inside = |v: &f64| *v >= low * (1.0 - 1e-9) && *v <= high * (1.0 + 1e-9);
        if !axis.ticks.is_empty() {
            let ticks = axis.ticks.iter().copied().filter(inside).collect();
            return Self { low, high, log: true, ticks, minor: Vec::new() };
        }
        let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let multiples = |factors: &[f64]| -> Vec<f64> {
            let all = decades.clone().flat_map(|d| factors.iter().map(move |f| f * 10f64.powi(d)));
            all.filter(inside).collect()
        };
        let digits = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
        let ticks = if (high / low) < 30.0 {
            // The coarsest choice with three ticks.
            let tenths: Vec<f64> = (10..100).map(|tenths| f64::from(tenths) / 10.0).collect();
            let choices = [&[1.0, 2.0, 5.0], &digits[..], &tenths].map(multiples);
            choices.into_iter().find(|c| c.len() > 2).unwrap_or_default()
        } else {
            let every = if high / low < 1e7 { 1 } else { 2 };
            multiples(&[1.0]).into_iter().step_by(every).collect()
        };
        Self { low, high, log: true, ticks, minor: multiples(&digits[1..]) }
    }

    fn linear(axis: &Axis, low: f64, high: f64) -> Self {
        let (low, high) = match axis.range {
            Some(range) => range,
            None => (low.min(0.0), if high > 0.0 { high * 1.06 } else { 1.0 }),
        };
        let step_min = (high - low) / 6.0;
        let power = 10f64.powf(step_min.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|f| f * power);
        let step = steps.into_iter().find(|s| *s >= step_min).unwrap_or(step_min);
        let (first, last) = ((low / step).ceil() as i64, (high / step + 1e-9).floor() as i64);
        let ticks: Vec<f64> = match axis.ticks.is_empty() {
            true => (first..=last).map(|i| i as f64 * step).collect(),
            false => axis.ticks.clone(),
        };
        let ticks = ticks.into_iter().filter(|t| *t >= low && *t <= high * (1.0 + 1e-9)).collect();
        Self { low, high, log: false, ticks, minor: Vec::new() }
    }

    /// The same scale without ticks, for an axis of categories.
    pub fn without_ticks(self) -> Self {
        Self { ticks: Vec::new(), minor: Vec::new(), ..self }
    }

    /// The position of a value, 0 at the lower end and 1 at the upper one; values outside are moved to the ends.
    pub fn position(&self, value: f64) -> f64 {
        let fraction = if self.log {
            (value.max(f64::MIN_POSITIVE) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        fraction.clamp(0.0, 1.0)
    }
}

/// A number as mantissa and power of ten, or as a decimal where that is short.
pub(super) enum Number {
    Decimal(String),
    /// Mantissa, empty for 1, and exponent.
    Scientific(String, i32),
}

impl Number {
    pub(super) fn of(value: f64) -> Self {
        if value == 0.0 {
            return Self::Decimal("0".into());
        }
        let exponent = value.abs().log10().floor();
        if (-3.0..5.0).contains(&exponent) {
            let scale = 10f64.powi((3 - exponent as i32).max(0));
            return Self::Decimal(((value * scale).round() / scale).to_string());
        }
        let mut exponent = exponent;
        let mut mantissa = (value / 10f64.powf(exponent) * 100.0).round() / 100.0;
        if mantissa.abs() >= 10.0 {
            (mantissa, exponent) = (mantissa / 10.0, exponent + 1.0);
        }
        let text = if mantissa == 1.0 { String::new() } else { mantissa.to_string() };
        Self::Scientific(text, exponent as i32)
    }
}

/// A number for a tick: a decimal where that is short, else with a power of ten.
pub fn tick_label(value: f64) -> String {
    const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match Number::of(value) {
        Number::Decimal(text) => text,
        Number::Scientific(mantissa, exponent) => {
            let raised = |c: char| c.to_digit(10).map_or('⁻', |d| SUPERSCRIPTS[d as usize]);
            let dot = if mantissa.is_empty() { "" } else { "·" };
            let exponent: String = exponent.to_string().chars().map(raised).collect();
            format!("{mantissa}{dot}10{exponent}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_have_ticks_and_the_ends_have_margins() {
        let s = Scale::of(&Axis::log(""), [1.0, 1000.0, 0.0]);
        assert_eq!(s.ticks, [1.0, 10.0, 100.0, 1000.0]);
        assert!(s.position(1.0) > 0.0 && s.position(1000.0) < 1.0 && s.position(1e9) == 1.0);
        let decade = |v: f64| s.position(10.0 * v) - s.position(v);
        assert!((decade(1.0) - decade(10.0)).abs() < 1e-12);
    }

    #[test]
    fn axes_of_less_than_a_decade_have_three_ticks() {
        assert_eq!(Scale::of(&Axis::log(""), [10.0, 60.0]).ticks, [10.0, 20.0, 50.0]);
        let narrow = Scale::of(&Axis::log(""), [0.15, 0.42]).ticks;
        assert_eq!(
            narrow.iter().map(|t| tick_label(*t)).collect::<Vec<_>>(),
            ["0.2", "0.3", "0.4"]
        );
        assert!(Scale::of(&Axis::log(""), [9.0, 10.0]).ticks.len() > 2);
    }

    #[test]
    fn linear_axes_start_at_zero() {
        let s = Scale::of(&Axis::linear(""), [3.0, 9.0]);
        assert_eq!(s.position(0.0), 0.0);
        assert_eq!(s.ticks, [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert!(Scale::of(&Axis::linear(""), []).ticks.len() > 2);
    }

    #[test]
    fn given_ticks_outside_the_range_are_dropped() {
        let axis = Axis::log("").with_ticks(vec![1.0, 2.0, 4.0, 512.0]);
        assert_eq!(Scale::of(&axis, [1.0, 4.0]).ticks, [1.0, 2.0, 4.0]);
    }

    #[test]
    fn tick_labels_are_short() {
        let numbers =
            [0.0, 1.0, 0.05, 2.5, 1024.0, 1e6, 5e7, 1e-6, 0.001, 1.15, 0.1 + 0.2, 9.999e8];
        let labels = [
            "0", "1", "0.05", "2.5", "1024", "10⁶", "5·10⁷", "10⁻⁶", "0.001", "1.15", "0.3", "10⁹",
        ];
        assert_eq!(numbers.map(tick_label), labels);
    }
}
