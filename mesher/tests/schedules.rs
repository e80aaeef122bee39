//! The mesh does not depend on the schedule: drawn schedules of 2 to 64 ranks, compared with the serial mesh.
//!
//! The number of a schedule determines its case, rank count, division and adversary. `SCHEDULES` is the number of
//! schedules, `SCHEDULES_FIRST` the number of the first one; `ci/schedules` runs many of them.
#![allow(missing_docs)]

mod support;

use cpu_time::ProcessTime;
use mesher::error::Error;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use support::fibres::Fibres;
use support::schedules::{Meshed, Serial, case, cases, drawn, words, write};
use support::{Run, run};

/// Schedules of each case.
const PER_CASE: u64 = 32;
/// Greatest number of cells in a case.
const CELLS: u64 = 2000;
/// One in this many schedules runs with the invariants checked after each phase.
const CHECKED: u64 = 8;

fn from_env(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |n| n.parse().expect("a number of schedules"))
}

/// Run configurations with 2 to 64 ranks, mostly few.
fn runs() -> impl Strategy<Value = Run> {
    let ranks = prop_oneof![6 => 2usize..5, 4 => 5usize..10, 2 => 10usize..25, 1 => 25usize..65];
    (run(), ranks).prop_map(|(run, ranks)| Run { ranks, ..run })
}

#[test]
fn schedules_do_not_change_the_mesh() {
    let (first, count) = (from_env("SCHEDULES_FIRST", 0), from_env("SCHEDULES", 2000));
    let (cases, runs) = (cases().boxed(), runs().boxed());
    let mut fibres = Fibres::default();
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
        let check = number % CHECKED == 0;
        let got = catch_unwind(AssertUnwindSafe(|| serial.on_seed(&mut fibres, &run, check)));
        if !got.as_ref().is_ok_and(|got| *got == serial.meshed) {
            panic!("{}", explain(number, serial, &run, got.ok()));
        }
        *by_ranks.entry(run.ranks.next_power_of_two()).or_default() += 1;
        cells += serial.meshed.as_ref().map_or(0, |m| m.cells);
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
    format!(
        "schedule {number} (seed {}, {} ranks): expected {:?}, {}\n\
         repeat it: ci/schedules 1 {number}\n\
         or: cargo run --release --bin mesher -- {path} {}\n\
         and compare with: cargo run --release --bin mesher -- {path} --comm solo",
        run.seed,
        run.ranks,
        serial.meshed,
        got.map_or("the ranks panicked".to_owned(), |got| format!("got {got:?}")),
        words(run),
    )
}
