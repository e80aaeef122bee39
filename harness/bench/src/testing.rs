//! Data for tests, here and in the crates that build on this one.

use crate::experiments::entry::{Comm, Entry, Line, Phase, Run, SCHEMA, Setup, Spread};
use crate::study::Study;
use crate::track::history::Record;
use std::collections::BTreeMap;

/// Returns a run with the given number of cells and useful times by phase and rank.
pub fn run(comm: Comm, cells: u64, useful: &[(&str, &[f64])]) -> Run {
    let ranks = useful[0].1.len();
    let total: Vec<f64> = (0..ranks).map(|r| useful.iter().map(|p| p.1[r]).sum()).collect();
    let phase = |(name, u): &(&str, &[f64])| Phase {
        name: (*name).to_owned(),
        useful_s: Spread::of(u),
        wall_s: Spread::of(u),
        messages: Spread::of(&vec![0.0; ranks]),
        message_bytes: Spread::of(&vec![0.0; ranks]),
    };
    let phases: Vec<Phase> = useful.iter().map(phase).collect();
    Run {
        setup: Setup {
            experiment: "strong".into(),
            engine: "mesher".into(),
            case: "cube".into(),
            spacing_min: 0.1,
            layer_cells_min: 4,
            ranks,
            comm,
            partitioner: "metis".into(),
            weights: "area".into(),
            ..Setup::default()
        },
        repeat: 0,
        warm_up: false,
        oversubscribed: false,
        command: "mesher".into(),
        program: String::new(),
        facets: 12,
        inputs: String::new(),
        scripts: String::new(),
        geometry: None,
        cells,
        digest: "0".repeat(32),
        time_wall_s: phases.iter().map(|p| p.useful_s.max).sum(),
        time_launch_s: phases.iter().map(|p| p.useful_s.max).sum(),
        time_cpu_s: total.iter().sum(),
        peak_rss_bytes: Spread::of(&vec![1e6; ranks]),
        useful_s: Spread::of(&total),
        phases,
        counters: Default::default(),
    }
}

/// Returns a line of a record.
pub fn line(entry: Entry) -> Line {
    Line { schema: SCHEMA.into(), session: "s".into(), time_utc: "t".into(), entry }
}

/// Returns a history of 30 commits in which `uav/words` grows by a tenth at commit 20, with noise below one percent.
pub fn history() -> Vec<Record> {
    let record = |i: usize| {
        let noise = (i * 7919 % 13) as f64 / 13.0;
        let words = if i < 20 { 1000.0 } else { 1100.0 } + 8.0 * noise;
        let metrics =
            BTreeMap::from([("uav/words".to_owned(), words), ("uav/cells".to_owned(), 8.0)]);
        let commit = format!("{i:040x}");
        Record {
            time: Some(format!("2026-01-{:02}T00:00:00Z", i + 1).parse().unwrap()),
            subject: "<b>".into(),
            metrics,
            ..Record::new(commit)
        }
    };
    (0..30).map(record).collect()
}

/// Returns the study declared by a file with this text.
///
/// # Errors
/// As [`Study::read`], with `FILE` instead of the path.
pub fn study(text: &str) -> Result<Study, String> {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("study.toml");
    std::fs::write(&path, text).unwrap();
    Study::read(&path).map_err(|why| why.replace(&path.display().to_string(), "FILE"))
}
