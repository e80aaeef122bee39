//! Files are read back as they were written, and damaged ones are refused.
#![allow(missing_docs)]

use proptest::prelude::*;
use std::fs;
use std::io::{Cursor, Seek, SeekFrom, Write};
use std::path::Path;
use vtkhdf::format::{Chunked, Group, Kind, Member, ReadError, Value};
use vtkhdf::read::File;
use vtkhdf::write::{Deflater, Writer};

/// A file with the bytes as a chunked array and everything else that a file can have.
fn file_of(bytes: &[u8], chunk_len: u32) -> (Vec<u8>, Group) {
    let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
    let mut array = Chunked::new(Kind::Byte, bytes.len() as u64, chunk_len);
    let mut deflater = Deflater::default();
    for (i, part) in bytes.chunks(array.chunk_len as usize).enumerate() {
        let mut part = part.to_vec();
        part.resize(array.chunk_bytes(), 0);
        array.chunks[i] = deflater.compress(&part).map(|chunk| writer.append(&chunk).unwrap());
    }
    let inner = Group {
        attributes: vec![
            ("text".to_owned(), Value::Text("a text".to_owned())),
            ("number".to_owned(), Value::Number(-7)),
            ("ints".to_owned(), Value::Ints32(vec![1, -2])),
        ],
        members: vec![("array".to_owned(), Member::Chunked(array))],
    };
    let small = |value| Member::Small(value);
    let root = Group {
        attributes: Vec::new(),
        members: vec![
            ("inner".to_owned(), Member::Group(inner)),
            ("ints".to_owned(), small(Value::Ints(vec![i64::MIN, 5]))),
            ("doubles".to_owned(), small(Value::Doubles(vec![0.1, -1e300]))),
        ],
    };
    (writer.finish(&root).unwrap().into_inner(), root)
}

/// The groups and the bytes of the array.
fn read(path: &Path) -> Result<(Group, Vec<u8>), ReadError> {
    let file = File::open(path)?;
    let root = file.root()?;
    let mut bytes = Vec::new();
    if let Some(Member::Group(inner)) = root.member("inner")
        && let Some(Member::Chunked(array)) = inner.member("array")
    {
        let mut chunk = Vec::new();
        for index in 0..array.chunks.len() {
            file.read_chunk(array, index, &mut chunk)?;
            bytes.extend_from_slice(&chunk);
        }
        bytes.truncate(array.len as usize);
    }
    Ok((root, bytes))
}

proptest! {
    #[test]
    fn groups_and_arrays_are_read_back(
        bytes in prop::collection::vec(prop_oneof![5 => Just(0u8), 1 => any::<u8>()], 1..2000),
        chunk_len in 1u32..300,
    ) {
        let (content, root) = file_of(&bytes, chunk_len);
        let place = tempfile::NamedTempFile::new().unwrap();
        fs::write(place.path(), content).unwrap();
        prop_assert_eq!(read(place.path()).unwrap(), (root, bytes));
    }
}

fn put(file: &mut tempfile::NamedTempFile, at: usize, byte: u8) {
    file.seek(SeekFrom::Start(at as u64)).unwrap();
    file.write_all(&[byte]).unwrap();
}

/// Every bit is covered by a checksum, except the padding within compressed chunks.
#[test]
fn a_flipped_bit_is_an_error_or_changes_nothing() {
    let bytes: Vec<u8> = (0..400u32).map(|i| (i * i / 7 % 5) as u8).collect();
    let (content, root) = file_of(&bytes, 150);
    let mut place = tempfile::NamedTempFile::new().unwrap();
    place.write_all(&content).unwrap();
    let mut harmless = 0;
    for at in 0..content.len() {
        for bit in 0..8 {
            put(&mut place, at, content[at] ^ 1 << bit);
            if let Ok(found) = read(place.path()) {
                assert_eq!(found, (root.clone(), bytes.clone()), "bit {bit} of byte {at}");
                harmless += 1;
            }
            put(&mut place, at, content[at]);
        }
    }
    assert!(harmless < 3 * 8, "{harmless} flipped bits were not found");
}

#[test]
fn a_file_of_any_other_length_is_an_error() {
    let (content, _) = file_of(&[1, 2, 3, 4, 5, 6, 7], 3);
    let place = tempfile::NamedTempFile::new().unwrap();
    for length in 0..content.len() {
        fs::write(place.path(), &content[..length]).unwrap();
        assert!(read(place.path()).is_err(), "{length} bytes");
    }
    fs::write(place.path(), [&content[..], &[0]].concat()).unwrap();
    assert!(matches!(read(place.path()), Err(ReadError::Damaged(_))));
}

#[test]
fn other_versions_are_named_and_not_called_damaged() {
    let (mut content, _) = file_of(&[1], 1);
    let place = tempfile::NamedTempFile::new().unwrap();
    content[8] = 0;
    fs::write(place.path(), &content).unwrap();
    let error = read(place.path()).unwrap_err();
    assert!(matches!(error, ReadError::Unknown(_)), "{error}");
    assert!(error.to_string().contains("superblock"), "{error}");
}

#[test]
fn a_device_is_refused_without_reading_it() {
    let error = read(Path::new("/dev/zero")).unwrap_err();
    assert!(error.to_string().contains("a device"), "{error}");
}
