use super::*;
use crate::case::{Case, RootSpec};
use crate::comm::{Solo, sim};
use crate::ingest::{self, Source};
use crate::lattice::Bounds;
use crate::lattice::{Enclosed, Keep};
use crate::octant::Side;
use crate::partition::{Division, Partitioner, Weights};
use crate::record::Recorder;
use crate::report::Counters;
use crate::{leaves as finished, octant, refine};

const RANKS: usize = 4;

fn case() -> Case {
    let torus = toml::from_str("shape = \"torus\"\nfacets = 640").expect("a generator");
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
    let (partitioner, weights) = (Partitioner::Morton, Weights::Rebalance);
    let division = Division { partitioner, weights, level_base: None };
    Options {
        division,
        ungraded,
        out: None,
        check: true,
        weight_exposed: None,
        force: true,
        strict: false,
        case_name: String::new(),
    }
}

fn mesh(ungraded: bool, comm: &dyn Comm) -> Mesh {
    let (mut record, mut counters) = (Recorder::default(), Counters::default());
    crate::make(&case(), &options(ungraded), comm, &mut record, &mut counters).expect("a good case")
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
    let Mesh { split, crossing, ownership, rules, .. } = mesh;
    base_tree(&Tree { split, crossing }, &rules, &ownership, comm);
}

fn check_sides(mesh: Mesh, comm: &dyn Comm) {
    let Mesh { split, crossing, sides: s, ownership, .. } = mesh;
    sides(&s, &Tree { split, crossing }, &ownership, comm);
}

fn check_graded(mesh: Mesh, comm: &dyn Comm) {
    graded(&mesh, None, comm);
}

/// The deepest level with octants in a set.
fn deepest(sets: &PerLevel) -> usize {
    sets.iter().rposition(|s| !s.is_empty()).expect("an octant")
}

/// Adds one octant to a set.
fn add(set: &mut BrickSet, code: u64) {
    *set = std::mem::take(set).union(BrickSet::from_unsorted(vec![as_brick(code)]));
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
    run(true, |m| m.rules.root.edge *= 1.0 + f64::EPSILON, |m, comm| rules(&m.rules, comm));
}

#[test]
#[should_panic(expected = "partition boundaries must be the same on all ranks")]
fn different_partitions_are_found() {
    let corrupt = |m: &mut Mesh| {
        let mut boundaries: Vec<_> = m.ownership.boundaries().collect();
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
        let slice = ingest::read(&case().source, comm).expect("a good case");
        let bounds = Bounds::of(&slice.facets);
        let local = mesh.rules.root.facets(slice.facets, &bounds, 0).expect("near the root");
        let mut routed = refine::route(&local, &mesh.ownership, comm);
        if comm.rank() == 1 {
            corrupt(&mut routed);
        }
        facets(&local, &routed, &mesh.ownership, comm);
    });
}

#[test]
#[should_panic(expected = "facets must be on all ranks whose octants they reach")]
fn a_facet_that_a_rank_misses_is_found() {
    check_facets(|routed| _ = routed.pop());
}

#[test]
#[should_panic(expected = "a rank's facets must reach its octants")]
fn a_facet_on_the_wrong_rank_is_found() {
    check_facets(|routed| routed.push(Facet { v: [[1; 3], [2, 1, 1], [1, 2, 1]] }));
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
    for l in (2..crate::tree::LEVELS as Level).rev() {
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
        let view = if comm.rank() == 1 { m.ownership.non_owning_view() } else { m.ownership };
        replicas(&[&m.crossing], &view, comm);
    };
    run(true, |_| (), check);
}

#[test]
#[should_panic(expected = "leaves must tile the root")]
fn leaves_that_overlap_a_coarser_one_are_found() {
    let mut mesh = mesh(true, &Solo);
    let l = deepest(&mesh.split);
    let b = mesh.split[l].brick(0);
    remove(&mut mesh.split[l - 1], |key| key == b.key >> 3);
    is_complete(&mesh.split, &mesh.ownership, &Solo);
}

#[test]
#[should_panic(expected = "has a side, but is no leaf off the surface")]
fn a_crossing_leaf_that_is_deleted_is_found() {
    run(true, |m| m.sides.inside = m.crossing.clone(), check_sides);
}

#[test]
#[should_panic(expected = "is in the set that this choice of sides leaves empty")]
fn leaves_stored_as_inside_and_as_deleted_are_found() {
    run(true, |m| m.sides.deleted = m.sides.inside.clone(), check_sides);
}

#[test]
#[should_panic(expected = "results of sides must be the same on all ranks")]
fn different_numbers_of_components_are_found() {
    run(true, |m| m.sides.summary.outside += 1, check_sides);
}

#[test]
#[should_panic(expected = "deleted leaves must not split")]
fn a_deleted_leaf_that_is_split_is_found() {
    let corrupt = |m: &mut Mesh| {
        let l = deepest(&m.sides.deleted);
        let code = m.sides.deleted[l].codes().next().expect("a deleted leaf");
        add(&mut m.split[l], code);
    };
    run(false, corrupt, check_graded);
}

#[test]
#[should_panic(expected = "octants split in T0 must be split in the graded tree")]
fn a_split_that_gradation_has_lost_is_found() {
    let mesh = mesh(false, &Solo);
    let mut base = mesh.split.clone();
    let l = deepest(&base);
    let code = base[l].codes().next().expect("a split octant") << 3;
    add(&mut base[l + 1], code);
    graded(&mesh, Some(&base), &Solo);
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
#[should_panic(expected = "must be split: a leaf two levels deeper touches it")]
fn a_tree_without_gradation_is_not_balanced() {
    run(true, |_| (), |m, comm| is_balanced(&m.split, &m.sides.deleted, &m.ownership, comm));
}

/// Octant 63 of level 2 is deep, octant 7 of level 1 touches it at one corner only: over a corner, balance is violated too.
#[test]
fn imbalance_is_found_over_corners_and_not_in_deleted_leaves() {
    let set = |codes: &[u64]| BrickSet::from_unsorted(codes.iter().map(|c| as_brick(*c)).collect());
    let mut split = crate::tree::per_level();
    // From the root down along the minimum corner's diagonal to the root's centre.
    split[0] = set(&[0]);
    split[1] = set(&[0]);
    split[2] = set(&[7]);
    let none = crate::tree::per_level();
    let touching = |deleted: &PerLevel| {
        let view = Ownership::solo();
        std::panic::catch_unwind(|| is_balanced(&split, deleted, &view, &Solo)).is_err()
    };
    assert!(touching(&none));
    let mut deleted = crate::tree::per_level();
    deleted[1] = set(&[1, 2, 3, 4, 5, 6]);
    assert!(touching(&deleted), "octant 7 touches over a corner");
    deleted[1] = set(&[1, 2, 3, 4, 5, 6, 7]);
    assert!(!touching(&deleted));
}

/// For each octant of level 2, and two levels deeper each octant in it, and all of them.
#[test]
fn octants_touched_are_those_with_a_common_point() {
    for code in 0..64 {
        let p = position(code);
        for inner in (0..64).map(|bit| 1 << bit).chain([0, u64::MAX]) {
            let touch = |q: u64| {
                let q = position(q);
                crate::brickset::ones(inner).any(|bit| {
                    let fine = position(u64::from(bit));
                    let at: [u32; 3] = std::array::from_fn(|a| 4 * p[a] + fine[a]);
                    (0..3).all(|a| at[a] <= 4 * q[a] + 4 && at[a] + 1 >= 4 * q[a])
                })
            };
            let want: BTreeSet<u64> = (0..64).filter(|&q| q != code && touch(q)).collect();
            let got: BTreeSet<u64> = octants_touched(2, code, inner).collect();
            assert_eq!(got, want, "octant {code}, inner {inner:#x}");
        }
    }
}

#[test]
#[should_panic(expected = "leaves must be in order and must not overlap")]
fn overlapping_leaves_are_found() {
    is_linear(0, &[octant::word(1, 2, Side::Outside), octant::word(2, 2 << 3 | 7, Side::Outside)]);
}

/// Checks the leaves after rank 1 has changed the mesh.
fn check_leaves(corrupt: impl Fn(&mut Mesh) + Sync, miscount: u64) {
    run(false, corrupt, |m, comm| {
        let (mut counts, written) = finished::emit(&m, None, comm).expect("no interrupt");
        counts.by_level[0][0] += miscount;
        leaves(&m, &counts, &written, comm);
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
        let l = deepest(&m.sides.deleted);
        let code = m.sides.deleted[l].codes().find(|c| m.ownership.owns(l as Level, c >> 6));
        add(&mut m.sides.deleted[l + 1], code.expect("a deleted leaf") << 3);
    };
    check_leaves(corrupt, 0);
}

#[test]
#[should_panic(expected = "leaves by level and by rank must add up")]
fn totals_that_differ_are_found() {
    let m = mesh(false, &Solo);
    let (counts, written) = finished::emit(&m, None, &Solo).expect("no interrupt");
    let mut all = finished::finish(&m, &counts, &written, None, &Solo).expect("no output");
    totals(&all, &written, &Solo);
    all.parts[0][0] += 1;
    totals(&all, &written, &Solo);
}
