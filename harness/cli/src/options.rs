//! Options that commands share: files and numbers, programs, and the part of a mesh.

use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser, ValueParser, ValueParserFactory};
use contract::case::Case;
use contract::failure::Failure;
use contract::lattice::Root;
use contract::manifest::Sides;
use contract::mesh::Mesh;
use contract::octant::LEVEL_MAX;
use contract::word::Side;
use export::selection::{Selection, Slice};
use run::engine::paths::Paths;
use run::engine::programs::{Given, Programs};
pub use run::verify::options::whole_seconds;
use std::io;
use std::ops::{Deref, RangeInclusive};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A file or a directory that the command writes or reads. It is checked when the command line is parsed, before any work: what is written
/// can be written, and is nothing that the command reads. Files of a directory are inputs when they are opened.
#[derive(Clone, Debug)]
pub struct Place<const WRITTEN: bool>(PathBuf);

/// A file that the command writes.
pub type Output = Place<true>;
/// A file or a directory that the command reads.
pub type Input = Place<false>;

impl<const WRITTEN: bool> Deref for Place<WRITTEN> {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl<const WRITTEN: bool> ValueParserFactory for Place<WRITTEN> {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        let check = if WRITTEN { writable } else { files::register_input };
        PathBufValueParser::new().try_map(move |path| check(&path).map(|()| Self(path))).into()
    }
}

/// A parser of outputs with one of these extensions.
pub fn with_extension(
    extensions: &'static [&'static str],
) -> impl TypedValueParser<Value = Output> {
    PathBufValueParser::new().try_map(move |path| {
        if !path.extension().is_some_and(|e| extensions.iter().any(|wanted| e == *wanted)) {
            let endings = extensions.join(" or .");
            return Err(io::Error::other(format!("the file name must end in .{endings}")));
        }
        writable(&path).map(|()| Place(path))
    })
}

fn writable(path: &Path) -> io::Result<()> {
    files::name_output(path).and_then(|()| files::check_writable(path))
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

/// A point in the user's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point(pub [f64; 3]);

impl FromStr for Point {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        numbers(text).map(Self).ok_or_else(|| "give three numbers: X,Y,Z".to_owned())
    }
}

/// As many finite numbers, separated by commas.
pub fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let finite = |n: &str| n.trim().parse().ok().filter(|c: &f64| c.is_finite());
    text.split(',').map(finite).collect::<Option<Vec<f64>>>()?.try_into().ok()
}

/// Reads the case with this name in geometries/catalogue.toml, or the case file with this path.
///
/// # Errors
/// If it cannot be read.
pub fn read_case(name: &str) -> Result<Case, Failure> {
    Case::read(&Paths::find().catalogue.case_file(name, Path::new(""))?)
}

/// Parses a root from four numbers.
pub fn root(text: &str) -> Result<Root, String> {
    let [x, y, z, edge] =
        numbers(text).ok_or_else(|| "give four numbers: X,Y,Z,EDGE".to_owned())?;
    Ok(Root { origin: [x, y, z], edge })
}

/// Paths of the programs.
#[derive(Args, Clone, Debug)]
pub struct ProgramArguments {
    /// The mesher [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub mesher: Option<Input>,
    /// The reference [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    pub reference: Option<Input>,
}

impl ProgramArguments {
    /// Returns the given paths, which take precedence over the search.
    pub fn given(&self) -> Given {
        let path = |given: &Option<Input>| given.as_deref().map(Path::to_owned);
        Given { mesher: path(&self.mesher), reference: path(&self.reference) }
    }
}

/// The program under test.
#[derive(Args, Clone, Debug)]
pub struct EngineArguments {
    /// The program under test: name in harness/engines or path of an engine description
    #[arg(long, default_value = "mesher")]
    pub engine: String,
    /// Paths of the programs.
    #[command(flatten)]
    pub programs: ProgramArguments,
}

impl EngineArguments {
    /// Finds the programs.
    ///
    /// # Errors
    /// If the engine is not known.
    pub fn find(&self) -> Result<Programs, String> {
        Programs::find_with_engine(&self.engine, self.programs.given())
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
            mesh.require_ranks()?;
            let ranks = mesh.parts.len();
            if rank as usize >= ranks {
                return Err(Failure::input(format!(
                    "--rank {rank}: the mesh has ranks 0 to {}",
                    ranks - 1
                )));
            }
        }
        if self.side.is_some() && mesh.manifest.sides == Sides::Unknown {
            return Err(Failure::input("--side: the sides of this mesh are unknown, so omit it"));
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
    fn points_have_three_finite_numbers() {
        assert_eq!("-1, 2.5,3e2".parse(), Ok(Point([-1.0, 2.5, 300.0])));
        for wrong in ["1,2", "1,2,3,4", "1,2,x", "1,2,nan", ""] {
            assert!(wrong.parse::<Point>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_time_limit_is_at_least_a_second_and_at_most_a_week() {
        assert_eq!((whole_seconds("1"), whole_seconds(" 604800 ")), (Ok(1), Ok(604_800)));
        for wrong in ["0", "-1", "604801", "1.5", ""] {
            assert_eq!(
                whole_seconds(wrong),
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
        assert_eq!(plane("z=-0.5"), Ok(Plane { axis: 2, at: -0.5 }));
        for wrong in ["", "z", "w=1", "z=", "z=nan", "0"] {
            assert!(plane(wrong).is_err(), "{wrong}");
        }
    }
}
