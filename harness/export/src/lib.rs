//! Meshes as files of other programs. A [`mesh::Mesh`] on disk is read leaf by leaf, so memory does not grow with the mesh,
//! also of one of which a [`selection::Selection`] needs a part.
//!
//! - [`format`](mod@format): the table of formats by file name;
//! - [`htg`]: the tree for VTK, in one file;
//! - [`vtu`]: cells for VTK; [`front`]: the surface towards a near-body mesh;
//! - [`foam`]: meshes for OpenFOAM; CGNS and MFEM are made of other formats by scripts;

#![deny(missing_docs)]

pub mod foam;
pub mod format;
pub mod front;
pub mod htg;
pub mod leaf;
mod leaves;
pub mod mesh;
pub mod options;
pub mod p8est;
pub mod polydata;
pub mod selection;
mod squares;
#[cfg(test)]
mod testing;
pub mod vtu;
mod written;
