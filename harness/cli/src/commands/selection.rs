//! Which part of a mesh a command uses.

use super::values::numbers;
use clap::Args;
use contract::failure::Failure;
use contract::lattice::Root;
use contract::manifest::Sides;
use contract::octant::LEVEL_MAX;
use contract::word::Side;
use export::mesh::Mesh;
use export::selection::{Selection, Slice};

/// Which leaves of a mesh are used. Leaves must satisfy all conditions that are given.
#[derive(Args, Debug, Default)]
#[command(next_help_heading = "Selection of cells (all that are given must hold)")]
pub struct SelectionArguments {
    /// Cells that meet this box, given by two opposite corners in the units of the geometry
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = clip, allow_hyphen_values = true)]
    clip: Option<[[f64; 3]; 2]>,
    /// Cells of at most this level; the root is level 0
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u8).range(0..=i64::from(LEVEL_MAX)))]
    level_max: Option<u8>,
    /// Cells on this side of the surface
    #[arg(long, value_enum)]
    side: Option<Side>,
    /// Cells that this rank of the mesher wrote
    #[arg(long, value_name = "R")]
    rank: Option<u32>,
    /// Cells that this plane cuts, in the units of the geometry
    #[arg(long, value_name = "x=X|y=Y|z=Z", value_parser = plane, allow_hyphen_values = true)]
    slice: Option<Plane>,
}

/// A plane normal to an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plane {
    axis: usize,
    at: f64,
}

impl SelectionArguments {
    /// The selection in the units of this mesh.
    ///
    /// # Errors
    /// If no leaf of such a mesh can satisfy a condition, or if its ranks are needed and it cannot be read.
    pub fn of(&self, mesh: &Mesh) -> Result<Selection, Failure> {
        self.check(mesh)?;
        let root = &mesh.manifest.root;
        let slice = self.slice.map(|plane| plane.of(root)).transpose().map_err(Failure::input)?;
        let clip = self.clip.map(|corners| corners.map(|corner| root.quantise_clamped(corner)));
        Ok(Selection { clip, level_max: self.level_max, side: self.side, rank: self.rank, slice })
    }

    /// Refuses conditions on what the mesh does not have.
    fn check(&self, mesh: &Mesh) -> Result<(), Failure> {
        if let Some(rank) = self.rank {
            if !mesh.has_ranks() {
                return Err(mesh.ranks_unknown());
            }
            let ranks = mesh.parts.len();
            if rank as usize >= ranks {
                return Err(Failure::input(format!(
                    "--rank {rank}: the mesh has ranks 0 to {}",
                    ranks - 1
                )));
            }
        }
        if self.side.is_some() && mesh.manifest.sides == Sides::Unknown {
            let why = "--side: the sides of this mesh are unknown, so omit it";
            return Err(Failure::input(why.to_owned()));
        }
        Ok(())
    }
}

impl Plane {
    fn of(self, root: &Root) -> Result<Slice, String> {
        let Self { axis, at } = self;
        Slice::new(root, axis, at).ok_or_else(|| {
            let (name, low) = (["x", "y", "z"][axis], root.origin[axis]);
            let high = low + root.edge;
            format!("--slice {name}={at}: the mesh extends from {name}={low} to {name}={high}")
        })
    }
}

/// Parses a box; the corners are returned in ascending order.
fn clip(text: &str) -> Result<[[f64; 3]; 2], String> {
    let [x0, y0, z0, x1, y1, z1] =
        numbers(text).ok_or_else(|| "give six numbers: X0,Y0,Z0,X1,Y1,Z1".to_owned())?;
    let axes = [(x0, x1), (y0, y1), (z0, z1)];
    if axes.iter().any(|(from, to)| from == to) {
        return Err("the box has no volume: use --slice for the cells at a plane".to_owned());
    }
    Ok([axes.map(|(from, to)| from.min(to)), axes.map(|(from, to)| from.max(to))])
}

/// Parses a plane.
fn plane(text: &str) -> Result<Plane, String> {
    let wrong = || "give an axis and a coordinate, such as z=0".to_owned();
    let (axis, at) = text.split_once('=').ok_or_else(wrong)?;
    let axis = ["x", "y", "z"].iter().position(|name| *name == axis.trim()).ok_or_else(wrong)?;
    let at: f64 = at.trim().parse().map_err(|_| wrong())?;
    if at.is_finite() { Ok(Plane { axis, at }) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_given_by_any_two_opposite_corners() {
        let expected = [[-1.0, 0.0, 2.5], [1.0, 2.0, 3.0]];
        assert_eq!(clip("-1,0,2.5,1,2,3"), Ok(expected));
        assert_eq!(clip("1, 0, 3, -1, 2, 2.5"), Ok(expected));
        for wrong in ["", "1,2,3", "1,2,3,4,5,6,7", "0,0,0,1,1,x", "0,0,0,1,1,inf", "0,0,0,1,1,0"] {
            assert!(clip(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_plane_has_an_axis_and_a_coordinate() {
        assert_eq!(plane("z=-0.5"), Ok(Plane { axis: 2, at: -0.5 }));
        for wrong in ["", "z", "w=1", "z=", "z=nan", "0"] {
            assert!(plane(wrong).is_err(), "{wrong}");
        }
    }
}
