//! The diagnosis for a terminal.

use std::fmt;

use super::finding::{Finding, Kind, Place};
use super::report::Diagnosis;
use contract::number::{number, point};
use contract::stl::Solid;

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.head().iter().try_for_each(|(name, text)| writeln!(f, "{name:<10}{text}"))?;
        for finding in self.findings.iter().filter(|finding| finding.count > 0) {
            self.details(finding, f)?;
        }
        let verdict = match self.changes_region {
            true => "at least one finding can change the mesh's region",
            false => "no finding that changes the mesh's region",
        };
        write!(f, "\n{verdict}")
    }
}

impl Diagnosis {
    fn head(&self) -> Vec<(&str, String)> {
        let Self { facets, vertices, solids, shells, extent, root, cell, .. } = self;
        let mut rows = vec![("facets", format!("{facets}, with {vertices} distinct vertices"))];
        if !solids.is_empty() {
            rows.push(("solids", solids.len().to_string()));
        }
        for Solid { name, facets, facet_first } in solids {
            let row = |name| ("", format!("{name:?}: {facets} facets from number {facet_first}"));
            rows.extend(name.as_ref().map(row));
        }
        rows.push(("shells", format!("{}, {} closed", shells.count, shells.closed)));
        let [low, high] = [extent.low, extent.high].map(|at| point(root.rounded(at)));
        rows.push(("extent", format!("{low} to {high}")));
        let (edge, margin) = (self.with_cells("", root.edge), self.with_cells("", extent.margin));
        let origin = point(root.origin);
        let root = format!("{origin} with edge {edge}; least distance to a face {margin}");
        rows.push(("root", root));
        let unknown = "not known; --spacing-min reports sizes in cells and thin sheets";
        let cell = cell.map(|cell| format!("{} at the surface", number(cell)));
        rows.push(("cell", cell.unwrap_or(unknown.to_owned())));
        rows
    }

    fn details(&self, finding: &Finding, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Finding { kind, count, count_changing, places, meaning, .. } = finding;
        let least = if finding.is_lower_bound { "at least " } else { "" };
        let effect = match count_changing {
            0 => String::new(),
            changing => format!("; {changing} can change the mesh's region"),
        };
        writeln!(f, "\n{}: {least}{count}{effect}\n  {meaning}", kind.row().0)?;
        for Place { facets, at, width } in places {
            let width = width.map(|width| format!(": {}", self.with_cells(" wide", width)));
            let dots = if facets.len() == Place::FACETS_MAX { ", ..." } else { "" };
            let facets: Vec<String> = facets.iter().map(ToString::to_string).collect();
            let at = point(self.root.rounded(*at));
            let (width, facets) = (width.unwrap_or_default(), facets.join(", "));
            writeln!(f, "  at {at}{width}; facets {facets}{dots}")?;
        }
        let more = count - places.len() as u64;
        // Two facets of a thin sheet are listed once.
        if more > 0 && !matches!(kind, Kind::ThinWalls | Kind::ThinGaps) {
            writeln!(f, "  and {more} more (--limit)")?;
        }
        Ok(())
    }

    /// A length with a word after it, and in cells if their size is known.
    fn with_cells(&self, word: &str, length: f64) -> String {
        let cells = self.cell.map(|cell| format!(" ({} cells)", number(length / cell)));
        format!("{}{word}{}", number(length), cells.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::EdgeCounts;
    use crate::extent::Extent;
    use crate::report::Shells;
    use contract::lattice::Root;

    fn finding(kind: Kind, count: u64, count_changing: u64, places: Vec<Place>) -> Finding {
        let meaning = format!("Meaning of {kind:?}.");
        Finding { count, count_changing, meaning, places, ..Finding::new(kind) }
    }

    /// A body of one open and two closed shells, with findings of every form.
    fn diagnosis() -> Diagnosis {
        let at = [0.1, 2.0, -3.5];
        let hole = Place { width: Some(0.5), ..Place::new(vec![1, 2], at) };
        let sheet = Place { width: Some(0.125), ..Place::new(vec![1, 2], at) };
        let one = |facets: std::ops::Range<u32>| vec![Place::new(facets.collect(), at)];
        let solid = |name: Option<&str>, facets| Solid {
            name: name.map(str::to_owned),
            facet_first: 3,
            facets,
        };
        let mut lower_bound = finding(Kind::Intersections, 2, 2, one(0..8));
        lower_bound.is_lower_bound = true;
        Diagnosis {
            schema: crate::report::SCHEMA,
            facets: 30,
            vertices: 17,
            edges: EdgeCounts::default(),
            solids: vec![solid(Some("wing"), 20), solid(None, 10)],
            shells: Shells { count: 3, closed: 2, facets: 30 },
            root: Root { origin: [-8.0; 3], edge: 16.0 },
            cell: Some(0.25),
            extent: Extent { low: [-1.0; 3], high: [1.0, 1.0, 2.5], margin: 5.5 },
            findings: vec![
                finding(Kind::Openings, 2, 1, vec![hole]),
                finding(Kind::Winding, 0, 0, vec![]),
                lower_bound,
                finding(Kind::ThinWalls, 4, 4, vec![sheet]),
                finding(Kind::InsideOut, 1, 0, one(0..7)),
            ],
            changes_region: true,
        }
    }

    #[test]
    fn a_diagnosis_lists_shells_findings_and_places() {
        let expected = "facets    30, with 17 distinct vertices\n\
            solids    2\n          \"wing\": 20 facets from number 3\n\
            shells    3, 2 closed\n\
            extent    (-1, -1, -1) to (1, 1, 2.5)\n\
            root      (-8, -8, -8) with edge 16.0 (64.0 cells); least distance to a face 5.50 (22.0 cells)\n\
            cell      0.250 at the surface\n\n\
            openings: 2; 1 can change the mesh's region\n  Meaning of Openings.\n  \
            at (0.1, 2, -3.5): 0.500 wide (2.00 cells); facets 1, 2\n  and 1 more (--limit)\n\n\
            intersecting pairs of facets: at least 2; 2 can change the mesh's region\n  Meaning of Intersections.\n  \
            at (0.1, 2, -3.5); facets 0, 1, 2, 3, 4, 5, 6, 7, ...\n  and 1 more (--limit)\n\n\
            facets of thin walls: 4; 4 can change the mesh's region\n  Meaning of ThinWalls.\n  \
            at (0.1, 2, -3.5): 0.125 wide (0.500 cells); facets 1, 2\n\n\
            closed shells inside out: 1\n  Meaning of InsideOut.\n  at (0.1, 2, -3.5); facets 0, 1, 2, 3, 4, 5, 6\n\n\
            at least one finding can change the mesh's region";
        assert_eq!(diagnosis().to_string(), expected);
    }

    #[test]
    fn a_single_shell_and_an_unknown_cell_need_fewer_lines() {
        let mut plain = diagnosis();
        (plain.cell, plain.changes_region) = (None, false);
        (plain.solids, plain.findings) = (Vec::new(), Vec::new());
        plain.shells = Shells { count: 1, closed: 1, facets: 16 };
        let expected = "facets    30, with 17 distinct vertices\nshells    1, 1 closed\n\
            extent    (-1, -1, -1) to (1, 1, 2.5)\n\
            root      (-8, -8, -8) with edge 16.0; least distance to a face 5.50\n\
            cell      not known; --spacing-min reports sizes in cells and thin sheets\n\n\
            no finding that changes the mesh's region";
        assert_eq!(plain.to_string(), expected);
    }
}
