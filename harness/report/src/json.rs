//! JSON as all reports have it: indented, with a line feed at the end.

use serde::Serialize;

/// The value as indented JSON.
///
/// # Panics
/// If JSON cannot represent the value: a map whose keys are not strings.
pub fn pretty<T: Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string_pretty(value).expect("reports have string keys only") + "\n"
}
