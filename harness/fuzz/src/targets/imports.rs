//! Meshes in other programs' formats. What is accepted becomes a leaf set, and its leaves tile no place twice.

use crate::Scratch;
use contract::import::{self, Format, Position, Request, leaf_set};
use contract::lattice::Root;
use contract::word;
use std::path::Path;

/// Imports a file; the first byte chooses options.
fn imported(path: &Path, format: Format, options: u8, side: &str) -> bool {
    let request = Request {
        sides: (options & 1 == 1).then(|| side.to_owned()),
        root: (options & 2 == 2).then_some(Root { origin: [-1.0, 2.0, 0.5], edge: 2.0 }),
        position: [Position::Corner, Position::Centre, Position::Index, Position::Corner]
            [usize::from(options >> 2 & 3)],
    };
    let Ok(cells) = import::read(path, format, &request) else { return false };
    let count = cells.len();
    let Ok(set) = leaf_set(&cells, request.root, None, "fuzz".to_owned()) else { return false };
    assert_eq!(set.words.len(), count);
    assert!(set.words.iter().all(|&word| word::fault(word).is_none()));
    assert!(
        set.words.is_sorted_by(|&a, &b| word::key(a) + word::span(word::level(a)) <= word::key(b))
    );
    true
}

fn file(scratch: &mut Scratch, name: &str, bytes: &[u8], format: Format, side: &str) -> bool {
    let Some((&options, bytes)) = bytes.split_first() else { return false };
    let path = scratch.file(name, bytes);
    // Whatever it returns, it returns. Seldom, because opening a file takes as long as reading it.
    if options & 16 == 16 {
        let _ = import::guess(path);
    }
    imported(path, format, options, side)
}

pub(super) fn npy(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    file(scratch, "table.npy", bytes, Format::Npy, "side")
}

pub(super) fn csv(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    file(scratch, "table.csv", bytes, Format::Csv, "side")
}

pub(super) fn p4est(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    file(scratch, "forest.p8est", bytes, Format::P4est, "data")
}

pub(super) fn discretize(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    file(scratch, "mesh.msh", bytes, Format::Discretize, "side")
}

/// Between the files of a polyMesh.
const SEPARATOR: &[u8] = b"\n@@@@\n";
const FILES: [&str; 5] = ["points", "faces", "owner", "neighbour", "cellLevel"];

/// The five files of a polyMesh, one after the other.
pub(super) fn openfoam(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let Some((&options, mut rest)) = bytes.split_first() else { return false };
    for name in FILES {
        let end = rest.windows(SEPARATOR.len()).position(|window| window == SEPARATOR);
        let (content, after) = rest.split_at(end.unwrap_or(rest.len()));
        scratch.file(&format!("polyMesh/{name}"), content);
        rest = after.strip_prefix(SEPARATOR).unwrap_or_default();
    }
    imported(&scratch.path().join("polyMesh"), Format::Openfoam, options & 1, "cellLevel")
}
