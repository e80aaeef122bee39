//! The hyper-tree grid of VTK in an HDF5 file, written and read chunk by chunk, so that a tree need not fit in memory.
//!
//! - [`write`](mod@write): the metadata of HDF5 1.10 that these files need: groups, attributes, small arrays, and long arrays of
//!   chunks that are compressed with zlib. [`format`](mod@format) has what the reader knows of it, too;
//! - [`tree`]: the layout of a hyper-tree grid of one oct-tree, and its arrays, window by window;
//! - [`read`]: the reader of such files. Those of other programs are refused.

pub mod format;
pub mod read;
pub mod tree;
pub mod write;
