//! Bodies with one opening of known width in one wall.

use contract::case::Facet;
use geometries::{Generator, Shape};

pub type Point = [f64; 3];
type Plane = [f64; 2];

/// A box or a sphere around the origin with one planar, convex opening.
#[derive(Clone, Debug)]
pub struct Body {
    pub name: &'static str,
    pub facets: Vec<Facet>,
    /// The opening, in order.
    pub rim: Vec<Point>,
    /// Diameter of the largest ball that passes.
    pub width: f64,
}

/// One body for each kind of opening.
pub fn bodies() -> Vec<Body> {
    vec![hole(0.15), slit([0.6, 0.09]), crack(0.15), missing_facet(77)]
}

/// Where openings are cut in the wall z = 1, off its centre.
const CENTRE: Plane = [0.13, -0.21];

pub fn hole(radius: f64) -> Body {
    let mut facets = box_without_walls(|axis, side| axis == 2 && side > 0.0);
    let (wall, rim, width) = wall_with_hole(radius);
    facets.extend(wall);
    Body { name: "hole", facets, rim, width }
}

/// A box with holes of these radii in the walls z = 1 and z = -1; the opening is the first hole.
pub fn two_holes(radius: f64, radius_opposite: f64) -> Body {
    let mut facets = box_without_walls(|axis, _| axis == 2);
    let (wall, rim, width) = wall_with_hole(radius);
    facets.extend(wall);
    let opposite = wall_with_hole(radius_opposite).0;
    facets.extend(opposite.into_iter().map(|f| f.map(|[x, y, z]| [x, y, -z])));
    Body { name: "two holes", facets, rim, width }
}

/// A box with a pipe of this length and radius on its wall z = 1. The opening is the pipe's inner end.
pub fn pipe(length: f32, radius: f64) -> Body {
    let mut facets = box_without_walls(|axis, side| axis == 2 && side > 0.0);
    let (wall, rim, width) = wall_with_hole(radius);
    facets.extend(wall);
    for i in 0..rim.len() {
        let [a, b] = [rim[i], rim[(i + 1) % rim.len()]].map(|v| v.map(|c| c as f32));
        let [c, d] = [a, b].map(|[x, y, z]| [x, y, z + length]);
        facets.extend([[a, b, c], [b, d, c]]);
    }
    Body { name: "pipe", facets, rim, width }
}

/// The wall z = 1 with a round hole, the hole's rim, and the diameter of the largest ball that passes.
fn wall_with_hole(radius: f64) -> (Vec<Facet>, Vec<Point>, f64) {
    const CORNERS: usize = 32;
    let corner = |i: usize| {
        let angle = (i as f64 + 0.3) * std::f64::consts::TAU / CORNERS as f64;
        [CENTRE[0] + radius * angle.cos(), CENTRE[1] + radius * angle.sin()]
    };
    let (facets, rim) = wall_with_opening(&(0..CORNERS).map(corner).collect::<Vec<_>>());
    // The ball touches the middles of the polygon's edges.
    (facets, rim, 2.0 * radius * (std::f64::consts::PI / CORNERS as f64).cos())
}

/// A rectangle of these half edges, the second of which is shorter.
pub fn slit(half: Plane) -> Body {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let corners = corners.map(|c: Plane| [0, 1].map(|a| CENTRE[a] + c[a] * half[a]));
    let (wall, rim) = wall_with_opening(&corners);
    let mut facets = box_without_walls(|axis, side| axis == 2 && side > 0.0);
    facets.extend(wall);
    Body { name: "slit", facets, rim, width: 2.0 * half[1] }
}

/// The wall's diagonal is an edge of one facet; on its other side it is two edges, whose common corner is off it.
pub fn crack(depth: f64) -> Body {
    let off = depth / 2f64.sqrt();
    let [a, b, c, d] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let junction = [-off, off];
    let mut facets = box_without_walls(|axis, side| axis == 2 && side > 0.0);
    facets.extend([[a, b, c], [a, junction, d], [junction, c, d]].map(on_wall));
    let rim = [a, c, junction].map(|[x, y]| [x, y, 1.0]).to_vec();
    Body { name: "crack", width: inscribed(&rim), facets, rim }
}

pub fn missing_facet(index: usize) -> Body {
    let generator = Generator { radius: Some(1.0), ..Generator::new(Shape::Sphere, 320) };
    let mut facets = generator.facets().unwrap();
    let rim = facets.remove(index).map(|v| v.map(f64::from)).to_vec();
    Body { name: "missing facet", width: inscribed(&rim), facets, rim }
}

/// A sphere of many facets without those around a place, of which more are near the opening than are searched one by one.
pub fn torn_sphere() -> Vec<Facet> {
    const CENTRE: Point = [0.3, 0.5, 0.8];
    let generator = Generator { radius: Some(1.0), ..Generator::new(Shape::Sphere, 5120) };
    let mut facets = generator.facets().unwrap();
    facets.retain(|facet| {
        let from = |v: &[f32; 3]| sub(v.map(f64::from), CENTRE);
        facet.iter().map(from).any(|d| dot(d, d) > 0.2 * 0.2)
    });
    facets
}

/// Diameter of a triangle's inscribed circle.
fn inscribed(t: &[Point]) -> f64 {
    let length =
        |i: usize, j: usize| (0..3).map(|k| (t[i][k] - t[j][k]).powi(2)).sum::<f64>().sqrt();
    let (a, b, c) = (length(0, 1), length(1, 2), length(2, 0));
    let s = (a + b + c) / 2.0;
    2.0 * ((s - a) * (s - b) * (s - c) / s).sqrt()
}

/// The wall z = 1 of the box with a convex opening around [`CENTRE`], and the opening's rim.
fn wall_with_opening(opening: &[Plane]) -> (Vec<Facet>, Vec<Point>) {
    let wall = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let angle = |p: &Plane| (p[1] - CENTRE[1]).atan2(p[0] - CENTRE[0]);
    let mut angles: Vec<f64> = opening.iter().chain(&wall).map(angle).collect();
    angles.sort_by(f64::total_cmp);
    let ring = |polygon: &[Plane]| angles.iter().map(|&a| exit(polygon, a)).collect::<Vec<_>>();
    let (inner, outer) = (ring(opening), ring(&wall));
    let mut facets = Vec::new();
    for i in 0..angles.len() {
        let j = (i + 1) % angles.len();
        facets.push(on_wall([inner[i], outer[i], outer[j]]));
        facets.push(on_wall([inner[i], outer[j], inner[j]]));
    }
    (facets, inner.into_iter().map(|[x, y]| [x, y, 1.0]).collect())
}

/// The point where a ray from [`CENTRE`] leaves a polygon.
fn exit(polygon: &[Plane], angle: f64) -> Plane {
    let cross = |u: Plane, v: Plane| u[0] * v[1] - u[1] * v[0];
    let (sin, cos) = angle.sin_cos();
    let reach = |i: usize| {
        let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        let (edge, from) = ([b[0] - a[0], b[1] - a[1]], [a[0] - CENTRE[0], a[1] - CENTRE[1]]);
        let scale = cross([cos, sin], edge);
        let (t, s) = (cross(from, edge) / scale, cross(from, [cos, sin]) / scale);
        (t > 0.0 && (-1e-9..=1.0 + 1e-9).contains(&s)).then_some(t)
    };
    let reach = (0..polygon.len()).find_map(reach).expect("the centre is inside");
    [CENTRE[0] + reach * cos, CENTRE[1] + reach * sin]
}

fn on_wall(corners: [Plane; 3]) -> Facet {
    corners.map(|[x, y]| [x as f32, y as f32, 1.0])
}

/// The box from -1 to 1 without the walls that `is_missing` selects by axis and side.
fn box_without_walls(is_missing: impl Fn(usize, f32) -> bool) -> Vec<Facet> {
    let mut facets = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            if is_missing(axis, side) {
                continue;
            }
            let corner = |u: f32, v: f32| {
                let mut at = [side; 3];
                (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (u, v);
                at
            };
            let [a, b, c, d] =
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            facets.extend([[a, b, c], [a, c, d]]);
        }
    }
    facets
}

/// Rotations about the origin: none, a quarter turn, and two about oblique axes.
pub const ROTATIONS: [[f64; 4]; 4] = [
    [0.0, 0.0, 0.0, 1.0],
    [0.707_106_781_186_547_5, 0.0, 0.0, 0.707_106_781_186_547_5],
    [0.182_574, 0.365_148, 0.547_723, 0.730_297],
    [-0.5, 0.1, 0.3, 0.806_225_8],
];

impl Body {
    /// The body, rotated by a unit quaternion.
    pub fn rotated(&self, q: [f64; 4]) -> Self {
        let turn = |v: Point| rotate(v, q);
        let facets =
            self.facets.iter().map(|f| f.map(|v| turn(v.map(f64::from)).map(|c| c as f32)));
        Self {
            facets: facets.collect(),
            rim: self.rim.iter().map(|&v| turn(v)).collect(),
            ..self.clone()
        }
    }

    /// The unit vector from the origin to the middle of the wall with the opening.
    pub fn axis(&self) -> Point {
        let count = self.rim.len();
        let normal =
            cross(sub(self.rim[count / 3], self.rim[0]), sub(self.rim[2 * count / 3], self.rim[0]));
        let length = dot(normal, normal).sqrt();
        normal.map(|c| c / length)
    }

    /// The facets with at least this many corners on the rim.
    pub fn at_rim(&self, corners: usize) -> Vec<u32> {
        let is_on_rim = |v: &[f32; 3]| {
            self.rim.iter().any(|r| (0..3).all(|a| (r[a] - f64::from(v[a])).abs() < 1e-6))
        };
        let count = |f: &Facet| f.iter().filter(|v| is_on_rim(v)).count();
        let chosen = self.facets.iter().enumerate().filter(|(_, f)| count(f) >= corners);
        chosen.map(|(i, _)| i as u32).collect()
    }

    /// Whether a segment passes the opening.
    pub fn passes(&self, from: Point, to: Point) -> bool {
        let count = self.rim.len();
        // Some consecutive corners are collinear.
        let area =
            |i: usize| cross(sub(self.rim[i], self.rim[0]), sub(self.rim[i + 1], self.rim[0]));
        let normal = std::array::from_fn(|a| (1..count - 1).map(|i| area(i)[a]).sum());
        let height = |p: Point| dot(sub(p, self.rim[0]), normal);
        let (a, b) = (height(from), height(to));
        if (a > 0.0) == (b > 0.0) {
            return false;
        }
        let at: Point = std::array::from_fn(|i| from[i] + (to[i] - from[i]) * a / (a - b));
        let side = |i: usize| {
            dot(cross(sub(self.rim[(i + 1) % count], self.rim[i]), sub(at, self.rim[i])), normal)
        };
        (0..count).all(|i| side(i) >= 0.0) || (0..count).all(|i| side(i) <= 0.0)
    }
}

fn rotate(v: Point, [x, y, z, w]: [f64; 4]) -> Point {
    let axis = [x, y, z];
    let t = cross(axis, v).map(|c| 2.0 * c);
    let s = cross(axis, t);
    std::array::from_fn(|a| v[a] + w * t[a] + s[a])
}

fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: Point, b: Point) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: Point, b: Point) -> Point {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}
