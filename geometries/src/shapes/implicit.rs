//! Surfaces of solids that a distance function defines: a closed surface of triangles from the function and a grid (marching
//! tetrahedra), whose spacing is fitted to the number of facets.
//!
//! Each cube of the grid is divided into six tetrahedra around its diagonal. Every edge of a
//! tetrahedron whose ends lie on different sides of the surface has one vertex, at the zero of the
//! distance function along the edge, and each tetrahedron joins its vertices to triangles.
//! Tetrahedra have no ambiguous cases, so the result is a closed manifold for every function: each
//! edge of a triangle lies in a face shared by two tetrahedra.

use super::solids::{Points, Vec3};
use crate::mesh::EdgeHasher;
use crate::{Generator, GeneratorError, Mesh};
use multiversion::multiversion;
use std::collections::HashMap;

/// A solid that can be drawn at any grid spacing.
pub(super) trait Body {
    /// Minimum and maximum corner of a box that contains the solid when no part is thickened.
    const BOUNDS: [Vec3; 2];
    /// The number of facets times the square of the spacing, for a fine grid.
    const FACETS_TIMES_SQUARE: f64;

    /// The solid, in which no part is thinner than twice `radius_least`. A grid misses parts that
    /// are thinner than its cells, so thin parts are thickened on a coarse grid.
    fn new(radius_least: f64) -> Self;

    /// A function that is negative inside and has a Lipschitz constant of at most 1, at several points.
    fn distance<const N: usize>(&self, p: &Points<N>) -> [f64; N];
}

/// The distances at several points, by the widest vectors of the processor. They are the same for all widths: no operation is fused with another.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn distances<B: Body, const N: usize>(body: &B, p: &Points<N>) -> [f64; N] {
    body.distance(p)
}

/// The part of the requested facets that the grid should produce, and its minimum. Splitting edges
/// adds the other facets.
const AIM: f64 = 0.97;
const AIM_LEAST: f64 = 0.92;

/// Number of attempts in which the spacing may decrease as well as increase.
const ATTEMPTS: usize = 10;

/// Draws a body with at most the requested number of facets. The longest edge of its bounding box
/// is scaled to `length`, and the centre of the box along x is moved to the origin; y = 0 remains
/// the plane of symmetry.
pub(super) fn draw<B: Body>(of: &Generator) -> Result<Mesh, GeneratorError> {
    let length = of.dimension("length", of.length, 1.0)?;
    let mut mesh = fit::<B>(of.facets);
    let bounds: [[f64; 2]; 3] = std::array::from_fn(|a| {
        let along = mesh.vertices.iter().map(|p| p[a]);
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    });
    let longest = bounds.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let middle = (bounds[0][0] + bounds[0][1]) * 0.5;
    let scale = length / longest;
    for p in &mut mesh.vertices {
        *p = [(p[0] - middle) * scale, p[1] * scale, p[2] * scale];
    }
    Ok(mesh)
}

/// Finds the grid spacing for a number of facets. That number is nearly proportional to the inverse
/// square of the spacing. The constant for fine grids gives the first spacing; it is inaccurate for
/// coarse grids, on which the body is thickened, so each further spacing follows from the number of
/// facets of the previous one.
fn fit<B: Body>(facets: usize) -> Mesh {
    let aim = AIM * facets as f64;
    let mut spacing = (B::FACETS_TIMES_SQUARE / aim).sqrt();
    for attempt in 0.. {
        let mesh = Drawing::<B>::of(spacing);
        let count = mesh.triangles.len();
        if count <= facets && (count as f64 > AIM_LEAST * facets as f64 || attempt >= ATTEMPTS) {
            return mesh;
        }
        // After these attempts the spacing only increases, so the loop ends.
        let least = if attempt < ATTEMPTS { 0.0 } else { 1.02 };
        spacing *= (count as f64 / aim).sqrt().max(least);
    }
    unreachable!("a coarse enough grid has few enough facets")
}

/// Minimum radius of a part, in cells. A part thinner than the diagonal of a cell could lie between
/// grid points.
const RADIUS_LEAST: f64 = 0.95;

/// Cells of the grid on every side of the bounds.
const ROOM: f64 = 3.0;

/// Minimum distance of a vertex from the ends of its edge, as a fraction of the edge, so that no
/// triangle degenerates.
const MARGIN: f64 = 0.05;

/// Cells along the edge of a block, the unit of sampling.
const BLOCK: usize = 4;

/// Number of vertices that are placed at once.
const LANES: usize = 8;

/// An edge of the grid that crosses the surface: its vertex, which is not placed yet, its ends and the distances there.
#[derive(Clone, Copy)]
struct Crossing {
    vertex: u32,
    ends: [Vec3; 2],
    values: [f64; 2],
}

/// A surface under construction.
struct Drawing<B> {
    body: B,
    low: Vec3,
    spacing: f64,
    mesh: Mesh,
    /// Vertex indices by grid edge: its lower end, 20 bits per coordinate, and its direction, 3
    /// bits.
    indices: HashMap<u64, u32, EdgeHasher>,
    /// Vertices to be placed, fewer than `LANES`.
    crossings: Vec<Crossing>,
}

/// The integer coordinates of a grid point.
type GridPoint = [usize; 3];

impl<B: Body> Drawing<B> {
    /// The surface on a grid with this spacing.
    fn of(spacing: f64) -> Mesh {
        // A thickened part may extend one radius beyond the bounds.
        let room = ROOM * spacing;
        let [low, high] = B::BOUNDS;
        let widest = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max) + 2.0 * room;
        let mut cells = BLOCK;
        while (cells as f64) * spacing < widest {
            cells *= 2;
        }
        assert!(cells < 1 << 20, "grid coordinates have 20 bits");
        let body = B::new(spacing * RADIUS_LEAST);
        let mut drawing = Self {
            body,
            low: low.map(|x| x - room),
            spacing,
            mesh: Mesh::default(),
            indices: HashMap::default(),
            crossings: Vec::with_capacity(LANES),
        };
        drawing.visit([0; 3], cells);
        drawing.place();
        drawing.mesh
    }

    fn position(&self, point: GridPoint) -> Vec3 {
        std::array::from_fn(|a| self.low[a] + point[a] as f64 * self.spacing)
    }

    /// Samples the blocks within a cube of the grid that may contain surface. A cube contains none
    /// if the distance at its centre exceeds half its diagonal.
    fn visit(&mut self, origin: GridPoint, cells: usize) {
        let half = cells as f64 * 0.5 * self.spacing;
        let centre = self.position(origin).map(|x| [x + half]);
        let reach = half * 1.7321;
        if distances(&self.body, &centre)[0].abs() > reach {
            return;
        }
        if cells == BLOCK {
            return self.block(origin);
        }
        for octant in 0..8 {
            let half = cells / 2;
            self.visit(std::array::from_fn(|a| origin[a] + half * (octant >> a & 1)), half);
        }
    }

    fn block(&mut self, origin: GridPoint) {
        const POINTS: usize = BLOCK + 1;
        let mut values = [0.0; POINTS * POINTS * POINTS];
        let index = |[x, y, z]: GridPoint| (z * POINTS + y) * POINTS + x;
        for (z, values) in values.chunks_mut(POINTS * POINTS).enumerate() {
            let sample =
                |i| self.position([origin[0] + i % POINTS, origin[1] + i / POINTS, origin[2] + z]);
            let points = [0, 1, 2].map(|a| std::array::from_fn(|i| sample(i)[a]));
            values.copy_from_slice(&distances::<B, { POINTS * POINTS }>(&self.body, &points));
        }
        for z in 0..BLOCK {
            for y in 0..BLOCK {
                for x in 0..BLOCK {
                    let corners: [f64; 8] = std::array::from_fn(|mask| {
                        values[index([x + (mask & 1), y + (mask >> 1 & 1), z + (mask >> 2)])]
                    });
                    let inside = corners.iter().filter(|&&value| value < 0.0).count();
                    if inside % 8 != 0 {
                        self.cube([origin[0] + x, origin[1] + y, origin[2] + z], &corners);
                    }
                }
            }
        }
    }

    /// Draws the six tetrahedra of a cube. The bits of a corner's index are its offset along the
    /// axes. A tetrahedron is a path from corner 0 to corner 7 that sets one bit at a time.
    fn cube(&mut self, origin: GridPoint, corners: &[f64; 8]) {
        for (first, second, is_even) in
            [(1, 2, true), (2, 4, true), (4, 1, true), (2, 1, false), (4, 2, false), (1, 4, false)]
        {
            self.tetrahedron(origin, corners, [0, first, first | second, 7], is_even);
        }
    }

    /// Draws one tetrahedron. `is_even` is whether its four corners, in this order, are positively
    /// oriented.
    fn tetrahedron(
        &mut self,
        origin: GridPoint,
        values: &[f64; 8],
        masks: [usize; 4],
        is_even: bool,
    ) {
        let inside = masks.map(|mask| values[mask] < 0.0);
        // The permutation is even, so it preserves the orientation.
        let Some((order, count)) = inside_first(inside) else {
            return;
        };
        let [a, b, c, d] = order.map(|i| masks[i]);
        let mut vertex = |from: usize, to: usize| self.vertex(origin, values, from, to);
        let corners = match count {
            1 => [vertex(a, b), vertex(a, c), vertex(a, d), 0],
            2 => [vertex(a, c), vertex(a, d), vertex(b, d), vertex(b, c)],
            _ => [vertex(a, d), vertex(b, d), vertex(c, d), 0],
        };
        let [p, q, r, s] = corners;
        let mut triangle = |p, q, r| {
            self.mesh.triangles.push(if is_even { [p, q, r] } else { [p, r, q] });
        };
        triangle(p, q, r);
        if count == 2 {
            triangle(p, r, s);
        }
    }

    /// The vertex on the edge between two corners of a cube. The bits of one corner contain those
    /// of the other.
    fn vertex(&mut self, origin: GridPoint, values: &[f64; 8], from: usize, to: usize) -> u32 {
        let (low, high) = (from & to, from | to);
        let start: GridPoint = std::array::from_fn(|a| origin[a] + (low >> a & 1));
        let direction = high ^ low;
        let key = (start[2] as u64) << 43 | (start[1] as u64) << 23 | (start[0] as u64) << 3;
        let key = key | direction as u64;
        if let Some(&index) = self.indices.get(&key) {
            return index;
        }
        let end = std::array::from_fn(|a| start[a] + (direction >> a & 1));
        let vertex = self.mesh.add_vertex([0.0; 3]);
        self.indices.insert(key, vertex);
        let ends = [start, end].map(|point| self.position(point));
        self.crossings.push(Crossing { vertex, ends, values: [values[low], values[high]] });
        if self.crossings.len() == LANES {
            self.place();
        }
        vertex
    }

    /// Places vertices where the distance is zero along their edges, by the Illinois variant of the false position method.
    fn place(&mut self) {
        let Some(last) = self.crossings.last() else { return };
        let edges: [Crossing; LANES] =
            std::array::from_fn(|i| *self.crossings.get(i).unwrap_or(last));
        let along = |i: usize, t: f64| {
            let [p, q] = edges[i].ends;
            [0, 1, 2].map(|a| p[a] + (q[a] - p[a]) * t)
        };
        let (mut low, mut high) =
            (edges.map(|e| (0.0, e.values[0])), edges.map(|e| (1.0, e.values[1])));
        let mut t = [0.5; LANES];
        for _ in 0..3 {
            for i in 0..LANES {
                let (low, high) = (low[i], high[i]);
                t[i] = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            }
            let points = [0, 1, 2].map(|a| std::array::from_fn(|i| along(i, t[i])[a]));
            let values = distances::<B, LANES>(&self.body, &points);
            for i in 0..LANES {
                if (values[i] < 0.0) == (low[i].1 < 0.0) {
                    low[i] = (t[i], values[i]);
                    high[i].1 *= 0.5;
                } else {
                    high[i] = (t[i], values[i]);
                    low[i].1 *= 0.5;
                }
            }
        }
        for (i, edge) in self.crossings.drain(..).enumerate() {
            self.mesh.vertices[edge.vertex as usize] = along(i, t[i].clamp(MARGIN, 1.0 - MARGIN));
        }
    }
}

/// An even permutation of the four corners that puts those inside first, and the number of these, 1
/// to 3. `None` if all corners are on one side.
fn inside_first(inside: [bool; 4]) -> Option<([usize; 4], usize)> {
    let mask = inside.iter().enumerate().fold(0, |mask, (i, &is)| mask | usize::from(is) << i);
    let order = match mask {
        0b0001 => [0, 1, 2, 3],
        0b0010 => [1, 2, 0, 3],
        0b0100 => [2, 0, 1, 3],
        0b1000 => [3, 0, 2, 1],
        0b0011 => [0, 1, 2, 3],
        0b0101 => [0, 2, 3, 1],
        0b1001 => [0, 3, 1, 2],
        0b0110 => [1, 2, 0, 3],
        0b1010 => [1, 3, 2, 0],
        0b1100 => [2, 3, 0, 1],
        0b0111 => [0, 1, 2, 3],
        0b1011 => [0, 3, 1, 2],
        0b1101 => [0, 2, 3, 1],
        0b1110 => [1, 3, 2, 0],
        _ => return None,
    };
    Some((order, mask.count_ones() as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Ball;

    impl Body for Ball {
        const BOUNDS: [Vec3; 2] = [[-1.1; 3], [1.1; 3]];
        const FACETS_TIMES_SQUARE: f64 = 100.0;

        fn new(_: f64) -> Self {
            Self
        }

        fn distance<const N: usize>(&self, [x, y, z]: &Points<N>) -> [f64; N] {
            std::array::from_fn(|i| (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt() - 1.0)
        }
    }

    #[test]
    fn a_ball_is_closed_and_has_the_volume_and_euler_number_of_a_ball() {
        let mesh = fit::<Ball>(30_000);
        assert!((27_000..=30_000).contains(&mesh.triangles.len()));
        assert!(mesh.is_closed() && mesh.flat_facet().is_none());
        assert!((mesh.volume() - 4.18879).abs() < 0.01);
        let euler = mesh.vertices.len() as i64 - mesh.triangles.len() as i64 / 2;
        assert_eq!(euler, 2);
    }

    #[test]
    fn distances_do_not_depend_on_the_width_of_vectors() {
        fn compare<B: Body>() {
            let body = B::new(0.001);
            for i in 0..4000 {
                // A lattice of rank 1 in the bounds.
                let at = |a: usize, lane: usize| {
                    let t = (f64::from(i * 8) + lane as f64) * [0.754_877, 0.569_840, 0.430_160][a];
                    B::BOUNDS[0][a] + (B::BOUNDS[1][a] - B::BOUNDS[0][a]) * t.fract()
                };
                let p = [0, 1, 2].map(|a| std::array::from_fn(|lane| at(a, lane)));
                let [wide, narrow]: [[f64; 8]; 2] = [distances(&body, &p), body.distance(&p)];
                assert_eq!(wide.map(f64::to_bits), narrow.map(f64::to_bits), "{p:?}");
            }
        }
        compare::<super::super::aircraft::Uav>();
        compare::<super::super::aircraft::Fighter<true>>();
    }

    #[test]
    fn inside_corners_come_first_by_an_even_permutation() {
        for mask in 1..15_usize {
            let inside: [bool; 4] = std::array::from_fn(|i| mask >> i & 1 == 1);
            let (order, count) = inside_first(inside).unwrap();
            assert_eq!(count, mask.count_ones() as usize);
            for (position, &corner) in order.iter().enumerate() {
                assert_eq!(inside[corner], position < count, "mask {mask:04b}");
            }
            let mut seen = order;
            seen.sort_unstable();
            assert_eq!(seen, [0, 1, 2, 3]);
            let inversions = (0..4)
                .flat_map(|i| (i + 1..4).map(move |j| (i, j)))
                .filter(|&(i, j)| order[i] > order[j])
                .count();
            assert_eq!(inversions % 2, 0, "mask {mask:04b}");
        }
        assert_eq!(inside_first([false; 4]), None);
        assert_eq!(inside_first([true; 4]), None);
    }
}
