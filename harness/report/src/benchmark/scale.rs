//! Ranges and ticks of axes.

use super::figure::Axis;

/// An axis with its ends, mapping values to 0..1.
#[derive(Clone, Debug)]
pub struct Scale {
    low: f64,
    high: f64,
    log: bool,
    /// Ticks with labels.
    pub ticks: Vec<f64>,
    /// Ticks without.
    pub minor: Vec<f64>,
}

impl Scale {
    /// A scale that holds all `values`. A logarithmic one passes over what is not above zero.
    pub fn of(axis: &Axis, values: &[f64]) -> Self {
        let usable = values.iter().copied().filter(|v| v.is_finite() && (!axis.log || *v > 0.0));
        let (low, high) = axis.range.unwrap_or_else(|| {
            usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
        });
        let (low, high) = if low <= high { (low, high) } else { (1.0, 10.0) };
        if axis.log { Self::log(axis, low, high) } else { Self::linear(axis, low, high) }
    }

    fn log(axis: &Axis, low: f64, high: f64) -> Self {
        // Room at both ends, so that markers do not lie on the frame.
        let room = (high / low).max(1.5).powf(0.05);
        let (low, high) =
            if axis.range.is_some() { (low, high) } else { (low / room, high * room) };
        let decades = (low.log10().floor() as i32..=high.log10().ceil() as i32).collect::<Vec<_>>();
        let inside = |v: &f64| *v >= low * (1.0 - 1e-9) && *v <= high * (1.0 + 1e-9);
        let times = |factors: &[f64]| -> Vec<f64> {
            let all = decades.iter().flat_map(|d| factors.iter().map(move |f| f * 10f64.powi(*d)));
            all.filter(|v| inside(v)).collect()
        };
        let whole = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
        let minor = times(&whole[1..]);
        let of_range = if (high / low) < 30.0 {
            // As few as tell the scale.
            let fine: Vec<f64> = (10..100).map(|tenths| f64::from(tenths) / 10.0).collect();
            let choices = [&[1.0, 2.0, 5.0], &whole[..], &fine].map(times);
            choices.into_iter().find(|c| c.len() > 2).unwrap_or_default()
        } else if high / low < 1e7 {
            times(&[1.0])
        } else {
            times(&[1.0]).into_iter().step_by(2).collect()
        };
        let ticks = if axis.ticks.is_empty() { of_range } else { axis.ticks.clone() };
        let minor = if axis.ticks.is_empty() { minor } else { Vec::new() };
        Self { low, high, log: true, ticks: ticks.into_iter().filter(inside).collect(), minor }
    }

    fn linear(axis: &Axis, low: f64, high: f64) -> Self {
        let (low, high) = match axis.range {
            Some(range) => range,
            None => (low.min(0.0), if high > 0.0 { high * 1.06 } else { 1.0 }),
        };
        let raw = (high - low) / 6.0;
        let power = 10f64.powf(raw.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].into_iter().map(|f| f * power).find(|s| *s >= raw).unwrap_or(raw);
        let first = (low / step).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        let chosen: Vec<f64> = (first..=last).map(|i| i as f64 * step).collect();
        let ticks = if axis.ticks.is_empty() { chosen } else { axis.ticks.clone() };
        let ticks = ticks.into_iter().filter(|t| *t >= low && *t <= high * (1.0 + 1e-9)).collect();
        Self { low, high, log: false, ticks, minor: Vec::new() }
    }

    /// The same without ticks, for an axis of names.
    pub fn bare(self) -> Self {
        Self { ticks: Vec::new(), minor: Vec::new(), ..self }
    }

    /// Where a value lies, 0 at the low end and 1 at the high one; values outside are drawn at the ends.
    pub fn at(&self, value: f64) -> f64 {
        let part = if self.log {
            (value.max(f64::MIN_POSITIVE) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        part.clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_are_ticks_and_the_ends_have_room() {
        let s = Scale::of(&Axis::log(""), &[1.0, 1000.0, 0.0]);
        assert_eq!(s.ticks, [1.0, 10.0, 100.0, 1000.0]);
        assert!(s.at(1.0) > 0.0 && s.at(1000.0) < 1.0 && s.at(1e9) == 1.0);
        assert!((s.at(10.0) - s.at(1.0) - (s.at(100.0) - s.at(10.0))).abs() < 1e-12);
        let short = Scale::of(&Axis::log(""), &[10.0, 60.0]);
        assert_eq!(short.ticks, [10.0, 20.0, 50.0]);
        let shorter = Scale::of(&Axis::log(""), &[0.15, 0.42]);
        assert_eq!(shorter.ticks.len(), 3, "0.2, 0.3, 0.4: {:?}", shorter.ticks);
        assert!(Scale::of(&Axis::log(""), &[9.0, 10.0]).ticks.len() > 2);
    }

    #[test]
    fn linear_axes_begin_at_zero() {
        let s = Scale::of(&Axis::linear(""), &[3.0, 9.0]);
        assert_eq!(s.at(0.0), 0.0);
        assert_eq!(s.ticks, [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert!(Scale::of(&Axis::linear(""), &[]).ticks.len() > 2);
    }

    #[test]
    fn ticks_may_be_told() {
        let axis = Axis::log("").with_ticks(vec![1.0, 2.0, 4.0, 512.0]);
        assert_eq!(Scale::of(&axis, &[1.0, 4.0]).ticks, [1.0, 2.0, 4.0]);
    }
}
