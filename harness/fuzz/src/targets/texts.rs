//! Files of the harness in TOML and JSON.

use crate::Scratch;
use bench::experiments::entry;
use bench::gate::Rules;
use bench::gate::measures::Measures;
use bench::track::history::{self, Record};
use contract::catalogue::{Catalogue, Size};
use run::engine::description::Description;
use run::engine::paths::Paths;
use run::engine::report::RunReport;
use std::sync::LazyLock;

static PATHS: LazyLock<Paths> = LazyLock::new(Paths::find);

/// An engine file, with its promises.
pub(super) fn engine(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let path = scratch.file("engine.toml", bytes);
    Description::find(&path.to_string_lossy(), &PATHS).is_ok()
}

/// The rules of `harness gate`.
pub(super) fn rules(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    Rules::read(scratch.file("rules.toml", bytes)).is_ok()
}

/// The file of `harness bench`.
pub(super) fn targets(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    bench::study::Study::read(scratch.file("targets.toml", bytes)).is_ok()
}

/// A catalogue of cases.
pub(super) fn catalogue(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let path = scratch.file("catalogue.toml", bytes).to_owned();
    Catalogue { path }.select(&[], &[Size::Small, Size::Medium, Size::Large]).is_ok()
}

/// A record of `harness bench`.
pub(super) fn record(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let content = entry::read(scratch.file("record.jsonl", bytes));
    content.is_ok_and(|(lines, _)| !lines.is_empty())
}

/// A history of `harness track`.
pub(super) fn history(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    history::read(scratch.file("history.jsonl", bytes)).is_ok_and(|h| !h.records.is_empty())
}

/// The reports of a run and of `harness gate`.
pub(super) fn reports(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let path = scratch.file("report.json", bytes);
    let run = RunReport::read(path);
    if let Ok(report) = &run {
        let _ = report.peak_rss_bytes_total();
    }
    let gate = Measures::parse(bytes);
    let added = Record::new("commit".to_owned()).with(bytes);
    assert_eq!(gate.is_ok(), added.is_ok());
    run.is_ok() || gate.is_ok()
}
