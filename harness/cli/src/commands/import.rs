//! `harness import`: makes a leaf-set directory from a mesh in another program's format.

use super::values::{Input, read_case, root};
use clap::Args;
use contract::case::Case;
use contract::failure::EXIT_HOLDS;
use contract::failure::Failure;
use contract::import::htg::ImportedTree;
use contract::import::{self, Format, Position, Request};
use contract::lattice::Root;
use contract::leafset::LeafSet;
use contract::manifest::{Manifest, Sides};
use contract::word::{self, KEY_END};
use run::engine::paths::Paths;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// `harness import`.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  harness import forest.p8est --root -4,-4,-4,8 --out mesh     the unit cube of the forest becomes this root
  harness import cells.csv --case body.toml --out mesh         columns x, y, z, level; the root of the case
  harness import mesh.vtu --sides side --out mesh              sides from a cell array: 0 outside, 1 inside, 2 crossing
  harness import foam/constant/polyMesh --out mesh             the root is derived from the cells

Every cell must be a cube of the oct-tree, within 0.01 of its edge, and no two may overlap. Exit codes: 0 success; 2 the
file is not such a mesh, which is explained in one sentence, or cannot be written; 3 Python, or VTK for VTK's formats, is missing (leaf \
words, p4est and the mesher's trees need neither).")]
pub struct Arguments {
    /// The mesh: a file, or an OpenFOAM case or polyMesh
    mesh: Input,
    /// The directory to make
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// How to read the mesh.
    #[command(flatten)]
    source: Source,
}

/// How to read a mesh in another program's format.
#[derive(Args, Debug)]
pub struct Source {
    /// The format [default: recognised by content]
    #[arg(long)]
    format: Option<Format>,
    /// Minimum corner and edge length of the root [default: that of the case, of the file, or derived from the cells]
    #[arg(long, value_name = "X,Y,Z,EDGE", value_parser = root, allow_hyphen_values = true)]
    root: Option<Root>,
    /// The case that was meshed, for its root and requirements: name in geometries/catalogue.toml or path of a case file
    #[arg(long, value_name = "CASE", conflicts_with = "root")]
    case: Option<String>,
    /// Cell array or column with the sides: 0 outside, 1 inside, 2 crossing [default: the sides are unknown]
    #[arg(long, value_name = "NAME")]
    sides: Option<String>,
    /// What x, y and z are in a table
    #[arg(long, value_enum, default_value_t)]
    position: Position,
    /// Time limit of a reader in Python
    #[arg(long, value_name = "SECONDS", default_value_t = 3600, value_parser = super::values::whole_seconds)]
    timeout: u64,
}

impl Source {
    /// Whether any option is given that has no effect on a leaf-set directory.
    pub fn is_given(&self) -> bool {
        let Self { format, root, case: _, sides, position, timeout: _ } = self;
        format.is_some() || root.is_some() || sides.is_some() || *position != Position::default()
    }

    /// Reads the case, if one is given.
    ///
    /// # Errors
    /// If it is not in the catalogue, or is invalid.
    pub fn read_case(&self) -> Result<Option<Case>, Failure> {
        self.case.as_deref().map(read_case).transpose()
    }

    /// Reads the mesh.
    ///
    /// # Errors
    /// If it is not a usable mesh, or if Python or VTK is missing.
    pub fn read(&self, mesh: &Path, case: Option<&Case>) -> Result<Imported, Failure> {
        let input = |error: import::ImportError| Failure::input(error.of_file(mesh));
        let root = self.root.or(case.map(|case| case.root));
        let format = self.format.map_or_else(|| import::guess(mesh), Ok).map_err(input)?;
        let program = format!("harness {} import", env!("CARGO_PKG_VERSION"));
        if format == Format::Vtk {
            let sides = self.sides.as_deref();
            let tree = ImportedTree::open(mesh, sides, root, case, program.clone());
            if let Some(tree) = tree.map_err(input)? {
                return Ok(Imported::Tree(Box::new(tree)));
            }
        }
        let request = Request { sides: self.sides.clone(), root, position: self.position };
        let limit = Duration::from_secs(self.timeout);
        let cells = run::import::read(mesh, format, &request, &Paths::find(), limit)?;
        let set = import::leaf_set(&cells, root, case, program).map_err(input)?;
        if root.is_none() && cells.root.is_none() {
            let Root { origin: [x, y, z], edge } = set.manifest.root;
            eprintln!(
                "harness: the root {x},{y},{z},{edge} is the least that holds the cells; --root gives another"
            );
        }
        Ok(Imported::Words(Box::new(set)))
    }
}

/// A mesh that was read.
pub enum Imported {
    /// Its leaves are in memory.
    Words(Box<LeafSet>),
    /// Its leaves are in a tree of any size.
    Tree(Box<ImportedTree>),
}

impl Imported {
    fn manifest(&self) -> &Manifest {
        match self {
            Self::Words(set) => &set.manifest,
            Self::Tree(tree) => &tree.manifest,
        }
    }

    fn create(&self, dir: &Path) -> io::Result<()> {
        match self {
            Self::Words(set) => set.create(dir),
            Self::Tree(tree) => tree.create(dir),
        }
    }
}

/// Reads and writes; returns the exit code.
///
/// # Errors
/// If the mesh cannot be read or written.
pub fn run(Arguments { mesh, out, source }: &Arguments) -> Result<u8, Failure> {
    let case = source.read_case()?;
    let set = source.read(mesh, case.as_ref())?;
    set.create(out)?;
    println!("{}: {}", out.display(), summary(set.manifest()));
    Ok(EXIT_HOLDS)
}

/// Number of cells, levels, sides, and the part of the root that they fill.
fn summary(manifest: &Manifest) -> String {
    let by_level: Vec<(u8, u64)> =
        (0..).zip(manifest.leaves_by_level).filter(|&(_, n)| n > 0).collect();
    let filled: u128 =
        by_level.iter().map(|&(level, n)| u128::from(n) * u128::from(word::span(level))).sum();
    let sides = match manifest.sides {
        Sides::Known => "sides known",
        Sides::Unknown => "sides unknown",
    };
    format!(
        "{} cells of levels {} to {}, {sides}; they fill {:.6} % of the root",
        manifest.leaves,
        by_level.first().map_or(0, |(level, _)| *level),
        by_level.last().map_or(0, |(level, _)| *level),
        100.0 * filled as f64 / KEY_END as f64
    )
}
