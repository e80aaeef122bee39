//! Meshes: leaf-set directories; forests of p4est; and hyper-tree grids in VTKHDF, both damaged files, whose checksums are repaired, so that
//! damage reaches what they protect, and undamaged files of nodes that need not be those of a tree.

use crate::Scratch;
use check::audit::audit_against;
use check::checks::CheckResult;
use check::promises::{Promises, Touching};
use contract::htg::TreeFile;
use contract::import::{ImportedTree, Request};
use contract::lattice::Root;
use contract::manifest::Manifest;
use contract::npy::PartFile;
use contract::{import, leafset, manifest, npy, word};
use std::cell::RefCell;
use std::io::Cursor as Memory;
use std::time::Instant;
use vtkhdf::format::{SIGNATURE, lookup3};
use vtkhdf::tree::{Shape, Siblings, TreeWriter, Window};
use vtkhdf::write::Deflater;

/// Stands for the digests of the 512 octants, which are 18 kB: inputs are short, and mostly of what matters.
const DIGESTS: &str = "@DIGESTS@";

/// The bytes with the digests of empty octants where [`DIGESTS`] stands first.
fn with_digests(bytes: &[u8]) -> Vec<u8> {
    let digests = DIGESTS.as_bytes();
    let Some(at) = bytes.windows(digests.len()).position(|window| window == digests) else {
        return bytes.to_vec();
    };
    let zeros = vec![format!("\"{:032x}\"", 0); manifest::OCTANTS].join(",");
    [&bytes[..at], zeros.as_bytes(), &bytes[at + digests.len()..]].concat()
}

/// Between the manifest and the words of the only part; without it, the root is the only leaf.
const SEPARATOR: &[u8] = b"\n@@@@\n";

/// A manifest and a part: the manifest is read back as it was written, and the directory is audited.
pub(super) fn manifest(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let at = bytes.windows(SEPARATOR.len()).position(|window| window == SEPARATOR);
    let (text, words) =
        at.map_or((bytes, &[0; 8][..]), |at| (&bytes[..at], &bytes[at + SEPARATOR.len()..]));
    scratch.file("mesh/mesh.json", &with_digests(text));
    let mesh = scratch.path().join("mesh");
    let Ok(manifest) = Manifest::read(&mesh) else { return false };
    scratch.file("again/mesh.json", manifest.text().as_bytes());
    let again = Manifest::read(&scratch.path().join("again")).expect("what was written");
    assert!(again == manifest, "{manifest:?}\n{again:?}");
    let words = &words[..words.len() / 8 * 8];
    let part = [&npy::header("<u8", &format!("({},)", words.len() / 8))[..], words].concat();
    scratch.file("mesh/leaves-00000.npy", &part);
    let Ok(set) = leafset::read(&mesh) else { return false };
    assert_eq!(set.words.len() % (words.len() / 8).max(1), 0);
    audit_against(&mesh, None, &Promises::of_definition());
    true
}

/// A file of leaf words, as a part of a leaf set and as an import.
pub(super) fn words(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let path = scratch.file("words.npy", bytes);
    let part = PartFile::open(path);
    let words = part.as_ref().ok().map(|part| part.read_all().expect("a file of this length"));
    let request = Request { sides: Some("side".to_owned()), ..Request::default() };
    // Cells that overlap are refused as a whole.
    if let Ok(cells) = import::words::read(path, &request) {
        let mut words = words.expect("an import of a part that can be read");
        words.sort_unstable();
        assert!(
            cells.words(&Root::UNIT).is_ok_and(|imported| imported == words) || overlap(&words)
        );
    }
    part.is_ok()
}

fn overlap(words: &[u64]) -> bool {
    let end = |word: u64| word::key(word) + word::span(word::level(word));
    words.windows(2).any(|pair| word::key(pair[1]) < end(pair[0]))
}

/// A forest of p4est; the first byte chooses options. What is accepted becomes a leaf set, and its leaves tile no place twice; any forest can be
/// audited, and is the same as itself.
pub(super) fn forest(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let Some((&options, bytes)) = bytes.split_first() else { return false };
    let path = scratch.file("forest.p8est", bytes);
    // Only a panic is a fault here. Tried for half of the option bytes.
    if options & 16 == 16 {
        let _ = import::guess(path);
    }
    if let Ok(forest) = import::forest::read(path) {
        let report = check::forest::audit(&forest, Touching::Corner, Instant::now());
        assert_eq!(report.leaves, forest.leaves.iter().flatten().count() as u64);
        assert!(check::forest::diff(&forest, &forest).iter().all(CheckResult::holds));
    }
    let request = Request {
        sides: (options & 1 == 1).then(|| "data".to_owned()),
        root: (options & 2 == 2).then_some(Root { origin: [-1.0, 2.0, 0.5], edge: 2.0 }),
        ..Request::default()
    };
    let Ok(cells) = import::p4est::read(path, &request) else { return false };
    let count = cells.count();
    let Ok(set) = import::leaf_set(&cells, request.root, None, "fuzz".to_owned()) else {
        return false;
    };
    assert_eq!(set.words.len(), count);
    assert!(set.words.iter().all(|&word| word::check(word).is_ok()));
    assert!(set.words.is_sorted() && !overlap(&set.words));
    true
}

thread_local! {
    static DEFLATER: RefCell<Deflater> = RefCell::default();
}

/// A hyper-tree grid in VTKHDF.
pub(super) fn tree_file(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let mut bytes = match bytes.starts_with(&SIGNATURE[..1]) {
        true => bytes.to_vec(),
        false => file_of(bytes),
    };
    repair_checksums(&mut bytes);
    let path = scratch.file("mesh.vtkhdf", &bytes);
    let imported = ImportedTree::open(path, None, None, None, "fuzz".to_owned());
    let tree = TreeFile::open(path);
    let Ok(tree) = tree else {
        assert!(!matches!(imported, Ok(Some(_))));
        return false;
    };
    let mut words = Vec::new();
    let whole = tree.blocks(&mut |run| {
        words.extend(run.iter().flat_map(|block| block.words()));
        true
    });
    assert_eq!(matches!(imported, Ok(Some(_))), whole.is_ok());
    if whole.is_err() {
        return false;
    }
    assert!(words.iter().all(|&word| word::check(word).is_ok()));
    assert!(words.is_sorted() && !overlap(&words));
    assert_eq!(tree.leaves, words.len() as u64);
    true
}

/// A file with nodes of any kind: the number of levels below the root, the groups of siblings of each, and four bytes for each group.
fn file_of(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.iter().copied();
    let mut next = || bytes.next().unwrap_or(0);
    let levels = next() % 8;
    let sizes: Vec<u64> = (0..levels).map(|_| 1 + u64::from(next() % 32)).collect();
    let nodes = [1].into_iter().chain(sizes.iter().map(|groups| 8 * groups)).collect();
    let shape = Shape { origin: [-1.0, 0.0, 0.5], edge: 2.0, nodes };
    let mut window = Window::new(0);
    let mut siblings = || {
        let [split, deleted, crossing, inside] = [next(), next(), next(), next()].map(u64::from);
        Siblings { split, deleted, crossing, inside }
    };
    window.put_root(siblings());
    (0..sizes.iter().sum()).for_each(|group| window.put(group, siblings()));
    let chunks = DEFLATER.with_borrow_mut(|deflater| window.compress(&shape, deflater));
    let write = || {
        let mut out = TreeWriter::new(Memory::new(Vec::new()), shape)?;
        out.add(0, &chunks)?;
        out.finish()
    };
    write().expect("memory is writable").into_inner()
}

/// Bytes of the superblock.
const SUPERBLOCK: usize = 48;
/// Bytes of the head of a table of chunks.
const TABLE_HEAD: usize = 28;

/// Repairs the checksums of HDF5's metadata: with wrong ones, a reader refuses a file before it looks at anything else. Makes the checksums and the length in the superblock right, wherever the blocks that have them are complete.
fn repair_checksums(bytes: &mut [u8]) {
    if bytes.starts_with(&SIGNATURE) && bytes.len() >= SUPERBLOCK {
        let length = bytes.len() as u64;
        bytes[28..36].copy_from_slice(&length.to_le_bytes());
        sum(bytes, 0, SUPERBLOCK as u64);
    }
    for at in 0..bytes.len().saturating_sub(TABLE_HEAD) {
        if bytes[at..].starts_with(b"OHDR") {
            let size = number(bytes, at + 6, 4);
            sum(bytes, at as u64, 10 + size + 4);
        } else if bytes[at..].starts_with(b"FAHD") {
            sum(bytes, at as u64, TABLE_HEAD as u64);
            let (entry, count) = (u64::from(bytes[at + 6]), number(bytes, at + 8, 8));
            let table = number(bytes, at + 16, 8);
            sum(bytes, table, count.saturating_mul(entry).saturating_add(18));
        }
    }
}

/// The number in these bytes, little-endian.
fn number(bytes: &[u8], at: usize, length: usize) -> u64 {
    bytes[at..at + length].iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte))
}

/// Writes the checksum of a block into its last four bytes, if the block is part of the file.
fn sum(bytes: &mut [u8], at: u64, length: u64) {
    let end = at.saturating_add(length);
    if end <= bytes.len() as u64 && length >= 4 {
        let (at, sum_at) = (at as usize, end as usize - 4);
        let checksum = lookup3(&bytes[at..sum_at]);
        bytes[sum_at..end as usize].copy_from_slice(&checksum.to_le_bytes());
    }
}
