//! The whole algorithm against a second one, on random cases; and on what comes out, the promises that
//! the definition makes to a reader.
mod support;

use reference::{Case, Keep, base_tree, mesh};
use support::dense::{CROSSING, Cell, Dense, Facet, INSIDE, OUTSIDE, assign_sides, base, grade};
use support::{ROOT_EDGE, Seeded, block, box_of_level, case};

/// Facets of every kind: any triangle, points, segments, lying in cell planes, reaching out of the root,
/// and closed blocks.
fn facets(seeded: &mut Seeded) -> Vec<Facet> {
    let mut facets = Vec::new();
    let unit = ROOT_EDGE >> seeded.of(3..=5);
    let reach = ROOT_EDGE / unit;
    for _ in 0..seeded.of(0..=2) {
        let min: [i64; 3] = std::array::from_fn(|_| seeded.of(-1..=reach - 2));
        let max = min.map(|x| x + seeded.of(2..=reach));
        let shift = if seeded.chance(1, 2) { seeded.of(0..=unit) } else { 0 };
        facets.extend(block(min.map(|x| x * unit + shift), max.map(|x| x * unit + shift)));
    }
    // Now and then a block with a hole.
    if seeded.chance(1, 3) {
        facets.pop();
    }
    for _ in 0..seeded.of(0..=3) {
        let mut vertex = || std::array::from_fn(|_| seeded.of(-2..=reach + 2) * unit);
        let (a, b, c) = (vertex(), vertex(), vertex());
        let kinds = [[a, b, c], [a, a, a], [a, b, b], [a, b, c]];
        facets.push(seeded.pick(&kinds));
    }
    facets
}

fn random_case(seeded: &mut Seeded, facets: &[Facet], finest: u32) -> (Case, u32) {
    let level_surface = seeded.of(1..=i64::from(finest)) as u32;
    let boxes = (0..seeded.of(0..=2)).map(|_| {
        let unit = ROOT_EDGE >> 5;
        let min: [i64; 3] = std::array::from_fn(|_| seeded.of(0..=30));
        let max = min.map(|x| seeded.of(x + 1..=x + 12).min(32));
        box_of_level(
            min.map(|x| x * unit),
            max.map(|x| x * unit),
            seeded.of(0..=i64::from(finest)) as u32,
        )
    });
    let boxes = boxes.collect();
    let case = Case {
        layer_cells_min: seeded.of(1..=4) as u32,
        keep: seeded.pick(&[Keep::Outside, Keep::Inside, Keep::All]),
        keep_crossing: seeded.chance(1, 2),
        boxes,
        ..case(facets, level_surface)
    };
    (case, level_surface)
}

fn kept(keep: Keep, side: u64) -> bool {
    match keep {
        Keep::Outside => side != INSIDE,
        Keep::Inside => side != OUTSIDE,
        Keep::All => true,
    }
}

/// A random case on which both ways agree.
struct Compared {
    case: Case,
    level_surface: u32,
    ambiguous: u64,
    graded: Dense,
}

fn compare(seeded: &mut Seeded, finest: u32) -> Compared {
    let facets = facets(seeded);
    let (case, level_surface) = random_case(seeded, &facets, finest);
    let mut dense = base(&case, &facets, finest, level_surface);
    let ambiguous = assign_sides(&mut dense, &facets);
    let base = base_tree(&case).unwrap();
    assert_eq!(base.words, dense.words(|_| true), "base tree of {case:?}");
    assert_eq!(base.ambiguous.map_or(0, |a| a.components), ambiguous, "{case:?}");
    for cell in &mut dense.cells {
        cell.kept = kept(case.keep, cell.side);
    }
    grade(&mut dense, i64::from(case.layer_cells_min), case.keep_crossing, level_surface);
    let wanted = |leaf: Cell| leaf.kept && (case.keep_crossing || leaf.side != CROSSING);
    assert_eq!(mesh(&case).unwrap().words, dense.words(wanted), "final mesh of {case:?}");
    Compared { case, level_surface, ambiguous, graded: dense }
}

#[test]
fn two_ways_one_mesh() {
    let mut seeded = Seeded::new(5);
    let (mut inside, mut ambiguous, mut crossing_deep) = (0, 0, 0);
    for _ in 0..400 {
        let compared = compare(&mut seeded, 4);
        let any =
            |wanted: &dyn Fn(&Cell) -> bool| u32::from(compared.graded.cells.iter().any(wanted));
        inside += any(&|cell| cell.side == INSIDE);
        crossing_deep += any(&|cell| cell.side == CROSSING && cell.level > compared.level_surface);
        ambiguous += u32::from(compared.ambiguous > 0);
    }
    // What is rare in random cases must not be missing from them.
    assert!(inside > 50, "{inside} cases have an inside");
    assert!(ambiguous > 20, "{ambiguous} cases are ambiguous");
    assert!(crossing_deep > 50, "{crossing_deep} cases have boxes finer than the surface on it");
    for _ in 0..20 {
        compare(&mut seeded, 5);
    }
}

/// Touching leaves differ by at most one level, and levels two apart are at least n cells of the level
/// between them apart.
#[test]
fn promises() {
    let mut seeded = Seeded::new(6);
    for _ in 0..60 {
        let Compared { case, level_surface, graded, .. } = compare(&mut seeded, 4);
        let mut leaves = graded.leaves();
        leaves.retain(|leaf| leaf.kept);
        for (i, &p) in leaves.iter().enumerate() {
            for &q in &leaves[..i] {
                let (fine, coarse) = if p.level > q.level { (p, q) } else { (q, p) };
                check_apart(&graded, &case, level_surface, fine, coarse);
            }
        }
    }
}

fn check_apart(dense: &Dense, case: &Case, level_surface: u32, fine: Cell, coarse: Cell) {
    let distance = distance(dense.leaf(fine), dense.leaf(coarse));
    assert!(
        distance > 0 || fine.level - coarse.level <= 1,
        "{fine:?} {coarse:?} of {case:?}",
        fine = fine.at,
        coarse = coarse.at
    );
    let gone = |leaf: Cell| !case.keep_crossing && leaf.side == CROSSING;
    let n = i64::from(case.layer_cells_min);
    for level in coarse.level + 1..fine.level {
        let promised = level < level_surface || case.keep == Keep::All;
        if promised && !gone(fine) && !gone(coarse) {
            let cell = 1 << (dense.finest - level);
            assert!(distance >= n * cell, "{:?} {:?} of {case:?}", fine.at, coarse.at);
        }
    }
    let near = (n - 1) << (dense.finest - level_surface.min(dense.finest));
    if fine.side == CROSSING && fine.level == level_surface && distance < near {
        assert!(coarse.level >= level_surface, "{:?} {:?} of {case:?}", fine.at, coarse.at);
    }
}

/// Of two cubes in cells, along the axis where they are farthest apart.
fn distance(p: (i64, [i64; 3]), q: (i64, [i64; 3])) -> i64 {
    let gap = |a: usize| (p.1[a] - q.1[a] - q.0).max(q.1[a] - p.1[a] - p.0);
    (0..3).map(gap).max().unwrap().max(0)
}
