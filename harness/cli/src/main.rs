//! The command `harness`; see `harness --help`.

#[macro_use]
mod output;

mod commands;
mod options;

use clap::Parser;
use clap::error::ErrorKind;
use commands::Arguments;
use contract::failure::{EXIT_HOLDS, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_OUTPUT, Failure};
use files::{BUG, Heap};
use run::engine::interrupt;
use std::io;
use std::panic::{catch_unwind, set_hook, take_hook};
use std::process::{ExitCode, exit};
use std::sync::Once;

#[global_allocator]
static HEAP: Heap = Heap {
    program: "harness",
    advice: "use a smaller mesh or a machine with more memory",
    end: interrupt::out_of_memory,
};

fn main() -> ExitCode {
    // Before the outputs are checked, which begins them.
    let _ = interrupt::install();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    report_a_panic_once();
    let Ok(ended) = catch_unwind(|| arguments.command.run()) else {
        interrupt::clean();
        exit(BUG);
    };
    let ended = files::clash().map_or(ended, |why| Err(Failure::input(why)));
    let code = output::finish(ended.unwrap_or_else(print_failure));
    match interrupt::requested() {
        // What other threads of an interrupted command were making.
        true => interrupt::clean(),
        false => interrupt::uninstall(),
    }
    // A command that fails because its programs were ended has been interrupted.
    let is_interrupted = code != EXIT_HOLDS && interrupt::requested();
    ExitCode::from(if is_interrupted { EXIT_INTERRUPTED } else { code })
}

/// Prints what is wrong with the command line in one sentence, or the help that it asks for.
fn refuse(error: &clap::Error) -> ExitCode {
    interrupt::uninstall();
    if error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let text = error.render().to_string();
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        // The tip is for names of files, and most are negative numbers.
        let ends = ["Usage:", "For more", "tip: to pass"];
        let is_said = |line: &&str| ends.iter().all(|end| !line.starts_with(end));
        let sentence = lines.take_while(is_said).collect::<Vec<_>>().join(" ");
        eprintln!("harness: {}; see --help", sentence.strip_prefix("error: ").unwrap_or(&sentence));
        return ExitCode::from(EXIT_INPUT);
    }
    match error.print() {
        Err(why) if why.kind() != io::ErrorKind::BrokenPipe => ExitCode::from(EXIT_OUTPUT),
        _ => ExitCode::from(if error.use_stderr() { EXIT_INPUT } else { EXIT_HOLDS }),
    }
}

/// Makes the first panic of any thread print one message. Threads that wait for that thread panic after it.
fn report_a_panic_once() {
    let report = take_hook();
    set_hook(Box::new(move |info| {
        static FIRST: Once = Once::new();
        FIRST.call_once(|| {
            report(info);
            eprintln!("harness: this is a bug: please report it with the command and its input");
        });
    }));
}

/// Prints why a command has no result; returns its exit code. After an interrupt, what else fails does so because of it: files that were
/// being made are gone.
fn print_failure(Failure { code, why }: Failure) -> u8 {
    match code == EXIT_INTERRUPTED || interrupt::requested() {
        true => interrupt::announce(),
        false => eprintln!("harness: {why}"),
    }
    code
}
