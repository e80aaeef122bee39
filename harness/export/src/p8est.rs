//! Forests for `p8est_load` of p4est: of 2.2 and versions before, and, if their names end in `.30.p8est`, of those since mid-2020.
//!
//! The file is that of `p8est_save`: the connectivity of one tree, whose vertices are the corners of the root; the header; and
//! the quadrants in Morton order. It is described in `contract::import::forest`, which reads it.
//!
//! A tree of p4est has no holes. What the mesh or the selection leaves out is filled with the fewest possible quadrants, and the
//! data of each quadrant, one byte, is its side, [`NO_SIDE`] or [`FILLER`]: a solver skips fillers, or gives them a material of their own.
//! The saved partition is that of one rank: p4est makes a uniform one, which is that of the mesher within its tolerance.

use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use contract::failure::{Failure, Result};
use contract::files;
use contract::import::forest::{ALIGNMENT, FORMAT};
use contract::import::p4est::{FILLER, NO_SIDE};
use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::manifest::Sides;
use contract::mesh::Leaf;
use contract::octant::{LEVEL_MAX, Octant};
use contract::word::{self, KEY_END, Order, Side};

use crate::options::{Export, Summary};

/// Deepest level of quadrants (`P8EST_QMAXLEVEL`). Coordinates are in units of one level more, like ours.
const QUADRANT_LEVEL_MAX: u8 = LEVEL_MAX - 1;
/// How names of forests end whose coordinates are in units of 2^-30 of the root (`P8EST_MAXLEVEL` since mid-2020).
const FINE: &[u8] = b".30.p8est";
/// `sizeof(p8est_quadrant_t)`, which `p8est_load` compares.
const QUADRANT_STRUCT_BYTES: u64 = 24;
/// The version of p4est whose format this is, which `p8est_connectivity_save` writes after the name of the format.
const VERSION: &[u8] = b"2.2";

/// Writes the selected leaves and the fillers as a forest. The numbers of quadrants precede them, and are written last.
///
/// # Errors
/// If no leaf is selected, if one is deeper than level 18, if the mesh cannot be read or the file cannot be written, or if
/// the user interrupts.
pub fn write(export: &Export<'_>, path: &Path) -> Result<Summary> {
    let leaves = export.count()?;
    let shift = if path.as_os_str().as_encoded_bytes().ends_with(FINE) { 11 } else { 0 };
    let start = |quadrants: u64| {
        let mut bytes = connectivity(&export.mesh.manifest.root);
        // Format; bytes of a coordinate, of a quadrant in memory, and of its data; whether data are saved; ranks; the ends of the only
        // rank and of the only tree.
        let header = [FORMAT, 4, QUADRANT_STRUCT_BYTES, 1, 1, 1, quadrants, quadrants];
        bytes.extend_from_slice(bytemuck::bytes_of(&header));
        pad(&mut bytes);
        bytes
    };
    let named = |error| Failure::at(path, error);
    let mut count = 0;
    let bytes = files::fill_atomically(path, |file| {
        let mut out = BufWriter::new(file);
        out.write_all(&start(0)).map_err(named)?;
        let (mut order, mut cells, mut volume) = (Order::default(), 0, 0);
        quadrants(export, &mut |octant, data| {
            count += 1;
            order.add(word::encode(octant, Side::Outside)).expect("octants in order");
            cells += u64::from(data != FILLER);
            volume += word::span(octant.level);
            let [x, y, z] = octant.corner.map(|at| at << shift);
            out.write_all(bytemuck::bytes_of(&[x, y, z, octant.level.into()])).map_err(named)?;
            out.write_all(&[data]).map_err(named)
        })?;
        let tiled = (leaves, KEY_END);
        assert_eq!((cells, volume), tiled, "the selected leaves and fillers tile the root");
        let begun = out.seek(SeekFrom::Start(0)).and_then(|_| out.write_all(&start(count)));
        begun.and_then(|()| out.flush()).map_err(named)
    })?;
    let fillers = count - leaves;
    let what = "more quadrants, whose data are 3 (in MFEM: attribute 4), fill the root";
    let whose = match shift {
        0 => "before mid-2020; a name that ends in .30.p8est makes one for later versions",
        _ => "since mid-2020; no earlier version loads it",
    };
    let notes = vec![format!("{fillers} {what}"), format!("the file is for p4est {whose}")];
    Ok(Summary { leaves, bytes, notes })
}

/// Visits the quadrants of the forest in Morton order, with their data.
fn quadrants(export: &Export<'_>, visit: &mut impl FnMut(Octant, u8) -> Result<()>) -> Result<()> {
    let has_sides = export.mesh.manifest.sides == Sides::Known;
    let mut next = 0;
    export.selection.visit(export.mesh, &mut |Leaf { octant, side, .. }| {
        if octant.level > QUADRANT_LEVEL_MAX {
            return Err(Failure::input(format!(
                "{octant} is too deep: p4est has levels 0 to {QUADRANT_LEVEL_MAX} (--level-max omits deeper leaves)"
            )));
        }
        let key = word::key_of(octant.corner);
        fill(next, key).try_for_each(|octant| visit(octant, FILLER))?;
        next = key + word::span(octant.level);
        visit(octant, if has_sides { side as u8 } else { NO_SIDE })
    })?;
    fill(next, KEY_END).try_for_each(|octant| visit(octant, FILLER))
}

/// The fewest octants that cover the Morton codes from `key` to `end`, in order.
fn fill(mut key: u64, end: u64) -> impl Iterator<Item = Octant> {
    std::iter::from_fn(move || {
        let fits = |level: &u8| key & (word::span(*level) - 1) == 0;
        let level = (0..=LEVEL_MAX).find(|level| fits(level) && word::span(*level) <= end - key)?;
        let octant = Octant { corner: word::corner_of(key), level };
        key += word::span(level);
        Some(octant)
    })
}

/// The connectivity of one tree, as `p8est_connectivity_new_unitcube` makes it, with the corners of the root as vertices. If their
/// difference has lost digits of the edge, the edge is the attribute of the tree.
fn connectivity(root: &Root) -> Vec<u8> {
    let mut bytes = b"p8est\0\0\0".to_vec();
    bytes.extend(VERSION);
    bytes.resize(ALIGNMENT, 0);
    // Format, bytes of an index, and numbers of vertices, trees, edges, trees at edges, corners, trees at corners, bytes of
    // attributes; the last number is reserved.
    let is_lost = root.to_user([UNITS_PER_EDGE; 3])[0] - root.origin[0] != root.edge;
    let attribute = if is_lost { &root.edge.to_le_bytes()[..] } else { &[] };
    let numbers = [FORMAT, 4, 8, 1, 0, 0, 0, 0, attribute.len() as u64, 0];
    bytes.extend_from_slice(bytemuck::bytes_of(&numbers));
    for vertex in 0..8 {
        let corner = std::array::from_fn(|a| (vertex >> a & 1) * UNITS_PER_EDGE);
        bytes.extend_from_slice(bytemuck::bytes_of(&root.to_user(corner)));
    }
    // Vertices of the tree; its neighbours across faces, which are itself; their faces; offsets of no edges and corners.
    (0..8u32).for_each(|vertex| bytes.extend(vertex.to_le_bytes()));
    bytes.extend([0; 6 * 4]);
    bytes.extend(0..6u8);
    bytes.extend(attribute);
    bytes.extend([0; 2 * 4]);
    pad(&mut bytes);
    bytes
}

/// Appends zero bytes up to a multiple of [`ALIGNMENT`].
fn pad(bytes: &mut Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(ALIGNMENT), 0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selection::Selection;
    use crate::testing::{export, stored};
    use contract::import::p4est::read;
    use contract::import::{Request, leaf_set};
    use contract::leafset::LeafSet;
    use contract::mesh::Mesh;
    use contract::testing::{random_words, words_of};
    use contract::word::Side;
    use proptest::prelude::*;
    use std::fs;

    const ROOT: Root = Root { origin: [-1.0, 2.0, 0.5], edge: 4.0 };

    fn mesh_of(parts: Vec<Vec<u64>>) -> Mesh {
        // The files remain open.
        stored(parts, ROOT).1
    }

    /// The leaf set that a reader makes of a file, with or without the data of the quadrants.
    fn import(path: &Path, sides: bool) -> LeafSet {
        let request = Request { sides: sides.then(|| "data".to_owned()), ..Request::default() };
        let cells = read(path, &request).unwrap();
        leaf_set(&cells, None, None, "test".to_owned()).unwrap()
    }

    fn exported(mesh: &Mesh, selection: &Selection) -> (tempfile::TempDir, Summary) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("forest.p8est");
        let summary = write(&export(mesh, selection), &path).unwrap();
        assert_eq!(fs::metadata(path).unwrap().len(), summary.bytes);
        (dir, summary)
    }

    /// The saved number of quadrants.
    fn quadrants_saved(path: &Path) -> u64 {
        let bytes = fs::read(path).unwrap();
        let number = |i: usize| u64::from_le_bytes(bytes[384 + 8 * i..][..8].try_into().unwrap());
        assert_eq!((number(5), number(6)), (1, number(7)));
        number(7)
    }

    proptest! {
        #[test]
        fn a_forest_read_again_has_the_leaves_and_a_complete_tree(
            words in random_words(5), parts in 1usize..5, interleaved in any::<bool>()
        ) {
            prop_assume!(!words.is_empty());
            let size = words.len().div_ceil(parts);
            let mut by_part = vec![Vec::new(); parts];
            for (i, &w) in words.iter().enumerate() {
                by_part[if interleaved { i % parts } else { i / size }].push(w);
            }
            let mesh = mesh_of(by_part);
            let (dir, summary) = exported(&mesh, &Selection::default());
            let path = dir.path().join("forest.p8est");
            let fillers = quadrants_saved(&path) - words.len() as u64;
            prop_assert!(summary.notes[0].starts_with(&format!("{fillers} more quadrants, whose data are 3 (in MFEM: attribute 4)")) && summary.notes[1].contains("for p4est"), "{summary:?}");
            let set = import(&path, true);
            prop_assert_eq!(set.manifest.digest, mesh.manifest.digest);
            prop_assert_eq!(set.manifest.root, ROOT);
            // Most quadrants are octants of a tree of the other length.
            let fine = dir.path().join("forest.30.p8est");
            write(&export(&mesh, &Selection::default()), &fine).unwrap();
            prop_assert_eq!(&import(&fine, true).words, &words);
            let differ = fs::read(&fine).unwrap() != fs::read(&path).unwrap();
            prop_assert_eq!(differ, words.len() > 1);
            prop_assert_eq!(set.words, words);
            let complete = import(&path, false);
            let filled: u64 = complete.words.iter().map(|&w| word::span(word::level(w))).sum();
            prop_assert_eq!(filled, KEY_END);
            prop_assert_eq!(quadrants_saved(&path), complete.manifest.leaves);
        }

        #[test]
        fn what_a_selection_leaves_out_is_filled(words in random_words(4), level in 0u8..5) {
            let selection = Selection { level_max: Some(level), ..Selection::default() };
            let expected: Vec<u64> =
                words.iter().copied().filter(|&w| word::level(w) <= level).collect();
            prop_assume!(!expected.is_empty());
            let (dir, _) = exported(&mesh_of(vec![words]), &selection);
            prop_assert_eq!(import(&dir.path().join("forest.p8est"), true).words, expected);
        }

        #[test]
        fn no_changed_byte_of_a_quadrant_goes_unnoticed(
            words in random_words(4), at in any::<prop::sample::Index>(), bit in 0u8..8
        ) {
            prop_assume!(!words.is_empty());
            let mesh = mesh_of(vec![words]);
            let (dir, _) = exported(&mesh, &Selection::default());
            let path = dir.path().join("forest.p8est");
            let mut bytes = fs::read(&path).unwrap();
            let quadrants = 17 * quadrants_saved(&path) as usize;
            let at = bytes.len() - 1 - at.index(quadrants);
            bytes[at] ^= 1 << bit;
            fs::write(&path, bytes).unwrap();
            let request = Request { sides: Some("data".to_owned()), ..Request::default() };
            let read = read(&path, &request)
                .and_then(|cells| leaf_set(&cells, None, None, "test".to_owned()));
            // The side of the only leaf may become unknown, which the manifest states.
            let stated = |of: &contract::manifest::Manifest| (of.digest, of.sides);
            prop_assert!(
                read.map_or(true, |set| stated(&set.manifest) != stated(&mesh.manifest))
            );
        }
    }

    #[test]
    fn leaves_of_unknown_sides_are_read_again_without_fillers() {
        let words = words_of(|o| o.level < 2)[3..].to_vec();
        let (dir, mut mesh) = stored(vec![words.iter().map(|word| word & !3).collect()], ROOT);
        mesh.manifest.sides = Sides::Unknown;
        let (forest, _) = exported(&mesh, &Selection::default());
        let path = forest.path().join("forest.p8est");
        let set = import(&path, true);
        assert_eq!(
            (set.manifest.sides, set.manifest.digest),
            (Sides::Unknown, mesh.manifest.digest)
        );
        // A side beside unknown ones is no file of an export.
        let mut bytes = fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() = 1;
        fs::write(dir.path().join("changed"), bytes).unwrap();
        let request = Request { sides: Some("data".to_owned()), ..Request::default() };
        let error = read(&dir.path().join("changed"), &request).unwrap_err().to_string();
        assert!(error.contains("only some of its leaves have a side"), "{error}");
    }

    proptest! {
        #[test]
        fn a_root_is_kept_to_the_last_bit(origin in prop::array::uniform3(-1e3f64..1e3), edge in 1e-3f64..1e3) {
            let root = Root { origin, edge };
            let (_dir, mesh) = stored(vec![words_of(|o| o.level < 2)], root);
            let (dir, _) = exported(&mesh, &Selection::default());
            let found = import(&dir.path().join("forest.p8est"), true).manifest.root;
            prop_assert_eq!(found.edge.to_bits(), edge.to_bits());
            prop_assert_eq!(found.origin.map(f64::to_bits), origin.map(f64::to_bits));
        }
    }

    #[test]
    fn the_connectivity_is_that_of_p4est() {
        let sample =
            concat!(env!("CARGO_MANIFEST_DIR"), "/../contract/tests/samples/unitcube.p8est");
        let cube = connectivity(&Root { origin: [0.0; 3], edge: 1.0 });
        assert_eq!(cube, fs::read(sample).unwrap()[..cube.len()]);
    }

    /// All intervals of 64 cells.
    #[test]
    fn a_hole_is_filled_with_the_fewest_octants() {
        let unit = word::span(17);
        for begin in 0..64 {
            for end in begin..=64 {
                let octants: Vec<Octant> = fill(begin * unit, end * unit).collect();
                let mut next = begin * unit;
                for octant in &octants {
                    assert_eq!(word::key_of(octant.corner), next);
                    next += word::span(octant.level);
                }
                assert_eq!(next, end * unit);
                let siblings = |w: &[Octant]| {
                    w.iter().zip(0..).all(|(o, d)| o.level == w[0].level && o.digit() == d)
                };
                assert!(!octants.windows(8).any(siblings), "{begin} to {end}");
            }
        }
    }

    #[test]
    fn a_mesh_that_p4est_cannot_represent_is_refused_and_no_file_is_written() {
        let deep = words_of(|o| o.corner == [0; 3] && o.level < 19);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("forest.p8est");
        let refusal = |selection: &Selection| {
            let mesh = &mesh_of(vec![deep.clone()]);
            write(&export(mesh, selection), &path)
        };
        let error = refusal(&Selection::default()).unwrap_err().to_string();
        assert!(error.contains("p4est has levels 0 to 18"), "{error}");
        let none = Selection { side: Some(Side::Inside), ..Selection::default() };
        let error = refusal(&none).unwrap_err().to_string();
        assert!(error.contains("no leaf satisfies"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        // The eight leaves of level 19 become one quadrant of level 18.
        let coarse = Selection { level_max: Some(18), ..Selection::default() };
        let leaves = refusal(&coarse).unwrap().leaves;
        assert_eq!(quadrants_saved(&path), leaves + 1);
    }
}
