//! The surface that an off-body mesh hands over to a near-body mesher: the faces exposed by deleted crossing leaves.
//!
//! - [`front`]: the faces; [`polygons`]: polygons that fit together; [`gap`]: the distance of each face from the wall;
//! - [`report`]: statistics; [`files`]: STL and VTK.
//!
//! All of it is held in memory: about 150 bytes per face, and 100 more while a file is written; and the tree, in which equal subtrees are stored
//! once.

pub mod files;
pub mod front;
pub mod gap;
pub mod polygons;
pub mod report;
