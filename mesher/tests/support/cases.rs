//! Small cases of unit tests.
#![allow(dead_code, missing_docs)]

use bricks::brick::Brick;
use bricks::brickset::BrickSet;
use bricks::tree::Tree;
use geometries::{Generator, Shape};
use mesher::Options;
use mesher::input::case::{BoxSpec, Case, RootSpec};
use mesher::input::ingest::Source;
use mesher::input::lattice::{Enclosed, Keep, Root, Rules};

pub fn case() -> Case {
    let extent = BoxSpec { min: [-0.2; 3], max: [0.9, 0.2, 0.2], spacing: 0.03 };
    Case {
        source: Source::Generated(Generator::new(Shape::Sphere, 1280)),
        spacing_min: 0.01,
        layer_cells_min: 4,
        keep: Keep::Outside,
        keep_crossing: true,
        root: RootSpec::Scale(4.0),
        boxes: vec![extent],
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

pub fn options() -> Options {
    Options::default()
}

/// Rules with surface level 3 that keep everything.
pub fn rules() -> Rules {
    Rules {
        root: Root { origin: [0.0; 3], edge: 1.0 },
        level_surface: 3,
        layer_cells_min: 1,
        keep: Keep::All,
        keep_crossing: true,
        boxes: vec![],
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

/// The set of octants with these codes.
pub fn set<'a>(codes: impl IntoIterator<Item = &'a u64>) -> BrickSet {
    let brick = |c: &u64| Brick { key: c >> 6, bits: 1 << (c & 63) };
    BrickSet::from_unsorted(codes.into_iter().map(brick).collect())
}

/// A tree of level 3 around a facet at the root's minimum corner.
pub fn small() -> Tree {
    let mut tree = Tree::default();
    for l in 0..3 {
        tree.split[l] = set(&[0]);
    }
    tree.crossing[3] = set(&[0, 1]);
    tree.check_structure();
    tree
}
