//! The two aircraft. x points aft and z up; the nose is at x = 0. A structure describes the half with
//! y >= 0; the other half is its mirror image.

use super::implicit::Body;
use super::solids::{
    Panel, Points, RoundCone, Section, Vec3, blend, carve, join, nearest, rounded_box,
};

fn section(leading: f64, trailing: f64, thickness_half: f64) -> Section {
    Section { leading, trailing, thickness_half }
}

/// An unmanned aircraft similar to the Predator of the paper: bulbous nose with a sensor ball, long
/// slender wings with stores on pylons, a boom, an inverted V tail and a ventral fin. The unit is
/// the wing span. The drawn surface is centred along x.
pub(super) struct Uav {
    hull: Vec<RoundCone>,
    ball: RoundCone,
    stores: Vec<RoundCone>,
    wing: Panel,
    tail: Panel,
    fin: Panel,
    pylons: Vec<Panel>,
}

impl Body for Uav {
    const BOUNDS: [Vec3; 2] = [[0.0, -0.51, -0.12], [0.57, 0.51, 0.06]];
    const FACETS_TIMES_SQUARE: f64 = 2.45;

    fn new(radius_least: f64) -> Self {
        let r = |radius: f64| radius.max(radius_least);
        let panel =
            |root, along, span, sections| Panel::new(root, along, span, sections, radius_least);
        let stations = [
            ([0.042, 0.0, 0.004], 0.032),
            ([0.105, 0.0, 0.009], 0.041),
            ([0.190, 0.0, 0.003], 0.034),
            ([0.340, 0.0, 0.000], 0.026),
            ([0.430, 0.0, 0.002], 0.018),
            ([0.560, 0.0, 0.005], 0.008),
        ];
        let cone = |[(p, a), (q, b)]: [(Vec3, f64); 2]| RoundCone::new(p, r(a), q, r(b));
        let store = |y: f64| cone([([0.228, y, -0.011], 0.0065), ([0.312, y, -0.011], 0.0060)]);
        let pylon = |y: f64| {
            let sections = [section(0.250, 0.298, 0.0026), section(0.254, 0.290, 0.0024)];
            panel([y, 0.015], [0.0, -1.0], 0.024, sections)
        };
        Self {
            hull: stations.windows(2).map(|w| cone([w[0], w[1]])).collect(),
            ball: cone([([0.084, 0.0, -0.034], 0.020), ([0.086, 0.0, -0.044], 0.020)]),
            stores: [0.12, 0.19].map(store).into(),
            wing: panel(
                [0.0, 0.014],
                [0.9995, 0.031_618_823],
                0.496,
                [section(0.222, 0.316, 0.0062), section(0.256, 0.300, 0.0026)],
            ),
            tail: panel(
                [0.0, 0.005],
                [0.8, -0.6],
                0.150,
                [section(0.468, 0.540, 0.0042), section(0.506, 0.550, 0.0024)],
            ),
            fin: panel(
                [0.0, 0.0],
                [0.0, -1.0],
                0.080,
                [section(0.484, 0.540, 0.0036), section(0.512, 0.546, 0.0024)],
            ),
            pylons: [0.12, 0.19].map(pylon).into(),
        }
    }

    #[inline(always)]
    fn distance<const N: usize>(&self, [x, y, z]: &Points<N>) -> [f64; N] {
        let p = &[*x, y.map(f64::abs), *z];
        let hull = blend(nearest(&self.hull, p), self.ball.distance(p), 0.006);
        let mut wing = self.wing.distance(p);
        for pylon in &self.pylons {
            wing = blend(wing, pylon.distance(p), 0.003);
        }
        let wing = blend(wing, nearest(&self.stores, p), 0.002);
        let tail = join(self.tail.distance(p), self.fin.distance(p));
        blend(blend(hull, wing, 0.010), tail, 0.006)
    }
}

/// A fighter similar to the F-22 of the paper: chined nose, canopy, two hollow intakes, swept
/// trapezoidal wings, tailplanes, two canted fins and two hollow nozzles; with `GEAR`, landing gear. The unit is its length.
pub(super) struct Fighter<const GEAR: bool> {
    nose: Vec<RoundCone>,
    canopy: Vec<RoundCone>,
    engine: RoundCone,
    nozzle: RoundCone,
    chine: Panel,
    wing: Panel,
    tailplane: Panel,
    fin: Panel,
    /// Legs and pairs of wheels.
    gear: Vec<RoundCone>,
    radius_least: f64,
}

impl<const GEAR: bool> Body for Fighter<GEAR> {
    const BOUNDS: [Vec3; 2] =
        [[-0.01, -0.38, if GEAR { -0.14 } else { -0.08 }], [1.01, 0.38, 0.21]];
    const FACETS_TIMES_SQUARE: f64 = 7.55;

    fn new(radius_least: f64) -> Self {
        let r = |radius: f64| radius.max(radius_least);
        let panel =
            |root, along, span, sections| Panel::new(root, along, span, sections, radius_least);
        let cones = |stations: &[(Vec3, f64)]| -> Vec<RoundCone> {
            let cone = |w: &[(Vec3, f64)]| RoundCone::new(w[0].0, r(w[0].1), w[1].0, r(w[1].1));
            stations.windows(2).map(cone).collect()
        };
        Self {
            nose: cones(&[
                ([0.004, 0.0, -0.004], 0.0035),
                ([0.120, 0.0, 0.000], 0.029),
                ([0.260, 0.0, 0.002], 0.043),
                ([0.620, 0.0, 0.006], 0.040),
            ]),
            canopy: cones(&[
                ([0.140, 0.0, 0.026], 0.010),
                ([0.215, 0.0, 0.040], 0.025),
                ([0.270, 0.0, 0.040], 0.023),
                ([0.420, 0.0, 0.034], 0.012),
            ]),
            engine: RoundCone::new([0.700, 0.046, 0.0], r(0.046), [0.895, 0.046, 0.0], r(0.034)),
            // A coarse grid needs a thicker wall, so the hollow is narrower.
            nozzle: RoundCone::new(
                [0.880, 0.046, 0.0],
                (0.024 - radius_least).max(0.002),
                [0.960, 0.046, 0.0],
                (0.026 - radius_least).max(0.002),
            ),
            chine: panel(
                [0.0, 0.002],
                [1.0, 0.0],
                0.098,
                [section(0.010, 0.560, 0.010), section(0.290, 0.560, 0.004)],
            ),
            wing: panel(
                [0.05, 0.004],
                [1.0, 0.0],
                0.305,
                [section(0.370, 0.842, 0.0115), section(0.644, 0.745, 0.0030)],
            ),
            tailplane: panel(
                [0.07, 0.0],
                [1.0, 0.0],
                0.170,
                [section(0.790, 0.990, 0.0060), section(0.925, 0.985, 0.0028)],
            ),
            fin: panel(
                [0.085, 0.020],
                [0.469_471_562_785_890_8, 0.882_947_592_858_926_9],
                0.180,
                [section(0.660, 0.860, 0.0065), section(0.785, 0.868, 0.0028)],
            ),
            gear: [
                ([0.270, 0.0, -0.02], [0.285, 0.0, -0.105], 0.005),
                ([0.285, 0.007, -0.105], [0.285, 0.013, -0.105], 0.015),
                ([0.610, 0.062, -0.02], [0.620, 0.080, -0.100], 0.007),
                ([0.620, 0.080, -0.100], [0.620, 0.094, -0.100], 0.022),
            ]
            .map(|(from, to, radius)| RoundCone::new(from, r(radius), to, r(radius)))
            .into(),
            radius_least,
        }
    }

    #[inline(always)]
    fn distance<const N: usize>(&self, [x, y, z]: &Points<N>) -> [f64; N] {
        let p = &[*x, y.map(f64::abs), *z];
        let nose = blend(nearest(&self.nose, p), nearest(&self.canopy, p), 0.012);
        let nose = blend(nose, self.chine.distance(p), 0.03);
        let duct = rounded_box(p, [0.470, 0.076, -0.004], [0.200, 0.034, 0.037], 0.010);
        let aft = rounded_box(p, [0.690, 0.045, 0.002], [0.170, 0.070, 0.034], 0.014);
        let hull = blend(blend(nose, duct, 0.010), aft, 0.020);
        let hull = blend(hull, self.engine.distance(p), 0.010);
        let boom = rounded_box(p, [0.830, 0.098, 0.002], [0.110, 0.016, 0.016], 0.010);
        let surfaces = blend(self.wing.distance(p), self.tailplane.distance(p), 0.004);
        let solid = blend(blend(hull, boom, 0.008), surfaces, 0.014);
        let solid = blend(solid, self.fin.distance(p), 0.010);
        let solid = if GEAR { blend(solid, nearest(&self.gear, p), 0.003) } else { solid };
        let half = [0.110, 0.026, 0.029].map(|size: f64| (size - self.radius_least).max(0.004));
        let intake = rounded_box(p, [0.250, 0.078, -0.004], half, 0.003);
        carve(solid, join(intake, self.nozzle.distance(p)))
    }
}
