//! Openings: connected sets of open edges, that is, of edges with one facet, apart from T-junctions.

use contract::lattice::UNITS_PER_EDGE;
use contract::octant::CELLS_PER_EDGE;
use contract::sets::Sets;

use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::junctions::{Segment, uncancelled};
use super::width;

/// A vertex this near to an edge lies on it, in lattice units. The finest cells are 256 units wide.
const TOLERANCE: f64 = 2.0;

/// The boundary of all openings.
struct Rims {
    segments: Vec<Segment>,
    /// Coordinates by vertex index, in the user's units.
    points: Vec<[f64; 3]>,
}

/// All openings, widest first: a hole, the rim of a sheet, or several that share a vertex.
pub fn openings(input: &Input, edges: &Edges, first: usize) -> Finding {
    let open = rims(input, edges);
    let tolerance = TOLERANCE * input.root.edge / UNITS_PER_EDGE as f64;
    let segments = uncancelled(open.segments, &open.points, tolerance);
    let rims = Rims { segments, points: open.points };
    let mut places: Vec<Place> =
        components(&rims).iter().map(|component| place(&rims, component)).collect();
    places.sort_by(|a, b| order(b.width, a.width).then(a.facets.cmp(&b.facets)));
    let mut finding = Finding::new(Kind::Openings);
    finding.count = places.len() as u64;
    finding.count_changing = places.iter().filter(|p| is_leak(input, p)).count() as u64;
    places.truncate(first);
    finding.places = places;
    finding
}

/// Whether cells may fit through the opening.
fn is_leak(input: &Input, place: &Place) -> bool {
    // Without a spacing, any may be chosen, up to the finest.
    let cell = input.cell.unwrap_or(input.root.edge / f64::from(CELLS_PER_EDGE));
    place.width.is_some_and(|width| width >= cell)
}

/// All open edges.
fn rims(input: &Input, edges: &Edges) -> Rims {
    let open = edges.iter().filter_map(|(ends, mut uses)| {
        let is_open = uses.len() == 1;
        uses.next().filter(|_| is_open).map(|u| Segment { ends, facet: u.facet })
    });
    let mut segments: Vec<Segment> = open.collect();
    let with_facet = |s: &Segment| s.ends.map(|v| (v, s.facet));
    let mut vertices: Vec<(u32, u32)> = segments.iter().flat_map(with_facet).collect();
    vertices.sort_unstable();
    vertices.dedup_by_key(|(v, _)| *v);
    let points = vertices.iter().map(|&(v, facet)| edges.position(input, facet, v)).collect();
    let index = |v: u32| vertices.binary_search_by_key(&v, |(v, _)| *v).expect("listed") as u32;
    segments.iter_mut().for_each(|s| s.ends = s.ends.map(index));
    Rims { segments, points }
}

/// The segments by component.
fn components(rims: &Rims) -> Vec<Vec<Segment>> {
    let mut sets = Sets::new(rims.points.len());
    for segment in &rims.segments {
        sets.union(segment.ends[0], segment.ends[1]);
    }
    let mut labelled: Vec<(u32, Segment)> =
        rims.segments.iter().map(|s| (sets.root(s.ends[0]), *s)).collect();
    labelled.sort_by_key(|(label, segment)| (*label, segment.ends));
    let component = |same: &[(u32, Segment)]| same.iter().map(|(_, segment)| *segment).collect();
    labelled.chunk_by(|a, b| a.0 == b.0).map(component).collect()
}

fn place(rims: &Rims, component: &[Segment]) -> Place {
    let ends = |s: &Segment| s.ends.map(|v| rims.points[v as usize]);
    let points: Vec<[f64; 3]> = component.iter().flat_map(ends).collect();
    let centre =
        std::array::from_fn(|a| points.iter().map(|p| p[a]).sum::<f64>() / points.len() as f64);
    let mut facets: Vec<u32> = component.iter().map(|s| s.facet).collect();
    facets.sort_unstable();
    facets.dedup();
    facets.truncate(Place::FACETS_MAX);
    Place { width: Some(width::width(&points)), ..Place::new(facets, centre) }
}

fn order(a: Option<f64>, b: Option<f64>) -> std::cmp::Ordering {
    a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0))
}
