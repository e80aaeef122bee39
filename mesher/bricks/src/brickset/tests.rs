//! Tests of brick sets: against maps, and of the check of their invariants.

use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

/// The set of octants with these codes.
pub fn set<'a>(codes: impl IntoIterator<Item = &'a u64>) -> BrickSet {
    let brick = |c: &u64| Brick { key: c >> 6, bits: 1 << (c & 63) };
    BrickSet::from_unsorted(codes.into_iter().map(brick).collect())
}

#[test]
fn codes_are_sorted_and_unique() {
    let s = set(&[900, 3, 64, 3, 5, 65]);
    s.check_invariants();
    assert_eq!(s.codes().collect::<Vec<_>>(), [3, 5, 64, 65, 900]);
    assert_eq!(s.count(), 5);
    assert!(s.contains(900) && !s.contains(4));
}

#[test]
fn coarsening_the_children_of_a_set_gives_the_set() {
    let s = set(&[3, 5, 64, 900, 70_000]);
    assert_eq!(s.coarsen().codes().collect::<Vec<_>>(), [0, 8, 112, 8_750]);
    let mut kids = BrickSet::default();
    s.child_bricks().for_each(|b| kids.push(b.key, b.bits));
    assert_eq!(kids.coarsen(), s);
    assert_eq!(kids.count(), 8 * s.count());
}

#[test]
fn unions_and_cursors_agree_with_lookups() {
    let (a, b) = (set(&[1, 70, 200, 5000]), set(&[2, 70, 300]));
    let u = a.clone().union(b);
    assert_eq!(u.codes().collect::<Vec<_>>(), [1, 2, 70, 200, 300, 5000]);
    let many = set(&(0..100_000).step_by(77).collect::<Vec<_>>());
    for stride in [1, 3, 50, 400] {
        let mut c = many.cursor();
        for key in (0..1600).step_by(stride) {
            assert_eq!(c.get(key), many.get(key), "key {key} stride {stride}");
            assert_eq!(c.get(key), many.get(key), "repeated query");
        }
    }
}

/// Bricks of a few runs, with keys at both ends of the runs.
fn bricks() -> impl Strategy<Value = BTreeMap<u64, u64>> {
    let key = (0u64..4, prop_oneof![0u64..6, (1u64 << LOW_BITS) - 3..1 << LOW_BITS])
        .prop_map(|(high, low)| high << LOW_BITS | low);
    prop::collection::btree_map(key, 1u64..8, 0..24)
}

fn of(bricks: &BTreeMap<u64, u64>) -> BrickSet {
    BrickSet::from_unsorted(bricks.iter().map(|(&key, &bits)| Brick { key, bits }).collect())
}

proptest! {
    #[test]
    fn a_condensed_set_reads_as_before(partial in bricks(), full in bricks()) {
        let full = full.into_keys().map(|key| (key, u64::MAX));
        let all: BTreeMap<u64, u64> = partial.into_iter().chain(full).collect();
        let plain = of(&all);
        let mut condensed = plain.clone();
        condensed.condense();
        condensed.check_invariants();
        prop_assert!(condensed.bricks().eq(plain.bricks()));
        prop_assert_eq!(condensed.count(), plain.count());
        prop_assert_eq!(condensed.is_empty(), plain.is_empty());
        let (mut here, mut there) = (condensed.cursor(), plain.cursor());
        for key in all.keys().flat_map(|key| [*key, *key, key + 1]) {
            prop_assert_eq!(condensed.get(key), plain.get(key));
            prop_assert_eq!(here.get(key), there.get(key));
        }
    }

    #[test]
    fn sets_of_several_runs_behave_like_maps(a in bricks(), b in bricks(), mask in 0u64..8) {
        let (x, y) = (of(&a), of(&b));
        x.check_invariants();
        let (mut both, mut without, mut kept) = (a.clone(), a.clone(), a.clone());
        b.iter().for_each(|(k, v)| *both.entry(*k).or_default() |= v);
        without.iter_mut().for_each(|(k, v)| *v &= !b.get(k).unwrap_or(&0));
        without.retain(|_, v| *v != 0);
        kept.retain(|k, v| (*v & mask != 0) && k % 3 != 0);
        prop_assert_eq!(x.clone().union(y.clone()), of(&both));
        prop_assert_eq!(x.clone().without(&y), of(&without));
        let mut some = x.clone();
        some.retain(|b| if b.key % 3 != 0 && b.bits & mask != 0 { b.bits } else { 0 });
        prop_assert_eq!(some, of(&kept));
        prop_assert!(x.bricks().map(|b| (b.key, b.bits)).eq(a.iter().map(|(k, v)| (*k, *v))));
        let key = b.keys().nth(b.len() / 2).copied().unwrap_or(3);
        let (i, j) = (x.position(key), x.position(2 * key));
        prop_assert_eq!((i, j), (a.range(..key).count(), a.range(..2 * key).count()));
        prop_assert!((0..x.len()).map(|i| x.brick(i)).eq(x.bricks()));
        prop_assert_eq!(x.count(), a.values().map(|bits| u64::from(bits.count_ones())).sum::<u64>());
        let intervals = [0..i, i..j, j..x.len()].map(|range| {
            let interval = x.clone().keep(range);
            interval.check_invariants();
            interval
        });
        let [before, middle, after] = intervals;
        let around = before.clone().union(after.clone());
        prop_assert_eq!(around.union(middle.clone()), x.clone());
        prop_assert_eq!(after.union(middle).union(before), x.clone());
        prop_assert_eq!(y.union(x.clone()), of(&both));
        let mut cursor = x.cursor();
        for key in both.keys() {
            let want = a.get(key).copied().unwrap_or(0);
            prop_assert_eq!((cursor.get(*key), x.get(*key)), (want, want));
        }
    }
}

#[test]
#[should_panic(expected = "brick 0x1 must follow brick 0x3")]
fn keys_out_of_order_are_found() {
    let mut s = set(&[64, 3 * 64]);
    s.low.swap(0, 1);
    s.check_invariants();
}

#[test]
#[should_panic(expected = "brick 0x1 must not be empty")]
fn an_empty_brick_is_found() {
    let mut s = set(&[64, 3 * 64]);
    s.bits[0] = 0;
    s.check_invariants();
}

#[test]
#[should_panic(expected = "each run must have a brick")]
fn an_empty_run_is_found() {
    let mut s = set(&[64, 64 << LOW_BITS]);
    s.runs[1].start = 0;
    s.check_invariants();
}

#[test]
fn leading_elements_are_counted_for_every_length() {
    let all: Vec<u32> = (0..40).collect();
    for (length, end) in (0..40).flat_map(|length| (0..42).map(move |end| (length, end))) {
        let found = leading(&all[..length], |low| low < end);
        assert_eq!(found, length.min(end as usize), "{length}, {end}");
    }
}

#[test]
fn more_octants_than_2_to_the_37th_are_counted_and_found() {
    // All octants of level 0, 2, 4, ..., 18, each set stored as that before it.
    let mut all: BrickSet = [Brick { key: 0, bits: 1 }].into_iter().collect();
    for level in (2..=18).step_by(2) {
        let mut finer = BrickSet::default();
        assert!(finer.replace_full(all).is_empty());
        all = finer;
        assert_eq!(all.count(), 1 << (3 * level));
    }
    assert_eq!(all.bytes(), 12);
    let last = (1 << (3 * 16)) - 1;
    let mut cursor = all.cursor();
    for (key, bits) in [(0, u64::MAX), (1 << 40, u64::MAX), (last, u64::MAX), (last + 1, 0)] {
        assert_eq!((all.get(key), cursor.get(key)), (bits, bits), "{key:#x}");
    }
    assert!(all.bricks().take(100).eq((0..100).map(|key| Brick { key, bits: u64::MAX })));
}

#[test]
#[should_panic(expected = "is only read")]
fn a_condensed_set_is_not_changed() {
    let mut set: BrickSet = [Brick { key: 3, bits: u64::MAX }].into_iter().collect();
    set.condense();
    assert_eq!((set.count(), set.bytes()), (64, 12));
    set.retain(|b| b.bits);
}
