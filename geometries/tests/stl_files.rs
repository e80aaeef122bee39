//! The files of `stl-files.txt` are what its head says of them.

use geometries::{StlFile, stl_files};

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
    let lines = text.split(['\r', '\n']).map(|line| line.split_whitespace().collect::<Vec<_>>());
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
        let found =
            if is_binary(&bytes) { coordinates_binary(&bytes) } else { coordinates_text(&bytes) };
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
