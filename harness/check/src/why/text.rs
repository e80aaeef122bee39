//! The answer for a terminal.

#[cfg(test)]
mod tests;

use std::fmt;

use super::answer::{Answer, Cause, Link, Place, Split, facets_that_cross};
use super::gradation::Rule;
use contract::number::number;

const TERMS: &str = "\nterms
  section: of reference/DEFINITION.md, the definition of the mesh
  T0: the base tree, which facets and boxes alone require; layers and balance refine it
  octant 3.1.4: the root's child 3, of that the child 1, of that the child 4; a child in the upper half in x counts 1, in y 2, in z 4
  component: the leaves of T0 that no facet crosses and that shared faces join; all have one side
  candidate: the leaf of the component from whose centre rays count facets";

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let point = |[x, y, z]: [f64; 3]| format!("({x}, {y}, {z})");
        let Self { path, level, min, max, .. } = self;
        write!(f, "octant {path} (level {level}), {} to {}", point(*min), point(*max))
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.point;
        match (&self.leaf, self.side, &self.base_leaf) {
            (Some(leaf), Some(side), base) => {
                let edge = number(leaf.max[0] - leaf.min[0]);
                writeln!(f, "({x}, {y}, {z}) lies in the {side} leaf {leaf}\n  edge {edge}")?;
                if let Some(base) = base.as_ref().filter(|base| *base != leaf) {
                    writeln!(f, "  leaf of T0: {base}")?;
                }
            }
            (_, _, Some(base)) => {
                writeln!(f, "({x}, {y}, {z}) lies in a deleted leaf of T0: {base}")?;
            }
            _ => writeln!(f, "({x}, {y}, {z}) lies in a part of the root that was deleted")?,
        }
        if let Some(rule) = &self.deleted_by {
            writeln!(f, "  deleted by {rule}")?;
        }
        writeln!(f, "\nsize")?;
        match &self.split {
            None if self.leaf.is_some() => {
                writeln!(f, "  the leaf is the root: nothing splits it")?
            }
            None => writeln!(f, "  not explained")?,
            Some(Split { octant, cause: None, .. }) => writeln!(
                f,
                "  its parent, {octant}, is split, and no rule that is known requires it (harness audit --case finds all such splits)"
            )?,
            Some(split) => {
                writeln!(f, "  its parent, {}, is split", split.octant)?;
                split.clauses().iter().try_for_each(|clause| writeln!(f, "    {clause}"))?;
            }
        }
        self.side(f)?;
        for what in &self.left_out {
            writeln!(f, "left out: {what}")?;
        }
        f.write_str(TERMS)
    }
}

impl Answer {
    fn side(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(reason) = &self.side_decided_by else {
            return writeln!(f, "side\n  not explained");
        };
        writeln!(f, "side\n  {} by section 4: {}", reason.side, reason.decision)?;
        if let Some(leaves) = reason.leaves {
            writeln!(f, "  the component has {leaves} leaves of T0")?;
        }
        match self.side {
            Some(found) if found != reason.side => {
                writeln!(f, "  but the mesh has the side {found} here")
            }
            _ => Ok(()),
        }
    }
}

impl Split {
    /// The clauses of the chain, from what forces the split to the cause; empty if no rule requires the split.
    pub(crate) fn clauses(&self) -> Vec<String> {
        let Some(cause) = &self.cause else { return Vec::new() };
        let clause = |(i, link): (usize, &Link)| match i {
            0 => sentence(link),
            _ => format!("its parent is split {}", sentence(link)),
        };
        let subject = match self.links.last() {
            None => "by section 3",
            Some(link) if link.rule == Rule::ExtraLayer => "it is crossing by section 4",
            Some(_) => "its parent is split by section 3",
        };
        let end = format!("{subject}: {}", what(cause));
        self.links.iter().enumerate().map(clause).chain([end]).collect()
    }
}

/// A link as a clause.
fn sentence(Link { rule, octant, leaf, distance_cells }: &Link) -> String {
    match (rule, distance_cells) {
        (Rule::Layer, 0) => format!("by section 6, step 2 (layer): it touches the leaf {leaf}"),
        (Rule::Layer, cells) => format!(
            "by section 6, step 2 (layer): only {cells} {} of level {} away is the leaf {leaf}",
            if *cells == 1 { "cell" } else { "cells" },
            leaf.level
        ),
        (Rule::Balance, _) => format!(
            "by section 6, step 3 (balance): it touches the leaf {leaf}, {} levels finer",
            leaf.level - octant.level
        ),
        (Rule::ExtraLayer, _) => {
            format!("by section 6 (extra layer): it touches the deleted crossing leaf {leaf}")
        }
    }
}

/// A cause as a clause.
fn what(cause: &Cause) -> String {
    let surface = match cause.facets_count {
        0 => "the surface crosses it".to_owned(),
        count => format!("{} it", facets_that_cross(&cause.facets, count)),
    };
    let surface = cause.is_crossed.then_some(surface).into_iter();
    let boxes = cause.boxes.iter().map(|index| format!("box {index} meets it"));
    surface.chain(boxes).collect::<Vec<_>>().join("; ")
}
