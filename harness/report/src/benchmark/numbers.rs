//! The results of a record as LaTeX macros, so that no number of a text is copied by hand: `\result{KEY}` is a median,
//! `\result[interval]{KEY}` its confidence interval, `\result[unit]{KEY}` its unit.
//!
//! A key is `ENGINE/CASE/EXPERIMENT/CELLS/RANKS/HOW/QUANTITY`, such as `mesher/uav/strong/48000000/16/projected/speedup`. A partition that
//! was chosen follows the experiment, as in `weights-metis-unit`. The same setup with another n has a number at its end: `speedup-2`.

use crate::figure::{file_name, name_apart};
use bench::experiments::group::{Group, Groups};
use bench::experiments::number::grouped;
use statistics::Median;
use std::fmt::Write;

/// A result, as it is printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Number {
    /// Its key.
    pub key: String,
    /// The median.
    pub value: String,
    /// The interval; empty for a single value.
    pub interval: String,
    /// The unit; empty for a ratio.
    pub unit: &'static str,
}

/// All results of a record.
pub fn numbers(groups: &Groups) -> Vec<Number> {
    let mut all: Vec<Number> = groups.all.iter().flat_map(|group| of(groups, group)).collect();
    name_apart(all.iter_mut().map(|number| &mut number.key));
    all
}

fn of(groups: &Groups, group: &Group) -> Vec<Number> {
    let s = &group.setup;
    let experiment = match s.division().as_str() {
        "default" => s.experiment.clone(),
        division => format!("{} {division}", s.experiment),
    };
    let names = [&s.engine, &s.case, &experiment].map(|name| file_name(name)).join("/");
    let setup = format!("{names}/{}/{}/{}", group.cells(), s.ranks, group.how());
    let single = |value: f64| Median { value, low: value, high: value, coverage: 1.0, count: 1 };
    let base = groups.reference(group);
    let scales = base.setup.ranks < s.ranks;
    let is_speedup = scales && base.cells() == group.cells();
    let rate = |time_s: f64| group.cells() as f64 / time_s / s.ranks as f64 / 1e6;
    let quantities = [
        ("time", Some(group.time_s), "s"),
        ("cpu", group.cpu_s(), "s"),
        ("rate", Some(group.time_s.falling(rate)), "10^6 cells/s/rank"),
        ("memory", Some(group.bytes_per_cell()), "B/cell"),
        ("speedup", is_speedup.then(|| groups.speedup(group)), ""),
        ("efficiency", scales.then(|| single(groups.efficiency(group).global())), ""),
    ];
    let number = |(name, median, unit): (&str, Option<Median>, &'static str)| {
        let Median { value, low, high, count, .. } = median.filter(|m| m.value.is_finite())?;
        let name_of = || format!("{setup}/{name}");
        assert!(low <= value && value <= high, "{}: {value} is not in its interval", name_of());
        let several = count > 1;
        let interval =
            if several { format!("{}--{}", digits(low), digits(high)) } else { String::new() };
        Some(Number { key: name_of(), value: digits(value), interval, unit })
    };
    let cells = Number {
        key: format!("{setup}/cells"),
        value: grouped(group.cells()),
        interval: String::new(),
        unit: "cells",
    };
    quantities.into_iter().filter_map(number).chain([cells]).collect()
}

/// Three significant digits, and all before the decimal point.
fn digits(value: f64) -> String {
    let magnitude = value.abs().log10().floor();
    let decimals =
        if magnitude.is_finite() { (2.0 - magnitude).clamp(0.0, 9.0) as usize } else { 0 };
    format!("{value:.decimals$}")
}

const HEAD: &str = r"% Made by `harness report`: \result{KEY} is a median, \result[interval]{KEY} its interval, \result[unit]{KEY} its unit.
\newcommand{\result}[2][value]{\ifcsname result/#2/#1\endcsname\csname result/#2/#1\endcsname
  \else\PackageError{numbers}{the record has no result #2}{}\fi}
\newcommand{\defresult}[4]{\expandafter\def\csname result/#1/value\endcsname{#2}%
  \expandafter\def\csname result/#1/interval\endcsname{#3}\expandafter\def\csname result/#1/unit\endcsname{#4}}
";

/// The unit of a result in LaTeX.
pub fn unit_tex(number: &Number) -> String {
    number.unit.replace("10^6", "$10^6$")
}

/// `numbers.tex`.
pub fn tex(numbers: &[Number]) -> String {
    let mut out = HEAD.to_owned();
    for number @ Number { key, value, interval, .. } in numbers {
        let unit = unit_tex(number);
        let _ = writeln!(out, "\\defresult{{{key}}}{{{value}}}{{{interval}}}{{{unit}}}");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::{Comm, Entry};
    use bench::testing::{line, run};
    use std::collections::BTreeSet;

    #[test]
    fn every_result_has_a_key_of_its_own() {
        let of = |n: u32| {
            let mut run = run(Comm::Sim, 1_000_000, &[("grade", &[3.0, 1.0])]);
            run.setup.layer_cells_min = n;
            line(Entry::Run(Box::new(run)))
        };
        let one = line(Entry::Run(Box::new(run(Comm::Sim, 1_000_000, &[("grade", &[4.0])]))));
        let all = numbers(&Groups::of(&[one, of(4), of(6)]));
        let keys: BTreeSet<&str> = all.iter().map(|number| number.key.as_str()).collect();
        assert_eq!(keys.len(), all.len());
        assert!(keys.iter().any(|key| key.ends_with("/time-2")), "{keys:?}");
        let speedup = all.iter().find(|n| n.key.ends_with("/2/projected/speedup")).unwrap();
        assert!(speedup.value.starts_with("1.3"), "{speedup:?}");
        assert!(
            tex(&all)
                .contains(&format!("\\defresult{{{}}}{{{}}}{{}}{{}}", speedup.key, speedup.value))
        );
    }

    #[test]
    fn three_digits_are_significant() {
        let shown = [0.0, 0.012345, 1.0, 99.96, 123456.0].map(digits);
        assert_eq!(shown, ["0", "0.0123", "1.00", "100.0", "123456"]);
    }
}
