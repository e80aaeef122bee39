//! Leaks through openings of known width: holes, slits, cracks at T-junctions and missing facets, in several
//! orientations.

mod openings;

use check::leak::ends::Target;
use check::leak::report::Report;
use check::leak::{LeakError, Question, Watch, answer};
use contract::case::{Case, Facet};
use contract::lattice::Root;
use contract::testing::{assert_text, base_tree};
use openings::{Body, ROTATIONS, bodies, pipe, torn_sphere, two_holes};
use std::cell::{Cell, RefCell};
use std::convert::Infallible;

/// Neither the bodies' centre nor their walls are in the planes of cells.
const ROOT: Root = Root { origin: [-3.91, -4.13, -4.07], edge: 8.0 };

struct Silent;

impl Watch for Silent {
    fn step(&self, _: &str) {}

    fn is_interrupted(&self) -> bool {
        false
    }
}

fn case(facets: &[Facet], level: u8) -> Case {
    let spacing = ROOT.edge / f64::from(1u32 << level);
    let Root { origin, edge } = ROOT;
    let text = format!("spacing_min = {spacing:?}\n[root]\norigin = {origin:?}\nedge = {edge:?}");
    Case::from_parts(&text, facets.to_vec()).unwrap()
}

fn ask(case: &Case, from: [f64; 3], to: Target) -> Result<Report, LeakError<Infallible>> {
    let question = Question { case, from, to, leaves_max: 1_000_000 };
    answer(&question, |level| Ok(base_tree(&case.facets_lattice, level)), &Silent)
        .map(|answer| answer.report)
}

fn from_centre(facets: &[Facet], level: u8) -> Report {
    ask(&case(facets, level), [0.0; 3], Target::Far).unwrap()
}

/// The narrowest place is the opening: its width to half a percent, and its rim.
fn assert_describes(report: &Report, body: &Body, what: &str) {
    let passage = report.passage.as_ref().unwrap();
    let narrowest = &passage.narrowest;
    let error = narrowest.width / body.width - 1.0;
    assert!(error.abs() < 0.005, "{what}: width {} instead of {}", narrowest.width, body.width);
    let (rim, near) = (body.at_rim(2), body.at_rim(1));
    assert!(!narrowest.facets.is_empty() && !narrowest.is_end, "{what}");
    assert!(narrowest.facets.iter().all(|f| near.contains(f)), "{what}: {:?}", narrowest.facets);
    if body.is_round {
        assert!(rim.iter().all(|f| narrowest.facets.contains(f)), "{what}: {:?}", narrowest.facets);
    }
    let points = &passage.points;
    assert!(points.iter().all(|p| p.width >= narrowest.width * 0.998), "{what}");
    let passes = points.windows(2).filter(|pair| body.passes(pair[0].at, pair[1].at)).count();
    assert_eq!(passes % 2, 1, "{what}: the path crosses the opening {passes} times");
}

/// The widest path leads through the opening, and its width and rim are right, in every orientation.
fn assert_passage(body: &Body) {
    for (turn, rotation) in ROTATIONS.into_iter().enumerate() {
        let body = body.rotated(rotation);
        let what = format!("{}, rotation {turn}", body.name);
        // An opening wider than 2 sqrt(3) cells joins the leaves at both sides.
        let wide = ROOT.level_for(body.width / 12f64.sqrt()).unwrap();
        let report = from_centre(&body.facets, wide);
        assert!(report.is_leak && report.opens.is_none(), "{what}");
        assert_describes(&report, &body, &what);
        // One narrower than a cell does not.
        let closes = report.closes.expect("a coarse tree is closed");
        assert!(closes.spacing > body.width / 12f64.sqrt(), "{what}");
        assert!(closes.spacing / 2.0 <= body.width, "{what}");

        let closed = from_centre(&body.facets, closes.level);
        assert!(!closed.is_leak && closed.limit.is_none(), "{what}");
        assert_eq!(closed.opens.unwrap().level, closes.level + 1, "{what}");
        assert_describes(&closed, &body, &format!("{what}, when it opens"));
        let (last, open) = report.levels.split_last().unwrap();
        assert!(!last.is_joined && open.iter().all(|level| level.is_joined), "{what}");
    }
}

#[test]
fn the_widest_path_leads_through_a_hole() {
    assert_passage(&bodies()[0]);
}

#[test]
fn the_widest_path_leads_through_a_slit() {
    assert_passage(&bodies()[1]);
}

#[test]
fn the_widest_path_leads_through_a_crack() {
    assert_passage(&bodies()[2]);
}

#[test]
fn the_widest_path_leads_through_a_missing_facet() {
    assert_passage(&bodies()[3]);
}

#[test]
fn the_answer_about_a_slit_and_a_crack_is_the_expected_text() {
    for body in &bodies()[1..3] {
        let wide = ROOT.level_for(body.width / 12f64.sqrt()).unwrap();
        for (level, what) in [(wide, "open"), (wide - 3, "closed")] {
            let text = from_centre(&body.facets, level).to_string();
            assert_text(&text, &format!("tests/leak/expected/{}-{what}.txt", body.name));
        }
    }
}

#[test]
fn the_answer_about_other_openings_is_the_expected_text() {
    let [hole, _, _, missing] = <[Body; 4]>::try_from(bodies()).unwrap();
    let turned = |body: Body| body.rotated(ROTATIONS[2]).facets;
    let all = [
        ("hole", turned(hole), 6),
        ("missing-facet", turned(missing), 7),
        ("pipe", turned(pipe(1.0, 0.13)), 6),
        ("two-holes", turned(two_holes(0.2, 0.199)), 5),
        ("torn-sphere", torn_sphere(), 5),
    ];
    for (name, facets, level) in all {
        let text = from_centre(&facets, level).to_string();
        assert_text(&text, &format!("tests/leak/expected/{name}.txt"));
    }
}

/// The radii of the two openings differ by an eighth of a cell.
fn assert_widest(level: u8, radius: f64, opposite: f64) {
    for rotation in ROTATIONS {
        let body = two_holes(radius, opposite).rotated(rotation);
        let report = from_centre(&body.facets, level);
        assert_describes(&report, &body, &format!("level {level}, radius {radius}"));
    }
}

#[test]
fn of_several_openings_the_widest_is_reported_even_if_they_differ_little() {
    assert_widest(7, 0.2, 0.19);
}

#[test]
fn of_several_narrow_openings_the_widest_is_reported() {
    assert_widest(8, 0.15, 0.145);
    assert_widest(8, 0.1, 0.096);
}

/// Every place of a pipe is equally narrow, and more of them than a search can refine.
fn assert_wide_everywhere(radius: f64, length: f32) {
    for rotation in ROTATIONS {
        let body = pipe(length, radius).rotated(rotation);
        let what = format!("radius {radius}, length {length}");
        let from_inside = from_centre(&body.facets, 7).passage.unwrap().narrowest;
        let error = from_inside.width / body.width - 1.0;
        assert!(error.abs() < 0.01 && !from_inside.is_end, "{what}: error {error}");
        // The start is in the pipe.
        let case = case(&body.facets, 8);
        let start = std::array::from_fn(|i| {
            let mean = body.rim.iter().map(|v| v[i]).sum::<f64>() / body.rim.len() as f64;
            mean + 0.3 * body.axis()[i]
        });
        let in_pipe = ask(&case, start, Target::Far).unwrap().passage.unwrap().narrowest;
        let error = in_pipe.width / body.width - 1.0;
        assert!(error.abs() < 0.01, "{what}, from {start:?}: error {error}");
    }
}

#[test]
fn a_long_pipe_is_as_wide_as_it_is_wherever_the_lattice_lies() {
    assert_wide_everywhere(0.1, 2.0);
}

#[test]
fn a_pipe_is_as_wide_as_it_is_wherever_the_lattice_lies() {
    assert_wide_everywhere(0.13, 1.0);
}

#[test]
fn a_closed_body_never_opens_and_that_is_proven_without_refinement() {
    let body = &bodies()[3];
    let rim: Facet = [0, 1, 2].map(|i| body.rim[i].map(|c| c as f32));
    let closed: Vec<Facet> = body.facets.iter().copied().chain([rim]).collect();
    let report = from_centre(&closed, 4);
    assert!(!report.is_leak && report.is_separated && report.passage.is_none());
    assert_eq!(report.levels.len(), 1);
}

#[test]
fn a_finer_base_tree_that_cannot_be_meshed_ends_the_refinement_and_is_reported() {
    struct Interruptible(Cell<bool>);
    impl Watch for Interruptible {
        fn step(&self, _: &str) {}

        fn is_interrupted(&self) -> bool {
            self.0.get()
        }
    }
    let case = case(&bodies()[0].facets, 3);
    let ask = |interrupts: bool| {
        let watch = Interruptible(Cell::new(false));
        let tree = |level| match level {
            3 => Ok(base_tree(&case.facets_lattice, level)),
            _ => {
                watch.0.set(interrupts);
                Err(format!("no memory for level {level}"))
            }
        };
        let question =
            Question { case: &case, from: [0.0; 3], to: Target::Far, leaves_max: 1_000_000 };
        answer(&question, tree, &watch).map(|answer| answer.report)
    };
    let report = ask(false).unwrap();
    assert!(!report.is_leak && report.opens.is_none() && report.passage.is_none());
    assert_eq!(report.limit.unwrap(), "level 4 could not be meshed: no memory for level 4");
    // A mesher that the user's signal ended is no reason to answer.
    assert!(matches!(ask(true), Err(LeakError::Source(_))));
}

#[test]
fn refinement_ends_at_the_limit_of_leaves_and_that_is_reported() {
    let body = bodies().remove(2);
    let case = case(&body.facets, 3);
    let question = Question { case: &case, from: [0.0; 3], to: Target::Far, leaves_max: 10_000 };
    let report = answer(
        &question,
        |level| Ok::<_, Infallible>(base_tree(&case.facets_lattice, level)),
        &Silent,
    );
    let report = report.unwrap().report;
    assert!(!report.is_leak && report.opens.is_none());
    assert!(report.limit.unwrap().contains("more than the limit of 10000"));
    assert!(report.levels.len() > 1 && report.levels.iter().all(|l| l.leaves <= 10_000));
}

#[test]
fn a_base_tree_is_meshed_if_it_is_expected_to_have_just_as_many_leaves_as_allowed() {
    let case = case(&bodies()[0].facets, 3);
    let tree = |level| Ok::<_, Infallible>(base_tree(&case.facets_lattice, level));
    let expected = 4 * base_tree(&case.facets_lattice, 3).len() as u64;
    for (leaves_max, levels) in [(expected - 1, 1), (expected, 2)] {
        let question = Question { case: &case, from: [0.0; 3], to: Target::Far, leaves_max };
        let report = answer(&question, tree, &Silent).unwrap().report;
        assert_eq!(report.levels.len(), levels, "at most {leaves_max}");
    }
}

#[test]
fn the_widest_path_is_searched_two_levels_below_the_coarsest_tree_that_joins_the_ends() {
    let report = from_centre(&bodies()[0].facets, 8);
    let closes = report.closes.unwrap().level;
    assert_eq!(report.passage.unwrap().spacing.level, closes + 3);
}

#[test]
fn small_finer_trees_are_derived_from_one_that_is_meshed() {
    let case = case(&bodies()[0].facets, 3);
    let tree = |level| base_tree(&case.facets_lattice, level);
    let asked = |finest: u8, leaves_max: u64| {
        let requested = RefCell::new(Vec::new());
        let source = |level| {
            requested.borrow_mut().push(level);
            if level <= finest { Ok(tree(level)) } else { Err("no memory") }
        };
        let question = Question { case: &case, from: [0.0; 3], to: Target::Far, leaves_max };
        let report = answer(&question, source, &Silent).unwrap().report;
        for meshed in &report.levels {
            assert_eq!(meshed.leaves, tree(meshed.spacing.level).len() as u64);
        }
        (requested.into_inner(), report)
    };
    // Level 7 is expected to have at most 65,536 leaves, level 8 more.
    let leaves = tree(3).len() as u64;
    assert!((65..=256).contains(&leaves), "{leaves}");
    let (requested, report) = asked(19, 1_000_000);
    assert_eq!(requested, [3, 7]);
    let opens = report.opens.unwrap().level;
    let levels: Vec<u8> = report.levels.iter().map(|meshed| meshed.spacing.level).collect();
    assert_eq!(levels, (3..=opens).collect::<Vec<u8>>());
    assert!((5..7).contains(&opens), "{opens}");
    // Not more than allowed, and without a tree that cannot be made.
    assert_eq!(asked(19, 16 * leaves).0, [3, 5]);
    assert_eq!(asked(19, 16 * leaves - 1).0[..2], [3, 4]);
    let (requested, failed) = asked(4, 1_000_000);
    assert_eq!(requested[..3], [3, 7, 4]);
    assert!(failed.limit.unwrap().contains("level 5 could not be meshed"));
}

#[test]
fn a_path_to_a_point_ends_in_its_leaf_and_bad_points_are_input_errors() {
    let body = bodies().remove(0);
    let case = case(&body.facets, 8);
    let report = ask(&case, [0.0; 3], Target::Point([0.0, 0.0, 3.0])).unwrap();
    assert_describes(&report, &body, "to a point");
    let passage = report.passage.unwrap();
    let last = passage.points.last().unwrap().at;
    assert!((last[2] - 3.0).abs() < 1.0, "{last:?}");
    let same = ask(&case, [0.0; 3], Target::Point([0.01; 3])).unwrap();
    assert!(same.is_leak && same.passage.unwrap().narrowest.is_end);
    let why = |from, to| match ask(&case, from, to) {
        Err(LeakError::Input(why)) => why,
        other => panic!("{other:?}"),
    };
    assert!(why([9.0; 3], Target::Far).contains("--from [9.0, 9.0, 9.0] is outside the root"));
    let crossing = why([0.3, 0.2, -1.0], Target::Far);
    assert!(crossing.contains("--from") && crossing.contains("nearest centre"), "{crossing}");
    let crossing = why([0.0; 3], Target::Point([0.3, 0.2, -1.0]));
    assert!(crossing.contains("--to") && crossing.contains("nearest centre"), "{crossing}");
}
