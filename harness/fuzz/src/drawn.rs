//! Many whole cases without libFuzzer, each drawn from its number: several times as many in a second of CPU time.

use crate::targets::whole_case::{self, Tried};
use mesher::input::lattice::Keep;
use std::collections::BTreeMap;
use std::fmt;
use std::panic::catch_unwind;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use std::{process, thread};

/// Numbers of cases by what they have.
#[derive(Debug, Default)]
pub struct Counts {
    cases: u64,
    leaves: u64,
    /// By a property that a case may have.
    having: Vec<(&'static str, u64)>,
    /// By the level of the finest leaves.
    deepest: BTreeMap<u64, u64>,
    /// By the least power of 8 that is not less than the number of leaves.
    leaves_up_to: BTreeMap<u64, u64>,
    /// By the number of simulated ranks.
    ranks: BTreeMap<usize, u64>,
}

/// The case that is tried.
static TRIED: AtomicU64 = AtomicU64::new(0);
/// No case takes as long.
const LIMIT: Duration = Duration::from_secs(60);

/// Ends the program when a case takes too long, which no other limit would find.
fn watch() {
    loop {
        let number = TRIED.load(Ordering::Relaxed);
        thread::sleep(LIMIT);
        if TRIED.load(Ordering::Relaxed) == number {
            eprintln!("case {number} takes longer than {} s", LIMIT.as_secs());
            process::exit(1);
        }
    }
}

/// Tries the cases from `first` on. The case of a number is that of the target `whole-case` with the number's eight bytes, the lowest first.
///
/// # Errors
/// The number of the first case that found a fault, whose message has been printed.
pub fn run(first: u64, count: u64) -> Result<Counts, u64> {
    let mut counts = Counts::default();
    TRIED.store(first, Ordering::Relaxed);
    thread::spawn(watch);
    for number in first..first.saturating_add(count) {
        TRIED.store(number, Ordering::Relaxed);
        let tried = catch_unwind(|| whole_case::tried(&number.to_le_bytes())).or(Err(number))?;
        counts.add(&tried);
    }
    Ok(counts)
}

impl Counts {
    fn add(&mut self, Tried { case, run, mesh }: &Tried) {
        self.cases += 1;
        *self.ranks.entry(run.ranks).or_default() += 1;
        let words = mesh.as_ref().map_or(&[][..], |mesh| &mesh.words);
        let level = |word: u64| word >> 2 & 31;
        let volume: u64 = words.iter().map(|&word| 1 << (57 - 3 * level(word))).sum();
        let levels = words.iter().fold(0u32, |levels, &word| levels | 1 << level(word));
        let summary = mesh.as_ref().map(|mesh| mesh.summary);
        let components = |at_least: fn(u64, u64) -> bool| {
            summary.is_some_and(|summary| at_least(summary.outside, summary.inside))
        };
        let properties = [
            ("seeds", !case.seeds.is_empty()),
            ("refused for a seed", mesh.is_none()),
            ("no facets", case.facets.is_empty()),
            ("extent boxes", !case.boxes.is_empty()),
            (
                "a box finer than the surface",
                case.boxes.iter().any(|b| b.spacing < case.spacing_min / 2.0),
            ),
            ("layers of more than one cell", case.layer_cells_min > 1),
            ("keep = outside", case.keep == Keep::Outside),
            ("keep = inside", case.keep == Keep::Inside),
            ("keep = all", case.keep == Keep::All),
            ("crossing leaves deleted", !case.keep_crossing),
            ("crossing leaves in the mesh", words.iter().any(|word| word & 3 == 2)),
            (
                "components outside and inside",
                components(|outside, inside| outside > 0 && inside > 0),
            ),
            ("three components or more", components(|outside, inside| outside + inside > 2)),
            ("enclosed components", summary.is_some_and(|s| s.enclosed.count > 0)),
            (
                "components decided by majority (leaks)",
                summary.is_some_and(|s| s.ambiguous.count > 0),
            ),
            (
                "inside reaches the root's boundary",
                summary.is_some_and(|s| s.inside_reaches_boundary),
            ),
            ("deleted leaves", mesh.is_some() && volume < 1 << 57),
            ("no leaf kept", mesh.is_some() && words.is_empty()),
            ("one leaf", words.len() == 1),
            ("leaves of three levels or more", levels.count_ones() > 2),
            ("several ranks", run.ranks > 1),
            ("a given base level", run.division.level_base.is_some()),
        ];
        self.having.resize(properties.len(), ("", 0));
        for (counted, (property, has)) in self.having.iter_mut().zip(properties) {
            *counted = (property, counted.1 + u64::from(has));
        }
        self.leaves += words.len() as u64;
        *self
            .deepest
            .entry(words.iter().map(|&word| level(word)).max().unwrap_or(0))
            .or_default() += 1;
        let up_to = (0..).map(|power| 8u64.pow(power)).find(|&up_to| words.len() as u64 <= up_to);
        *self.leaves_up_to.entry(up_to.expect("fewer leaves than 2^57")).or_default() += 1;
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = |f: &mut fmt::Formatter<'_>, what: &dyn fmt::Display, cases: u64| {
            let percent = 100.0 * cases as f64 / self.cases as f64;
            writeln!(f, "{what:<44} {cases:>9} {percent:>6.2} %")
        };
        writeln!(
            f,
            "{} cases, {:.0} leaves on average",
            self.cases,
            self.leaves as f64 / self.cases as f64
        )?;
        for &(property, cases) in &self.having {
            row(f, &property, cases)?;
        }
        for (level, &cases) in &self.deepest {
            row(f, &format!("level of the finest leaves: {level}"), cases)?;
        }
        for (leaves, &cases) in &self.leaves_up_to {
            row(f, &format!("leaves: at most {leaves}"), cases)?;
        }
        for (ranks, &cases) in &self.ranks {
            row(f, &format!("ranks: {ranks}"), cases)?;
        }
        Ok(())
    }
}
