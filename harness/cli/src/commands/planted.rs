//! `harness planted`: ends with a fault of the harness itself, for the tests of its exit codes.

use clap::Args;
use contract::failure::EXIT_HOLDS;
use std::hint::black_box;
use std::thread;

/// `harness planted`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The fault: a `panic` on the main thread, a panic on another `thread` for which it waits, or a request for too much `memory`
    #[arg(long)]
    fault: String,
}

/// Lets the fault occur.
pub fn run(arguments: &Arguments) -> u8 {
    let _place = tempfile::tempdir();
    let fault = || panic!("a fault that was asked for");
    match &*arguments.fault {
        "memory" => drop(black_box(vec![0_u8; 1 << 62])),
        "thread" => thread::scope(|scope| _ = scope.spawn(fault)),
        _ => fault(),
    }
    EXIT_HOLDS
}
