use super::*;
use contract::lattice::Root;
use contract::manifest::Enclosed;

fn terms(n: u32) -> Terms {
    let root = Root { origin: [0.0; 3], edge: 8.0 };
    Terms {
        root,
        level_surface: 3,
        layer_cells_min: n,
        keep: Keep::All,
        keep_crossing: true,
        boxes: vec![],
        seeds: vec![],
        enclosed: Enclosed::Delete,
        sides: Default::default(),
    }
}

/// Sorted words of octants that are given by their paths, all with side outside.
fn mesh(paths: &[&[u8]]) -> Vec<u64> {
    let octant =
        |path: &&[u8]| path.iter().fold(Octant::ROOT, |octant, &digit| octant.child(digit));
    let leaf = |path| word::encode(&Leaf { octant: octant(path), side: Side::Outside });
    let mut words: Vec<u64> = paths.iter().map(leaf).collect();
    words.sort_unstable();
    words
}

fn rule(a: &[u64], b: &[u64], n: u32) -> String {
    let first = a.iter().zip(b).take_while(|(x, y)| x == y).count();
    let terms = terms(n);
    let dispute = Dispute { a, b, terms: &terms, case: None };
    dispute.rule(a.get(first).copied(), b.get(first).copied()).join("\n")
}

/// Two meshes with the octant `fine`, one with the octant 1 as a leaf, and one with three of its children
/// instead.
fn pair(fine: &[u8]) -> (Vec<u64>, Vec<u64>) {
    let unsplit = mesh(&[fine, &[1]]);
    let split = mesh(&[fine, &[1, 0], &[1, 1], &[1, 2]]);
    (unsplit, split)
}

#[test]
fn rules_of_layer_and_balance_name_their_witness() {
    let (unsplit, split) = pair(&[0, 1]);
    let text = rule(&unsplit, &split, 2);
    assert!(
        text.contains("step 2 (layer)")
            && text.ends_with("by the leaf octant 0.1 (level 2), which both have: B is right"),
        "{text}"
    );
    let text = rule(&unsplit, &split, 1);
    assert!(
        text.contains("nothing in either mesh requires") && text.contains("A is right"),
        "{text}"
    );
    let (unsplit, split) = pair(&[0, 1, 1]);
    let text = rule(&split, &unsplit, 1);
    assert!(text.contains("step 3 (balance)") && text.contains("A is right"), "{text}");
}

#[test]
fn the_search_continues_at_a_disputed_witness() {
    // Octant 1.2 is needlessly split in B only. Its children require the split of octant 3.
    let a = mesh(&[&[1, 2], &[3]]);
    let b = mesh(&[&[1, 2, 2], &[3, 0], &[3, 1]]);
    let (first_a, first_b) = (mesh(&[&[3]])[0], mesh(&[&[3, 0]])[0]);
    let terms = terms(1);
    let text =
        Dispute { a: &a, b: &b, terms: &terms, case: None }.rule(Some(first_a), Some(first_b));
    assert_eq!(text.len(), 2, "{text:?}");
    assert!(text[0].contains("octant 1.2.2 (level 3), which A does not have"), "{text:?}");
    assert!(
        text[1].contains("leaf octant 1.2 (level 2)") && text[1].contains("A is right"),
        "{text:?}"
    );
}

#[test]
fn a_leaf_requires_a_split_up_to_the_distance_of_its_rule() {
    let octant = |path: &[u8]| path.iter().fold(Octant::ROOT, |octant, &digit| octant.child(digit));
    let requires = |n: u32, source: &[u8], target: &[u8]| {
        let terms = terms(n);
        let dispute = Dispute { a: &[], b: &[], terms: &terms, case: None };
        dispute.requires(&octant(source), &octant(target))
    };
    // Octant 0.0.1 of level 3 is two of its cells away from octant 1, 0.1.0 one, and 0.1.1 touches it.
    for (source, touching, cells) in
        [(&[0, 0, 1], false, 2), (&[0, 1, 0], false, 1), (&[0, 1, 1], true, 0)]
    {
        for n in 1..=4 {
            let text = requires(n, source, &[1]);
            if cells + 1 < n {
                let expected = format!(
                    "section 6, step 2 (layer): it is nearer than n - 1 = {} cells of level 3, so it has level >= 3",
                    n - 1
                );
                assert_eq!(text, Some(expected), "{n} cells, {cells} away");
            } else if touching {
                let expected = "section 6, step 3 (balance): it touches a leaf of level 3, so it has level >= 2";
                assert_eq!(text.as_deref(), Some(expected), "{n} cells");
            } else {
                assert_eq!(text, None, "{n} cells, {cells} away");
            }
        }
    }
    // One level finer than a leaf that it touches, as fine, coarser, and within it.
    for (source, target) in
        [(&[0, 1][..], &[1][..]), (&[0], &[1]), (&[0], &[1, 0]), (&[1, 0, 0], &[1])]
    {
        assert_eq!(requires(1, source, target), None);
    }
    for (source, target) in [(&[0][..], &[1][..]), (&[0], &[1, 0]), (&[1, 0, 0], &[1])] {
        assert_eq!(requires(9, source, target), None);
    }
}

#[test]
fn searches_at_an_octant_find_strict_ancestors_and_leaves_within() {
    let words = mesh(&[&[0], &[1, 0], &[1, 7], &[3]]);
    let terms = terms(1);
    let dispute = Dispute { a: &words, b: &[], terms: &terms, case: None };
    let octant = |path: &[u8]| path.iter().fold(Octant::ROOT, |octant, &digit| octant.child(digit));
    let ancestor =
        |path: &[u8]| dispute.ancestor_leaf(Mesh::A, &octant(path)).map(|leaf| leaf.octant);
    let within = |path: &[u8]| dispute.has_within(Mesh::A, &octant(path));
    assert_eq!(ancestor(&[0, 0]), Some(octant(&[0])));
    assert_eq!(ancestor(&[0, 7, 7]), Some(octant(&[0])));
    assert_eq!(ancestor(&[3, 7]), Some(octant(&[3])));
    for path in [&[0][..], &[1], &[1, 0], &[2, 0], &[7]] {
        assert_eq!(ancestor(path), None, "{path:?}");
    }
    for (path, expected) in [
        (&[0][..], true),
        (&[1], true),
        (&[1, 0], true),
        (&[1, 1], false),
        (&[1, 6], false),
        (&[2], false),
        (&[7], false),
        (&[], true),
    ] {
        assert_eq!(within(path), expected, "{path:?}");
    }
    assert!(!dispute.has_within(Mesh::B, &Octant::ROOT));
    assert_eq!(dispute.ancestor_leaf(Mesh::B, &octant(&[0, 0])), None);
}

#[test]
fn a_leaf_of_one_mesh_only_is_judged_by_its_side_and_what_is_kept() {
    let leaf = |side| Leaf { octant: Octant::ROOT.child(1), side };
    let absence = |mesh, side, keep, keep_crossing| {
        let terms = Terms { keep, keep_crossing, ..terms(1) };
        let words = [word::encode(&leaf(side))];
        Dispute { a: &words, b: &words, terms: &terms, case: None }.absence(mesh, &leaf(side))
    };
    assert_eq!(
        absence(Mesh::A, Side::Crossing, Keep::All, false),
        "section 7: keep_crossing is false, so A must not have a crossing leaf"
    );
    assert_eq!(
        absence(Mesh::B, Side::Inside, Keep::Outside, true),
        "section 5: keep is outside, so B must not have a leaf that is inside"
    );
    let lost = "is kept; B lost the leaf, or gave its component another side (section 4)";
    for (side, keep) in
        [(Side::Crossing, Keep::Inside), (Side::Inside, Keep::Inside), (Side::Outside, Keep::All)]
    {
        let keep_name = format!("{keep:?}").to_lowercase();
        let expected = format!("section 5: keep is {keep_name}, so a leaf that is {side} {lost}");
        assert_eq!(absence(Mesh::A, side, keep, true), expected);
    }
}

#[test]
fn a_needless_split_has_a_caveat_where_a_deleted_leaf_or_a_facet_may_require_it() {
    let case = Case::from_parts(
        "spacing_min = 1.0\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n",
        vec![[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]],
    )
    .unwrap();
    let caveat = |keep, keep_crossing, case| {
        let terms = Terms { keep, keep_crossing, ..terms(1) };
        Dispute { a: &[], b: &[], terms: &terms, case }.caveat()
    };
    for case in [None, Some(&case)] {
        assert!(caveat(Keep::All, false, case).contains("deleted afterwards"));
    }
    assert_eq!(
        caveat(Keep::Outside, true, None),
        ", unless a facet does (give the case file: --case)"
    );
    assert_eq!((caveat(Keep::All, true, None), caveat(Keep::Outside, true, Some(&case))), ("", ""));
}

#[test]
fn sides_missing_leaves_and_invalid_words_have_their_sections() {
    let outside = mesh(&[&[0], &[1]]);
    let inside = vec![outside[0] | 1, outside[1]];
    assert!(rule(&outside, &inside, 1).starts_with("section 4"));
    assert!(rule(&outside[1..], &outside, 1).starts_with("section 5: keep is all"));
}

#[test]
fn with_a_case_facets_and_rays_decide() {
    let cube = "spacing_min = 1.0\nkeep = 'all'\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n";
    let facet = [[-1.5, -1.5, -1.5], [-1.2, -1.5, -1.5], [-1.5, -1.2, -1.5]];
    let case = Case::from_parts(cube, vec![facet]).unwrap();
    let terms = Terms::of_case(&case);
    let rule = |a: &[u64], b: &[u64]| {
        Dispute { a, b, terms: &terms, case: Some(&case) }
            .rule(a.first().copied(), b.first().copied())
            .join("")
    };
    let (coarse, fine) = (mesh(&[&[0]]), mesh(&[&[0, 0]]));
    assert!(rule(&coarse, &fine).contains("section 3: facet 0 crosses it"));
    assert!(rule(&[coarse[0] | 2], &coarse).contains("crossing: A is right"));
    // A crossed leaf of the surface's level need not be split.
    let (coarse, fine) = (mesh(&[&[0, 7, 0]]), mesh(&[&[0, 7, 0, 0]]));
    assert!(rule(&coarse, &fine).contains("nothing in either mesh requires the split"));
    let coarse = mesh(&[&[0]]);
    let far = mesh(&[&[7]]);
    assert!(rule(&[far[0] | 1], &far).contains("0 of its 6 rays are inside: B is right"));
    assert!(
        rule(&[far[0] | 1], &[far[0] | 2]).contains("0 of its 6 rays are inside: neither is right")
    );
    assert!(rule(&coarse, &[coarse[0] | 2]).contains("crossing: B is right"));
}

#[test]
fn a_leaf_within_a_closed_body_is_inside() {
    let [a, b, c, d] = [[1.0f32; 3], [7.5, 1.0, 1.0], [1.0, 7.5, 1.0], [1.0, 1.0, 7.5]];
    let keys = "spacing_min = 1.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
    let body = vec![[a, b, c], [a, b, d], [a, c, d], [b, c, d]];
    let case = Case::from_parts(keys, body.clone()).unwrap();
    let outside = mesh(&[&[0, 7, 0]])[0];
    let rule = |case: &Case, a: u64, b: u64| {
        let terms = Terms::of_case(case);
        Dispute { a: &[], b: &[], terms: &terms, case: Some(case) }.rule(Some(a), Some(b)).join("")
    };
    let text = rule(&case, outside, outside | 1);
    assert!(text.contains("6 of its 6 rays are inside: B is right, if"), "{text}");
    let text = rule(&case, outside | 1, outside);
    assert!(text.contains("6 of its 6 rays are inside: A is right, if"), "{text}");
    // Without the facet across the diagonal, the rays towards it leave the body where it is open.
    let open = Case::from_parts(keys, body[..3].to_vec()).unwrap();
    let text = rule(&open, outside, outside | 1);
    assert!(text.contains("3 of its 6 rays are inside: another candidate"), "{text}");
}
