//! Sides against outside oracles: trimesh, open3d and pyvista say on which side the centroids of base-tree
//! leaves lie; the harness's own exact rays say who is right where somebody differs.
//!
//! The order of things: [`sample`] chooses the points, the crate `run` puts them to the oracles, [`vote`] compares the
//! answers with the mesh and with the exact rays, and says what fails and what is only worth telling.

pub mod sample;
pub mod vote;
pub mod watertight;
