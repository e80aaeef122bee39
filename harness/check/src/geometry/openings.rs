//! Openings: connected sets of open edges, that is, of edges with one facet.

use super::edges::Edges;
use super::input::Input;
use super::report::{Finding, Kind, Place};
use super::shells::{find, unite};
use super::width;

/// An open edge: its vertices, and its one facet.
#[derive(Clone, Copy)]
struct Open {
    ends: [u32; 2],
    facet: u32,
}

/// All openings, widest first: a hole, the rim of a sheet, or several that share a vertex.
pub fn openings(input: &Input, edges: &Edges, first: usize) -> Finding {
    let open = open_edges(edges);
    let mut finding = Finding::new(Kind::Openings);
    finding.edges = Some(open.len() as u64);
    let mut places: Vec<Place> =
        components(&open).iter().map(|component| place(input, edges, component)).collect();
    places.sort_by(|a, b| {
        order(b.width, a.width).then(order(b.diameter, a.diameter)).then(a.facets.cmp(&b.facets))
    });
    finding.count = places.len() as u64;
    finding.count_changing = places.iter().filter(|p| is_leak(input, p)).count() as u64;
    places.truncate(first);
    finding.places = places;
    finding
}

/// Whether cells may fit through the opening.
fn is_leak(input: &Input, place: &Place) -> bool {
    place.width.is_some_and(|width| match input.cell {
        Some(cell) => width >= cell,
        None => width > 0.0,
    })
}

fn open_edges(edges: &Edges) -> Vec<Open> {
    let open = edges.iter().filter_map(|(ends, mut uses)| {
        let is_open = uses.len() == 1;
        uses.next().filter(|_| is_open).map(|u| Open { ends, facet: u.facet })
    });
    open.collect()
}

/// The open edges by component.
fn components(open: &[Open]) -> Vec<Vec<Open>> {
    let mut vertices: Vec<u32> = open.iter().flat_map(|edge| edge.ends).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let index = |v: u32| vertices.binary_search(&v).expect("an end of an open edge") as u32;
    let mut parents: Vec<u32> = (0..vertices.len() as u32).collect();
    for edge in open {
        unite(&mut parents, index(edge.ends[0]), index(edge.ends[1]));
    }
    let mut labelled: Vec<(u32, Open)> =
        open.iter().map(|edge| (find(&mut parents, index(edge.ends[0])), *edge)).collect();
    labelled.sort_by_key(|(label, edge)| (*label, edge.ends));
    let component = |same: &[(u32, Open)]| same.iter().map(|(_, edge)| *edge).collect();
    labelled.chunk_by(|a, b| a.0 == b.0).map(component).collect()
}

fn place(input: &Input, edges: &Edges, component: &[Open]) -> Place {
    let ends = |edge: &Open| edge.ends.map(|v| edges.position(input, edge.facet, v));
    let points: Vec<[f64; 3]> = component.iter().flat_map(ends).collect();
    let centre =
        std::array::from_fn(|a| points.iter().map(|p| p[a]).sum::<f64>() / points.len() as f64);
    let mut facets: Vec<u32> = component.iter().map(|edge| edge.facet).collect();
    facets.sort_unstable();
    facets.dedup();
    facets.truncate(Place::FACETS_MAX);
    let size = width::size(&points);
    Place {
        edges: Some(component.len() as u64),
        diameter: Some(size.diameter),
        diameter_cells: input.in_cells(size.diameter),
        width: Some(size.width),
        width_cells: input.in_cells(size.width),
        ..Place::new(facets, centre)
    }
}

fn order(a: Option<f64>, b: Option<f64>) -> std::cmp::Ordering {
    a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0))
}
