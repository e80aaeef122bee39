//! Solids as distance functions, of which the aircraft are composed.
//!
//! Invariant of every function here: its Lipschitz constant is at most 1, and it is negative
//! inside. The invariant allows [`super::implicit`] to skip space that cannot contain surface.

/// A point or direction.
pub(super) type Vec3 = [f64; 3];

/// Several points, by axis. Functions of all of them are loops without branches, which the compiler turns into vector instructions.
pub(super) type Points<const N: usize> = [[f64; N]; 3];

/// The values of a function at several points.
#[inline(always)]
fn at_each<const N: usize>(p: &Points<N>, f: impl Fn(Vec3) -> f64) -> [f64; N] {
    let mut values = [0.0; N];
    for i in 0..N {
        values[i] = f([p[0][i], p[1][i], p[2][i]]);
    }
    values
}

/// A function of two values, for several of them.
#[inline(always)]
fn of_both<const N: usize>(mut a: [f64; N], b: [f64; N], f: impl Fn(f64, f64) -> f64) -> [f64; N] {
    for i in 0..N {
        a[i] = f(a[i], b[i]);
    }
    a
}

#[inline(always)]
fn sub(p: Vec3, q: Vec3) -> Vec3 {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

#[inline(always)]
fn dot(p: Vec3, q: Vec3) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

#[inline(always)]
fn interpolate(t: f64, from: f64, to: f64) -> f64 {
    from + (to - from) * t
}

/// The convex hull of two balls.
pub(super) struct RoundCone {
    from: Vec3,
    along: Vec3,
    radius: [f64; 2],
    /// Squares of the length and of the length of the side of the tangent cone.
    square: f64,
    square_side: f64,
}

impl RoundCone {
    /// Neither ball may contain the other.
    pub(super) fn new(from: Vec3, radius_from: f64, to: Vec3, radius_to: f64) -> Self {
        let along = sub(to, from);
        let square = dot(along, along);
        let shrink = radius_from - radius_to;
        let square_side = square - shrink * shrink;
        assert!(square_side > 0.0, "one ball of a round cone contains the other");
        Self { from, along, radius: [radius_from, radius_to], square, square_side }
    }

    /// The exact distance, by Inigo Quilez's formula for a round cone.
    #[inline(always)]
    pub(super) fn distance<const N: usize>(&self, p: &Points<N>) -> [f64; N] {
        let [from, to] = self.radius;
        let (square, shrink) = (self.square, from - to);
        at_each(p, |p| {
            let q = sub(p, self.from);
            let y = dot(q, self.along);
            let z = y - square;
            let x2 = (dot(q, q) * square - y * y).max(0.0) * square;
            let k = shrink * shrink.abs() * x2;
            // Beyond either end, or beside the cone.
            let (squared, more, radius) = if z * z.abs() * square * self.square_side > k {
                (x2 + z * z * square, 0.0, to)
            } else if y * y.abs() * square * self.square_side < k {
                (x2 + y * y * square, 0.0, from)
            } else {
                (x2 * self.square_side / square, y * shrink, from)
            };
            (squared.sqrt() + more) / square - radius
        })
    }
}

/// A box with rounded edges; `half` includes the rounding.
#[inline(always)]
pub(super) fn rounded_box<const N: usize>(
    p: &Points<N>,
    centre: Vec3,
    half: Vec3,
    rounding: f64,
) -> [f64; N] {
    at_each(p, |p| {
        let q: Vec3 = std::array::from_fn(|a| (p[a] - centre[a]).abs() - half[a] + rounding);
        let out = q.map(|x| x.max(0.0));
        dot(out, out).sqrt() + q[0].max(q[1]).max(q[2]).min(0.0) - rounding
    })
}

/// The cross section of a wing at one end: the x coordinates of its leading and trailing edge, and
/// half its thickness.
#[derive(Clone, Copy)]
pub(super) struct Section {
    pub(super) leading: f64,
    pub(super) trailing: f64,
    pub(super) thickness_half: f64,
}

/// A tapered wing, tail or pylon that extends from a root along a direction normal to x.
pub(super) struct Panel {
    root: [f64; 2],
    along: [f64; 2],
    span: f64,
    sections: [Section; 2],
    /// Minimum radius of every part, so that the grid does not miss any.
    radius_least: f64,
    /// Compensates for the slope that taper and sweep add, so that the Lipschitz constant is at
    /// most 1.
    shrink: f64,
}

impl Panel {
    /// A panel of length `span` from `root` (y, z) in the direction `along` (y, z; a unit vector).
    pub(super) fn new(
        root: [f64; 2],
        along: [f64; 2],
        span: f64,
        sections: [Section; 2],
        radius_least: f64,
    ) -> Self {
        let [from, to] = sections;
        let slope = (to.leading - from.leading).abs().max((to.trailing - from.trailing).abs())
            + (to.thickness_half - from.thickness_half).abs();
        let slope = slope / span;
        let shrink = 1.0 / (1.0 + slope * slope).sqrt();
        Self { root, along, span, sections, radius_least, shrink }
    }

    #[inline(always)]
    pub(super) fn distance<const N: usize>(&self, p: &Points<N>) -> [f64; N] {
        // Not `at_each`: in a closure of this size the compiler does not use vectors.
        let mut values = [0.0; N];
        for i in 0..N {
            values[i] = self.distance_at([p[0][i], p[1][i], p[2][i]]);
        }
        values
    }

    #[inline(always)]
    fn distance_at(&self, p: Vec3) -> f64 {
        let (y, z) = (p[1] - self.root[0], p[2] - self.root[1]);
        let reach = y * self.along[0] + z * self.along[1];
        let off = (z * self.along[0] - y * self.along[1]).abs();
        let t = (reach / self.span).clamp(0.0, 1.0);
        let beyond = (reach - self.span).max(-reach).max(0.0);
        let [from, to] = &self.sections;
        let leading = interpolate(t, from.leading, to.leading);
        let trailing = interpolate(t, from.trailing, to.trailing);
        let thick = interpolate(t, from.thickness_half, to.thickness_half).max(self.radius_least);
        let section = self.section(p[0], off, leading, trailing, thick);
        let side = (section + thick).max(0.0);
        let rounded = (side * side + beyond * beyond).sqrt() - thick;
        (if beyond > 0.0 { rounded } else { section }) * self.shrink
    }

    /// An aerofoil: the hulls of a circle at the nose and a thick circle at 35 % of the chord, and
    /// of the latter and a thin circle at the trailing edge.
    #[inline(always)]
    fn section(&self, x: f64, off: f64, leading: f64, trailing: f64, thick: f64) -> f64 {
        let [nose, tail] = [0.45, 0.12].map(|part| (thick * part).max(self.radius_least));
        let middle = interpolate(0.35, leading, trailing);
        let fore = hull_of_circles([x, off], [leading + nose, middle], [nose, thick]);
        let aft = hull_of_circles([x, off], [middle, trailing - tail], [thick, tail]);
        fore.min(aft)
    }
}

/// The distance to the hull of two circles whose centres lie on the axis `off = 0`; `off` is at
/// least 0.
#[inline(always)]
fn hull_of_circles([x, off]: [f64; 2], centres: [f64; 2], [from, to]: [f64; 2]) -> f64 {
    let length = centres[1] - centres[0];
    let sin = (from - to) / length;
    let cos = (1.0 - sin * sin).sqrt();
    let q = x - centres[0];
    let reach = q * cos - off * sin;
    // One circle may contain the other.
    let is_one = length <= (from - to).abs();
    let is_first = if is_one { from > to } else { reach < 0.0 };
    let is_circle = is_one || is_first || reach > cos * length;
    let (centre, radius) = if is_first { (centres[0], from) } else { (centres[1], to) };
    let circle = ((x - centre) * (x - centre) + off * off).sqrt() - radius;
    if is_circle { circle } else { off * cos + q * sin - from }
}

/// The union of two solids with a fillet of about the size `fillet` at their intersection.
#[inline(always)]
pub(super) fn blend<const N: usize>(a: [f64; N], b: [f64; N], fillet: f64) -> [f64; N] {
    of_both(a, b, |a, b| {
        let h = (fillet - (a - b).abs()).max(0.0);
        a.min(b) - h * h / (4.0 * fillet)
    })
}

/// The union of two solids.
#[inline(always)]
pub(super) fn join<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    of_both(a, b, f64::min)
}

/// The union of some round cones. A loop, as `fold` would be compiled for the narrowest vectors.
#[inline(always)]
pub(super) fn nearest<const N: usize>(cones: &[RoundCone], p: &Points<N>) -> [f64; N] {
    let mut nearest = [f64::INFINITY; N];
    for cone in cones {
        nearest = join(nearest, cone.distance(p));
    }
    nearest
}

/// The first solid without the second.
#[inline(always)]
pub(super) fn carve<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    of_both(a, b, |a, b| a.max(-b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The greatest difference quotient over random pairs of nearby points around a solid of unit
    /// size.
    fn steepest(distance: impl Fn(&Points<1>) -> [f64; 1]) -> f64 {
        let distance = |p: Vec3| distance(&p.map(|x| [x]))[0];
        let mut steepest = 0.0_f64;
        for i in 0..20_000_u64 {
            let noise = |salt: u64| {
                let x = (i * 7 + salt).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                ((x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64
                    / (1_u64 << 53) as f64
            };
            let p = [noise(0), noise(1), noise(2)].map(|x| 3.0 * x - 1.5);
            let step = [noise(3), noise(4), noise(5)].map(|x| 1e-3 * (x - 0.5));
            let q = [p[0] + step[0], p[1] + step[1], p[2] + step[2]];
            steepest = steepest.max((distance(p) - distance(q)).abs() / dot(step, step).sqrt());
        }
        steepest
    }

    #[test]
    fn no_distance_function_is_steeper_than_one() {
        let cone = RoundCone::new([-0.5, 0.1, 0.0], 0.3, [0.6, 0.0, 0.2], 0.1);
        let root = Section { leading: -0.6, trailing: 0.6, thickness_half: 0.1 };
        let tip = Section { leading: 0.4, trailing: 0.7, thickness_half: 0.02 };
        let panel = Panel::new([0.0, 0.1], [0.6, 0.8], 1.0, [root, tip], 0.01);
        let chunk = |p: &Points<1>| rounded_box(p, [0.1; 3], [0.5, 0.3, 0.2], 0.1);
        assert!(steepest(|p| cone.distance(p)) < 1.0 + 1e-9);
        assert!(steepest(|p| panel.distance(p)) < 1.0 + 1e-9);
        assert!(steepest(chunk) < 1.0 + 1e-9);
        let all = |p: &Points<1>| carve(blend(cone.distance(p), panel.distance(p), 0.2), chunk(p));
        let steep = steepest(all);
        assert!(steep > 0.9 && steep < 1.0 + 1e-9, "{steep}");
    }

    #[test]
    fn the_distance_to_a_round_cone_is_exact() {
        let cone = RoundCone::new([0.0; 3], 0.5, [2.0, 0.0, 0.0], 0.25);
        let distance = |p: Vec3| cone.distance(&p.map(|x| [x]))[0];
        assert_eq!(distance([-1.5, 0.0, 0.0]), 1.0);
        assert_eq!(distance([3.25, 0.0, 0.0]), 1.0);
        assert!(distance([1.0, 0.3, 0.0]) < 0.0);
        // The side is tangent to the first ball at this point.
        let sin = 0.125;
        let p = [0.5 * sin, 0.5 * (1.0_f64 - sin * sin).sqrt(), 0.0];
        assert!(distance(p).abs() < 1e-12);
    }

    #[test]
    fn the_surface_of_a_panel_passes_through_its_edges_and_its_thickest_point() {
        let section = Section { leading: 0.0, trailing: 1.0, thickness_half: 0.05 };
        let panel = Panel::new([0.0; 2], [1.0, 0.0], 2.0, [section; 2], 0.001);
        let distance = |p: Vec3| panel.distance(&p.map(|x| [x]))[0];
        assert!(distance([0.0, 1.0, 0.0]).abs() < 1e-12);
        assert!(distance([1.0, 1.0, 0.0]).abs() < 1e-12);
        assert!(distance([0.35, 1.0, 0.05]).abs() < 1e-12);
        assert!(distance([0.5, 2.5, 0.0]) > 0.4);
        assert!(distance([0.5, 1.0, 0.0]) < 0.0);
    }
}
