//! The diagnosis for a terminal.

use std::fmt;

use super::finding::{Finding, Kind, Place};
use super::meaning::number;
use super::report::Diagnosis;

impl Kind {
    /// The heading of the kind's row.
    pub fn title(self) -> &'static str {
        match self {
            Self::Openings => "openings",
            Self::Junctions => "edges at T-junctions",
            Self::NonManifoldOdd => "edges with 3, 5, ... facets",
            Self::NonManifoldEven => "edges with 4, 6, ... facets",
            Self::Winding => "neighbours, opposite winding",
            Self::InsideOut => "closed shells inside out",
            Self::Cavities => "closed shells, likely cavities",
            Self::Duplicates => "duplicate facets",
            Self::Degenerate => "facets without area",
            Self::Slivers => "slivers",
            Self::Intersections => "intersecting pairs of facets",
            Self::Contacts => "touching pairs of facets",
            Self::ThinWalls => "facets of thin walls",
            Self::ThinGaps => "facets at thin gaps",
            Self::OutsideRoot => "facets beyond the root",
            Self::TouchingRoot => "facets on the root's boundary",
        }
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.header(f)?;
        writeln!(f, "\n{:<31}{:>10}  effect on the mesh's region", "finding", "count")?;
        for finding in &self.findings {
            let effect = match (finding.count, finding.count_changing) {
                (0, _) => String::new(),
                (_, 0) => "none".into(),
                (all, changing) if all == changing => "POSSIBLE".into(),
                (_, changing) => format!("POSSIBLE for {changing}"),
            };
            let count =
                format!("{}{}", if finding.is_lower_bound { ">=" } else { "" }, finding.count);
            let row = format!("{:<31}{count:>10}  {effect}", finding.kind.title());
            writeln!(f, "{}", row.trim_end())?;
        }
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
        for shell in shells.largest.iter().filter(|_| shells.count > 1) {
            let state = if shell.is_closed { "closed" } else { "open" };
            writeln!(
                f,
                "          {} facets from number {}, {state}",
                shell.facets, shell.facet_first
            )?;
        }
        more(f, shells.largest.len() as u64, shells.count)?;
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
        writeln!(f, "\n{}: {}", finding.kind.title(), finding.meaning)?;
        for place in &finding.places {
            writeln!(f, "  {}", line(place))?;
        }
        // Two facets of a thin sheet are listed once.
        let is_sheet = matches!(finding.kind, Kind::ThinWalls | Kind::ThinGaps);
        if is_sheet { Ok(()) } else { more(f, finding.places.len() as u64, finding.count) }
    }
}

fn more(f: &mut fmt::Formatter<'_>, listed: u64, count: u64) -> fmt::Result {
    if listed > 0 && listed < count {
        writeln!(f, "          and {} more (--first)", count - listed)?;
    }
    Ok(())
}

fn line(place: &Place) -> String {
    let mut text = format!("at {}", point(&place.at));
    if let Some(width) = place.width {
        text += &format!(": {} wide{}", number(width), in_cells(place.width_cells));
    }
    if let Some(diameter) = place.diameter {
        text += &format!(", {} across{}", number(diameter), in_cells(place.diameter_cells));
    }
    if let Some(edges) = place.edges {
        text += &format!(", {edges} edges");
    }
    let facets: Vec<String> = place.facets.iter().map(ToString::to_string).collect();
    let dots = if facets.len() == Place::FACETS_MAX { ", ..." } else { "" };
    let noun = if facets.len() == 1 { "facet" } else { "facets" };
    format!("{text}; {noun} {}{dots}", facets.join(", "))
}

fn in_cells(cells: Option<f64>) -> String {
    cells.map_or(String::new(), |cells| format!(" ({} cells)", number(cells)))
}

fn point(at: &[f64; 3]) -> String {
    let [x, y, z] = at.map(|c| format!("{:?}", c as f32));
    format!("({x}, {y}, {z})")
}
