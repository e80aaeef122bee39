//! Shapes that need no file: closed surfaces as facet soup, in as many facets as asked.
//!
//! Every shape is one closed, outward-wound surface whose facets share their vertices bit for bit, and
//! is the same on every machine: only `+ - * /`, square roots and `libm` are used, and nothing depends
//! on the order of a hash table. [`Generator`] is the `[generator]` table of a case file.
//!
//! The number of facets is exact when it is even and the shape can be drawn in that few; a closed
//! surface of triangles always has an even number of them, so an odd request gives one facet less.

#![deny(missing_docs)]

mod generator;
mod mesh;
mod shapes;
mod stl;

pub use generator::{Generator, GeneratorError, Shape};
pub use mesh::{Mesh, MeshFault};
pub use stl::write_stl_binary;

/// One facet: three vertices, f32 as in STL.
pub type Facet = [[f32; 3]; 3];
