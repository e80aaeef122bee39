//! The test vectors that all programs share (`DEFINITION.md`, section 14).
use crate::support;
use reference::lattice::{Facet, Input};
use reference::leaves::{Tally, digest_of_facets, hex};
use reference::octant::Octant;
use reference::{BoxSpec, Case, Root, Side, digest, mix};
use serde_json::Value;

fn cases(name: &str) -> Vec<Value> {
    let vectors: Value = serde_json::from_str(include_str!("../../vectors/digest.json")).unwrap();
    assert_eq!(vectors["schema"], "octree-test-vectors/1");
    let cases = vectors[name].as_array().unwrap().clone();
    assert!(!cases.is_empty());
    cases
}

fn word(text: &Value) -> u64 {
    u64::from_str_radix(text.as_str().unwrap(), 16).unwrap()
}

fn number(text: &Value) -> f64 {
    text.as_str().unwrap().parse().unwrap()
}

fn point(texts: &Value) -> [f64; 3] {
    std::array::from_fn(|a| number(&texts[a]))
}

fn lattice_point(numbers: &Value) -> [i64; 3] {
    std::array::from_fn(|a| numbers[a].as_i64().unwrap())
}

fn empty(origin: [f64; 3], edge: f64) -> Case {
    Case { root: Root { origin, edge }, spacing_min: edge, ..support::case(&[], 0) }
}

#[test]
fn mixes_agree_with_the_vectors() {
    for case in cases("mix") {
        assert_eq!(hex(mix(word(&case["word"]))), case["mix"]);
    }
}

#[test]
fn digests_agree_in_any_order() {
    for case in cases("digests") {
        let mut words: Vec<u64> = case["words"].as_array().unwrap().iter().map(word).collect();
        assert_eq!(hex(digest(&words)), case["digest"]);
        words.reverse();
        assert_eq!(hex(digest(&words)), case["digest"], "in reverse order");
        let tally = Tally::of(&words);
        assert_eq!(hex(tally.digest), case["digest"]);
        let merged = tally.octant_digests.iter().fold(0_u128, |sum, &d| sum.wrapping_add(d));
        assert_eq!(hex(merged), case["digest"], "the digests of octants add");
    }
}

#[test]
fn digests_of_geometries_agree_with_the_vectors() {
    for case in cases("geometries") {
        let facet =
            |nine: &Value| [0, 3, 6].map(|v| [0, 1, 2].map(|a| nine[v + a].as_i64().unwrap()));
        let facets: Vec<Facet> = case["facets"].as_array().unwrap().iter().map(facet).collect();
        assert_eq!(hex(digest_of_facets(&facets)), case["digest"]);
    }
}

#[test]
fn leaf_words_agree_with_the_vectors() {
    for case in cases("words") {
        let level = case["level"].as_u64().unwrap() as u32;
        let min = lattice_point(&case["cell"]).map(|x| (x * 256) as i32);
        let side = match case["side"].as_str().unwrap() {
            "outside" => Side::Outside,
            "inside" => Side::Inside,
            "crossing" => Side::Crossing,
            other => panic!("side {other}"),
        };
        let found = Octant { min, level }.word(side);
        assert_eq!(found, word(&case["word"]));
        let octant = case["octant"].as_u64().unwrap() as usize;
        assert_eq!(Tally::of(&[found]).octant_digests[octant], mix(found));
    }
}

#[test]
fn levels_of_spacings_agree_with_the_vectors() {
    for case in cases("levels") {
        let edge = number(&case["edge"]);
        let spacing_min = number(&case["spacing"]);
        let found = Input::new(&Case { spacing_min, ..empty([0.0; 3], edge) });
        match case["level"].as_u64() {
            Some(level) => assert_eq!(u64::from(found.unwrap().level_surface), level),
            None => {
                assert!(found.unwrap_err().to_string().contains("the cell edge at the deepest"))
            }
        }
    }
}

#[test]
fn roots_by_scale_agree_with_the_vectors() {
    for case in cases("roots") {
        let vertices: Vec<[f64; 3]> =
            case["vertices"].as_array().unwrap().iter().map(point).collect();
        let facet = vertices.try_into().unwrap();
        let root = Root::around(&[facet], number(&case["root_scale"])).unwrap();
        assert_eq!(root, Root { origin: point(&case["origin"]), edge: number(&case["edge"]) });
    }
}

#[test]
fn quantised_vertices_agree_with_the_vectors() {
    for case in cases("quantised") {
        let vertex = point(&case["vertex"]);
        let facets = vec![[vertex; 3]];
        let found =
            Input::new(&Case { facets, ..empty(point(&case["origin"]), number(&case["edge"])) });
        if case["lattice"].is_null() {
            let why = found.unwrap_err().to_string();
            assert!(why.starts_with("facet 0 ") && why.contains("outside the root"), "{why}");
        } else {
            assert_eq!(found.unwrap().facets[0][0], lattice_point(&case["lattice"]));
        }
    }
}

#[test]
fn quantised_boxes_agree_with_the_vectors() {
    for case in cases("boxes") {
        let edge = number(&case["edge"]);
        let spec = BoxSpec { min: point(&case["min"]), max: point(&case["max"]), spacing: edge };
        let boxes = vec![spec];
        let input = Input::new(&Case { boxes, ..empty(point(&case["origin"]), edge) }).unwrap();
        assert_eq!(input.boxes[0].extent.min, lattice_point(&case["lattice_min"]));
        assert_eq!(input.boxes[0].extent.max, lattice_point(&case["lattice_max"]));
    }
}
