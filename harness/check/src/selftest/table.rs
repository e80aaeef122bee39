//! The table of trials.

use std::collections::BTreeSet;
use std::fmt;

use super::{Kill, SelftestReport};

pub(super) fn write(report: &SelftestReport, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    rows(report, f)?;
    report
        .alarms
        .iter()
        .try_for_each(|alarm| writeln!(f, "FALSE ALARM on a correct mesh: {alarm}"))?;
    report.unused.iter().try_for_each(|name| writeln!(f, "applies to no case: {name}"))?;
    let names: BTreeSet<_> = report.kills.iter().map(|k| k.mutant).collect();
    let survivors = report.kills.iter().filter(|k| !k.killed()).count();
    let (corruptions, trials, alarms) = (names.len(), report.kills.len(), report.alarms.len());
    write!(
        f,
        "{corruptions} corruptions in {trials} trials: {survivors} survived, {alarms} false alarms"
    )
}

fn rows(report: &SelftestReport, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let heads = ("corruption", "case", "expected");
    let width = |of: fn(&Kill) -> usize, head: &str| {
        report.kills.iter().map(of).fold(head.len(), usize::max)
    };
    let (name, case) = (width(|k| k.mutant.len(), heads.0), width(|k| k.case.len(), heads.1));
    writeln!(f, "{:name$}  {:case$}  {:10}  {:8}  reported by", heads.0, heads.1, heads.2, "")?;
    for kill in &report.kills {
        let verdict = if kill.killed() { "killed" } else { "SURVIVED" };
        let by = kill.caught_by.join(", ");
        let audit =
            match kill.audit_caught_by.as_slice() {
                [] => String::new(),
                by => format!("; audit: {}", by.join(", ")),
            } + if kill.whole_audit_missed { "; missed by the audit with the case" } else { "" };
        let Kill { mutant, case: on, expected, .. } = kill;
        writeln!(f, "{mutant:name$}  {on:case$}  {expected:10}  {verdict:8}  {by}{audit}")?;
        if let Some(finding) = &kill.finding {
            writeln!(f, "{:name$}  first finding: {}", "", one_line(finding))?;
        }
    }
    Ok(())
}

/// The beginning of a finding, on one line: some findings quote whole manifests.
fn one_line(finding: &str) -> String {
    const SHOWN: usize = 160;
    let flat = finding.replace('\n', " ");
    if flat.chars().count() <= SHOWN {
        flat
    } else {
        flat.chars().take(SHOWN).collect::<String>() + "..."
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_a_row_per_trial_and_the_counts() {
        let kill = |mutant, expected, caught_by: &[&'static str], audit: &[&'static str]| Kill {
            mutant,
            case: "a case".to_owned(),
            expected,
            caught_by: caught_by.to_vec(),
            audit_expected: !audit.is_empty(),
            audit_caught_by: audit.to_vec(),
            whole_audit_missed: false,
            finding: None,
        };
        let mut report = SelftestReport::default();
        report.kills.push(kill(
            "leaf removed",
            "complete",
            &["complete", "identical"],
            &["complete"],
        ));
        report.kills[0].finding = Some("two\nlines".to_owned());
        report.kills.push(kill("leaf removed", "complete", &["balance"], &[]));
        report.kills.push(kill("side", "sides", &["sides"], &[]));
        let rows = "corruption    case    expected              reported by\n\
            leaf removed  a case  complete    killed    complete, identical; audit: complete\n              \
            first finding: two lines\n\
            leaf removed  a case  complete    SURVIVED  balance\n\
            side          a case  sides       killed    sides\n";
        let counts = "2 corruptions in 3 trials: 1 survived, 0 false alarms";
        assert_eq!(report.to_string(), format!("{rows}{counts}"));
        report.alarms.push("an alarm".to_owned());
        report.unused.push("unused");
        let rest = "FALSE ALARM on a correct mesh: an alarm\napplies to no case: unused\n\
            2 corruptions in 3 trials: 1 survived, 1 false alarms";
        assert_eq!(report.to_string(), format!("{rows}{rest}"));
        assert_eq!(one_line(&"x".repeat(160)), "x".repeat(160));
        assert_eq!(one_line(&"x".repeat(161)), "x".repeat(160) + "...");
    }
}
