//! Measured runs: their execution, their record, and what follows from it.
//!
//! Every result is appended to a record of [`entry`] lines immediately. All tables and figures are computed from the record alone, by
//! [`group`] and [`pop`] here and by the crate `report`. They can therefore be reproduced at any time on any
//! machine. A [study](crate::study) declares what is run.

pub(crate) mod cases;
pub mod entry;
pub mod execute;
pub mod group;
pub mod machine;
pub mod model;
pub mod network;
pub mod pop;
