//! STL files: mesher, reference and harness read the same facets, or all refuse the file.

#[path = "../../../../mesher/tests/support/stl_inputs.rs"]
mod inputs;

use crate::Scratch;
use geometries::Facet;
use mesher::input::ingest::{self, Source};
use ranks::Solo;

/// Any bytes.
pub(super) fn bytes(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let mesher = ingest::read(&Source::Stl(scratch.file("body.stl", bytes).to_owned()), &Solo).ok();
    let [mesher, reference, harness] = [
        mesher.and_then(|slice| bits(&slice.facets)),
        reference::stl::parse(bytes).ok().and_then(|facets| bits(&facets)),
        contract::stl::parse(bytes).ok().and_then(|body| bits(&body.facets)),
    ];
    assert!(
        mesher == reference && reference == harness,
        "facets by mesher, reference and harness: {:?}",
        [&mesher, &reference, &harness].map(|read| read.as_ref().map(Vec::len))
    );
    mesher.is_some()
}

/// A file that is nearly always nearly valid, drawn with these bytes as the seed.
pub(super) fn grammar(scratch: &mut Scratch, seed: &[u8]) -> bool {
    let seed = seed.iter().fold(0u64, |seed, &byte| seed.rotate_left(8) ^ u64::from(byte));
    bytes(scratch, &inputs::input(&mut inputs::Random(seed)))
}

/// The bits of the coordinates; `None` if one is not finite, which each program refuses in a later step.
fn bits(facets: &[Facet]) -> Option<Vec<u32>> {
    let flat = facets.as_flattened().as_flattened();
    flat.iter().all(|c| c.is_finite()).then(|| flat.iter().map(|c| c.to_bits()).collect())
}
