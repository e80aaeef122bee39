//! The answer for a terminal.

#[cfg(test)]
mod tests;

use std::fmt;

use super::answer::{Answer, CauseRecord, LinkRecord, SideReason, Split, user_place};
use contract::number::number;

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
            if split.cause.is_none() {
                writeln!(f, "    no rule that is known requires it (harness why --unneeded)")?;
                continue;
            }
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
                _ => split.clauses().iter().try_for_each(|c| writeln!(f, "    {c}"))?,
            }
            let links = split.links.len();
            let noun = if links == 1 { "leaf" } else { "leaves" };
            writeln!(f, "    a chain of {links} {noun}")?;
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
            SideReason::Component { side, decision, candidate, leaves, .. } => {
                write!(f, "side\n  {side} by section 4: {decision}")?;
                if let Some(candidate) = candidate {
                    write!(f, "\n  candidate: {}", user_place(candidate))?;
                }
                write!(f, "\n  the component has {leaves} leaves of T0")?;
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

impl Split {
    /// The clauses of the chain, from what forces the split to the cause; empty if no rule requires the split.
    pub(crate) fn clauses(&self) -> Vec<String> {
        let Some(cause) = &self.cause else { return Vec::new() };
        let clause = |(i, link): (usize, &LinkRecord)| match i {
            0 => sentence(link),
            _ => format!("its parent is split {}", sentence(link)),
        };
        let subject = match self.links.last() {
            None => "by section 3",
            Some(link) if link.rule == "extra_layer" => "it is crossing by section 4",
            Some(_) => "its parent is split by section 3",
        };
        let end = format!("{subject}: {}", what(cause));
        self.links.iter().enumerate().map(clause).chain([end]).collect()
    }
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
