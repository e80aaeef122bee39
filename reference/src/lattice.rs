//! Quantisation of a case to the integer lattice, on which every geometric decision is exact.
use crate::case_file::{Case, Enclosed, Keep, Root};
use crate::error::Error;
use crate::octant::{Extent, LEVEL_MAX, ROOT_EDGE};

/// A facet: three lattice points, each coordinate within [-2^27, 2^28].
pub type Facet = [[i64; 3]; 3];

/// An extent box on the lattice, clamped to the root.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatticeBox {
    /// The box, in lattice units.
    pub extent: Extent,
    /// Minimum level of the leaves that meet the box.
    pub level: u32,
}

/// A case on the lattice: the complete input of the algorithm.
#[derive(Clone, Debug)]
pub struct Input {
    /// The root, used only to report a location in the user's unit.
    pub root: Root,
    /// The facets.
    pub facets: Vec<Facet>,
    /// The extent boxes.
    pub boxes: Vec<LatticeBox>,
    /// The level D of `spacing_min`.
    pub level_surface: u32,
    /// Minimum thickness of a layer, in cells.
    pub layer_cells_min: u32,
    /// The region that the final mesh covers.
    pub keep: Keep,
    /// Whether crossing leaves stay in the final mesh.
    pub keep_crossing: bool,
    /// The seeds.
    pub seeds: Vec<Seed>,
    /// The treatment of outside components that do not reach the boundary of the root.
    pub enclosed: Enclosed,
}

/// A point in the flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// The seed in the user's unit, used only in messages.
    pub given: [f64; 3],
    /// The seed on the lattice. A coordinate outside the root is -1 or 2^27, which no leaf contains.
    pub point: [i64; 3],
}

impl Input {
    /// Validates a case and quantises it to the lattice.
    ///
    /// # Errors
    /// An edge or a spacing is not finite and positive; the origin is not finite; a layer has no
    /// cells; a spacing requires a level beyond 19; along an axis, a box has a corner that is not
    /// finite or a minimum that is not less than its maximum; a box has too many cells; a vertex is not finite or more than
    /// one root edge outside the root; a seed is not finite.
    pub fn new(case: &Case) -> Result<Self, Error> {
        let root = case.root;
        if !root.origin.iter().all(|x| x.is_finite()) {
            let origin = root.origin;
            return invalid(format!(
                "the root's origin {origin:?} is not finite: give three finite numbers"
            ));
        }
        if !is_length(root.edge) {
            let edge = root.edge;
            return invalid(format!(
                "the root's edge is {edge}: it must be finite and greater than 0"
            ));
        }
        if case.layer_cells_min == 0 {
            return invalid(
                "layer_cells_min is 0: it must be at least 1, which is plain 2:1 balance"
                    .to_owned(),
            );
        }
        let level_surface = level(&root, "spacing_min", case.spacing_min)?;
        let mut boxes = Vec::new();
        for (index, spec) in case.boxes.iter().enumerate() {
            let finite = spec.min.iter().chain(&spec.max).all(|x| x.is_finite());
            if !finite || (0..3).any(|a| spec.min[a] >= spec.max[a]) {
                return invalid(format!(
                    "box {index} extends from {:?} to {:?}: its corners must be finite and min less than max along every axis",
                    spec.min, spec.max
                ));
            }
            let level = level(&root, &format!("the spacing of box {index}"), spec.spacing)?;
            let corner = |x| quantised(&root, x).map(|q| q.clamp(0.0, ROOT_EDGE as f64) as i64);
            let extent = Extent { min: corner(spec.min), max: corner(spec.max) };
            let cells = cells_in(&extent, level);
            if cells > CELLS_MAX {
                return Err(Error::TooManyCells { index, cells });
            }
            boxes.push(LatticeBox { extent, level });
        }
        let facets = case.facets.iter().enumerate();
        let seeds = case.seeds.iter().enumerate();
        Ok(Self {
            root,
            facets: facets
                .map(|(index, facet)| quantised_facet(&root, index, facet))
                .collect::<Result<_, _>>()?,
            boxes,
            level_surface,
            layer_cells_min: case.layer_cells_min,
            keep: case.keep,
            keep_crossing: case.keep_crossing,
            seeds: seeds
                .map(|(index, &seed)| quantised_seed(&root, index, seed))
                .collect::<Result<_, _>>()?,
            enclosed: case.enclosed,
        })
    }
}

/// The location of a lattice point in the user's unit.
#[must_use]
pub fn location(root: &Root, point: [i64; 3]) -> [f64; 3] {
    let unit = root.edge / ROOT_EDGE as f64;
    std::array::from_fn(|a| root.origin[a] + point[a] as f64 * unit)
}

fn invalid<T>(problem: String) -> Result<T, Error> {
    Err(Error::Invalid(problem))
}

fn is_length(x: f64) -> bool {
    x.is_finite() && x > 0.0
}

/// More cells than this, of some fifty bytes each, take more memory than a serial run should.
const CELLS_MAX: f64 = 1e9;

/// The number of cells of a level that fill a box.
fn cells_in(extent: &Extent, level: u32) -> f64 {
    let edge = (ROOT_EDGE >> level) as f64;
    (0..3).map(|a| (extent.max[a] - extent.min[a]) as f64 / edge).product()
}

/// The coarsest level whose cells have an edge of at most `spacing`.
fn level(root: &Root, name: &str, spacing: f64) -> Result<u32, Error> {
    if !is_length(spacing) {
        return invalid(format!("{name} is {spacing}: it must be finite and greater than 0"));
    }
    let level = (0..=LEVEL_MAX).find(|&d| root.edge / f64::from(1_u32 << d) <= spacing);
    level.map_or_else(
        || {
            let least = root.edge / f64::from(1_u32 << LEVEL_MAX);
            invalid(format!(
                "{name} is {spacing}, less than {least}, the cell edge at the deepest level, 19: choose a larger spacing or a smaller root"
            ))
        },
        Ok,
    )
}

/// The nearest lattice point. The coordinates remain floating-point numbers because they may be too
/// large for an integer or not finite.
fn quantised(root: &Root, x: [f64; 3]) -> [f64; 3] {
    let scale = ROOT_EDGE as f64 / root.edge;
    std::array::from_fn(|a| ((x[a] - root.origin[a]) * scale).round_ties_even())
}

fn quantised_seed(root: &Root, index: usize, seed: [f64; 3]) -> Result<Seed, Error> {
    if !seed.iter().all(|x| x.is_finite()) {
        return invalid(format!("seed {index} is {seed:?}: give three finite numbers"));
    }
    let point = quantised(root, seed).map(|q| q.clamp(-1.0, ROOT_EDGE as f64) as i64);
    Ok(Seed { given: seed, point })
}

fn quantised_facet(root: &Root, index: usize, facet: &[[f64; 3]; 3]) -> Result<Facet, Error> {
    let mut points = [[0; 3]; 3];
    for (point, &vertex) in points.iter_mut().zip(facet) {
        let q = quantised(root, vertex);
        if !vertex.iter().chain(&q).all(|x| x.is_finite()) {
            return invalid(format!(
                "facet {index} has a vertex {vertex:?} that is not finite: repair the geometry"
            ));
        }
        let allowed = -(ROOT_EDGE as f64)..=2.0 * ROOT_EDGE as f64;
        if !q.iter().all(|x| allowed.contains(x)) {
            return invalid(format!(
                "facet {index} has a vertex {vertex:?} more than one root edge outside the root (origin {:?}, edge {}): enlarge or move the \
                 root, or correct the vertex",
                root.origin, root.edge
            ));
        }
        // The conversion is exact: q are integers of at most 2^28 in absolute value.
        *point = q.map(|x| x as i64);
    }
    Ok(points)
}
