//! An unmanned aircraft similar to the Predator of the paper: bulbous nose with a sensor ball, long
//! slender wings with stores on pylons, a boom, an inverted V tail and a ventral fin.
//!
//! The unit is the wing span. x points aft and z up; the nose is at x = 0. The drawn surface is
//! centred along x.

use super::implicit::Body;
use super::solids::{Panel, RoundCone, Section, Vec3, blend};

/// The half of the aircraft with y >= 0; the other half is its mirror image.
pub(super) struct Uav {
    hull: Vec<RoundCone>,
    ball: RoundCone,
    stores: Vec<RoundCone>,
    wing: Panel,
    tail: Panel,
    fin: Panel,
    pylons: Vec<Panel>,
}

fn section(leading: f64, trailing: f64, thickness_half: f64) -> Section {
    Section { leading, trailing, thickness_half }
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

    fn distance(&self, [x, y, z]: Vec3) -> f64 {
        let p = [x, y.abs(), z];
        let nearest =
            |cones: &[RoundCone]| cones.iter().map(|c| c.distance(p)).fold(f64::INFINITY, f64::min);
        let hull = blend(nearest(&self.hull), self.ball.distance(p), 0.006);
        let wing = self
            .pylons
            .iter()
            .fold(self.wing.distance(p), |sum, pylon| blend(sum, pylon.distance(p), 0.003));
        let wing = blend(wing, nearest(&self.stores), 0.002);
        let tail = self.tail.distance(p).min(self.fin.distance(p));
        blend(blend(hull, wing, 0.010), tail, 0.006)
    }
}
