//! Closed shapes and defects at random.

use super::*;
use geometries::{Generator, Shape};
use proptest::prelude::*;

/// Closed shapes at random sizes and places.
fn shape() -> impl Strategy<Value = Vec<Facet>> {
    let shapes = [Shape::Cube, Shape::Sphere, Shape::Torus, Shape::NestedSpheres, Shape::Pipe];
    (prop::sample::select(shapes.to_vec()), 100usize..600, prop::array::uniform3(-4.0f64..4.0))
        .prop_map(|(shape, facets, centre)| {
            let generator = Generator { centre: Some(centre), ..Generator::new(shape, 2 * facets) };
            generator.facets().unwrap()
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn closed_shapes_have_no_findings_but_a_cavity(facets in shape()) {
        let found = diagnosis(facets, Some(0.002));
        // The inner one of two spheres is a cavity.
        let cavity = (found.shells.count == 2).then_some((Kind::Nested, 1));
        prop_assert_eq!(counts(&found), Vec::from_iter(cavity));
    }

    /// Defects at random: some facets removed, repeated, flipped, and a second shape put over the first.
    #[test]
    fn the_order_of_facets_and_vertices_has_no_effect(
        a in shape(),
        b in shape(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), 0..3), 0..12),
        seed in any::<u64>(),
        spacing in 0.01f64..0.5,
    ) {
        let mut facets = [a, b].concat();
        for (index, edit) in edits {
            let i = index.index(facets.len());
            match edit {
                0 => drop(facets.remove(i)),
                1 => facets.push(facets[i]),
                _ => facets[i].swap(0, 1),
            }
        }
        let expected = diagnosis(facets.clone(), Some(spacing));
        let mut state = seed;
        let mut random = |n: usize| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % n
        };
        for i in (1..facets.len()).rev() {
            facets.swap(i, random(i + 1));
            facets[i].rotate_left(random(3));
        }
        let got = diagnosis(facets, Some(spacing));
        prop_assert_eq!(counts(&got), counts(&expected));
        prop_assert_eq!(got.changes_region, expected.changes_region);
        prop_assert_eq!((got.shells.count, got.shells.closed), (expected.shells.count, expected.shells.closed));
    }

    /// Both sides of a wall of known thickness, in any direction, beside a wall that is thicker than a cell.
    #[test]
    fn the_widths_of_a_plate_are_its_thickness(
        thickness in 0.05f32..0.45, axis in prop::array::uniform3(-1.0f64..1.0), angle in 0.0f64..3.0,
    ) {
        let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
        prop_assume!(length > 0.1);
        let [x, y, z] = axis.map(|c| c / length);
        let (sin, cos) = angle.sin_cos();
        // Rodrigues' formula.
        let rotated = |v: [f32; 3]| {
            let v = v.map(f64::from);
            let along = x * v[0] + y * v[1] + z * v[2];
            let cross = [y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]];
            std::array::from_fn(|a| (v[a] * cos + cross[a] * sin + [x, y, z][a] * along * (1.0 - cos)) as f32)
        };
        let bodies = [cuboid([0.0; 3], [4.0, 4.0, thickness]), cuboid([0.0, 0.0, 2.0], [4.0, 4.0, 4.0])].concat();
        let found = diagnosis(bodies.iter().map(|f| f.map(rotated)).collect(), Some(0.5));
        let walls = found.finding(Kind::ThinWalls).unwrap();
        // The four facets at the rim of the plate see each other too where it is thinner than a cell wide.
        prop_assert!(walls.count >= 4 && count(&found, Kind::ThinGaps) == 0);
        for place in &walls.places {
            prop_assert!((place.width.unwrap() - f64::from(thickness)).abs() < 1e-5, "{:?}", place);
        }
    }
}
