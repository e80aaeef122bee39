//! Parses the output of valgrind's callgrind: instructions and calls by function.
//!
//! The format: `fn=(1) name` opens a function, and later `fn=(1)` is the same; a line that begins with a
//! position (`12`, `+3`, `-1`, `*`) has the function's own cost; after a `calls=COUNT ...` line the next such line is
//! the cost of the callee, which is not the function's own.

use std::collections::HashMap;

/// The profile of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// Total number of instructions.
    pub instructions: u64,
    /// Instructions by function, excluding callees.
    pub own: HashMap<String, u64>,
    /// Number of calls by function.
    pub calls: HashMap<String, u64>,
}

/// Functions that allocate memory.
const ALLOCATORS: [&str; 5] = ["malloc", "calloc", "realloc", "posix_memalign", "aligned_alloc"];

impl Profile {
    /// Returns the number of allocations.
    pub fn allocations(&self) -> u64 {
        ALLOCATORS.iter().filter_map(|name| self.calls.get(*name)).sum()
    }

    /// Adds the profile of another process.
    pub fn add(&mut self, other: &Self) {
        self.instructions += other.instructions;
        for (of, more) in [(&mut self.own, &other.own), (&mut self.calls, &other.calls)] {
            for (name, count) in more {
                *of.entry(name.clone()).or_default() += count;
            }
        }
    }

    /// Parses a callgrind file. A process that was replaced by another program has no costs.
    pub fn parse(text: &str) -> Self {
        let mut profile = Self::default();
        let mut names: HashMap<&str, &str> = HashMap::new();
        let (mut function, mut callee) = ("", "");
        let mut after_calls = false;
        for line in text.lines() {
            if let Some(rest) = line.strip_prefix("fn=") {
                function = name_of(rest, &mut names);
            } else if let Some(rest) = line.strip_prefix("cfn=") {
                callee = name_of(rest, &mut names);
            } else if let Some(rest) = line.strip_prefix("calls=") {
                let count: u64 = first_number(rest);
                // Versions of a symbol of the C library are one function.
                let plain =
                    callee.split('@').next().unwrap_or(callee).split('\'').next().unwrap_or(callee);
                *profile.calls.entry(plain.to_owned()).or_default() += count;
                after_calls = true;
            } else if is_cost(line) && !std::mem::take(&mut after_calls) {
                let cost = line.split_whitespace().nth(1).map_or(0, first_number);
                *profile.own.entry(function.to_owned()).or_default() += cost;
                profile.instructions += cost;
            }
        }
        profile
    }

    /// Returns the differences of instructions by function relative to an older profile, largest first.
    pub fn grown_since(&self, old: &Self) -> Vec<(String, i64)> {
        let mut names: Vec<&String> = self.own.keys().chain(old.own.keys()).collect();
        names.sort();
        names.dedup();
        let of = |profile: &Self, name| profile.own.get(name).copied().unwrap_or(0) as i64;
        let mut grown: Vec<(String, i64)> =
            names.into_iter().map(|name| (name.clone(), of(self, name) - of(old, name))).collect();
        grown.sort_by_key(|(_, by)| std::cmp::Reverse(by.abs()));
        grown.retain(|(_, by)| *by != 0);
        grown
    }
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

fn first_number(text: &str) -> u64 {
    let digits = text.split(|c: char| !c.is_ascii_digit()).next();
    digits.and_then(|digits| digits.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "version: 1\nevents: Ir\n\nfl=(1) a.rs\nfn=(1) main\n12 3\n+1 4\ncfn=(2) malloc@GLIBC\n\
                        calls=5 0\n* 100\n* 2\n\nfn=(2)\n0 100\ncfn=(3) _int_malloc\ncalls=5 +3\n0 7\nfn=(3)\n0 7\n\
                        totals: 116\n";

    #[test]
    fn own_costs_add_up_to_the_reported_total() {
        let profile = Profile::parse(FILE);
        assert_eq!(profile.instructions, 116);
        assert_eq!((profile.own["main"], profile.own["malloc@GLIBC"]), (9, 100));
        assert_eq!((profile.calls["malloc"], profile.allocations()), (5, 5));
        assert_eq!(Profile::parse("events: Ir\n"), Profile::default());
    }

    #[test]
    fn profiles_of_several_processes_add_up() {
        let mut sum = Profile::parse(FILE);
        sum.add(&Profile::parse(FILE));
        assert_eq!((sum.instructions, sum.own["main"], sum.allocations()), (232, 18, 10));
    }

    #[test]
    fn differences_are_sorted_by_size() {
        let old = Profile::parse(FILE);
        let new = Profile::parse(
            &FILE.replace("12 3", "12 30").replace("\n0 7\ntotals", "\n0 5\ntotals"),
        );
        assert_eq!(
            new.grown_since(&old),
            [("main".to_owned(), 27), ("_int_malloc".to_owned(), -2)]
        );
    }
}
