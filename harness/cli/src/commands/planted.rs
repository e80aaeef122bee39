//! `harness planted`: ends with a fault of the harness itself, for the tests of its exit codes.

use clap::{Args, ValueEnum};
use contract::failure::EXIT_HOLDS;
use std::hint::black_box;
use std::thread;

/// `harness planted`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The fault
    #[arg(long)]
    fault: Fault,
}

/// A fault of the harness.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Fault {
    /// A panic on the main thread.
    Panic,
    /// A panic on another thread, for which the main thread waits.
    Thread,
    /// A request for more memory than there is.
    Memory,
}

/// Lets the fault occur.
pub fn run(arguments: &Arguments) -> u8 {
    let _place = tempfile::tempdir();
    match arguments.fault {
        Fault::Panic => panic!("a fault that was asked for"),
        Fault::Thread => {
            thread::scope(|scope| _ = scope.spawn(|| panic!("a fault that was asked for")))
        }
        Fault::Memory => drop(black_box(vec![0_u8; 1 << 62])),
    }
    EXIT_HOLDS
}
