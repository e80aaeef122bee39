//! Surfaces of solids that a distance function defines. The grid spacing is fitted to the number of
//! facets.

use super::solids::Vec3;
use crate::{Generator, GeneratorError, Mesh};
use grid::Drawing;

mod grid;

/// A solid that can be drawn at any grid spacing.
pub(super) trait Body {
    /// Minimum and maximum corner of a box that contains the solid when no part is thickened.
    const BOUNDS: [Vec3; 2];
    /// The number of facets times the square of the spacing, for a fine grid.
    const FACETS_TIMES_SQUARE: f64;

    /// The solid, in which no part is thinner than twice `radius_least`. A grid misses parts that
    /// are thinner than its cells, so thin parts are thickened on a coarse grid.
    fn new(radius_least: f64) -> Self;

    /// A function that is negative inside and has a Lipschitz constant of at most 1.
    fn distance(&self, p: Vec3) -> f64;
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
    fn a_ball_is_closed_and_has_the_volume_and_euler_number_of_a_ball() {
        let mesh = fit::<Ball>(30_000);
        assert!((27_000..=30_000).contains(&mesh.triangles.len()));
        assert!(mesh.is_closed() && mesh.flat_facet().is_none());
        assert!((mesh.volume() - 4.18879).abs() < 0.01);
        let euler = mesh.vertices.len() as i64 - mesh.triangles.len() as i64 / 2;
        assert_eq!(euler, 2);
    }
}
