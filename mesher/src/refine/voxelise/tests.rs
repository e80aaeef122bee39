use super::*;

#[test]
#[should_panic(expected = "facets must be sorted by containing octant")]
fn facets_out_of_order_are_found() {
    let facet = |c: i32| Facet { v: [[c; 3]; 3] };
    let mut binned = BinnedFacets::new(&[facet(9000), facet(100)]);
    binned.check_invariants();
    binned.containing.swap(0, 1);
    binned.check_invariants();
}

#[test]
#[should_panic(expected = "facet 1, binned at")]
fn a_facet_in_the_wrong_bin_is_found() {
    let facet = |c: i32| Facet { v: [[c; 3]; 3] };
    let mut binned = BinnedFacets::new(&[facet(9000), facet(100)]);
    binned.facets[1] = facet(20_000);
    binned.check_invariants();
}

#[test]
fn runs_of_every_length_end_before_their_end() {
    let all: Vec<ContainingOctant> = (0..40).map(|i| ContainingOctant(i / 2)).collect();
    for length in 0..all.len() {
        for end in 0..22 {
            let containing = &all[..length];
            let want = containing.iter().take_while(|h| h.0 < end).count();
            assert_eq!(run_length(containing, ContainingOctant(end)), want, "{length}, {end}");
        }
    }
}

#[test]
fn values_are_those_of_the_proofs() {
    let of = |a: &[i128]| {
        let v = [0, 3, 6].map(|i| [0, 1, 2].map(|axis| a[i + axis] as i32));
        ContainingOctant::of(&Facet { v }).map(|octant| octant.0.into()).into_iter().collect()
    };
    crate::values::compare("src/refine/voxelise.rs", &[("of", &of)]);
}
