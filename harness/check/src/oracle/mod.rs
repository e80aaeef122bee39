//! Comparison of sides with external oracles. trimesh, open3d and pyvista determine the side of the centroids
//! of base-tree leaves; the harness's own exact rays decide where they differ.
//!
//! [`sample`] chooses the points, the crate `run` passes them to the oracles, and [`vote`] compares the answers
//! with the mesh and with the exact rays. [`watertight`] decides whether a difference is an error.

pub mod sample;
pub mod vote;
pub mod watertight;
