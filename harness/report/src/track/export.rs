//! The history for other programs: Bencher, github-action-benchmark, spreadsheets, readers of JUnit XML.

use crate::figure::latex::table;
use crate::json::pretty;
use crate::junit::{suite, test, to_text, unsuccessful};
use bench::track::history::Record;
use bench::track::{Series, is_gain, summary, unit};
use quick_junit::NonSuccessKind::Failure;
use quick_junit::TestCaseStatus;
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

/// The last record for github-action-benchmark, tool `customSmallerIsBetter`: a list of name, unit, value. It has the costs alone.
pub fn github(record: &Record) -> String {
    let entry = |(name, value): (&String, &f64)| json!({ "name": name, "unit": unit(name), "value": value });
    let costs = record.metrics.iter().filter(|(name, _)| is_gain(name) != Some(true));
    pretty(&Value::Array(costs.map(entry).collect()))
}

/// The whole history as CSV, one value per line.
pub fn csv(records: &[Record]) -> String {
    let rows = records.iter().flat_map(|record| {
        record.metrics.iter().map(|(name, value)| {
            let (case, metric) = name.split_once('/').unwrap_or(("all", name));
            let names = [&record.commit, &record.time, case, metric].map(str::to_owned);
            names.into_iter().chain([value.to_string()]).collect()
        })
    });
    table(&["commit", "time", "case", "metric", "value"], rows)
}

/// A test per metric. It fails if the last change point is one for the worse among the last `recent` values.
pub fn junit(all: &[Series], recent: usize) -> String {
    let mut xml = quick_junit::Report::new("harness track");
    let of_series = |series: &Series| {
        let text = summary(std::slice::from_ref(series));
        let ended = match series.worse_recently(recent) {
            Some(_) => unsuccessful(Failure, text.trim_end()),
            None => TestCaseStatus::success(),
        };
        test(&series.name, ended, if series.changes.is_empty() { "" } else { &text })
    };
    xml.add_test_suite(suite("track", 0.0, all.iter().map(of_series)));
    to_text(&xml)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::testing::history as sample;
    use bench::track::analyse;
    use statistics::change_points::Rules;

    #[test]
    fn exports_have_the_documented_formats() {
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
    fn a_recent_increase_of_a_cost_is_a_failed_test() {
        let all = analyse(&sample(), &Rules::default());
        let failures = |recent| {
            quick_junit::Report::deserialize_from_str(&junit(&all, recent)).unwrap().failures
        };
        assert_eq!((failures(10), failures(5)), (1, 0));
    }
}
