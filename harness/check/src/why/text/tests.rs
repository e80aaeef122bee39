use super::*;
use contract::lattice::Root;
use contract::octant::Octant;

/// The place of the octant with these digits, in a root of edge 16.
fn place(digits: &[u8]) -> Place {
    let octant = digits.iter().fold(Octant::ROOT, |octant, &digit| octant.child(digit));
    Place::new(&octant, &Root { origin: [0.0; 3], edge: 16.0 })
}

fn cause(digits: &[u8], facets: &[u32], facets_count: u64, boxes: &[usize]) -> Cause {
    let (facets, boxes) = (facets.to_vec(), boxes.to_vec());
    Cause { octant: place(digits), facets, facets_count, is_crossed: facets_count > 0, boxes }
}

fn link(rule: Rule, octant: &[u8], leaf: &[u8], distance_cells: i64) -> Link {
    Link { rule, octant: place(octant), leaf: place(leaf), distance_cells }
}

fn clauses(octant: &[u8], links: Vec<Link>, cause: Cause) -> String {
    Split { octant: place(octant), links, cause: Some(cause) }.clauses().join("\n")
}

#[test]
fn causes_are_facets_the_surface_and_boxes() {
    let of = |facets: &[u32], count, boxes: &[usize]| what(&cause(&[], facets, count, boxes));
    assert_eq!(of(&[4, 5], 9, &[]), "facets 4, 5 and 7 more cross it");
    assert_eq!(of(&[4, 5], 2, &[]), "facets 4, 5 cross it");
    assert_eq!(of(&[4], 1, &[0]), "facet 4 crosses it; box 0 meets it");
    assert_eq!(of(&[], 0, &[2]), "box 2 meets it");
    let both = Cause { is_crossed: true, ..cause(&[], &[], 0, &[1]) };
    assert_eq!(what(&both), "the surface crosses it; box 1 meets it");
}

#[test]
fn a_chain_is_printed_link_by_link() {
    assert_eq!(
        clauses(&[0], vec![], cause(&[0], &[7], 1, &[])),
        "by section 3: facet 7 crosses it"
    );
    let first = link(Rule::Layer, &[0], &[1, 0, 0], 1);
    let second = link(Rule::Balance, &[1, 0], &[1, 0, 0, 0], 0);
    let expected = "by section 6, step 2 (layer): only 1 cell of level 3 away is the leaf octant 1.0.0 (level 3), (8, 0, 0) to (10, 2, 2)\n\
            its parent is split by section 6, step 3 (balance): it touches the leaf octant 1.0.0.0 (level 4), (8, 0, 0) to (9, 1, 1), 2 levels finer\n\
            its parent is split by section 3: facet 7 crosses it";
    let chain = clauses(&[0], vec![first, second], cause(&[1, 0, 0], &[7], 1, &[]));
    assert_eq!(chain, expected);
    let extra = link(Rule::ExtraLayer, &[0, 3, 1], &[1, 0, 3, 0], 0);
    let expected = "by section 6 (extra layer): it touches the deleted crossing leaf octant 1.0.3.0 (level 4), (10, 2, 0) to (11, 3, 1)\n\
            it is crossing by section 4: facet 7 crosses it";
    assert_eq!(clauses(&[0, 3, 1], vec![extra], cause(&[1, 0, 3, 0], &[7], 1, &[])), expected);
}
