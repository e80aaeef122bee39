//! Phases 1 and 2: the case, its geometry, and both on the lattice.

pub mod case;
pub mod ingest;
pub mod lattice;
pub mod quantise;
pub mod stl;
