//! Writer of binary STL: a header of 80 bytes, the number of facets, 50 bytes per facet.

use std::io::{self, Write};

use crate::Facet;

/// Writes facets as little-endian binary STL, with normals by the right-hand rule (zero for a facet
/// without area) and attribute bytes of zero. The header does not start with "solid", because some
/// readers take such files for ASCII STL.
///
/// # Errors
/// Writing fails, or the number of facets exceeds 32 bits.
pub fn write_stl_binary(facets: &[Facet], mut to: impl Write) -> io::Result<()> {
    let count = u32::try_from(facets.len()).map_err(|_| {
        io::Error::new(
            io::ErrorKind::InvalidInput,
            "the number of facets exceeds the 32 bits of binary STL",
        )
    })?;
    let mut header = [b' '; 80];
    header[..30].copy_from_slice(b"binary STL, generated surface.");
    to.write_all(&header)?;
    to.write_all(&count.to_le_bytes())?;
    for facet in facets {
        let mut record = [0u8; 50];
        let numbers = normal(facet).into_iter().chain(facet.iter().flatten().copied());
        for (field, number) in record.chunks_exact_mut(4).zip(numbers) {
            field.copy_from_slice(&number.to_le_bytes());
        }
        to.write_all(&record)?;
    }
    to.flush()
}

fn normal(facet: &Facet) -> [f32; 3] {
    let edge = |v: usize, a: usize| f64::from(facet[v][a]) - f64::from(facet[0][a]);
    let n: [f64; 3] = std::array::from_fn(|a| {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        edge(1, b) * edge(2, c) - edge(1, c) * edge(2, b)
    });
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 { n.map(|x| (x / length) as f32) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_facet_is_a_record_of_fifty_bytes_with_its_normal_and_vertices() {
        let facet = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 3.0, 1.0]];
        let mut bytes = Vec::new();
        write_stl_binary(&[facet, facet], &mut bytes).unwrap();
        assert_eq!(bytes.len(), 84 + 2 * 50);
        assert!(!bytes.starts_with(b"solid"));
        assert_eq!(bytes[80..84], [2, 0, 0, 0]);
        let numbers: Vec<f32> = bytes[84..132]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
            .collect();
        assert_eq!(numbers, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 0.0, 1.0, 0.0, 3.0, 1.0]);
    }

    #[test]
    fn the_normal_of_a_facet_without_area_is_zero() {
        assert_eq!(normal(&[[1.0; 3]; 3]), [0.0; 3]);
    }
}
