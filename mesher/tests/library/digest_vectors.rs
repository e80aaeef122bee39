//! The test vectors shared by all programs: digests, leaf words, levels, roots, lattice points, boxes.

use bricks::digest::{Digests, digest, hex, mix, of_facets};
use bricks::facet::Facet;
use bricks::octant::{LEVEL_MAX, Side, corner, morton, position, start57, word};
use mesher::input::case::{BoxSpec, Case, RootSpec};
use mesher::input::ingest::Source;
use mesher::input::lattice::{Bounds, Enclosed, Keep, Root};
use serde_json::Value;

fn vectors(name: &str) -> Vec<Value> {
    let all: Value = serde_json::from_str(include_str!("../../../reference/vectors/digest.json"))
        .expect("the vectors are JSON");
    assert_eq!(all["schema"], "octree-test-vectors/1");
    let found = all[name].as_array().expect("a list").clone();
    assert!(!found.is_empty());
    found
}

fn hexadecimal(text: &Value) -> u64 {
    u64::from_str_radix(text.as_str().expect("text"), 16).expect("hexadecimal digits")
}

/// Numbers are strings, so that no JSON reader rounds them.
fn number(text: &Value) -> f64 {
    text.as_str().expect("text").parse().expect("a number")
}

fn point(texts: &Value) -> [f64; 3] {
    std::array::from_fn(|a| number(&texts[a]))
}

fn integers(numbers: &Value) -> [i64; 3] {
    std::array::from_fn(|a| numbers[a].as_i64().expect("a whole number"))
}

fn root(v: &Value) -> Root {
    Root { origin: point(&v["origin"]), edge: number(&v["edge"]) }
}

/// A vertex in STL's precision. The vectors hold values that f32 represents exactly.
fn narrow(p: [f64; 3]) -> [f32; 3] {
    let q = p.map(|c| c as f32);
    assert_eq!(q.map(f64::from), p, "f32 must represent a vertex exactly");
    q
}

#[test]
fn mixes_and_digests_equal_the_vectors() {
    for v in vectors("mix") {
        assert_eq!(hex(mix(hexadecimal(&v["word"]))), v["mix"]);
    }
    for v in vectors("digests") {
        let given = v["words"].as_array().expect("a list");
        let mut words: Vec<u64> = given.iter().map(hexadecimal).collect();
        assert_eq!(hex(digest(&words)), v["digest"]);
        words.reverse();
        assert_eq!(hex(digest(&words)), v["digest"], "the order must not matter");
        words.sort_unstable();
        let mut whole = Digests::default();
        whole.add(&words);
        assert_eq!(hex(whole.whole()), v["digest"], "the octants' digests must add up");
    }
}

#[test]
fn digests_of_geometries_equal_the_vectors() {
    for v in vectors("geometries") {
        let facet = |nine: &Value| Facet {
            v: std::array::from_fn(|i| {
                std::array::from_fn(|a| nine[3 * i + a].as_i64().expect("an integer") as i32)
            }),
        };
        let mut facets: Vec<Facet> =
            v["facets"].as_array().expect("a list").iter().map(facet).collect();
        assert_eq!(hex(of_facets(&facets)), v["digest"]);
        facets.reverse();
        assert_eq!(hex(of_facets(&facets)), v["digest"], "the order must not matter");
    }
}

#[test]
fn leaf_words_equal_the_vectors() {
    for v in vectors("words") {
        let level = v["level"].as_u64().expect("a level") as u32;
        let side = match v["side"].as_str() {
            Some("outside") => Side::Outside,
            Some("inside") => Side::Inside,
            Some("crossing") => Side::Crossing,
            other => panic!("side {other:?}"),
        };
        let cell = integers(&v["cell"]);
        let code = morton(cell.map(|c| c as u32)) >> (3 * (LEVEL_MAX - level));
        let w = word(level, code, side);
        assert_eq!(w, hexadecimal(&v["word"]));
        assert_eq!(position(start57(level, code)).map(i64::from), cell);
        assert_eq!(corner(level, code), cell.map(|c| c * 256));
        let mut digests = Digests::default();
        digests.add(&[w]);
        assert_eq!(digests.octants[v["octant"].as_u64().expect("an octant") as usize], mix(w));
    }
}

#[test]
fn levels_of_spacings_equal_the_vectors() {
    for v in vectors("levels") {
        let root = Root { origin: [0.0; 3], edge: number(&v["edge"]) };
        let found = root.level_of(number(&v["spacing"]), "spacing_min").ok().map(u64::from);
        assert_eq!(found, v["level"].as_u64(), "{v}");
    }
}

#[test]
fn roots_around_bodies_equal_the_vectors() {
    for v in vectors("roots") {
        let facet = std::array::from_fn(|i| narrow(point(&v["vertices"][i])));
        let found = Root::around(&Bounds::of(&[facet]), number(&v["root_scale"])).ok();
        assert_eq!(found, Some(root(&v)));
    }
}

#[test]
fn lattice_points_equal_the_vectors() {
    for v in vectors("quantised") {
        let (root, vertex) = (root(&v), point(&v["vertex"]));
        let at = root.nearest(vertex);
        let near = vertex.map(|c| c as f32);
        if v["lattice"].is_null() {
            // The nearest vertex in f32, with the root translated by the difference.
            let by = |a: usize| f64::from(near[a]) - vertex[a];
            let moved = Root { origin: std::array::from_fn(|a| root.origin[a] + by(a)), ..root };
            let message = moved
                .facets(vec![[near; 3]], &Bounds::of(&[[near; 3]]), 0)
                .expect_err("too far outside")
                .to_string();
            assert!(
                message.contains("facet 0") && message.contains("outside the root"),
                "{message}"
            );
            continue;
        }
        assert_eq!(at, integers(&v["lattice"]), "{v}");
        // Only extent boxes can have coordinates that f32 does not represent.
        if near.map(f64::from) == vertex {
            let found =
                root.facets(vec![[near; 3]], &Bounds::of(&[[near; 3]]), 0).expect("near the root");
            assert_eq!(found[0].v.map(|p| p.map(i64::from)), [at; 3], "{v}");
        }
    }
}

#[test]
fn boxes_on_the_lattice_equal_the_vectors() {
    for v in vectors("boxes") {
        let root = root(&v);
        let spec = BoxSpec { min: point(&v["min"]), max: point(&v["max"]), spacing: root.edge };
        let case = Case {
            source: Source::Given(vec![]),
            spacing_min: root.edge,
            layer_cells_min: 1,
            keep: Keep::All,
            keep_crossing: true,
            root: RootSpec::Exact(root),
            boxes: vec![spec],
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
        };
        let rules = case.rules(&Bounds::of(&[])).expect("the box is good");
        assert_eq!(rules.boxes[0].min, integers(&v["lattice_min"]));
        assert_eq!(rules.boxes[0].max, integers(&v["lattice_max"]));
    }
}
