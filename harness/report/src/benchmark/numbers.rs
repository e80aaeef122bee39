//! The results of a record as LaTeX macros, so that no number of a text is copied by hand: `\result{KEY}` is a median,
//! `\result[interval]{KEY}` its confidence interval, `\result[coverage]{KEY}` the confidence in per cent, `\result[unit]{KEY}` its unit.
//!
//! A key is `ENGINE/CASE/EXPERIMENT/CELLS/RANKS/HOW/QUANTITY`, such as `mesher/uav/strong/48000000/16/projected/speedup`. A partition that
//! was chosen follows the experiment, as in `weights-metis-unit`, and so does n in the experiment `layers`: `layers-n16`. Otherwise the same
//! setup with another n has a number before its quantity: `projected-2/speedup`.
//!
//! `harness report DIR --check paper.tex` compares the numbers of a text with the record. A finding is a `\result` of a key that the record
//! does not have, a `\defresult` (in a copy of `numbers.tex`) that differs from the record, or a number with a decimal point and three or
//! more significant digits that is written by hand and that no result rounds to. Texts that it includes are compared as well. A line that
//! ends in `% not a result` is not read, so that a version or a clock rate is no finding.

use super::groups::clocks;
use crate::figure::{file_name, name_apart};
use bench::experiments::group::{Group, Groups};
use contract::number::{digits, grouped};
use regex::{Captures, Match, Regex};
use statistics::Median;

/// A result, as it is printed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Number {
    /// Its key.
    pub key: String,
    /// The median.
    pub value: String,
    /// The interval; empty for a single value.
    pub interval: String,
    /// The confidence that the interval contains the median, in per cent; empty as well.
    pub coverage: String,
    /// The unit in LaTeX; empty for a ratio.
    pub unit: &'static str,
    /// The base case of a speedup or an efficiency; empty for another quantity.
    pub base: String,
}

/// All results of a record.
pub fn numbers(groups: &Groups) -> Vec<Number> {
    let mut setups: Vec<String> = groups.all.iter().map(key_of).collect();
    name_apart(setups.iter_mut());
    groups.all.iter().zip(&setups).flat_map(|(group, setup)| of(groups, group, setup)).collect()
}

/// The part of a key that all numbers of a group have.
fn key_of(group: &Group) -> String {
    let s = &group.setup;
    let experiment = match s.division().as_str() {
        "default" if s.experiment == "layers" => format!("layers n{}", s.layer_cells_min),
        "default" => s.experiment.clone(),
        division => format!("{} {division}", s.experiment),
    };
    let names = [&s.engine, &s.case, &experiment].map(|name| file_name(name)).join("/");
    format!("{names}/{}/{}/{}", group.cells(), s.ranks, group.how())
}

fn of(groups: &Groups, group: &Group, setup: &str) -> Vec<Number> {
    let base = groups.reference(group);
    let scales =
        base.setup.ranks < group.setup.ranks && clocks([base, group].into_iter()).is_none();
    let is_speedup = scales && base.cells() == group.cells();
    let quantities = [
        ("time", Some(group.time_s), "s"),
        ("cpu", group.cpu_s(), "s"),
        ("rate", Some(group.rates()), "$10^6$ cells/s/rank"),
        ("memory", group.bytes_per_cell(), "B/cell"),
        ("speedup", is_speedup.then(|| groups.speedup(group)), ""),
        ("efficiency", scales.then(|| groups.global_efficiency(group)), ""),
    ];
    let number = |(name, median, unit): (&str, Option<Median>, &'static str)| {
        let median @ Median { value, low, high, .. } = median.filter(|m| m.value.is_finite())?;
        let key = format!("{setup}/{name}");
        assert!(low <= value && value <= high, "{key}: {value} is not in its interval");
        let ends = [[low, high].map(digits).join("--"), median.per_cent().to_string()];
        let [interval, coverage] = if median.coverage > 0.0 { ends } else { Default::default() };
        let base = if unit.is_empty() { base.how_on() } else { String::new() };
        Some(Number { key, value: digits(value), interval, coverage, unit, base })
    };
    let (key, value) = (format!("{setup}/cells"), grouped(group.cells()));
    let cells = Number { key, value, unit: "cells", ..Number::default() };
    quantities.into_iter().filter_map(number).chain([cells]).collect()
}

const HEAD: &str = r"% Made by `harness report`: \result{KEY} is a median, \result[interval]{KEY} its interval, \result[coverage]{KEY} the
% confidence of that in per cent (95 and more need six repetitions), \result[unit]{KEY} its unit. A projected time, and what
% follows from it, is the critical path of medians per rank, and can be below that of every repetition. A speedup and an
% efficiency are over the base case at the end of their line, which counts as ideal in a speedup if it has several ranks.
\newcommand{\result}[2][value]{\ifcsname result/#2/#1\endcsname\csname result/#2/#1\endcsname
  \else\PackageError{numbers}{the record has no result #2}{}\fi}
\newcommand{\defresult}[5]{\expandafter\def\csname result/#1/value\endcsname{#2}%
  \expandafter\def\csname result/#1/interval\endcsname{#3}\expandafter\def\csname result/#1/coverage\endcsname{#4}%
  \expandafter\def\csname result/#1/unit\endcsname{#5}}
";

/// `numbers.tex`.
pub fn tex(numbers: &[Number]) -> String {
    let mut out = HEAD.to_owned();
    for Number { key, value, interval, coverage, unit, base } in numbers {
        let over = if base.is_empty() { "" } else { " % over " };
        out += &format!(
            "\\defresult{{{key}}}{{{value}}}{{{interval}}}{{{coverage}}}{{{unit}}}{over}{base}\n"
        );
    }
    out
}

/// What is not a number of a text: arguments of commands that name a label, a file or a source, options of commands, colours, factors of the
/// layout, lengths. A bracket after the first commands begins an interval or a short title. Options over several lines have an equals sign.
/// Before a word, `in` is one as well.
const NOT_READ: [&str; 6] = [
    r"\\(?:left\b|in\b|[bB]igg?l?\b|(?:caption|chapter|part|item|title|(?:sub)*section|(?:sub)?paragraph)\b\*?)",
    r"(?:[dD][oO][iI][^0-9\n]{0,20}10\.[0-9]{4,9}/[^\s}]*|ar[xX]iv[^0-9\n]{0,10}[0-9]{4}\.[0-9]{4,5})|\\(?:[a-zA-Z]*(?:label|ref|cite[a-z]*|input|url)|include|result|includegraphics|usepackage|pgfplotsset|bibitem)\*?\s*(?:\[[^\]]*\]\s*)*\{[^}]*\}",
    r"\\(?:definecolor\s*(?:\{[^}]*\}\s*){3}|[a-zA-Z]*color\s*\[[^\]]*\]\s*\{[^}]*\})",
    r"\\(?:(?:(?:re)?newcommand|def)\*?\s*\{?\s*\\(?:arraystretch|baselinestretch)\s*\}?|linespread|scalebox)\s*\{[^}]*\}",
    r"(?:\\[a-zA-Z]+\*?|[}\]])\[\s*[a-zA-Z][^\[\]=]*=[^\[\]]*\]|\\[a-zA-Z]+\*?\[[^\]\n]*\]|[}\]]\[[^\]\n]*[a-zA-Z!][^\]\n]*\]",
    r"[0-9.]+(?:[ \t]*(?:pt|cm|mm|em|ex|bp)\b|in(?:[ \t]*[^a-zA-Z \t]|$)|\\[a-zA-Z]*(?:width|height|size|skip|sep|indent|unitlength)\b)",
];

/// Digits with points, thousands separators, and a power of ten.
const LITERAL: &str = r"[0-9]{1,3}(?:(?:,|\{,\}|\\,|~)[0-9]{3})+(?:\.[0-9]+)?|[0-9.]*[0-9](?:[eE][-+]?[0-9]+|\s*\\(?:cdot|times)\s*10\^(?:\{\s*-?[0-9]+\s*\}|[0-9]))?";

/// What a text has.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Numbers that were compared with the record.
    pub compared: usize,
    /// Those of them that are written by hand, for which any result will do.
    pub by_hand: usize,
    /// What is wrong, with line numbers.
    pub findings: Vec<String>,
}

/// Compares the numbers of a LaTeX text with the results of a record.
pub fn check(text: &str, numbers: &[Number]) -> Checked {
    let mut found: Vec<(usize, Option<String>)> = Vec::new();
    let code = without_comments(&without(r"(?m)^(?:.*[^\\\n])?% not a result\s*$", text));
    for definition in pattern(r"(?m)^\s*\\defresult.*$").find_iter(&code) {
        found.push((definition.start(), defines_otherwise(definition.as_str(), numbers)));
    }
    let code = without(r"(?m)^\s*\\defresult.*$", &code);
    let uses = pattern(r"\\result\s*(?:\[([^\]]*)\])?\s*\{\s*([^}]*?)\s*\}");
    // In a macro, a part of the key is an argument.
    let whole = uses.captures_iter(&code).filter(|of| !of[2].contains('#'));
    found.extend(whole.map(|of| {
        let option = of.get(1).map_or("value", |option| option.as_str());
        (of.get(0).map_or(0, |whole| whole.start()), misused(option, &of[2], numbers))
    }));
    let code = NOT_READ.iter().fold(code, |code, pattern| without(pattern, &code));
    let (named, percent) = (found.len(), pattern(r"^(?:\\,|[~\s])*\\%"));
    for literal in pattern(LITERAL).find_iter(&code).filter(|number| is_result(number, &code)) {
        let number = literal.as_str();
        // Per cent of a ratio, such as an efficiency.
        let is_percent = percent.is_match(&text[literal.end()..]);
        let is_known = numbers.iter().any(|result| rounds_to(result, number, is_percent));
        let why = || format!("{number} is written by hand, and no result rounds to it");
        found.push((literal.start(), (!is_known).then(why)));
    }
    let (compared, by_hand) = (found.len(), found.len() - named);
    found.sort_by_key(|(at, _)| *at);
    let line = |at: usize| 1 + text[..at].matches('\n').count();
    let finding = |(at, why): &(usize, Option<String>)| {
        why.as_ref().map(|why| format!("line {}: {why}", line(*at)))
    };
    Checked { compared, by_hand, findings: found.iter().filter_map(finding).collect() }
}

/// How a text includes another. The directory of `\import` has its slash.
const INCLUDED: &str = r#"\\(?:(?:sub)?import\s*\{\s*([^}]*?)\s*\}\s*\{\s*([^}]*?)\s*\}|(?:input|include|subfile)(?:\s*\{\s*"?([^}"]*?)"?\s*\}|[ \t]+"?([^\s\\{}"]+)))"#;

/// The texts that a text includes, as it names them, without figures of a report.
pub fn included(text: &str) -> Vec<String> {
    let (code, included) = (without_comments(text), pattern(INCLUDED));
    let name = |of: Captures| of.iter().skip(1).flatten().map(|m| m.as_str()).collect::<String>();
    included.captures_iter(&code).map(name).filter(|name| !name.starts_with(r"\figures/")).collect()
}

/// In an address, `%` begins no comment.
fn without_comments(text: &str) -> String {
    without(r"(?m)%.*$", &without(r"\\(?:[\\%]|(?:url|href|path)\s*\{[^}\n]*\})", text))
}

fn pattern(text: &str) -> Regex {
    Regex::new(text).expect("a constant pattern is valid")
}

/// The text with blanks in place of a pattern, so that everything else keeps its place.
fn without(of: &str, text: &str) -> String {
    let blank = |found: &Captures| -> String {
        found[0].bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }).collect()
    };
    pattern(of).replace_all(text, blank).into_owned()
}

/// Whether digits are a number with a decimal point and three or more significant digits; one that begins with its point is not the end of
/// a word.
fn is_result(found: &Match, code: &str) -> bool {
    let number = mantissa(found.as_str()).0;
    let digits = number.trim_start_matches(['0', '.']).replace('.', "").len();
    let is_end = number.starts_with('.') && code[..found.start()].ends_with(char::is_alphanumeric);
    number.matches('.').count() == 1 && digits >= 3 && !is_end
}

/// What a definition says that the record does not say.
fn defines_otherwise(arguments: &str, numbers: &[Number]) -> Option<String> {
    let groups = arguments.split('{').skip(1).filter_map(|group| Some(group.split_once('}')?.0));
    let [key, here @ ..] = &groups.collect::<Vec<_>>()[..] else {
        return Some("\\defresult needs five arguments".to_owned());
    };
    let Some(n) = numbers.iter().find(|number| number.key == *key) else {
        return Some(format!("the record has no result {key}"));
    };
    let (there, here) = ([&n.value, &n.interval, &n.coverage, n.unit].join(" "), here.join(" "));
    (here != there).then(|| format!("{key} is {here} here and {there} in the record"))
}

/// Why a use of `\result` has no text.
fn misused(option: &str, key: &str, numbers: &[Number]) -> Option<String> {
    match (option, numbers.iter().find(|number| number.key == key)) {
        (_, None) => Some(format!("the record has no result {key}")),
        ("interval" | "coverage", Some(n)) if n.interval.is_empty() => {
            Some(format!("{key} has no interval"))
        }
        ("value" | "interval" | "coverage" | "unit", _) => None,
        _ => Some(format!("\\result has no option {option}: use value, interval, coverage, unit")),
    }
}

/// Whether a result, its interval's ends included, is this number when it is rounded to as many decimals.
fn rounds_to(number: &Number, literal: &str, is_percent: bool) -> bool {
    let (literal, mut power) = mantissa(literal);
    power -= if is_percent && number.unit.is_empty() { 2 } else { 0 };
    let decimals = literal.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let literal = &if literal.starts_with('.') { format!("0{literal}") } else { literal };
    number.interval.split("--").chain([number.value.as_str()]).any(|text| {
        let value: Result<f64, _> = text.replace(',', "").parse();
        let rounded = |value: f64| format!("{:.decimals$}", value / 10f64.powi(power));
        value.is_ok_and(|value| rounded(value) == *literal)
    })
}

/// The digits before the power of ten of a number, without separators, and that power.
fn mantissa(literal: &str) -> (String, i32) {
    let literal = literal.replace("{,}", "").replace("\\,", "").replace(['~', ','], "");
    let end = literal.find(['e', 'E', '\\', ' ']).unwrap_or(literal.len());
    let power = literal[end..].rsplit(['e', 'E', '^']).next().unwrap_or_default();
    let power = power.trim_matches(|c: char| !c.is_ascii_digit() && c != '-');
    (literal[..end].to_owned(), power.parse().unwrap_or(0))
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
        let of_second = keys.iter().filter(|key| key.contains("/projected-2/"));
        assert_eq!(of_second.count(), 4, "all numbers of the second group: {keys:?}");
        let speedup = all.iter().find(|n| n.key.ends_with("/2/projected/speedup")).unwrap();
        assert!(speedup.value.starts_with("1.3"), "{speedup:?}");
        assert!(tex(&all).contains(&format!(
            "\\defresult{{{}}}{{{}}}{{}}{{}}{{}} % over projected on 1 rank\n",
            speedup.key, speedup.value
        )));
    }

    #[test]
    fn three_digits_are_significant() {
        let shown = [0.0, 0.012345, 1.0, 99.96, 123456.0].map(digits);
        assert_eq!(shown, ["0", "0.0123", "1.00", "100.0", "123456"]);
    }

    #[test]
    fn included_texts_are_found() {
        let text = "\\input{a} % \\input{b}\n\\include{ c.tex }\\includegraphics{d}100\\% \\input\n{e}\\input{\\figures/f}\\input g.tex\n\
                    \\subfile{h}\\import{i/}{j}\\subimport{k/}{l.tex}\\input{\"m n/o\"}\\inputlineno{p}";
        let expected = ["a", "c.tex", "e", "g.tex", "h", "i/j", "k/l.tex", "m n/o"];
        assert_eq!(included(text), expected);
    }

    fn number(key: &str, value: &str, interval: &str) -> Number {
        let coverage = if interval.is_empty() { "" } else { "75" }.into();
        let [key, value, interval] = [key, value, interval].map(str::to_owned);
        Number { key, value, interval, coverage, unit: "s", ..Number::default() }
    }

    #[test]
    fn unknown_keys_old_copies_and_numbers_by_hand_are_found() {
        let record = [
            number("a/time", "1.234", "1.10--1.30"),
            number("a/speedup", "11.3", ""),
            number("a/rate", "1234.5", "9234.5--9999.5"),
        ];
        let findings = |text: &str| check(text, &record).findings;
        let right = "It takes \\result{a/time} (\\result[interval]{a/time}), 1.23 or 1.234 s, $1.23\\times10^0$ or 0.123e1 s, 1\\,234.5 or 1{,}234.5 or 1~234.5 cells, 11.3 times faster \\cite{x1.999}. \\\\% 9.99\n\
                     \\includegraphics[width=0.487\\textwidth]{fig-1.555} 1.234\\,s, 0.125pt, Section 3.4, 2013, 100\\% \\pgfplotsset{compat=1.16}\n\\\\[1.25in] \\vskip 1.25in\n\\href{http://x/1.999%20b}{b}\n\
                     \\defresult{a/time}{1.234}{1.10--1.30}{75}{s}";
        assert_eq!(check(right, &record), Checked { compared: 12, by_hand: 9, findings: vec![] });
        let others = "Rust 1.89 and 2.45 GHz % not a result\r\ndoi:10.1137/100791.634, \\doi{10.1007/s1.234}, https://doi.org/10.1145/2.345, arXiv:1706.07931v2 [cs]";
        assert_eq!(check(others, &record), Checked::default());
        let layout = "\\citep[see][Table 3.129]{x} \\cite [a] [b 3.129] {x} \\textcolor[rgb]{0.1,0.255,0.355}{a} \\rowcolor [gray] {0.905} \\def\\baselinestretch{1.255}\n\
                      \\begin{axis}[width=9cm, x=1.555,\n y=1.255]\\foo[thick,\n scale = 1.255] \\renewcommand{\\arraystretch}{1.255}\\linespread{1.255}\\scalebox{0.555}{a}";
        assert_eq!(check(layout, &record), Checked::default());
        let efficiency = [Number { unit: "", ..number("a/efficiency", "0.708", "") }];
        let right = "\\newcommand{\\T}[1]{\\result{a/#1/time}}\\definecolor{c}{rgb}{0.123,0.456,0.789} \\hspace*{9.89 cm} 70.8\\,\\%, 70.8~\\% and 0.708";
        assert_eq!(
            check(right, &efficiency),
            Checked { compared: 3, by_hand: 3, findings: vec![] }
        );
        assert_eq!(check("70.8 s, 0.71\\%", &efficiency).findings.len(), 1);
        for (text, part) in [
            ("\\result{a/tim}", "line 1: the record has no result a/tim"),
            ("x\n\\result [unit]\n{ a/tim\n}", "line 2: the record has no result a/tim"),
            ("12.34\\%", "12.34 is written by hand"),
            ("77.77\\,s", "77.77 is written by hand"),
            ("x\n1.25 s", "line 2: 1.25 is written by hand"),
            ("\\textbf{12.4}", "12.4 is written by hand"),
            (
                "\\defresult{a/time}{1.3}{1.10--1.30}{75}{s}",
                "a/time is 1.3 1.10--1.30 75 s here and 1.234 1.10--1.30 75 s in the record",
            ),
            ("\\defresult{a/time}{1.234}{1.10--1.30}{75}{ms}", "1.10--1.30 75 ms here"),
            ("$x\\in[9.87, 1.23]$", "9.87 is written by hand"),
            ("$\\left[9.87, 1.23\\right]$", "9.87 is written by hand"),
            ("1.23e5", "1.23e5 is written by hand"),
            ("$1.23\\cdot 10^{-3}$", "is written by hand"),
            ("1,001.23 s", "1,001.23 is written by hand"),
            // A part of it would do.
            ("9\\,011.3 s", "9\\,011.3 is written by hand"),
            ("8~234.5 s", "8~234.5 is written by hand"),
            ("[9.87, 1.23]", "9.87 is written by hand"),
            ("CI$_{95}[9.87, 1.23]$", "9.87 is written by hand"),
            ("\\myresult{9.87}", "9.87 is written by hand"),
            ("\\textbf{a} [1.23, 9.87]", "9.87 is written by hand"),
            ("$x\\in[0, 1)$,\n\\cite{a,\n9.87", "line 3: 9.87 is written by hand"),
            ("\\url{http://x/a%20b} 9.87", "9.87 is written by hand"),
            ("\\caption[short 9.87]{a}", "9.87 is written by hand"),
            ("\\caption[n = 3,\n9.87]{a}", "9.87 is written by hand"),
            ("\\textcolor[rgb]{1,0,0}{9.87}", "9.87 is written by hand"),
            ("\\scalebox{0.555}{9.87}", "9.87 is written by hand"),
            ("1.89 % not a result\n9.87 % no result", "line 2: 9.87 is written by hand"),
            ("9.87\\% not a result", "9.87 is written by hand"),
            ("10.1137/9 s", "10.1137 is written by hand"),
            ("\\newcommand{\\a}{9.87}", "9.87 is written by hand"),
            ("\\cite{a} [9.87,\n1.23] = [b]", "9.87 is written by hand"),
            ("\\subsection*[9.87]{a}", "9.87 is written by hand"),
            ("9.87exactly", "9.87 is written by hand"),
            ("9.87in total", "9.87 is written by hand"),
            ("a factor of .987", ".987 is written by hand"),
            ("\\result[intervall]{a/time}", "no option intervall"),
            ("\\result[interval]{a/speedup}", "a/speedup has no interval"),
            ("\\defresult{b}{1.3}{}{}{}", "no result b"),
        ] {
            let found = findings(text);
            assert!(found.len() == 1 && found[0].contains(part), "{text}: {found:?}");
        }
        assert_eq!(check("No number at all.", &record).compared, 0);
    }
}
