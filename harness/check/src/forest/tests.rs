//! The topology and the balance, compared with a definition by points: a lattice of twice the resolution of the finest leaves has a point in
//! the middle of every part of a face, edge or corner in which leaves can touch. Points are the same where glued faces or listed edges and
//! corners identify them, and leaves touch if they share a point.

mod points;

use super::*;
use contract::import::forest::{Connectivity, Lists};
use points::Points;
use proptest::prelude::*;

const LEVEL: u32 = 3;
/// Points along an edge of a tree, less one.
const POINTS: i64 = 2 << LEVEL;
const ALL: [Touching; 3] = [Touching::Face, Touching::Edge, Touching::Corner];

/// Trees that are not glued.
fn cubes(dimension: usize, trees: usize) -> Connectivity {
    let faces = 2 * dimension;
    let own = |index: usize| ((index / faces) as i32, (index % faces) as i8);
    let (tree_to_tree, tree_to_face) = (0..faces * trees).map(own).unzip();
    let corners = Lists { offsets: vec![0], ..Lists::default() };
    let edges = if dimension == 3 { corners.clone() } else { Lists::default() };
    Connectivity {
        dimension,
        trees,
        tree_to_tree,
        tree_to_face,
        edges,
        corners,
        ..Connectivity::default()
    }
}

/// Glues two faces that are still on the boundary.
fn glue(c: &mut Connectivity, one: (usize, usize), two: (usize, usize), orientation: usize) {
    let faces = 2 * c.dimension;
    for ((tree, face), (other, its)) in [(one, two), (two, one)] {
        c.tree_to_tree[faces * tree + face] = other as i32;
        c.tree_to_face[faces * tree + face] = (its + faces * orientation) as i8;
    }
}

/// Lists an edge or corner of several trees, if none of them is listed.
fn list(c: &mut Connectivity, is_edge: bool, members: &[(usize, usize)]) {
    let (places, trees) = (if is_edge { 12 } else { 1 << c.dimension }, c.trees);
    let lists = if is_edge { &mut c.edges } else { &mut c.corners };
    lists.of_tree.resize(places * trees, -1);
    if members.iter().any(|(tree, place)| lists.of_tree[places * tree + place % places] >= 0) {
        return;
    }
    for &(tree, place) in members {
        lists.of_tree[places * tree + place % places] = lists.offsets.len() as i32 - 1;
        lists.trees.push(tree as i32);
        lists.places.push(place as i8);
    }
    lists.offsets.push(lists.trees.len() as i32);
}

/// The leaves of trees in which octants that contain one of these points, in units of the finest leaves, are refined to a level.
fn forest(connectivity: Connectivity, refined: &[(usize, [i64; 3], i32)]) -> Forest {
    let unit = 1 << (30 - LEVEL);
    let dimension = connectivity.dimension;
    let mut leaves = vec![Vec::new(); connectivity.trees];
    for (tree, leaves) in leaves.iter_mut().enumerate() {
        let mut open = vec![Quadrant { corner: [0; 3], level: 0, data: 0 }];
        while let Some(quadrant) = open.pop() {
            let size = 1i64 << (30 - quadrant.level);
            let contains = |point: &[i64; 3]| {
                (0..dimension)
                    .all(|a| (0..size).contains(&(point[a] * unit - i64::from(quadrant.corner[a]))))
            };
            let is_split = |(t, point, level): &(usize, [i64; 3], i32)| {
                *t == tree && contains(point) && quadrant.level < *level
            };
            match refined.iter().any(is_split) {
                false => leaves.push(quadrant),
                true => open.extend((0..1 << dimension).rev().map(|child: i32| {
                    let corner = [0, 1, 2]
                        .map(|a| quadrant.corner[a] + (child >> a & 1) * (size / 2) as i32);
                    Quadrant { corner, level: quadrant.level + 1, data: 0 }
                })),
            }
        }
    }
    Forest { connectivity, leaves, data_bytes: 0 }
}

fn audited(forest: &Forest, touching: Touching) -> AuditReport {
    audit(forest, touching, Instant::now())
}

fn holds(report: &AuditReport, name: &str) -> bool {
    report.checks.iter().find(|check| check.name == name).unwrap().holds()
}

/// Compares the audit of a forest with the definition by points, in every way of touching.
fn compare(forest: &Forest, points: &mut Points) {
    let dimension = forest.connectivity.dimension;
    let differences = points.differences(forest);
    for (touching, odd) in ALL.into_iter().zip([dimension - 1, 1, 0]) {
        if dimension == 3 || touching != Touching::Edge {
            let report = audited(forest, touching);
            assert!(report.checks[..4].iter().all(CheckResult::holds), "{report}");
            let expected = differences[odd] < 2;
            assert_eq!(
                report.holds(),
                expected,
                "{touching:?}: {report}\n{:?}",
                forest.connectivity
            );
        }
    }
}

/// Refines the first tree in one corner after the other, or beside it, and compares each forest.
fn compare_all(connectivity: &Connectivity) {
    let mut points = Points::of(connectivity);
    let last = (1 << LEVEL) - 1;
    for corner in 0..1usize << connectivity.dimension {
        let at = |a: usize| (corner >> a & 1) as i64 * last;
        for x in [at(0), last / 2] {
            let refined = [(0, [x, at(1), at(2)], LEVEL as i32)];
            compare(&forest(connectivity.clone(), &refined), &mut points);
        }
    }
}

#[test]
fn all_gluings_of_two_trees_by_a_face() {
    for dimension in [2, 3] {
        for face in 0..2 * dimension {
            for its in 0..2 * dimension {
                for orientation in 0..1 << (dimension - 1) {
                    let mut two = cubes(dimension, 2);
                    glue(&mut two, (0, face), (1, its), orientation);
                    compare_all(&two);
                }
            }
        }
    }
}

#[test]
fn all_gluings_of_two_cubes_by_an_edge_or_a_corner() {
    for edge in 0..12 {
        for its in 0..24 {
            let mut two = cubes(3, 2);
            list(&mut two, true, &[(0, edge), (1, its)]);
            compare_all(&two);
        }
    }
    for dimension in [2, 3] {
        for corner in 0..1 << dimension {
            for its in 0..1 << dimension {
                let mut two = cubes(dimension, 2);
                list(&mut two, false, &[(0, corner), (1, its)]);
                compare_all(&two);
            }
        }
    }
}

#[test]
fn all_gluings_of_a_tree_to_itself() {
    for dimension in [2, 3] {
        for face in 0..2 * dimension {
            for its in face + 1..2 * dimension {
                for orientation in 0..1 << (dimension - 1) {
                    let mut one = cubes(dimension, 1);
                    glue(&mut one, (0, face), (0, its), orientation);
                    compare_all(&one);
                }
            }
        }
    }
}

/// Faces are glued and edges and corners listed at random, also where that is no manifold.
fn random_forest() -> impl Strategy<Value = Forest> {
    let pair = || {
        (
            0usize..4,
            any::<prop::sample::Index>(),
            0usize..4,
            any::<prop::sample::Index>(),
            0usize..4,
        )
    };
    let points = prop::collection::vec(
        (0usize..4, prop::array::uniform3(0i64..1 << LEVEL), 0i32..=LEVEL as i32),
        0..6,
    );
    (
        2usize..4,
        1usize..5,
        prop::collection::vec(pair(), 0..7),
        prop::collection::vec(pair(), 0..3),
        points,
    )
        .prop_map(|(dimension, trees, glued, listed, refined)| {
            let mut c = cubes(dimension, trees);
            for (tree, face, other, its, orientation) in glued {
                let (tree, other) = (tree % trees, other % trees);
                let (face, its) = (face.index(2 * dimension), its.index(2 * dimension));
                let is_free = |tree: usize, face: usize| {
                    let index = 2 * dimension * tree + face;
                    (c.tree_to_tree[index], c.tree_to_face[index]) == (tree as i32, face as i8)
                };
                if (tree, face) != (other, its) && is_free(tree, face) && is_free(other, its) {
                    glue(&mut c, (tree, face), (other, its), orientation % (1 << (dimension - 1)));
                }
            }
            for (tree, place, other, its, kind) in listed {
                let members = |count: usize, own: usize| {
                    [(tree % trees, place.index(own)), (other % trees, its.index(count))]
                };
                match dimension == 3 && kind % 2 == 0 {
                    true => list(&mut c, true, &members(24, 12)),
                    false => list(&mut c, false, &members(1 << dimension, 1 << dimension)),
                }
            }
            forest(c, &refined)
        })
}

proptest! {
    #[test]
    fn random_forests_agree_with_the_definition_by_points(forest in random_forest()) {
        compare(&forest, &mut Points::of(&forest.connectivity));
    }

    #[test]
    fn a_change_of_a_leaf_is_found(forest in random_forest(), tree in any::<prop::sample::Index>(), at in any::<prop::sample::Index>(), kind in 0..4) {
        prop_assert!(diff(&forest, &forest).iter().all(CheckResult::holds));
        // As an old version of p4est writes it.
        let mut old = forest.clone();
        old.leaves.iter_mut().flatten().for_each(|leaf| leaf.corner = leaf.corner.map(|at| at >> 11));
        prop_assert!(diff(&forest, &old).iter().all(CheckResult::holds));
        let mut changed = forest.clone();
        let leaves = tree.get(&forest.leaves);
        let (tree, at) = (tree.index(forest.leaves.len()), at.index(leaves.len()));
        let of_tree = &mut changed.leaves[tree];
        match kind {
            0 => drop(of_tree.remove(at)),
            1 => of_tree.insert(at, leaves[at]),
            2 => of_tree[at].corner[0] += 1,
            _ => of_tree[at].level += 1,
        }
        let found = diff(&forest, &changed);
        prop_assert!(found[0].holds() && found[1].findings_total == 1);
        let detail = &found[1].findings[0];
        let place = format!("tree {tree}");
        prop_assert!(detail.contains(&place), "{}", detail);
        let report = audited(&changed, Touching::Corner);
        prop_assert!(!report.holds() && holds(&report, "balance"), "{}", report);
    }
}

fn found(report: &AuditReport) -> Vec<(&str, &str)> {
    report.checks.iter().flat_map(|c| c.findings.iter().map(|f| (c.name, f.as_str()))).collect()
}

#[test]
fn a_finding_names_trees_and_quadrants() {
    let mut two = cubes(3, 2);
    list(&mut two, true, &[(0, 11), (1, 8)]);
    let unbalanced = forest(two, &[(0, [7, 7, 0], 2)]);
    let report = audited(&unbalanced, Touching::Edge);
    let half = 1 << 29;
    let text = format!(
        "tree 0, quadrant 6 (level 2 at {0}, {0}, 0) touches in an edge tree 1, quadrant 0 (level 0 at 0, 0, 0)",
        half + half / 2
    );
    assert_eq!(found(&report)[0], ("balance", text.as_str()));
    assert!(audited(&unbalanced, Touching::Face).holds());
}

#[test]
fn missing_overlapping_and_invalid_quadrants_are_named() {
    let good = forest(cubes(2, 2), &[(0, [0; 3], 1)]);
    let changed = |change: fn(&mut Vec<Quadrant>)| {
        let mut forest = good.clone();
        change(&mut forest.leaves[0]);
        let report = audited(&forest, Touching::Corner);
        found(&report)
            .iter()
            .map(|(check, detail)| format!("{check}: {detail}"))
            .collect::<Vec<_>>()
            .join("\n")
    };
    for (change, expected) in [
        ((|leaves| leaves.truncate(3)) as fn(&mut Vec<Quadrant>), "complete: tree 0, quadrant 2 "),
        (
            |leaves| leaves.retain(|leaf| leaf.corner != [1 << 29, 0, 0]),
            "complete: tree 0, quadrant 1 ",
        ),
        (|leaves| leaves.clear(), "complete: tree 0 has no quadrants"),
        (|leaves| leaves.swap(1, 2), "linear: tree 0, quadrant 2 "),
        (
            |leaves| leaves[1].level = 0,
            "valid: tree 0, quadrant 1 (level 0 at 536870912, 0, 0) is no octant",
        ),
        (|leaves| leaves[3].corner[0] = -1, "valid: tree 0, quadrant 3 "),
        (|leaves| leaves[3].level = 30, "valid: tree 0, quadrant 3 "),
    ] {
        let text = changed(change);
        assert!(text.starts_with(expected), "{text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
}

#[test]
fn a_connectivity_that_contradicts_itself_is_a_finding() {
    let mut good = cubes(3, 2);
    glue(&mut good, (0, 1), (1, 2), 3);
    list(&mut good, true, &[(0, 0), (1, 18)]);
    list(&mut good, false, &[(0, 7), (1, 7)]);
    type Fault = (fn(&mut Connectivity), &'static str);
    let faults: [Fault; 8] = [
        (|c| c.tree_to_tree[1] = 2, "face 1 of tree 0 is glued to face code 20 of tree 2"),
        (|c| c.tree_to_face[1] = 24, "face 1 of tree 0 is glued to face code 24"),
        (
            |c| c.tree_to_face[1] -= 6,
            "face 1 of tree 0 is glued to face 2 of tree 1 with orientation 2",
        ),
        (|c| c.edges.places[1] = 24, "list 0 of edges has edge 24 of tree 1"),
        (|c| c.edges.trees[0] = -1, "list 0 of edges has edge 0 of tree -1"),
        (|c| c.edges.of_tree[1] = 0, "edge 1 of tree 0 states list 0 of edges, but no list has it"),
        (
            |c| c.corners.of_tree[7] = -1,
            "corner 7 of tree 0 states no list of corners, but list 0 has it",
        ),
        (|c| c.corners.offsets[1] = 1, "the lists of corners do not begin"),
    ];
    let report = audited(&forest(good.clone(), &[]), Touching::Corner);
    assert!(report.holds(), "{report}");
    for (change, expected) in faults {
        let mut wrong = good.clone();
        change(&mut wrong);
        let report = audited(&forest(wrong, &[]), Touching::Corner);
        assert!(found(&report)[0].1.starts_with(expected), "{report}");
    }
}

/// Four squares around a point: the two diagonal pairs meet only there, so p4est's documentation asks for a list.
#[test]
fn places_that_no_list_has_are_counted() {
    let mut brick = cubes(2, 4);
    for (first, second, face) in [(0, 1, 1), (2, 3, 1), (0, 2, 3), (1, 3, 3)] {
        glue(&mut brick, (first, face), (second, face - 1), 0);
    }
    let note = |c: &Connectivity| {
        let mut result = CheckResult::new("connectivity");
        Topology::of(c, &mut result).unwrap();
        result.note
    };
    assert!(note(&brick).starts_with("4 tree corners whose trees"), "{}", note(&brick));
    list(&mut brick, false, &[(0, 3), (1, 2), (2, 1), (3, 0)]);
    assert_eq!(note(&brick), "");
}

#[test]
fn an_edge_that_meets_itself_is_counted() {
    let mut one = cubes(3, 1);
    list(&mut one, true, &[(0, 5), (0, 17)]);
    let mut result = CheckResult::new("connectivity");
    Topology::of(&one, &mut result).unwrap();
    let expected = "1 tree edges meet themselves in the opposite direction, the first 5 of tree 0";
    assert_eq!(result.note, expected);
}
