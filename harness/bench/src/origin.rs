//! Measurements of different origins - machines, builds of a program, geometries - are different series. The first origin of a
//! name keeps the name; those of the others have the suffix ` [2]`, ` [3]`, ..., in every table and figure.

use std::collections::BTreeMap;

/// The origins of every name, in the order in which they were seen.
#[derive(Clone, Debug, Default)]
pub struct Origins(BTreeMap<String, Vec<String>>);

impl Origins {
    /// Returns the suffix of a name for measurements of this origin. An unknown origin is empty, and one of its own.
    pub fn suffix(&mut self, name: &str, origin: &str) -> String {
        let seen = self.0.entry(name.to_owned()).or_default();
        let known = seen.iter().position(|other| other == origin);
        let at = known.unwrap_or_else(|| {
            seen.push(origin.to_owned());
            seen.len() - 1
        });
        if at == 0 { String::new() } else { format!(" [{}]", at + 1) }
    }

    /// Returns a sentence for every name with more than one origin.
    pub fn described(&self) -> Vec<String> {
        let several = self.0.iter().filter(|(_, seen)| seen.len() > 1);
        let sentence = |(name, seen): (&String, &Vec<String>)| {
            let label = |(i, origin): (usize, &String)| {
                let origin = if origin.is_empty() { "unknown" } else { origin };
                format!("[{}]: {origin}", i + 1)
            };
            let all: Vec<String> = seen.iter().enumerate().map(label).collect();
            format!("series of different origins are apart: {name} {}", all.join("; "))
        };
        several.map(sentence).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_further_origin_has_a_suffix_of_its_own() {
        let mut origins = Origins::default();
        let of = |origins: &mut Origins, origin| origins.suffix("mesher", origin);
        let suffixes = ["x", "y", "x", "", "z", "y"].map(|origin| of(&mut origins, origin));
        assert_eq!(suffixes, ["", " [2]", "", " [3]", " [4]", " [2]"]);
        assert_eq!(origins.suffix("reference", "y"), "", "other names have origins of their own");
        let described = origins.described();
        assert!(
            described.len() == 1
                && described[0].contains("mesher [1]: x; [2]: y; [3]: unknown; [4]: z")
        );
    }
}
