//! STL files and case files: mesher, reference and harness read the same facets and the same case, or all refuse the file.

#[path = "../../../../mesher/tests/support/stl_inputs.rs"]
mod inputs;

use crate::Scratch;
use geometries::Facet;
use mesher::input::ingest::{self, Source};
use mesher::input::lattice::Bounds;
use ranks::Solo;

/// An STL file of any bytes.
pub(super) fn stl(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let mesher = ingest::read(&Source::Stl(scratch.file("body.stl", bytes).to_owned()), &Solo).ok();
    let [mesher, reference, harness] = [
        mesher.and_then(|slice| facet_bits(&slice.facets)),
        reference::stl::parse(bytes).ok().and_then(|facets| facet_bits(&facets)),
        contract::stl::parse(bytes).ok().and_then(|body| facet_bits(&body.facets)),
    ];
    assert!(
        mesher == reference && reference == harness,
        "facets by mesher, reference and harness: {:?}",
        [&mesher, &reference, &harness].map(|read| read.as_ref().map(Vec::len))
    );
    mesher.is_some()
}

/// An STL file that is nearly always nearly valid, drawn with these bytes as the seed.
pub(super) fn stl_grammar(scratch: &mut Scratch, seed: &[u8]) -> bool {
    let seed = seed.iter().fold(0u64, |seed, &byte| seed.rotate_left(8) ^ u64::from(byte));
    stl(scratch, &inputs::input(&mut inputs::Random(seed)))
}

/// The bits of the coordinates; `None` if one is not finite, which each program refuses in a later step.
fn facet_bits(facets: &[Facet]) -> Option<Vec<u32>> {
    let flat = facets.as_flattened().as_flattened();
    flat.iter().all(|c| c.is_finite()).then(|| flat.iter().map(|c| c.to_bits()).collect())
}

const BODY: &[u8] = b"solid
facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 1 0 vertex 1 0 0 endloop endfacet
facet normal 0 0 0 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 0 1 endloop endfacet
facet normal 0 0 0 outer loop vertex 0 0 0 vertex 0 0 1 vertex 0 1 0 endloop endfacet
facet normal 0 0 0 outer loop vertex 1 0 0 vertex 0 1 0 vertex 0 0 1 endloop endfacet
endsolid";

/// More facets would take longer than all else.
const FACETS_MAX: usize = 3000;

/// A case on the lattice, as all programs understand it.
#[derive(Debug, PartialEq)]
struct Meaning {
    facets: Vec<[[i64; 3]; 3]>,
    root: ([f64; 3], f64),
    /// The surface level and `layer_cells_min`.
    numbers: [u32; 2],
    /// `keep`, `keep_crossing` and `enclosed`.
    kept: String,
    boxes: Vec<([i64; 3], [i64; 3], u32)>,
    /// Lattice points.
    seeds: Vec<[i64; 3]>,
}

/// A case file, in a directory with `body.stl`, a tetrahedron.
pub(super) fn case(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let generator = str::from_utf8(bytes)
        .ok()
        .and_then(|text| text.parse::<toml::Table>().ok())
        .and_then(|table| table.get("generator")?.get("facets")?.as_integer());
    // Counts that a shape refuses are tried, and those that would take memory and time are not.
    if generator.is_some_and(|facets| (FACETS_MAX as i64..1 << 40).contains(&facets)) {
        return false;
    }
    scratch.file("body.stl", BODY);
    let path = scratch.file("case.toml", bytes).to_owned();
    // The path of another file, which might be a large one.
    if let Ok(case) = case_file::read(&path)
        && let Source::Stl(body) = case.source
        && body != path.with_file_name("body.stl")
    {
        return false;
    }
    let (mesher, reference, harness) = (by_mesher(&path), by_reference(&path), by_harness(&path));
    // The reference alone refuses a box whose cells would not fit into memory.
    if !matches!(reference, Err(reference::Error::TooManyCells { .. })) {
        assert_eq!(mesher.as_ref().ok(), reference.as_ref().ok(), "{mesher:?}\n{reference:?}");
    }
    // Here only the harness looks whether a seed lies in the flow.
    let has_seeds = mesher.as_ref().is_ok_and(|case| !case.seeds.is_empty());
    if !(has_seeds && harness.is_err()) {
        assert_eq!(mesher.as_ref().ok(), harness.as_ref().ok(), "{mesher:?}\n{harness:?}");
    }
    mesher.is_ok()
}

/// A coordinate of a seed, where the reference cuts it off: outside of the root.
fn near(x: i64) -> i64 {
    x.clamp(-1, 1 << 27)
}

fn by_mesher(path: &std::path::Path) -> Result<Meaning, String> {
    let meaning = || {
        let case = case_file::read(path)?;
        let slice = ingest::read(&case.source, &Solo)?;
        let bounds = Bounds::of(&slice.facets);
        let rules = case.rules(&bounds)?;
        let facets = rules.root.facets(slice.facets, &bounds, 0)?;
        Ok(Meaning {
            facets: facets.iter().map(|facet| facet.v.map(|v| v.map(i64::from))).collect(),
            root: (rules.root.origin, rules.root.edge),
            numbers: [rules.level_surface, rules.layer_cells_min],
            kept: format!("{:?}", (rules.keep, rules.keep_crossing, rules.enclosed)),
            boxes: rules.boxes.iter().map(|b| (b.min, b.max, b.level)).collect(),
            seeds: rules.seeds.iter().map(|seed| seed.lattice.map(near)).collect(),
        })
    };
    meaning().map_err(|error: mesher::error::Error| error.to_string())
}

fn by_reference(path: &std::path::Path) -> Result<Meaning, reference::Error> {
    let input = reference::lattice::Input::new(&reference::case_file::read(path)?)?;
    Ok(Meaning {
        facets: input.facets,
        root: (input.root.origin, input.root.edge),
        numbers: [input.level_surface, input.layer_cells_min],
        kept: format!("{:?}", (input.keep, input.keep_crossing, input.enclosed)),
        boxes: input.boxes.iter().map(|b| (b.extent.min, b.extent.max, b.level)).collect(),
        seeds: input.seeds.iter().map(|seed| seed.point).collect(),
    })
}

fn by_harness(path: &std::path::Path) -> Result<Meaning, String> {
    let case = contract::case::Case::read(path).map_err(|error| error.to_string())?;
    Ok(Meaning {
        root: (case.root.origin, case.root.edge),
        numbers: [u32::from(case.level_surface), case.layer_cells_min],
        kept: format!("{:?}", (case.keep, case.keep_crossing, case.enclosed)),
        boxes: case.boxes.iter().map(|b| (b.min, b.max, u32::from(b.level))).collect(),
        seeds: case.rules.seeds.clone(),
        facets: case.facets_lattice,
    })
}
