//! The shapes, with their dimensions and minimum numbers of facets.

use crate::{Generator, GeneratorError, Mesh, Shape};

mod aircraft;
mod assembly;
mod basic;
mod implicit;
mod pipe;
mod solids;

/// The keys of the dimensions of a shape.
pub(crate) fn dimensions(shape: Shape) -> &'static [&'static str] {
    match shape {
        Shape::Cube => &["edge"],
        Shape::Sphere => &["radius"],
        Shape::Torus => &["radius", "radius_tube"],
        Shape::NestedSpheres => &["radius", "radius_inner"],
        Shape::Plate => &["length", "width", "thickness"],
        Shape::Pipe => &["radius", "radius_bend", "angle", "length"],
        Shape::Uav | Shape::Fighter | Shape::FighterGear | Shape::Car => &["length"],
        Shape::BoxesOverlapping => &["edge"],
        Shape::BoxInBox => &["edge", "thickness"],
        Shape::ThreeSpheres => &["radius"],
        Shape::PipesCrossing => &["radius", "radius_bend", "length"],
    }
}

/// Minimum number of facets of a shape.
pub(crate) fn facets_least(shape: Shape) -> usize {
    match shape {
        Shape::Cube | Shape::Plate => 12,
        Shape::Sphere => 20,
        Shape::NestedSpheres => 40,
        Shape::Torus => 18,
        Shape::Pipe => 60,
        Shape::Uav | Shape::Fighter | Shape::FighterGear => 2_000,
        Shape::BoxesOverlapping | Shape::BoxInBox => 24,
        Shape::ThreeSpheres => 60,
        Shape::PipesCrossing => 120,
        Shape::Car => 144,
    }
}

/// Draws the shape about its own origin with at most the requested number of facets, and not many
/// fewer.
pub(crate) fn draw(of: &Generator) -> Result<Mesh, GeneratorError> {
    match of.shape {
        Shape::Cube => basic::cube(of),
        Shape::Plate => basic::plate(of),
        Shape::Sphere => basic::sphere(of),
        Shape::NestedSpheres => basic::nested_spheres(of),
        Shape::Torus => basic::torus(of),
        Shape::Pipe => pipe::pipe(of),
        Shape::Uav => implicit::draw::<aircraft::Uav>(of),
        Shape::Fighter => implicit::draw::<aircraft::Fighter<false>>(of),
        Shape::FighterGear => implicit::draw::<aircraft::Fighter<true>>(of),
        Shape::BoxesOverlapping => assembly::boxes_overlapping(of),
        Shape::BoxInBox => assembly::box_in_box(of),
        Shape::ThreeSpheres => assembly::three_spheres(of),
        Shape::PipesCrossing => pipe::pipes_crossing(of),
        Shape::Car => assembly::car(of),
    }
}

/// The least pitch, at most `longest`, for which `count` does not exceed `facets`. `count` is a
/// step function that does not increase with the pitch, so bisection finds the step.
fn pitch_finest(longest: f64, facets: usize, count: impl Fn(f64) -> usize) -> f64 {
    let (mut fine, mut coarse) = (longest / (facets as f64 + 1.0), longest);
    for _ in 0..100 {
        let middle = (fine + coarse) * 0.5;
        if count(middle) > facets { fine = middle } else { coarse = middle }
    }
    coarse
}
