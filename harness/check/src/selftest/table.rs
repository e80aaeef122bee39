//! The table of kills.

use std::collections::BTreeSet;
use std::fmt;

use super::{Kill, SelftestReport};

pub(super) fn write(report: &SelftestReport, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let heads = ("corruption", "case", "meant for", "");
    let wide =
        |of: fn(&Kill) -> usize, least: usize| report.kills.iter().map(of).fold(least, usize::max);
    let name = wide(|k| k.mutant.len(), heads.0.len());
    let case = wide(|k| k.case.len(), heads.1.len());
    writeln!(
        f,
        "{:name$}  {:case$}  {:10}  {:8}  reported by",
        heads.0, heads.1, heads.2, heads.3
    )?;
    for kill in &report.kills {
        let verdict = if kill.killed() { "killed" } else { "SURVIVED" };
        let by = kill.caught_by.join(", ");
        let audit = match kill.audit_caught_by.as_slice() {
            [] => String::new(),
            by => format!("; audit: {}", by.join(", ")),
        };
        let Kill { mutant, case: on, meant, .. } = kill;
        writeln!(f, "{mutant:name$}  {on:case$}  {meant:10}  {verdict:8}  {by}{audit}")?;
        if let Some(finding) = &kill.finding {
            writeln!(f, "{:name$}  first finding: {}", "", one_line(finding))?;
        }
    }
    report
        .alarms
        .iter()
        .try_for_each(|alarm| writeln!(f, "FALSE ALARM on a correct mesh: {alarm}"))?;
    report.unused.iter().try_for_each(|name| writeln!(f, "NO SPECIMEN for: {name}"))?;
    let left_out = &report.left_out;
    left_out.iter().try_for_each(|(name, why)| writeln!(f, "left out: {name}: {why}"))?;
    let names: BTreeSet<_> = report.kills.iter().map(|k| k.mutant).collect();
    let survivors = report.kills.iter().filter(|k| !k.killed()).count();
    let (kinds, tried) = (names.len(), report.kills.len());
    write!(
        f,
        "{kinds} corruptions in {tried} trials: {survivors} survived, {} false alarms",
        report.alarms.len()
    )?;
    match left_out.len() {
        0 => Ok(()),
        count => write!(f, ", {count} left out"),
    }
}

/// Findings may quote whole manifests: enough to recognise them by.
fn one_line(finding: &str) -> String {
    const SHOWN: usize = 160;
    let flat = finding.replace('\n', " ");
    if flat.chars().count() <= SHOWN {
        flat
    } else {
        flat.chars().take(SHOWN).collect::<String>() + "..."
    }
}
