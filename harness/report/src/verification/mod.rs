//! A verification's report, printed: a file per format.

pub mod json;
pub mod junit;
pub mod markdown;
pub mod remarks;
pub mod table;
