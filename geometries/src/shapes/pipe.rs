//! A curved pipe for internal flow: a straight section, a bend and a straight section, closed by
//! flat caps.
//!
//! The centre line of the bore runs along +x to the origin, where the bend towards +y starts.

use std::f64::consts::TAU;

use super::pitch_finest;
use crate::{Generator, GeneratorError, Mesh};

/// The pipe, its bend starting at the origin.
pub(super) fn pipe(of: &Generator) -> Result<Mesh, GeneratorError> {
    Ok(CentreLine::of(of)?.draw_finest(of.facets))
}

/// Two equal pipes with bends of 90 degrees. The first section of the second pipe passes through the
/// middle of the last section of the first pipe, half a radius above it.
pub(super) fn pipes_crossing(of: &Generator) -> Result<Mesh, GeneratorError> {
    let line = CentreLine::of(of)?;
    if line.straight <= 2.0 * line.radius {
        let requirement = format!("must exceed the width of the other pipe, {}", 2.0 * line.radius);
        let (key, value) = ("length", line.straight);
        return Err(GeneratorError::InvalidDimension { key, value, requirement });
    }
    let mut mesh = line.draw_finest(of.facets / 2);
    let mut second = mesh.clone();
    let along = line.radius_bend + line.straight * 0.5;
    second.translate([along, along, line.radius * 0.5]);
    mesh.append(&second);
    Ok(mesh)
}

/// The centre line of the pipe, and the radius of its bore.
struct CentreLine {
    radius: f64,
    radius_bend: f64,
    /// In radians.
    angle: f64,
    straight: f64,
}

impl CentreLine {
    fn of(of: &Generator) -> Result<Self, GeneratorError> {
        let radius = of.dimension("radius", of.radius, 0.1)?;
        let radius_bend = of.dimension("radius_bend", of.radius_bend, radius * 3.0)?;
        let angle = of.dimension("angle", of.angle, 90.0)?;
        let straight = of.dimension("length", of.length, radius * 5.0)?;
        let invalid = |key, value, requirement| {
            Err(GeneratorError::InvalidDimension { key, value, requirement })
        };
        if radius_bend <= radius {
            return invalid("radius_bend", radius_bend, format!("must exceed radius = {radius}"));
        }
        if angle > 180.0 {
            return invalid(
                "angle",
                angle,
                "must be at most 180, so that the straight sections do not meet".into(),
            );
        }
        Ok(Self { radius, radius_bend, angle: angle * (TAU / 360.0), straight })
    }

    /// The finest pipe of at most `facets` facets.
    fn draw_finest(&self, facets: usize) -> Mesh {
        let facets_at = |pitch| self.divisions(pitch).facets();
        // A pipe may be wider than long.
        let pitch = pitch_finest(self.total().max(TAU * self.radius), facets, facets_at);
        draw(self, &self.divisions(pitch))
    }

    fn bend(&self) -> f64 {
        self.radius_bend * self.angle
    }

    fn total(&self) -> f64 {
        2.0 * self.straight + self.bend()
    }

    fn divisions(&self, pitch: f64) -> Divisions {
        let count = |length: f64, least: usize| ((length / pitch) as usize).max(least);
        Divisions {
            around: count(TAU * self.radius, 6),
            straight: count(self.straight, 1),
            bend: count(self.bend(), 2),
            cap: count(self.radius, 1),
        }
    }

    /// A point of the centre line and the direction, in the xy plane, that points away from the
    /// centre of the bend. `step` counts divisions from the inlet.
    fn frame(&self, divisions: &Divisions, step: usize) -> ([f64; 2], [f64; 2]) {
        let bend_end = divisions.straight + divisions.bend;
        let turned = match step {
            _ if step <= divisions.straight => 0.0,
            _ if step >= bend_end => self.angle,
            _ => self.angle * (step - divisions.straight) as f64 / divisions.bend as f64,
        };
        let (sin, cos) = libm::sincos(turned);
        let r = self.radius_bend;
        let from_bend = if step < divisions.straight {
            -self.straight * (divisions.straight - step) as f64 / divisions.straight as f64
        } else {
            self.straight * step.saturating_sub(bend_end) as f64 / divisions.straight as f64
        };
        let point = [r * sin + from_bend * cos, r * (1.0 - cos) + from_bend * sin];
        (point, [sin, -cos])
    }
}

/// Number of divisions: around the circumference, along each straight section, along the bend, and
/// along the radius of each cap.
struct Divisions {
    around: usize,
    straight: usize,
    bend: usize,
    cap: usize,
}

impl Divisions {
    fn along(&self) -> usize {
        2 * self.straight + self.bend
    }

    /// Number of facets: two per quadrilateral of the wall; each cap consists of rings around a
    /// fan.
    fn facets(&self) -> usize {
        2 * self.around * (self.along() + 2 * self.cap - 1)
    }
}

fn draw(line: &CentreLine, divisions: &Divisions) -> Mesh {
    let mut mesh = Mesh::default();
    let last = divisions.along();
    // The surface consists of rings of vertices: outward on the cap of the inlet, along the wall,
    // and inward on the cap of the outlet.
    let inlet = (1..divisions.cap).map(|i| (0, i));
    let wall = (0..=last).map(|step| (step, divisions.cap));
    let outlet = (1..divisions.cap).rev().map(|i| (last, i));
    let mut rings = 0;
    for (step, out) in inlet.chain(wall).chain(outlet) {
        let reach = line.radius * out as f64 / divisions.cap as f64;
        let ([x, y], [away_x, away_y]) = line.frame(divisions, step);
        for i in 0..divisions.around {
            let (sin, cos) = libm::sincos(TAU * i as f64 / divisions.around as f64);
            mesh.add_vertex([x + reach * cos * away_x, y + reach * cos * away_y, reach * sin]);
        }
        rings += 1;
    }
    let index = |ring: usize, i: usize| (ring * divisions.around + i % divisions.around) as u32;
    for ring in 1..rings {
        for i in 0..divisions.around {
            let previous = ring - 1;
            mesh.add_quad([
                index(previous, i),
                index(ring, i),
                index(ring, i + 1),
                index(previous, i + 1),
            ]);
        }
    }
    let [inlet, outlet] = [0, last].map(|step| {
        let ([x, y], _) = line.frame(divisions, step);
        mesh.add_vertex([x, y, 0.0])
    });
    for i in 0..divisions.around {
        mesh.triangles.push([inlet, index(0, i), index(0, i + 1)]);
        mesh.triangles.push([outlet, index(rings - 1, i + 1), index(rings - 1, i)]);
    }
    mesh
}
