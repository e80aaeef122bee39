use super::*;
use crate::why::answer::{Deletion, Place, SCHEMA};
use contract::lattice::Root;
use contract::octant::Octant;
use contract::word::Side;

/// The place of the octant with these digits, in a root of edge 16.
fn place(digits: &[u8]) -> Place {
    let octant = digits.iter().fold(Octant::ROOT, |octant, &digit| octant.child(digit));
    Place::new(&octant, &Root { origin: [0.0; 3], edge: 16.0 })
}

fn cause(digits: &[u8], facets: &[u32], count: u64, boxes: &[usize]) -> CauseRecord {
    let (facets, boxes) = (facets.to_vec(), boxes.to_vec());
    CauseRecord {
        section: "3",
        octant: place(digits),
        facets,
        facets_count: count,
        is_crossed: count > 0,
        boxes,
    }
}

fn link(rule: &'static str, octant: &[u8], leaf: &[u8], distance_cells: i64) -> LinkRecord {
    LinkRecord { rule, section: "6", octant: place(octant), leaf: place(leaf), distance_cells }
}

fn split(octant: &[u8], links: Vec<LinkRecord>, cause: Option<CauseRecord>) -> Split {
    Split { octant: place(octant), links, cause }
}

fn answer(splits: Vec<Split>) -> Answer {
    Answer {
        schema: SCHEMA,
        point: [1.0, 2.0, 0.5],
        leaf: Some(place(&[0, 3])),
        base_leaf: Some(place(&[0])),
        side: Some(Side::Outside),
        side_decided_by: SideReason::Unknown,
        deleted_by: None,
        splits,
        left_out: Vec::new(),
        layer_cells_min: 4,
    }
}

const TERMS: &str = "\n\nterms\n  section: of reference/DEFINITION.md, the definition of the mesh\n  \
        T0: the base tree, which facets and boxes alone require; layers and balance refine it\n  \
        octant 3.1.4: the root's child 3, of that the child 1, of that the child 4; a child in the upper half in x counts 1, in y 2, in z 4";

const HEAD: &str = "(1, 2, 0.5) lies in the outside leaf octant 0.3 (level 2), (4, 4, 0) to (8, 8, 4)\n  edge 4.00\n\nsize\n";

/// The lines on the size, of a leaf whose side is not explained.
fn sizes(splits: Vec<Split>) -> String {
    let text = answer(splits).to_string();
    let text = text.strip_prefix(HEAD).unwrap_or_else(|| panic!("{text}"));
    text.strip_suffix(&format!("side\n  not explained{TERMS}"))
        .unwrap_or_else(|| panic!("{text}"))
        .to_owned()
}

#[test]
fn splits_of_the_base_tree_share_the_cause_of_the_finest() {
    assert_eq!(sizes(vec![]), "  the leaf is the root: nothing splits it\n");
    let root = split(&[], vec![], Some(cause(&[], &[7], 1, &[])));
    assert_eq!(
        sizes(vec![root.clone()]),
        "  level 0: the root is split by section 3: facet 7 crosses it\n"
    );
    let finest = split(&[0], vec![], Some(cause(&[0], &[1, 2], 2, &[])));
    let expected = "  levels 0 to 1: octant 0 (level 1), (0, 0, 0) to (8, 8, 8) and its ancestors are split by section 3: \
            facets 1, 2 cross it, each of which suffices\n";
    assert_eq!(sizes(vec![root, finest]), expected);
    let unknown = "  level 1: octant 0 (level 1), (0, 0, 0) to (8, 8, 8) is split\n    \
            no rule that is known requires it (harness why --unneeded)\n";
    assert_eq!(sizes(vec![split(&[0], vec![], None)]), unknown);
}

#[test]
fn causes_are_facets_the_surface_and_boxes() {
    let of = |facets: &[u32], count, boxes: &[usize]| what(&cause(&[], facets, count, boxes));
    assert_eq!(of(&[4, 5], 9, &[]), "facets 4, 5 and 7 more cross it, each of which suffices");
    assert_eq!(of(&[4], 1, &[0]), "facet 4 crosses it; box 0 meets it, each of which suffices");
    assert_eq!(of(&[], 0, &[2]), "box 2 meets it");
    assert_eq!(
        what(&CauseRecord { is_crossed: true, ..cause(&[], &[], 0, &[]) }),
        "the surface crosses it"
    );
    let both = CauseRecord { is_crossed: true, ..cause(&[], &[], 0, &[1]) };
    assert_eq!(what(&both), "the surface crosses it; box 1 meets it, each of which suffices");
}

#[test]
fn a_chain_is_printed_link_by_link_and_what_it_shares_by_reference() {
    let end = || Some(cause(&[1, 0], &[7], 1, &[]));
    let shared = || link("balance", &[1, 0], &[1, 0, 0, 0], 0);
    let first = split(&[0], vec![link("layer", &[0], &[1, 0, 0], 1), shared()], end());
    let second = split(&[0, 3], vec![link("layer", &[0, 3], &[1, 0, 2], 2), shared()], end());
    let third = split(&[0, 3, 1], vec![link("extra_layer", &[0, 3, 1], &[1, 0, 3, 0], 0)], end());
    let touching =
        split(&[0], vec![link("layer", &[0], &[1, 0, 0], 0)], Some(cause(&[1], &[], 0, &[3])));
    let text = sizes(vec![first, second, third, touching]);
    let expected = "  level 1: octant 0 (level 1), (0, 0, 0) to (8, 8, 8) is split\n    \
            by section 6 (layer): only 1 cell of level 3 away is the leaf octant 1.0.0 (level 3), (8, 0, 0) to (10, 2, 2)\n    \
            its parent is split by section 6 (balance): it touches the leaf octant 1.0.0.0 (level 4), (8, 0, 0) to (9, 1, 1), 2 levels finer\n    \
            its parent is split by section 3: facet 7 crosses it\n    a chain of 2 leaves\n  \
            level 2: octant 0.3 (level 2), (4, 4, 0) to (8, 8, 4) is split\n    \
            by section 6 (layer): only 2 cells of level 3 away is the leaf octant 1.0.2 (level 3), (8, 2, 0) to (10, 4, 2)\n    \
            its parent is split as in the chain of level 1\n    a chain of 2 leaves\n  \
            level 3: octant 0.3.1 (level 3), (6, 4, 0) to (8, 6, 2) is split\n    \
            by section 6 (extra layer): it touches the deleted crossing leaf octant 1.0.3.0 (level 4), (10, 2, 0) to (11, 3, 1)\n    \
            it is crossing by section 4: facet 7 crosses it\n    a chain of 1 leaf\n  \
            level 1: octant 0 (level 1), (0, 0, 0) to (8, 8, 8) is split\n    \
            by section 6 (layer): it touches the leaf octant 1.0.0 (level 3), (8, 0, 0) to (10, 2, 2)\n    \
            its parent is split by section 3: box 3 meets it\n    a chain of 1 leaf\n";
    assert_eq!(text, expected);
}

#[test]
fn only_a_chain_with_the_same_end_and_cause_is_referred_to() {
    let other = |from: &[u8], facet| {
        let links =
            vec![link("layer", from, &[1, 0, 0], 1), link("balance", &[1, 0], &[1, 0, 0, 0], 0)];
        split(from, links, Some(cause(&[1, 0], &[facet], 1, &[])))
    };
    let by_reference = "as in the chain of level 1";
    assert!(sizes(vec![other(&[0], 7), other(&[0, 3], 7)]).contains(by_reference));
    assert!(!sizes(vec![other(&[0], 7), other(&[0, 3], 8)]).contains(by_reference));
    let mut longer = other(&[0, 3], 7);
    longer.links.push(link("balance", &[1], &[1, 1, 1], 0));
    assert!(!sizes(vec![other(&[0], 7), longer]).contains(by_reference));
}

/// The beginning up to the size, and the end from the side on, without the terms.
fn ends(answer: &Answer) -> (String, String) {
    let text = answer.to_string();
    let (head, rest) = text.split_once("\nsize\n").unwrap();
    let (_, side) = rest.split_once("side\n").unwrap();
    (head.to_owned(), side.strip_suffix(TERMS).unwrap_or(side).to_owned())
}

#[test]
fn a_deleted_part_has_the_rule_that_deletes_it() {
    let mut deleted = answer(vec![]);
    (deleted.leaf, deleted.side) = (None, None);
    deleted.deleted_by = Some(Deletion { section: "5", rule: "the rule".to_owned() });
    deleted.left_out = vec!["one thing".to_owned(), "another".to_owned()];
    let (head, side) = ends(&deleted);
    assert_eq!(
        head,
        "(1, 2, 0.5) lies in a deleted leaf of T0: octant 0 (level 1), (0, 0, 0) to (8, 8, 8)\n  \
             deleted by section 5: the rule\n"
    );
    assert_eq!(side, "  not explained\nleft out: one thing\nleft out: another");
    deleted.base_leaf = None;
    assert!(
        ends(&deleted).0.starts_with("(1, 2, 0.5) lies in a part of the root that was deleted\n")
    );
    assert!(!deleted.to_string().contains("nothing splits it"));
}

#[test]
fn a_side_is_decided_by_facets_or_by_the_component() {
    let mut crossing = answer(vec![]);
    crossing.side_decided_by = SideReason::Facets { facets: vec![3], facets_count: 1 };
    let of_base = "  crossing by section 4: facet 3 crosses the leaf of T0 that was split into it, \
            octant 0 (level 1), (0, 0, 0) to (8, 8, 8)";
    assert_eq!(ends(&crossing).1, of_base);
    crossing.base_leaf = crossing.leaf.clone();
    assert_eq!(ends(&crossing).1, "  crossing by section 4: facet 3 crosses the leaf");

    let mut component = answer(vec![]);
    let reason = |side, candidate| SideReason::Component {
        side,
        decision: "the decision".to_owned(),
        candidate,
        rays_odd: None,
        seed: None,
        leaves: 5,
    };
    component.side_decided_by = reason(Side::Outside, None);
    assert_eq!(
        ends(&component).1,
        "  outside by section 4: the decision\n  the component has 5 leaves of T0"
    );
    component.side_decided_by = reason(Side::Inside, Some(place(&[2])));
    let side = "  inside by section 4: the decision\n  candidate: octant 2 (level 1), (0, 8, 0) to (8, 16, 8)\n  \
            the component has 5 leaves of T0\n  but the mesh has the side outside here";
    let terms = "\n  component: the leaves of T0 that no facet crosses and that shared faces join; all have one side\n  \
            candidate: the leaf of the component from whose centre rays count facets";
    assert_eq!(ends(&component).1, format!("{side}{TERMS}{terms}"));
}
