//! Verification of oct-tree meshes: nothing here shares an algorithm with the programs it judges.
//!
//! - the contract between programs, this harness's own few lines for it: [`octant`], [`word`],
//!   [`digest`], [`manifest`], [`npy`], [`leafset`], [`lattice`], [`stl`], [`case`];
//! - what checks stand on: [`tree`] (leaves as a tree whose equal subtrees are stored once), [`parity`]
//!   (rays), [`triangle`] (exact facet-octant test);
//! - [`check`]: a file per promise; [`audit`](mod@audit): those that need no more than the leaves, at any size;
//! - [`export`]: meshes for VTK to show;
//! - [`diff`](mod@diff): where two meshes differ; [`selftest`]: the checks themselves put to the test.

pub mod audit;
pub mod bench;
pub mod case;
pub mod check;
pub mod diff;
pub mod digest;
pub mod engine;
pub mod export;
pub mod gate;
pub mod lattice;
pub mod leafset;
pub mod manifest;
pub mod npy;
pub mod octant;
pub mod oracle;
pub mod out;
pub mod parity;
pub mod report;
pub mod selftest;
pub mod shrink;
pub mod stl;
pub mod track;
pub mod tree;
pub mod triangle;
pub mod verify;
pub mod word;
