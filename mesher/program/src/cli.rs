//! The command line, and the case that it describes.

use bricks::octant::{LEVEL_MAX, Level};
use case_file::Keys;
use clap::Parser;
use mesher::Options;
use mesher::error::{Error, agree};
use mesher::input::case::Case;
use mesher::input::ingest::Source;
use mesher::output::write::Output;
use mesher::partition::{Division, Partitioner, Weights};
use ranks::{Comm, launch, text_of_first, uncounted};
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::exit;
use std::time::Duration;

/// Exit code of a run whose text could not be printed.
pub const UNPRINTED: i32 = 4;

/// Makes an off-body hexahedral oct-tree mesh around a geometry.
///
/// Runs on one rank, or in parallel under a launcher of MPI jobs: `mpirun -n 8 mesher ...`. Exit codes: 0 success, 1 the geometry or the flow is unusable (--strict), 2 unusable
/// input or an output directory that is not empty or belongs to another run, 4 output could not be written, 70 a bug, 71 the
/// mesh would not fit into memory or memory ran out, 75 a rank exceeded --stall-limit, 130 interrupted by a signal. Unless the code is 0, no file of the mesh remains; a mesh that is complete stays if only its report could not be made or written (4, 70, 71), a rank stalls after that (75) or a second signal arrives (130).
#[derive(Clone, Parser)]
#[command(version = env!("VERSION"))]
pub struct Args {
    /// Case file (.toml), or STL file together with --spacing-min
    #[arg(required_unless_present = "serve")]
    input: Option<PathBuf>,
    /// Write the mesh to this directory, which must be empty or not exist; default: write nothing
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Files to write, separated by commas
    #[arg(long, value_enum, value_delimiter = ',', default_value = "words", requires = "out")]
    write: Vec<Files>,
    /// Also write the report to this file, as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Stop at the base tree T0: all leaves with their sides, none deleted, none graded
    #[arg(long)]
    ungraded: bool,
    /// Method that assigns base leaves to ranks
    #[arg(long, visible_alias = "preset", value_enum, default_value = "morton")]
    partitioner: Partitioner,
    /// Weights of the partition [default: rebalance, which is area with METIS or --level-base; unit with --preset paper]
    #[arg(long, value_enum)]
    weights: Option<Weights>,
    /// Level of the base leaves: 0 to 19, or auto
    #[arg(long, default_value = "auto", value_parser = level_base)]
    level_base: LevelBase,
    /// Communication between ranks: auto, solo (one rank), mpi, or sim:RANKS[:SEED] (ranks simulated in this process)
    #[arg(long, default_value = "auto", value_parser = comm_choice)]
    pub comm: CommChoice,
    /// Simulated ranks repeat all phases after `read` and `quantise`, each alone with the messages that it has received, and the report has the
    /// times of that: those of a rank with a core and caches of its own
    #[arg(long, conflicts_with_all = ["plan", "out"])]
    time_alone: bool,
    /// Check the invariants of the mesh after each phase; takes time and memory, and panics if one is violated
    #[arg(long, conflicts_with = "plan")]
    check: bool,
    /// Make no mesh: print what the run would take, in cells, time, memory and files, from pilot runs at coarser spacings
    #[arg(long)]
    pub plan: bool,
    /// Mesh even if the memory probably does not suffice, instead of ending with exit code 71
    #[arg(long)]
    pub force: bool,
    /// End with exit code 1, without a mesh, if the geometry leaks between spacings or bounds nothing, or the flow is empty or on the wrong side; otherwise these are warnings
    #[arg(long, conflicts_with = "plan")]
    strict: bool,
    /// Each rank keeps the name of its current phase in DIR/rank-00000.txt, also when the run has failed or was interrupted
    #[arg(long, value_name = "DIR")]
    pub status: Option<PathBuf>,
    /// End the job if ranks of MPI wait for another one for longer than this, and name it; greater than the time of the longest phase
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub stall_limit: Option<Duration>,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
    /// Run one command line after another, which spares the start of MPI: each is a line of standard input, a JSON array of the
    /// words after the program's name, and answered by its exit code on a line of standard output
    #[arg(long, exclusive = true)]
    pub serve: bool,
    #[command(flatten)]
    keys: Option<Keys>,
}

impl Args {
    fn input(&self) -> &Path {
        self.input.as_deref().expect("a run has an input")
    }
}

/// Files of a mesh, besides the manifest.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Files {
    /// Leaf words: a NumPy array per rank, 8 bytes per cell
    Words,
    /// The tree with sides, for VTK and ParaView: mesh.vtkhdf, a hyper-tree grid of about 0.05 bytes per cell
    Htg,
}

/// The level of the base leaves; chosen automatically if none. (clap treats an `Option` of that name otherwise.)
type LevelBase = Option<Level>;

/// Communication between ranks.
#[derive(Clone, Copy)]
pub enum CommChoice {
    /// MPI under a launcher of MPI jobs, else a single rank.
    Auto,
    /// A single rank.
    Solo,
    /// MPI.
    Mpi,
    /// Ranks simulated in this process: their number, and the seed of their schedule.
    Sim { ranks: usize, seed: u64 },
}

fn level_base(s: &str) -> Result<LevelBase, String> {
    let level = s.parse().ok().filter(|l| *l <= LEVEL_MAX);
    let is_right = level.is_some() || s == "auto";
    if is_right { Ok(level) } else { Err("give auto or a level from 0 to 19".into()) }
}

fn seconds(s: &str) -> Result<Duration, String> {
    let limit = s.parse().ok().and_then(|s| Duration::try_from_secs_f64(s).ok());
    limit.filter(|l| !l.is_zero()).ok_or_else(|| "give a positive number of seconds".into())
}

fn comm_choice(s: &str) -> Result<CommChoice, String> {
    let sim = |ranks: &str, seed: &str| {
        let ranks = ranks.parse().ok().filter(|r| (1..=4096).contains(r))?;
        Some(CommChoice::Sim { ranks, seed: seed.parse().ok()? })
    };
    let choice = match s.split(':').collect::<Vec<_>>()[..] {
        ["auto"] => Some(CommChoice::Auto),
        ["solo"] => Some(CommChoice::Solo),
        ["mpi"] => Some(CommChoice::Mpi),
        ["sim", ranks] => sim(ranks, "1"),
        ["sim", ranks, seed] => sim(ranks, seed),
        _ => None,
    };
    choice.ok_or_else(|| "give auto, solo, mpi or sim:RANKS[:SEED] with 1 to 4096 ranks".into())
}

/// The command line. Help and version are printed here, on the first rank of a job, and end the process.
///
/// # Errors
/// In one sentence, as all other errors.
pub fn parse<W: Into<OsString> + Clone>(words: impl IntoIterator<Item = W>) -> Result<Args, Error> {
    Args::try_parse_from(words).map_err(|e| {
        if !e.use_stderr() {
            let print = || e.print().and_then(|()| io::stdout().flush());
            match launch::is_first().then(print).transpose() {
                // A closed pipe is no reason to fail.
                Err(e) if e.kind() != io::ErrorKind::BrokenPipe => exit(UNPRINTED),
                _ => exit(0),
            }
        }
        let text = e.to_string();
        let lines = text.lines().map(str::trim).filter(|l| !l.is_empty());
        let is_said = |l: &&str| !l.starts_with("Usage:") && !l.starts_with("For more information");
        let sentence = lines.take_while(is_said).collect::<Vec<_>>().join(" ");
        let sentence = sentence.strip_prefix("error: ").unwrap_or(&sentence);
        Error::input(format!("{sentence}; see --help"))
    })
}

/// The options of a run.
///
/// # Errors
/// If the weights contradict the paper's, or no ranks are simulated that could be timed alone.
pub fn options(args: &Args) -> Result<Options, Error> {
    if args.time_alone && !matches!(args.comm, CommChoice::Sim { .. }) {
        return Err(Error::input("--time-alone is for simulated ranks: add --comm sim:RANKS"));
    }
    let why = "--preset paper gives each base leaf weight 1: leave out --weights";
    let weights = match (args.partitioner, args.weights) {
        (Partitioner::Paper, None | Some(Weights::Unit)) => Weights::Unit,
        (Partitioner::Paper, Some(_)) => return Err(Error::input(why)),
        (_, weights) => weights.unwrap_or_default(),
    };
    let case_name = is_case_file(args).then(|| args.input().display().to_string());
    let [words, tree] = [Files::Words, Files::Htg].map(|files| args.write.contains(&files));
    Ok(Options {
        division: Division { partitioner: args.partitioner, weights, level_base: args.level_base },
        ungraded: args.ungraded,
        out: args.out.clone().map(|directory| Output { directory, words, tree }),
        check: args.check,
        strict: args.strict,
        time_alone: args.time_alone,
        case_name: case_name.unwrap_or_else(|| "CASE".to_owned()),
    })
}

fn is_case_file(args: &Args) -> bool {
    args.input().extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// The case that the command line describes; a case file is read on rank 0. Collective.
///
/// # Errors
/// The same on all ranks.
pub fn case(args: &Args, comm: &dyn Comm) -> Result<Case, Error> {
    let input = args.input().display();
    if is_case_file(args) {
        if args.keys.is_some() {
            return Err(Error::input(format!(
                "{input} is a case file: set the spacing, layers, sides, root, boxes and seeds there, not on the command line"
            )));
        }
        let text = (comm.rank() == 0).then(|| case_file::read_text(args.input())).transpose();
        let of_first = |text: Option<String>| text_of_first(comm, &text.unwrap_or_default());
        let text = uncounted(comm, || agree(comm, text).map(of_first))?;
        return case_file::parse(&text, args.input());
    }
    let case = args.keys.clone().and_then(|k| k.case_of(Source::Stl(args.input().to_owned())));
    let why = "is read as an STL file: give --spacing-min, or a case file (.toml)";
    case.ok_or_else(|| Error::input(format!("{input} {why}")))
}
