//! The mesher's command line. Only this file prints.

#![deny(missing_docs)]

use clap::Parser;
use mesher::base::Division;
use mesher::case::{BoxSpec, Case, LAYER_CELLS_MIN, ROOT_SCALE, RootSpec};
use mesher::comm::{Comm, Solo, sim};
use mesher::error::Error;
use mesher::ingest::Source;
use mesher::lattice::{Keep, Root};
use mesher::partition::{Partitioner, Weights};
use mesher::record::{INTERRUPTED, Recorder};
use mesher::report::Report;
use mesher::{Options, mesh};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::atomic::Ordering;

/// Exit code of a bug.
const BUG: i32 = 70;

/// Makes an off-body hexahedral oct-tree mesh around a geometry.
///
/// Serial as it is; `mpirun -n 8 mesher ...` is all that parallel takes. Exit codes: 0 done, 2 unusable
/// input, 4 output not written, 70 a bug, 130 interrupted.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// A case file (.toml), or an STL file together with --spacing-min
    input: PathBuf,
    /// Directory to write the leaf set to; absent or empty. Without it nothing is written
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the report as JSON to this file, too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Stop at the base tree T0: all leaves with their sides, nothing deleted or graded
    #[arg(long)]
    ungraded: bool,
    /// Who cuts the base tree into parts [default: metis where built in, else morton]
    #[arg(long, value_enum)]
    partitioner: Option<Partitioner>,
    /// What a base leaf weighs in the partition
    #[arg(long, value_enum, default_value = "area")]
    weights: Weights,
    /// Level at which the tree is cut into base leaves: a number, or auto
    #[arg(long, default_value = "auto", value_parser = level_base)]
    level_base: LevelBase,
    /// How ranks talk: auto, solo, mpi, or sim:RANKS[:SEED] (ranks simulated in this process)
    #[arg(long, default_value = "auto", value_parser = comm_choice)]
    comm: CommChoice,
    /// Each rank keeps DIR/rank-00000.txt with the phase that it is in
    #[arg(long, value_name = "DIR")]
    status: Option<PathBuf>,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
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

#[derive(Clone, Copy)]
struct LevelBase(Option<u32>);

#[derive(Clone, Copy)]
enum CommChoice {
    Auto,
    Solo,
    Mpi,
    Sim { ranks: usize, seed: u64 },
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
fn parse() -> Result<Args, Error> {
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

fn main() {
    let args = parse();
    // Failing to install the handler only means that interrupts end the process the default way.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            exit(130);
        }
    });
    match choose(args.as_ref().map_or(CommChoice::Auto, |a| a.comm)) {
        Ok(CommChoice::Mpi) => run_mpi(&args),
        Ok(CommChoice::Sim { ranks, seed }) => {
            abort_on_panic(|| exit(BUG));
            let codes = sim::run(ranks, seed, |comm| run(&args, comm));
            exit(codes.into_iter().max().unwrap_or(0));
        }
        Ok(_) => {
            abort_on_panic(|| exit(BUG));
            exit(run(&args, &Solo));
        }
        Err(e) => exit(fail(&e)),
    }
}

/// Number of ranks that an MPI launcher has started, if one has.
fn launched() -> Option<usize> {
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_SIZE", "MPI_LOCALNRANKS"]
        .iter()
        .find_map(|v| std::env::var(v).ok()?.parse().ok())
}

fn choose(asked: CommChoice) -> Result<CommChoice, Error> {
    let wants_mpi = match asked {
        CommChoice::Auto => {
            launched().is_some()
                || std::env::var("SLURM_PROCID").is_ok() && std::env::var("PMIX_RANK").is_ok()
        }
        CommChoice::Mpi => true,
        _ => return Ok(asked),
    };
    if !wants_mpi {
        return Ok(CommChoice::Solo);
    }
    if cfg!(feature = "mpi") {
        return Ok(CommChoice::Mpi);
    }
    match launched() {
        Some(1) => Ok(CommChoice::Solo),
        _ => Err(Error::input(
            "this mesher was built without MPI: build it with --features mpi, or run it without mpirun",
        )),
    }
}

#[cfg(feature = "mpi")]
fn run_mpi(args: &Result<Args, Error>) {
    let comm = mesher::comm::mpi::Mpi::start();
    // A panic that unwinds would leave the other ranks waiting for ever.
    abort_on_panic(|| mesher::comm::mpi::abort(BUG));
    let code = run(args, &comm);
    // All ranks have the same code, as errors are agreed on.
    drop(comm);
    exit(code);
}

#[cfg(not(feature = "mpi"))]
fn run_mpi(_: &Result<Args, Error>) {
    unreachable!("MPI is chosen only where it is built in");
}

/// Makes a panic on any thread end the whole run.
fn abort_on_panic(end: fn() -> !) {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        report(info);
        eprintln!("this is a bug in the mesher: please report it with the case");
        end();
    }));
}

fn fail(e: &Error) -> i32 {
    eprintln!("mesher: {e}");
    e.exit_code()
}

/// One rank's run; returns the exit code, the same on all ranks.
fn run(args: &Result<Args, Error>, comm: &dyn Comm) -> i32 {
    let first = comm.rank() == 0;
    let args = match args {
        Ok(args) => args,
        Err(e) if first => return fail(e),
        Err(e) => return e.exit_code(),
    };
    let status = args.status.as_ref().map(|dir| dir.join(format!("rank-{:05}.txt", comm.rank())));
    let progress = first && !args.quiet && std::io::stderr().is_terminal();
    let mut record = Recorder::new(status, progress);
    record.tell("start");
    let result = work(args, comm, &mut record);
    record.tell("done");
    if progress {
        eprint!("\r\x1b[K");
    }
    match result {
        Ok(report) => {
            if first && !args.quiet {
                // A reader that went away is no reason to fail.
                let _ = writeln!(std::io::stdout(), "{report}");
            }
            0
        }
        Err(e) if first => fail(&e),
        Err(e) => e.exit_code(),
    }
}

fn work(args: &Args, comm: &dyn Comm, record: &mut Recorder) -> Result<Report, Error> {
    if let Some(dir) = &args.status {
        comm.agree(std::fs::create_dir_all(dir).map_err(|e| {
            Error::output(format!("{}: {e}: choose another --status", dir.display()))
        }))?;
    }
    // A place that cannot be written is found out now rather than after the meshing.
    let json = args.json.as_ref().filter(|_| comm.rank() == 0).map(|p| Json::begin(p)).transpose();
    let json = mesher::comm::agree(comm, json)?;
    let case = mesher::comm::agree(comm, case(args))?;
    let partitioner = args.partitioner.unwrap_or(if cfg!(feature = "metis") {
        Partitioner::Metis
    } else {
        Partitioner::Morton
    });
    let options = Options {
        division: Division { partitioner, weights: args.weights, level_base: args.level_base.0 },
        ungraded: args.ungraded,
        out: args.out.clone(),
    };
    let report = mesh(&case, &options, comm, record)?;
    comm.agree(json.map_or(Ok(()), |json| json.finish(&report)))?;
    Ok(report)
}

fn case(args: &Args) -> Result<Case, Error> {
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

/// The report's JSON file: written beside its place, and put there when it is complete.
struct Json {
    path: PathBuf,
    file: tempfile::NamedTempFile,
}

impl Json {
    fn begin(path: &Path) -> Result<Self, Error> {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let begin = || {
            if path.is_dir() {
                return Err(std::io::ErrorKind::IsADirectory.into());
            }
            // Readable by whom the user's other files are.
            let permissions = std::os::unix::fs::PermissionsExt::from_mode(0o666);
            tempfile::Builder::new().permissions(permissions).tempfile_in(folder)
        };
        let file = begin().map_err(|e| Self::fail(path, &e))?;
        Ok(Self { path: path.to_owned(), file })
    }

    fn finish(mut self, report: &Report) -> Result<(), Error> {
        let mut write = || -> std::io::Result<()> {
            serde_json::to_writer_pretty(&mut self.file, report)?;
            self.file.write_all(b"\n")?;
            self.file.as_file().sync_all()
        };
        write().map_err(|e| Self::fail(&self.path, &e))?;
        self.file.persist(&self.path).map_err(|e| Self::fail(&self.path, &e.error))?;
        Ok(())
    }

    fn fail(path: &Path, e: &std::io::Error) -> Error {
        Error::output(format!("{}: {e}: choose another --json", path.display()))
    }
}
