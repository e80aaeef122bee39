//! Reader of STL files, binary or ASCII.
//!
//! A file is binary if its length is 84 + 50 n for the n in its header, whatever its first bytes:
//! some binary files begin with "solid". Any other file must be ASCII.
mod ascii;

use crate::error::Error;
use crate::input_file;
use std::path::Path;

/// The three vertices of a facet, in the precision of STL.
pub type Facet = [[f32; 3]; 3];

const HEADER_BYTES: usize = 84;
const FACET_BYTES: usize = 50;

/// Reads the facets of an STL file. A valid file may contain no facets; a file of zero bytes is an
/// error.
///
/// # Errors
/// The file cannot be read, is damaged or is not STL, or a vertex is not finite.
pub fn read(path: &Path) -> Result<Vec<Facet>, Error> {
    let bytes = input_file::read(path)?;
    parse(&bytes).map_err(|why| Error::Invalid(format!("geometry {}: {why}", path.display())))
}

/// Parses the bytes of an STL file.
///
/// # Errors
/// One sentence with the problem, its location and a remedy, without the path of the file.
pub fn parse(bytes: &[u8]) -> Result<Vec<Facet>, String> {
    if bytes.is_empty() {
        return Err("the file is empty; export the geometry again".to_owned());
    }
    let facets = match header_count(bytes) {
        Some(count) if binary_length(count) == bytes.len() as u64 => binary(bytes),
        _ if ascii::is_likely(bytes) => ascii::parse(bytes)?,
        Some(count) => return Err(wrong_length(count, bytes.len())),
        None => {
            return Err(
                "the file is neither ASCII STL, which begins with \"solid\", nor long enough \
                        for binary STL; give an STL file"
                    .to_owned(),
            );
        }
    };
    let finite = |facet: &Facet| facet.as_flattened().iter().all(|x| x.is_finite());
    if let Some(index) = facets.iter().position(|facet| !finite(facet)) {
        let vertices = facets[index];
        return Err(format!(
            "facet {index} has a vertex that is not finite ({vertices:?}); repair the geometry"
        ));
    }
    Ok(facets)
}

/// The facet count in a binary header. It may be arbitrarily wrong, so nothing is allocated from
/// it.
fn header_count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u32::from_le_bytes(count.try_into().expect("four bytes")))
}

fn binary_length(facets: u32) -> u64 {
    HEADER_BYTES as u64 + FACET_BYTES as u64 * u64::from(facets)
}

fn wrong_length(count: u32, length: usize) -> String {
    format!(
        "as binary STL the file should have {} bytes for the {count} facets of its header, but it \
         has {length}, and it is not ASCII STL either; it is damaged or not STL: export it again",
        binary_length(count)
    )
}

/// The record of a facet is a normal, which is ignored, three vertices, and two bytes of
/// attributes.
fn binary(bytes: &[u8]) -> Vec<Facet> {
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    let facet = |record: &[u8]| {
        std::array::from_fn(|vertex| {
            std::array::from_fn(|axis| {
                let start = 12 + 12 * vertex + 4 * axis;
                number(&record[start..start + 4])
            })
        })
    };
    bytes[HEADER_BYTES..].chunks_exact(FACET_BYTES).map(facet).collect()
}
