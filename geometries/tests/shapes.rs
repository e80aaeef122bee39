//! Properties of every generated shape, tested on facets as an STL reader sees them: two vertices
//! are the same only if their bits are equal.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use geometries::{Facet, Generator, Shape};

const SHAPES: [Shape; 14] = [
    Shape::Cube,
    Shape::Sphere,
    Shape::Torus,
    Shape::NestedSpheres,
    Shape::Plate,
    Shape::Pipe,
    Shape::Uav,
    Shape::Fighter,
    Shape::FighterGear,
    Shape::BoxesOverlapping,
    Shape::BoxInBox,
    Shape::ThreeSpheres,
    Shape::PipesCrossing,
    Shape::Car,
];

fn facets(shape: Shape, count: usize) -> Vec<Facet> {
    Generator::new(shape, count).facets().unwrap()
}

/// The generator of a `[generator]` table.
fn table(text: &str) -> Generator {
    toml::from_str(text).unwrap()
}

/// The number of distinct vertices, and the facets by vertex index.
fn weld(facets: &[Facet]) -> (usize, Vec<[usize; 3]>) {
    let mut numbers = HashMap::new();
    let triangles = facets
        .iter()
        .map(|facet| {
            facet.map(|vertex| {
                let next = numbers.len();
                // Adding zero maps -0 to +0, which is equal but has other bits.
                *numbers.entry(vertex.map(|x| (x + 0.0).to_bits())).or_insert(next)
            })
        })
        .collect();
    (numbers.len(), triangles)
}

/// The number of occurrences of each directed edge.
fn directed_edges(triangles: &[[usize; 3]]) -> HashMap<(usize, usize), usize> {
    let mut edges = HashMap::new();
    for t in triangles {
        for i in 0..3 {
            *edges.entry((t[i], t[(i + 1) % 3])).or_insert(0) += 1;
        }
    }
    edges
}

fn area_vector([p, q, r]: &Facet) -> [f64; 3] {
    let edge = |v: &[f32; 3], a: usize| f64::from(v[a]) - f64::from(p[a]);
    [(1, 2), (2, 0), (0, 1)].map(|(b, c)| edge(q, b) * edge(r, c) - edge(q, c) * edge(r, b))
}

fn volume(facets: &[Facet]) -> f64 {
    let six_fold = |facet: &Facet| {
        let n = area_vector(facet);
        (0..3).map(|a| n[a] * f64::from(facet[0][a])).sum::<f64>()
    };
    facets.iter().map(six_fold).sum::<f64>() / 6.0
}

/// The FNV-1a hash of the bits of all vertices in order.
fn fingerprint(facets: &[Facet]) -> u64 {
    facets
        .iter()
        .flatten()
        .flatten()
        .flat_map(|x| x.to_bits().to_le_bytes())
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
}

/// Asserts that the surface is closed and wound outward. Returns its Euler characteristic.
fn assert_closed(facets: &[Facet], name: &str) -> i64 {
    let (vertices, triangles) = weld(facets);
    for (i, facet) in facets.iter().enumerate() {
        assert!(area_vector(facet) != [0.0; 3], "{name}: facet {i} has no area: {facet:?}");
    }
    let edges = directed_edges(&triangles);
    for (&(a, b), &times) in &edges {
        assert_eq!(times, 1, "{name}: two facets traverse an edge in the same direction");
        assert!(edges.contains_key(&(b, a)), "{name}: an edge has only one facet");
    }
    assert!(volume(facets) > 0.0, "{name}: wound inward");
    vertices as i64 - edges.len() as i64 / 2 + triangles.len() as i64
}

#[test]
fn every_shape_is_closed_wound_outward_and_of_the_right_genus() {
    for shape in SHAPES {
        for count in [2_000, 2_500, 3_333, 5_000, 12_345, 20_000, 60_000] {
            let name = format!("{shape:?} {count}");
            let facets = facets(shape, count);
            assert_eq!(facets.len(), count & !1, "{name}");
            let euler = assert_closed(&facets, &name);
            let expected = match shape {
                Shape::Torus => 0,
                Shape::NestedSpheres | Shape::BoxesOverlapping | Shape::BoxInBox => 4,
                Shape::PipesCrossing => 4,
                Shape::ThreeSpheres => 6,
                Shape::Car => 16,
                _ => 2,
            };
            assert_eq!(euler, expected, "{name}: Euler characteristic");
        }
    }
}

#[test]
fn every_shape_can_be_drawn_with_its_minimum_number_of_facets() {
    let least = [12, 20, 18, 40, 12, 60, 2_000, 2_000, 2_000, 24, 24, 60, 120, 144];
    for (shape, least) in SHAPES.into_iter().zip(least) {
        let drawn = facets(shape, least);
        assert_eq!(drawn.len(), least);
        assert_closed(&drawn, &format!("{shape:?}"));
        let error = Generator::new(shape, least - 1).facets().unwrap_err().to_string();
        assert!(error.contains(&format!("at least {least}")), "{error}");
        for more in [least + 1, least + 2, 2 * least, 3 * least + 8] {
            let drawn = facets(shape, more);
            assert_eq!(drawn.len(), more & !1, "{shape:?}");
            assert_closed(&drawn, &format!("{shape:?} {more}"));
        }
    }
}

#[test]
fn volumes_agree_with_the_analytic_ones() {
    let cases = [
        ("shape = 'cube'\nfacets = 1000\nedge = 2", 8.0, 1e-12),
        ("shape = 'plate'\nfacets = 1000\nlength = 2\nwidth = 1\nthickness = 0.25", 0.5, 1e-12),
        ("shape = 'sphere'\nfacets = 20000\nradius = 2", 4.0 / 3.0 * PI * 8.0, 1e-3),
        (
            "shape = 'torus'\nfacets = 20000\nradius = 2\nradius_tube = 0.5",
            TAU * 2.0 * PI * 0.25,
            3e-3,
        ),
        (
            "shape = 'nested_spheres'\nfacets = 20000\nradius = 2\nradius_inner = 1",
            4.0 / 3.0 * PI * 7.0,
            1e-3,
        ),
        (
            "shape = 'pipe'\nfacets = 20000\nradius = 0.5\nradius_bend = 2\nangle = 120\nlength = 3",
            PI * 0.25 * (6.0 + 2.0 * TAU / 3.0),
            3e-3,
        ),
        ("shape = 'boxes_overlapping'\nfacets = 1000\nedge = 2", 16.0, 1e-6),
        ("shape = 'box_in_box'\nfacets = 1000\nedge = 4\nthickness = 0.5", 64.0 - 27.0, 1e-6),
        (
            "shape = 'three_spheres'\nfacets = 20000\nradius = 3",
            4.0 / 3.0 * PI * (27.0 - 8.0 + 1.0),
            3e-3,
        ),
        (
            "shape = 'pipes_crossing'\nfacets = 40000\nradius = 0.5\nradius_bend = 2\nlength = 3",
            2.0 * PI * 0.25 * (6.0 + 2.0 * TAU / 4.0),
            3e-3,
        ),
    ];
    for (text, expected, tolerance) in cases {
        let found = volume(&table(text).facets().unwrap());
        assert!((found / expected - 1.0).abs() < tolerance, "{text}: {found}, not {expected}");
    }
}

/// The least and greatest coordinate along each axis.
fn bounds(facets: &[Facet]) -> [[f32; 2]; 3] {
    std::array::from_fn(|a| {
        let along = facets.iter().flatten().map(|v| v[a]);
        along.fold([f32::MAX, f32::MIN], |[low, high], x| [low.min(x), high.max(x)])
    })
}

#[test]
fn the_faces_of_a_cube_lie_exactly_in_their_planes() {
    let drawn = table("shape = 'cube'\nfacets = 1234\nedge = 0.5\ncentre = [1.0, -2.0, 0.25]");
    let drawn = drawn.facets().unwrap();
    let planes = [[0.75, 1.25], [-2.25, -1.75], [0.0, 0.5]];
    assert_eq!(bounds(&drawn), planes);
    for facet in &drawn {
        let lies_in_a_plane = |a: usize| planes[a].iter().any(|&x| facet.iter().all(|v| v[a] == x));
        assert!((0..3).any(lies_in_a_plane), "{facet:?}");
    }
}

#[test]
fn aircraft_have_the_requested_length_and_converge_with_the_number_of_facets() {
    for (shape, axis) in [(Shape::Uav, 1), (Shape::Fighter, 0), (Shape::FighterGear, 0)] {
        let mut generator = Generator::new(shape, 40_000);
        generator.length = Some(3.0);
        let [low, high] = bounds(&generator.facets().unwrap())[axis];
        assert!((high - low - 3.0).abs() < 1e-6);
        let [coarse, fine, finer] = [10_000, 100_000, 400_000].map(|n| volume(&facets(shape, n)));
        assert!(
            coarse > fine && fine > finer,
            "coarse grids thicken parts: {coarse} {fine} {finer}"
        );
        assert!(fine / finer < 1.25, "{fine} {finer}");
    }
}

/// If a fingerprint changes, so does every case that uses the shape.
#[test]
fn vertices_are_the_same_on_every_machine() {
    let found =
        SHAPES.map(|shape| format!("{shape:?} {:016x}", fingerprint(&facets(shape, 5_000))));
    let expected = [
        "Cube 4227310de9dabf4d",
        "Sphere 914f3fca52f626bd",
        "Torus d8e786b07c704db6",
        "NestedSpheres 7fed22e94e96d6cb",
        "Plate ab2156a40181d6f1",
        "Pipe e619cd95ecd928a7",
        "Uav d69a389f190928e2",
        "Fighter c8c5ca71f8b4b867",
        "FighterGear c5893e4bf4a5d84a",
        "BoxesOverlapping 96ec59bcba714c59",
        "BoxInBox 6136c9e36c34ac3c",
        "ThreeSpheres 6d3acb370afa2fc9",
        "PipesCrossing 142de534e071ab38",
        "Car 003c8fd0ad8a0ecc",
    ];
    assert_eq!(found, expected);
}

#[test]
fn a_pipe_that_is_wider_than_long_has_the_number_of_facets_too() {
    for facets in [60, 200, 3000] {
        let size = "radius = 1\nradius_bend = 1.1\nangle = 1\nlength = 0.001";
        let pipe = table(&format!("shape = 'pipe'\nfacets = {facets}\n{size}"));
        assert_eq!(pipe.facets().unwrap().len(), facets);
    }
}

#[test]
fn invalid_tables_are_refused_with_the_reason() {
    let refusal = |text: &str| match toml::from_str::<Generator>(text) {
        Ok(generator) => generator.facets().unwrap_err().to_string(),
        Err(error) => error.to_string(),
    };
    for (text, reason) in [
        ("shape = 'sphere'\nfacets = 100\nradios = 1", "unknown field `radios`"),
        (
            "shape = 'sphere'\nfacets = 100\nthickness = 1",
            "no dimension `thickness`; it has radius",
        ),
        ("shape = 'ball'\nfacets = 100", "unknown variant `ball`"),
        ("shape = 'sphere'", "missing field `facets`"),
        ("shape = 'sphere'\nfacets = -1", "invalid value"),
        ("shape = 'sphere'\nfacets = 100\nradius = -1", "must be from 1.2e-38"),
        ("shape = 'sphere'\nfacets = 100\nradius = nan", "must be from 1.2e-38"),
        ("shape = 'sphere'\nfacets = 100\nradius = inf", "must be from 1.2e-38"),
        ("shape = 'sphere'\nfacets = 100\ncentre = [0, inf, 0]", "must be finite"),
        ("shape = 'torus'\nfacets = 100\nradius_tube = 1", "less than radius"),
        ("shape = 'nested_spheres'\nfacets = 100\nradius_inner = 0.5", "less than radius"),
        ("shape = 'nested_spheres'\nfacets = 300\nradius_inner = 0.495", "request more facets"),
        ("shape = 'pipes_crossing'\nfacets = 1200\nlength = 0.2", "must exceed the width"),
        ("shape = 'cube'\nfacets = 200\nedge = 5e-324", "must be from 1.2e-38"),
        ("shape = 'pipe'\nfacets = 100\nradius_bend = 0.1", "must exceed radius"),
        ("shape = 'pipe'\nfacets = 100\nangle = 200", "at most 180"),
        ("shape = 'pipes_crossing'\nfacets = 200\nangle = 60", "no dimension `angle`"),
        ("shape = 'box_in_box'\nfacets = 100\nthickness = 0.5", "less than half of edge"),
        ("shape = 'sphere'\nfacets = 99999999999999", "at most 100000000"),
        ("shape = 'uav'\nfacets = 100000001", "at most 100000000"),
        ("shape = 'sphere'\nfacets = 100\ncentre = [1e9, 0, 0]", "has no area in f32"),
        ("shape = 'sphere'\nfacets = 100\nradius = 1e300", "must be from 1.2e-38"),
    ] {
        let message = refusal(text);
        assert!(message.contains(reason), "{text}\n{message}");
    }
}

#[test]
fn lists_that_are_too_long_are_refused() {
    let refused = |centre: &str| {
        let text = format!("shape = 'cube'\nfacets = 12\ncentre = {centre}\nedge = inf\n");
        geometries::refuse_surplus::<Generator>(&text).is_err()
    };
    assert!(refused("[0, 1, 2, 3]") && !refused("[0, 1, 2]") && !refused("'x'"));
    assert!(geometries::refuse_surplus::<Vec<f64>>("not toml").is_ok());
}
