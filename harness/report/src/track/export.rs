//! The history for other people's tools: Bencher, github-action-benchmark, spreadsheets, JUnit readers.

use crate::verification::junit::to_text;
use bench::track::history::Record;
use bench::track::{Series, summary};
use quick_junit::{NonSuccessKind, TestCase, TestCaseStatus, TestSuite};
use serde_json::{Map, Value, json};

/// The last record in Bencher Metric Format: `{case: {metric: {"value": x}}}`.
pub fn bencher(record: &Record) -> String {
    let mut cases = Map::new();
    for (name, value) in &record.metrics {
        let (case, metric) = name.split_once('/').unwrap_or(("all", name));
        let measures = cases.entry(case).or_insert_with(|| Value::Object(Map::new()));
        measures[metric] = json!({ "value": value });
    }
    pretty(&Value::Object(cases))
}

/// The last record for github-action-benchmark, tool `customSmallerIsBetter`: a list of name, unit, value.
pub fn github(record: &Record) -> String {
    let entry = |(name, value): (&String, &f64)| json!({ "name": name, "unit": unit(name), "value": value });
    pretty(&Value::Array(record.metrics.iter().map(entry).collect()))
}

fn unit(name: &str) -> &'static str {
    match name.rsplit('/').next().unwrap_or(name) {
        "seconds" => "s",
        "message_bytes" => "bytes",
        "instructions" => "instructions",
        "cells" | "leaves" => "cells",
        _ => "count",
    }
}

fn pretty(value: &Value) -> String {
    // A value that was made here holds nothing that JSON cannot.
    let mut text = serde_json::to_string_pretty(value).expect("plain data");
    text.push('\n');
    text
}

/// The whole history as a table, one number to a line.
pub fn csv(records: &[Record]) -> String {
    let mut text = "commit,time,case,metric,value\n".to_owned();
    for record in records {
        for (name, value) in &record.metrics {
            let (case, metric) = name.split_once('/').unwrap_or(("all", name));
            let fields = [&record.commit, &record.time, case, metric].map(quoted).join(",");
            text.push_str(&format!("{fields},{value}\n"));
        }
    }
    text
}

/// A field of RFC 4180.
fn quoted(field: &str) -> String {
    match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field.to_owned(),
    }
}

/// A test per metric, which fails where the last change is for the worse and recent.
pub fn junit(all: &[Series], recent: usize) -> String {
    let mut xml = quick_junit::Report::new("harness track");
    let mut suite = TestSuite::new("track");
    for series in all {
        let status = match series.worse_recently(recent) {
            Some(_) => {
                let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
                status.set_message(summary(std::slice::from_ref(series)).trim_end().to_owned());
                status
            }
            None => TestCaseStatus::success(),
        };
        let mut test = TestCase::new(series.name.as_str(), status);
        if !series.changes.is_empty() {
            test.set_system_out(summary(std::slice::from_ref(series)));
        }
        suite.add_test_case(test);
    }
    xml.add_test_suite(suite);
    to_text(&xml)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::statistics::change_points::Rules;
    use bench::testing::history as sample;
    use bench::track::analyse;

    #[test]
    fn forms_are_those_that_the_tools_document() {
        let record = Record {
            metrics: [("uav/4 ranks/words".to_owned(), 3.5)].into(),
            ..Record::new("a".into())
        };
        let bencher: Value = serde_json::from_str(&bencher(&record)).unwrap();
        assert_eq!(bencher, json!({ "uav": { "4 ranks/words": { "value": 3.5 } } }));
        let github: Value = serde_json::from_str(&github(&record)).unwrap();
        assert_eq!(github, json!([{ "name": "uav/4 ranks/words", "unit": "count", "value": 3.5 }]));
    }

    #[test]
    fn commas_and_quotes_stay_within_their_field() {
        let mut record = Record::new("a".into());
        record.metrics.insert("x, \"y\"/z".into(), 1.0);
        assert_eq!(csv(&[record]), "commit,time,case,metric,value\na,,\"x, \"\"y\"\"\",z,1\n");
    }

    #[test]
    fn junit_fails_what_got_worse_recently() {
        let all = analyse(&sample(), &Rules::default());
        let failures = |recent| {
            quick_junit::Report::deserialize_from_str(&junit(&all, recent)).unwrap().failures
        };
        assert_eq!((failures(10), failures(5)), (1, 0));
    }
}
