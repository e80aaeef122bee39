//! Items by key, in the order in which the keys first occur, and what is numbered in that order.
//!
//! Measurements of different origins - machines, builds of a program, geometries - are different series. The first origin of a
//! name keeps the name; those of the others have the suffix ` [2]`, ` [3]`, ..., in every table and figure.

use std::collections::BTreeMap;

/// Returns the items of every key.
pub fn by_key<T: Copy, K: PartialEq>(
    items: impl IntoIterator<Item = T>,
    key: impl Fn(T) -> K,
) -> Vec<(K, Vec<T>)> {
    let mut found: Vec<(K, Vec<T>)> = Vec::new();
    for item in items {
        let key = key(item);
        match found.iter_mut().find(|(other, _)| *other == key) {
            Some((_, items)) => items.push(item),
            None => found.push((key, vec![item])),
        }
    }
    found
}

/// Returns the items without repetitions.
pub fn distinct<T: PartialEq>(items: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for item in items {
        if !found.contains(&item) {
            found.push(item);
        }
    }
    found
}

/// The origins of every name, in the order in which they were seen.
#[derive(Clone, Debug, Default)]
pub struct Origins(BTreeMap<String, Vec<String>>);

impl Origins {
    /// Returns the suffix of a name for measurements of this origin. An unknown origin is empty, and one of its own.
    pub fn suffix(&mut self, name: &str, origin: &str) -> String {
        let seen = self.0.entry(name.to_owned()).or_default();
        let at = seen.iter().position(|other| other == origin).unwrap_or_else(|| {
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
            let all = seen.iter().enumerate().map(label).collect::<Vec<_>>().join("; ");
            format!("the first origin keeps the name, and other series are apart: {name} {all}")
        };
        several.map(sentence).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_in_the_order_of_their_first_items() {
        assert_eq!(by_key([3, 4, 1, 2], |i| i % 2), [(1, vec![3, 1]), (0, vec![4, 2])]);
        assert_eq!(distinct([3, 1, 3, 2, 1]), [3, 1, 2]);
    }

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
                && described[0].contains("the first origin keeps the name")
                && described[0].contains("mesher [1]: x; [2]: y; [3]: unknown; [4]: z")
        );
    }
}
