//! Assemblies of several closed surfaces, which overlap or enclose each other.
//!
//! Facets are distributed over the parts by surface area.

use super::basic::{geodesic, slab};
use crate::{Generator, GeneratorError, Mesh};

/// One closed surface of an assembly.
struct Part {
    solid: Solid,
    centre: [f64; 3],
    /// Whether the surface bounds a cavity, so that its normals point inward.
    is_cavity: bool,
}

enum Solid {
    /// An axis-aligned box with these edges.
    Box([f64; 3]),
    /// An ellipsoid with these semi-axes.
    Ellipsoid([f64; 3]),
}

impl Part {
    fn new(solid: Solid, centre: [f64; 3]) -> Self {
        Self { solid, centre, is_cavity: false }
    }

    fn cavity(solid: Solid) -> Self {
        Self { solid, centre: [0.0; 3], is_cavity: true }
    }

    fn facets_least(&self) -> usize {
        match self.solid {
            Solid::Box(_) => 12,
            Solid::Ellipsoid(_) => 20,
        }
    }

    /// A measure of the surface area, by which facets are distributed.
    fn area(&self) -> f64 {
        let ([x, y, z], factor) = match self.solid {
            Solid::Box(edges) => (edges, 2.0),
            // A sphere has about this area per product of two semi-axes.
            Solid::Ellipsoid(axes) => (axes, 4.0),
        };
        factor * (x * y + y * z + z * x)
    }

    fn draw(&self, facets: usize) -> Mesh {
        let mut mesh = match self.solid {
            Solid::Box(edges) => slab(edges, facets),
            Solid::Ellipsoid(axes) => {
                let mut ball = geodesic(1.0, facets);
                ball.scale(axes);
                ball
            }
        };
        if self.is_cavity {
            mesh.flip();
        }
        mesh.translate(self.centre);
        mesh
    }
}

/// Draws all parts with at most `facets` facets, which must suffice for the minimum of each part.
fn assemble(parts: &[Part], facets: usize) -> Mesh {
    let spare = facets - parts.iter().map(Part::facets_least).sum::<usize>();
    let area: f64 = parts.iter().map(Part::area).sum();
    let mut mesh = Mesh::default();
    for part in parts {
        let share = (spare as f64 * (part.area() / area)) as usize;
        mesh.append(&part.draw(part.facets_least() + share));
    }
    mesh
}

/// Two cubes, the first about the origin. The offset of the second is not a simple fraction of the
/// edge, so that the two surfaces have no edges or vertices in common.
pub(super) fn boxes_overlapping(of: &Generator) -> Result<Mesh, GeneratorError> {
    let edge = of.dimension("edge", of.edge, 1.0)?;
    let offset = [0.5477, 0.4583, 0.3606].map(|x| x * edge);
    let parts = [[0.0; 3], offset].map(|centre| Part::new(Solid::Box([edge; 3]), centre));
    Ok(assemble(&parts, of.facets))
}

/// A cube about the origin with a cubic cavity.
pub(super) fn box_in_box(of: &Generator) -> Result<Mesh, GeneratorError> {
    let edge = of.dimension("edge", of.edge, 1.0)?;
    let thickness = of.dimension("thickness", of.thickness, edge * 0.25)?;
    let inner = edge - 2.0 * thickness;
    if inner <= 0.0 {
        let (value, requirement) = (thickness, format!("must be less than half of edge = {edge}"));
        return Err(GeneratorError::InvalidDimension { key: "thickness", value, requirement });
    }
    let parts = [Part::new(Solid::Box([edge; 3]), [0.0; 3]), Part::cavity(Solid::Box([inner; 3]))];
    Ok(assemble(&parts, of.facets))
}

/// Spheres about the origin, the inner ones with two thirds and one third of the radius.
pub(super) fn three_spheres(of: &Generator) -> Result<Mesh, GeneratorError> {
    let radius = of.dimension("radius", of.radius, 0.5)?;
    let ball = |part: f64| Solid::Ellipsoid([radius * part; 3]);
    let parts = [
        Part::new(ball(1.0), [0.0; 3]),
        Part::cavity(ball(2.0 / 3.0)),
        Part::new(ball(1.0 / 3.0), [0.0; 3]),
    ];
    Ok(assemble(&parts, of.facets))
}

/// A car about the origin, its nose towards -x and its wheels at negative z.
pub(super) fn car(of: &Generator) -> Result<Mesh, GeneratorError> {
    let length = of.dimension("length", of.length, 1.0)?;
    let boxed = |edges: [f64; 3], centre| (Solid::Box(edges.map(|x| x * length)), centre);
    let ball = |axes: [f64; 3], centre| (Solid::Ellipsoid(axes.map(|x| x * length)), centre);
    let wheel = |x, y| ball([0.079, 0.031, 0.079], [x, y, -0.083]);
    let mirror = |y| ball([0.017, 0.033, 0.021], [-0.127, y, 0.087]);
    let parts = [
        boxed([1.0, 0.38, 0.16], [0.0; 3]),
        boxed([0.47, 0.323, 0.171], [0.061, 0.0, 0.113]),
        wheel(-0.307, -0.169),
        wheel(-0.307, 0.169),
        wheel(0.293, -0.169),
        wheel(0.293, 0.169),
        mirror(-0.181),
        mirror(0.181),
    ];
    let placed = parts
        .map(|(solid, centre): (Solid, [f64; 3])| Part::new(solid, centre.map(|x| x * length)));
    Ok(assemble(&placed, of.facets))
}
