//! The formats that the programs exchange, implemented independently of them, and the algebra of octants and trees.
//!
//! - files: [`case`], [`plain`] (a case that every program can read), [`catalogue`], [`stl`], [`manifest`], [`npy`],
//!   [`leafset`], [`mesh`] (the reader of meshes of any size), [`htg`] (the tree in a file of VTK), [`import`] (meshes of other programs), [`files`] (atomic writes);
//! - [`failure`]: why a command has no result, with its exit code, and what it reports meanwhile;
//! - [`paper`]: the numbers that we cite;
//! - numbers: [`lattice`], [`octant`], [`word`], [`digest`], [`number`] (for readers);
//! - foundations of the checks: [`tree`] (leaves as a tree that stores equal subtrees once), [`neighbourhood`], [`parity`] (rays),
//!   [`triangle`] (exact facet-octant test), [`sets`] (disjoint sets).

pub mod case;
pub mod catalogue;
pub mod digest;
pub mod failure;
pub mod files;
pub mod htg;
pub mod import;
pub mod lattice;
pub mod leafset;
pub mod manifest;
pub mod mesh;
pub mod neighbourhood;
pub mod npy;
pub mod number;
pub mod octant;
pub mod paper;
pub mod parity;
pub mod plain;
mod rules;
pub mod sets;
pub mod stl;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod tree;
pub mod triangle;
pub mod word;
