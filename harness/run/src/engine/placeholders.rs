//! Placeholders in command templates: names between braces.

use std::collections::BTreeMap;

/// Values of placeholders.
pub type Values<'a> = BTreeMap<&'a str, String>;

/// The word in `parallel` that stands for the launcher's words.
pub const LAUNCHER: &str = "{launcher}";

/// The placeholders of a word, without their braces.
pub(super) fn placeholders(word: &str) -> impl Iterator<Item = &str> {
    word.split('{').skip(1).filter_map(|rest| rest.split_once('}')).map(|(name, _)| name)
}

/// A word with its placeholders replaced by their values; those without a value are left as they are.
pub fn fill(word: &str, values: &Values) -> String {
    let mut filled = word.to_owned();
    for name in placeholders(word) {
        if let Some(value) = values.get(name) {
            filled = filled.replace(&format!("{{{name}}}"), value);
        }
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_not_searched_for_placeholders() {
        let values = Values::from([("case", "{out}".to_owned()), ("out", "o".to_owned())]);
        assert_eq!(fill("a{case}b", &values), "a{out}b");
        assert_eq!(fill("{none}", &values), "{none}");
    }
}
