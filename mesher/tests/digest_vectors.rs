//! The test vectors that all programs share: digests, leaf words, levels, roots, lattice points, boxes.
#![allow(missing_docs)]

use mesher::case::{BoxSpec, Case, RootSpec};
use mesher::digest::{Digests, digest, hex, mix};
use mesher::ingest::Source;
use mesher::lattice::{Bounds, Keep, Root};
use mesher::octant::{LEVEL_MAX, Side, corner, morton, position, start57, word};
use serde_json::Value;

fn vectors(name: &str) -> Vec<Value> {
    let all: Value = serde_json::from_str(include_str!("../../reference/vectors/digest.json"))
        .expect("the vectors are JSON");
    assert_eq!(all["schema"], "octree-test-vectors/1");
    let found = all[name].as_array().expect("a list").clone();
    assert!(!found.is_empty());
    found
}

fn hexadecimal(text: &Value) -> u64 {
    u64::from_str_radix(text.as_str().expect("text"), 16).expect("hexadecimal digits")
}

/// Numbers are text, so that no JSON reader rounds them.
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

/// A vertex as STL have it. The vectors hold what f32 can hold.
fn narrow(p: [f64; 3]) -> [f32; 3] {
    let q = p.map(|c| c as f32);
    assert_eq!(q.map(f64::from), p, "a vertex is of f32");
    q
}

#[test]
fn mixes_and_digests() {
    for v in vectors("mix") {
        assert_eq!(hex(mix(hexadecimal(&v["word"]))), v["mix"]);
    }
    for v in vectors("digests") {
        let given = v["words"].as_array().expect("a list");
        let mut words: Vec<u64> = given.iter().map(hexadecimal).collect();
        assert_eq!(hex(digest(&words)), v["digest"]);
        words.reverse();
        assert_eq!(hex(digest(&words)), v["digest"], "whatever the order");
        words.sort_unstable();
        let mut whole = Digests::default();
        whole.add(&words);
        assert_eq!(hex(whole.whole()), v["digest"], "octants add up");
    }
}

#[test]
fn leaf_words() {
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
fn levels_of_spacings() {
    for v in vectors("levels") {
        let root = Root { origin: [0.0; 3], edge: number(&v["edge"]) };
        let found = root.level_of(number(&v["spacing"]), "spacing_min").ok().map(u64::from);
        assert_eq!(found, v["level"].as_u64(), "{v}");
    }
}

#[test]
fn roots_around_bodies() {
    for v in vectors("roots") {
        let facet = std::array::from_fn(|i| narrow(point(&v["vertices"][i])));
        let found = Root::around(&Bounds::of(&[facet]), number(&v["root_scale"])).ok();
        assert_eq!(found, Some(root(&v)));
    }
}

#[test]
fn lattice_points() {
    for v in vectors("quantised") {
        let (root, vertex) = (root(&v), point(&v["vertex"]));
        let at: [i64; 3] = std::array::from_fn(|a| root.quantise(a, vertex[a]));
        let near = vertex.map(|c| c as f32);
        if v["lattice"].is_null() {
            // The vertex that f32 has nearest, and a root moved by as much.
            let by = |a: usize| f64::from(near[a]) - vertex[a];
            let moved = Root { origin: std::array::from_fn(|a| root.origin[a] + by(a)), ..root };
            let told = moved
                .facets(vec![[near; 3]], &Bounds::of(&[[near; 3]]), 0)
                .expect_err("too far outside")
                .to_string();
            assert!(told.contains("facet 0") && told.contains("outside the root"), "{told}");
            continue;
        }
        assert_eq!(at, integers(&v["lattice"]), "{v}");
        // A vertex that f32 cannot hold is none that an STL can have; boxes may have it.
        if near.map(f64::from) == vertex {
            let found =
                root.facets(vec![[near; 3]], &Bounds::of(&[[near; 3]]), 0).expect("near the root");
            assert_eq!(found[0].v.map(|p| p.map(i64::from)), [at; 3], "{v}");
        }
    }
}

#[test]
fn boxes_on_the_lattice() {
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
        };
        let rules = case.rules(&Bounds::EMPTY).expect("the box is good");
        assert_eq!(rules.boxes[0].min, integers(&v["lattice_min"]));
        assert_eq!(rules.boxes[0].max, integers(&v["lattice_max"]));
    }
}
