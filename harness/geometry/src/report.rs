//! The result of a diagnosis as data, as JSON of the schema `octree-geometry/7` when serialised, and for a terminal.
//!
//! Invariants, which [`Diagnosis::check_invariants`] executes:
//! - edges by class sum to all, and three times the facets of shells to the facets at edges;
//! - shells have no more facets than the geometry; all shells are closed iff no edge has an odd number of facets;
//! - findings of edges agree with these counts; no finding occurs more often than there are edges, shells or facets that it can concern;
//! - places are no more than occurrences, of existing facets; openings are listed from the widest; the width of a sheet is positive and less
//!   than [`RESOLVED`] cells;
//! - what changes the region is part of what occurs, and a body beyond the root is found there.

use contract::lattice::{Root, UNITS_PER_EDGE};
use contract::number::{number, point};
use contract::stl::Solid;
use serde::Serialize;
use std::fmt;

use super::edges::EdgeCounts;
use super::finding::{Finding, Kind, Place, RESOLVED};
use super::input::Extent;

/// Name and version of the JSON form.
pub const SCHEMA: &str = "octree-geometry/7";

/// The shells in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Shells {
    /// Number of shells.
    pub count: u64,
    /// Number of closed shells.
    pub closed: u64,
    /// Number of their facets: all but those with a repeated vertex, and slivers that are left out of the edges.
    pub facets: u64,
}

/// The result of a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Number of facets.
    pub facets: u64,
    /// Number of distinct vertices.
    pub vertices: u64,
    /// The edges of the facets of shells.
    pub edges: EdgeCounts,
    /// The solids of the file; none for a generated body.
    pub solids: Vec<Solid>,
    /// The shells.
    pub shells: Shells,
    /// The root cube.
    pub root: Root,
    /// Edge length of the cells at the surface; none if no spacing was given.
    pub cell: Option<f64>,
    /// The body's extent in the root.
    pub extent: Extent,
    /// One finding of every kind that was searched for.
    pub findings: Vec<Finding>,
    /// Whether a finding can change the mesh's region.
    pub changes_region: bool,
}

impl Diagnosis {
    /// Whether a search has ended early.
    pub fn is_incomplete(&self) -> bool {
        self.findings.iter().any(|finding| finding.is_lower_bound)
    }

    /// Asserts the invariants.
    ///
    /// # Panics
    /// If one is violated, which is a bug.
    pub fn check_invariants(&self) {
        let Self { edges, shells, facets, extent, .. } = self;
        let classes = edges.open + edges.paired + edges.flipped + edges.odd + edges.even;
        assert_eq!(classes, edges.all, "edges by class do not sum to all: {edges:?}");
        let at_edges = edges.open + 2 * (edges.paired + edges.flipped) + edges.facets_non_manifold;
        assert_eq!(at_edges, 3 * shells.facets, "facets at {edges:?} are not those of shells");
        assert!(shells.facets <= *facets, "shells have more facets than the geometry");
        assert!(shells.closed <= shells.count, "{shells:?}");
        let are_closed = edges.open + edges.odd == 0;
        assert_eq!(shells.closed == shells.count, are_closed, "{shells:?} with {edges:?}");
        let count = |kind| self.finding(kind).map_or(0, |finding| finding.count);
        let of_edges = [Kind::NonManifoldOdd, Kind::Winding].map(count);
        assert_eq!(of_edges, [edges.odd, edges.flipped], "findings of edges with {edges:?}");
        let inward = count(Kind::InsideOut) + count(Kind::Nested);
        assert!(inward <= shells.count, "{inward} are wound inward, or nested: {shells:?}");
        let cell = self.cell.unwrap_or(f64::INFINITY);
        for finding in &self.findings {
            let most = match finding.kind {
                Kind::Openings => edges.all,
                Kind::Intersections => facets * facets.saturating_sub(1) / 2,
                _ => edges.all.max(*facets),
            };
            assert!(finding.count <= most, "{} of {most}: {:?}", finding.count, finding.kind);
            finding.check_invariants(*facets, cell);
        }
        let beyond = 2.0 * self.root.edge / UNITS_PER_EDGE as f64;
        let is_within = extent.margin >= -beyond;
        assert!(is_within || count(Kind::OutsideRoot) > 0, "no facet is beyond, but {extent:?}");
    }

    /// The finding of a kind, if this kind was searched for.
    pub fn finding(&self, kind: Kind) -> Option<&Finding> {
        self.findings.iter().find(|finding| finding.kind == kind)
    }

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
        let least = if finding.is_lower_bound { "not all were examined; at least " } else { "" };
        let effect = match count_changing {
            0 => String::new(),
            changing => format!("; {changing} can change the mesh's region"),
        };
        let text = format!("\n{}: {least}{count}{effect}\n  {meaning}", kind.row().0);
        writeln!(f, "{}", text.trim_end())?;
        for Place { facets, facets_more, at, width, is_bound } in places {
            let about = if *is_bound { "at most " } else { "" };
            let width = width.map(|width| format!(": {about}{}", self.with_cells(" wide", width)));
            let dots = if *facets_more > 0 { ", ..." } else { "" };
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

impl Finding {
    fn check_invariants(&self, facets: u64, cell: f64) {
        let Self { kind, count, count_changing, places, .. } = self;
        assert!(count_changing <= count, "{count_changing} of {count} change the region: {kind:?}");
        assert_eq!(places.is_empty(), *count == 0, "places of {count}: {kind:?}");
        assert!(places.len() as u64 <= *count, "{} places of {count}: {kind:?}", places.len());
        assert_eq!(self.meaning.is_empty(), *count == 0, "the meaning of {count}: {kind:?}");
        let numbers = || places.iter().flat_map(|place| &place.facets);
        assert!(numbers().all(|&facet| u64::from(facet) < facets), "facets of {kind:?}");
        let widths: Vec<f64> = places.iter().filter_map(|place| place.width).collect();
        assert!(widths.is_sorted_by(|a, b| a >= b), "widths of {kind:?}: {widths:?}");
        if matches!(kind, Kind::ThinWalls | Kind::ThinGaps) {
            let are_thin = widths.iter().all(|w| (0.0..=1.000_001 * RESOLVED * cell).contains(w));
            assert!(are_thin, "{widths:?} of {kind:?} in cells of {cell}");
        }
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.head().iter().try_for_each(|(name, text)| writeln!(f, "{name:<10}{text}"))?;
        let is_listed = |finding: &&Finding| finding.count > 0 || finding.is_lower_bound;
        self.findings.iter().filter(is_listed).try_for_each(|finding| self.details(finding, f))?;
        let verdict = match () {
            () if self.changes_region => "at least one finding can change the mesh's region",
            () if self.is_incomplete() => "what was examined does not change the mesh's region",
            () => "no finding that changes the mesh's region",
        };
        write!(f, "\n{verdict}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose;
    use crate::input::{Input, Requested};
    use geometries::{Generator, Shape};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn wrong_answers_are_noticed() {
        // A sphere with a hole, a copy of a facet and a flipped one, in cells wider than itself.
        let mut facets = Generator::new(Shape::Sphere, 320).facets().unwrap();
        let is_within = |f: &[[f32; 3]; 3]| f.as_flattened().iter().all(|c| *c > 0.1);
        facets.remove(facets.iter().position(is_within).unwrap());
        facets.push(facets[100]);
        facets[200].swap(0, 1);
        let root = Root { origin: [-8.0; 3], edge: 16.0 };
        let requested =
            Requested { spacing_min: Some(4.0), root: Some(root), ..Requested::default() };
        let right = diagnose(&Input::of(Default::default(), facets, requested).unwrap(), 5);
        let index = |kind| right.findings.iter().position(|f| f.kind == kind).unwrap();
        let [openings, walls, winding] =
            [Kind::Openings, Kind::ThinWalls, Kind::Winding].map(index);
        assert!([openings, walls, winding].iter().all(|&i| right.findings[i].count > 0));
        type Plant<'a> = (&'a str, &'a dyn Fn(&mut Diagnosis));
        let plants: [Plant; 11] = [
            ("an edge more", &|d| d.edges.all += 1),
            ("a pair instead of an open edge", &|d| {
                (d.edges.open, d.edges.paired) = (d.edges.open - 1, d.edges.paired + 1)
            }),
            ("a facet of no shell", &|d| d.shells.facets -= 1),
            ("all shells closed", &|d| d.shells.closed = d.shells.count),
            ("a flipped facet less", &|d| d.findings[winding].count -= 1),
            ("a facet less", &|d| d.facets -= 1),
            ("more changes than occurrences", &|d| d.findings[openings].count_changing = 9),
            ("an opening without places", &|d| d.findings[openings].places.clear()),
            ("a place of a facet that does not exist", &|d| {
                d.findings[winding].places[0].facets[0] = 999
            }),
            ("a narrower opening before a wider one", &|d| {
                let places = &mut d.findings[openings].places;
                places.push(Place { width: Some(9.0), ..places[0].clone() });
            }),
            ("a wall thicker than its limit", &|d| d.findings[walls].places[0].width = Some(9.5)),
        ];
        right.check_invariants();
        for (what, plant) in plants {
            let mut wrong = right.clone();
            plant(&mut wrong);
            let noticed = catch_unwind(AssertUnwindSafe(|| wrong.check_invariants()));
            assert!(noticed.is_err(), "{what} is not noticed");
        }
    }

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
        let mut lower_bound = finding(Kind::Intersections, 2, 2, one(0..9));
        lower_bound.is_lower_bound = true;
        Diagnosis {
            schema: SCHEMA,
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
                finding(Kind::InsideOut, 1, 0, one(0..8)),
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
            intersecting pairs of facets: not all were examined; at least 2; 2 can change the mesh's region\n  Meaning of Intersections.\n  \
            at (0.1, 2, -3.5); facets 0, 1, 2, 3, 4, 5, 6, 7, ...\n  and 1 more (--limit)\n\n\
            facets of thin walls: 4; 4 can change the mesh's region\n  Meaning of ThinWalls.\n  \
            at (0.1, 2, -3.5): 0.125 wide (0.500 cells); facets 1, 2\n\n\
            closed shells inside out: 1\n  Meaning of InsideOut.\n  at (0.1, 2, -3.5); facets 0, 1, 2, 3, 4, 5, 6, 7\n\n\
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
        let nothing_yet = finding(Kind::ThinGaps, 0, 0, vec![]);
        plain.findings = vec![Finding { is_lower_bound: true, ..nothing_yet }];
        let text = plain.to_string();
        for part in [
            "facets at thin gaps: not all were examined; at least 0\n",
            "what was examined does not change",
        ] {
            assert!(text.contains(part), "{text}");
        }
    }
}
