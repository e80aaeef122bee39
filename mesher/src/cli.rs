//! The command line, and the case that it stands for.

use clap::Parser;
use mesher::case::{BoxSpec, Case, LAYER_CELLS_MIN, ROOT_SCALE, RootSpec};
use mesher::error::Error;
use mesher::ingest::Source;
use mesher::lattice::{Keep, Root};
use mesher::partition::{Partitioner, Weights};
use std::path::PathBuf;

/// Makes an off-body hexahedral oct-tree mesh around a geometry.
///
/// Serial as it is; `mpirun -n 8 mesher ...` is all that parallel takes. Exit codes: 0 done, 2 unusable
/// input, 4 output not written, 70 a bug, 130 interrupted.
#[derive(Parser)]
#[command(version)]
pub struct Args {
    /// A case file (.toml), or an STL file together with --spacing-min
    input: PathBuf,
    /// Directory to write the leaf set to; absent or empty. Without it nothing is written
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the report as JSON to this file, too
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Have in it who sent how much to whom in exchanges: [from, to, messages, bytes] of each pair that did
    #[arg(long, requires = "json")]
    pub message_matrix: bool,
    /// Stop at the base tree T0: all leaves with their sides, nothing deleted or graded
    #[arg(long)]
    pub ungraded: bool,
    /// Who cuts the base tree into parts
    #[arg(long, value_enum, default_value = "morton")]
    pub partitioner: Partitioner,
    /// What a base leaf weighs in the partition
    #[arg(long, value_enum, default_value = "rebalance")]
    pub weights: Weights,
    /// Level at which the tree is cut into base leaves: a number, or auto
    #[arg(long, default_value = "auto", value_parser = level_base)]
    pub level_base: LevelBase,
    /// How ranks talk: auto, solo, mpi, or sim:RANKS[:SEED] (ranks simulated in this process)
    #[arg(long, default_value = "auto", value_parser = comm_choice)]
    pub comm: CommChoice,
    /// Each rank keeps DIR/rank-00000.txt with the phase that it is in
    #[arg(long, value_name = "DIR")]
    pub status: Option<PathBuf>,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    body: Body,
}

/// The case, where the input is an STL file.
#[derive(clap::Args)]
#[command(next_help_heading = "Without a case file")]
struct Body {
    /// Cells at the surface are this size or smaller
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    spacing_min: Option<f64>,
    /// Minimum thickness of a layer, in cells [default: 4]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    layer_cells_min: Option<u32>,
    /// Which side stays [default: outside]
    #[arg(long, value_enum)]
    keep: Option<Keep>,
    /// Leave crossing leaves out of the mesh
    #[arg(long)]
    drop_crossing: bool,
    /// Root edge in longest edges of the bounding box, centred on it [default: 10]
    #[arg(long, value_name = "X", conflicts_with = "root", allow_negative_numbers = true)]
    root_scale: Option<f64>,
    /// Root cube: minimum corner and edge
    #[arg(long, value_name = "X,Y,Z,EDGE", allow_hyphen_values = true, value_parser = numbers::<4>)]
    root: Option<[f64; 4]>,
    /// Extent box: minimum corner, maximum corner, spacing; any number of times
    #[arg(long = "box", value_name = "X0,Y0,Z0,X1,Y1,Z1,SPACING", allow_hyphen_values = true, value_parser = numbers::<7>)]
    boxes: Vec<[f64; 7]>,
}

/// A level to cut at; chosen by the number of ranks if none.
#[derive(Clone, Copy)]
pub struct LevelBase(pub Option<u32>);

/// How ranks talk.
#[derive(Clone, Copy)]
pub enum CommChoice {
    /// MPI under a launcher of MPI jobs, else a single rank.
    Auto,
    /// A single rank.
    Solo,
    /// MPI.
    Mpi,
    /// Ranks simulated in this process.
    Sim {
        /// How many.
        ranks: usize,
        /// Of their schedule.
        seed: u64,
    },
}

fn level_base(s: &str) -> Result<LevelBase, String> {
    if s == "auto" {
        return Ok(LevelBase(None));
    }
    match s.parse() {
        Ok(l) if l <= mesher::octant::LEVEL_MAX => Ok(LevelBase(Some(l))),
        _ => Err("give auto or a level from 0 to 19".into()),
    }
}

fn comm_choice(s: &str) -> Result<CommChoice, String> {
    let mut words = s.split(':');
    let choice = match (words.next(), words.next(), words.next()) {
        (Some("auto"), None, None) => Some(CommChoice::Auto),
        (Some("solo"), None, None) => Some(CommChoice::Solo),
        (Some("mpi"), None, None) => Some(CommChoice::Mpi),
        (Some("sim"), Some(ranks), seed) => (|| {
            let ranks = ranks.parse().ok().filter(|r| (1..=4096).contains(r))?;
            Some(CommChoice::Sim { ranks, seed: seed.unwrap_or("1").parse().ok()? })
        })(),
        _ => None,
    };
    choice
        .filter(|_| words.next().is_none())
        .ok_or_else(|| "give auto, solo, mpi or sim:RANKS[:SEED] with 1 to 4096 ranks".into())
}

fn numbers<const N: usize>(s: &str) -> Result<[f64; N], String> {
    let values: Result<Vec<f64>, _> = s.split(',').map(|w| w.trim().parse::<f64>()).collect();
    values
        .ok()
        .and_then(|v| v.try_into().ok())
        .ok_or_else(|| format!("give {N} numbers with commas between them"))
}

/// The command line; what is wrong with it in one sentence, as all other errors. Help and version end
/// the process here.
pub fn parse() -> Result<Args, Error> {
    Args::try_parse().map_err(|e| {
        if !e.use_stderr() {
            e.exit();
        }
        let text = e.to_string();
        let lines = text.lines().map(str::trim).filter(|l| !l.is_empty());
        let told: Vec<&str> = lines
            .take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more information"))
            .collect();
        let told = told.join(" ");
        Error::input(format!("{}; see --help", told.strip_prefix("error: ").unwrap_or(&told)))
    })
}

/// The case that the command line asks for.
pub fn case(args: &Args) -> Result<Case, Error> {
    let b = &args.body;
    let is_case = args.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    if is_case {
        let given = b.spacing_min.is_some()
            || b.layer_cells_min.is_some()
            || b.keep.is_some()
            || b.drop_crossing;
        if given || b.root_scale.is_some() || b.root.is_some() || !b.boxes.is_empty() {
            return Err(Error::input(format!(
                "{} is a case file, which says it all: change it there",
                args.input.display()
            )));
        }
        return Case::read(&args.input);
    }
    let spacing_min = b.spacing_min.ok_or_else(|| {
        Error::input(format!(
            "{} is taken for an STL file: give --spacing-min, or a case file (.toml)",
            args.input.display()
        ))
    })?;
    Ok(Case {
        source: Source::Stl(args.input.clone()),
        spacing_min,
        layer_cells_min: b.layer_cells_min.unwrap_or(LAYER_CELLS_MIN),
        keep: b.keep.unwrap_or(Keep::Outside),
        keep_crossing: !b.drop_crossing,
        root: match b.root {
            Some([x, y, z, edge]) => RootSpec::Exact(Root { origin: [x, y, z], edge }),
            None => RootSpec::Scale(b.root_scale.unwrap_or(ROOT_SCALE)),
        },
        boxes: b
            .boxes
            .iter()
            .map(|v| BoxSpec { min: [v[0], v[1], v[2]], max: [v[3], v[4], v[5]], spacing: v[6] })
            .collect(),
    })
}
