//! The `[generator]` table of a case file: a shape, a number of facets, and the shape's own sizes.
//!
//! A size that the shape does not have is an error, exactly as an unknown key is.

use std::fmt;

use serde::Deserialize;

use crate::{Facet, Mesh, shapes};

/// The shapes that can be generated, by the name they have in a case file.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Hash)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// An axis-aligned cube: its faces lie in lattice planes wherever the root's planes allow it.
    Cube,
    /// A geodesic sphere.
    Sphere,
    /// A ring around the z axis.
    Torus,
    /// A spherical shell: a sphere within a sphere, the space between them being inside.
    NestedSpheres,
    /// A thin axis-aligned plate, its thickness along z.
    Plate,
    /// A pipe of two straights and a bend, closed by flat caps: internal flow.
    Pipe,
    /// An unmanned aircraft: fuselage, long wings, boom, inverted V tail, stores.
    Uav,
    /// A fighter: chined fuselage, hollow intakes and nozzles, trapezoid wings, two canted fins.
    Fighter,
}

impl fmt::Display for Shape {
    /// The name in a case file.
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
        })
    }
}

/// What a case file's `[generator]` table holds. Sizes left out take the shape's defaults.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Generator {
    /// Which shape.
    pub shape: Shape,
    /// How many facets are wanted. Even numbers are met exactly; an odd one gives one facet less.
    pub facets: usize,
    /// Where the shape's own origin goes. Every shape; default `[0, 0, 0]`.
    #[serde(default)]
    pub centre: Option<[f64; 3]>,
    /// `cube`: the edge, default 1.
    #[serde(default)]
    pub edge: Option<f64>,
    /// `sphere` and `nested_spheres` (outer): default 0.5. `torus` (of the centre line): default 0.5.
    /// `pipe` (of the bore): default 0.1.
    #[serde(default)]
    pub radius: Option<f64>,
    /// `nested_spheres`: of the inner sphere, default half of `radius`.
    #[serde(default)]
    pub radius_inner: Option<f64>,
    /// `torus`: of the tube, default 0.2 of `radius`.
    #[serde(default)]
    pub radius_tube: Option<f64>,
    /// `pipe`: of the bend's centre line, default 3 times `radius`.
    #[serde(default)]
    pub radius_bend: Option<f64>,
    /// `pipe`: how far the bend turns, in degrees below 360, default 90.
    #[serde(default)]
    pub angle: Option<f64>,
    /// `plate`: along x, default 1. `pipe`: of each straight, default 5 times
    /// `radius`. `uav` and `fighter`: the
    /// longest edge of the bounding box, default 1.
    #[serde(default)]
    pub length: Option<f64>,
    /// `plate`: along y, default 0.5.
    #[serde(default)]
    pub width: Option<f64>,
    /// `plate`: along z, default 0.01.
    #[serde(default)]
    pub thickness: Option<f64>,
}

/// Why a generator cannot be drawn: always the user's input.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeneratorError {
    /// A size was given that this shape does not have.
    #[error("the shape {shape} has no size `{key}`; it has {known}")]
    SizeForeign {
        /// The shape asked for.
        shape: Shape,
        /// The key that does not belong to it.
        key: &'static str,
        /// The keys that do.
        known: String,
    },
    /// A size is zero, negative, not finite, or contradicts another.
    #[error("[generator] {key} = {value}: {want}")]
    SizeWrong {
        /// Which size.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it has to be.
        want: String,
    },
    /// Fewer facets than the shape can be drawn in, or more than indices can number.
    #[error("[generator] facets = {facets}: {shape} needs at least {least} and at most {most}")]
    FacetsWrong {
        /// The shape asked for.
        shape: Shape,
        /// The number asked for.
        facets: usize,
        /// The least that the shape can be drawn in.
        least: usize,
        /// The most.
        most: usize,
    },
    /// The sizes are so extreme that f32 vertices fall together.
    #[error("[generator] {0}; ask for fewer facets or a shape nearer the origin")]
    Unrepresentable(String),
}

/// Above this, vertex numbers would no longer fit their 32 bits with room to spare.
const FACETS_MOST: usize = 1 << 31;

impl Generator {
    /// A shape with all its sizes at their defaults.
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

    /// The shape as facet soup, outward wound.
    pub fn facets(&self) -> Result<Vec<Facet>, GeneratorError> {
        Ok(self.mesh()?.facets())
    }

    /// The shape as an indexed mesh of exactly `facets` facets (one less where that is odd).
    pub fn mesh(&self) -> Result<Mesh, GeneratorError> {
        self.check_keys()?;
        let least = shapes::facets_least(self.shape);
        if self.facets < least || self.facets > FACETS_MOST {
            let (shape, facets, most) = (self.shape, self.facets, FACETS_MOST);
            return Err(GeneratorError::FacetsWrong { shape, facets, least, most });
        }
        let mut mesh = shapes::draw(self)?;
        mesh.translate(self.centre.unwrap_or([0.0; 3]));
        mesh.split_edges_until(self.facets);
        match mesh.fault_of_area() {
            None => Ok(mesh),
            Some(fault) => Err(GeneratorError::Unrepresentable(fault.to_string())),
        }
    }

    /// A size of the table, or its default; positive and finite either way.
    pub(crate) fn size(
        &self,
        key: &'static str,
        given: Option<f64>,
        default: f64,
    ) -> Result<f64, GeneratorError> {
        let value = given.unwrap_or(default);
        if value.is_finite() && value > 0.0 {
            return Ok(value);
        }
        Err(GeneratorError::SizeWrong { key, value, want: "must be positive and finite".into() })
    }

    /// Sizes that were given, by key.
    fn sizes_given(&self) -> impl Iterator<Item = &'static str> {
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
        let known = shapes::sizes(self.shape);
        if let Some(key) = self.sizes_given().find(|key| !known.contains(key)) {
            let known = known.join(", ");
            return Err(GeneratorError::SizeForeign { shape: self.shape, key, known });
        }
        match self.centre.iter().flatten().find(|x| !x.is_finite()) {
            None => Ok(()),
            Some(&value) => Err(GeneratorError::SizeWrong {
                key: "centre",
                value,
                want: "must be finite".into(),
            }),
        }
    }
}
