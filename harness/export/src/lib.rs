//! Meshes as files of other programs. A mesh on disk is read leaf by leaf, and a [`selection::Selection`] is a part of it.
//!
//! - [`format`](mod@format): the table of formats by file name;
//! - [`htg`]: the tree for VTK, in one file; [`p8est`]: forests for p4est;
//! - [`vtu`]: cells for VTK; [`front`]: the surface towards a near-body mesh;
//! - [`foam`]: meshes for OpenFOAM; CGNS and MFEM are made of other formats by scripts.

pub mod foam;
pub mod format;
pub mod front;
pub mod htg;
mod leaves;
pub mod options;
pub mod p8est;
mod points;
pub mod selection;
#[cfg(test)]
mod testing;
pub mod vtu;
