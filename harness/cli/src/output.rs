//! Printing that never panics, and shows control characters of other programs as signs. The macros here replace those of the standard library in the whole program: a closed pipe, as in
//! `harness ... | head`, ends the printing and not the command, and a full disk becomes an exit code.

use contract::failure::{EXIT_HOLDS, EXIT_OUTPUT};
use files::{message, plain};
use run::engine::interrupt;
use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write, stderr, stdout};
use std::sync::OnceLock;

/// The first error of standard output, except that of a closed pipe.
static FAILURE: OnceLock<io::Error> = OnceLock::new();

macro_rules! print {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

macro_rules! println {
    ($($text:tt)*) => { $crate::output::write(format_args!("{}\n", format_args!($($text)*))) };
}

macro_rules! eprintln {
    ($($text:tt)*) => { $crate::output::write_error(format_args!($($text)*)) };
}

/// Writes to standard output, unless an input could not be read because it is an output: then no answer is true.
pub fn write(text: Arguments) {
    if files::clash().is_some() {
        return;
    }
    note(stdout().lock().write_all(plain(&text).as_bytes()));
}

/// Writes a message to standard error, at most a screen. If that fails, there is no place left to report it.
pub fn write_error(text: Arguments) {
    match message(&text).to_string() {
        text if text == "harness: interrupted" => interrupt::announce(),
        text => _ = writeln!(stderr().lock(), "{text}"),
    }
}

fn note(written: io::Result<()>) {
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = FAILURE.set(error);
    }
}

/// The exit code of a command that returned `code`: [`EXIT_OUTPUT`] if the command succeeded, but its output was lost.
pub fn finish(code: u8) -> u8 {
    note(stdout().flush());
    match FAILURE.get() {
        Some(error) => {
            eprintln!("harness: standard output cannot be written: {error}");
            if code == EXIT_HOLDS { EXIT_OUTPUT } else { code }
        }
        None => code,
    }
}
