//! The program: chooses the communication between ranks, meshes, reports.

mod cli;

use cli::{Args, CommChoice, UNPRINTED, case, options, parse};
use files::{BUG, Heap, check_writable, interrupt, message, write_atomically};
use mesher::Job;
use mesher::error::{Error, agree};
use mesher::input::ingest::Source;
use mesher::output::write::write_json;
use mesher::record::Recorder;
use ranks::{Comm, STALLED, Solo, first_other, launch, sim, text_of_first, uncounted};
use std::env::args_os;
use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal, Write, stderr, stdin, stdout};
use std::iter::once;
use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::Once;
use std::thread::sleep;
use std::time::Duration;

#[global_allocator]
static HEAP: Heap = Heap {
    program: "mesher",
    advice: "choose a larger spacing (--plan estimates what fits) or use more machines",
    end: launch::abort,
};

/// Time that an interrupted rank of a job lives on. When one rank has ended, launchers kill the others at once, which must have removed
/// their files by then.
const LINGER: Duration = Duration::from_millis(300);

fn main() {
    let asked = parse(args_os());
    let comm = asked.as_ref().map_or(CommChoice::Auto, |args| args.comm);
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    fix_heap(comm);
    let message = match (launch::is_first(), stderr().is_terminal()) {
        (false, _) => "",
        (true, false) => "mesher: interrupted\n",
        // The name of the current phase is on the line.
        (true, true) => "\r\x1b[Kmesher: interrupted\n",
    };
    // Without handlers, signals end the process the default way.
    let is_parallel = launch::ranks().is_some_and(|ranks| ranks > 1);
    let _ = interrupt::install(message, if is_parallel { LINGER } else { Duration::ZERO });
    abort_on_panic();
    exit(match choose(comm) {
        #[cfg(feature = "mpi")]
        Ok(CommChoice::Mpi) => run_mpi(&asked),
        Ok(CommChoice::Sim { ranks, seed }) => sim::run(ranks, seed, |comm| obey(&asked, comm))[0],
        Ok(_) => obey(&asked, &Solo),
        Err(e) => fail(&e, launch::is_first()),
    })
}

/// Fixes parameters of the C library's heap, which glibc otherwise adapts to the blocks that are freed. Blocks above the first get mappings of
/// their own if the heap has no room for them, as most large sets on a rank of a large mesh. Mappings are returned to the system when they are
/// freed; with 940 M cells on one rank glibc would keep a tenth of the memory unused. The second is what the heap keeps at its end: with many ranks the sets are in the heap, which
/// needs as much again in every phase (a page fault takes 2 us on a virtual machine). Simulated ranks have a heap each, as ranks in processes
/// have, unless the address space is too small: in a common one, a rank searches what all ranks have freed, which is not in its caches. That took a
/// fifth of the CPU time of 1,024 ranks. Otherwise the thread that handles signals needs no heap of its own, which would take 64 MiB of address space.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn fix_heap(comm: CommChoice) {
    use libc::{M_ARENA_MAX, M_MMAP_THRESHOLD, M_TOP_PAD, M_TRIM_THRESHOLD};
    let heaps = match comm {
        // Those of the ranks, of the first thread and of that for signals; with the stack of a rank.
        CommChoice::Sim { ranks, .. } if planner::address_space_left() > 1.2e8 * ranks as f64 => {
            ranks as i32 + 2
        }
        _ => 1,
    };
    // SAFETY: `mallopt` only sets a number, under the lock of the heap; any size is valid.
    let fix = |parameter, value| unsafe { libc::mallopt(parameter, value) };
    fix(M_MMAP_THRESHOLD, 4 << 20);
    fix(M_TRIM_THRESHOLD, 64 << 20);
    fix(M_ARENA_MAX, heaps);
    if planner::address_space_left().is_finite() {
        return;
    }
    // Linux may back what the heap grows by here with huge pages, once it is used, as a page fault takes 2 us on a virtual machine. With more,
    // more of the large sets would find room in the heap in place of mappings of their own.
    const HEAP: usize = 16 << 20;
    fix(M_TOP_PAD, HEAP as i32);
    let block = Vec::<u8>::with_capacity(2 << 20);
    let start = block.as_ptr().addr().next_multiple_of(2 << 20);
    // SAFETY: advice on pages, whatever they are, changes no contents.
    unsafe { libc::madvise(start as *mut _, HEAP, libc::MADV_HUGEPAGE) };
    fix(M_TOP_PAD, 128 << 10);
}

/// Resolves `auto` by the launcher's environment.
fn choose(asked: CommChoice) -> Result<CommChoice, Error> {
    match asked {
        CommChoice::Auto if !launch::is_mpi_job() => Ok(CommChoice::Solo),
        CommChoice::Auto | CommChoice::Mpi if cfg!(feature = "mpi") => Ok(CommChoice::Mpi),
        CommChoice::Auto | CommChoice::Mpi if launch::ranks() == Some(1) => Ok(CommChoice::Solo),
        CommChoice::Auto | CommChoice::Mpi => Err(Error::input(
            "this mesher was built without MPI: build it with --features mpi, or run it without mpirun",
        )),
        _ if launch::ranks().is_some_and(|ranks| ranks > 1) => Err(Error::input(
            "each rank of this job would mesh on its own: leave out --comm, or start the mesher without mpirun",
        )),
        _ => Ok(asked),
    }
}

#[cfg(feature = "mpi")]
fn run_mpi(asked: &Result<Args, Error>) -> i32 {
    /// Address space that a rank must have left, in bytes: with less, MPI libraries crash or hang while they start.
    const ADDRESS_SPACE_MPI: f64 = 384e6;
    let left = planner::address_space_left();
    if left < ADDRESS_SPACE_MPI {
        let e = Error::memory(format!(
            "the limit on its address space or data leaves a rank {:.0} MB of memory, too little for MPI: raise it (ulimit -v, -d) by {:.0} MB",
            left / 1e6,
            (ADDRESS_SPACE_MPI - left) / 1e6
        ));
        // The launcher ends all ranks with the first one: rank 0 speaks for those that have the same limit, and has this time to do so.
        if !launch::is_first() {
            sleep(Duration::from_secs(10));
        }
        return fail(&e, true);
    }
    let comm = launch::join();
    match launch::check_size(&*comm) {
        Ok(()) => obey(asked, &*comm),
        Err(e) => fail(&Error::input(e), launch::is_first()),
    }
}

/// Makes a panic on any thread end the whole job, with one notice per process: one that unwinds would leave the other ranks waiting forever.
/// Every rank that panics prints where.
fn abort_on_panic() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        report(info);
        static NOTICE: Once = Once::new();
        NOTICE.call_once(|| {
            complain(&"this is a bug in the mesher: please report it with the case");
        });
        interrupt::abandon(true);
        launch::abort(BUG);
    }));
}

/// Prints an error, on one rank of a job; returns the exit code.
fn fail(e: &Error, prints: bool) -> i32 {
    if prints {
        complain(&format_args!("mesher: {e}"));
    }
    e.exit_code
}

/// Prints a line on the standard error; returns whether that was possible.
fn complain(line: &dyn Display) -> bool {
    // A launcher puts lines of its own between two writes.
    stderr().write_all(format!("{}\n", message(line)).as_bytes()).is_ok()
}

/// What a run prints.
struct Done {
    text: String,
    warnings: Vec<String>,
    /// Why the planned mesh would not be made.
    refusal: Option<Error>,
}

/// Prints warnings and the outcome; returns the exit code.
fn print(done: &Done) -> i32 {
    let is_warned = done.warnings.iter().all(|w| complain(&format_args!("mesher: warning: {w}")));
    if say(&done.text) && is_warned { 0 } else { UNPRINTED }
}

/// Prints a line on the standard output; returns whether that was possible. A closed pipe is no reason to fail.
fn say(line: &dyn Display) -> bool {
    let printed = writeln!(stdout(), "{line}").and_then(|()| stdout().flush());
    let failed = printed.err().filter(|e| e.kind() != ErrorKind::BrokenPipe);
    let why = |e| complain(&format_args!("mesher: standard output: {e}: free disk space"));
    failed.map(why).is_none()
}

/// The command line of rank 0, which all ranks follow. Collective.
fn of_first(asked: &Result<Args, Error>, comm: &dyn Comm) -> Result<Args, Error> {
    if let Some(rank) = first_other(comm, &env!("VERSION")) {
        return Err(Error::input(format!(
            "rank {rank} is another version of the mesher than rank 0: start the same program on all ranks"
        )));
    }
    let words: Vec<_> = args_os().map(|w| w.to_string_lossy().into_owned()).collect();
    let mine = words.join("\0");
    let first = text_of_first(comm, &mine);
    if first == mine { asked.clone() } else { parse(first.split('\0')) }
}

/// Does what the command line asks for, on one rank; returns the exit code, the same on all ranks. Collective.
fn obey(asked: &Result<Args, Error>, comm: &dyn Comm) -> i32 {
    match uncounted(comm, || of_first(asked, comm)) {
        Ok(args) if args.serve => serve(comm),
        Ok(args) => run(&args, comm),
        Err(e) => {
            interrupt::decide(true);
            fail(&e, comm.rank() == 0)
        }
    }
}

/// Runs the command lines that rank 0 reads from its standard input; returns the exit code of this service: on rank 0, that of output that
/// cannot be written if an answer was not. Collective.
fn serve(comm: &dyn Comm) -> i32 {
    let (mut lines, is_first, mut code_of_job) = (stdin().lines(), comm.rank() == 0, 0);
    loop {
        interrupt::begin();
        // A line that is not UTF-8 is refused like others that are no JSON. Without a line feed, it is the end, or why nothing can be read.
        let text = |line: io::Result<String>| match line {
            Err(e) if e.kind() != ErrorKind::InvalidData => format!("standard input: {e}"),
            line => line.unwrap_or_default() + "\n",
        };
        let line = is_first.then(|| lines.next()).flatten().map_or(String::new(), text);
        comm.next_run();
        let line = uncounted(comm, || text_of_first(comm, &line));
        let Some(line) = line.strip_suffix('\n') else {
            return if line.is_empty() { code_of_job } else { fail(&Error::input(line), is_first) };
        };
        // The peak of this run alone; where that is impossible, it includes those before it.
        let _ = std::fs::write("/proc/self/clear_refs", "5");
        let code = served(line).map_or_else(|e| fail(&e, is_first), |args| run(&args, comm));
        if is_first && !say(&code) {
            code_of_job = UNPRINTED;
        }
    }
}

/// The run that a line of a service asks for.
fn served(line: &str) -> Result<Args, Error> {
    let words: Vec<String> = serde_json::from_str(line)
        .map_err(|e| Error::input(format!("`{line}` is no JSON array of words: {e}")))?;
    // These would end the service.
    let prints = |w: &String| {
        let is_short = w.starts_with('-') && !["--", "-o"].iter().any(|of| w.starts_with(of));
        is_short && w.contains(['h', 'V']) || ["--help", "--version"].contains(&w.as_str())
    };
    if !words.iter().any(prints) {
        let mut args = parse(once("mesher".to_owned()).chain(words))?;
        args.quiet = true;
        let is_of_job = matches!(args.comm, CommChoice::Auto | CommChoice::Mpi);
        if is_of_job && !args.serve && args.stall_limit.is_none() {
            return Ok(args);
        }
    }
    Err(Error::input(
        "a run of a service has no --help, --version, --serve or --stall-limit, and no --comm but that of the job",
    ))
}

/// One rank's run; returns the exit code, the same on all ranks. Collective.
fn run(args: &Args, comm: &dyn Comm) -> i32 {
    let first = comm.rank() == 0;
    if let Some(limit) = args.stall_limit {
        comm.limit_calls(limit);
    }
    let prints = first && !args.quiet;
    let mut record = Recorder::default();
    record.progress = prints && stderr().is_terminal();
    let result = work(args, comm, &mut record);
    // Launchers send a signal to the other ranks when the first one ends with an error.
    interrupt::decide(true);
    if let Some(limit) = args.stall_limit {
        comm.enter("done");
        interrupt::stop_at(format_args!("done:{}", comm.rank()));
        // A barrier.
        comm.sum(0);
        end_within(limit);
    }
    interrupt::stop_at(format_args!("end:{}", comm.rank()));
    if record.progress {
        let _ = write!(stderr(), "\r\x1b[K");
    }
    match result.map(|done| (if prints { print(&done) } else { 0 }, done.refusal)) {
        Err(e) | Ok((0, Some(e))) => fail(&e, first),
        Ok((code, _)) => code,
    }
}

/// Ends the process if it has not ended within the limit: MPI's own end waits for all ranks, without limit.
fn end_within(limit: Duration) {
    let end = move || {
        sleep(limit);
        complain(&format_args!(
            "mesher: the run is complete, but another rank has not ended for {} s: look at it with a debugger",
            limit.as_secs_f64()
        ));
        // What the process runs at its exit may wait for that rank as well.
        interrupt::exit_at_once(STALLED);
    };
    let _ = std::thread::Builder::new().spawn(end);
}

/// Finds out that two options name one output, or one in the directory of another.
fn named_apart(args: &Args) -> Result<(), Error> {
    let name = |path: &PathBuf| files::name_output(path).map_err(|e| Error::input(e).at(path));
    [&args.out, &args.json, &args.status].into_iter().flatten().try_for_each(name)
}

const WRITABLE: &str = "a report is JSON";

fn work(args: &Args, comm: &dyn Comm, record: &mut Recorder) -> Result<Done, Error> {
    // Checked before meshing, so that a path that cannot be written to ends the run at once.
    let json = args.json.as_deref().filter(|_| comm.rank() == 0);
    let on_json = |advice: &str, write: &dyn Fn(&Path) -> io::Result<()>| {
        let Some(path) = json else { return Ok(()) };
        write(path).map_err(|e| Error::output(format!("{e}: {advice}")).at(path))
    };
    let apart = if comm.rank() == 0 { named_apart(args) } else { Ok(()) };
    agree(comm, apart.and_then(|()| on_json("choose another --json", &check_writable)))?;
    let case = case(args, comm)?;
    // No output may be the geometry.
    if let Source::Stl(path) = &case.source {
        agree(comm, files::register_input(path).map_err(|e| Error::input(e).at(path)))?;
    }
    if let Some(dir) = &args.status {
        // Not before the inputs are known, which these files must not replace.
        let path = dir.join(format!("rank-{:05}.txt", comm.rank()));
        let begin = std::fs::create_dir_all(dir).and_then(|()| record.keep_status(path));
        let named = |e: io::Error| match e.kind() {
            ErrorKind::InvalidInput => Error::input(e).at(dir),
            _ => Error::output(format!("{e}: choose another --status")).at(dir),
        };
        agree(comm, begin.map_err(named))?;
    }
    let options = options(args)?;
    let job = &mut Job::new(&options, comm, record);
    let mut bytes = Vec::new();
    let done = if args.plan {
        let plan = planner::plan(&case, job)?;
        let refusal = (!plan.fits && !args.force).then(|| plan.refusal());
        json.map_or(Ok(()), |_| write_json(&mut bytes, &plan)).expect(WRITABLE);
        Done { text: plan.to_string(), warnings: Vec::new(), refusal }
    } else {
        let report = planner::mesh(&case, args.force, job)?;
        json.map_or(Ok(()), |_| write_json(&mut bytes, &report)).expect(WRITABLE);
        Done { text: report.to_string(), warnings: report.warnings, refusal: None }
    };
    let is_made = options.out.is_some() && !args.plan;
    let made = if is_made { "the mesh is complete, only its report is missing; " } else { "" };
    let advice = format!("{made}choose another --json or free disk space");
    interrupt::stop_at(format_args!("report:{}", comm.rank()));
    let write = |path: &Path| write_atomically(path, |out| out.write_all(&bytes));
    agree(comm, on_json(&advice, &write))?;
    record.report_status("done");
    Ok(done)
}
