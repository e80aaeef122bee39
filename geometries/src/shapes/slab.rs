//! Axis-aligned boxes: the cube and the thin plate. Each face is a grid of rectangles of two facets
//! each.

use std::collections::HashMap;

use super::pitch_finest;
use crate::{Generator, GeneratorError, Mesh};

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
    let mut drawing = Drawing { sizes, divisions, mesh: Mesh::default(), indices: HashMap::new() };
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

struct Drawing {
    sizes: [f64; 3],
    divisions: [usize; 3],
    mesh: Mesh,
    indices: HashMap<[usize; 3], u32>,
}

impl Drawing {
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
