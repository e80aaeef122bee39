//! A case: the geometry to mesh and the resolution.

use crate::error::Error;
use crate::input::ingest::Source;
use crate::input::lattice::{Bounds, Enclosed, ExtentBox, Keep, Root, Rules, Seed};
use bricks::octant::ROOT_EDGE;
use serde::Deserialize;
use std::fmt::Display;

/// A case as the user specifies it. Lengths are in the unit of the geometry.
#[derive(Clone, Debug)]
pub struct Case {
    /// Source of the facets.
    pub source: Source,
    /// Cells at the surface are this size or smaller.
    pub spacing_min: f64,
    /// Minimum thickness of a layer, in cells.
    pub layer_cells_min: u32,
    /// The side that is kept.
    pub keep: Keep,
    /// Whether crossing leaves are kept.
    pub keep_crossing: bool,
    /// The root cube.
    pub root: RootSpec,
    /// Extent boxes.
    pub boxes: Vec<BoxSpec>,
    /// Points that lie in the flow; if there are none, rays decide the sides.
    pub seeds: Vec<[f64; 3]>,
    /// The treatment of outside components that do not reach the root's boundary.
    pub enclosed: Enclosed,
}

/// Specification of the root cube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RootSpec {
    /// Edge as a multiple of the longest edge of the geometry's bounding box; centred on that box.
    Scale(f64),
    /// Origin and edge.
    Exact(Root),
}

/// An extent box and the spacing inside it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// Minimum corner.
    pub min: [f64; 3],
    /// Maximum corner.
    pub max: [f64; 3],
    /// Cells in the box are this size or smaller.
    pub spacing: f64,
}

impl Case {
    /// The rules that define the mesh, given the bounds of the geometry.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn rules(&self, bounds: &Bounds) -> Result<Rules, Error> {
        positive("spacing_min", self.spacing_min)?;
        require(self.layer_cells_min > 0, "layer_cells_min is 0: a layer has at least 1 cell")?;
        let root = match self.root {
            RootSpec::Exact(root) => root,
            RootSpec::Scale(k) => {
                positive("root_scale", k).and_then(|()| Root::around(bounds, k))?
            }
        };
        positive("the root's edge", root.edge)?;
        let finite = |what: &str, point: [f64; 3]| {
            let why = format!("{what} is not finite: give three numbers");
            require(point.iter().all(|c| c.is_finite()), why)
        };
        finite("the root's origin", root.origin)?;
        let level_surface = root.level_of(self.spacing_min, "spacing_min")?;
        let boxes = self.boxes.iter().enumerate().map(|(i, b)| b.on(&root, i));
        let seed = |(number, &given): (usize, &[f64; 3])| {
            finite(&format!("seed {number}"), given)?;
            Ok(Seed { given, lattice: root.nearest(given) })
        };
        Ok(Rules {
            root,
            level_surface,
            layer_cells_min: self.layer_cells_min,
            keep: self.keep,
            keep_crossing: self.keep_crossing,
            boxes: boxes.collect::<Result<_, _>>()?,
            seeds: self.seeds.iter().enumerate().map(seed).collect::<Result<_, Error>>()?,
            enclosed: self.enclosed,
        })
    }
}

/// Refuses the case, unless it is right.
fn require(is_right: bool, why: impl Display) -> Result<(), Error> {
    if is_right { Ok(()) } else { Err(Error::input(why)) }
}

fn positive(what: &str, v: f64) -> Result<(), Error> {
    require(v.is_finite() && v > 0.0, format!("{what} is {v}: give a positive number"))
}

impl BoxSpec {
    /// The box on the lattice; `number`, from 0, identifies it in errors.
    fn on(&self, root: &Root, number: usize) -> Result<ExtentBox, Error> {
        let [min, max] = [self.min, self.max];
        let is_right = (0..3).all(|a| min[a] < max[a] && min[a].is_finite() && max[a].is_finite());
        let why = "min must be below max on every axis, and both finite";
        require(is_right, format!("box {number}: {why}"))?;
        let spacing = format!("box {number}: spacing");
        positive(&spacing, self.spacing)?;
        let level = root.level_of(self.spacing, &spacing)?;
        let on_lattice = |p| root.nearest(p).map(|c| c.clamp(0, ROOT_EDGE));
        Ok(ExtentBox { min: on_lattice(min), max: on_lattice(max), level })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_out_of_range_are_refused() {
        let c = Case { spacing_min: 0.5, root: RootSpec::Scale(10.0), ..crate::tests::case() };
        let c = Case { boxes: Vec::new(), ..c };
        let unit = Bounds { lo: [0.0; 3], hi: [1.0; 3] };
        assert_eq!(c.rules(&unit).unwrap().level_surface, 5);
        for spacing_min in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9] {
            assert!(Case { spacing_min, ..c.clone() }.rules(&unit).is_err());
        }
        assert!(c.rules(&Bounds::of(&[])).is_err());
        assert!(Case { layer_cells_min: 0, ..c.clone() }.rules(&unit).is_err());
        let boxed = |min: [f64; 3]| Case {
            boxes: vec![BoxSpec { min, max: [1.0; 3], spacing: 0.1 }],
            ..c.clone()
        };
        assert!(boxed([0.0; 3]).rules(&unit).is_ok());
        assert!(boxed([0.0, 1.0, 0.0]).rules(&unit).is_err());
    }
}
