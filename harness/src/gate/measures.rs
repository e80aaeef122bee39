//! What is exact about one program: counters, digests, instructions. A record of it is a baseline that
//! needs no build, and a point in the history that `harness track` keeps.

use super::report::Told;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the JSON form.
pub const SCHEMA: &str = "octree-measures/1";

/// What was measured of one program.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// [`SCHEMA`].
    pub schema: String,
    /// The program.
    pub of: Measured,
    /// By case.
    pub cases: BTreeMap<String, CaseMeasures>,
}

/// Which program was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// As the user named it.
    pub named: String,
    /// The revision it was built from.
    pub revision: Option<String>,
}

/// What was measured of one case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CaseMeasures {
    /// The mesh's digest.
    pub digest: Option<String>,
    /// Numbers that repeat exactly, by name.
    pub exact: BTreeMap<String, u64>,
    /// Numbers from valgrind; they repeat but for hash seeds and addresses.
    pub counted: BTreeMap<String, u64>,
}

impl Measures {
    /// Nothing measured yet.
    pub fn of_program(told: Told) -> Self {
        let of = Measured { named: told.named, revision: told.revision };
        Self { schema: SCHEMA.to_owned(), of, cases: BTreeMap::new() }
    }

    /// The place for a case's numbers.
    pub fn case(&mut self, name: &str) -> &mut CaseMeasures {
        self.cases.entry(name.to_owned()).or_default()
    }

    /// Reads a record, or the record in a gate's report.
    ///
    /// # Errors
    /// In a sentence, where it is neither.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Report {
            candidate_measures: Measures,
        }
        let measures: Self = match serde_json::from_slice::<Report>(text) {
            Ok(report) => report.candidate_measures,
            Err(_) => serde_json::from_slice(text)
                .map_err(|error| format!("not a record of `harness gate`: {error}"))?,
        };
        match measures.schema == SCHEMA {
            true => Ok(measures),
            false => Err(format!("schema {:?}, not {SCHEMA:?}", measures.schema)),
        }
    }

    /// As JSON.
    pub fn json(&self) -> String {
        // Strings and whole numbers only.
        let mut text =
            serde_json::to_string_pretty(self).expect("measures are representable in JSON");
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::report::Report;

    #[test]
    fn a_record_and_a_report_read_back() {
        let mut measures = Measures::of_program(Told { named: "m".into(), revision: None });
        measures.case("cube").exact.insert("rays".into(), u64::MAX);
        assert_eq!(Measures::parse(measures.json().as_bytes()).unwrap(), measures);
        let report =
            Report { candidate_measures: measures.clone(), ..Report::new(None, Told::default()) };
        let text = serde_json::to_vec(&report).unwrap();
        assert_eq!(Measures::parse(&text).unwrap(), measures);
        assert!(Measures::parse(b"{\"cells\": 1}").is_err());
        let other = measures.json().replace("measures/1", "measures/9");
        assert!(Measures::parse(other.as_bytes()).unwrap_err().contains("measures/9"));
    }
}
