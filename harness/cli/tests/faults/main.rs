//! Faults: calls of the system that fail, ranks that are killed or stopped, programs that hang, flood or lie, a clock that jumps, a network
//! that is cut. Every run ends in a stated time with one sentence and a documented exit code, and leaves no unfinished file.
//!
//! Each test prints a table. `ci/faults` sets `FAULTS` to a number of calls that fail per program and fault, and tries all other faults;
//! without it a sample of each kind is tried.

mod calls;
mod clock;
mod liars;
mod network;
mod phases;
mod place;
mod programs;
mod tools;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::time::Instant;

#[test]
fn a_call_that_fails_ends_every_program_without_unfinished_files() {
    calls::family();
}

#[test]
fn a_rank_that_fails_in_any_phase_ends_its_job_without_a_mesh() {
    phases::family();
}

#[test]
fn programs_that_hang_flood_or_lie_are_ended_and_reported() {
    liars::family();
}

#[test]
fn a_clock_that_jumps_changes_neither_limits_nor_durations() {
    clock::family();
}

#[test]
fn ranks_that_a_network_cuts_off_end_without_a_mesh() {
    network::family();
}

/// A table of faults, where they happened, and how the program ended: the rows of one family.
struct Table {
    rows: Vec<Row>,
    start: Instant,
}

/// Runs with one kind of fault.
struct Row {
    place: String,
    fault: String,
    codes: BTreeMap<String, usize>,
    seconds_max: f64,
    left: BTreeMap<String, usize>,
    wrong: Vec<String>,
}

impl Row {
    /// A row for a program or phase, and a fault.
    fn new(place: impl Into<String>, fault: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            fault: fault.into(),
            codes: BTreeMap::new(),
            seconds_max: 0.0,
            left: BTreeMap::new(),
            wrong: Vec::new(),
        }
    }

    /// Adds a run: its exit code, its time, what it left, and what is wrong with it.
    fn add(&mut self, code: Option<i32>, seconds: f64, left: &str, wrong: Option<String>) {
        let code = code.map_or("signal".to_owned(), |code| code.to_string());
        *self.codes.entry(code).or_default() += 1;
        self.seconds_max = self.seconds_max.max(seconds);
        *self.left.entry(left.to_owned()).or_default() += 1;
        self.wrong.extend(wrong);
    }
}

fn counted(counts: &BTreeMap<String, usize>) -> String {
    let one = |(what, count): (&String, &usize)| match counts.len() {
        1 => what.clone(),
        _ => format!("{what} ({count})"),
    };
    counts.iter().map(one).collect::<Vec<_>>().join(", ")
}

impl Table {
    /// A table without rows.
    fn new() -> Self {
        Self { rows: Vec::new(), start: Instant::now() }
    }

    /// Adds a row; one without runs is left out.
    fn push(&mut self, row: Row) {
        for wrong in &row.wrong {
            println!("wrong: {}: {}: {wrong}", row.place, row.fault);
        }
        self.rows.extend((!row.codes.is_empty()).then_some(row));
    }

    /// Prints the table.
    ///
    /// # Panics
    /// If a row is wrong, or there is none.
    fn finish(self, family: &str) {
        let runs: usize = self.rows.iter().flat_map(|row| row.codes.values()).sum();
        let wrong: usize = self.rows.iter().map(|row| row.wrong.len()).sum();
        let mut text = format!(
            "\n| {family} | fault | runs | exit code | longest, s | left | as documented |\n"
        );
        text += "|---|---|---:|---|---:|---|---|\n";
        for Row { place, fault, codes, seconds_max, left, wrong } in &self.rows {
            let runs: usize = codes.values().sum();
            let (codes, left) = (counted(codes), counted(left));
            let verdict =
                if wrong.is_empty() { "yes".to_owned() } else { format!("no ({})", wrong.len()) };
            let _ = writeln!(
                text,
                "| {place} | {fault} | {runs} | {codes} | {seconds_max:.2} | {left} | {verdict} |"
            );
        }
        let seconds = self.start.elapsed().as_secs();
        println!("{text}\n{family}: {runs} runs in {seconds} s, {wrong} wrong");
        assert!(runs > 0, "{family}: nothing was run");
        assert!(wrong == 0, "{family}: {wrong} runs did not end as documented");
    }
}
