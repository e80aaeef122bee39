//! Hyper-tree grids in VTKHDF: damaged files, whose checksums are repaired, so that damage reaches what they protect; and undamaged
//! files of nodes that need not be those of a tree.

use crate::{Scratch, repair};
use contract::htg::TreeFile;
use contract::import::htg::ImportedTree;
use contract::word;
use std::cell::RefCell;
use std::io::Cursor as Memory;
use vtkhdf::format::SIGNATURE;
use vtkhdf::tree::{Shape, Siblings, TreeWriter, Window};
use vtkhdf::write::Deflater;

thread_local! {
    static DEFLATER: RefCell<Deflater> = RefCell::default();
}

pub(super) fn run(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let mut bytes = match bytes.starts_with(&SIGNATURE[..1]) {
        true => bytes.to_vec(),
        false => file_of(bytes),
    };
    repair::checksums(&mut bytes);
    let path = scratch.file("mesh.vtkhdf", &bytes);
    let imported = ImportedTree::open(path, None, None, None, "fuzz".to_owned());
    let tree = TreeFile::open(path, true);
    let Ok(tree) = tree else {
        assert!(!matches!(imported, Ok(Some(_))));
        return false;
    };
    let mut words = Vec::new();
    let whole = tree.words(&mut |run| {
        words.extend_from_slice(run);
        true
    });
    assert_eq!(matches!(imported, Ok(Some(_))), whole.is_ok());
    if whole.is_err() {
        return false;
    }
    assert!(words.iter().all(|&word| word::fault(word).is_none()));
    assert!(words.is_sorted_by(|&a, &b| word::key(a) + word::span(word::level(a)) <= word::key(b)));
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
        let [split, deleted, crossing, inside] = [next(), next(), next(), next()];
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
