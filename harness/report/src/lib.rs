//! The forms in which the harness presents its findings.
//!
//! - `figure`: the model of a figure, and SVG, PNG, PDF, CSV and LaTeX from it;
//! - [`page`](mod@page), [`table`], [`pretty`]: what all reports share;
//! - [`verification`]: table, Markdown, JUnit and JSON of a verification;
//! - [`benchmark`]: figures and page of a record of benchmarks;
//! - [`gate`], [`track`]: their tables and pages;
//! - [`picture`]: pictures of meshes.

pub mod archive;
pub mod benchmark;
mod figure;
pub mod gate;
mod junit;
pub mod page;
pub mod picture;
pub mod table;
pub mod track;
pub mod verification;

use serde::Serialize;

/// The value as indented JSON, with a line feed at the end.
///
/// # Panics
/// If JSON cannot represent the value: a map whose keys are not strings.
pub fn pretty<T: Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string_pretty(value).expect("reports have string keys only") + "\n"
}
