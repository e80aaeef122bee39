//! The answer for a terminal.

use std::fmt;

use super::answer::{Answer, CauseRecord, LinkRecord, SideReason, Split, user_place};
use crate::geometry::meaning::number;

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.point;
        match (&self.leaf, self.side, &self.base_leaf) {
            (Some(leaf), Some(side), _) => {
                let edge = number(leaf.max[0] - leaf.min[0]);
                writeln!(f, "({x}, {y}, {z}) lies in the {side} leaf {}", user_place(leaf))?;
                writeln!(f, "  edge {edge}")?;
            }
            (_, _, Some(base)) => {
                writeln!(f, "({x}, {y}, {z}) lies in a deleted leaf of T0: {}", user_place(base))?;
            }
            _ => writeln!(f, "({x}, {y}, {z}) lies in a part of the root that was deleted")?,
        }
        if let Some(deletion) = &self.deleted_by {
            writeln!(f, "  deleted by section {}: {}", deletion.section, deletion.rule)?;
        }
        self.sizes(f)?;
        self.side(f)?;
        for what in &self.left_out {
            write!(f, "\nleft out: {what}")?;
        }
        self.terms(f)
    }
}

impl Answer {
    fn sizes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nsize")?;
        let by_base = |split: &&Split| split.links.is_empty() && split.cause.is_some();
        let of_base = self.splits.iter().take_while(by_base).count();
        if let Some(Split { octant, cause: Some(cause), .. }) = self.splits[..of_base].last() {
            match octant.level {
                0 => writeln!(f, "  level 0: the root is split by section 3: {}", what(cause))?,
                level => writeln!(
                    f,
                    "  levels 0 to {level}: {} and its ancestors are split by section 3: {}",
                    user_place(octant),
                    what(cause)
                )?,
            }
        }
        let graded = &self.splits[of_base..];
        for (i, split) in graded.iter().enumerate() {
            writeln!(f, "  level {}: {} is split", split.octant.level, user_place(&split.octant))?;
            let Some(cause) = &split.cause else {
                writeln!(f, "    no rule that is known requires it (harness why --unneeded)")?;
                continue;
            };
            // Chains of successive levels often end alike.
            let continued = |other: &&Split| {
                other.links.get(1..) == split.links.get(1..) && other.cause == split.cause
            };
            match (split.links.first(), graded[..i].iter().find(continued)) {
                (Some(link), Some(other)) if link.rule != "extra_layer" => {
                    let level = other.octant.level;
                    writeln!(f, "    {}", sentence(link))?;
                    writeln!(f, "    its parent is split as in the chain of level {level}")?;
                }
                _ => links(split, cause, f)?,
            }
            let links = split.links.len();
            let noun = if links == 1 { "leaf" } else { "leaves" };
            match split.is_shortest {
                true => writeln!(f, "    the shortest chain: {links} {noun}")?,
                false => writeln!(f, "    a chain of {links} {noun}; a shorter one may exist")?,
            }
        }
        match &self.splits[..] {
            [] if self.leaf.is_some() => writeln!(f, "  the leaf is the root: nothing splits it"),
            _ => Ok(()),
        }
    }

    /// The terms that the answer uses.
    fn terms(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "\n\nterms\n  section: of reference/DEFINITION.md, the definition of the mesh\n  T0: the base tree, which facets and \
             boxes alone require; layers and balance refine it\n  octant 3.1.4: the root's child 3, of that the child 1, of \
             that the child 4; a child in the upper half in x counts 1, in y 2, in z 4"
        )?;
        match &self.side_decided_by {
            SideReason::Component { candidate: Some(_), .. } => write!(
                f,
                "\n  component: the leaves of T0 that no facet crosses and that shared faces join; all have one side\n  \
                 candidate: the leaf of the component from whose centre rays count facets"
            ),
            _ => Ok(()),
        }
    }

    fn side(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.side_decided_by {
            SideReason::Facets { facets, facets_count } => {
                write!(
                    f,
                    "side\n  crossing by section 4: {} the leaf",
                    crossed(facets, *facets_count)
                )?;
                match (&self.leaf, &self.base_leaf) {
                    (Some(leaf), Some(base)) if leaf != base => {
                        write!(f, " of T0 that was split into it, {}", user_place(base))
                    }
                    _ => Ok(()),
                }
            }
            SideReason::Component {
                side,
                decision,
                candidate,
                leaves_visited,
                is_complete,
                ..
            } => {
                write!(f, "side\n  {side} by section 4: {decision}")?;
                if let Some(candidate) = candidate {
                    write!(f, "\n  candidate: {}", user_place(candidate))?;
                }
                let part = if *is_complete { "has" } else { "has at least" };
                write!(f, "\n  the component {part} {leaves_visited} leaves of T0")?;
                match self.side {
                    Some(found) if found != *side => {
                        write!(f, "\n  but the mesh has the side {found} here")
                    }
                    _ => Ok(()),
                }
            }
            SideReason::Unknown => write!(f, "side\n  not explained"),
        }
    }
}

/// The links of a chain and the cause at its end.
fn links(split: &Split, cause: &CauseRecord, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    for (i, link) in split.links.iter().enumerate() {
        let subject = if i == 0 { "" } else { "its parent is split " };
        writeln!(f, "    {subject}{}", sentence(link))?;
    }
    let subject = match split.links.last() {
        Some(link) if link.rule == "extra_layer" => "it is crossing by section 4",
        _ => "its parent is split by section 3",
    };
    writeln!(f, "    {subject}: {}", what(cause))
}

/// A link as a clause.
fn sentence(link: &LinkRecord) -> String {
    let leaf = user_place(&link.leaf);
    let (section, level) = (link.section, link.leaf.level);
    match link.rule {
        "layer" if link.distance_cells == 0 => {
            format!("by section {section} (layer): it touches the leaf {leaf}")
        }
        "layer" => {
            let cells = if link.distance_cells == 1 { "cell" } else { "cells" };
            format!(
                "by section {section} (layer): only {} {cells} of level {level} away is the leaf {leaf}",
                link.distance_cells
            )
        }
        "balance" => format!(
            "by section {section} (balance): it touches the leaf {leaf}, {} levels finer",
            level - link.octant.level
        ),
        _ => format!(
            "by section {section} (extra layer): it touches the deleted crossing leaf {leaf}"
        ),
    }
}

/// A cause as a clause.
fn what(cause: &CauseRecord) -> String {
    let facets = match cause.facets_count {
        0 if cause.is_crossed => vec!["the surface crosses it".to_owned()],
        0 => vec![],
        count => vec![format!("{} it", crossed(&cause.facets, count))],
    };
    let boxes = cause.boxes.iter().map(|index| format!("box {index} meets it"));
    let causes: Vec<String> = facets.into_iter().chain(boxes).collect();
    let each =
        if causes.len() > 1 || cause.facets_count > 1 { ", each of which suffices" } else { "" };
    causes.join("; ") + each
}

/// Facets as subject and verb.
fn crossed(facets: &[u32], count: u64) -> String {
    let numbers: Vec<String> = facets.iter().map(ToString::to_string).collect();
    match (count, count - facets.len() as u64) {
        (1, _) => format!("facet {} crosses", numbers[0]),
        (_, 0) => format!("facets {} cross", numbers.join(", ")),
        (_, more) => format!("facets {} and {more} more cross", numbers.join(", ")),
    }
}

#[cfg(test)]
mod tests {
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
        Split { octant: place(octant), links, cause, is_shortest: true }
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
        let mut third =
            split(&[0, 3, 1], vec![link("extra_layer", &[0, 3, 1], &[1, 0, 3, 0], 0)], end());
        third.is_shortest = false;
        let touching =
            split(&[0], vec![link("layer", &[0], &[1, 0, 0], 0)], Some(cause(&[1], &[], 0, &[3])));
        let text = sizes(vec![first, second, third, touching]);
        let expected = "  level 1: octant 0 (level 1), (0, 0, 0) to (8, 8, 8) is split\n    \
            by section 6 (layer): only 1 cell of level 3 away is the leaf octant 1.0.0 (level 3), (8, 0, 0) to (10, 2, 2)\n    \
            its parent is split by section 6 (balance): it touches the leaf octant 1.0.0.0 (level 4), (8, 0, 0) to (9, 1, 1), 2 levels finer\n    \
            its parent is split by section 3: facet 7 crosses it\n    the shortest chain: 2 leaves\n  \
            level 2: octant 0.3 (level 2), (4, 4, 0) to (8, 8, 4) is split\n    \
            by section 6 (layer): only 2 cells of level 3 away is the leaf octant 1.0.2 (level 3), (8, 2, 0) to (10, 4, 2)\n    \
            its parent is split as in the chain of level 1\n    the shortest chain: 2 leaves\n  \
            level 3: octant 0.3.1 (level 3), (6, 4, 0) to (8, 6, 2) is split\n    \
            by section 6 (extra layer): it touches the deleted crossing leaf octant 1.0.3.0 (level 4), (10, 2, 0) to (11, 3, 1)\n    \
            it is crossing by section 4: facet 7 crosses it\n    a chain of 1 leaf; a shorter one may exist\n  \
            level 1: octant 0 (level 1), (0, 0, 0) to (8, 8, 8) is split\n    \
            by section 6 (layer): it touches the leaf octant 1.0.0 (level 3), (8, 0, 0) to (10, 2, 2)\n    \
            its parent is split by section 3: box 3 meets it\n    the shortest chain: 1 leaf\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn only_a_chain_with_the_same_end_and_cause_is_referred_to() {
        let other = |from: &[u8], facet| {
            let links = vec![
                link("layer", from, &[1, 0, 0], 1),
                link("balance", &[1, 0], &[1, 0, 0, 0], 0),
            ];
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
            ends(&deleted)
                .0
                .starts_with("(1, 2, 0.5) lies in a part of the root that was deleted\n")
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
        let reason = |side, candidate, is_complete| SideReason::Component {
            side,
            decision: "the decision".to_owned(),
            candidate,
            rays_odd: None,
            seed: None,
            leaves_visited: 5,
            is_complete,
            is_proven: true,
        };
        component.side_decided_by = reason(Side::Outside, None, true);
        assert_eq!(
            ends(&component).1,
            "  outside by section 4: the decision\n  the component has 5 leaves of T0"
        );
        component.side_decided_by = reason(Side::Inside, Some(place(&[2])), false);
        let side = "  inside by section 4: the decision\n  candidate: octant 2 (level 1), (0, 8, 0) to (8, 16, 8)\n  \
            the component has at least 5 leaves of T0\n  but the mesh has the side outside here";
        let terms = "\n  component: the leaves of T0 that no facet crosses and that shared faces join; all have one side\n  \
            candidate: the leaf of the component from whose centre rays count facets";
        assert_eq!(ends(&component).1, format!("{side}{TERMS}{terms}"));
    }
}
