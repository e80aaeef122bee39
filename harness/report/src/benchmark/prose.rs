//! The numbers of a LaTeX text against a record: `harness report DIR --check paper.tex`.
//!
//! A finding is a `\result` of a key that the record does not have, a `\defresult` (in a copy of `numbers.tex`) that differs from the
//! record, or a number of three or more significant digits that is written by hand and that no result rounds to. Numbers in comments,
//! in arguments of commands that name something, and lengths are not read; years and section numbers have too few digits or no point.

use super::numbers::{Number, unit_tex};

/// What a text has.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Numbers that were compared with the record.
    pub compared: usize,
    /// What is wrong, with line numbers.
    pub findings: Vec<String>,
}

/// Compares the numbers of a text with the results of a record.
pub fn check(text: &str, numbers: &[Number]) -> Checked {
    let (mut code, mut found) = (String::new(), Vec::new());
    for line in text.lines().map(without_comment) {
        match line.trim_start().strip_prefix("\\defresult") {
            Some(arguments) => found.push((code.len(), defines_otherwise(arguments, numbers))),
            None => code += line,
        }
        code.push('\n');
    }
    found.extend(uses(&code).map(|(at, option, key)| (at, misused(option, key, numbers))));
    found.extend(literals(&code).map(|(at, literal)| {
        let is_known = numbers.iter().any(|number| rounds_to(number, literal));
        let why = || format!("{literal} is written by hand, and no result rounds to it");
        (at, (!is_known).then(why))
    }));
    found.sort_by_key(|(at, _)| *at);
    let line = |at: usize| 1 + code[..at].matches('\n').count();
    let finding = |(at, why): &(usize, Option<String>)| {
        why.as_ref().map(|why| format!("line {}: {why}", line(*at)))
    };
    Checked { compared: found.len(), findings: found.iter().filter_map(finding).collect() }
}

/// The line up to its comment.
fn without_comment(line: &str) -> &str {
    let is_start = |&(at, _): &(usize, &str)| !line[..at].ends_with('\\');
    line.match_indices('%').find(is_start).map_or(line, |(at, _)| &line[..at])
}

/// What a definition says that the record does not say.
fn defines_otherwise(arguments: &str, numbers: &[Number]) -> Option<String> {
    let groups = arguments.split('{').skip(1).filter_map(|group| Some(group.split_once('}')?.0));
    let [key, here @ ..] = &groups.collect::<Vec<_>>()[..] else {
        return Some("\\defresult needs four arguments".to_owned());
    };
    let Some(n) = numbers.iter().find(|number| number.key == *key) else {
        return Some(format!("the record has no result {key}"));
    };
    let [here, there] = [here, &[&n.value, &n.interval, &unit_tex(n)]].map(|of| of.join(" "));
    (here != there).then(|| format!("{key} is {here} here and {there} in the record"))
}

/// Why a use of `\result` has no text.
fn misused(option: &str, key: &str, numbers: &[Number]) -> Option<String> {
    match (option, numbers.iter().find(|number| number.key == key)) {
        (_, None) => Some(format!("the record has no result {key}")),
        ("interval", Some(n)) if n.interval.is_empty() => Some(format!("{key} has no interval")),
        ("value" | "interval" | "unit", _) => None,
        _ => Some(format!("\\result has no option {option}: give value, interval or unit")),
    }
}

/// Where `\result` is used, and with which option and key. White space may stand around its arguments, and ends of lines.
fn uses(code: &str) -> impl Iterator<Item = (usize, &str, &str)> {
    const COMMAND: &str = "\\result";
    code.match_indices(COMMAND).filter_map(|(at, _)| {
        let rest = code[at + COMMAND.len()..].trim_start();
        let (option, rest) = match rest.strip_prefix('[') {
            Some(option) => option.split_once(']')?,
            None => ("value", rest),
        };
        Some((at, option, rest.trim_start().strip_prefix('{')?.split_once('}')?.0.trim()))
    })
}

/// Numbers with a decimal point and three or more significant digits, as they stand in the text. Zero before the point may be missing.
fn literals(code: &str) -> impl Iterator<Item = (usize, &str)> {
    let not_part = |c: char| !c.is_ascii_digit() && c != '.';
    let is_start = move |&(at, c): &(usize, char)| {
        let before = code[..at].chars().next_back();
        let is_point = c == '.' && code[at + 1..].starts_with(|c: char| c.is_ascii_digit());
        (c.is_ascii_digit() || is_point && before.is_none_or(|c| !c.is_alphanumeric()))
            && before.is_none_or(not_part)
    };
    let starts = code.char_indices().filter(is_start);
    starts.filter_map(move |(at, _)| {
        let end = code[at..].find(not_part).map_or(code.len(), |length| at + length);
        let literal = code[at..end].trim_end_matches('.');
        let digits = literal.trim_start_matches(['0', '.']).replace('.', "").len();
        let is_number = literal.matches('.').count() == 1 && digits >= 3;
        let line = code[..at].rfind('\n').map_or(0, |end| end + 1);
        (is_number && !is_length(&code[end..]) && !is_name(&code[line..at]))
            .then_some((at, literal))
    })
}

/// Whether a unit of TeX follows, or a length such as `\textwidth`.
fn is_length(rest: &str) -> bool {
    let units = ["pt", "cm", "mm", "in", "em", "ex", "bp"];
    let ends = ["width", "height", "size", "skip", "sep", "indent", "unitlength"];
    let command = rest.strip_prefix('\\').unwrap_or_default();
    let name = command.split(|c: char| !c.is_ascii_alphabetic()).next().unwrap_or_default();
    units.iter().any(|unit| rest.starts_with(unit)) || ends.iter().any(|end| name.ends_with(end))
}

/// Whether the begin of a line ends within an option `[...]` of a command, or within the argument of a command that names a label, a file or a
/// source.
fn is_name(before: &str) -> bool {
    const NAMING: &str = "label ref cite input result includegraphics url usepackage bibitem";
    let opened = |open: char, close: char| {
        let at = before.rfind(open).filter(|&at| !before[at..].contains(close));
        at.map(|at| &before[..at])
    };
    let is_command = |text: &str| {
        let name = text.trim_end_matches(|c: char| c.is_ascii_alphabetic() || c == '*');
        text.ends_with(['}', ']']) || name.len() < text.len() && name.ends_with('\\')
    };
    let names = |command: &str| {
        let command = command
            .strip_suffix(']')
            .and_then(|text| text.rsplit_once('['))
            .map_or(command, |c| c.0);
        NAMING.split(' ').any(|name| command.ends_with(name))
    };
    opened('[', ']').is_some_and(is_command) || opened('{', '}').is_some_and(names)
}

/// Whether a result, its interval's ends included, is this number when it is rounded to as many decimals.
fn rounds_to(number: &Number, literal: &str) -> bool {
    let decimals = literal.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let literal =
        &if literal.starts_with('.') { format!("0{literal}") } else { literal.to_owned() };
    let ends = number.interval.split("--");
    ends.chain([number.value.as_str()]).any(|text| {
        let value: Result<f64, _> = text.replace(',', "").parse();
        value.is_ok_and(|value| text == *literal || format!("{value:.decimals$}") == *literal)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(key: &str, value: &str, interval: &str) -> Number {
        Number { key: key.into(), value: value.into(), interval: interval.into(), unit: "s" }
    }

    #[test]
    fn unknown_keys_old_copies_and_numbers_by_hand_are_found() {
        let record = [number("a/time", "1.234", "1.10--1.30"), number("a/speedup", "11.3", "")];
        let findings = |text: &str| check(text, &record).findings;
        let right = "It takes \\result{a/time} (\\result[interval]{a/time}), 1.23 or 1.234 s, 11.3 times faster \\cite{x1.999}. % 9.99\n\
                     \\includegraphics[width=0.487\\textwidth]{fig-1.555} 1.234\\,s, 0.125pt, Section 3.4, 2013, 100\\%\n\
                     \\defresult{a/time}{1.234}{1.10--1.30}{s}";
        assert_eq!(check(right, &record), Checked { compared: 7, findings: vec![] });
        for (text, part) in [
            ("\\result{a/tim}", "line 1: the record has no result a/tim"),
            ("x\n\\result [unit]\n{ a/tim\n}", "line 2: the record has no result a/tim"),
            ("12.34\\%", "12.34 is written by hand"),
            ("77.77\\,s", "77.77 is written by hand"),
            ("x\n1.25 s", "line 2: 1.25 is written by hand"),
            ("\\textbf{12.4}", "12.4 is written by hand"),
            (
                "\\defresult{a/time}{1.3}{1.10--1.30}{s}",
                "a/time is 1.3 1.10--1.30 s here and 1.234 1.10--1.30 s in the record",
            ),
            ("\\defresult{a/time}{1.234}{1.10--1.30}{ms}", "1.10--1.30 ms here"),
            ("[9.87, 1.23]", "9.87 is written by hand"),
            ("\\textbf{a} [1.23, 9.87]", "9.87 is written by hand"),
            ("$x\\in[0, 1)$,\n\\cite{a,\n9.87", "line 3: 9.87 is written by hand"),
            ("a factor of .987", ".987 is written by hand"),
            ("\\result[intervall]{a/time}", "no option intervall"),
            ("\\result[interval]{a/speedup}", "a/speedup has no interval"),
            ("\\defresult{b}{1.3}{}{}", "no result b"),
        ] {
            let found = findings(text);
            assert!(found.len() == 1 && found[0].contains(part), "{text}: {found:?}");
        }
        assert_eq!(check("No number at all.", &record).compared, 0);
    }
}
