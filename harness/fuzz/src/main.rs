//! The program that `ci/fuzz` runs: libFuzzer, and the target that `FUZZ_TARGET` names.
#![no_main]

use fuzz::{Scratch, TARGETS, Target};
use libfuzzer_sys::fuzz_target;
use std::cell::RefCell;

fn target() -> Target {
    let name = std::env::var("FUZZ_TARGET").unwrap_or_default();
    Target::named(&name).unwrap_or_else(|| {
        let known = TARGETS.map(|target| target.name).join(", ");
        eprintln!("fuzz: FUZZ_TARGET is {name:?}: give one of {known}");
        std::process::exit(2)
    })
}

thread_local! {
    static STATE: RefCell<(Target, Scratch)> = RefCell::new((target(), Scratch::default()));
}

fuzz_target!(|bytes: &[u8]| {
    STATE.with_borrow_mut(|(target, scratch)| (target.run)(scratch, bytes));
});
