use super::*;
use crate::input::case::{BoxSpec, Case, RootSpec};
use crate::input::ingest::{self, Source};
use crate::input::lattice::{Bounds, Enclosed, ExtentBox, Keep, Rules, Seed};
use crate::output::leaves as finished;
use crate::partition::ownership::Placement;
use crate::record::Recorder;
use crate::refine;
use bricks::facet::Facet;
use bricks::octant::Side;
use bricks::tree::Tree;
use geometries::{Generator, Shape};
use ranks::{Solo, sim};

const RANKS: usize = 4;

fn case() -> Case {
    let torus = Generator::new(Shape::Torus, 640);
    Case {
        source: Source::Generated(torus),
        spacing_min: 0.05,
        layer_cells_min: 4,
        keep: Keep::Outside,
        keep_crossing: true,
        root: RootSpec::Scale(2.0),
        boxes: vec![],
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

fn options(ungraded: bool) -> Options {
    Options { ungraded, ..Options::default() }
}

fn mesh(ungraded: bool, comm: &dyn Comm) -> Mesh {
    let (mut record, options) = (Recorder::default(), options(ungraded));
    let job = &mut crate::Job::new(&options, comm, &mut record);
    let quantised = crate::quantised(&case(), job).expect("a good case");
    let mesh = crate::grow(quantised, job).expect("a good case");
    // Condensed sets cannot be corrupted.
    let split = mesh.split.each_ref().map(|set| set.bricks().collect());
    Mesh { split, ..mesh }
}

/// Makes T0, or the graded tree, and runs a check on it after rank 1 has run `corrupt`.
fn run(ungraded: bool, corrupt: impl Fn(&mut Mesh) + Sync, check: impl Fn(Mesh, &dyn Comm) + Sync) {
    sim::run(RANKS, 1, |comm| {
        let mut mesh = mesh(ungraded, comm);
        if comm.rank() == 1 {
            corrupt(&mut mesh);
        }
        check(mesh, comm);
    });
}

fn check_base_tree(mesh: Mesh, comm: &dyn Comm) {
    let facets = ranks::gather(comm, &local_facets(&mesh, comm));
    let Mesh { split, crossing, ownership, rules, .. } = mesh;
    let tree = Tree { split, crossing };
    let (tree, ownership, rules) = (&tree, &ownership, &rules);
    base_tree(&Base { tree, ownership, facets: &facets, rules, comm });
}

fn check_sides(mesh: Mesh, comm: &dyn Comm) {
    let Mesh { split, crossing, sides: s, ownership, rules, .. } = mesh;
    let tree = Tree { split, crossing };
    let (tree, ownership, rules) = (&tree, &ownership, &rules);
    let base = Base { tree, ownership, facets: &[], rules, comm };
    sides(&s, &base);
    sides::agree_over_faces(&s, &base);
}

fn check_graded(mesh: Mesh, comm: &dyn Comm) {
    graded(&mesh, comm);
    splits::gradation(&mesh, &base_split(comm), comm);
}

/// The splits of T0, with the partition of the graded tree.
fn base_split(comm: &dyn Comm) -> PerLevel {
    let (mut base, graded) = (mesh(true, comm), mesh(false, comm));
    graded.ownership.synchronise_replicas(&mut [&mut base.split], comm);
    base.split
}

/// This rank's slice of the facets on the lattice.
fn local_facets(mesh: &Mesh, comm: &dyn Comm) -> Vec<Facet> {
    let slice = ingest::read(&case().source, comm).expect("a good case");
    let bounds = Bounds::of(&slice.facets);
    mesh.rules.root.facets(slice.facets, &bounds, 0).expect("near the root")
}

/// The deepest level with octants in a set.
fn deepest(sets: &PerLevel) -> usize {
    sets.iter().rposition(|s| !s.is_empty()).expect("an octant")
}

/// Adds one octant to a set.
fn add(set: &mut BrickSet, code: u64) {
    let one = Brick { key: code >> 6, bits: 1 << (code & 63) };
    *set = std::mem::take(set).union(BrickSet::from_unsorted(vec![one]));
}

/// Removes all octants of a set in its bricks for which `is_removed` is true.
fn remove(set: &mut BrickSet, is_removed: impl Fn(u64) -> bool) {
    set.retain(|b| if is_removed(b.key) { 0 } else { b.bits });
}

#[test]
fn sound_meshes_pass() {
    run(true, |_| (), check_base_tree);
    run(true, |_| (), check_sides);
    run(false, |_| (), check_graded);
}

#[test]
#[should_panic(expected = "slices of facets must be contiguous")]
fn a_facet_in_two_slices_is_found() {
    sim::run(RANKS, 1, |comm| {
        let mut slice = ingest::read(&case().source, comm).expect("a good case");
        slice.first -= u64::from(comm.rank() == 1);
        slices(&slice, comm);
    });
}

#[test]
#[should_panic(expected = "rules must be the same on all ranks")]
fn different_rules_are_found() {
    sim::run(RANKS, 1, |comm| {
        let factor = 1.0 + comm.rank() as f64 * f64::EPSILON;
        check_lattice(|q| q.rules.root.edge *= factor, comm);
    });
}

#[test]
#[should_panic(expected = "partition boundaries must be the same on all ranks")]
fn different_partitions_are_found() {
    let corrupt = |m: &mut Mesh| {
        let mut boundaries = m.ownership.boundaries().to_vec();
        // Not a boundary of rank 1, whose intervals must remain.
        boundaries[3].0 += 1;
        m.ownership = Ownership::along(1, RANKS, boundaries);
    };
    run(true, corrupt, |m, comm| ownership(&m.ownership, comm));
}

/// Checks the routed facets after rank 1 has changed those that it has received.
fn check_facets(corrupt: impl Fn(&mut Vec<Facet>) + Sync) {
    sim::run(RANKS, 1, |comm| {
        let mesh = mesh(true, comm);
        let local = local_facets(&mesh, comm);
        let mut routed = refine::route(&local, &mesh.ownership, comm);
        if comm.rank() == 1 {
            corrupt(&mut routed);
        }
        splits::routed(&routed, &ranks::gather(comm, &local), &mesh.ownership);
    });
}

#[test]
#[should_panic(expected = "a rank must have the facets that reach its octants, each once")]
fn a_facet_that_a_rank_misses_is_found() {
    check_facets(|routed| _ = routed.pop());
}

#[test]
#[should_panic(expected = "a rank must have the facets that reach its octants, each once")]
fn a_facet_on_the_wrong_rank_is_found() {
    check_facets(|routed| routed.push(Facet { v: [[1; 3], [2, 1, 1], [1, 2, 1]] }));
}

/// Checks the quantised case after a change.
fn check_lattice(corrupt: impl Fn(&mut Quantised), comm: &dyn Comm) {
    let box_spec = BoxSpec { min: [-9.0, 0.0, 0.0], max: [0.1; 3], spacing: 0.04 };
    let case = Case { boxes: vec![box_spec], seeds: vec![[0.7, 0.0, 0.0]], ..case() };
    let slice = ingest::read(&case.source, comm).expect("a good case");
    let given = slice.facets.clone();
    let mut quantised = crate::input::quantise::quantise(&case, slice, comm).expect("a good case");
    corrupt(&mut quantised);
    lattice(&given, &case, &quantised, comm);
}

#[test]
fn whatever_is_not_at_the_nearest_lattice_point_is_found() {
    check_lattice(|_| (), &Solo);
    let corruptions: [&dyn Fn(&mut Quantised); 6] = [
        &|q| q.facets[7].v[1][2] += 1,
        &|q| q.rules.level_surface += 1,
        &|q| q.rules.seeds[0].lattice[1] -= 1,
        &|q| q.rules.boxes[0].max[2] += 1,
        &|q| q.rules.boxes[0].min[0] += 1,
        &|q| q.rules.boxes[0].level -= 1,
    ];
    for (number, corrupt) in corruptions.into_iter().enumerate() {
        let check = std::panic::AssertUnwindSafe(|| check_lattice(corrupt, &Solo));
        assert!(std::panic::catch_unwind(check).is_err(), "corruption {number}");
    }
}

/// Each of them leaves a tree whose structure is right.
#[test]
#[should_panic(expected = "split and crossing by the definition")]
fn a_crossing_leaf_that_no_facet_crosses_is_found() {
    let corrupt = |m: &mut Mesh| {
        let l = deepest(&m.split) + 1;
        let is_mine = |code: &u64| m.ownership.owns(l as Level, code >> 6);
        let exists = Tree::exists(&m.split, l as Level).map(|b| Brick { bits: b.bits, ..b });
        let all = BrickSet::from_unsorted(exists.collect()).without(&m.crossing[l]);
        let code = all.codes().find(is_mine).expect("a leaf that does not cross");
        add(&mut m.crossing[l], code);
    };
    let check = |m: Mesh, comm: &dyn Comm| {
        let facets = ranks::gather(comm, &local_facets(&m, comm));
        let tree = Tree { split: m.split, crossing: m.crossing };
        tree.check_structure();
        let (tree, ownership, rules) = (&tree, &m.ownership, &m.rules);
        splits::tree(&Base { tree, ownership, facets: &facets, rules, comm });
    };
    run(true, corrupt, check);
}

#[test]
#[should_panic(expected = "split and crossing by the definition")]
fn an_octant_that_an_extent_box_does_not_split_is_found() {
    let mesh = mesh(true, &Solo);
    let facets = local_facets(&mesh, &Solo);
    let far = bricks::octant::ROOT_EDGE;
    let extent = ExtentBox { min: [far - 5; 3], max: [far; 3], level: 4 };
    let rules = Rules { boxes: vec![extent], ..mesh.rules };
    let tree = Tree { split: mesh.split, crossing: mesh.crossing };
    let (tree, ownership, rules) = (&tree, &mesh.ownership, &rules);
    splits::tree(&Base { tree, ownership, facets: &facets, rules, comm: &Solo });
}

#[test]
#[should_panic(expected = "is crossing, but no leaf")]
fn a_crossing_octant_that_is_split_is_found() {
    let corrupt = |m: &mut Mesh| {
        let l = deepest(&m.split);
        m.crossing[l] = m.split[l].clone();
    };
    run(true, corrupt, check_base_tree);
}

#[test]
#[should_panic(expected = "is split, but its parent is not")]
fn a_split_octant_without_a_parent_is_found() {
    let corrupt = |m: &mut Mesh| {
        let l = deepest(&m.split);
        let b = m.split[l].brick(0);
        remove(&mut m.split[l - 1], |key| key == b.key >> 3);
    };
    run(true, corrupt, check_base_tree);
}

/// Corrupts a replica of a brick of T0 on rank 1, and leaves its tree valid.
fn corrupt_replica(m: &mut Mesh, change: impl Fn(&mut BrickSet, u64)) {
    for l in (2..bricks::tree::LEVELS as Level).rev() {
        let is_replica = |b: &Brick| m.ownership.placement(l, b.key) != Placement::Local;
        if let Some(b) = m.crossing[l as usize].bricks().find(is_replica) {
            return change(&mut m.crossing[l as usize], b.key);
        }
    }
    panic!("rank 1 has no replica with a crossing leaf");
}

#[test]
#[should_panic(expected = "replicas of a brick must be equal")]
fn a_replica_with_other_octants_is_found() {
    let half = |set: &mut BrickSet, key| {
        set.retain(|b| if b.key == key { b.bits & b.bits.wrapping_sub(1) } else { b.bits });
    };
    run(true, |m| corrupt_replica(m, half), check_base_tree);
}

#[test]
#[should_panic(expected = "replicas of a brick must be equal")]
fn a_missing_replica_is_found() {
    run(true, |m| corrupt_replica(m, |set, key| remove(set, |k| k == key)), check_base_tree);
}

#[test]
#[should_panic(expected = "a rank must hold the bricks that it has")]
fn a_brick_of_another_rank_is_found() {
    let check = |m: Mesh, comm: &dyn Comm| {
        let boundaries = m.ownership.boundaries().to_vec();
        // Rank 1 takes itself for rank 2.
        let rank = if comm.rank() == 1 { 2 } else { comm.rank() };
        let crossing = if comm.rank() == 1 {
            let l = deepest(&m.crossing);
            let mut other = bricks::tree::PerLevel::default();
            let (start, _) = boundaries[2];
            add(&mut other[l], start >> (3 * (LEVEL_MAX - l as Level)) | 0o777);
            other
        } else {
            m.crossing
        };
        replicas(&[&crossing], &Ownership::along(rank, RANKS, boundaries), comm);
    };
    run(true, |_| (), check);
}

#[test]
#[should_panic(expected = "has a side, but is no leaf off the surface")]
fn a_crossing_leaf_that_is_deleted_is_found() {
    run(true, |m| m.sides.stored = m.crossing.clone(), check_sides);
}

#[test]
#[should_panic(expected = "results of sides must be the same on all ranks")]
fn different_numbers_of_components_are_found() {
    run(true, |m| m.sides.summary.outside += 1, check_sides);
}

#[test]
#[should_panic(expected = "is deleted, but no leaf")]
fn a_deleted_leaf_that_is_split_is_found() {
    let corrupt = |m: &mut Mesh| {
        let l = deepest(&m.sides.stored);
        let code = m.sides.stored[l].codes().next().expect("a deleted leaf");
        add(&mut m.split[l], code);
    };
    run(false, corrupt, check_graded);
}

/// Checks gradation on one rank after a change of an octant: no longer split, or split if it was not.
fn check_gradation(layer_cells_min: u32, choose: impl Fn(&Mesh, &PerLevel) -> (usize, u64)) {
    let (mut mesh, base) = (mesh(false, &Solo), base_split(&Solo));
    mesh.rules.layer_cells_min = layer_cells_min;
    let (l, code) = choose(&mesh, &base);
    toggle(&mut mesh.split[l], code);
    splits::gradation(&mesh, &base, &Solo);
}

fn toggle(set: &mut BrickSet, code: u64) {
    if !set.contains(code) {
        return add(set, code);
    }
    set.retain(|b| if b.key == code >> 6 { b.bits & !(1 << (code & 63)) } else { b.bits });
}

/// An octant that only gradation has split, without split children.
fn graded_split(mesh: &Mesh, base: &PerLevel) -> (usize, u64) {
    let l = deepest(&mesh.split);
    let found = mesh.split[l].clone().without(&base[l]).codes().next();
    (l, found.expect("a split by gradation"))
}

#[test]
#[should_panic(expected = "must be split for a layer or balance")]
fn a_layer_that_lacks_an_octant_is_found() {
    check_gradation(4, graded_split);
}

#[test]
#[should_panic(expected = "must be split for a layer or balance")]
fn a_layer_that_is_too_thin_is_found() {
    check_gradation(7, |_, _| (0, 0));
}

#[test]
#[should_panic(expected = "is split without need")]
fn a_layer_that_is_too_thick_is_found() {
    check_gradation(2, graded_split);
}

#[test]
#[should_panic(expected = "no rule asks for level")]
fn a_leaf_deeper_than_all_rules_is_found() {
    check_gradation(4, |mesh, _| {
        let l = deepest(&mesh.split);
        (l + 1, mesh.split[l].codes().next().expect("an octant") << 3)
    });
}

#[test]
fn every_corruption_of_one_graded_octant_is_found() {
    let (mut mesh, base) = (mesh(false, &Solo), base_split(&Solo));
    splits::gradation(&mesh, &base, &Solo);
    let mut corrupted = 0;
    for l in 1..=deepest(&mesh.split) {
        let leaves = BrickSet::from_unsorted(Tree::exists(&mesh.split, l as Level).collect());
        let kept = leaves.without(&mesh.split[l]).without(&mesh.sides.stored[l]);
        let fresh = mesh.split[l].clone().without(&base[l]);
        for code in kept.codes().step_by(997).chain(fresh.codes().step_by(97)) {
            toggle(&mut mesh.split[l], code);
            let check = || splits::gradation(&mesh, &base, &Solo);
            let check = std::panic::AssertUnwindSafe(check);
            assert!(std::panic::catch_unwind(check).is_err(), "octant {code} of level {l}");
            toggle(&mut mesh.split[l], code);
            corrupted += 1;
        }
    }
    assert!(corrupted > 9, "{corrupted} octants");
}

#[test]
#[should_panic(expected = "is split, but its parent is not")]
fn a_graded_octant_without_a_parent_is_found() {
    let corrupt = |m: &mut Mesh| {
        let l = deepest(&m.split);
        let b = m.split[l].brick(0);
        remove(&mut m.split[l - 1], |key| key == b.key >> 3);
    };
    run(false, corrupt, check_graded);
}

#[test]
#[should_panic(expected = "must be split for a layer or balance")]
fn a_tree_without_gradation_is_not_balanced() {
    let check = |m: Mesh, comm: &dyn Comm| splits::gradation(&m, &m.split, comm);
    run(true, |m| m.rules.layer_cells_min = 1, check);
}

#[test]
#[should_panic(expected = "is on another side than a leaf across a face")]
fn a_side_that_differs_between_ranks_is_found() {
    let corrupt = |m: &mut Mesh| {
        // All that rank 1 owns changes sides; replicas agree.
        for l in 0..m.sides.stored.len() {
            let all = Tree::exists(&m.split, l as Level).collect();
            let open = BrickSet::from_unsorted(all).without(&m.split[l]).without(&m.crossing[l]);
            let mut flipped = open.without(&m.sides.stored[l]);
            let local = |b: &Brick| m.ownership.placement(l as Level, b.key) == Placement::Local;
            flipped.retain(|b| if local(&b) { b.bits } else { 0 });
            m.sides.stored[l].retain(|b| if local(&b) { 0 } else { b.bits });
            m.sides.stored[l] = std::mem::take(&mut m.sides.stored[l]).union(flipped);
        }
    };
    run(true, corrupt, check_sides);
}

#[test]
#[should_panic(expected = "has a seed, but is no flow")]
fn a_seed_that_is_no_flow_is_found() {
    let mut mesh = mesh(true, &Solo);
    let at_corner = Seed { given: [0.0; 3], lattice: [1; 3] };
    mesh.rules.seeds = vec![at_corner];
    let tree = Tree { split: mesh.split, crossing: mesh.crossing };
    let seeds = |rules: &Rules| {
        let (tree, ownership) = (&tree, &Ownership::solo());
        let base = Base { tree, ownership, facets: &[], rules, comm: &Solo };
        sides::seeds(&mesh.sides, &base);
    };
    seeds(&mesh.rules);
    seeds(&Rules { keep: Keep::Inside, ..mesh.rules.clone() });
}

#[test]
fn a_fingerprint_depends_on_the_mesh_alone() {
    let of = |ranks| sim::run(ranks, 1, |comm| fingerprint(&mesh(false, comm), comm));
    let one = of(1)[0];
    assert!(of(RANKS).iter().all(|f| *f == one));
    let mut other = mesh(false, &Solo);
    let l = deepest(&other.crossing);
    let key = other.crossing[l].brick(0).key;
    remove(&mut other.crossing[l], |k| k == key);
    assert_ne!(fingerprint(&other, &Solo), one);
}

#[test]
#[should_panic(expected = "leaves must be in order and must not overlap")]
fn overlapping_leaves_are_found() {
    is_linear(
        0,
        &[
            bricks::octant::word(1, 2, Side::Outside),
            bricks::octant::word(2, 2 << 3 | 7, Side::Outside),
        ],
    );
}

/// Checks the leaves after rank 1 has changed the mesh.
fn check_leaves(corrupt: impl Fn(&mut Mesh) + Sync, miscount: u64) {
    run(false, corrupt, |m, comm| {
        let (mut counts, ..) = finished::emit(&m, None, comm).expect("no interrupt");
        counts[0][0] += miscount;
        leaves(&m, &counts, comm);
    });
}

#[test]
fn sound_leaves_pass() {
    check_leaves(|_| (), 0);
}

#[test]
#[should_panic(expected = "counts must add up")]
fn a_leaf_counted_twice_is_found() {
    check_leaves(|_| (), 1);
}

#[test]
#[should_panic(expected = "leaves and deleted leaves must tile the root")]
fn a_deleted_octant_that_is_no_leaf_is_found() {
    let corrupt = |m: &mut Mesh| {
        let l = deepest(&m.sides.stored);
        let code = m.sides.stored[l].codes().find(|c| m.ownership.owns(l as Level, c >> 6));
        add(&mut m.sides.stored[l + 1], code.expect("a deleted leaf") << 3);
    };
    check_leaves(corrupt, 0);
}
