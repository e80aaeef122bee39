//! Pictures of small meshes whose squares are known, and of random ones.

use super::*;
use contract::octant::Octant;
use contract::testing::{leaf_set, random_words, words_of};
use contract::word::{self, Side, encode};
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
    Request { selection: Selection::default(), body: None, colour, zoom: 1.0 }
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
    let svg = Picture::collect(&mesh, &shown).unwrap().svg();
    // The window is 1370 wide, from 190 to 1560, so a unit of the user is 171.25; the legend ends at 76.
    for path in [
        "M190 1446H532.5V1103.5H190z",
        "M532.5 1446H875V1103.5H532.5z",
        "M875 1446H1560V761H875z",
        "M190 761H875V76H190z",
    ] {
        assert!(svg.contains(path), "{path} is missing in {svg}");
    }
    assert!(svg.contains(">z = 1; cells in the plane: 7<"), "{svg}");
    assert!(svg.contains(">level<") && !svg.contains("geometry"), "{svg}");
    // Above the small leaves.
    let shown = Request { selection: at(2, 4.0), ..shown };
    let picture = Picture::collect(&mesh, &shown).unwrap();
    assert_eq!((picture.squares.leaves, picture.key.len()), (4, 1));
}

#[test]
fn the_section_of_a_cube_is_a_square_also_in_the_plane_of_its_face() {
    let (_place, mesh) = on_disk(vec![eight_and_seven()]);
    let cube = cube();
    let section = |axis: usize, coordinate: f64| {
        let selection = at(axis, coordinate);
        let shown = Request { selection, body: Some(&cube), ..request(Colour::Level) };
        Picture::collect(&mesh, &shown).unwrap().section.expect("the body is known")
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
    let picture = Picture::collect(&mesh, &shown).unwrap();
    assert_eq!((picture.slice.axis, picture.slice.at), (2, UNITS_PER_EDGE / 2));
    assert!(picture.svg().contains(">geometry<"));
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
        let picture = match Picture::collect(&mesh, &shown) {
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
        let merged = Squares::collect(&mesh, &shown.selection, Colour::Level, [10, 8], 20).unwrap();
        prop_assert!(merged.squares.len() <= 20);
        prop_assert_eq!(merged.squares.iter().map(|s| s.leaves).sum::<u64>(), cut.len() as u64);
        prop_assert_eq!(merged.leaves, cut.len() as u64);
    }
}

#[test]
fn small_leaves_are_merged_and_the_greatest_value_counts() {
    let leaf = |corner, side| encode(Octant { corner, level: 19 }, side);
    let mut words = vec![
        leaf([0; 3], Side::Outside),
        leaf([1, 0, 0], Side::Crossing),
        leaf([0, 1, 0], Side::Inside),
    ];
    words.sort_unstable();
    let (_place, mesh) = on_disk(vec![words]);
    let shown = Request { selection: at(2, 0.0), ..request(Colour::Side) };
    let picture = Picture::collect(&mesh, &shown).unwrap();
    let [square] = picture.squares.squares[..] else { panic!("{picture:?}") };
    assert_eq!((square.level, square.value, square.leaves), (10, Side::Crossing as u32, 3));
    assert!(picture.svg().contains("cells in the plane: 3, the smallest merged"));
}

#[test]
fn a_clip_box_is_the_window() {
    let (_place, mesh) = on_disk(vec![eight_and_seven()]);
    let clip = [[0.0, 0.0, 0.0], [4.0, 2.0, 8.0]].map(|c| mesh.manifest.root.quantise_clamped(c));
    let selection = Selection { clip: Some(clip), ..at(2, 1.0) };
    let shown = Request { selection, ..request(Colour::Level) };
    let picture = Picture::collect(&mesh, &shown).unwrap();
    assert_eq!(picture.window, [[0.0, 0.0], [4.0, 2.0]]);
    assert_eq!((picture.squares.leaves, picture.key[&2].0.as_str()), (2, "2"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Lines of segments outside of the window may still cross it.
    #[test]
    fn the_section_lies_in_the_window(facets in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(0f32..8.0)), 1..40)) {
        let (_place, mesh) = on_disk(vec![eight_and_seven()]);
        let clip = [[1.0, 2.0, 0.0], [3.0, 3.0, 8.0]].map(|c| mesh.manifest.root.quantise_clamped(c));
        let selection = Selection { clip: Some(clip), ..at(2, 4.0) };
        let shown = Request { selection, body: Some(&facets), ..request(Colour::Level) };
        Picture::collect(&mesh, &shown).unwrap().check_invariants();
    }
}

#[test]
fn a_picture_without_cells_and_unknown_sides_are_errors() {
    let (place, mesh) = on_disk(vec![eight_and_seven()]);
    let sentence =
        |mesh: &Mesh, shown: &Request| Picture::collect(mesh, shown).unwrap_err().to_string();
    let selection = Selection { level_max: Some(0), ..Selection::default() };
    let empty = Request { selection, ..request(Colour::Level) };
    assert!(sentence(&mesh, &empty).contains("no leaf of the selection"));
    let sides = contract::manifest::Sides::Unknown;
    contract::manifest::Manifest { sides, ..mesh.manifest.clone() }.write(place.path()).unwrap();
    let unknown = Mesh::open(place.path()).unwrap();
    assert!(sentence(&unknown, &request(Colour::Side)).contains("unknown"));
}

#[test]
fn a_body_beyond_the_root_is_no_obstacle() {
    let (place, mesh) = on_disk(vec![eight_and_seven()]);
    // The sum of corner and edge is beyond this root by a rounding error.
    let root = Root { origin: [0.1; 3], edge: 0.3 };
    contract::manifest::Manifest { root, ..mesh.manifest }.write(place.path()).unwrap();
    let mesh = Mesh::open(place.path()).unwrap();
    let shown = Request { body: Some(&cube()), ..request(Colour::Level) };
    let picture = Picture::collect(&mesh, &shown).unwrap();
    assert_eq!((picture.slice.at, picture.squares.leaves), (UNITS_PER_EDGE, 4));
}

#[test]
fn a_picture_has_the_format_of_its_name() {
    let (_place, mesh) = on_disk(vec![eight_and_seven()]);
    let svg = Picture::collect(&mesh, &request(Colour::Level)).unwrap().svg();
    assert_eq!(format_of("a.svg".as_ref()).unwrap()(&svg).unwrap(), svg.as_bytes());
    for name in ["a.vtk", "a", ".svg", "a.html"] {
        assert!(format_of(name.as_ref()).unwrap_err().contains(".svg"), "{name}");
    }
    if cfg!(feature = "figures") {
        let bytes = |name: &str| format_of(name.as_ref()).unwrap()(&svg).unwrap();
        assert_eq!(&bytes("a.PNG")[1..4], b"PNG");
        assert!(bytes("a.pdf").starts_with(b"%PDF"));
    }
}

#[test]
fn planes_far_from_the_origin_have_their_digits() {
    let (_place, mesh) = on_disk(vec![eight_and_seven()]);
    let picture = Picture::collect(&mesh, &request(Colour::Level)).unwrap();
    let root = Root { origin: [22_191.242, -14_722.031, 689.93], edge: 5553.0 };
    for (z, name) in [(3410.4, "z = 3410.4"), (3410.0, "z = 3410"), (689.93, "z = 689.93")] {
        let slice = Slice::new(&root, 2, z).unwrap();
        assert_eq!(Picture { slice, root, ..picture.clone() }.plane_name(), name);
    }
}

/// Slices in every colour, of a root far from the origin too.
#[cfg(feature = "figures")]
#[test]
fn no_text_of_a_picture_is_cut_or_lies_on_another() {
    use crate::figure::tests::assert_legible;
    let words = eight_and_seven();
    let (_place, mesh) = on_disk(words.chunks(1).map(<[u64]>::to_vec).collect());
    let cube = cube();
    for colour in [Colour::Level, Colour::Rank, Colour::Side] {
        let shown = Request { body: Some(&cube), ..request(colour) };
        let picture = Picture::collect(&mesh, &shown).unwrap();
        assert_legible(&picture.svg());
        let far = |at: f64| at - 12_345_678.0;
        let window = picture.window.map(|corner| corner.map(far));
        let root = Root { origin: picture.root.origin.map(far), ..picture.root };
        assert_legible(&Picture { window, root, section: None, ..picture }.svg());
    }
}

/// Asserts that a change of a picture is noticed, and for the stated reason.
fn assert_noticed(why: &str, change: impl Fn(&mut Picture)) {
    let (_dir, mesh) = on_disk(vec![eight_and_seven()]);
    let facet = [[1.0f32, 1.0, -1.0], [7.0, 1.0, 9.0], [1.0, 7.0, 9.0]];
    let request = Request { body: Some(&[facet]), selection: at(2, 1.0), ..request(Colour::Level) };
    let mut picture = Picture::collect(&mesh, &request).unwrap();
    change(&mut picture);
    let check = std::panic::AssertUnwindSafe(|| {
        picture.check_invariants();
        picture.squares.check_invariants(SQUARES_MAX);
    });
    let caught = std::panic::catch_unwind(check).unwrap_err();
    let message = caught.downcast_ref::<String>().cloned();
    let message = message.unwrap_or_else(|| panic!("no message"));
    assert!(message.contains(why), "{message}");
}

#[test]
fn planted_wrong_pictures_are_noticed() {
    assert_noticed("not within the root", |p| p.window[1][0] = 9.0);
    assert_noticed("is outside of", |p| p.window = [[6.0; 2], [8.0; 2]]);
    assert_noticed("has no colour", |p| _ = p.key.pop_last());
    assert_noticed("leaves [", |p| {
        p.section.as_mut().expect("the body is known")[0][0][1] = -5.0;
    });
    assert_noticed("not the square of an octant", |p| p.squares.squares[0].corner[0] += 1);
    assert_noticed("leaves of all squares", |p| p.squares.leaves += 1);
    assert_noticed("overlap", |p| p.squares.squares.swap(0, 5));
}
