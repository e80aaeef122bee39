//! A verification as JSON; the schema is documented in harness/doc/verify.md.

use run::verify::report::Report;

/// The report as JSON, ending in a line feed.
///
/// # Panics
/// If a reader would not find the same outcomes in it.
pub fn json(report: &Report) -> String {
    let text = crate::json::pretty(report);
    check_invariants(&text, report);
    text
}

fn check_invariants(text: &str, report: &Report) {
    let read: Report = serde_json::from_str(text).expect("the report is read as it was written");
    read.check_invariants();
    let of = |report: &Report| (report.tally(), report.exit_code());
    assert_eq!(of(&read), of(report), "outcomes in the JSON, and in the report");
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::testing::report as sample;

    #[test]
    fn reading_restores_the_report() {
        let text = json(&sample());
        let back: Report = serde_json::from_str(&text).unwrap();
        assert_eq!(json(&back), text);
    }

    #[test]
    #[should_panic(expected = "outcomes in the JSON")]
    fn an_outcome_that_changed_is_noticed() {
        let text = json(&sample()).replace("\"fail\"", "\"left_out\"");
        check_invariants(&text, &sample());
    }

    #[test]
    fn outcomes_are_named_and_have_reasons() {
        let value: serde_json::Value = serde_json::from_str(&json(&sample())).unwrap();
        let checks = value["cases"][0]["checks"].as_array().unwrap();
        let outcomes: Vec<_> =
            checks.iter().map(|check| check["outcome"].as_str().unwrap()).collect();
        assert_eq!(outcomes, ["pass", "pass", "fail", "left_out"]);
        assert_eq!(checks[3]["why"], "the engine is not built");
    }
}
