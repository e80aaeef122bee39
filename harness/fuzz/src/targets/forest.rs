//! Forests of p4est. What is accepted becomes a leaf set, and its leaves tile no place twice; any forest can be audited, and is
//! the same as itself.

use crate::Scratch;
use check::checks::CheckResult;
use check::promises::Touching;
use contract::import::{self, Format, Request, forest, leaf_set};
use contract::lattice::Root;
use contract::word;
use std::time::Instant;

/// The first byte chooses options.
pub(super) fn run(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let Some((&options, bytes)) = bytes.split_first() else { return false };
    let path = scratch.file("forest.p8est", bytes);
    // Only a panic is a fault here. Tried for half of the option bytes.
    if options & 16 == 16 {
        let _ = import::guess(path);
    }
    if let Ok(forest) = forest::read(path) {
        let report = check::forest::audit(&forest, Touching::Corner, Instant::now());
        assert_eq!(report.leaves, forest.leaves.iter().flatten().count() as u64);
        assert!(check::forest::diff(&forest, &forest).iter().all(CheckResult::holds));
    }
    let request = Request {
        sides: (options & 1 == 1).then(|| "data".to_owned()),
        root: (options & 2 == 2).then_some(Root { origin: [-1.0, 2.0, 0.5], edge: 2.0 }),
        ..Request::default()
    };
    let Ok(cells) = import::read(path, Format::P4est, &request) else { return false };
    let count = cells.len();
    let Ok(set) = leaf_set(&cells, request.root, None, "fuzz".to_owned()) else { return false };
    assert_eq!(set.words.len(), count);
    assert!(set.words.iter().all(|&word| word::fault(word).is_none()));
    assert!(
        set.words.is_sorted_by(|&a, &b| word::key(a) + word::span(word::level(a)) <= word::key(b))
    );
    true
}
