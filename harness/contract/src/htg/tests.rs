use super::*;
use crate::octant::Octant;
use crate::testing::words_with_sides;
use crate::word::{Side, key, key_of, level, span};
use std::fs;
use tempfile::NamedTempFile;
use vtkhdf::tree::{Siblings, TreeWriter, WINDOW, Window, groups};
use vtkhdf::write::Deflater;

const ROOT: Root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };

/// The nodes of a tree, level by level.
#[derive(Default)]
struct Nodes {
    by_level: Vec<u64>,
    split: Vec<bool>,
    masked: Vec<bool>,
    sides: Vec<u8>,
}

fn nodes_of(words: &[u64]) -> Nodes {
    let (mut nodes, mut octants) = (Nodes::default(), vec![Octant::ROOT]);
    while !octants.is_empty() {
        nodes.by_level.push(octants.len() as u64);
        let mut children = Vec::new();
        for octant in octants {
            let begin = key_of(octant.corner);
            let first = words.get(words.partition_point(|&w| key(w) < begin)).copied();
            let first = first.filter(|&w| key(w) < begin + span(octant.level));
            let is_split = first.is_some_and(|w| level(w) > octant.level);
            nodes.split.push(is_split);
            nodes.masked.push(first.is_none());
            nodes.sides.push(first.filter(|_| !is_split).map_or(0, |w| (w & 3) as u8));
            children.extend((0..8).filter(|_| is_split).map(|d| octant.child(d)));
        }
        octants = children;
    }
    nodes
}

/// A file of these nodes.
fn file_of(nodes: &Nodes) -> NamedTempFile {
    let file = NamedTempFile::new().unwrap();
    let shape = Shape { origin: ROOT.origin, edge: ROOT.edge, nodes: nodes.by_level.clone() };
    let mut out = TreeWriter::new(fs::File::create(file.path()).unwrap(), shape.clone()).unwrap();
    let siblings = |first: usize| {
        let bits = |is_set: &dyn Fn(usize) -> bool| {
            (0..8).map(|i| u8::from(nodes.sides.len() > first + i && is_set(first + i)) << i).sum()
        };
        Siblings {
            split: bits(&|node| nodes.split[node]),
            deleted: bits(&|node| nodes.masked[node]),
            crossing: bits(&|node| nodes.sides[node] & 2 != 0),
            inside: bits(&|node| nodes.sides[node] & 1 != 0),
        }
    };
    for index in 0..shape.windows() {
        let mut window = Window::new(index);
        if index == 0 {
            window.put_root(siblings(0));
        }
        for group in groups(index).take_while(|group| 8 * group + 1 < shape.nodes_total()) {
            window.put(group, siblings(1 + 8 * group as usize));
        }
        out.add(index, &window.compress(&shape, &mut Deflater::default())).unwrap();
    }
    out.finish().unwrap();
    file
}

/// A tree with holes and all sides.
fn words(levels: u8) -> Vec<u64> {
    let pick = |o: &Octant, below: u64| {
        (crate::digest::mix(key_of(o.corner) << 5 | u64::from(o.level)) >> 70) as u64 % below
    };
    words_with_sides(
        |o| o.level < levels && pick(o, 10) < 9,
        |o| Side::ALL.get(pick(o, 4) as usize).copied(),
    )
}

fn words_in(tree: &TreeFile) -> Result<Vec<u64>> {
    let mut all = Vec::new();
    tree.words(&mut |run| {
        all.extend_from_slice(run);
        true
    })?;
    Ok(all)
}

#[test]
fn a_tree_in_several_chunks_is_read_as_a_whole() {
    let words = words(7);
    let nodes = nodes_of(&words);
    assert!(nodes.split.len() as u64 > 2 * WINDOW && nodes.by_level.len() == 8);
    let file = file_of(&nodes);
    let tree = TreeFile::open(file.path()).unwrap();
    assert_eq!((tree.root, &*tree.path), (ROOT, file.path()));
    assert_eq!(words_in(&tree).unwrap(), words);
    assert_eq!(tree.leaves, words.len() as u64);
    let (mut runs, mut read) = (0, 0);
    tree.words(&mut |run| {
        assert!(run.len() < RUN + 8);
        (runs, read) = (runs + 1, read + run.len());
        runs < 2
    })
    .unwrap();
    assert!(runs == 2 && read >= 2 * RUN && read < words.len());
}

#[test]
fn trees_of_one_leaf_and_without_leaves_are_read() {
    for (words, leaves) in [(vec![2], 1), (vec![], 0)] {
        let file = file_of(&nodes_of(&words));
        let tree = TreeFile::open(file.path()).unwrap();
        assert_eq!((words_in(&tree).unwrap(), tree.leaves), (words, leaves));
    }
}

#[test]
fn a_root_that_is_no_cube_is_another_layout() {
    for edge in [0.0, -4.0, f64::NAN, f64::INFINITY] {
        let shape = Shape { origin: ROOT.origin, edge, nodes: vec![1] };
        let file = NamedTempFile::new().unwrap();
        let out = fs::File::create(file.path()).unwrap();
        TreeWriter::new(out, shape).unwrap().finish().unwrap();
        let error = TreeFile::open(file.path()).unwrap_err();
        assert!(matches!(&error, TreeError::Unknown(why) if why.contains("no cube")), "{error}");
    }
}

#[test]
fn nodes_that_are_no_tree_are_damage() {
    let damaged = |edit: &dyn Fn(&mut Nodes)| {
        let mut nodes = nodes_of(&words(5));
        edit(&mut nodes);
        let file = file_of(&nodes);
        let read = TreeFile::open(file.path()).and_then(|tree| words_in(&tree));
        let error = read.unwrap_err();
        assert!(matches!(error, TreeError::Damaged(_)), "{error}");
        error.to_string()
    };
    let split =
        |split: bool, nodes: &Nodes| nodes.split.iter().position(|&is| is == split).unwrap();
    let less = damaged(&|nodes| {
        let last = nodes.split.iter().rposition(|&is| is).unwrap();
        nodes.split[last] = false;
    });
    assert!(
        less.starts_with("is damaged: ") && less.contains("of level 4 are split, and"),
        "{less}"
    );
    let more = damaged(&|nodes| {
        let leaf = split(false, nodes);
        (nodes.split[leaf], nodes.masked[leaf]) = (true, false);
    });
    assert!(more.starts_with("is damaged: ") && more.contains(" are split, and "), "{more}");
    let both = damaged(&|nodes| nodes.masked[0] = true);
    assert_eq!(both, "is damaged: a node is masked and split");
    let side = damaged(&|nodes| {
        let leaf = (0..nodes.split.len()).find(|&i| !nodes.split[i] && !nodes.masked[i]).unwrap();
        nodes.sides[leaf] = 3;
    });
    assert!(side.starts_with("is damaged: node ") && side.ends_with(" has the side 3"), "{side}");
}
