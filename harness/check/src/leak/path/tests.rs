use super::*;
use contract::lattice::FacetLattice;

/// A path through these points, all with the same clearance but the narrowest.
fn path(points: &[Point], narrowest: usize, clearance: f64, approaches: [usize; 2]) -> Path {
    let spot = |(i, &at): (usize, &Point)| {
        let wider = if i == narrowest { 0.0 } else { 1.0 };
        Spot { at, clearance: clearance + wider, step: f64::INFINITY, apart: 0.0 }
    };
    Path { spots: points.iter().enumerate().map(spot).collect(), narrowest, approaches }
}

/// Three steps along x, then three along y.
const BEND: [Point; 7] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [2.0, 0.0, 0.0],
    [3.0, 0.0, 0.0],
    [3.0, 1.0, 0.0],
    [3.0, 2.0, 0.0],
    [3.0, 3.0, 0.0],
];

#[test]
fn the_direction_is_that_of_the_path_around_its_narrowest_place() {
    let unit = |v: Point| v.map(|c| c / length(v));
    for (narrowest, clearance, expected) in [
        // Within half the clearance there is no other point, so the direction is from the one before to the one after.
        (2, 1.0, [1.0, 0.0, 0.0]),
        (3, 1.0, [1.0, 1.0, 0.0]),
        (4, 1.0, [0.0, 1.0, 0.0]),
        // Points 1, 3 and 4 are within 1.1, so it is from point 0 to point 5.
        (2, 2.2, [3.0, 2.0, 0.0]),
        // At the ends, there is nothing before or after.
        (0, 1.0, [1.0, 0.0, 0.0]),
        (6, 1.0, [0.0, 1.0, 0.0]),
        (3, 99.0, [3.0, 3.0, 0.0]),
    ] {
        let found = path(&BEND, narrowest, clearance, [0, 0]).direction();
        let error = length(sub(found, unit(expected)));
        assert!(error < 1e-12, "point {narrowest}, clearance {clearance}: {found:?}");
    }
    assert_eq!(path(&BEND[..1], 0, 1.0, [0, 0]).direction(), [1.0, 0.0, 0.0]);
    assert_eq!(path(&[[5.0; 3]; 3], 1, 1.0, [0, 0]).direction(), [1.0, 0.0, 0.0]);
}

#[test]
fn approaches_are_no_place_for_an_opening() {
    let is_at_end =
        |narrowest, approaches| path(&BEND, narrowest, 1.0, approaches).is_narrowest_at_end();
    assert_eq!([0, 1, 5, 6].map(|i| is_at_end(i, [0, 0])), [true, false, false, true]);
    assert_eq!([2, 3, 4, 5].map(|i| is_at_end(i, [2, 1])), [true, false, false, true]);
    for (narrowest, approaches, found) in [
        (2, [0, 0], 2),
        (2, [2, 1], 2),
        (2, [3, 1], 3),
        (5, [2, 1], 5),
        (5, [2, 2], 2),
        (6, [0, 0], 6),
    ] {
        let path = path(&BEND, narrowest, 1.0, approaches);
        assert_eq!(path.find_narrowest(), found, "{narrowest} without {approaches:?}");
    }
}

/// Four facets around a square hole in the plane x = 0, as wide as it says.
fn wall_with_hole(width: i64) -> Vec<FacetLattice> {
    let (far, half) = (100_000, width / 2);
    let corner = |[y, z]: [i64; 2], by: i64| [0, y * by, z * by];
    let corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    let side = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let [p, q, r, s] = [corner(a, half), corner(b, half), corner(b, far), corner(a, far)];
        [[p, q, r], [p, r, s]]
    };
    (0..4).flat_map(side).collect()
}

#[test]
fn a_grid_widens_a_path_that_leads_past_the_middle_of_an_opening() {
    // Few facets, and more than are searched one by one.
    for copies in [1, 40] {
        assert_widened(&wall_with_hole(1000).repeat(copies));
    }
}

fn assert_widened(facets: &[FacetLattice]) {
    let clearance = Clearance::new(facets);
    // Through the opening near its rim.
    let points: Vec<Point> = (-8..=8).map(|x| [f64::from(x) * 250.0, 300.0, -350.0]).collect();
    let spot = |&at: &Point| Spot {
        at,
        clearance: clearance.at(at, f64::INFINITY),
        step: f64::INFINITY,
        apart: 0.0,
    };
    let mut path =
        Path { spots: points.iter().map(spot).collect(), narrowest: 8, approaches: [0, 0] };
    assert_eq!(path.throat().clearance, 150.0);
    let ends = [path.spots[0], path.spots[16]];
    let (step, mut scratch) = (80.0, Scratch::default());
    let widest =
        path.widen(step, f64::INFINITY, &clearance, &mut scratch, &|| false).unwrap().unwrap();
    assert!(!widest.is_at_end);
    path.narrowest = path.find_narrowest();
    let throat = path.throat();
    assert_eq!((throat.clearance, throat.step), (widest.least, step));
    assert!((500.0 - step..=500.0).contains(&throat.clearance), "{throat:?}");
    assert!(throat.at[0].abs() <= step && path.direction()[0] > 0.9, "{throat:?}");
    assert_eq!([path.spots[0], path.spots[path.spots.len() - 1]], ends);
    for spot in &path.spots {
        assert!((spot.clearance - clearance.at(spot.at, f64::INFINITY)).abs() < 1e-3, "{spot:?}");
    }
    // Balls at neighbours overlap.
    for pair in path.spots.windows(2) {
        let apart = length(sub(pair[0].at, pair[1].at));
        assert!(apart < pair[0].clearance + pair[1].clearance, "{pair:?}");
    }
    // Nothing passes a wall.
    let blocked =
        [spot(&[-400.0, 2000.0, 0.0]), spot(&[0.0, 2000.0, 0.0]), spot(&[400.0, 2000.0, 0.0])];
    let mut blocked = Path { spots: blocked.to_vec(), narrowest: 1, approaches: [0, 0] };
    assert!(
        blocked.widen(step, f64::INFINITY, &clearance, &mut scratch, &|| false).unwrap().is_none()
    );
}

/// The sides of a duct along x, 1000 wide.
fn duct() -> Vec<FacetLattice> {
    let corner = |x: i64, [y, z]: [i64; 2]| [x, y, z];
    let corners = [[0, 0], [1000, 0], [1000, 1000], [0, 1000]];
    let side = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let [p, q, r, s] = [corner(0, a), corner(0, b), corner(9000, b), corner(9000, a)];
        [[p, q, r], [p, r, s]]
    };
    (0..4).flat_map(side).collect()
}

#[test]
fn a_path_through_a_long_passage_is_moved_to_its_middle_unless_it_is_there() {
    let facets = duct();
    let clearance = Clearance::new(&facets);
    let spot = |at: Point| Spot {
        at,
        clearance: clearance.at(at, f64::INFINITY),
        step: f64::INFINITY,
        apart: 0.0,
    };
    let through = |y: f64, z: f64| Path {
        spots: [2000.0, 3500.0, 5000.0].map(|x| spot([x, y, z])).to_vec(),
        narrowest: 1,
        approaches: [0, 0],
    };
    let mut path = through(300.0, 600.0);
    path.centre(501.0, f64::INFINITY, &clearance);
    assert!(
        path.spots.len() > 3 && path.spots.iter().all(|spot| spot.clearance > 498.0),
        "{path:?}"
    );
    let mut path = through(500.0, 500.0);
    path.centre(501.0, f64::INFINITY, &clearance);
    assert_eq!(path.spots, through(500.0, 500.0).spots);
    // An approach stays where it is.
    let mut path = Path { approaches: [1, 0], ..through(300.0, 600.0) };
    path.centre(501.0, f64::INFINITY, &clearance);
    let (approach, rest) = path.spots.split_first().expect("points");
    assert_eq!(*approach, through(300.0, 600.0).spots[0]);
    assert!(rest.len() > 2 && rest.iter().all(|spot| spot.clearance > 498.0), "{rest:?}");
}

#[test]
fn an_end_is_reached_if_the_points_up_to_it_are_in_the_cube() {
    let reaches =
        |narrowest, half, approaches| path(&BEND, narrowest, 1.0, approaches).reaches_end(half);
    assert_eq!([1.5, 2.0, 2.5].map(|half| reaches(2, half, [0, 0])), [false, true, true]);
    assert_eq!([0.5, 1.0].map(|half| reaches(5, half, [0, 0])), [false, true]);
    assert_eq!([0.5, 1.0].map(|half| reaches(2, half, [1, 0])), [false, true]);
    assert_eq!([0.5, 1.0].map(|half| reaches(3, half, [0, 2])), [false, true]);
}

#[test]
fn a_path_leads_through_centres_of_leaves_and_faces_and_to_the_boundary() {
    let words = contract::testing::words_of(|o| o.level < 2);
    let leaves = Leaves::new(&words).unwrap();
    let edge = contract::lattice::UNITS_PER_EDGE as f64 / 4.0;
    let corner = (9.0 * edge) as i64;
    let facets: Vec<FacetLattice> = vec![[[0, 0, corner]; 3]];
    let clearance = Clearance::new(&facets);
    let (from, to) = ([0.5, 0.5, 0.5], [1.5, 0.5, 0.5]);
    let leaf = |at: Point| leaves.locate(at.map(|c| (c * edge) as i64));
    let spots = |goal| -> Vec<Point> {
        let spots = raw(&leaves, &[leaf(from), leaf(to)], goal, &clearance);
        for spot in &spots {
            let expected = length(sub(spot.at, [0.0, 0.0, 9.0 * edge]));
            assert!((spot.clearance - expected).abs() < 1e-6 * expected);
            assert!(spot.step.is_infinite() && spot.apart == 0.0);
        }
        spots.iter().map(|spot| spot.at.map(|c| c / edge)).collect()
    };
    let inner = vec![from, [1.0, 0.5, 0.5], to];
    assert_eq!(spots(Goal::Place(leaf(to))), inner);
    assert_eq!(spots(Goal::Far), [inner, vec![[1.5, 0.0, 0.5]]].concat());
}
