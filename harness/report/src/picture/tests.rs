//! Pictures of small meshes whose squares are known, and of random ones.

use super::format::{Format, write};
use super::scene::{Scene, html};
use super::squares::Detail;
use super::*;
use contract::octant::Octant;
use contract::testing::{leaf_set, random_words, words_of};
use contract::word::{self, Leaf, Side, encode};
use export::selection::Selection;
use proptest::prelude::*;
use tempfile::TempDir;

/// A mesh on disk; the root begins at 0 and its edge is 8.
fn on_disk(parts: Vec<Vec<u64>>) -> (TempDir, Mesh) {
    let place = tempfile::tempdir().unwrap();
    leaf_set(parts).write(place.path()).unwrap();
    let mesh = Mesh::open(place.path()).unwrap();
    (place, mesh)
}

/// Seven leaves of edge 4, and eight of edge 2 at the origin.
fn eight_and_seven() -> Vec<u64> {
    words_of(|o| o.level == 0 || o.level == 1 && o.corner == [0; 3])
}

fn request(colour: Colour) -> Request<'static> {
    Request {
        selection: Selection::default(),
        body: None,
        colour,
        zoom: 1.0,
        level_max: LEVEL_MAX,
        command: "harness picture mesh --out a.svg".to_owned(),
    }
}

fn at(axis: usize, coordinate: f64) -> Selection {
    let root = Root { origin: [0.0; 3], edge: 8.0 };
    Selection { slice: Slice::new(&root, axis, coordinate), ..Selection::default() }
}

/// The cube from 2 to 6: two facets on either side of each axis.
fn cube() -> Vec<Facet> {
    let mut facets = Vec::new();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 2.0), (axis, 6.0)]) {
        let corner = |u: f32, v: f32| {
            let mut at = [side; 3];
            (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (u, v);
            at
        };
        facets.push([corner(2.0, 2.0), corner(6.0, 2.0), corner(6.0, 6.0)]);
        facets.push([corner(2.0, 2.0), corner(6.0, 6.0), corner(2.0, 6.0)]);
    }
    facets
}

#[test]
fn squares_are_where_the_leaves_are() {
    let (_place, mesh) = on_disk(vec![eight_and_seven()]);
    let shown = Request { selection: at(2, 1.0), ..request(Colour::Level) };
    let svg = svg(&Picture::collect(&mesh, &shown, &DETAIL).unwrap());
    // The window is 1360 wide, from 200 to 1560, so a unit of the user is 170; the legend ends at 72.
    for path in [
        "M200 752h340v340h-340z",
        "M540 1092h340v340h-340z",
        "M880 752h680v680h-680z",
        "M200 72h680v680h-680z",
    ] {
        assert!(svg.contains(path), "{path} is missing in {svg}");
    }
    assert_eq!((svg.matches("h340v340").count(), svg.matches("h680v680").count()), (4, 3));
    assert!(svg.contains(">z = 1; 7 cells in the plane<"), "{svg}");
    assert!(svg.contains(">level<") && !svg.contains("geometry"), "{svg}");
    // Above the small leaves.
    let shown = Request { selection: at(2, 4.0), ..shown };
    let picture = Picture::collect(&mesh, &shown, &DETAIL).unwrap();
    assert_eq!((picture.squares.leaves, picture.key.len()), (4, 1));
}

#[test]
fn the_section_of_a_cube_is_a_square_also_in_the_plane_of_its_face() {
    let (_place, mesh) = on_disk(vec![eight_and_seven()]);
    let cube = cube();
    let section = |axis: usize, coordinate: f64| {
        let selection = at(axis, coordinate);
        let shown = Request { selection, body: Some(&cube), ..request(Colour::Level) };
        Picture::collect(&mesh, &shown, &DETAIL).unwrap().section.unwrap()
    };
    for (axis, coordinate) in [(0, 4.0), (1, 3.3), (2, 4.0), (2, 2.0)] {
        let segments = section(axis, coordinate);
        let length = |[p, q]: &[Planar; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
        assert!((segments.iter().map(length).sum::<f64>() - 16.0).abs() < 1e-6, "{segments:?}");
        for p in segments.as_flattened() {
            assert!(p.iter().any(|c| (c - 2.0).abs() < 1e-6 || (c - 6.0).abs() < 1e-6), "{p:?}");
        }
    }
    // The plane of the upper face is that of the leaves above it.
    assert!(section(2, 6.0).is_empty());
    // Without a slice, the plane halves the cube.
    let shown = Request { body: Some(&cube), ..request(Colour::Side) };
    let picture = Picture::collect(&mesh, &shown, &DETAIL).unwrap();
    assert_eq!((picture.slice.axis, picture.slice.at), (2, UNITS_PER_EDGE / 2));
    assert!(svg(&picture).contains(">geometry<"));
}

proptest! {
    #[test]
    fn squares_have_the_area_of_the_leaves_that_the_plane_cuts(
        leaves in random_words(5), axis in 0usize..3, coordinate in 0.0f64..8.0
    ) {
        let (_place, mesh) = on_disk(vec![leaves.clone()]);
        let selection = at(axis, coordinate);
        let slice = selection.slice.unwrap();
        let cut: Vec<Octant> = leaves.iter().map(|&w| word::octant(w)).filter(|o| slice.cuts(o)).collect();
        let shown = Request { selection, ..request(Colour::Level) };
        let picture = match Picture::collect(&mesh, &shown, &DETAIL) {
            Ok(picture) => picture,
            Err(error) => {
                prop_assert!(cut.is_empty(), "{}", error);
                return Ok(());
            }
        };
        let area = |edge: u32| f64::from(edge).powi(2);
        let expected: f64 = cut.iter().map(|o| area(o.edge())).sum();
        let squares = &picture.squares.squares;
        prop_assert_eq!(squares.iter().map(|s| area(s.edge())).sum::<f64>(), expected);
        prop_assert_eq!(picture.squares.leaves, cut.len() as u64);
        // As many as a small page holds; each leaf is in one of them.
        let detail = Detail { squares_max: 20, outlined_max: 5, level_max: LEVEL_MAX };
        let merged = Picture::collect(&mesh, &shown, &detail).unwrap().squares;
        prop_assert!(merged.squares.len() <= 20);
        prop_assert_eq!(merged.squares.iter().map(|s| s.leaves).sum::<u64>(), cut.len() as u64);
        prop_assert_eq!(merged.leaves, cut.len() as u64);
        let outlined = merged.squares.iter().filter(|s| s.level <= merged.level_outlined);
        prop_assert!(outlined.count() <= 5 || merged.level_outlined == 0);
    }
}

#[test]
fn small_leaves_are_merged_and_the_greatest_value_counts() {
    let leaf = |corner, side| encode(&Leaf { octant: Octant { corner, level: 19 }, side });
    let mut words = vec![
        leaf([0; 3], Side::Outside),
        leaf([1, 0, 0], Side::Crossing),
        leaf([0, 1, 0], Side::Inside),
    ];
    words.sort_unstable();
    let (_place, mesh) = on_disk(vec![words]);
    let shown = Request { selection: at(2, 0.0), ..request(Colour::Side) };
    let picture = Picture::collect(&mesh, &shown, &DETAIL).unwrap();
    let [square] = picture.squares.squares[..] else { panic!("{picture:?}") };
    assert_eq!((square.level, square.value, square.leaves), (10, Side::Crossing as u32, 3));
    assert!(svg(&picture).contains("3 cells in the plane, the smallest merged"));
    // The base mesh shows its own levels.
    let shown = Request { level_max: 6, colour: Colour::Level, ..shown };
    let picture = Picture::collect(&mesh, &shown, &DETAIL).unwrap();
    assert_eq!((picture.squares.squares.len(), picture.key[0].value), (1, 6));
    assert!(svg(&picture).contains("; 1 cell in the plane<"));
}

#[test]
fn a_clip_box_is_the_window() {
    let (_place, mesh) = on_disk(vec![eight_and_seven()]);
    let clip = [[0.0, 0.0, 7.0], [4.0, 2.0, 8.0]].map(|c| mesh.manifest.root.quantise_clamped(c));
    let selection = Selection { clip: Some(clip), ..at(2, 1.0) };
    let shown = Request { selection, ..request(Colour::Spacing) };
    let picture = Picture::collect(&mesh, &shown, &DETAIL).unwrap();
    assert_eq!(picture.window, [[0.0, 0.0], [4.0, 2.0]]);
    assert_eq!((picture.squares.leaves, picture.key[0].name.as_str()), (2, "2"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Lines of segments outside of the window may still cross it.
    #[test]
    fn the_section_lies_in_the_window(facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(0f32..8.0)), 1..40)) {
        let (_place, mesh) = on_disk(vec![eight_and_seven()]);
        let clip = [[1.0, 2.0, 0.0], [3.0, 3.0, 8.0]].map(|c| mesh.manifest.root.quantise_clamped(c));
        let selection = Selection { clip: Some(clip), ..at(2, 4.0) };
        let shown = Request { selection, body: Some(&facets), ..request(Colour::Spacing) };
        Picture::collect(&mesh, &shown, &DETAIL).unwrap().check_invariants();
    }
}

#[test]
fn a_picture_without_cells_and_unknown_sides_are_errors() {
    let (place, mesh) = on_disk(vec![eight_and_seven()]);
    let sentence = |mesh: &Mesh, shown: &Request| {
        Picture::collect(mesh, shown, &DETAIL).unwrap_err().to_string()
    };
    let selection = Selection { level_max: Some(0), ..Selection::default() };
    let empty = Request { selection, ..request(Colour::Level) };
    assert!(sentence(&mesh, &empty).contains("no leaf of the selection"));
    let sides = contract::manifest::Sides::Unknown;
    contract::manifest::Manifest { sides, ..mesh.manifest.clone() }.write(place.path()).unwrap();
    let unknown = Mesh::open(place.path()).unwrap();
    assert!(sentence(&unknown, &request(Colour::Side)).contains("unknown"));
}

#[test]
fn a_picture_is_written_in_the_format_of_its_name() {
    let (place, mesh) = on_disk(vec![eight_and_seven()]);
    let picture = Picture::collect(&mesh, &request(Colour::Level), &DETAIL).unwrap();
    let path = place.path().join("a.svg");
    write(&picture, Format::of(&path).unwrap(), &path).unwrap();
    assert!(path.is_file());
    let error = write(&picture, Format::Svg, &place.path().join("no/a.svg")).unwrap_err();
    assert!(error.to_string().contains("no/a.svg"), "{error}");
    for (name, why) in
        [("a.vtk", "must end in .svg"), ("a", "must end in"), (".svg", "must end in")]
    {
        assert!(Format::of(name.as_ref()).unwrap_err().contains(why), "{name}");
    }
    assert!(Format::Html.draw(&picture).is_err());
    if cfg!(feature = "figures") {
        assert_eq!(&Format::Png.draw(&picture).unwrap()[1..4], b"PNG");
        assert!(Format::Pdf.draw(&picture).unwrap().starts_with(b"%PDF"));
    }
}

#[test]
fn a_view_has_three_slices_and_the_ranks_of_the_surface_and_needs_no_network() {
    let words = eight_and_seven();
    let (_place, mesh) = on_disk(vec![words[..10].to_vec(), words[10..].to_vec()]);
    let cube = cube();
    let shown = Request { body: Some(&cube), ..request(Colour::Rank) };
    let scene = Scene::collect(&mesh, &shown).unwrap();
    let names: Vec<&str> = scene.slices.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["z = 4", "x = 4", "y = 4"]);
    // Six bytes per square are eight characters; the planes cut the four leaves above 4.
    assert!(scene.slices.iter().all(|s| s.squares.len() == 4 * 8));
    assert_eq!(scene.legend.len(), 2);
    let body = scene.body.as_ref().unwrap();
    assert_eq!(body.points.len(), (8 * 12usize).div_ceil(3) * 4);
    let page = html(&scene);
    assert!(page.contains("\"title\": \"15 cells by rank\"") && !page.contains("{}</script>"));
    for outside in ["http", "src=", "import ", "@import", "url(", "fetch("] {
        assert!(!page.contains(outside), "{outside}");
    }
    let alone = scene.of_body();
    assert!(alone.slices.is_empty() && alone.legend.is_empty() && alone.body.is_some());
}

#[test]
fn labels_of_the_vertical_axis_have_room_and_planes_far_from_the_origin_their_digits() {
    let at = |v: f64| [[0.0, v], [100.0, v + 100.0]];
    // Five digits and a sign are wider than the usual margin.
    assert!(draw::scale(&at(-12_050.0)) < 0.97 * draw::scale(&at(0.0)));
    let root = Root { origin: [22_191.242, -14_722.031, 689.93], edge: 5553.0 };
    for (z, name) in [(3410.4, "z = 3410.4"), (3410.0, "z = 3410"), (689.93, "z = 689.93")] {
        assert_eq!(plane_name(&root, Slice::new(&root, 2, z).unwrap()), name);
    }
}

/// Asserts that a change of a picture is noticed, and for the stated reason.
fn assert_noticed(why: &str, change: impl Fn(&mut Picture)) {
    let (_dir, mesh) = on_disk(vec![eight_and_seven()]);
    let facet = [[1.0f32, 1.0, -1.0], [7.0, 1.0, 9.0], [1.0, 7.0, 9.0]];
    let request = Request { body: Some(&[facet]), selection: at(2, 1.0), ..request(Colour::Level) };
    let mut picture = Picture::collect(&mesh, &request, &DETAIL).unwrap();
    change(&mut picture);
    let check = std::panic::AssertUnwindSafe(|| {
        picture.check_invariants();
        picture.squares.check_invariants(&DETAIL);
    });
    let caught = std::panic::catch_unwind(check).unwrap_err();
    let message = caught.downcast_ref::<String>().cloned();
    let message = message.unwrap_or_else(|| panic!("no message"));
    assert!(message.contains(why), "{message}");
}

#[test]
fn planted_wrong_pictures_are_noticed() {
    assert_noticed("not within the root", |p| p.window[1][0] = 9.0);
    assert_noticed("outside of the window", |p| p.window = [[6.0; 2], [8.0; 2]]);
    assert_noticed("has no colour", |p| p.key.truncate(1));
    assert_noticed("leaves the window", |p| p.section.as_mut().unwrap()[0][0][1] = -5.0);
    assert_noticed("not the square of an octant", |p| p.squares.squares[0].corner[0] += 1);
    assert_noticed("leaves of all squares", |p| p.squares.leaves += 1);
    assert_noticed("overlap", |p| p.squares.squares.swap(0, 5));
}
