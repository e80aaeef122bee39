//! The diagnosis for a terminal.

use std::fmt;

use super::finding::{Finding, Kind, Place};
use super::report::Diagnosis;
use contract::number::number;

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.header(f)?;
        for finding in self.findings.iter().filter(|finding| finding.count > 0) {
            self.details(finding, f)?;
        }
        let verdict = match self.changes_region {
            true => "findings that can change the mesh's region",
            false => "no finding that changes the mesh's region",
        };
        write!(f, "\n{verdict}")
    }
}

impl Diagnosis {
    fn header(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { facets, vertices, shells, extent, root, .. } = self;
        writeln!(f, "facets    {facets}, with {vertices} distinct vertices")?;
        let names = self.solids.iter().filter_map(|s| s.name.as_ref().map(|name| (name, s)));
        if !self.solids.is_empty() {
            writeln!(f, "solids    {}", self.solids.len())?;
        }
        for (name, solid) in names {
            writeln!(
                f,
                "          {name:?}: {} facets from number {}",
                solid.facets, solid.facet_first
            )?;
        }
        writeln!(f, "shells    {}, {} closed", shells.count, shells.closed)?;
        writeln!(f, "extent    {} to {}", point(&extent.low), point(&extent.high))?;
        let cells = |length: f64| in_cells(self.cell.map(|cell| length / cell));
        writeln!(
            f,
            "root      {} with edge {}{}; least distance to a face {}{}",
            point(&root.origin),
            number(root.edge),
            cells(root.edge),
            number(extent.margin),
            cells(extent.margin)
        )?;
        match self.cell {
            Some(cell) => writeln!(f, "cell      {} at the surface", number(cell)),
            None => writeln!(
                f,
                "cell      not known; --spacing-min reports sizes in cells and thin sheets"
            ),
        }
    }

    fn details(&self, finding: &Finding, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Finding { kind, count, count_changing, places, meaning, .. } = finding;
        let least = if finding.is_lower_bound { "at least " } else { "" };
        let effect = match count_changing {
            0 => String::new(),
            changing => format!("; {changing} can change the mesh's region"),
        };
        writeln!(f, "\n{}: {least}{count}{effect}\n  {meaning}", kind.title())?;
        places.iter().try_for_each(|place| writeln!(f, "  {}", self.line(place)))?;
        match count - places.len() as u64 {
            // Two facets of a thin sheet are listed once.
            more if more > 0 && !matches!(kind, Kind::ThinWalls | Kind::ThinGaps) => {
                writeln!(f, "  and {more} more (--limit)")
            }
            _ => Ok(()),
        }
    }

    fn line(&self, place: &Place) -> String {
        let mut text = format!("at {}", point(&place.at));
        if let Some(width) = place.width {
            let cells = in_cells(self.cell.map(|cell| width / cell));
            text += &format!(": {} wide{cells}", number(width));
        }
        let facets: Vec<String> = place.facets.iter().map(ToString::to_string).collect();
        let dots = if facets.len() == Place::FACETS_MAX { ", ..." } else { "" };
        format!("{text}; facets {}{dots}", facets.join(", "))
    }
}

fn in_cells(cells: Option<f64>) -> String {
    cells.map_or(String::new(), |cells| format!(" ({} cells)", number(cells)))
}

fn point(at: &[f64; 3]) -> String {
    let [x, y, z] = at.map(|c| match c as f32 {
        short if short.is_finite() => format!("{short:?}"),
        _ => number(c),
    });
    format!("({x}, {y}, {z})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::EdgeCounts;
    use crate::extent::Extent;
    use crate::report::Shells;
    use contract::lattice::Root;
    use contract::stl::Solid;

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
            extent    (-1.0, -1.0, -1.0) to (1.0, 1.0, 2.5)\n\
            root      (-8.0, -8.0, -8.0) with edge 16.0 (64.0 cells); least distance to a face 5.50 (22.0 cells)\n\
            cell      0.250 at the surface\n\n\
            openings: 2; 1 can change the mesh's region\n  Meaning of Openings.\n  \
            at (0.1, 2.0, -3.5): 0.500 wide (2.00 cells); facets 1, 2\n  and 1 more (--limit)\n\n\
            intersecting pairs of facets: at least 2; 2 can change the mesh's region\n  Meaning of Intersections.\n  \
            at (0.1, 2.0, -3.5); facets 0, 1, 2, 3, 4, 5, 6, 7, ...\n  and 1 more (--limit)\n\n\
            facets of thin walls: 4; 4 can change the mesh's region\n  Meaning of ThinWalls.\n  \
            at (0.1, 2.0, -3.5): 0.125 wide (0.500 cells); facets 1, 2\n\n\
            closed shells inside out: 1\n  Meaning of InsideOut.\n  at (0.1, 2.0, -3.5); facets 0, 1, 2, 3, 4, 5, 6\n\n\
            findings that can change the mesh's region";
        assert_eq!(diagnosis().to_string(), expected);
    }

    #[test]
    fn a_single_shell_and_an_unknown_cell_need_fewer_lines() {
        let mut plain = diagnosis();
        (plain.cell, plain.changes_region) = (None, false);
        (plain.solids, plain.findings) = (Vec::new(), Vec::new());
        plain.shells = Shells { count: 1, closed: 1, facets: 16 };
        let expected = "facets    30, with 17 distinct vertices\nshells    1, 1 closed\n\
            extent    (-1.0, -1.0, -1.0) to (1.0, 1.0, 2.5)\n\
            root      (-8.0, -8.0, -8.0) with edge 16.0; least distance to a face 5.50\n\
            cell      not known; --spacing-min reports sizes in cells and thin sheets\n\n\
            no finding that changes the mesh's region";
        assert_eq!(plain.to_string(), expected);
    }
}
