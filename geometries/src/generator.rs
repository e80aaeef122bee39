//! The `[generator]` table of a case file: a shape, a number of facets, and the dimensions of the
//! shape.
//!
//! A dimension that the shape does not have is an error, as an unknown key is.

use std::fmt;

use serde::Deserialize;

use crate::{Facet, shapes};

/// The shapes that can be generated. Case files use their names in snake case.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// An axis-aligned cube. With a suitable root its faces lie in lattice planes.
    Cube,
    /// A geodesic sphere.
    Sphere,
    /// A ring around the z axis.
    Torus,
    /// A spherical shell: the inside is the space between two concentric spheres.
    NestedSpheres,
    /// A thin axis-aligned plate with its thickness along z.
    Plate,
    /// A pipe of two straight sections and a bend, closed by flat caps, for internal flow.
    Pipe,
    /// An unmanned aircraft: fuselage, long wings, boom, inverted V tail, stores.
    Uav,
    /// A fighter: chined fuselage, hollow intakes and nozzles, trapezoid wings, two canted fins.
    Fighter,
    /// The fighter on its landing gear, as that of the paper.
    FighterGear,
    /// Two equal cubes that overlap in a corner.
    BoxesOverlapping,
    /// A cubic shell: the inside is the wall around a sealed cubic cavity.
    BoxInBox,
    /// Three concentric spheres: by parity, outer shell and core are inside, the shell between them
    /// outside.
    ThreeSpheres,
    /// Two closed pipes, each like `Pipe`, one of which passes through a straight section of the
    /// other.
    PipesCrossing,
    /// A car assembled from eight closed solids that overlap: body, cabin, four wheels, two mirrors.
    Car,
}

impl fmt::Display for Shape {
    /// Writes the name that case files use.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cube => "cube",
            Self::Sphere => "sphere",
            Self::Torus => "torus",
            Self::NestedSpheres => "nested_spheres",
            Self::Plate => "plate",
            Self::Pipe => "pipe",
            Self::Uav => "uav",
            Self::Fighter => "fighter",
            Self::FighterGear => "fighter_gear",
            Self::BoxesOverlapping => "boxes_overlapping",
            Self::BoxInBox => "box_in_box",
            Self::ThreeSpheres => "three_spheres",
            Self::PipesCrossing => "pipes_crossing",
            Self::Car => "car",
        })
    }
}

/// The contents of a `[generator]` table. Dimensions that are not given take the defaults of the
/// shape. All lengths are in the user's unit.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Generator {
    /// The shape.
    pub shape: Shape,
    /// Requested number of facets: exact if even, otherwise the shape has one less.
    pub facets: usize,
    /// Every shape: the position of its origin, default `[0, 0, 0]`.
    #[serde(default)]
    pub centre: Option<[f64; 3]>,
    /// `cube`, each of `boxes_overlapping`, and the outer box of `box_in_box`: the edge, default 1.
    #[serde(default)]
    pub edge: Option<f64>,
    /// `sphere`, and the outer sphere of `nested_spheres` and `three_spheres`: default 0.5. `torus`:
    /// of the centre line, default 0.5. `pipe` and `pipes_crossing`: of the bore, default 0.1.
    #[serde(default)]
    pub radius: Option<f64>,
    /// `nested_spheres`: of the inner sphere, default half of `radius`.
    #[serde(default)]
    pub radius_inner: Option<f64>,
    /// `torus`: of the tube, default 0.2 of `radius`.
    #[serde(default)]
    pub radius_tube: Option<f64>,
    /// `pipe` and `pipes_crossing`: of the bend's centre line, default 3 times `radius`.
    #[serde(default)]
    pub radius_bend: Option<f64>,
    /// `pipe`: angle of the bend in degrees, at most 180, default 90.
    #[serde(default)]
    pub angle: Option<f64>,
    /// `plate`: along x, default 1. `pipe` and `pipes_crossing`: of each straight section, default 5
    /// times `radius`. `uav`, `fighter`, `fighter_gear` and `car`: the longest edge of the bounding box, default 1.
    #[serde(default)]
    pub length: Option<f64>,
    /// `plate`: along y, default 0.5.
    #[serde(default)]
    pub width: Option<f64>,
    /// `plate`: along z, default 0.01. `box_in_box`: of the wall, default a quarter of `edge`.
    #[serde(default)]
    pub thickness: Option<f64>,
}

/// An invalid `[generator]` table, which the user can correct.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeneratorError {
    /// The shape does not have this dimension.
    #[error("[generator] the shape {shape} has no dimension `{key}`; it has {known}")]
    UnknownDimension {
        /// The shape.
        shape: Shape,
        /// The key of the dimension.
        key: &'static str,
        /// The keys of the dimensions that the shape has.
        known: String,
    },
    /// A dimension is zero, negative, not finite, or contradicts another.
    #[error("[generator] {key} = {value}: {requirement}")]
    InvalidDimension {
        /// The key of the dimension.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The condition that it must satisfy.
        requirement: String,
    },
    /// The number of facets is less than the minimum of the shape, or more than a hundred million.
    #[error("[generator] facets = {facets}: {shape} needs at least {least} and at most {most}")]
    InvalidFacets {
        /// The shape.
        shape: Shape,
        /// The requested number.
        facets: usize,
        /// The minimum for the shape.
        least: usize,
        /// The maximum for every shape.
        most: usize,
    },
    /// The vertices of a facet coincide or are not finite in f32.
    #[error(
        "[generator] facet {facet} has no area in f32; request fewer facets or a shape closer to the origin"
    )]
    Unrepresentable {
        /// Index of the facet.
        facet: usize,
    },
}

/// Maximum number of facets, so that a mistyped number is an error instead of the end of all memory.
/// Vertex indices are 32 bits wide, and a closed surface has about half as many vertices as facets.
const FACETS_MOST: usize = 100_000_000;

impl Generator {
    /// A shape with default dimensions.
    pub fn new(shape: Shape, facets: usize) -> Self {
        Self {
            shape,
            facets,
            centre: None,
            edge: None,
            radius: None,
            radius_inner: None,
            radius_tube: None,
            radius_bend: None,
            angle: None,
            length: None,
            width: None,
            thickness: None,
        }
    }

    /// The shape as facet soup, wound outward: exactly `facets` facets, one less if that number is odd.
    ///
    /// # Errors
    /// The table is invalid for the shape.
    pub fn facets(&self) -> Result<Vec<Facet>, GeneratorError> {
        self.check_keys()?;
        let least = shapes::facets_least(self.shape);
        if self.facets < least || self.facets > FACETS_MOST {
            let (shape, facets, most) = (self.shape, self.facets, FACETS_MOST);
            return Err(GeneratorError::InvalidFacets { shape, facets, least, most });
        }
        let mut mesh = shapes::draw(self)?;
        mesh.translate(self.centre.unwrap_or([0.0; 3]));
        mesh.split_edges_until(self.facets);
        match mesh.flat_facet() {
            None => Ok(mesh.facets()),
            Some(facet) => Err(GeneratorError::Unrepresentable { facet }),
        }
    }

    /// A dimension of the table or its default, checked to be positive and a normal number in single precision.
    pub(crate) fn dimension(
        &self,
        key: &'static str,
        given: Option<f64>,
        default: f64,
    ) -> Result<f64, GeneratorError> {
        let value = given.unwrap_or(default);
        // Vertices are written in single precision.
        if (value as f32).is_normal() && value > 0.0 {
            return Ok(value);
        }
        Err(GeneratorError::InvalidDimension {
            key,
            value,
            requirement: "must be from 1.2e-38 to 3.4e38".into(),
        })
    }

    /// The keys of the dimensions that the table gives.
    fn dimensions_given(&self) -> impl Iterator<Item = &'static str> {
        [
            ("edge", self.edge),
            ("radius", self.radius),
            ("radius_inner", self.radius_inner),
            ("radius_tube", self.radius_tube),
            ("radius_bend", self.radius_bend),
            ("angle", self.angle),
            ("length", self.length),
            ("width", self.width),
            ("thickness", self.thickness),
        ]
        .into_iter()
        .filter_map(|(key, value)| value.map(|_| key))
    }

    fn check_keys(&self) -> Result<(), GeneratorError> {
        let known = shapes::dimensions(self.shape);
        if let Some(key) = self.dimensions_given().find(|key| !known.contains(key)) {
            let known = known.join(", ");
            return Err(GeneratorError::UnknownDimension { shape: self.shape, key, known });
        }
        match self.centre.iter().flatten().find(|x| !x.is_finite()) {
            None => Ok(()),
            Some(&value) => Err(GeneratorError::InvalidDimension {
                key: "centre",
                value,
                requirement: "must be finite".into(),
            }),
        }
    }
}
