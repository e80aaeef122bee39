//! A table of faults, where they happened, and how the program ended.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::time::Instant;

/// Rows of one family of faults.
pub struct Table {
    rows: Vec<Row>,
    start: Instant,
}

/// Runs with one kind of fault.
pub struct Row {
    place: String,
    fault: String,
    codes: BTreeMap<String, usize>,
    seconds_max: f64,
    left: BTreeMap<String, usize>,
    wrong: Vec<String>,
}

impl Row {
    /// A row for a program or phase, and a fault.
    pub fn new(place: impl Into<String>, fault: impl Into<String>) -> Self {
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
    pub fn add(&mut self, code: Option<i32>, seconds: f64, left: &str, wrong: Option<String>) {
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
    pub fn new() -> Self {
        Self { rows: Vec::new(), start: Instant::now() }
    }

    /// Adds a row; one without runs is left out.
    pub fn push(&mut self, row: Row) {
        for wrong in &row.wrong {
            println!("wrong: {}: {}: {wrong}", row.place, row.fault);
        }
        self.rows.extend((!row.codes.is_empty()).then_some(row));
    }

    /// Prints the table.
    ///
    /// # Panics
    /// If a row is wrong, or there is none.
    pub fn finish(self, family: &str) {
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
