use super::*;
use crate::checks::CAPACITY;
use crate::promises::Touching;
use contract::digest::Digest;
use contract::htg::Block;
use contract::import::ImportedTree;
use contract::leafset::{self, LeafSet};
use contract::manifest::{Keep, Sides};
use contract::octant::Octant;
use contract::testing::{leaf_set, random_words, words_of};
use contract::tree::Builder;
use contract::word;
use proptest::prelude::*;

fn audited(set: &LeafSet) -> AuditReport {
    let dir = tempfile::tempdir().unwrap();
    set.write(dir.path()).unwrap();
    audit(dir.path())
}

/// An audit of a mesh by itself.
fn audit(dir: &Path) -> AuditReport {
    audit_against(dir, None, &Promises::of_definition())
}

fn found(report: &AuditReport) -> Vec<&'static str> {
    report.checks.iter().filter(|c| !c.holds()).map(|c| c.name).collect()
}

/// A balanced mesh of three levels.
fn correct() -> Vec<u64> {
    words_of(|o| o.level == 0 || o.level < 3 && o.corner == [0; 3])
}

proptest! {
    #[test]
    fn the_result_does_not_depend_on_the_partition(words in random_words(3), part_of in prop::collection::vec(0usize..5, 600)) {
        let mut parts = vec![Vec::new(); 5];
        words.iter().zip(&part_of).for_each(|(&w, &part)| parts[part].push(w));
        let words: Vec<u64> = words.into_iter().take(part_of.len()).collect();
        let leaves = words.len() as u64;
        let one = audited(&leaf_set(vec![words]));
        let several = audited(&leaf_set(parts));
        prop_assert_eq!(found(&one), found(&several));
        prop_assert!(!found(&several).contains(&"manifest") && !found(&several).contains(&"linear"));
        prop_assert_eq!(several.leaves, leaves);
    }
}

#[test]
fn a_correct_mesh_passes_and_an_unsorted_part_fails() {
    let mut unsorted = correct();
    let mut set = leaf_set(vec![unsorted.clone(), vec![]]);
    set.manifest.level_surface = 3;
    assert!(audited(&set).holds());
    // The deepest leaves, of level 3, need a surface or a box.
    set.manifest.level_surface = 2;
    assert_eq!(found(&audited(&set)), ["spacing"]);
    unsorted.swap(3, 4);
    let report = audited(&leaf_set(vec![unsorted]));
    assert!(found(&report).contains(&"linear"));
}

#[test]
fn promises_replace_the_checks_of_the_definition_unless_they_include_it() {
    // Level 1 touches level 4 in a corner.
    let words = words_of(|o| o.level == 0 || "0.7.7".starts_with(&o.path()));
    let dir = tempfile::tempdir().unwrap();
    leaf_set(vec![words]).write(dir.path()).unwrap();
    let names = |promises: &Promises| {
        let report = audit_against(dir.path(), None, promises);
        let names: Vec<_> = report.checks.iter().map(|check| check.name).collect();
        (names, found(&report))
    };
    let balance = |touching, ratio| Promises {
        balance: Some(touching),
        ratio: Some(ratio),
        ..Promises::default()
    };
    let checked = ["files", "manifest", "linear", "balance"];
    let (names_of_balance, findings) = names(&balance(Touching::Corner, 4));
    assert_eq!((&names_of_balance[..], &findings[..]), (&checked[..], &["balance"][..]));
    assert_eq!(names(&balance(Touching::Corner, 8)), (names_of_balance, vec![]));
    let of_definition = audit(dir.path());
    let expected: Vec<_> = of_definition.checks.iter().map(|check| check.name).collect();
    let by_promise = names(&Promises::of_definition());
    assert_eq!(by_promise, (expected, found(&of_definition)));
    assert!(by_promise.0.contains(&"layer"));
}

#[test]
fn a_check_that_had_nothing_to_check_examined_nothing_and_the_others_every_leaf() {
    let report = audited(&leaf_set(vec![correct()]));
    assert!(report.not_run().count() > 0 && report.checked_anything());
    assert_eq!(report.nodes, Tree::of_words(&correct()).nodes() as u64);
    for check in &report.checks {
        let expected = match check.name {
            checks::FILES => 1,
            _ if check.was_run() => report.leaves,
            _ => 0,
        };
        assert_eq!(check.examined, expected, "{check}");
    }
}

/// The codes of unknown sides are all `outside`, which must neither pass for sides nor fail for holes.
#[test]
fn what_needs_unknown_sides_is_not_checked() {
    let mut words = correct();
    words.pop();
    let mut set = leaf_set(vec![words]);
    let found = |set: &LeafSet, name: &str| {
        let checks = audited(set).checks;
        checks.into_iter().find(|c| c.name == name).expect("a check of the audit")
    };
    let is_withdrawn = |set: &LeafSet, name: &str| {
        found(set, name).nothing_to_check.is_some_and(|why| why.contains("sides of the leaves"))
    };
    assert!(!found(&set, "complete").holds() && !is_withdrawn(&set, "sides"));
    set.manifest.sides = Sides::Unknown;
    assert!(!found(&set, "complete").holds() && is_withdrawn(&set, "sides"));
    set.manifest.keep = Keep::Outside;
    for name in ["complete", "sides", "kept"] {
        assert!(is_withdrawn(&set, name), "{name}");
    }
}

/// Components are compared with seeds, with the manifest's counts, and with the boundary of a mesh without enclosed ones.
#[test]
fn what_states_nothing_about_components_does_not_keep_the_right_ones() {
    let mut set = leaf_set(vec![correct()]);
    let is_checked = |set: &LeafSet| {
        let found = audited(set).checks.into_iter().find(|check| check.name == "kept").unwrap();
        assert!(found.holds() || !found.was_run(), "{found}");
        found.was_run()
    };
    set.manifest.keep = Keep::Outside;
    assert!(is_checked(&set));
    set.manifest.enclosed = contract::manifest::Enclosed::Keep;
    assert!(!is_checked(&set));
}

#[test]
fn a_promise_of_sides_is_broken_by_a_mesh_without() {
    let text = "spacing_min = 2.0\nkeep = 'all'\nroot = { origin = [0.0, 0.0, 0.0], edge = 8.0 }\n";
    let facet = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]];
    let case = Case::from_parts(text, vec![facet]).unwrap();
    let sides = Some(crate::promises::Sides { band_cells: 0.25 });
    let promises = Promises { sides, ..Promises::default() };
    for known in [true, false] {
        let mut set = leaf_set(vec![words_of(|o| o.level < 2)]);
        set.manifest.sides = if known { Sides::Known } else { Sides::Unknown };
        let dir = tempfile::tempdir().unwrap();
        set.write(dir.path()).unwrap();
        let report = audit_against(dir.path(), Some(&case), &promises);
        let check = report.checks.iter().find(|check| check.name == "sides").unwrap();
        assert_eq!((check.was_run(), check.holds()), (true, known), "{report}");
        let claims = report.checks.iter().find(|check| check.name == "manifest").unwrap();
        let claims: Vec<&str> = claims.findings.iter().map(|f| f.as_str()).collect();
        let level = "level_surface: 0 in the manifest; 2 in fact";
        assert_eq!(claims, [level, "layer_cells_min: 1 in the manifest; 4 in fact"]);
        // Leaves near the facet are not judged, and are not counted.
        assert!(!known || check.examined > 0 && check.examined < 64, "{report}");
    }
}

#[test]
fn the_report_states_each_check_and_whether_leaves_were_checked() {
    let mut layer = CheckResult::new("layer");
    layer.lacks("no layer");
    let mut report = AuditReport {
        checks: vec![CheckResult::new("manifest"), layer],
        leaves: 3_000_000,
        nodes: 12,
        time_read_s: 0.25,
        time_wall_s: 1.5,
    };
    let expected = "manifest   holds, 0 examined\nlayer      nothing to check: no layer\n\
        left out: the mesh gave no check of its leaves anything to check\n\
        3000000 leaves (12 distinct octants) in 1.50 s, of which reading 0.25 s: 2.0 M leaves/s";
    assert_eq!(report.to_string(), expected);
    assert_eq!(report.not_run().map(|check| check.name).collect::<Vec<_>>(), ["layer"]);
    assert!(report.holds() && !report.checked_anything());
    report.checks.push(CheckResult::new("balance"));
    assert!(report.holds() && report.checked_anything());
    report.checks.remove(2);
    report.checks[0].report("a finding".to_owned());
    assert!(!report.holds() && report.checked_anything());
}

#[test]
fn a_report_that_contradicts_itself_is_a_bug() {
    let correct = audited(&leaf_set(vec![correct()]));
    let faults: [fn(&mut AuditReport); 2] =
        [|r| r.nodes = 20 * r.leaves, |r| r.checks[0].findings_total += 1];
    for fault in faults {
        let mut wrong = correct.clone();
        fault(&mut wrong);
        assert!(std::panic::catch_unwind(|| wrong.check_invariants()).is_err(), "{wrong}");
    }
}

#[test]
fn a_manifest_that_names_no_file_gives_no_check_anything_to_check() {
    let promises = Promises { balance: Some(Touching::Face), ..Promises::default() };
    let dir = tempfile::tempdir().unwrap();
    leaf_set(vec![]).write(dir.path()).unwrap();
    let report = audit_against(dir.path(), None, &promises);
    assert!(report.holds() && report.not_run().count() == report.checks.len(), "{report}");
    assert!(report.to_string().contains("mesh.json names no file of leaves"), "{report}");
}

/// The audit must not pass if memory does not suffice, but it still checks counts and digests.
#[test]
fn an_exceeded_memory_limit_is_a_finding() {
    let mut set = leaf_set(vec![words_of(|o| o.level < 5 && o.corner[0] < 1 << 18)]);
    set.manifest.leaves += 1;
    let dir = tempfile::tempdir().unwrap();
    set.write(dir.path()).unwrap();
    let report = audit_within(1, dir.path(), None, &Promises::of_definition());
    assert_eq!(found(&report), ["manifest", CAPACITY]);
}

/// The blocks of an octant in which all leaves have level 16; those on the path to one octant, which `change` replaces, are smaller.
fn blocks(octant: Octant, to: &Octant, change: fn(Octant) -> Option<Block>) -> Vec<Block> {
    let key = word::key_of(octant.corner) << 7;
    if octant == *to {
        return change(octant).into_iter().collect();
    }
    if octant.level >= 3 && !octant.contains(to) {
        return vec![Block { first: key | 16 << 2, depth: 16 - octant.level }];
    }
    (0..8).flat_map(|digit| blocks(octant.child(digit), to, change)).collect()
}

/// All of 2^48 leaves are counted, and one corrupt one is found. Only their digest is not made, which takes a day.
#[test]
fn one_corrupt_leaf_of_more_than_2_to_the_37_is_found() {
    fn leaves(o: Octant, level: u8, side: u64) -> Option<Block> {
        let first = word::key_of(o.corner) << 7 | u64::from(level) << 2 | side;
        Some(Block { first, depth: level - o.level })
    }
    let whole = |o: Octant| leaves(o, 16, 0);
    let inside = |o: Octant| leaves(o, 16, 1);
    let coarse = |o: Octant| leaves(o, o.level, 0);
    type Change = fn(Octant) -> Option<Block>;
    let cases: [(u8, Change, &[&str]); 6] = [
        (16, whole, &[]),
        (16, |_| None, &["manifest", "complete"]),
        (16, inside, &["manifest", "sides"]),
        (15, inside, &["manifest", "sides"]),
        (14, coarse, &["manifest", "balance"]),
        (15, coarse, &["manifest"]),
    ];
    for (level, change, expected) in cases {
        let to = Octant { corner: [77_000, 300_008, 499_992], level: 19 }.ancestor(level);
        let (mut tally, mut builder) = (leaf_set(vec![]).manifest, Builder::default());
        tally.parts.clear();
        for block in blocks(Octant::ROOT, &to, change) {
            tally.count(block.first, block.leaves());
            builder.push_block(&block).unwrap();
        }
        let mut manifest = Manifest { keep_crossing: true, ..leaf_set(vec![]).manifest };
        manifest.parts.clear();
        manifest.level_surface = 16;
        manifest.count(16 << 2, 1 << 48);
        assert!(manifest.leaves > 1 << 37 && tally.leaves >= (1 << 48) - 511);
        let pass = Pass { tally, linear: CheckResult::new("linear"), tree: Some(builder.finish()) };
        assert!(pass.tree.as_ref().unwrap().nodes() < 60);
        let results = checks::all(&Subject::of(&manifest, manifest.tree, pass, None));
        let found: Vec<_> = results.iter().filter(|c| !c.holds()).map(|c| c.name).collect();
        assert_eq!(found, expected, "level {level}");
    }
}

/// A mesh that has the tree alone, as large meshes do.
#[test]
fn a_tree_alone_must_have_the_leaves_of_its_manifest() {
    let sample = Path::new("../contract/tests/samples/sphere.vtkhdf");
    let open = ImportedTree::open(sample, None, None, None, "test".to_owned());
    let place = tempfile::tempdir().unwrap();
    open.unwrap().expect("a tree").link(place.path()).unwrap();
    let correct = Manifest::read(place.path()).unwrap();
    let report = audit(place.path());
    assert!(report.leaves == 9056 && report.nodes > 0 && !found(&report).contains(&"manifest"));
    let changes: [fn(&mut Manifest); 3] = [
        |m| m.octant_digests.swap(0, 511),
        |m| m.digest = Digest(m.digest.0 ^ 1),
        |m| m.leaves += 1 << 33,
    ];
    for change in changes {
        let mut wrong = correct.clone();
        change(&mut wrong);
        wrong.write(place.path()).unwrap();
        let manifest = audit(place.path()).checks.remove(1);
        assert_eq!((manifest.name, manifest.holds()), ("manifest", false));
    }
}

/// A mesh of the contract's samples as parts and as a tree, in one directory.
#[test]
fn a_tree_beside_parts_must_have_their_leaves() {
    const TREE_FILE: &str = "mesh.vtkhdf";
    let sample = Path::new("../contract/tests/samples/sphere.vtkhdf");
    let open = ImportedTree::open(sample, None, None, None, "test".to_owned());
    let place = tempfile::tempdir().unwrap();
    let parts = place.path().join("parts");
    open.unwrap().expect("a tree").create(&parts).unwrap();
    let mut correct = leafset::read(&parts).unwrap();
    correct.manifest.hyper_tree_grid = Some(TREE_FILE.to_owned());
    let tree_file = |set: &LeafSet, tree: &[u8]| {
        let dir = tempfile::tempdir().unwrap();
        set.write(dir.path()).unwrap();
        std::fs::write(dir.path().join(TREE_FILE), tree).unwrap();
        let checks = audit(dir.path()).checks;
        assert_eq!((checks[0].name, checks[0].examined), (checks::FILES, 2));
        let result = checks.into_iter().find(|check| check.name == TREE).expect("its check");
        let details = result.findings.iter().cloned();
        (result.examined, details.collect::<Vec<_>>().join("\n"))
    };
    let bytes = std::fs::read(sample).unwrap();
    assert_eq!(tree_file(&correct, &bytes), (9056, String::new()));
    let other = correct.with_parts(vec![correct.words[1..].to_vec()]);
    let (examined, text) = tree_file(&other, &bytes);
    assert!(
        examined == 9056 && text.starts_with("the leaves of the tree have the digest"),
        "{text}"
    );
    assert!(text.ends_with(&other.manifest.digest.to_string()), "{text}");
    let (_, text) = tree_file(&correct, &bytes[..bytes.len() / 2]);
    assert!(text.contains(TREE_FILE) && text.contains("is damaged"), "{text}");
    // That both have the same leaves shows nothing about them.
    let dir = tempfile::tempdir().unwrap();
    correct.write(dir.path()).unwrap();
    std::fs::write(dir.path().join(TREE_FILE), &bytes).unwrap();
    let boxes = Promises { boxes: true, ..Promises::default() };
    let report = audit_against(dir.path(), None, &boxes);
    assert!(report.holds() && !report.checked_anything(), "{report}");
}

#[test]
fn a_report_as_json_has_the_verdict_and_a_line_per_check() {
    let mut set = leaf_set(vec![correct()]);
    set.manifest.level_surface = 3;
    for extra_leaves in [0, 1] {
        set.manifest.leaves += extra_leaves;
        let report = audited(&set);
        let read: serde_json::Value = serde_json::from_str(&report.json(report.holds())).unwrap();
        assert_eq!(read["schema"], "octree-audit/1");
        assert_eq!(read["holds"], extra_leaves == 0);
        assert_eq!(read["leaves"], report.leaves);
        assert!(read["time_cpu_s"].is_f64() && read["peak_rss_bytes"].as_u64() > Some(0));
        for (written, check) in read["checks"].as_array().unwrap().iter().zip(&report.checks) {
            let mut expected = serde_json::json!({
                "name": check.name, "examined": check.examined, "findings": check.findings_total
            });
            if let Some(why) = &check.nothing_to_check {
                expected["nothing_to_check"] = why.as_str().into();
            }
            assert_eq!(*written, expected);
        }
    }
}
