//! Measured runs: their execution, their record, and what follows from it.
//!
//! Every result is appended to a [`record`] immediately. All tables and figures are computed from the record alone, by
//! [`group`], [`pop`] and [`cause`] here and by the crate `report`. They can therefore be reproduced at any time on any
//! machine. A [study](crate::study) declares what is run.

pub mod cause;
pub mod entry;
pub mod execute;
pub(crate) mod feasible;
#[cfg(test)]
mod foreign;
pub mod group;
pub mod machine;
pub mod network;
pub mod number;
pub mod pop;
pub mod programs;
pub mod record;
pub mod sizing;
pub mod variant;
