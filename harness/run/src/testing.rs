//! Data for the tests of this crate and of those that depend on it.

use crate::engine::layout::{Layout, Ranks};
use crate::verify::options::Options;
use crate::verify::report::{
    Asked, CaseReport, Check, Missing, Outcome, RUNS, Report, Run, SCHEMA,
};

/// A check of a run with this layout.
pub(crate) fn of_layout(layout: &Layout, name: &str, outcome: Outcome) -> Check {
    Check { ranks: layout.rank_count(), ..Check::new(layout.to_string(), name, outcome) }
}

/// A report with one entry of every kind, also for the tests of the output formats.
pub fn report() -> Report {
    let layout = Layout {
        partitioner: Some("metis".into()),
        level_base: Some("auto".into()),
        ..Layout::on(Ranks::Mpi(4))
    };
    let run = Run {
        program: "mesher".into(),
        layout: None,
        cells: 7600,
        digest: "0".repeat(32),
        time_wall_s: 0.1,
        is_time_reported: true,
        time_process_s: 0.2,
        peak_rss_bytes: Some(76_000),
    };
    let on_ranks = Run { layout: Some(layout.clone()), time_wall_s: 0.05, ..run.clone() };
    let mut sides = Check::new("serial", "oracles", Outcome::held(7600));
    sides.notes.push("open3d was wrong at 1 point".into());
    let case = CaseReport {
        name: "cube_small".into(),
        facets: 12,
        leaves_base: 5000,
        cells: 7600,
        runs: vec![run, on_ranks],
        checks: vec![
            sides,
            of_layout(&layout, RUNS, Outcome::held(2)),
            of_layout(&layout, "same leaves", Outcome::fail("first difference <at> root")),
            Check::new("p4est", "balance", Outcome::left_out("the engine is not built")),
        ],
        kept: Some("out/cube_small".into()),
        repeat_with: Some("harness verify cube_small --ranks 4".into()),
        time_s: 1.5,
        ..CaseReport::default()
    };
    let missing =
        Missing { what: "p4est".into(), why: "the engine is not built".into(), required: false };
    Report {
        schema: SCHEMA.into(),
        program: "harness 0".into(),
        cores: 2,
        asked: Asked {
            cases: vec!["cube_small".into()],
            ranks: vec![4],
            subjects: vec!["p4est".into()],
            ..Asked::default()
        },
        missing: vec![missing],
        cases: vec![case],
        interrupted: false,
        time_s: 2.0,
    }
}

/// Options of the smallest possible verification.
pub fn options() -> Options {
    Options::of_leaves_alone(Vec::new())
}
