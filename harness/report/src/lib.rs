//! The forms in which the harness shows what it found.
//!
//! - [`verification`]: table, Markdown, JUnit and JSON of a verification;
//! - [`benchmark`]: figures and page of a record of benchmarks;
//! - [`targets`], [`gate`], [`track`]: their tables and pages;
//! - [`vtu`](mod@vtu): meshes for VTK.

pub mod benchmark;
pub mod gate;
pub mod targets;
pub mod track;
pub mod verification;
pub mod vtu;
