//! Parses the output of valgrind's callgrind: instructions by function.
//!
//! The format: `fn=(1) name` opens a function, and later `fn=(1)` is the same; a line that begins with a
//! position (`12`, `+3`, `-1`, `*`) has the function's own cost; after a `calls=COUNT ...` line the next such line is
//! the cost of the callee, which is not the function's own.

use super::measures::Numbers;
use std::collections::{BTreeSet, HashMap};

/// The sum of the profiles of a run's processes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// Instructions by function, excluding callees.
    pub own: Numbers,
}

impl Profile {
    /// Returns the number of instructions.
    pub fn instructions(&self) -> u64 {
        self.own.values().sum()
    }

    /// Adds the content of a callgrind file. A process that was replaced by another program has no costs.
    pub fn add(&mut self, text: &str) {
        let mut names: HashMap<&str, &str> = HashMap::new();
        let (mut function, mut after_calls) = ("", false);
        for line in text.lines() {
            if let Some(rest) = line.strip_prefix("fn=") {
                function = name_of(rest, &mut names);
            } else if let Some(rest) = line.strip_prefix("cfn=") {
                name_of(rest, &mut names);
            } else if line.starts_with("calls=") {
                after_calls = true;
            } else if is_cost(line) && !std::mem::take(&mut after_calls) {
                let cost = line.split_whitespace().nth(1).and_then(|cost| cost.parse().ok());
                *self.own.entry(function.to_owned()).or_default() += cost.unwrap_or(0);
            }
        }
    }
}

/// Returns the differences of instructions by function, largest first.
pub fn differences(old: &Numbers, new: &Numbers) -> Vec<(String, i64)> {
    let names: BTreeSet<&String> = old.keys().chain(new.keys()).collect();
    let of = |numbers: &Numbers, name: &String| numbers.get(name).copied().unwrap_or(0) as i64;
    let by = |name: &String| (name.clone(), of(new, name) - of(old, name));
    let mut all: Vec<(String, i64)> =
        names.into_iter().map(by).filter(|(_, by)| *by != 0).collect();
    all.sort_by_key(|(_, by)| std::cmp::Reverse(by.abs()));
    all
}

/// Whether a line begins with a position.
fn is_cost(line: &str) -> bool {
    line.starts_with(|c: char| c.is_ascii_digit() || "+-*".contains(c))
}

/// `(12) name` defines, `(12)` refers.
fn name_of<'a>(text: &'a str, names: &mut HashMap<&'a str, &'a str>) -> &'a str {
    match text.split_once(") ") {
        Some((number, name)) => {
            names.insert(number, name);
            name
        }
        None => names.get(text.trim_end_matches(')')).copied().unwrap_or(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "version: 1\nevents: Ir\n\nfl=(1) a.rs\nfn=(1) main\n12 3\n+1 4\ncfn=(2) malloc@GLIBC\n\
                        calls=5 0\n* 100\n* 2\n\nfn=(2)\n0 100\ncfn=(3) _int_malloc\ncalls=5 +3\n0 7\nfn=(3)\n0 7\n\
                        totals: 116\n";

    fn profile(files: &[&str]) -> Profile {
        let mut profile = Profile::default();
        files.iter().for_each(|file| profile.add(file));
        profile
    }

    #[test]
    fn own_costs_add_up_to_the_reported_total() {
        let one = profile(&[FILE]);
        assert_eq!(one.instructions(), 116);
        assert_eq!((one.own["main"], one.own["malloc@GLIBC"]), (9, 100));
        assert_eq!(profile(&["events: Ir\n"]), Profile::default());
        let sum = profile(&[FILE, FILE]);
        assert_eq!((sum.instructions(), sum.own["main"]), (232, 18));
    }

    #[test]
    fn differences_are_sorted_by_size() {
        let other = FILE.replace("12 3", "12 30").replace("\n0 7\ntotals", "\n0 5\ntotals");
        let found = differences(&profile(&[FILE]).own, &profile(&[&other]).own);
        assert_eq!(found, [("main".to_owned(), 27), ("_int_malloc".to_owned(), -2)]);
    }
}
