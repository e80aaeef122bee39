use super::*;
use crate::octant::Octant;
use crate::testing::words_with_sides;
use crate::word::{Side, key, key_of, level, span};
use std::fs;
use tempfile::NamedTempFile;
use vtkhdf::write::{Deflater, Writer};

const ROOT: Root = Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 };

/// The nodes of a tree, level by level.
#[derive(Default)]
struct Nodes {
    by_level: Vec<i64>,
    split: Vec<bool>,
    masked: Vec<bool>,
    sides: Vec<u8>,
    /// One for each node, or none.
    ranks: Vec<i32>,
}

fn nodes_of(words: &[u64]) -> Nodes {
    let (mut nodes, mut octants) = (Nodes::default(), vec![Octant::ROOT]);
    while !octants.is_empty() {
        nodes.by_level.push(octants.len() as i64);
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

fn packed(bits: &[bool]) -> Vec<u8> {
    let byte = |eight: &[bool]| (0..).zip(eight).map(|(i, &bit)| u8::from(bit) << (7 - i)).sum();
    bits.chunks(8).map(byte).collect()
}

/// A file of these nodes in chunks of 512 bytes, in which `edit` has changed the grid.
fn file_of(nodes: &Nodes, edit: impl FnOnce(&mut Group)) -> NamedTempFile {
    let file = NamedTempFile::new().unwrap();
    let mut out = Writer::new(fs::File::create(file.path()).unwrap()).unwrap();
    let mut array_of = |kind: Kind, bytes: &[u8]| {
        let mut array = Chunked::new(kind, (bytes.len() / kind.bytes()) as u64, 512);
        let chunk_bytes = array.chunk_bytes();
        for (slot, chunk) in array.chunks.iter_mut().zip(bytes.chunks(chunk_bytes)) {
            let mut chunk = chunk.to_vec();
            chunk.resize(chunk_bytes, 0);
            *slot = Deflater::default().compress(&chunk).map(|chunk| out.append(&chunk).unwrap());
        }
        Member::Chunked(array)
    };
    let ranks: Vec<u8> = nodes.ranks.iter().flat_map(|rank| rank.to_le_bytes()).collect();
    let ranks = (!ranks.is_empty()).then(|| (RANK.to_owned(), array_of(Kind::Int32, &ranks)));
    let mut array = |bytes: &[u8]| array_of(Kind::Byte, bytes);
    let total = nodes.split.len();
    let described = (total - *nodes.by_level.last().unwrap() as usize).max(1);
    let ints = |numbers: Vec<i64>| Member::Small(Value::Ints(numbers));
    let data = [(SIDE.to_owned(), array(&nodes.sides))].into_iter().chain(ranks);
    let data = Group { members: data.collect(), ..Group::default() };
    let mut members = vec![
        ("NumberOfTrees", ints(vec![1])),
        ("NumberOfCellsPerTreeDepth", ints(nodes.by_level.clone())),
        ("NumberOfCells", ints(vec![total as i64])),
        ("DescriptorsSize", ints(vec![described as i64])),
        ("Descriptors", array(&packed(&nodes.split[..described]))),
        ("Mask", array(&packed(&nodes.masked))),
        (CELL_DATA, Member::Group(data)),
    ];
    for (name, low) in COORDINATES.into_iter().zip(ROOT.origin) {
        members.push((name, Member::Small(Value::Doubles(vec![low, low + ROOT.edge]))));
    }
    let attributes = [
        ("Type", Value::Text(TYPE.to_owned())),
        ("BranchFactor", Value::Number(2)),
        ("Dimensions", Value::Ints32(vec![2; 3])),
        (EDGE, Value::Doubles(vec![ROOT.edge])),
    ];
    let mut grid = Group {
        attributes: attributes.map(|(name, value)| (name.to_owned(), value)).into(),
        members: members.into_iter().map(|(name, member)| (name.to_owned(), member)).collect(),
    };
    edit(&mut grid);
    let members = vec![(GROUP.to_owned(), Member::Group(grid))];
    out.finish(&Group { members, ..Group::default() }).unwrap();
    file
}

/// A tree with holes and all sides, whose arrays have several chunks.
fn words() -> Vec<u64> {
    let pick = |o: &Octant, below: u64| {
        (crate::digest::mix(key_of(o.corner) << 5 | u64::from(o.level)) >> 70) as u64 % below
    };
    words_with_sides(
        |o| o.level < 5 && pick(o, 10) < 9,
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
fn a_tree_in_several_chunks_is_read_as_a_whole_and_octant_by_octant() {
    let words = words();
    let nodes = nodes_of(&words);
    assert!(nodes.split.len() > 10_000 && nodes.by_level.len() == 6);
    let file = file_of(&nodes, |_| ());
    let tree = TreeFile::open(file.path(), Some(SIDE)).unwrap();
    assert_eq!((tree.root, tree.has_sides(), tree.path()), (ROOT, true, file.path()));
    assert_eq!(words_in(&tree).unwrap(), words);
    let index = tree.index().unwrap();
    assert_eq!(index.leaves, words.len() as u64);
    let mut cursor = Cursor::new(&tree, &index);
    for level in 0..=6u8 {
        for octant in (0..1u64 << (3 * level)).step_by(1 + (1 << level) * 5) {
            let (begin, end) = (octant * span(level), (octant + 1) * span(level));
            let first = words.partition_point(|&w| key(w) < begin);
            let last = words.partition_point(|&w| key(w) < end);
            let mut found = Vec::new();
            cursor.words(begin, level, &mut found).unwrap();
            assert_eq!(found, words[first..last], "octant {octant} of level {level}");
            assert_eq!(cursor.leaves_before(begin).unwrap(), first as u64);
        }
    }
    let without_sides = TreeFile::open(file.path(), None).unwrap();
    let expected: Vec<u64> = words.iter().map(|w| w & !word::SIDE_BITS).collect();
    assert_eq!((without_sides.has_sides(), words_in(&without_sides).unwrap()), (false, expected));
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
        let file = file_of(&nodes_of(&words), |_| ());
        let tree = TreeFile::open(file.path(), Some(SIDE)).unwrap();
        assert_eq!((words_in(&tree).unwrap(), tree.index().unwrap().leaves), (words, leaves));
    }
}

#[test]
fn ranks_are_read_with_the_words_if_there_is_one_for_each_node() {
    let words = words();
    let ranked = |count: usize, rank: fn(usize) -> i32| {
        let mut nodes = nodes_of(&words);
        nodes.ranks = (0..nodes.split.len().min(count)).map(rank).collect();
        let file = file_of(&nodes, |_| ());
        (TreeFile::open(file.path(), Some(SIDE)).unwrap(), nodes, file)
    };
    let read = |tree: &TreeFile| {
        let (mut found, mut ranks) = (Vec::new(), Vec::new());
        let index = tree.index().unwrap();
        let read = Cursor::new(tree, &index).words_and_ranks(0, 0, &mut found, &mut ranks);
        read.map(|()| (found, ranks))
    };
    let (tree, nodes, _file) = ranked(usize::MAX, |node| node as i32 % 77);
    let (found, ranks) = read(&tree).unwrap();
    assert!(tree.has_ranks() && found == words && ranks.len() == words.len());
    // Nodes are counted level by level, so the rank of the first leaf of a level is known.
    for by_level in [3, 4, 5] {
        let first: i64 = nodes.by_level[..by_level].iter().sum();
        let is_leaf = |&i: &usize| !nodes.split[i] && !nodes.masked[i];
        let node = (first as usize..nodes.split.len()).find(is_leaf).unwrap();
        let leaf = words.iter().position(|&w| usize::from(level(w)) == by_level);
        assert_eq!(leaf.map(|leaf| ranks[leaf]), Some(node as u32 % 77), "level {by_level}");
    }
    for (tree, _, _file) in [ranked(0, |_| 0), ranked(5, |_| 0)] {
        assert!(!tree.has_ranks());
        assert_eq!(read(&tree).unwrap(), (words.clone(), vec![]));
    }
    let (tree, _, _file) = ranked(usize::MAX, |_| -1);
    assert!(read(&tree).unwrap_err().to_string().ends_with("has the rank -1"));
}

#[test]
fn without_the_edge_the_root_is_that_of_the_coordinates() {
    let nodes = nodes_of(&[2]);
    let root = |edit: &dyn Fn(&mut Group)| {
        TreeFile::open(file_of(&nodes, edit).path(), None).map(|tree| tree.root)
    };
    let without_edge = |grid: &mut Group| grid.attributes.retain(|(name, _)| name != EDGE);
    assert_eq!(root(&without_edge).unwrap(), ROOT);
    let with_edge = |edge: f64| {
        root(&move |grid: &mut Group| {
            without_edge(grid);
            grid.attributes.push((EDGE.to_owned(), Value::Doubles(vec![edge])));
        })
    };
    // The coordinates have lost digits of it.
    assert_eq!(with_edge(4.000001).unwrap().edge, 4.000001);
    for edge in [4.001, 3.999, 0.0, -4.0, f64::NAN, f64::INFINITY] {
        let why = with_edge(edge).unwrap_err().to_string();
        assert!(why.contains("are not those of a cube of edge"), "{why}");
    }
    let with_axis = |name: &'static str, ends: Vec<f64>| {
        root(&move |grid: &mut Group| {
            grid.members.retain(|(other, _)| other != name);
            grid.members.push((name.to_owned(), Member::Small(Value::Doubles(ends.clone()))));
        })
    };
    assert_eq!(with_axis("YCoordinates", vec![7.0, 11.0]).unwrap().origin, [-1.0, 7.0, 2.0]);
    for ends in
        [vec![7.0, 12.0], vec![7.0, 10.0], vec![7.0], vec![7.0, 11.0, 15.0], vec![f64::NAN, 4.0]]
    {
        assert!(matches!(with_axis("ZCoordinates", ends), Err(TreeError::Layout(_))));
    }
}

#[test]
fn another_layout_is_named() {
    let nodes = nodes_of(&words());
    let refused = |edit: &dyn Fn(&mut Group), sides| {
        let error = TreeFile::open(file_of(&nodes, edit).path(), sides).unwrap_err();
        assert!(error.is_of_another_layout());
        error.to_string().replace("is not a hyper-tree grid of one oct-tree: ", "")
    };
    let without = |name: &'static str| {
        refused(
            &move |grid: &mut Group| {
                grid.members.retain(|(other, _)| other != name);
                grid.attributes.retain(|(other, _)| other != name);
            },
            None,
        )
    };
    for name in [
        "Type",
        "BranchFactor",
        "Dimensions",
        "NumberOfTrees",
        "NumberOfCells",
        "DescriptorsSize",
        "Descriptors",
    ] {
        assert_eq!(without(name), format!("it has no {name}"));
    }
    assert_eq!(without("NumberOfCellsPerTreeDepth"), "it has no NumberOfCellsPerTreeDepth");
    assert_eq!(without("XCoordinates"), "its XCoordinates are not two coordinates");
    let with = |name: &'static str, numbers: Vec<i64>| {
        refused(
            &move |grid: &mut Group| {
                grid.members.retain(|(other, _)| other != name);
                grid.members.push((name.to_owned(), Member::Small(Value::Ints(numbers.clone()))));
            },
            None,
        )
    };
    assert_eq!(with("NumberOfTrees", vec![2]), "its NumberOfTrees is Ints([2]), not Ints([1])");
    for counts in [
        vec![2],
        vec![],
        vec![1, 7],
        vec![1, 16],
        vec![1, 8, 0],
        vec![1, 8, 72],
        vec![1, -8],
        [vec![1], vec![8; 20]].concat(),
    ] {
        let why = with("NumberOfCellsPerTreeDepth", counts);
        assert!(why.ends_with("is not that of an oct-tree of at most 20 levels"), "{why}");
    }
    assert_eq!(refused(&|_| (), Some("body")), "it has no cell data body of unsigned bytes");
    let no_data = |grid: &mut Group| grid.members.retain(|(name, _)| name != CELL_DATA);
    assert_eq!(refused(&no_data, Some(SIDE)), "it has no cell data side of unsigned bytes");
    let mask = |grid: &mut Group| {
        grid.members.retain(|(name, _)| name != "Mask");
        grid.members.push(("Mask".to_owned(), Member::Chunked(Chunked::new(Kind::Byte, 5, 5))));
    };
    assert!(refused(&mask, None).starts_with("its Mask is not an array of "));
}

#[test]
fn nodes_that_are_no_tree_are_damage() {
    let damaged = |edit: &dyn Fn(&mut Nodes)| {
        let mut nodes = nodes_of(&words());
        edit(&mut nodes);
        let file = file_of(&nodes, |_| ());
        let tree = TreeFile::open(file.path(), Some(SIDE)).unwrap();
        let error = words_in(&tree).unwrap_err();
        assert!(!error.is_of_another_layout());
        error.to_string()
    };
    let split =
        |split: bool, nodes: &Nodes| nodes.split.iter().position(|&is| is == split).unwrap();
    let less = damaged(&|nodes| {
        let last = nodes.split.iter().rposition(|&is| is).unwrap();
        nodes.split[last] = false;
    });
    assert_eq!(less, "is damaged: nodes of level 5 have no parent");
    let more = damaged(&|nodes| {
        let leaf = split(false, nodes);
        (nodes.split[leaf], nodes.masked[leaf]) = (true, false);
    });
    assert!(more.starts_with("is damaged: node ") && more.ends_with(" has no children"), "{more}");
    let both = damaged(&|nodes| nodes.masked[0] = true);
    assert_eq!(both, "is damaged: a node from 0 on is masked and split");
    let side = damaged(&|nodes| {
        let leaf = (0..nodes.split.len()).find(|&i| !nodes.split[i] && !nodes.masked[i]).unwrap();
        nodes.sides[leaf] = 3;
    });
    assert!(side.starts_with("is damaged: node ") && side.ends_with(" has the side 3"), "{side}");
}
