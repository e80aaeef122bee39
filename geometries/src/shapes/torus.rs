//! A ring around the z axis.

use std::f64::consts::TAU;

use super::pitch_finest;
use crate::{Generator, GeneratorError, Mesh};

/// A torus about the origin.
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
