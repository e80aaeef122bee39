//! Shapes with known defects, and shapes without any.

mod drawn;

use contract::case::Facet;
use contract::lattice::Root;
use contract::testing::assert_text;
use geometry::diagnose;
use geometry::finding::{Kind, Place};
use geometry::input::{Input, Requested};
use geometry::report::Diagnosis;

/// Lattice units are powers of two, so that vertices with integer coordinates are exact.
const ROOT: Root = Root { origin: [-16.0; 3], edge: 32.0 };

fn diagnosis(facets: Vec<Facet>, spacing_min: Option<f64>) -> Diagnosis {
    let requested = Requested { spacing_min, root: Some(ROOT), ..Requested::default() };
    diagnose(&Input::of(Default::default(), facets, requested).unwrap(), 5)
}

fn count(diagnosis: &Diagnosis, kind: Kind) -> u64 {
    diagnosis.finding(kind).unwrap().count
}

/// The kinds that occur, with their counts.
fn counts(diagnosis: &Diagnosis) -> Vec<(Kind, u64)> {
    let found = diagnosis.findings.iter().filter(|f| f.count > 0);
    found.map(|f| (f.kind, f.count)).collect()
}

fn first(diagnosis: &Diagnosis, kind: Kind) -> &Place {
    &diagnosis.finding(kind).unwrap().places[0]
}

fn quad([a, b, c, d]: [[f32; 3]; 4]) -> [Facet; 2] {
    [[a, b, c], [a, c, d]]
}

/// An axis-parallel box, wound outward. The first two facets are the face z = low.
fn cuboid(low: [f32; 3], high: [f32; 3]) -> Vec<Facet> {
    let corner = |i: usize| std::array::from_fn(|a| if i >> a & 1 == 1 { high[a] } else { low[a] });
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    faces.iter().flat_map(|face| quad(face.map(corner))).collect()
}

fn cube() -> Vec<Facet> {
    cuboid([0.0; 3], [4.0; 3])
}

/// A cube whose face z = 0 has a rectangular hole.
fn cube_with_hole(low: [f32; 2], high: [f32; 2]) -> Vec<Facet> {
    let outer = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
    let inner = [low, [high[0], low[1]], high, [low[0], high[1]]];
    let at = |[x, y]: [f32; 2]| [x, y, 0.0];
    let side = |i: usize| {
        let j = (i + 1) % 4;
        quad([at(outer[i]), at(inner[i]), at(inner[j]), at(outer[j])])
    };
    (0..4).flat_map(side).chain(cube().split_off(2)).collect()
}

fn close(a: Option<f64>, b: f64) -> bool {
    a.is_some_and(|a| (a - b).abs() < 1e-9)
}

#[test]
fn a_cube_has_no_findings() {
    let cube = diagnosis(cube(), Some(0.25));
    assert_eq!(counts(&cube), []);
    assert!(!cube.changes_region);
    assert_eq!((cube.vertices, cube.shells.count, cube.shells.closed), (8, 1, 1));
    assert_eq!(cube.extent.margin, 12.0);
}

#[test]
fn a_removed_facet_leaves_one_opening_of_known_size() {
    let mut facets = cube();
    facets.remove(0);
    let wide = diagnosis(facets.clone(), Some(2.0));
    assert_eq!(counts(&wide), [(Kind::Openings, 1)]);
    let hole = first(&wide, Kind::Openings);
    assert!(close(hole.width, 8f64.sqrt()));
    assert!(wide.changes_region);
    assert_eq!(wide.shells.closed, 0);
    // At a spacing above its width no cell fits through.
    let narrow = diagnosis(facets, Some(4.0));
    assert_eq!((count(&narrow, Kind::Openings), narrow.changes_region), (1, false));
}

#[test]
fn the_rim_of_a_half_model_in_a_face_of_the_root_is_no_opening() {
    let mut facets = cube();
    // The face x = 0.
    facets.drain(8..10);
    let openings = |x: f64| {
        let root = Some(Root { origin: [x, -4.0, -4.0], edge: 16.0 });
        let requested = Requested { spacing_min: Some(0.25), root, ..Requested::default() };
        diagnose(&Input::of(Default::default(), facets.clone(), requested).unwrap(), 5)
            .finding(Kind::Openings)
            .unwrap()
            .count
    };
    // No leaf fits between the rim and a face that is less than a cell away.
    assert_eq!([0.0, 1.0, -0.2, -0.25, -1.0].map(openings), [0, 0, 0, 1, 1]);
    // A box beyond the root has no cells there, of whatever size.
    let mut half = cuboid([-15.875, -2.0, -2.0], [-8.0, 2.0, 2.0]);
    half.retain(|f| f.iter().any(|v| v[0] != -15.875));
    let beyond = "[[box]]\nmin = [-20.0, -3.0, -3.0]\nmax = [-17.0, 3.0, 3.0]\nspacing = 0.05";
    for rules in ["", beyond] {
        assert_eq!(count(&case(&half, rules), Kind::Openings), 0, "{rules}");
    }
}

/// A slot from face to face of the root keeps two rims only, of an edge each, which are one opening.
#[test]
fn an_opening_from_face_to_face_of_the_root_is_as_wide_as_between_its_edges() {
    let bar = cuboid([0.0, 0.0, -16.0], [4.0, 4.0, 16.0]);
    let is_along = |f: &Facet, a: usize| f.iter().any(|v| v[a] != f[0][a]);
    let channel: Vec<Facet> = bar.into_iter().filter(|f| is_along(f, 2)).collect();
    assert_eq!(count(&case(&channel, ""), Kind::Openings), 0);
    let is_wall = |f: &Facet| is_along(f, 0) || f[0][0] == 0.0;
    let found = case(&channel.into_iter().filter(is_wall).collect::<Vec<_>>(), "");
    let openings = found.finding(Kind::Openings).unwrap();
    assert_eq!((openings.count, openings.count_changing), (1, 1), "{found}");
    assert!(close(openings.places[0].width, 4.0), "{found}");
}

/// By the wall with a hole smaller than a cell, octants that a box divides have smaller leaves, beyond the box, too.
#[test]
fn a_box_beside_an_opening_may_let_it_leak() {
    let facets = cube_with_hole([1.9; 2], [2.1; 2]);
    for (high, has_effect) in [(-0.02, true), (-4.0, false)] {
        let rules =
            format!("[[box]]\nmin = [1.0, 1.0, -8.0]\nmax = [3.0, 3.0, {high:?}]\nspacing = 0.05");
        let found = case(&facets, &rules);
        let openings = found.finding(Kind::Openings).unwrap();
        assert_eq!((openings.count, openings.count_changing), (1, has_effect.into()), "{found}");
    }
}

/// A hole that crossing leaves close leaves a solid in a solid what it is.
#[test]
fn a_solid_in_a_solid_is_found_behind_a_hole_smaller_than_a_cell() {
    let scaled = |v: [f32; 3]| v.map(|c| c * 4.0 - 6.0);
    let around: Vec<Facet> = cube().iter().map(|f| f.map(scaled)).collect();
    for (high, nested) in [(2.1, 1), (3.0, 0)] {
        let facets = [&around[..], &cube_with_hole([1.9; 2], [high; 2])].concat();
        let found = case(&facets, "keep = 'inside'");
        assert_eq!(count(&found, Kind::Nested), nested, "{found}");
    }
}

/// Both cavities are closed and beside each other, but bound one solid.
#[test]
fn a_wall_between_two_cavities_is_thin() {
    let cavity = |low, high| cuboid(low, high).into_iter().map(|[a, b, c]| [c, b, a]).collect();
    let cavities: [Vec<Facet>; 2] =
        [cavity([1.0; 3], [3.0, 7.0, 7.0]), cavity([3.125, 1.0, 1.0], [7.0; 3])];
    let body = [cuboid([0.0; 3], [8.0; 3]), cavities.concat()].concat();
    let found = case(&body, "keep = 'inside'");
    assert_eq!(count(&found, Kind::ThinWalls), 4, "{found}");
}

/// Seeds and not rays say what is flow, but crossing leaves on copies within the body stay.
#[test]
fn copies_within_the_body_change_the_region_of_seeds_beyond_it_if_crossing_leaves_stay() {
    let other = cuboid([4.0, 0.0, 0.0], [8.0, 4.0, 4.0]).into_iter().map(|[a, b, c]| [c, b, a]);
    let facets: Vec<Facet> = cube().into_iter().chain(other).collect();
    for keep_crossing in [true, false] {
        let found =
            case(&facets, &format!("keep_crossing = {keep_crossing}\nseeds = [[-9.0, 3.5, 3.5]]"));
        let changing = found.finding(Kind::Duplicates).unwrap().count_changing;
        assert_eq!(changing, if keep_crossing { 2 } else { 0 }, "{found}");
    }
}

/// The last layer of leaves before the root's boundary may cross the body.
#[test]
fn an_overlap_in_a_body_a_cell_from_the_root_may_be_flow() {
    let overlapping = |margin: f32| {
        let at = 16.0 - margin;
        [cuboid([0.0; 3], [at; 3]), cuboid([4.0; 3], [8.0; 3])].concat()
    };
    for (margin, has_effect) in [(0.25, true), (0.26, false)] {
        let found = case(&overlapping(margin), "keep_crossing = false");
        assert_eq!(found.changes_region, has_effect, "{found}");
    }
}

#[test]
fn vertices_that_f32_numbers_cannot_hold_are_found() {
    let mut facets = cube();
    facets.as_flattened_mut().iter_mut().for_each(|corner| corner[1] += 5e6);
    let root = Some(Root { origin: [-16.0, 5e6 - 16.0, -16.0], edge: 32.0 });
    // Such numbers are half a unit apart.
    for (spacing, rounded) in [(0.5, 12), (2.0, 0)] {
        let requested = Requested { spacing_min: Some(spacing), root, ..Requested::default() };
        let found = diagnose(&Input::of(Default::default(), facets.clone(), requested).unwrap(), 5);
        assert_eq!(count(&found, Kind::Rounded), rounded);
    }
    // All but the lower face reach into a box with finer cells.
    let text = "spacing_min = 2.0\nroot = { origin = [-16.0, 4999984.0, -16.0], edge = 32.0 }\n\
        [generator]\nshape = 'cube'\nfacets = 12\nedge = 4.0\ncentre = [2.0, 5000002.0, 2.0]\n\
        [[box]]\nmin = [-9.0, 4999990.0, 3.5]\nmax = [9.0, 5000010.0, 9.0]\nspacing = 0.5\n";
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("far.toml");
    std::fs::write(&path, text).unwrap();
    let found = diagnose(&Input::read(&path, Requested::default()).unwrap(), 5);
    assert_eq!((count(&found, Kind::Rounded), found.changes_region), (10, true));
}

#[test]
fn a_slit_is_judged_by_its_width_and_not_by_its_length() {
    let facets = cube_with_hole([1.0, 2.0], [3.0, 2.125]);
    for (spacing, changes) in [(0.125, true), (0.25, false)] {
        let slit = diagnosis(facets.clone(), Some(spacing));
        assert_eq!(count(&slit, Kind::Openings), 1);
        assert!(close(first(&slit, Kind::Openings).width, 0.125));
        assert_eq!(slit.changes_region, changes, "spacing {spacing}");
    }
}

#[test]
fn a_repeated_facet_is_a_duplicate_in_any_order_of_its_vertices() {
    let mut facets = cube();
    let [a, b, c] = facets[5];
    facets.push([c, b, a]);
    let found = diagnosis(facets, Some(0.25));
    assert_eq!(counts(&found), [(Kind::NonManifoldOdd, 3), (Kind::Duplicates, 1)]);
    assert_eq!(first(&found, Kind::Duplicates).facets, [5, 12]);
    // Rays pass three copies like one, but two like none.
    let copies = |n: usize| diagnosis(cube().repeat(n), Some(0.25));
    let of_copies = |n| (count(&copies(n), Kind::Duplicates), copies(n).changes_region);
    assert_eq!([2, 3].map(of_copies), [(12, true), (24, false)]);
    assert!(found.changes_region);
}

/// Every facet twice, the second time reversed: rays see no body, and the hole is where all facets of an edge are copies of one.
#[test]
fn a_hole_in_a_surface_of_two_sides_is_an_opening() {
    let mut facets = cube();
    let [a, b, c] = facets.remove(5);
    let openings =
        |facets: &[Facet]| first(&diagnosis(facets.to_vec(), None), Kind::Openings).width;
    let once = openings(&facets);
    let reversed: Vec<Facet> = facets.iter().map(|&[a, b, c]| [a, c, b]).collect();
    facets.extend(reversed);
    assert_eq!(openings(&facets), once, "around {:?}", [a, b, c]);
    facets.extend([[a, b, c], [a, c, b]]);
    assert_eq!(count(&diagnosis(facets, None), Kind::Openings), 0);
}

/// A cylinder with a slot around half of it: its rim is an arc there and back again, whose depth is no width.
#[test]
fn the_width_of_a_slot_around_a_pipe_is_an_upper_bound() {
    let at = |i: usize, z: f32| {
        let (sin, cos) = ((i % 32) as f32 * std::f32::consts::TAU / 32.0).sin_cos();
        [cos, sin, z]
    };
    let heights = [-2.0, -0.0025, 0.0025, 2.0];
    let side = |i: usize| {
        let quads = heights.windows(2).enumerate().filter(move |(layer, _)| *layer != 1 || i >= 16);
        quads.flat_map(move |(_, z)| {
            quad([at(i, z[0]), at(i + 1, z[0]), at(i + 1, z[1]), at(i, z[1])])
        })
    };
    let lids = |i: usize| [-2.0, 2.0].map(|z| [[0.0, 0.0, z], at(i, z), at(i + 1, z)]);
    let facets: Vec<Facet> = (0..32).flat_map(|i| side(i).chain(lids(i))).collect();
    let found = diagnosis(facets, Some(0.05));
    let place = first(&found, Kind::Openings);
    assert!(place.is_bound && place.width.unwrap() > 0.5, "{place:?}");
    assert!(found.to_string().contains("): at most "), "{found}");
}

/// A slot of which one end is raised, so that its ends are farther from the line between them than its sides are.
#[test]
fn a_rim_that_is_not_flat_is_not_narrower_than_what_passes() {
    let mut facets = cube_with_hole([1.0, 2.0], [3.0, 2.25]);
    let raised = |corner: &[f32; 3]| corner[..2] == [3.0, 2.25];
    let corners = facets.as_flattened_mut().iter_mut();
    corners.filter(|corner| raised(corner)).for_each(|corner| corner[2] += 0.25);
    let slot = diagnosis(facets, Some(0.25));
    let width = first(&slot, Kind::Openings).width.unwrap();
    assert!((0.25..0.5).contains(&width) && slot.changes_region, "{width}");
}

/// Only a small part of two large facets faces the other.
#[test]
fn a_gap_between_parts_of_large_facets_is_found() {
    let upper = cuboid([3.8, 3.8, 4.0625], [8.0; 3]);
    let found = diagnosis([cube(), upper].concat(), Some(0.125));
    assert_eq!(counts(&found), [(Kind::ThinGaps, 4)]);
}

/// A case with these facets in a root that all of them lie in.
fn case(facets: &[Facet], rules: &str) -> Diagnosis {
    let dir = tempfile::tempdir().unwrap();
    let vertex = |[x, y, z]: &[f32; 3]| format!("vertex {x} {y} {z}\n");
    let facet = |f: &Facet| {
        let corners = f.iter().map(vertex).collect::<String>();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    let text = facets.iter().map(facet).collect::<String>();
    std::fs::write(dir.path().join("body.stl"), format!("solid\n{text}endsolid\n")).unwrap();
    let root = "root = { origin = [-16.0, -16.0, -16.0], edge = 32.0 }";
    let text = format!("geometry = 'body.stl'\nspacing_min = 0.25\n{root}\n{rules}\n");
    std::fs::write(dir.path().join("case.toml"), text).unwrap();
    diagnose(&Input::read(&dir.path().join("case.toml"), Requested::default()).unwrap(), 5)
}

/// Equal facets, or others in one plane, back to back, are a wall in the flow through both solids. A solid in a solid is a space.
#[test]
fn where_solids_touch_and_solids_in_solids_change_the_region_if_leaves_within_are_kept() {
    let seeds = |within: bool| format!("seeds = [[{}, 3.5, 3.5]]", if within { 0.5 } else { -9.0 });
    let [within, beyond] = [true, false].map(seeds);
    let rules = [
        // Crossing leaves within the body stay in the mesh.
        ("", true),
        ("keep_crossing = false", false),
        ("keep = 'inside'", true),
        ("keep = 'all'", true),
        (&within, true),
        (&beyond, true),
        (&format!("keep_crossing = false\n{beyond}"), false),
        (&format!("keep = 'inside'\n{within}"), true),
        (&format!("keep = 'inside'\nkeep_crossing = false\n{beyond}"), false),
        (&format!("keep = 'all'\n{beyond}"), true),
    ];
    let equal = cuboid([4.0, 0.0, 0.0], [8.0, 4.0, 4.0]);
    let other = cuboid([4.0, 1.0, 1.0], [6.0, 3.0, 3.0]);
    for (second, kind, effects) in [
        (equal, Kind::Duplicates, 2),
        (other, Kind::Intersections, 2),
        (cuboid([1.0; 3], [3.0; 3]), Kind::Nested, 1),
    ] {
        for (rules, has_effect) in rules {
            let found = case(&[cube(), second.clone()].concat(), rules);
            let changing = found.finding(kind).unwrap().count_changing;
            assert_eq!(changing, if has_effect { effects } else { 0 }, "{rules}: {found}");
        }
    }
    let nested = [cube(), cuboid([1.0; 3], [3.0; 3])].concat();
    assert!(case(&nested, "enclosed = 'keep'").changes_region);
    // A vertex on an edge and a narrow hole open the edges of the shell around it.
    let [a, b, c] = nested[0];
    let [middle, off] = [0.0, 0.01].map(|by| [0, 1, 2].map(|x| (b[x] + c[x]) / 2.0 + by));
    for middle in [middle, off] {
        let parts = vec![[a, b, middle], [a, middle, c]];
        let found = case(&[&nested[1..], &parts].concat(), "keep = 'inside'");
        assert_eq!((found.shells.closed, count(&found, Kind::Nested)), (1, 1), "{found}");
        assert!(found.changes_region);
    }
    // The inner one may be open at T-junctions, too, also wound as a cavity, but not at an opening.
    let [p, q, r] = nested[12];
    let middle = [0, 1, 2].map(|x| (q[x] + r[x]) / 2.0);
    for is_solid in [true, false] {
        let inner = [&nested[13..], &[[p, q, middle], [p, middle, r]]].concat();
        let inner = inner.iter().map(|&[a, b, c]| if is_solid { [a, b, c] } else { [c, b, a] });
        let found =
            case(&nested[..12].iter().copied().chain(inner).collect::<Vec<_>>(), "keep = 'inside'");
        assert_eq!((found.shells.closed, count(&found, Kind::Nested)), (1, 1), "{found}");
        assert_eq!(found.changes_region, is_solid, "{found}");
    }
    let torn = case(&[&nested[..12], &nested[13..]].concat(), "keep = 'inside'");
    assert_eq!((count(&torn, Kind::Nested), count(&torn, Kind::Openings)), (0, 1), "{torn}");
    // Both solids inside out are the same; one of them alone makes the inner one a cavity.
    let reversed = |i: usize, facet: &Facet, at: &[usize]| {
        let [a, b, c] = *facet;
        if at.contains(&(i / 12)) { [c, b, a] } else { [a, b, c] }
    };
    for (at, is_solid) in [(&[0, 1][..], true), (&[0], false), (&[1], false)] {
        let facets: Vec<_> = nested.iter().enumerate().map(|(i, f)| reversed(i, f, at)).collect();
        assert_eq!(case(&facets, "keep = 'inside'").changes_region, is_solid);
    }
    // Nor does a flipped facet or a slit of the shell around it, in any place of the root, also if all is inside out, as in a mirror.
    let flipped = |i: usize| {
        let facets = nested[..12].iter().enumerate();
        facets.map(|(at, facet)| reversed(0, facet, &[usize::from(at != i)])).collect()
    };
    let slit = cube_with_hole([1.5, 0.5], [1.9, 3.5]);
    for around in (0..12).map(flipped).chain([slit]) {
        for is_solid in [true, false] {
            let inner = |facet| reversed(0, facet, &[usize::from(is_solid)]);
            let facets =
                [&around[..], &nested[12..].iter().map(inner).collect::<Vec<_>>()].concat();
            let far = facets.iter().map(|f| f.map(|v| v.map(|c| 15.0 - c / 8.0))).collect();
            for facets in [facets, far] {
                let found = case(&facets, "keep = 'inside'");
                let nested = found.finding(Kind::Nested).unwrap();
                assert_eq!((nested.count, nested.count_changing), (1, is_solid.into()), "{found}");
            }
        }
    }
    assert!(case(&nested, "seeds = [[2.0, 2.0, 2.0]]").changes_region);
    let beyond = format!("keep_crossing = false\n{beyond}");
    assert!(!case(&nested, &format!("enclosed = 'keep'\n{beyond}")).changes_region);
    // Where the rays of seeds are not counted and no crossing leaf stays, copies and overlaps do not matter to a flow beyond the body.
    let overlapping = [cube(), cube()[..3].to_vec(), cuboid([3.0; 3], [7.0; 3])].concat();
    for (rules, has_effect) in [("", true), (&within, true), (&beyond, false)] {
        let found = case(&overlapping, rules);
        let kinds = [Kind::NonManifoldOdd, Kind::Duplicates, Kind::Intersections];
        assert!(kinds.iter().all(|&kind| count(&found, kind) > 0), "{found}");
        assert_eq!(found.changes_region, has_effect, "{rules}: {found}");
        assert_eq!(found.to_string().contains("all of them lie beyond the body"), !has_effect);
    }
    // The ray of a seed beyond a half model counts an odd number of facets where it leaves through the plane of symmetry.
    let half = |low, high| cuboid(low, high).into_iter().filter(|f| f.iter().any(|v| v[0] > -16.0));
    let [fuselage, wing] = [([0.0, 0.0], -8.0), ([2.0, 1.0], -4.0)]
        .map(|([y, z], x)| half([-16.0, y, z], [x, y + 4.0, z + 4.0]).collect::<Vec<_>>());
    let found =
        case(&[fuselage, wing].concat(), "keep_crossing = false\nseeds = [[12.0, 5.0, 2.0]]");
    assert!(count(&found, Kind::Intersections) > 0 && !found.changes_region, "{found}");
    // Walls matter to a flow within the body, gaps to one around it, whatever side is kept by its name.
    let plate = cuboid([0.0; 3], [4.0, 4.0, 0.125]);
    let thin = [plate, cuboid([0.0, 0.0, 0.25], [4.0; 3])].concat();
    for (rules, walls, gaps) in [(&beyond, 0, 4), (&within, 4, 0)] {
        let found = case(&thin, &format!("keep = 'inside'\n{rules}"));
        let changing = |kind| found.finding(kind).unwrap().count_changing;
        assert_eq!((changing(Kind::ThinWalls), changing(Kind::ThinGaps)), (walls, gaps), "{found}");
    }
}

/// As in assemblies: the copies are within the body, unless one of the solids is there twice, once inside out.
#[test]
fn solids_that_touch_in_equal_facets_change_the_region_by_their_crossing_leaves_alone() {
    let touching = [cube(), cuboid([4.0, 0.0, 0.0], [8.0, 4.0, 4.0])].concat();
    for keeps_crossing in [false, true] {
        let found = case(&touching, &format!("keep_crossing = {keeps_crossing}"));
        let expected = (vec![(Kind::Duplicates, 2)], keeps_crossing);
        assert_eq!((counts(&found), found.changes_region), expected);
        assert_eq!(found.to_string().contains("where solids touch"), !keeps_crossing, "{found}");
    }
    let mut inward = cube();
    inward.iter_mut().for_each(|facet| facet.swap(0, 1));
    let beside = cuboid([4.0, 4.0, 0.0], [8.0, 8.0, 4.0]);
    assert!(diagnosis([cube(), inward, beside].concat(), Some(0.25)).changes_region);
}

#[test]
fn a_flipped_facet_disagrees_with_three_neighbours() {
    let mut facets = cube();
    facets[7].swap(0, 1);
    let found = diagnosis(facets, Some(0.25));
    assert_eq!(counts(&found), [(Kind::Winding, 3)]);
    assert!(!found.changes_region);
}

#[test]
fn a_closed_shell_that_is_wound_inward_is_inside_out_or_a_cavity() {
    let inward = |low, high| {
        let mut facets = cuboid(low, high);
        facets.iter_mut().for_each(|f| f.swap(0, 1));
        facets
    };
    let small = inward([1.0; 3], [2.0; 3]);
    let beside = diagnosis([cube(), inward([5.0; 3], [6.0; 3])].concat(), Some(0.25));
    assert_eq!(counts(&beside), [(Kind::InsideOut, 1)]);
    assert_eq!(first(&beside, Kind::InsideOut).facets, [12]);
    assert!(!beside.changes_region);
    assert_eq!(
        counts(&diagnosis([cube(), small.clone()].concat(), Some(0.25))),
        [(Kind::Nested, 1)]
    );
    // The crossing leaves of a solid in a solid stay in the mesh; one in the cavity of another is in the flow.
    let solid = cuboid([1.25; 3], [1.75; 3]);
    let nested = diagnosis([cube(), solid.clone()].concat(), Some(0.125));
    assert_eq!((counts(&nested), nested.changes_region), (vec![(Kind::Nested, 1)], true));
    let in_cavity = diagnosis([cube(), small.clone(), solid].concat(), Some(0.25));
    assert_eq!(count(&in_cavity, Kind::Nested), 1);
    // An open shell has no volume.
    assert_eq!(counts(&diagnosis(small[1..].to_vec(), None)), [(Kind::Openings, 1)]);
    let far = [inward([-15.0; 3], [-14.0; 3]), cuboid([14.0; 3], [15.0; 3])].concat();
    assert_eq!(counts(&diagnosis(far, Some(0.25))), [(Kind::InsideOut, 1)]);
}

#[test]
fn an_overlap_of_two_solids_is_not_a_thin_wall_but_the_wall_of_a_cavity_is() {
    // The lower face of the upper box is a quarter below the upper face of the lower one.
    let overlap =
        [cuboid([0.0; 3], [4.0, 4.0, 4.0]), cuboid([1.0, 1.0, 3.75], [3.0, 3.0, 8.0])].concat();
    let overlap = diagnosis(overlap, Some(0.5));
    assert!(count(&overlap, Kind::Intersections) > 0);
    assert_eq!(count(&overlap, Kind::ThinWalls), 0);
    let mut cavity = cuboid([0.25; 3], [3.75; 3]);
    cavity.iter_mut().for_each(|f| f.swap(0, 1));
    assert_eq!(count(&diagnosis([cube(), cavity].concat(), Some(0.5)), Kind::ThinWalls), 24);
}

#[test]
fn overlapping_boxes_intersect_along_six_segments() {
    // Each segment of the hexagon lies in one facet of each box.
    let facets = [cuboid([0.0; 3], [4.0; 3]), cuboid([2.0; 3], [6.0; 3])].concat();
    let found = diagnosis(facets.clone(), Some(0.25));
    assert_eq!(count(&found, Kind::Intersections), 6);
    assert_eq!((found.shells.count, found.shells.closed), (2, 2));
    assert!(found.changes_region);
    let apart = [cuboid([0.0; 3], [4.0; 3]), cuboid([5.0; 3], [6.0; 3])].concat();
    assert_eq!(counts(&diagnosis(apart, Some(0.25))), []);
}

#[test]
fn boxes_that_share_part_of_a_face_intersect_in_its_plane() {
    let facets = [cube(), cuboid([4.0, 1.0, 1.0], [6.0, 3.0, 3.0])].concat();
    let found = diagnosis(facets, Some(0.25));
    // The diagonals of both faces are on one line, so each half of one overlaps with one half of the other.
    assert_eq!(count(&found, Kind::Intersections), 2);
}

/// Only facets in one plane overlap, but between x = 2 and 4 there are two volumes, and rays find none.
#[test]
fn a_solid_that_appears_twice_with_other_diagonals_changes_the_region() {
    // Every other diagonal of its faces, wound outward or inward.
    let other = cube()
        .chunks(2)
        .flat_map(|f| {
            let ([a, b, c], d) = (f[0], f[1][2]);
            quad([b, c, d, a])
        })
        .collect::<Vec<_>>();
    let reversed = other.iter().map(|&[a, b, c]| [c, b, a]).collect();
    // In the file, other vertices; on the lattice, the same.
    let copy = cuboid([1e-9; 3], [4.0; 3]);
    for other in [other, reversed, copy] {
        let found = diagnosis([cube(), other].concat(), Some(0.25));
        assert!(found.changes_region, "{found}");
    }
}

#[test]
fn boxes_that_overlap_with_flush_sides_change_the_region() {
    let boxes = [cuboid([0.0; 3], [4.0; 3]), cuboid([2.0, 0.0, 0.0], [6.0, 4.0, 4.0])].concat();
    let found = diagnosis(boxes, Some(0.25));
    assert!(found.finding(Kind::Intersections).unwrap().count_changing >= 4);
}

/// A box whose faces consist of squares with edge 1.
fn squared(low: [f32; 3], high: [f32; 3]) -> Vec<Facet> {
    let faces = cuboid(low, high);
    let split = |face: &[Facet]| {
        let ([a, b, _], [_, _, d]) = (face[0], face[1]);
        let at = |to: [f32; 3]| [0, 1, 2].map(|x| to[x] - a[x]);
        let (u, w) = (at(b), at(d));
        let [m, n] = [u, w].map(|v| v.iter().fold(0, |sum, c| sum + c.abs() as i32));
        let point = |i: i32, j: i32| {
            let part = |v: [f32; 3], x: usize, i: i32, n: i32| v[x] * i as f32 / n as f32;
            [0, 1, 2].map(|x| a[x] + part(u, x, i, m) + part(w, x, j, n))
        };
        let square =
            |i, j| quad([point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)]);
        (0..m)
            .flat_map(|i| (0..n).flat_map(move |j| square(i, j)).collect::<Vec<_>>())
            .collect::<Vec<_>>()
    };
    faces.chunks(2).flat_map(split).collect()
}

/// Where the surfaces cross, facets of both have edges, so that no pair intersects.
#[test]
fn solids_that_overlap_at_edges_of_their_facets_change_the_region() {
    let cube = squared([0.0; 3], [4.0; 3]);
    // Each unit square has two facets: those of the cube's within the other, and the reverse.
    for (low, high, within) in [
        ([2.0, 1.0, 1.0], [6.0, 3.0, 3.0], 2 * (4 + 4 + 4 * 4)),
        // The edges of one are on those of the other, which makes them one shell.
        ([2.0; 3], [6.0; 3], 2 * 6 * 4),
    ] {
        let found = diagnosis([cube.clone(), squared(low, high)].concat(), None);
        assert_eq!(counts(&found), [(Kind::Overlaps, within)]);
        assert!(found.changes_region);
    }
    // A face in common, a cavity, and a cavity that is wound like a solid.
    let beside = squared([4.0, 1.0, 1.0], [6.0, 3.0, 3.0]);
    let mut cavity = squared([1.0; 3], [3.0; 3]);
    let nested = diagnosis([cube.clone(), cavity.clone()].concat(), None);
    cavity.iter_mut().for_each(|f| f.swap(0, 1));
    for other in [beside, cavity] {
        assert_eq!(count(&diagnosis([cube.clone(), other].concat(), None), Kind::Overlaps), 0);
    }
    assert_eq!(count(&nested, Kind::Overlaps), 0);
}

/// Rays take the overlap for outside. It is enclosed, and so deleted, as are its crossing leaves.
#[test]
fn an_overlap_changes_no_external_flow_without_crossing_leaves() {
    let boxes = [cuboid([0.0; 3], [4.0; 3]), cuboid([2.0; 3], [6.0; 3])].concat();
    let changes = |rules: &str| case(&boxes, rules).changes_region;
    assert!(!changes("keep_crossing = false"));
    for rules in
        ["", "keep_crossing = false\nenclosed = 'keep'", "keep_crossing = false\nkeep = 'all'"]
    {
        assert!(changes(rules), "{rules}");
    }
    let beyond: Vec<Facet> = boxes.iter().map(|f| f.map(|v| v.map(|c| c + 9.9))).collect();
    assert!(case(&beyond, "keep_crossing = false").changes_region);
}

#[test]
fn a_vertex_on_an_edge_is_a_t_junction_and_not_an_opening() {
    let mut facets = cube();
    let [a, b, c] = facets[0];
    let middle = std::array::from_fn(|x| (b[x] + c[x]) / 2.0);
    facets[0] = [a, b, middle];
    facets.push([a, middle, c]);
    let found = diagnosis(facets, Some(0.25));
    assert_eq!((counts(&found), found.edges.open), (vec![], 3));
}

/// A lattice unit is 2^-26 of this root, and vertices of large coordinates are far from one another.
#[test]
fn a_vertex_farther_from_an_edge_than_two_lattice_units_leaves_an_opening() {
    for (scale, edge) in [(1.0, 8.0), (1024.0, 8192.0)] {
        let unit = edge / (1u64 << 27) as f32;
        for (units, openings) in [(1.0, 0), (4.0, 1)] {
            let mut facets: Vec<Facet> =
                cube().into_iter().map(|facet| facet.map(|v| v.map(|c| scale * c))).collect();
            // The facets of the face z = 0 have the vertices (0, 0), (0, 4), (4, 4) and (4, 0); that at (0, 2) is off the edge.
            let [a, b, c] = facets[0];
            let middle = [units * unit, 2.0 * scale, 0.0];
            facets[0] = [a, middle, c];
            facets.push([middle, b, c]);
            let root = Some(Root {
                origin: [-1.0; 3].map(|c| c * f64::from(scale)),
                edge: f64::from(edge),
            });
            let requested = Requested { spacing_min: None, root, ..Requested::default() };
            let input = Input::of(Default::default(), facets, requested).unwrap();
            let found = count(&diagnose(&input, 5), Kind::Openings);
            assert_eq!(found, openings, "{units} units, {scale}");
        }
    }
}

#[test]
fn edges_with_more_than_two_facets_are_even_or_odd() {
    let adjacent = [cube(), cuboid([4.0, 4.0, 0.0], [8.0, 8.0, 4.0])].concat();
    let adjacent = diagnosis(adjacent, Some(0.25));
    assert_eq!((adjacent.edges.even, counts(&adjacent)), (1, vec![]));
    let mut with_fin = cube();
    let [a, b, _] = with_fin[0];
    with_fin.push([a, b, [-4.0; 3]]);
    let found = diagnosis(with_fin, Some(0.25));
    assert_eq!(count(&found, Kind::NonManifoldOdd), 1);
    assert_eq!(found.shells.closed, 0);
}

#[test]
fn facets_without_area_have_no_effect_unless_they_are_apart() {
    let mut facets = cube();
    facets.push([facets[0][0], facets[0][1], facets[0][0]]);
    facets.push([[facets[0][2]; 3], facets[0]].concat()[..3].try_into().unwrap());
    assert_eq!(counts(&diagnosis(facets.clone(), Some(0.25))), vec![]);
    // A copy of one is no duplicate.
    facets.extend([[[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [1.0, 1.0, 1.0]]; 2]);
    facets.push([[9.0, 9.0, 9.0]; 3]);
    let found = diagnosis(facets, Some(0.25));
    let stray = vec![(Kind::Stray, 3)];
    assert_eq!((counts(&found), found.facets - found.shells.facets), (stray, 5));
    assert!(found.changes_region && found.finding(Kind::Stray).unwrap().count_changing == 3);
    // The other diagonal of a face lies on it, that of the cube does not.
    for (from, to, stray) in [([4.0, 0.0, 4.0], [0.0, 4.0, 4.0], 0), ([4.0; 3], [0.0; 3], 1)] {
        let found = diagnosis([cube(), vec![[from, to, to]]].concat(), Some(0.25));
        assert_eq!((count(&found, Kind::Stray), found.changes_region), (stray, stray > 0));
    }
    // A sliver on an edge of the cube lies on its facets, too, and no ray meets it, nor its copy, nor one at its own edge; but a fin at its
    // middle has an odd number of facets.
    let (from, middle, to) = ([0.0, 0.0, 4.0], [2.0, 0.0, 4.0], [4.0, 0.0, 4.0]);
    let sliver = [from, middle, to];
    let mut facets = [cube(), vec![sliver]].concat();
    for more in [&[][..], &[sliver], &[[from, [1.0, 0.0, 4.0], middle]]] {
        assert_eq!(counts(&diagnosis([&facets[..], more].concat(), Some(0.25))), []);
    }
    facets.push([middle, to, [9.0; 3]]);
    assert_eq!(diagnosis(facets, None).finding(Kind::NonManifoldOdd).unwrap().count_changing, 1);
    let point = diagnosis(vec![[[9.0, 9.0, 9.0]; 3]], Some(0.25));
    assert_eq!((counts(&point), point.shells.facets), (vec![(Kind::Stray, 1)], 0));
}

#[test]
fn walls_and_gaps_narrower_than_a_cell_are_thin() {
    let plates = |gap: f32| {
        let upper = 1.0 + gap;
        [cuboid([0.0; 3], [4.0, 4.0, 1.0]), cuboid([0.0, 0.0, upper], [4.0, 4.0, 9.0])].concat()
    };
    // On a side that is meshed, also between one cell and as many as hold one in any position and direction.
    for gap in [0.375, 1.0] {
        let found = diagnosis(plates(gap), Some(0.5));
        assert_eq!(counts(&found), [(Kind::ThinGaps, 4)]);
        assert!(close(first(&found, Kind::ThinGaps).width, gap.into()));
        assert!(found.changes_region);
    }
    assert_eq!(counts(&diagnosis(plates(1.25), Some(0.5))), []);
    // The lower plate is thinner than two units: with an outer flow its inside does not matter.
    let found = diagnosis(cuboid([0.0; 3], [4.0, 4.0, 1.0]), Some(2.0));
    assert_eq!((count(&found, Kind::ThinWalls), found.changes_region), (4, false));
    assert!(close(first(&found, Kind::ThinWalls).width, 1.0));
}

/// A facet's orientation has no effect on the mesh, so none on its gaps.
#[test]
fn gaps_and_walls_of_shells_that_are_inside_out_are_found() {
    let inward = |mut facets: Vec<Facet>| {
        facets.iter_mut().for_each(|f| f.swap(0, 1));
        facets
    };
    let (lower, upper) = (cuboid([0.0; 3], [4.0, 4.0, 1.0]), cuboid([0.0, 0.0, 1.375], [4.0; 3]));
    for (below, above, inside_out) in [
        (lower.clone(), inward(upper.clone()), 1),
        (inward(lower.clone()), upper.clone(), 1),
        (inward(lower.clone()), inward(upper), 2),
    ] {
        let found = diagnosis([below, above].concat(), Some(0.5));
        assert_eq!(counts(&found), [(Kind::InsideOut, inside_out), (Kind::ThinGaps, 4)]);
        assert!(found.changes_region);
    }
    let wall = diagnosis(inward(lower), Some(2.0));
    assert_eq!(counts(&wall), [(Kind::InsideOut, 1), (Kind::ThinWalls, 4)]);
    // A cavity bounds the same wall by either winding.
    for cavity in [cuboid([0.25; 3], [3.75; 3]), inward(cuboid([0.25; 3], [3.75; 3]))] {
        let hollow = diagnosis([cube(), cavity].concat(), Some(0.5));
        assert_eq!(counts(&hollow), [(Kind::Nested, 1), (Kind::ThinWalls, 24)]);
    }
    // A shell in the bounding box of an angle, but beside the angle, is no cavity.
    let angle = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 4.0], [0.0, 4.0]];
    let at = |i: usize, z| [angle[i % 6][0], angle[i % 6][1], z];
    let sides = (0..6).flat_map(|i| quad([at(i, 0.0), at(i + 1, 0.0), at(i + 1, 4.0), at(i, 4.0)]));
    let ends = [[3, 2, 1], [3, 1, 0], [3, 0, 5], [3, 5, 4]];
    let lids = ends.map(|lid| [lid.map(|i| at(i, 0.0)), [2, 1, 0].map(|i| at(lid[i], 4.0))]);
    let angle: Vec<Facet> = sides.chain(lids.concat()).collect();
    assert_eq!(counts(&diagnosis(angle.clone(), Some(0.25))), []);
    let beside = [angle, inward(cuboid([2.0; 3], [3.0; 3]))].concat();
    assert_eq!(counts(&diagnosis(beside, Some(0.25))), [(Kind::InsideOut, 1)]);
}

/// In the time of one search each: slivers on one edge, which fan from its end, are 10^8 pairs.
#[test]
fn many_slivers_on_one_edge_are_not_compared_with_each_other() {
    let at = |i: u16| [f32::from(i) / 4096.0, 0.0, 0.0];
    let fan = (1..16_384).map(|i| [[0.0; 3], at(i), at(i + 1)]);
    let found = diagnosis(cube().into_iter().chain(fan).collect(), Some(0.25));
    assert_eq!((counts(&found), found.shells.closed), (vec![], 1));
}

/// In the time of one pair of facets each: 10^9 pairs take minutes.
#[test]
fn many_copies_of_two_facets_take_no_longer_than_others() {
    let lower = [[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let upper = lower.map(|[x, y, _]| [y, x, 0.25]);
    let across = [[1.0, 1.0, -1.0], [1.0, 1.0, 0.125], [2.0, 1.0, -1.0]];
    let facets = [vec![lower; 20_000], vec![upper; 20_000], vec![across]].concat();
    let found = diagnosis(facets, Some(0.5));
    assert_eq!(count(&found, Kind::Duplicates), 2 * 19_999);
    assert_eq!((count(&found, Kind::Intersections), count(&found, Kind::ThinGaps)), (1, 2));
    assert!(found.findings.iter().all(|finding| !finding.is_lower_bound));
    let solids = diagnosis(cube().repeat(5_000), Some(0.5));
    assert_eq!((count(&solids, Kind::Overlaps), solids.changes_region), (12, true));
}

#[test]
fn facets_on_and_beyond_the_root_are_found() {
    let on = diagnosis(cuboid([-16.0, 0.0, 0.0], [0.0, 1.0, 1.0]), Some(0.25));
    assert!(count(&on, Kind::TouchingRoot) > 2 && !on.changes_region);
    let beyond = diagnosis(cuboid([-17.0, 0.0, 0.0], [0.0, 1.0, 1.0]), Some(0.25));
    assert!(count(&beyond, Kind::OutsideRoot) > 2 && beyond.changes_region);
    assert_eq!(beyond.extent.margin, -1.0);
}

#[test]
fn json_has_the_schema_and_text_the_findings() {
    let found = diagnosis(cube_with_hole([1.0, 1.0], [3.0, 3.0]), Some(0.5));
    let json: serde_json::Value = serde_json::to_value(&found).unwrap();
    assert_eq!(json["schema"], "octree-geometry/7");
    assert_eq!(json["findings"][0]["kind"], "openings");
    assert_eq!(json["findings"][0]["places"][0]["width"], 2.0);
    let text = found.to_string();
    assert!(text.contains("openings: 1; 1 can change the mesh's region"), "{text}");
    assert!(text.contains("2.00 wide (4.00 cells)"), "{text}");
}

/// Every kind of finding at a place of its own.
#[test]
fn the_diagnosis_of_a_body_with_every_defect_is_the_expected_text() {
    let at = |[x, y, z]: [f32; 3], facets: Vec<Facet>| -> Vec<Facet> {
        facets
            .iter()
            .map(|facet| facet.map(|v| [v[0] / 2.0 + x, v[1] / 2.0 + y, v[2] / 2.0 + z]))
            .collect()
    };
    let mut without_two = cube();
    without_two.drain(2..4);
    let mut junction = cube();
    let [a, b, c] = junction[0];
    let middle = std::array::from_fn(|x| (b[x] + c[x]) / 2.0);
    junction[0] = [a, b, middle];
    junction.push([a, middle, c]);
    let mut with_fin = cube();
    let [a, b, _] = with_fin[0];
    with_fin.push([a, b, [-1.0; 3]]);
    with_fin.push([b, a, [1.0, -1.0, -2.0]]);
    let mut odd = cube();
    odd.push([a, b, [-1.0; 3]]);
    let mut flipped = cube();
    flipped[7].swap(0, 1);
    let mut copied = cube();
    copied.extend([flipped[0], flipped[0]]);
    let plates =
        [cuboid([0.0; 3], [4.0, 4.0, 0.375]), cuboid([0.0, 0.0, 0.75], [4.0, 4.0, 4.0])].concat();
    let facets = [
        at([-12.0; 3], cube_with_hole([1.0, 1.0], [2.0, 3.0])),
        at([-8.0, -12.0, -12.0], without_two),
        at([-4.0, -12.0, -12.0], junction),
        at([0.0, -12.0, -12.0], with_fin),
        at([4.0, -12.0, -12.0], odd),
        at([8.0, -12.0, -12.0], flipped),
        at([-12.0, -8.0, -12.0], copied),
        at([-8.0, -8.0, -12.0], [cuboid([0.0; 3], [4.0; 3]), cuboid([2.0; 3], [6.0; 3])].concat()),
        at([-4.0, -8.0, -12.0], [cube(), cuboid([4.0, 1.0, 1.0], [6.0, 3.0, 3.0])].concat()),
        at([4.0, -8.0, -12.0], plates),
        at([-12.0, -4.0, -12.0], vec![[[0.0; 3], [8.0, 0.0, 0.0], [4.0, 0.0078125, 0.0]]]),
        at([-12.0, 0.0, -12.0], vec![[[1.0; 3], [2.0; 3], [1.0; 3]], [[9.0; 3]; 3]]),
        at([-16.0, 4.0, 0.0], cube()),
        at([15.0, 8.0, 0.0], cube()),
    ]
    .concat();
    let mut texts = String::new();
    for (spacing, first, name) in [(Some(0.25), 5, "cells"), (None, 1, "no cells")] {
        let requested =
            Requested { spacing_min: spacing, root: Some(ROOT), ..Requested::default() };
        let input = Input::of(Default::default(), facets.clone(), requested).unwrap();
        texts += &format!("== {name}\n{}", diagnose(&input, first));
    }
    assert_text(&texts, "tests/geometry/expected.txt");
}
