//! The report of a gate as text, Markdown, JUnit XML and JSON.

use crate::junit::{skipped, suite, test, to_text, unsuccessful};
use crate::table::escaped;
use bench::gate::measures::LayerName;
use bench::gate::report::{End, GateFinding, GateReport, Layer, Verdict};
use quick_junit::NonSuccessKind::{Error, Failure};
use quick_junit::TestCaseStatus;
use std::collections::BTreeMap;
use std::time::Duration;

/// The report as text: a section per layer; unchanged values are only counted.
pub fn text(report: &GateReport) -> String {
    let baseline = report.baseline.iter().map(|measured| format!(" against baseline {measured}"));
    let mut text = format!("candidate {}{}\n", report.candidate, baseline.collect::<String>());
    // Unchanged times are shown, too, because their notes state how certain they are, and checks that fail as before.
    let is_shown = |layer: &Layer, finding: &GateFinding| match layer.name {
        LayerName::Time => true,
        LayerName::Correctness if finding.candidate > Some(0.0) => true,
        _ => finding.verdict != Verdict::Unchanged,
    };
    for layer in &report.layers {
        text += &format!("{:<13} {}\n", layer.name, summary(layer));
        let shown = layer.findings.iter().filter(|finding| is_shown(layer, finding));
        text.extend(shown.map(|finding| format!("  {}\n", line(finding))));
    }
    text + &verdict(report) + "\n"
}

/// The report as Markdown, for the summary page of a CI system.
pub fn markdown(report: &GateReport) -> String {
    let verdict = escaped(&verdict(report));
    format!("## harness gate\n\n**{verdict}**\n\n```text\n{}```\n", text(report))
}

/// The report as JUnit XML: a suite per layer, a test per metric. Inconclusive metrics are skipped tests with a reason.
pub fn junit(report: &GateReport) -> String {
    let mut xml = quick_junit::Report::new("harness gate");
    xml.set_time(Duration::from_secs_f64(report.time_s));
    for layer in &report.layers {
        let whole = |why: &String| test("layer", skipped(format!("left out: {why}")), "");
        let of_finding = |finding: &GateFinding| {
            let GateFinding { case, metric, verdict, note, .. } = finding;
            let ended = match verdict {
                Verdict::Regression => unsuccessful(Failure, &line(finding)),
                Verdict::Missing => unsuccessful(Error, &format!("not compared: {note}")),
                Verdict::Inconclusive | Verdict::LeftOut | Verdict::Accepted => {
                    skipped(format!("{verdict}: {note}"))
                }
                _ => TestCaseStatus::success(),
            };
            test(format!("{case}: {metric}"), ended, &line(finding))
        };
        let tests = layer.left_out.iter().map(whole).chain(layer.findings.iter().map(of_finding));
        xml.add_test_suite(suite(&layer.name.to_string(), layer.time_s, tests));
    }
    if xml.errors + xml.failures == 0 && !matches!(report.end(), End::Holds(_)) {
        let end = test("the gate is complete", unsuccessful(Error, &verdict(report)), "");
        xml.add_test_suite(suite("verdict", 0.0, [end]));
    }
    to_text(&xml)
}

/// The verdict on the candidate, with the time of the gate.
fn verdict(report: &GateReport) -> String {
    let end = match report.end() {
        End::Holds(total) if report.baseline.is_some() => {
            let mut findings = report.layers.iter().flat_map(|layer| &layer.findings);
            let accepted = findings.any(|finding| finding.verdict == Verdict::Accepted);
            let also = "; other meshes were accepted, and their numbers not compared";
            let also = if accepted { also } else { "" };
            format!("nothing got worse in {total} comparisons{also}")
        }
        End::Holds(total) => format!("{total} quantities were measured, and no baseline was given"),
        End::Interrupted => "interrupted".to_owned(),
        End::Incomplete(why) => format!("INCOMPLETE: {why}"),
        End::Regression => {
            let is_bad = |layer: &&Layer| layer.verdict() == Verdict::Regression;
            let bad = report.layers.iter().filter(is_bad).map(|layer| layer.name.to_string());
            format!("REGRESSION in {}", bad.collect::<Vec<_>>().join(", "))
        }
    };
    format!("{end} ({:.1} s)", report.time_s)
}

fn summary(layer: &Layer) -> String {
    if let Some(why) = &layer.left_out {
        return format!("left out: {why}");
    }
    let mut counts: BTreeMap<Verdict, usize> = BTreeMap::new();
    layer.findings.iter().for_each(|finding| *counts.entry(finding.verdict).or_default() += 1);
    let present: Vec<String> = counts.iter().rev().map(|(of, n)| format!("{n} {of}")).collect();
    format!("{} ({:.1} s)", present.join(", "), layer.time_s)
}

fn line(finding: &GateFinding) -> String {
    let GateFinding { case, metric, verdict, note, .. } = finding;
    let values = finding.baseline.zip(finding.candidate);
    let values = values.map(|(old, new)| format!(" {} -> {}", number(old), number(new)));
    let change = finding.change_percent.map(|change| format!(" ({change:+.2} %)"));
    let note = (!note.is_empty()).then(|| format!("; {note}"));
    let head = format!("{verdict:<12} {case}: {metric}");
    [Some(head), values, change, note].into_iter().flatten().collect()
}

/// Counts exactly, times to four decimals.
fn number(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value:.0}") } else { format!("{value:.4}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::gate::measures::{LayerName, Measured, Measures};

    fn sample() -> GateReport {
        let measured = |named: &str| Measured { named: named.into(), ..Measured::default() };
        let mut report =
            GateReport::new(Some(measured("main")), Measures::of_program(measured(".")));
        let cases = || vec!["cube".to_owned()];
        let values = |metric: &str, verdict, values, note: &str| {
            GateFinding::noted("cube", metric, verdict, note).of_values(values)
        };
        let mut counters = Layer::new(LayerName::Counters, cases());
        counters.findings = vec![
            values("rays", Verdict::Regression, [6.0, 7.0], "exceeds the tolerance of 0 %"),
            values("messages", Verdict::Unchanged, [6.0, 6.0], ""),
            GateFinding::noted("cube", "time", Verdict::Inconclusive, "a <busy> machine | or so"),
        ];
        let left_out = Some("no valgrind".into());
        report.layers =
            vec![counters, Layer { left_out, ..Layer::new(LayerName::Instructions, cases()) }];
        report
    }

    #[test]
    fn a_gate_that_compared_nothing_says_so_in_every_form() {
        let mut report = sample();
        let note = "the record does not contain this case";
        report.layers[0].findings =
            vec![GateFinding::noted("cube", "baseline", Verdict::Missing, note)];
        let expected = format!("INCOMPLETE: counters of cube: nothing was compared: {note}");
        assert!(text(&report).contains(&expected), "{}", text(&report));
        assert!(markdown(&report).contains(&expected.replace('_', "\\_")));
        let back = quick_junit::Report::deserialize_from_str(&junit(&report)).unwrap();
        assert_eq!(back.errors, 1);
    }

    #[test]
    fn text_lists_changes_and_counts_the_rest() {
        let text = text(&sample());
        assert!(
            text.contains(
                "regression   cube: rays 6 -> 7 (+16.67 %); exceeds the tolerance of 0 %"
            ),
            "{text}"
        );
        assert!(text.contains("1 unchanged") && !text.contains("messages"), "{text}");
        assert!(
            text.contains("REGRESSION in counters") && text.contains("left out: no valgrind"),
            "{text}"
        );
    }

    #[test]
    fn a_check_that_fails_as_before_is_shown() {
        let failing = |count: f64| {
            let mut report = sample();
            let finding = GateFinding::noted("cube", "serial: layer", Verdict::Unchanged, "thin");
            report.layers[0].name = LayerName::Correctness;
            report.layers[0].findings = vec![finding.of_values([count, count])];
            text(&report)
        };
        assert!(failing(4.0).contains("unchanged    cube: serial: layer 4 -> 4"));
        assert!(!failing(0.0).contains("serial: layer"));
    }

    #[test]
    fn a_junit_reader_finds_the_counts() {
        let back = quick_junit::Report::deserialize_from_str(&junit(&sample())).unwrap();
        assert_eq!((back.tests, back.failures), (4, 1));
    }
}
