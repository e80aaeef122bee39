//! The forms in which the harness presents its findings.
//!
//! - [`figure`]: the model of a figure, and SVG, PGF/TikZ and CSV from it;
//! - [`page`](mod@page), [`table`], [`markdown`], [`json`]: what all reports share;
//! - [`verification`]: table, Markdown, JUnit and JSON of a verification;
//! - [`benchmark`]: figures and page of a record of benchmarks;
//! - [`targets`], [`gate`], [`track`]: their tables and pages;
//! - [`picture`]: pictures of meshes.

pub mod archive;
pub mod benchmark;
pub mod figure;
pub mod gate;
pub mod json;
mod junit;
pub mod markdown;
pub mod page;
pub mod picture;
pub mod table;
pub mod targets;
pub mod track;
pub mod verification;
