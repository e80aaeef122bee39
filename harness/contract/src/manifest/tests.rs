use super::*;

#[test]
fn keys_of_seeds_and_components_are_optional_and_survive_a_round_trip() {
    let mut manifest = crate::testing::leaf_set(vec![vec![0]]).manifest;
    let text = serde_json::to_string(&manifest).unwrap();
    assert!(!text.contains("components\":"), "{text}");
    let older = text.replace("\"seeds\":[],\"enclosed\":\"delete\",", "");
    assert_ne!(older, text);
    assert_eq!(serde_json::from_str::<Manifest>(&older).unwrap(), manifest);
    let enclosed = EnclosedComponents { count: 1, leaves: 512, example: Some([0.5, 1.0, 2.0]) };
    manifest.components = Some(Components { outside: 3, inside: 1, enclosed });
    (manifest.seeds, manifest.enclosed) = (vec![[1, 2, 3]], Enclosed::Keep);
    let text = serde_json::to_string(&manifest).unwrap();
    assert!(text.contains("\"enclosed\":{\"count\":1,\"leaves\":512,\"example\":[0.5,1.0,2.0]}"));
    assert_eq!(serde_json::from_str::<Manifest>(&text).unwrap(), manifest);
}

#[test]
fn only_unknown_sides_are_written() {
    let mut manifest = crate::testing::leaf_set(vec![vec![0]]).manifest;
    for (sides, key) in [(Sides::Known, None), (Sides::Unknown, Some("\"sides\":\"unknown\""))] {
        manifest.sides = sides;
        let text = serde_json::to_string(&manifest).unwrap();
        assert_eq!(text.contains("\"sides\""), key.is_some(), "{text}");
        assert!(key.is_none_or(|key| text.contains(key)), "{text}");
        assert_eq!(serde_json::from_str::<Manifest>(&text).unwrap(), manifest);
    }
}

#[test]
fn numbers_out_of_range_are_faults() {
    let manifest = crate::testing::leaf_set(vec![vec![0]]).manifest;
    assert_eq!(manifest.fault(), None);
    let faulty = |edit: &dyn Fn(&mut Manifest)| {
        let mut manifest = manifest.clone();
        edit(&mut manifest);
        manifest.fault().unwrap_or_default()
    };
    let with_box = |min: i64, max: i64, level: u8| {
        faulty(&|m| m.boxes.push(ExtentBox { min: [0, min, 0], max: [1, max, 1], level }))
    };
    assert_eq!(with_box(0, UNITS_PER_EDGE, 19), "");
    for (min, max, level) in [(0, 1, 20), (1, 0, 3), (i64::MIN, 1, 3), (0, UNITS_PER_EDGE + 1, 3)] {
        assert!(with_box(min, max, level).starts_with("boxes"));
    }
    assert!(faulty(&|m| m.level_surface = 20).starts_with("level_surface"));
    assert!(faulty(&|m| m.layer_cells_min = 0).starts_with("layer_cells_min"));
    assert!(faulty(&|m| m.seeds.push([0, i64::MAX, 0])).starts_with("seeds"));
    assert!(faulty(&|m| m.octant_digests.clear()).starts_with("octant_digests"));
    for edge in [0.0, -1.0, f64::NAN, 1e-300, 1e300] {
        assert!(faulty(&|m| m.root.edge = edge).starts_with("root"));
    }
    assert!(faulty(&|m| m.root.origin[2] = f64::INFINITY).starts_with("root"));
}

#[test]
fn numbers_at_the_ends_of_their_ranges_are_no_faults() {
    let mut manifest = crate::testing::leaf_set(vec![vec![0]]).manifest;
    (manifest.level_surface, manifest.layer_cells_min) = (LEVEL_MAX, 1);
    manifest.boxes.push(ExtentBox { min: [5; 3], max: [5; 3], level: 0 });
    manifest.seeds = vec![[0; 3], [UNITS_PER_EDGE; 3]];
    for (origin, edge) in [(-9.9e99, 1e-100), (9.9e99, 9.9e99)] {
        manifest.root = Root { origin: [origin; 3], edge };
        assert_eq!(manifest.fault(), None);
    }
    manifest.root.origin[0] = -1e100;
    assert!(manifest.fault().is_some_and(|fault| fault.starts_with("root")));
    manifest.root = Root { origin: [0.0; 3], edge: 1e100 };
    assert!(manifest.fault().is_some_and(|fault| fault.starts_with("root")));
    manifest.root.edge = 1.0;
    manifest.seeds = vec![[0, 0, UNITS_PER_EDGE + 1]];
    assert!(manifest.fault().is_some_and(|fault| fault.starts_with("seeds")));
    manifest.seeds = vec![[0, -1, 0]];
    assert!(manifest.fault().is_some_and(|fault| fault.starts_with("seeds")));
}

#[test]
fn leaves_are_counted_by_level_side_and_octant() {
    let words = [0, 3 << 2 | 1, 511 << 55 | 3 << 2 | 2, 25 << 2 | 3];
    let mut tally = Manifest::default();
    tally.set_leaves(&words);
    let mut by_level = [0; LEVEL_MAX as usize + 1];
    (by_level[0], by_level[3]) = (1, 2);
    assert_eq!((tally.leaves, tally.leaves_by_level), (4, by_level));
    assert_eq!(tally.leaves_by_side, BySide { outside: 1, inside: 1, crossing: 1 });
    assert_eq!(tally.digest, Digest::of(&words));
    assert_eq!(tally.octant_digests[511], Digest::of(&words[2..3]));
    let mut counted = Manifest::default();
    counted.count(words[1], 1);
    assert_eq!(
        (counted.leaves, counted.leaves_by_side.inside, counted.leaves_by_level[3]),
        (1, 1, 1)
    );
    assert_eq!(
        (part_name(0), part_name(123_456)),
        ("leaves-00000.npy".to_owned(), "leaves-123456.npy".to_owned())
    );
}
