//! The program that `ci/fuzz` runs: libFuzzer, and the target that `FUZZ_TARGET` named when this file was compiled. With one target, the
//! linker leaves out most counters, which libFuzzer clears and reads for every input.
#![no_main]

use fuzz::{Scratch, Target};
use libfuzzer_sys::fuzz_target;
use std::cell::RefCell;

const TARGET: Target = Target::named(env!("FUZZ_TARGET"));

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

fuzz_target!(|bytes: &[u8]| {
    SCRATCH.with_borrow_mut(|scratch| (TARGET.run)(scratch, bytes));
});
