//! Generated shapes: closed surfaces as facet soup, with a given number of facets.
//!
//! Every shape is a closed surface wound outward, or several that overlap or enclose each other,
//! whose facets share vertices bit for bit. It is the same on every machine: only `+ - * /`, square
//! roots and `libm` are used, and nothing depends on the order of a hash table. [`Generator`] is the
//! `[generator]` table of a case file.
//!
//! A closed surface of triangles has an even number of facets. If the requested number is odd, the
//! shape has one facet less; otherwise the number is exact. Each shape has a minimum number.

#![deny(missing_docs)]

mod generator;
mod mesh;
mod shapes;
mod stl;

pub use generator::{Generator, GeneratorError, Shape};
use mesh::Mesh;
use serde::de::DeserializeOwned;
pub use stl::{StlFile, stl_files, write_stl_binary};

/// The three vertices of a facet, in the precision of STL.
pub type Facet = [[f32; 3]; 3];

/// Reads the text of a file again, as a reader that counts: `toml` ignores what a list has beyond the numbers that are read.
///
/// # Errors
/// One sentence, if a list is longer than what `T` reads of it. What else is wrong is not said, and what is not finite may hide it.
pub fn refuse_surplus<T: DeserializeOwned>(text: &str) -> Result<(), String> {
    let value = toml::from_str(text).map(serde_json::from_value::<T>);
    match value {
        Ok(Err(why)) if why.to_string().starts_with("invalid length") => Err(format!(
            "a list is longer than what is read of it ({why}): a point, for example, has three numbers, and brackets of its own"
        )),
        _ => Ok(()),
    }
}
