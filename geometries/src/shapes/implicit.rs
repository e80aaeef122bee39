//! From a solid given by a distance function to a surface of so many triangles: which grid it takes.

use super::solids::Vec3;
use crate::{Generator, GeneratorError, Mesh};
use grid::Drawing;

mod grid;

/// A solid that can be drawn at any grid spacing.
pub(super) trait Body {
    /// Corners of a box that holds the solid as it is when nothing has to be thickened, minimum first.
    const BOUNDS: [Vec3; 2];
    /// The number of facets times the square of the spacing, for a fine grid.
    const FACETS_TIMES_SQUARE: f64;

    /// The solid with nothing thinner than twice this radius. A grid misses what is thinner than its
    /// cells, so a coarse aircraft is a stouter one.
    fn new(radius_least: f64) -> Self;

    /// Negative inside; differs between two points by no more than they are apart.
    fn distance(&self, p: Vec3) -> f64;
}

/// What part of the facets asked for the grid should give; splitting edges gives the rest.
const AIM: f64 = 0.97;
const AIM_LEAST: f64 = 0.92;

/// How often the spacing is adjusted both ways.
const ATTEMPTS: usize = 10;

/// Draws a body in at most the facets asked for. The longest edge of its bounding box becomes `length`,
/// and its middle along x comes to the origin; y = 0 stays the plane of symmetry.
pub(super) fn draw<B: Body>(of: &Generator) -> Result<Mesh, GeneratorError> {
    let length = of.size("length", of.length, 1.0)?;
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

/// The number of facets goes with the inverse square of the spacing, nearly: where the constant that is
/// known for a fine drawing misses, as it does for a coarse and hence stouter one, the number that came
/// out says where to try next.
fn fit<B: Body>(facets: usize) -> Mesh {
    let aim = AIM * facets as f64;
    let mut spacing = (B::FACETS_TIMES_SQUARE / aim).sqrt();
    for attempt in 0.. {
        let mesh = Drawing::<B>::of(spacing);
        let count = mesh.triangles.len();
        if count <= facets && (count as f64 > AIM_LEAST * facets as f64 || attempt >= ATTEMPTS) {
            return mesh;
        }
        // After the last attempt only coarser ones follow, so that this ends.
        let least = if attempt < ATTEMPTS { 0.0 } else { 1.02 };
        spacing *= (count as f64 / aim).sqrt().max(least);
    }
    unreachable!("a coarse enough grid has few enough facets")
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

        fn distance(&self, p: Vec3) -> f64 {
            (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt() - 1.0
        }
    }

    #[test]
    fn a_ball_is_closed_and_round() {
        let mesh = fit::<Ball>(30_000);
        assert!((27_000..=30_000).contains(&mesh.triangles.len()));
        assert_eq!(mesh.fault(), None);
        assert!((mesh.volume() - 4.18879).abs() < 0.01);
        let euler = mesh.vertices.len() as i64 - mesh.triangles.len() as i64 / 2;
        assert_eq!(euler, 2);
    }
}
