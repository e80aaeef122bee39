//! The history of measured values by commit: a page, figures, and forms for other programs.

pub mod export;
pub mod figures;
pub mod page;
