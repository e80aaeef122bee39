//! The basic shapes: boxes, which are the cube and the thin plate, spheres and the torus. Each face of a box is a grid of rectangles of
//! two facets each. A geodesic sphere is an icosahedron with evenly divided edges, projected onto the sphere.

use super::pitch_finest;
use crate::{Generator, GeneratorError, Mesh};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// A cube centred on the origin.
pub(super) fn cube(of: &Generator) -> Result<Mesh, GeneratorError> {
    let edge = of.dimension("edge", of.edge, 1.0)?;
    Ok(slab([edge; 3], of.facets))
}

/// A thin plate centred on the origin.
pub(super) fn plate(of: &Generator) -> Result<Mesh, GeneratorError> {
    let sizes = [
        of.dimension("length", of.length, 1.0)?,
        of.dimension("width", of.width, 0.5)?,
        of.dimension("thickness", of.thickness, 0.01)?,
    ];
    Ok(slab(sizes, of.facets))
}

/// A box centred on the origin.
pub(super) fn slab(sizes: [f64; 3], facets: usize) -> Mesh {
    let divisions = divisions(sizes, facets);
    let mut drawing =
        BoxDrawing { sizes, divisions, mesh: Mesh::default(), indices: HashMap::new() };
    for axis in 0..3 {
        drawing.face(axis, false);
        drawing.face(axis, true);
    }
    drawing.mesh
}

/// Number of facets of a box with these divisions along the axes.
fn facets_of([x, y, z]: [usize; 3]) -> usize {
    4 * (x * y + y * z + z * x)
}

/// The finest division into nearly square rectangles that does not exceed the number of facets.
fn divisions(sizes: [f64; 3], facets: usize) -> [usize; 3] {
    let divided = |pitch: f64| sizes.map(|size| ((size / pitch) as usize).max(1));
    let longest = sizes.into_iter().fold(0.0, f64::max);
    divided(pitch_finest(longest, facets, |pitch| facets_of(divided(pitch))))
}

struct BoxDrawing {
    sizes: [f64; 3],
    divisions: [usize; 3],
    mesh: Mesh,
    indices: HashMap<[usize; 3], u32>,
}

impl BoxDrawing {
    /// One of the two faces that are normal to an axis.
    fn face(&mut self, axis: usize, high: bool) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        for j in 0..self.divisions[c] {
            for i in 0..self.divisions[b] {
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
                    let mut point = [0; 3];
                    point[axis] = if high { self.divisions[axis] } else { 0 };
                    point[b] = i + di;
                    point[c] = j + dj;
                    self.vertex(point)
                });
                let [p, q, r, s] = corners;
                self.mesh.add_quad(if high { [p, q, r, s] } else { [p, s, r, q] });
            }
        }
    }

    fn vertex(&mut self, point: [usize; 3]) -> u32 {
        if let Some(&index) = self.indices.get(&point) {
            return index;
        }
        // The first and the last position are exactly half the size, so faces stay in their lattice
        // planes.
        let position = std::array::from_fn(|a| {
            let (i, of) = (point[a] as f64, self.divisions[a] as f64);
            (2.0 * i - of) / of * (self.sizes[a] * 0.5)
        });
        let index = self.mesh.add_vertex(position);
        self.indices.insert(point, index);
        index
    }
}

/// A sphere about the origin.
pub(super) fn sphere(of: &Generator) -> Result<Mesh, GeneratorError> {
    let radius = of.dimension("radius", of.radius, 0.5)?;
    Ok(geodesic(radius, of.facets))
}

/// A shell. The normals of the inner sphere point to the centre, because the core is outside the
/// shell.
pub(super) fn nested_spheres(of: &Generator) -> Result<Mesh, GeneratorError> {
    let radius = of.dimension("radius", of.radius, 0.5)?;
    let radius_inner = of.dimension("radius_inner", of.radius_inner, radius * 0.5)?;
    let invalid = |requirement| {
        let (key, value) = ("radius_inner", radius_inner);
        Err(GeneratorError::InvalidDimension { key, value, requirement })
    };
    if radius_inner >= radius {
        return invalid(format!("must be less than radius = {radius}"));
    }
    // Facets have about the same size on both spheres.
    let (outer, inner) = (radius * radius, radius_inner * radius_inner);
    let facets_inner = ((of.facets as f64 * (inner / (outer + inner))) as usize).max(20);
    let mut inside = geodesic(radius_inner, facets_inner);
    inside.flip();
    let mut mesh = geodesic(radius, of.facets - inside.triangles.len());
    // Facets lie nearer to the centre than their vertices, on either sphere.
    let least = mesh.least_distance();
    if radius_inner >= least {
        return invalid(format!(
            "must be less than {least}, where the facets of the outer sphere are nearest to the centre (request more facets)"
        ));
    }
    mesh.append(&inside);
    Ok(mesh)
}

/// A torus about the origin: a ring around the z axis.
pub(super) fn torus(of: &Generator) -> Result<Mesh, GeneratorError> {
    let radius = of.dimension("radius", of.radius, 0.5)?;
    let radius_tube = of.dimension("radius_tube", of.radius_tube, radius * 0.2)?;
    if radius_tube >= radius {
        let (value, requirement) = (radius_tube, format!("must be less than radius = {radius}"));
        return Err(GeneratorError::InvalidDimension { key: "radius_tube", value, requirement });
    }
    let around = |radius: f64, pitch: f64| ((TAU * radius / pitch) as usize).max(3);
    let divisions = |pitch| (around(radius, pitch), around(radius_tube, pitch));
    let pitch = pitch_finest(TAU * radius, of.facets, |pitch| {
        let (ring, tube) = divisions(pitch);
        2 * ring * tube
    });
    let (ring, tube) = divisions(pitch);
    let mut mesh = Mesh::default();
    for i in 0..ring {
        let (sin, cos) = libm::sincos(TAU * i as f64 / ring as f64);
        for j in 0..tube {
            let (up, out) = libm::sincos(TAU * j as f64 / tube as f64);
            let reach = radius + radius_tube * out;
            mesh.add_vertex([reach * cos, reach * sin, radius_tube * up]);
        }
    }
    let index = |i: usize, j: usize| ((i % ring) * tube + j % tube) as u32;
    for i in 0..ring {
        for j in 0..tube {
            mesh.add_quad([index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]);
        }
    }
    Ok(mesh)
}

/// The finest geodesic sphere of at most `facets` facets. A sphere of frequency f has 20 f^2
/// facets.
pub(super) fn geodesic(radius: f64, facets: usize) -> Mesh {
    let frequency = (facets / 20).isqrt().max(1);
    let mut drawing =
        SphereDrawing { radius, frequency, mesh: Mesh::default(), indices: HashMap::new() };
    for corners in ICOSAHEDRON {
        drawing.face(corners);
    }
    drawing.mesh
}

/// Facets of the icosahedron, counter-clockwise as seen from outside.
const ICOSAHEDRON: [[usize; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// Corner `i` of the icosahedron, not normalised: the cyclic permutations of (0, 1, golden ratio).
fn corner(i: usize) -> [f64; 3] {
    let golden = (1.0 + 5.0_f64.sqrt()) * 0.5;
    let first = if i.is_multiple_of(2) { -1.0 } else { 1.0 };
    let second = if i % 4 < 2 { golden } else { -golden };
    match i / 4 {
        0 => [first, second, 0.0],
        1 => [0.0, first, second],
        _ => [second, 0.0, first],
    }
}

struct SphereDrawing {
    radius: f64,
    frequency: usize,
    mesh: Mesh,
    /// Vertex indices by barycentric coordinates (corner, weight), which are the same for all
    /// facets.
    indices: HashMap<[(usize, usize); 3], u32>,
}

impl SphereDrawing {
    fn face(&mut self, corners: [usize; 3]) {
        let f = self.frequency;
        for j in 0..f {
            for i in 0..f - j {
                let mut vertex = |i: usize, j: usize| self.vertex(corners, [f - i - j, i, j]);
                let (p, q, r) = (vertex(i, j), vertex(i + 1, j), vertex(i, j + 1));
                let opposite = (i + j + 1 < f).then(|| vertex(i + 1, j + 1));
                self.mesh.triangles.push([p, q, r]);
                if let Some(s) = opposite {
                    self.mesh.triangles.push([q, s, r]);
                }
            }
        }
    }

    fn vertex(&mut self, corners: [usize; 3], weights: [usize; 3]) -> u32 {
        let mut key =
            [0, 1, 2].map(|c| if weights[c] == 0 { (0, 0) } else { (corners[c], weights[c]) });
        key.sort_unstable();
        if let Some(&index) = self.indices.get(&key) {
            return index;
        }
        // The sum follows the order of the key, so the position does not depend on the facet.
        let mut p = [0.0; 3];
        for (c, weight) in key {
            let q = corner(c);
            p = std::array::from_fn(|a| p[a] + q[a] * weight as f64);
        }
        let scale = self.radius / (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        let index = self.mesh.add_vertex(p.map(|x| x * scale));
        self.indices.insert(key, index);
        index
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_is_divided_equally_along_all_axes() {
        assert_eq!(divisions([1.0; 3], 12), [1; 3]);
        assert_eq!(divisions([1.0; 3], 47), [1; 3]);
        assert_eq!(divisions([1.0; 3], 48), [2; 3]);
        assert_eq!(divisions([1.0; 3], 12 * 64 * 64), [64; 3]);
    }

    #[test]
    fn a_plate_is_not_divided_across_its_thickness() {
        let [x, y, z] = divisions([1.0, 0.5, 0.001], 5_000);
        assert_eq!(z, 1);
        assert!((1.8..2.2).contains(&(x as f64 / y as f64)));
    }
}
