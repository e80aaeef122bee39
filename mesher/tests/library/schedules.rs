//! The mesh does not depend on the schedule: drawn schedules of 2 to 64 ranks, compared with the serial mesh.
//!
//! The number of a schedule determines its case, rank count, division and adversary. `SCHEDULES` is the number of
//! schedules, `SCHEDULES_FIRST` the number of the first one; `ci/schedules` runs many of them.

use crate::support::schedules::{Meshed, Serial, case, cases, drawn, run_words, write};
use crate::support::{Run, first_difference, run};
use cpu_time::ProcessTime;
use mesher::error::Error;
use mesher::partition::{Division, Partitioner};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Schedules of each case.
const PER_CASE: u64 = 64;
/// Greatest number of cells in a case.
const CELLS: usize = 1000;
/// One in this many schedules runs all phases, with the invariants checked after each; the others end with the leaves.
const WHOLE: u64 = 16;

fn from_env(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |n| n.parse().expect("a number of schedules"))
}

/// Run configurations with 2 to 64 ranks, mostly few: they take the least time, and each order is more likely. METIS is seldom used, because
/// it takes longer than a small mesh and sends nothing.
fn runs() -> impl Strategy<Value = Run> {
    let ranks = prop_oneof![30 => 2usize..5, 10 => 5usize..10, 2 => 10usize..25, 1 => 25usize..65];
    let with_metis = prop::bool::weighted(0.1);
    (run(), ranks, with_metis).prop_map(|(run, ranks, with_metis)| {
        let partitioner = if with_metis { Partitioner::Metis } else { Partitioner::Morton };
        Run { ranks, division: Division { partitioner, ..run.division }, ..run }
    })
}

#[test]
fn schedules_do_not_change_the_mesh() {
    let (first, count) = (from_env("SCHEDULES_FIRST", 0), from_env("SCHEDULES", 2000));
    let (cases, runs) = (cases(), runs().boxed());
    let mut serial: Option<(u64, Serial)> = None;
    let (mut by_ranks, mut cells, mut refused) = (BTreeMap::<usize, u64>::new(), 0, 0);
    let started = ProcessTime::now();
    for number in first..first + count {
        let of_case = number / PER_CASE;
        let (_, serial) = match serial.take_if(|s| s.0 == of_case) {
            Some(same) => serial.insert(same),
            None => serial.insert((of_case, case(&cases, of_case, CELLS))),
        };
        let run = drawn(&runs, number);
        let whole = number % WHOLE == 0;
        let got = catch_unwind(AssertUnwindSafe(|| serial.on_seed(&run, whole)));
        if !got.as_ref().is_ok_and(|got| serial.equals(got)) {
            panic!("{}", explain(number, serial, &run, got.ok()));
        }
        *by_ranks.entry(run.ranks.next_power_of_two()).or_default() += 1;
        cells += serial.meshed.as_ref().map_or(0, |m| m.outcome.words.len());
        refused += u64::from(serial.meshed.is_err());
    }
    let cpu_s = started.elapsed().as_secs_f64();
    println!(
        "schedules {first} to {}: {count} schedules of {} cases, {:.0} cells on average, {refused} schedules of refused cases; {cpu_s:.1} s of CPU time, {:.3} ms per schedule",
        first + count - 1,
        count.div_ceil(PER_CASE),
        cells as f64 / count as f64,
        1e3 * cpu_s / count as f64,
    );
    let ranges = by_ranks.iter().map(|(up_to, n)| format!("up to {up_to} ranks: {n}"));
    println!("{}", ranges.collect::<Vec<_>>().join(", "));
}

/// What failed, and the commands that repeat it.
fn explain(number: u64, serial: &Serial, run: &Run, got: Option<Result<Meshed, Error>>) -> String {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("schedules");
    let path = write(&serial.small, &folder, &format!("case-{number}"));
    let path = path.display();
    let what = match (&serial.meshed, got) {
        (_, None) => "a rank panicked".to_owned(),
        (Ok(want), Some(Ok(got))) => {
            format!(
                "{}; {:?}",
                first_difference(&got.outcome.words, &want.outcome.words),
                got.reported
            )
        }
        (want, Some(got)) => {
            let error = |m: &Result<Meshed, Error>| m.as_ref().err().map(Error::to_string);
            format!("errors {:?} and {:?}", error(&got), error(want))
        }
    };
    format!(
        "schedule {number} (seed {}, {} ranks) and the serial mesher differ: {what}\n\
         repeat it: ci/schedules 1 {number}\n\
         or: cargo run --release --bin mesher -- {path} {}\n\
         and compare with: cargo run --release --bin mesher -- {path} --comm solo",
        run.seed,
        run.ranks,
        run_words(run),
    )
}
