//! The report of a verification; one module per format.

pub mod json;
pub mod junit;
pub mod markdown;
pub mod remarks;
pub mod table;
