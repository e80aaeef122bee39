//! Files are read back as they were written, and all others are refused.
#![allow(missing_docs)]

use proptest::prelude::*;
use std::fs;
use std::io::{Cursor, Seek, SeekFrom, Write};
use std::path::Path;
use vtkhdf::format::ReadError;
use vtkhdf::read::TreeReader;
use vtkhdf::tree::{Shape, Siblings, TreeWriter, WINDOW, Window, groups};
use vtkhdf::write::Deflater;

/// A file in which the siblings of group g have the numbers `of(g)`, and its shape.
fn file_of(nodes: Vec<u64>, of: impl Fn(u64) -> Siblings) -> (Vec<u8>, Shape) {
    let shape = Shape { origin: [0.1, -2.0, 1e6], edge: 0.3, nodes };
    let mut out = TreeWriter::new(Cursor::new(Vec::new()), shape.clone()).unwrap();
    let mut deflater = Deflater::default();
    for index in 0..shape.windows() {
        let mut window = Window::new(index);
        // Five at a time, whether they are in the window or not.
        for first in (groups(index).start.saturating_sub(3)..groups(index).end).step_by(5) {
            let mut all = Siblings::default();
            let exists = |group: &u64| 8 * group + 1 < shape.nodes_total();
            for (i, group) in (first..first + 5).enumerate().filter(|(_, group)| exists(group)) {
                let Siblings { split, deleted, crossing, inside } = of(group);
                all.split |= split << (8 * i);
                all.deleted |= deleted << (8 * i);
                all.crossing |= crossing << (8 * i);
                all.inside |= inside << (8 * i);
            }
            window.put(first, all);
        }
        out.add(index, &window.compress(&shape, &mut deflater)).unwrap();
    }
    (out.finish().unwrap().into_inner(), shape)
}

/// A small file with all arrays.
fn small() -> Vec<u8> {
    let siblings = Siblings { split: 1, deleted: 6, crossing: 0x30, inside: 8 };
    file_of(vec![1, 8, 8], |_| siblings).0
}

/// The shape, and the bytes of all arrays.
fn read(path: &Path) -> Result<(Shape, Vec<Vec<u8>>), ReadError> {
    let file = TreeReader::open(path)?;
    let mut all = Vec::new();
    for array in &file.arrays {
        let (mut bytes, mut chunk) = (Vec::new(), Vec::new());
        for index in 0..array.chunks.len() {
            file.read_chunk(array, index, &mut chunk)?;
            bytes.extend_from_slice(&chunk);
        }
        all.push(bytes);
    }
    Ok((file.shape.clone(), all))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn trees_of_several_windows_are_read_back(seed in any::<u64>(), is_masked in any::<bool>()) {
        let nodes: Vec<u64> = (0..8).map(|level| if level < 7 { 1 << (3 * level) } else { 1 << 20 }).collect();
        let of = |group: u64| {
            let mixed = (group ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
            let deleted = if is_masked { mixed & 0xff } else { 0 };
            Siblings { split: mixed >> 8 & 0xff, deleted, crossing: 1, inside: 4 }
        };
        let (content, shape) = file_of(nodes, of);
        let place = tempfile::NamedTempFile::new().unwrap();
        fs::write(place.path(), content).unwrap();
        let (found, [split, masked, sides]) = read(place.path()).map(|(shape, all)| (shape, <[_; 3]>::try_from(all).unwrap())).unwrap();
        prop_assert!(shape.windows() > 4 && found == shape);
        prop_assert_eq!(masked.iter().all(|&bits| bits == 0), !is_masked);
        for group in [0, 1, 77, WINDOW / 8 - 1, WINDOW / 8, (shape.nodes_total() - 9) / 8] {
            let siblings = of(group);
            for i in 0..8 {
                let node = (1 + 8 * group + i) as usize;
                let bit = |bits: &[u8]| bits.get(node / 8).map_or(0, |byte| u64::from(byte >> (7 - node % 8) & 1));
                if (node as u64) < shape.nodes_described() {
                    prop_assert_eq!(bit(&split), siblings.split >> i & 1);
                }
                prop_assert_eq!(bit(&masked), siblings.deleted >> i & 1);
                prop_assert_eq!(sides[node], [2, 0, 1, 0, 0, 0, 0, 0][i as usize]);
            }
        }
    }
}

/// Every bit of the metadata is compared, and chunks have checksums, except for their padding.
#[test]
fn a_flipped_bit_is_an_error_or_changes_nothing() {
    let content = small();
    let mut place = tempfile::NamedTempFile::new().unwrap();
    place.write_all(&content).unwrap();
    let original = read(place.path()).unwrap();
    let mut put = |at: usize, byte: u8| {
        place.seek(SeekFrom::Start(at as u64)).unwrap();
        place.write_all(&[byte]).unwrap();
        read(place.path())
    };
    let mut harmless = 0;
    for at in 0..content.len() {
        for bit in 0..8 {
            if let Ok(found) = put(at, content[at] ^ 1 << bit) {
                assert_eq!(found, original, "bit {bit} of byte {at}");
                harmless += 1;
            }
        }
        put(at, content[at]).unwrap();
    }
    assert!(harmless < 4 * 8, "{harmless} flipped bits were not found");
}

#[test]
fn a_file_of_any_other_length_is_an_error() {
    let content = small();
    let place = tempfile::NamedTempFile::new().unwrap();
    for length in 0..content.len() {
        fs::write(place.path(), &content[..length]).unwrap();
        assert!(read(place.path()).is_err(), "{length} bytes");
    }
    fs::write(place.path(), [&content[..], &[0]].concat()).unwrap();
    assert!(matches!(read(place.path()), Err(ReadError::Damaged(_))));
}

#[test]
fn nodes_that_are_not_those_of_an_oct_tree_are_another_layout() {
    let place = tempfile::NamedTempFile::new().unwrap();
    for nodes in [
        vec![2],
        vec![1, 7],
        vec![1, 16],
        vec![1, 8, 0],
        vec![1, 8, 72],
        [vec![1], vec![8; 20]].concat(),
    ] {
        fs::write(place.path(), file_of(nodes.clone(), |_| Default::default()).0).unwrap();
        let error = read(place.path()).unwrap_err();
        assert!(matches!(error, ReadError::Unknown(_)), "{nodes:?}: {error}");
    }
}

#[test]
fn other_versions_are_named_and_not_called_damaged() {
    let mut content = small();
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

#[test]
fn trees_of_more_nodes_than_2_to_the_37th_are_read_back() {
    let below = (1..=12).map(|level| 1 << (3 * level));
    let nodes: Vec<u64> = [1].into_iter().chain(below).chain([(1 << 37) + 8]).collect();
    let shape = Shape { origin: [0.0; 3], edge: 1.0, nodes };
    let place = tempfile::NamedTempFile::new().unwrap();
    let mut out = TreeWriter::new(place.reopen().unwrap(), shape.clone()).unwrap();
    // Only the last group has a side.
    let last = shape.windows() - 1;
    let group = (shape.nodes_total() - 9) / 8;
    let mut window = Window::new(last);
    window.put(group, Siblings { inside: 0x81, ..Siblings::default() });
    out.add(last, &window.compress(&shape, &mut Deflater::default())).unwrap();
    drop(out.finish().unwrap());
    let file = TreeReader::open(place.path()).unwrap();
    assert_eq!((&file.shape, file.shape.windows()), (&shape, 823_882));
    let mut chunk = Vec::new();
    file.read_chunk(&file.arrays[2], last as usize, &mut chunk).unwrap();
    let first = (1 + 8 * group - last * WINDOW) as usize;
    assert_eq!(chunk[first..first + 8], [1, 0, 0, 0, 0, 0, 0, 1]);
    assert_eq!(chunk.iter().map(|&side| u64::from(side)).sum::<u64>(), 2);
    file.read_chunk(&file.arrays[2], last as usize / 2, &mut chunk).unwrap();
    assert!(chunk.iter().all(|&side| side == 0) && chunk.len() as u64 == WINDOW);
}
