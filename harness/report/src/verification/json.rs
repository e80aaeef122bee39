//! JSON for programs; the schema is documented in the harness's README.

use run::verify::report::Report;

/// The report as JSON, ending in a line feed.
pub fn json(report: &Report) -> String {
    // The model holds strings, numbers and lists only: nothing of it can fail to become JSON.
    let mut text = serde_json::to_string_pretty(report).expect("a report is representable in JSON");
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::testing::report as sample;

    #[test]
    fn round_trip() {
        let text = json(&sample());
        let back: Report = serde_json::from_str(&text).unwrap();
        assert_eq!(json(&back), text);
    }

    #[test]
    fn outcomes_are_words() {
        let value: serde_json::Value = serde_json::from_str(&json(&sample())).unwrap();
        let checks = value["cases"][0]["checks"].as_array().unwrap();
        let outcomes: Vec<_> =
            checks.iter().map(|check| check["outcome"].as_str().unwrap()).collect();
        assert_eq!(outcomes, ["pass", "fail", "left_out"]);
        assert_eq!(checks[2]["why"], "the engine is not built");
    }
}
