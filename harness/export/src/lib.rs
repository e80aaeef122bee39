//! Meshes as files of other programs. A [`mesh::Mesh`] on disk is read leaf by leaf, so memory does not grow with the mesh,
//! and only those parts of the files are read that a [`selection::Selection`] needs.

#![deny(missing_docs)]

pub mod error;
pub mod foam;
pub mod mesh;
pub mod selection;
