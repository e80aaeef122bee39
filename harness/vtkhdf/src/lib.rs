//! HDF5 files that are written and read chunk by chunk, so that a data set need not fit in memory, and the hyper-tree grid of
//! VTK in such a file.
//!
//! - [`write`](mod@write) and [`read`](mod@read): the part of HDF5 1.10 that these files need: groups, attributes, small arrays, and long arrays of
//!   chunks that are compressed with zlib. [`format`](mod@format) has what both know of it;
//! - [`checksum`]: that of every block of metadata;
//! - [`tree`]: the layout of a hyper-tree grid of one oct-tree, and its arrays, window by window.
//!
//! A file that VTK or h5py wrote is refused if it has anything else.

#![deny(missing_docs)]

pub mod checksum;
pub mod format;
pub mod read;
pub mod tree;
pub mod write;
