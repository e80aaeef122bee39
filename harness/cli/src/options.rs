//! Options that commands share: files and numbers, programs, a mesh on disk or of a case, and the part of a mesh.

use clap::Args;
use contract::case::Case;
use contract::failure::{Failure, Result};
use contract::lattice::Root;
use contract::manifest::Sides;
use contract::mesh::Mesh;
use contract::octant::LEVEL_MAX;
use contract::word::Side;
use export::selection::{Selection, Slice};
use run::engine::layout::{Layout, SERIAL};
use run::engine::paths::Paths;
pub use run::engine::paths::{Input, Output};
use run::engine::runner::{Engine, Given, Programs};
pub use run::verify::options::whole_seconds;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// The examples at the head of a page of `harness/doc`, for the help of its command.
pub fn examples(page: &str) -> String {
    let block = page.split("```").nth(1).unwrap_or_default();
    format!("Examples:{}", block.trim_end().replace('\n', "\n  "))
}

/// A parser of a number in a range.
pub fn number_in(
    range: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| {
        let number = text.trim().parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("give a number from {} to {}", range.start(), range.end()))
    }
}

/// Parses a point in the user's units.
pub fn point(text: &str) -> Result<[f64; 3], String> {
    numbers(text, "X,Y,Z")
}

/// Parses finite numbers, separated by commas as in `form`.
fn numbers<const N: usize>(text: &str, form: &str) -> Result<[f64; N], String> {
    let finite = |n: &str| n.trim().parse().ok().filter(|c: &f64| c.is_finite());
    let numbers = text.split(',').map(finite).collect::<Option<Vec<f64>>>();
    let array = numbers.and_then(|numbers| numbers.try_into().ok());
    array.ok_or_else(|| format!("give finite numbers: {form}"))
}

/// Reads the case with this name in geometries/catalogue.toml, or the case file with this path.
///
/// # Errors
/// If it cannot be read.
pub fn read_case(name: &str) -> Result<Case> {
    Case::read(&Paths::find().catalogue.case_file(name, Path::new(""))?)
}

/// Parses a root from four numbers.
pub fn root(text: &str) -> Result<Root, String> {
    let [x, y, z, edge] = numbers(text, "X,Y,Z,EDGE")?;
    let root = Root { origin: [x, y, z], edge };
    let why = "give an edge that is positive, from 1e-100 to 1e100";
    root.is_cube().then_some(root).ok_or_else(|| why.to_owned())
}

/// The program under test.
#[derive(Args, Clone, Debug)]
pub struct EngineArguments {
    /// The program under test: name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    pub engine: String,
    /// Paths of the programs.
    #[command(flatten)]
    pub programs: Given,
}

impl EngineArguments {
    /// Finds the programs.
    ///
    /// # Errors
    /// If the engine is not known.
    pub fn find(&self) -> Result<Programs> {
        Programs::find(&self.engine, &self.programs)
    }
}

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
    slice: Option<(usize, f64)>,
}

impl SelectionArguments {
    /// The selection in the units of this mesh.
    ///
    /// # Errors
    /// If no leaf of such a mesh can satisfy a condition, or if its ranks are needed and it cannot be read.
    pub fn of(&self, mesh: &Mesh) -> Result<Selection> {
        let Self { clip, level_max, side, rank, slice } = *self;
        let (root, ranks) = (&mesh.manifest.root, mesh.parts.len());
        if let Some(rank) = rank {
            mesh.require_ranks()?;
            let why = format!("--rank {rank}: the mesh has {ranks} ranks, from 0 on");
            Failure::unless((rank as usize) < ranks, why)?;
        }
        let are_known = side.is_none() || mesh.manifest.sides == Sides::Known;
        Failure::unless(are_known, "--side: the sides of this mesh are unknown, so omit it")?;
        let plane = |(axis, at)| {
            let (name, low) = (AXES[axis], root.origin[axis]);
            let high = low + root.edge;
            let extent = format!("the mesh extends from {name}={low} to {name}={high}");
            Slice::new(root, axis, at).ok_or_else(|| format!("--slice {name}={at}: {extent}"))
        };
        let clip = clip.map(|corners| corners.map(|corner| root.quantise_clamped(corner)));
        Ok(Selection { clip, level_max, side, rank, slice: slice.map(plane).transpose()? })
    }
}

/// A mesh on disk or a case, and how a case is meshed.
#[derive(Args, Debug)]
pub struct MeshArguments {
    /// A leaf-set directory, a case file (.toml) or a name in geometries/catalogue.toml
    #[arg(value_name = "CASE|DIR")]
    mesh: String,
    /// The case of a leaf-set directory, which provides the geometry: name in geometries/catalogue.toml or path of a case file
    #[arg(long, value_name = "CASE")]
    case: Option<String>,
    /// Time limit for meshing a case [default: 600]
    #[arg(long, value_name = "SECONDS", value_parser = whole_seconds)]
    timeout: Option<Duration>,
    /// The program that meshes a case: name in harness/engines or path of an engine description [default: mesher]
    #[arg(long)]
    engine: Option<String>,
    /// The program of the engine [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    mesher: Option<Input>,
}

/// A leaf-set directory. One that was made is deleted with this value.
pub struct Meshed {
    /// The directory.
    pub dir: PathBuf,
    /// The temporary directory in which it was made.
    pub made: Option<TempDir>,
}

impl MeshArguments {
    /// The mesh, and its case if that is known. A case is meshed in a temporary directory, by ranks of this layout, as far as the base tree or to its end.
    ///
    /// # Errors
    /// If the case cannot be read or meshed.
    pub fn open(&self, layout: &Layout, ungraded: bool) -> Result<(Meshed, Option<Case>)> {
        let given = Path::new(&self.mesh);
        if given.is_dir() {
            let Self { engine, mesher, timeout, .. } = self;
            let is_plain = engine.is_none() && mesher.is_none() && timeout.is_none();
            let why = format!("{} is meshed already: omit the options for meshing", self.mesh);
            Failure::unless(is_plain && !ungraded && *layout == SERIAL, why)?;
            let case = self.case.as_deref().map(read_case).transpose()?;
            return Ok((Meshed { dir: given.to_owned(), made: None }, case));
        }
        let why = format!("{} is not a leaf-set directory, which --case requires", self.mesh);
        Failure::unless(self.case.is_none(), why)?;
        let (name, paths) = (self.engine.as_deref().unwrap_or("mesher"), Paths::find());
        let engine = Engine::find(name, self.mesher.as_deref(), &paths)?;
        let path = paths.catalogue.case_file(&self.mesh, Path::new(""))?;
        let case = Case::read(&path)?;
        if let Some(why) = engine.description.declines(&case) {
            return Err(Failure::missing(format!("left out: {why}")));
        }
        let made = tempfile::Builder::new().prefix("harness-mesh-").tempdir()?;
        let prepared = engine.prepare(&path, &made.path().join("case"))?;
        let limit = self.timeout.unwrap_or(Duration::from_secs(600));
        let dir = engine.mesh(&prepared, layout, ungraded, (made.path(), limit))?;
        Ok((Meshed { dir, made: Some(made) }, Some(case)))
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Parses a box; the corners are returned in ascending order.
fn clip(text: &str) -> Result<[[f64; 3]; 2], String> {
    let [x0, y0, z0, x1, y1, z1] = numbers(text, "X0,Y0,Z0,X1,Y1,Z1")?;
    let axes = [(x0, x1), (y0, y1), (z0, z1)];
    if axes.iter().any(|(from, to)| from == to) {
        return Err("the box has no volume: use --slice for the cells at a plane".to_owned());
    }
    Ok([axes.map(|(from, to)| from.min(to)), axes.map(|(from, to)| from.max(to))])
}

/// Parses a plane: its axis and its coordinate along it.
fn plane(text: &str) -> Result<(usize, f64), String> {
    let parsed = text.split_once('=').and_then(|(axis, at)| {
        let [at] = numbers(at, "").ok()?;
        Some((AXES.iter().position(|name| *name == axis.trim())?, at))
    });
    parsed.ok_or_else(|| "give an axis and a coordinate, such as z=0".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_three_finite_numbers() {
        assert_eq!(point("-1, 2.5,3e2"), Ok([-1.0, 2.5, 300.0]));
        for wrong in ["1,2", "1,2,3,4", "1,2,x", "1,2,nan", ""] {
            assert!(point(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_root_has_an_edge_that_is_positive() {
        assert_eq!(root("-1,0,2,4"), Ok(Root { origin: [-1.0, 0.0, 2.0], edge: 4.0 }));
        for wrong in ["0,0,0,0", "0,0,0,-1", "0,0,0,inf", "0,0,0", "0,0,0,1e100", "1e100,0,0,1"] {
            assert!(root(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_time_limit_is_at_least_a_second_and_at_most_a_week() {
        let seconds = |text| whole_seconds(text).map(|limit| limit.as_secs());
        assert_eq!((seconds("1"), seconds(" 604800 ")), (Ok(1), Ok(604_800)));
        for wrong in ["0", "-1", "604801", "1.5", ""] {
            assert_eq!(
                seconds(wrong),
                Err("give a whole number of seconds from 1 to 604800".to_owned())
            );
        }
    }

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
        assert_eq!(plane("z=-0.5"), Ok((2, -0.5)));
        for wrong in ["", "z", "w=1", "z=", "z=nan", "0"] {
            assert!(plane(wrong).is_err(), "{wrong}");
        }
    }
}
