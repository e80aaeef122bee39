//! Some facets as one: bounds on where they are, on their normals and on their heights along a common vector.

#[cfg(test)]
mod tests;

use contract::lattice::FacetLattice;

use super::boxes::{Bounds, unit_normal};
use super::bundles::{Bundle, greater, less};

/// Upper bound on the rounding errors of heights, in lattice units.
const HEIGHT_ERROR: f64 = 1e-5;

/// Upper bound on the rounding errors of cosines and of ratios of lengths.
const ROUNDING: f64 = 1e-5;

/// Some facets.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    bounds: Bounds,
    /// A vector in the middle of the unit normals.
    normal: [f32; 3],
    /// Greatest differences of the components of the unit normals from those of `normal`.
    spread: [f32; 3],
    /// Least and greatest scalar product of `normal` and a vertex.
    heights: [f64; 2],
    /// The shell of the facets; none if they belong to several.
    pub shell: Option<u32>,
}

impl Patch {
    /// A facet with an area.
    pub fn of(facet: &FacetLattice, bounds: Bounds, shell: u32) -> Self {
        let unit = unit_normal(facet);
        let mut patch = Self {
            bounds,
            normal: unit.map(|x| x as f32),
            spread: [0.0; 3],
            heights: [f64::INFINITY, f64::NEG_INFINITY],
            shell: Some(shell),
        };
        for a in 0..3 {
            patch.spread[a] = above((unit[a] - f64::from(patch.normal[a])).abs());
        }
        patch.add_heights(facet);
        patch
    }

    /// The patch of facets, if there are any, each given with its own patch. Its heights are those of the vertices, unlike those of a union.
    pub fn of_all<'a>(
        facets: impl Iterator<Item = (&'a FacetLattice, Self)> + Clone,
    ) -> Option<Self> {
        let mut ends = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let mut all: Option<Self> = None;
        for (_, one) in facets.clone() {
            for a in 0..3 {
                let (middle, spread) = (f64::from(one.normal[a]), f64::from(one.spread[a]));
                ends[0][a] = less(ends[0][a], middle - spread);
                ends[1][a] = greater(ends[1][a], middle + spread);
            }
            all = Some(all.map_or(one, |all| Self {
                bounds: all.bounds.union(&one.bounds),
                shell: all.shell.filter(|_| all.shell == one.shell),
                ..all
            }));
        }
        let mut all = all?;
        (all.normal, all.spread) = middle(ends);
        all.heights = [f64::INFINITY, f64::NEG_INFINITY];
        facets.for_each(|(facet, _)| all.add_heights(facet));
        Some(all)
    }

    fn add_heights(&mut self, facet: &FacetLattice) {
        for vertex in facet {
            let height: f64 = (0..3).map(|a| f64::from(self.normal[a]) * vertex[a] as f64).sum();
            self.heights = [less(self.heights[0], height), greater(self.heights[1], height)];
        }
    }

    /// The facets of both.
    pub fn union(&self, other: &Self) -> Self {
        let end = |sign: f64| {
            [0, 1, 2].map(|a| {
                let end = |p: &Self| f64::from(p.normal[a]) + sign * f64::from(p.spread[a]);
                let [p, q] = [end(self), end(other)];
                if sign < 0.0 { less(p, q) } else { greater(p, q) }
            })
        };
        let (normal, spread) = middle([end(-1.0), end(1.0)]);
        let ([a, b], [c, d]) = (self.heights_along(&normal), other.heights_along(&normal));
        let heights = [less(a, c), greater(b, d)];
        let shell = self.shell.filter(|_| self.shell == other.shell);
        Self { bounds: self.bounds.union(&other.bounds), normal, spread, heights, shell }
    }

    /// Bounds on the scalar products of another vector and the vertices.
    fn heights_along(&self, vector: &[f32; 3]) -> [f64; 2] {
        let (mut middle, mut half) = (0.0, 0.0);
        for a in 0..3 {
            let turn = f64::from(vector[a]) - f64::from(self.normal[a]);
            let (centre, extent) = self.along(a);
            middle += turn * centre;
            half += turn.abs() * extent;
        }
        [self.heights[0] + middle - half, self.heights[1] + middle + half]
    }

    /// The middle and half the length of the bounding box along an axis.
    fn along(&self, a: usize) -> (f64, f64) {
        let (low, high) = (f64::from(self.bounds.low[a]), f64::from(self.bounds.high[a]));
        ((low + high) / 2.0, (high - low) / 2.0)
    }

    /// A lower bound on the squared distance of the facets.
    pub fn squared_min(&self, other: &Self) -> f64 {
        let (mut boxes, mut between, mut extents, mut others) = (0.0, [0.0; 3], 0.0, 0.0);
        let (mut turned, mut turned_half, mut height, mut length) = (0.0, 0.0, 0.0, 0.0);
        for a in 0..3 {
            let ((p, r), (q, s)) = (self.along(a), other.along(a));
            between[a] = q - p;
            let gap = greater((q - p).abs() - (r + s), 0.0);
            boxes += gap * gap;
            extents += r * r;
            others += s * s;
            let normal = f64::from(self.normal[a]);
            let turn = normal + f64::from(other.normal[a]);
            turned += turn * q;
            turned_half += turn.abs() * s;
            height += normal * between[a];
            length += normal * normal;
        }
        // The normals of a large patch may have a short mean, or none.
        if length < 0.25 {
            return boxes;
        }
        let low = turned - turned_half - other.heights[1] - self.heights[1];
        let high = turned + turned_half - other.heights[0] - self.heights[0];
        let gap = greater(greater(low, -high) - HEIGHT_ERROR, 0.0);
        let squared: f64 = between.iter().map(|x| x * x).sum();
        let lateral = (squared - height * height / length).max(0.0).sqrt();
        let lateral = greater(lateral * (1.0 - ROUNDING) - extents.sqrt() - others.sqrt(), 0.0);
        greater(boxes, (gap * gap / length + lateral * lateral) * (1.0 - 1e-9))
    }

    /// The same bounds in f32, relative to a point from which no coordinate is farther than `radius`.
    pub fn bundle(&self, origin: [f64; 3], radius: f64) -> Bundle<1> {
        // The error of a coordinate is a quarter of this.
        let error = radius * 2.0f64.powi(-22);
        let mut bundle = Bundle::EMPTY;
        let mut middle = 0.0;
        for (a, origin) in origin.into_iter().enumerate() {
            let (centre, half) = self.along(a);
            bundle.centre[a][0] = (centre - origin) as f32;
            bundle.half[a][0] = above(half + error);
            bundle.normal[a][0] = self.normal[a];
            // With the errors of a sum of products.
            bundle.spread[a][0] = self.spread[a] + 2e-6;
            middle += f64::from(self.normal[a]) * centre;
        }
        bundle.low[0] = -above(middle - self.heights[0] + error);
        bundle.high[0] = above(self.heights[1] - middle + error);
        bundle
    }
}

/// The middles of intervals, and upper bounds on half their lengths.
fn middle([low, high]: [[f64; 3]; 2]) -> ([f32; 3], [f32; 3]) {
    let normal = [0, 1, 2].map(|a| ((low[a] + high[a]) / 2.0) as f32);
    let half = |a: usize| {
        let middle = f64::from(normal[a]);
        above(greater(high[a] - middle, middle - low[a]))
    };
    (normal, [half(0), half(1), half(2)])
}

/// A float that is no less.
fn above(x: f64) -> f32 {
    (x as f32).next_up()
}
