//! The history of numbers by commit: a page, and forms for other programs.

pub mod export;
pub mod page;
