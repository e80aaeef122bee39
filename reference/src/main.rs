//! The program `reference`: meshes a case by the paper's serial algorithm.
use clap::Parser;
use files::{Heap, interrupt};
use reference::write::{self, AmbiguousCount, Which};
use reference::{Error, Geometry, Leak, Mesh, base_tree, case_file, leaves, mesh};
use serde::Serialize;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[global_allocator]
static HEAP: Heap = Heap {
    program: "error",
    advice: "choose a larger spacing, or use a machine with more memory",
    end: std::process::exit,
};

/// The exit code of output that cannot be written.
const EXIT_OUTPUT: u8 = 4;

/// Mesh a case by the paper's serial algorithm: simple, exact and slow
///
/// Exit codes: 0 success, 2 unusable input, 4 output could not be written, 70 a bug, 71 a mesh that does not fit into memory, 130 interrupted.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Case file
    #[arg(value_name = "CASE.toml")]
    case: PathBuf,
    /// Write the leaf set to this directory, which must be empty or not exist
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Stop after the base tree: all leaves with their sides, before deletion and gradation
    #[arg(long)]
    ungraded: bool,
    /// Write a JSON record of the run to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The record of a run.
#[derive(Serialize)]
struct Run {
    schema: &'static str,
    program: &'static str,
    tree: Which,
    ranks: u32,
    facets: u64,
    geometry: Geometry,
    leaks: Vec<Leak>,
    cells: u64,
    cells_by_level: [u64; 20],
    components_ambiguous: AmbiguousCount,
    digest: String,
    time_wall_s: f64,
    /// One number, for the only rank; empty if the operating system does not report it.
    peak_rss_bytes: Vec<u64>,
}

fn main() -> ExitCode {
    // Without handlers, signals end the process the default way.
    let _ = interrupt::install("error: interrupted\n", Duration::ZERO);
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(e) => {
            return ExitCode::from(match e.print() {
                Err(e) if e.kind() != ErrorKind::BrokenPipe => EXIT_OUTPUT,
                // A closed pipe is no reason to fail.
                _ => e.exit_code() as u8,
            });
        }
    };
    match std::panic::catch_unwind(|| run(&arguments)) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(error)) => {
            // The exit code remains if the standard error is full.
            let _ = complain(&format_args!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
        // The panic handler has already printed the message.
        Err(_) => ExitCode::from(files::BUG as u8),
    }
}

fn run(arguments: &Arguments) -> Result<(), Error> {
    let start = Instant::now();
    // Meshing may take an hour: refuse an unusable directory before it starts.
    files::register_input(&arguments.case)
        .map_err(|source| Error::Read { path: arguments.case.clone(), source })?;
    for path in [&arguments.out, &arguments.json].into_iter().flatten() {
        files::name_output(path).map_err(|source| Error::Write { path: path.clone(), source })?;
    }
    if let Some(path) = &arguments.json {
        files::check_writable(path)
            .map_err(|source| Error::Write { path: path.clone(), source })?;
    }
    let claim = arguments.out.as_deref().map(write::claim).transpose()?;
    interrupt::stop_at(format_args!("start"));
    let case = case_file::read(&arguments.case)?;
    let (which, mesh) = if arguments.ungraded {
        (Which::Base, base_tree(&case)?)
    } else {
        (Which::Final, mesh(&case)?)
    };
    interrupt::stop_at(format_args!("write"));
    if let Some((claim, directory)) = claim.zip(arguments.out.as_deref()) {
        write::leaf_set(claim, directory, which, &case, &mesh)?;
    }
    let tally = leaves::Tally::of(&mesh.words);
    let record = Run {
        schema: "octree-reference-run/1",
        program: write::PROGRAM,
        tree: which,
        ranks: 1,
        facets: case.facets.len() as u64,
        geometry: mesh.geometry.clone(),
        leaks: mesh.leaks.clone(),
        cells: mesh.words.len() as u64,
        cells_by_level: tally.leaves_by_level,
        components_ambiguous: AmbiguousCount::of(&mesh),
        digest: leaves::hex(tally.digest),
        time_wall_s: start.elapsed().as_secs_f64(),
        peak_rss_bytes: peak_rss_bytes().into_iter().collect(),
    };
    interrupt::stop_at(format_args!("report"));
    if let Some(path) = &arguments.json {
        write::json(path, &record)?;
    }
    print_summary(&mesh, &record)
}

fn print_summary(mesh: &Mesh, record: &Run) -> Result<(), Error> {
    if let Some(ambiguous) = &mesh.ambiguous {
        let [x, y, z] = ambiguous.example;
        complain(&format_args!(
            "warning: the rays of {} components disagree, for example at ({x}, {y}, {z}); \
             look for holes or single sheets there",
            ambiguous.components
        ))?;
    }
    if let Some(Leak { spacing_coarse, spacing_fine, point: [x, y, z], .. }) = mesh.leaks.last() {
        // At the other spacing, most of them are found again.
        let same = mesh.leaks.iter().filter(|leak| leak.spacing_coarse == *spacing_coarse).count();
        complain(&format_args!(
            "warning: {same} regions are closed at a spacing of {spacing_coarse} and open at \
             {spacing_fine}, for example the one at ({x}, {y}, {z}); look for holes there"
        ))?;
    }
    let enclosed = &mesh.components.enclosed;
    if let Some([x, y, z]) = enclosed.example {
        complain(&format_args!(
            "note: enclosed space is deleted, {} components and {} leaves, for example at \
             ({x}, {y}, {z}); `enclosed = \"keep\"` keeps it",
            enclosed.count, enclosed.leaves
        ))?;
    }
    let Run { cells, digest, time_wall_s, .. } = record;
    match writeln!(std::io::stdout(), "{cells} cells, digest {digest}, {time_wall_s:.2} s") {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(Error::Write { path: "standard output".into(), source })
        }
        // A closed pipe is no reason to fail.
        _ => Ok(()),
    }
}

/// Prints a line on the standard error.
fn complain(line: &dyn Display) -> Result<(), Error> {
    writeln!(std::io::stderr(), "{}", files::message(line))
        .map_err(|source| Error::Write { path: "standard error".into(), source })
}

/// Peak resident memory of this process; `None` if the operating system does not report it.
fn peak_rss_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kibibytes * 1024)
}
