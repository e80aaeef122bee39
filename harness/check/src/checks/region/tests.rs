use super::*;
use contract::case::Case;
use contract::word;

/// What the surveys of a case share.
struct Geometry {
    terms: Manifest,
    truth: Truth,
    lattice: Vec<contract::lattice::FacetLattice>,
}

impl Geometry {
    fn of(case: &Case) -> Self {
        let terms = case.rules.clone();
        let truth = Truth::of(case, &terms).unwrap();
        Self { terms, truth, lattice: case.facets_lattice.clone() }
    }

    fn survey<'a>(&'a self, tree: &'a Tree, band_cells: f64) -> Survey<'a> {
        let Self { terms, truth, lattice } = self;
        let (parity, knows_crossing) = (Parity::new(lattice), band_cells == 0.0);
        Survey { terms, tree, truth, parity, band_cells, knows_crossing }
    }

    fn sides(&self, tree: &Tree, band_cells: f64) -> CheckResult {
        let mut result = CheckResult::new("sides");
        self.survey(tree, band_cells).check_sides(&mut result);
        result
    }

    fn complete(&self, tree: &Tree, band_cells: f64) -> CheckResult {
        let mut result = CheckResult::new("complete");
        self.survey(tree, band_cells).check_complete(&mut result);
        result
    }
}

const CROSSED: Position = Position::Near { crossed: true };

/// A tetrahedron in a root of edge 8 with leaves of edge 1, without the facets from number `count`.
fn tetrahedron(count: usize, seeds: &str) -> Case {
    let [a, b, c, d] = [[1.1f32; 3], [6.9, 1.1, 1.1], [1.1, 6.9, 1.1], [1.1, 1.1, 6.9]];
    let body = [[a, b, d], [a, c, d], [a, b, c], [b, c, d]];
    let text = format!(
        "spacing_min = 1.0\nkeep = 'inside'\nseeds = {seeds}\nroot = {{ origin = [0.0, 0.0, 0.0], edge = 8.0 }}\n"
    );
    Case::from_parts(&text, body[..count].to_vec()).unwrap()
}

fn positions(count: usize, seeds: &str, paths: &[&[u8]]) -> Vec<Position> {
    let case = tetrahedron(count, seeds);
    let (geometry, tree) = (Geometry::of(&case), Tree::default());
    let space = geometry.survey(&tree, 0.0);
    let octant = |path: &&[u8]| path.iter().fold(Octant::ROOT, |o, &digit| o.child(digit));
    paths.iter().map(|path| space.position(octant(path))).collect()
}

#[test]
fn a_place_is_near_the_surface_or_in_a_component_that_is_kept_or_not() {
    let (outside, inside) = (Position::On(Side::Outside, false), Position::On(Side::Inside, true));
    // Within the body, far from it, in a leaf that a facet crosses, and in a child of it that none crosses.
    let paths: [&[u8]; 4] = [&[0, 7, 0], &[7, 7], &[0, 0, 7], &[0, 0, 7, 7]];
    let expected = [inside, outside, CROSSED, CROSSED];
    assert_eq!(positions(4, "[]", &paths), expected);
    // Seeds decide, so that rays are not asked, even if the body is open.
    assert_eq!(positions(4, "[[2.5, 2.5, 2.5]]", &paths), expected);
    let open = positions(3, "[[2.5, 2.5, 2.5]]", &paths[..2]);
    assert_eq!(open, [inside, inside]);
}

#[test]
fn a_band_wider_than_the_root_leaves_nothing_to_check() {
    let case = tetrahedron(4, "[]");
    let geometry = Geometry::of(&case);
    let tree = Tree::of_words(&contract::testing::words_of(|o| o.level < 2));
    for (band_cells, was_run) in [(0.0, true), (8.0, false)] {
        let results = [geometry.sides(&tree, band_cells), geometry.complete(&tree, band_cells)];
        assert_eq!(results.map(|result| result.examined > 0), [was_run; 2]);
    }
}

#[test]
fn places_within_the_band_are_not_judged() {
    let case = tetrahedron(4, "[]");
    let geometry = Geometry::of(&case);
    let (terms, facets) = (&geometry.terms, &geometry.truth.facets);
    let words = contract::testing::words_of(|o| o.level < 3);
    let tree = Tree::of_words(&words);
    for band_cells in [0.0, 0.5, 1.0, 1.5] {
        // A cell has edge 1.
        let band = (band_cells * (UNITS_PER_EDGE / 8) as f64) as i64;
        let is_beyond = |word: &&u64| {
            facets.meeting(&facets.all(), &word::octant(**word), band).next().is_none()
        };
        // Without a band, crossed leaves are judged, too.
        let judged = |word: &&u64| band_cells == 0.0 || is_beyond(word);
        let expected = words.iter().filter(judged).count() as u64;
        let result = geometry.complete(&tree, band_cells);
        assert_eq!(result.examined, expected, "{band_cells}");
        assert_eq!((1..512).contains(&expected), band_cells > 0.0, "{expected}");
        let findings = result.findings;
        assert!(!findings.is_empty(), "{band_cells}");
        for detail in &findings {
            let names = |&w: &u64| detail.ends_with(&terms.root.place(word::octant(w)).to_string());
            assert!(words.iter().any(names), "{detail}");
        }
    }
}

#[test]
fn a_leaf_coarser_than_the_surface_level_is_judged_by_its_parts_beyond_the_band() {
    let mut case = tetrahedron(4, "[]");
    case.rules.level_surface = 5;
    let (geometry, none) = (Geometry::of(&case), Tree::default());
    let facets = &geometry.truth.facets;
    let survey = geometry.survey(&none, 1.0);
    let meets =
        |octant: &Octant, by: i64| facets.meeting(&facets.all(), octant, by).next().is_some();
    let band = UNITS_PER_EDGE / 32;
    let words = contract::testing::words_of(|o| o.level < 3);
    let octants = words.iter().map(|&w| word::octant(w));
    let free = octants.filter(|leaf| !meets(leaf, 0));
    let wrong: Vec<Octant> = free
        .filter(|leaf| survey.position(*leaf) == Position::On(Side::Outside, false))
        .filter(|leaf| (0..64).any(|p| !meets(&leaf.child(p >> 3).child(p & 7), band)))
        .collect();
    let at_band = wrong.iter().filter(|leaf| meets(leaf, band)).count();
    assert!(0 < at_band && at_band < wrong.len(), "{at_band} of {}", wrong.len());
    let result = geometry.complete(&Tree::of_words(&words), 1.0);
    assert_eq!(result.findings_total, wrong.len() as u64, "{result}");
}

/// Leaves of edge 1 with the sides of the components, and of which kind they are.
fn labelled(space: &Survey) -> Vec<u64> {
    let side = |octant: &Octant| match space.position(*octant) {
        Position::On(side, _) => Some(side),
        Position::Near { .. } => Some(Side::Crossing),
        Position::Undecided => Some(Side::Outside),
    };
    contract::testing::words_with_sides(|o| o.level < 3, side)
}

#[test]
fn a_leaf_with_another_side_than_its_component_is_a_finding_and_undecided_ones_are_counted() {
    for (count, undecided) in [(4, false), (3, true)] {
        let case = tetrahedron(count, "[]");
        let (geometry, none) = (Geometry::of(&case), Tree::default());
        let space = geometry.survey(&none, 0.0);
        let mut words = labelled(&space);
        // Of the largest octant around the leaf that no facet meets.
        let position = |w: &u64| {
            let around = (0..=3).map(|level| word::octant(*w).ancestor(level));
            let is_free = |octant: &Octant| {
                let facets = &geometry.truth.facets;
                facets.meeting(&facets.all(), octant, 0).next().is_none()
            };
            around.into_iter().find(is_free).map_or(CROSSED, |o| space.position(o))
        };
        let count =
            |of: &dyn Fn(Position) -> bool| words.iter().filter(|w| of(position(w))).count() as u64;
        let judged = count(&|position| position != Position::Undecided);
        let not_judged = count(&|position| position == Position::Undecided);
        assert_eq!(not_judged > 0, undecided);
        let check = |words: &[u64]| geometry.sides(&Tree::of_words(words), 0.0);
        let note = format!(
            "leaves beyond 0 cells from the geometry; {not_judged} are not judged, because their rays disagree"
        );
        let result = check(&words);
        assert_eq!((result.findings_total, result.examined, &result.note), (0, judged, &note));
        let far = words.iter().position(|w| matches!(position(w), Position::On(..))).unwrap();
        words[far] ^= 1;
        let (result, leaf) = (check(&words), case.root.place(word::octant(words[far])).to_string());
        let expected = format!("the inside leaf {leaf} is in a component that is outside");
        assert_eq!((result.findings_total, &result.findings[0]), (1, &expected));
        // A label of its own: a crossing leaf where no facet is, even if the rays disagree, and a crossed leaf without it.
        let (mut spurious, mut lost) = (labelled(&space), labelled(&space));
        let at = |of: Position| words.iter().position(|w| position(w) == of);
        if let Some(at) = at(Position::Undecided).or(Some(far)) {
            spurious[at] = spurious[at] & !3 | Side::Crossing as u64;
        }
        lost[at(CROSSED).unwrap()] &= !3;
        for (words, text) in [(spurious, "the crossing leaf"), (lost, "is crossed by a facet")] {
            let result = check(&words);
            assert!(result.findings_total == 1 && result.findings[0].contains(text), "{result}");
        }
    }
}

#[test]
fn crossed_leaves_are_kept_or_deleted_as_the_case_says_unless_the_band_hides_them() {
    for keep_crossing in [true, false] {
        let mut case = tetrahedron(4, "[]");
        case.rules.keep_crossing = keep_crossing;
        let (geometry, none) = (Geometry::of(&case), Tree::default());
        let is_crossing = |w: &u64| w & 3 == Side::Crossing as u64;
        let kept = |w: &u64| is_crossing(w) && keep_crossing || w & 3 == Side::Inside as u64;
        let words = labelled(&geometry.survey(&none, 0.0));
        let right: Vec<u64> = words.iter().copied().filter(kept).collect();
        let check = |words: &[u64], band_cells, knows_crossing| {
            let tree = Tree::of_words(words);
            let mut result = CheckResult::new("complete");
            Survey { knows_crossing, ..geometry.survey(&tree, band_cells) }
                .check_complete(&mut result);
            result
        };
        // All crossed leaves wrong, and one of them.
        let crossed: Vec<u64> = words.iter().copied().filter(is_crossing).collect();
        for wrong in [&crossed[..], &crossed[..1]] {
            let mut words = right.clone();
            words.retain(|w| !wrong.contains(w));
            if !keep_crossing {
                words.extend(wrong);
                words.sort_unstable();
            }
            let what = if keep_crossing { "the mesh has a hole" } else { "a leaf must be deleted" };
            let octant = case.root.place(word::octant(wrong[0])).to_string();
            for band_cells in [0.0, 1.0] {
                let result = check(&words, band_cells, true);
                assert_eq!(result.findings_total, wrong.len() as u64, "{result}");
                assert_eq!(result.findings[0], format!("{what}: {octant}"));
                assert_eq!(check(&right, band_cells, true).findings_total, 0);
            }
            assert_eq!(check(&words, 0.1, false).findings_total, 0);
        }
        let inside = right.iter().position(|w| !is_crossing(w)).unwrap();
        let mut words = right.clone();
        words.remove(inside);
        assert_eq!(check(&words, 0.0, true).findings_total, 1);
    }
}

#[test]
fn without_a_facet_a_place_is_undecided_where_rays_disagree() {
    // The component of the far field reaches into the body, where the rays towards three sides hit facets.
    let far = Position::On(Side::Outside, false);
    assert_eq!(positions(3, "[]", &[&[0, 7, 0], &[7, 7]]), [Position::Undecided, far]);
}
