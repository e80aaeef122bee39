//! A verification as JSON; the schema is documented in harness/doc/verify.md.

use run::verify::report::Report;

/// The report as JSON, ending in a line feed.
pub fn json(report: &Report) -> String {
    crate::json::pretty(report)
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
    fn outcomes_are_named_and_have_reasons() {
        let value: serde_json::Value = serde_json::from_str(&json(&sample())).unwrap();
        let checks = value["cases"][0]["checks"].as_array().unwrap();
        let outcomes: Vec<_> =
            checks.iter().map(|check| check["outcome"].as_str().unwrap()).collect();
        assert_eq!(outcomes, ["pass", "fail", "left_out"]);
        assert_eq!(checks[2]["why"], "the engine is not built");
    }
}
