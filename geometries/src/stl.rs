//! Writer of binary STL (a header of 80 bytes, the number of facets, 50 bytes per facet), and the files of `stl-files.txt`, for tests
//! of readers. The head of that file describes its format.

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

/// An STL file that every reader must read, or must refuse.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StlFile {
    /// Its name, which ends in `.stl`.
    pub name: String,
    /// Whether it must be read.
    pub is_valid: bool,
    /// Its contents.
    pub bytes: Vec<u8>,
}

/// All files.
///
/// # Panics
/// If the format of `stl-files.txt` is violated.
pub fn stl_files() -> Vec<StlFile> {
    let text = include_str!("../stl-files.txt");
    let (_, files) = text.split_once("\n== ").expect("a first file");
    files.split("\n== ").map(file).collect()
}

fn file(text: &str) -> StlFile {
    let (head, body) = text.split_once('\n').unwrap_or((text, ""));
    let (title, _) = head.split_once(": ").expect("a property or an error");
    let words: Vec<&str> = title.split(' ').collect();
    // Its last line end is before the head of the next file.
    let body =
        if body.is_empty() || body.ends_with('\n') { body.into() } else { format!("{body}\n") };
    StlFile {
        name: words[1].into(),
        is_valid: words[0] == "valid",
        bytes: if words.contains(&"hex") {
            body.split_whitespace().map(byte).collect()
        } else {
            unescaped(&body)
        },
    }
}

fn byte(hex: &str) -> u8 {
    u8::from_str_radix(hex, 16).expect("two hexadecimal digits")
}

fn unescaped(text: &str) -> Vec<u8> {
    let mut parts = text.split('\\');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    while let Some(part) = parts.next() {
        let (escaped, rest) = match part.chars().next() {
            Some('\n') => (None, &part[1..]),
            Some('r') => (Some(b'\r'), &part[1..]),
            Some('t') => (Some(b'\t'), &part[1..]),
            Some('x') => (Some(byte(&part[1..3])), &part[3..]),
            None => (Some(b'\\'), parts.next().unwrap_or_default()),
            Some(other) => panic!("\\{other} is no escape"),
        };
        bytes.extend(escaped);
        bytes.extend_from_slice(rest.as_bytes());
    }
    bytes
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

    fn file(name: &str) -> StlFile {
        stl_files().into_iter().find(|file| file.name == name).unwrap()
    }

    /// Whether a file has the length of a binary STL file with its facet count.
    fn is_binary(data: &[u8]) -> bool {
        let count = data.get(80..84).map(|b| u32::from_le_bytes(b.try_into().unwrap()));
        count.is_some_and(|count| data.len() as u64 == 84 + 50 * u64::from(count))
    }

    fn coordinates_binary(data: &[u8]) -> Vec<f32> {
        let records = data[84..].chunks_exact(50);
        let numbers = records.flat_map(|record| record[12..48].chunks_exact(4));
        numbers.map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    /// The coordinates on the lines that start with "vertex", which suffices for these files.
    fn coordinates_text(data: &[u8]) -> Vec<f32> {
        let text: String = data.iter().map(|&b| char::from(b).to_ascii_lowercase()).collect();
        let lines =
            text.split(['\r', '\n']).map(|line| line.split_whitespace().collect::<Vec<_>>());
        let vertices = lines.filter(|words| words.first() == Some(&"vertex"));
        vertices.flat_map(|words| [1, 2, 3].map(|i| words[i].parse().unwrap())).collect()
    }

    #[test]
    fn all_valid_files_contain_the_same_facets() {
        let expected = coordinates_binary(&file("binary.stl").bytes);
        assert_eq!(expected.len(), 8 * 9);
        let valid: Vec<_> = stl_files().into_iter().filter(|file| file.is_valid).collect();
        assert_eq!(valid.len(), 20);
        for StlFile { name, bytes, .. } in valid {
            assert_eq!(is_binary(&bytes), name.starts_with("binary"), "{name}");
            let found = if is_binary(&bytes) {
                coordinates_binary(&bytes)
            } else {
                coordinates_text(&bytes)
            };
            assert_eq!(found, expected, "{name}");
        }
    }

    #[test]
    fn invalid_files_have_the_wrong_length_for_binary_stl_or_one_number_that_is_not_finite() {
        let good = file("binary.stl").bytes;
        let invalid: Vec<_> = stl_files().into_iter().filter(|file| !file.is_valid).collect();
        assert_eq!(invalid.len(), 23);
        for StlFile { name, bytes, .. } in invalid {
            let one_is_not_finite =
                || coordinates_binary(&bytes).iter().filter(|x| !x.is_finite()).count() == 1;
            assert!(!is_binary(&bytes) || one_is_not_finite(), "{name}");
            assert_ne!(bytes, good);
        }
        assert!(is_binary(&file("nan.stl").bytes) && is_binary(&file("infinite.stl").bytes));
    }

    #[test]
    fn escapes_are_bytes() {
        assert_eq!(file("header_cut.stl").bytes.len(), 40);
        assert!(file("empty.stl").bytes.is_empty());
        assert!(!file("ascii_cr.stl").bytes.contains(&b'\n'));
        assert!(file("ascii_crlf.stl").bytes.ends_with(b"\r\n"));
        assert!(String::from_utf8(file("ascii_name_latin1.stl").bytes).is_err());
    }
}
