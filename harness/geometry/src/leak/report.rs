//! The answer as data, as JSON of the schema `octree-leak/5` when serialised, and for a terminal. Lengths are in the user's units.
//!
//! Its invariants are in `super::invariants`.

use super::Target;
use contract::lattice::Root;
use contract::number::{number, point};
use serde::Serialize;
use std::fmt;

/// Name and version of the JSON form.
pub const SCHEMA: &str = "octree-leak/5";

/// A surface level and its spacing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spacing {
    /// Level of the cells at the surface.
    pub level: u8,
    /// Their edge length.
    pub spacing: f64,
}

impl Spacing {
    /// The spacing of a level.
    pub fn of(level: u8, root: &Root) -> Self {
        Self { level, spacing: root.edge_of(level) }
    }
}

/// The coarser base tree that does not join the ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Closes {
    /// Its surface level and spacing.
    #[serde(flatten)]
    pub spacing: Spacing,
    /// Whether facets cross the leaf of an end there.
    pub is_end_crossed: bool,
}

/// A point of a path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// The point.
    pub at: [f64; 3],
    /// Diameter of the largest ball centred there that no facet enters.
    pub width: f64,
}

/// The narrowest place of a path.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Narrowest {
    /// Centre of the largest ball that passes on this path.
    pub at: [f64; 3],
    /// Its diameter.
    pub width: f64,
    /// A ball of this diameter passes on this path.
    pub width_min: f64,
    /// No ball of a greater diameter passes on any path.
    pub width_max: f64,
    /// `width` in cells of the case's surface level.
    pub width_cells: f64,
    /// The edge of the finest cells of boxes that this ball meets; infinite if it meets none.
    #[serde(skip)]
    pub cell_of_boxes: f64,
    /// The facets at the rim, which the ball touches to within 5 % of its radius, by number from 0; nearest first.
    pub facets: Vec<u32>,
    /// Index among the points of the path.
    pub index: usize,
    /// Whether an end of the path is no more than 5 % wider, so that it is no opening: the widest place near the start or the end.
    pub is_end: bool,
}

/// The widest path.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Passage {
    /// The base tree through whose free leaves it leads.
    #[serde(flatten)]
    pub spacing: Spacing,
    /// The narrowest place.
    pub narrowest: Narrowest,
    /// Indices of the first and the last point between which the width counts: the path leads away from the facets near its ends.
    pub inner: (usize, usize),
    /// The points, from the start to the end.
    pub points: Vec<Point>,
}

/// The answer for two places.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The start.
    pub from: [f64; 3],
    /// The end.
    pub to: Target,
    /// The case's surface level and spacing.
    #[serde(flatten)]
    pub spacing: Spacing,
    /// Whether free leaves of the case's base tree join the ends.
    pub is_leak: bool,
    /// Whether the start is outside by its rays, although no path joins it to the far field.
    pub is_enclosed: bool,
    /// Whether no path joins the start to the far field, but it is outside, and the root's boundary opens its space.
    pub is_cut: bool,
    /// The coarser level, the nearest to the case's, whose base tree does not join the ends.
    pub closes: Option<Closes>,
    /// The widest path if there is a leak, at the case's level or a coarser one that joins the ends.
    pub passage: Option<Passage>,
}

/// The answers for one case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answers {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Name of the case.
    pub case: String,
    /// Number of facets.
    pub facets: u64,
    /// The root cube.
    pub root: Root,
    /// The answers.
    pub examined: Vec<Report>,
}

/// Facets at the rim that are printed.
const FACETS_MAX: usize = 24;
/// What follows a spacing that closes an opening.
const CLOSE: &str = "close this opening wherever the lattice lies, and finer ones may on this lattice; others have widths of their own (`harness geometry`).";
const END: &str = "          This is the widest place near the start or the end: no place between is narrower. Openings beside the points themselves do not count.\n";
/// What follows where no path explains that the start is outside.
const ENCLOSED: &str = ": the facets enclose the start, although by its rays it is outside, as beside openings, overlaps and facets that appear \
    twice (`harness geometry`). If the mesher reports that it leaked, its rays have changed their verdict, and no path has opened";
/// What follows where the root's boundary alone opens the space of the start.
const CUT: &str = ", but the start is outside, and the root's boundary opens its space, so it is meshed as flow if keep = outside, as a cavity \
    of a half model would be: give a seed in the flow (seeds) if that is not meant";
const ENDS_CROSSED: &str = ", where facets cross the leaf of the start or the end";

impl fmt::Display for Answers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Many regions may have the same answer without a path.
        let is_same = |a: &Report, b: &Report| {
            let [a, b] = [a, b].map(|of| (of.to, of.is_leak, of.is_enclosed, of.is_cut));
            a == b && !a.1
        };
        for (i, same) in self.examined.chunk_by(is_same).enumerate() {
            f.write_str(if i > 0 { "\n" } else { "" })?;
            same[0].fmt(f)?;
            let more = same.len() - 1;
            if more > 0 {
                writeln!(f, "          The same holds for {more} more starts (--json).")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let to = match self.to {
            Target::Point(at) => point(at),
            Target::Far => "the far field".to_owned(),
        };
        let (from, at) = (point(self.from), spacing(&self.spacing));
        writeln!(f, "from      {from}\nto        {to}\nspacing   {at}\n")?;
        let Some(passage) = &self.passage else {
            let remark = if self.is_enclosed { ENCLOSED } else { "" };
            let remark = if self.is_cut { CUT } else { remark };
            return writeln!(f, "no leak at this spacing{remark}");
        };
        let verdict = match passage.narrowest.is_end {
            true => "JOINED: start and end lie in one space, or one of them within the opening",
            false => "LEAK: free leaves join start and end",
        };
        let closed = match &self.closes {
            None => ", at every spacing".to_owned(),
            Some(Closes { spacing: at, is_end_crossed }) => {
                let crossed = if *is_end_crossed { ENDS_CROSSED } else { "" };
                format!("; closed at spacing {}{crossed}", spacing(at))
            }
        };
        writeln!(f, "{verdict}{closed}")?;
        describe(passage, self.closes.is_some(), f)
    }
}

/// What is printed of a widest path. Where no spacing closes it, as in a box of cells that pass through it, none is named.
fn describe(passage: &Passage, is_closed: bool, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let n = &passage.narrowest;
    let [width, min, max, cells] = [n.width, n.width_min, n.width_max, n.width_cells].map(number);
    let is_named = is_closed && !n.is_end && n.width_max <= n.cell_of_boxes;
    let end = if n.is_end { END } else { "" };
    let closing = format!("          Cells wider than {max} {CLOSE}\n");
    let closing = if is_named { &closing } else { "" };
    let listed: Vec<String> = n.facets.iter().take(FACETS_MAX).map(ToString::to_string).collect();
    let more = match n.facets.len().saturating_sub(FACETS_MAX) {
        0 => String::new(),
        more => format!(" and {more} more (--json)"),
    };
    write!(
        f,
        "\nThe narrowest place of the widest path\n\
         width     {width} ({cells} cells of the case's spacing): diameter of the largest ball that passes, {min} to {max}\n\
         {closing}at        {}\nfacets    {}{more}\n{end}",
        point(n.at),
        listed.join(", ")
    )
}

/// A spacing with all its digits: a case with this one has the same level.
fn spacing(Spacing { level, spacing }: &Spacing) -> String {
    format!("{spacing} (level {level})")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn narrowest(facets: std::ops::Range<u32>, index: usize, is_end: bool) -> Narrowest {
        Narrowest {
            at: [0.5, 0.0, -1.25],
            width: 0.125,
            width_min: 0.124,
            width_max: 0.128,
            width_cells: 0.25,
            cell_of_boxes: f64::INFINITY,
            facets: facets.collect(),
            index,
            is_end,
        }
    }

    /// A leak through an opening, along a path of this many points.
    fn leak(points: usize, narrowest: Narrowest) -> Report {
        let root = Root { origin: [0.0; 3], edge: 8.0 };
        let point = |i: usize| Point { at: [i as f64, 0.0, 1.0], width: 0.5 + i as f64 };
        let spacing = Spacing::of(4, &root);
        let points: Vec<Point> = (0..points).map(point).collect();
        Report {
            from: [0.0, 0.25, 1.0],
            to: Target::Far,
            spacing,
            is_leak: true,
            is_enclosed: false,
            is_cut: false,
            closes: Some(Closes { spacing: Spacing::of(2, &root), is_end_crossed: true }),
            passage: Some(Passage { spacing, narrowest, inner: (0, points.len() - 1), points }),
        }
    }

    const HEAD: &str =
        "from      (0, 0.25, 1)\nto        the far field\nspacing   0.5 (level 4)\n\n";

    #[test]
    fn a_leak_is_described_with_its_opening_and_its_path() {
        let expected = "LEAK: free leaves join start and end; closed at spacing 2 (level 2), where facets cross the leaf of the start or the end\n\
            \nThe narrowest place of the widest path\n\
            width     0.125 (0.250 cells of the case's spacing): diameter of the largest ball that passes, 0.124 to 0.128\n          \
            Cells wider than 0.128 close this opening wherever the lattice lies, and finer ones may on this lattice; others have widths of their own (`harness geometry`).\n\
            at        (0.5, 0, -1.25)\nfacets    3, 4\n";
        assert_eq!(leak(3, narrowest(3..5, 1, false)).to_string(), format!("{HEAD}{expected}"));
    }

    #[test]
    fn of_long_rims_the_first_part_is_printed() {
        let facets = |count| leak(1, narrowest(0..count, 0, false)).to_string();
        assert!(facets(24).contains(" 22, 23\n"));
        assert!(facets(26).contains(" 22, 23 and 2 more (--json)\n"));
    }

    #[test]
    fn a_path_that_is_narrowest_at_its_end_has_no_opening() {
        let mut report = leak(1, narrowest(3..4, 0, true));
        (report.closes, report.to) = (None, Target::Point([1.0, 2.0, 3.5]));
        let text = report.to_string();
        let start = "from      (0, 0.25, 1)\nto        (1, 2, 3.5)\n";
        assert!(text.starts_with(start), "{text}");
        let verdict = "\nJOINED: start and end lie in one space, or one of them within the opening, at every spacing\n";
        assert!(text.contains(verdict), "{text}");
        let remark = format!("facets    3\n{END}");
        assert!(text.contains(&remark) && !text.contains("Cells wider than"), "{text}");
    }

    #[test]
    fn an_opening_that_no_spacing_closes_names_none() {
        let report = Report { closes: None, ..leak(3, narrowest(3..5, 1, false)) };
        let text = report.to_string();
        assert!(
            text.contains(", at every spacing") && !text.contains("Cells wider than"),
            "{text}"
        );
        // The cells of a box pass through the opening, although coarser ones close the path elsewhere.
        let narrowest = Narrowest { cell_of_boxes: 0.1, ..narrowest(3..5, 1, false) };
        assert!(!leak(3, narrowest).to_string().contains("Cells wider than"));
    }

    #[test]
    fn starts_with_the_same_answer_are_counted() {
        let leak = leak(1, narrowest(3..4, 0, false));
        let none = Report { is_leak: false, closes: None, passage: None, ..leak.clone() };
        let root = Root { origin: [0.0; 3], edge: 8.0 };
        let examined = vec![none.clone(), none.clone(), none, leak.clone(), leak.clone()];
        let answers = Answers { schema: SCHEMA, case: String::new(), facets: 1, root, examined };
        let same =
            "no leak at this spacing\n          The same holds for 2 more starts (--json).\n";
        assert_eq!(answers.to_string(), format!("{HEAD}{same}\n{leak}\n{leak}"));
    }

    #[test]
    fn without_a_leak_the_answer_is_one_line() {
        let mut report = leak(1, narrowest(3..4, 0, false));
        (report.is_leak, report.closes, report.passage) = (false, None, None);
        assert_eq!(report.to_string(), format!("{HEAD}no leak at this spacing\n"));
        report.is_enclosed = true;
        assert!(report.to_string().contains("no leak at this spacing: the facets enclose"));
    }
}
