//! Fuzz targets: every reader of a file that somebody else may have written, and the mesher against the reference.
//!
//! A target is a function of some bytes. It panics if it has found a fault: programs that read a file differently, or a mesh that is not
//! that of the definition. A reader's own panic, an allocation beyond the limit of `ci/fuzz`, and an input that takes seconds are faults, too.
//! `ci/fuzz` generates inputs with libFuzzer; the inputs in `corpus` are tried by an ordinary test.

pub mod drawn;
mod repair;
mod scratch;
mod targets;

pub use scratch::Scratch;
pub use targets::TARGETS;

/// A fuzz target.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name, which is that of its file in the corpus.
    pub name: &'static str,
    /// Tries an input; returns whether it was accepted. Panics if it has found a fault.
    pub run: fn(&mut Scratch, &[u8]) -> bool,
}

impl Target {
    /// The target with a name.
    ///
    /// # Panics
    /// If there is none.
    pub const fn named(name: &str) -> Self {
        let mut at = 0;
        while !is_same(TARGETS[at].name.as_bytes(), name.as_bytes()) {
            at += 1;
        }
        TARGETS[at]
    }
}

/// Whether the bytes are the same; `==` is not constant.
const fn is_same(a: &[u8], b: &[u8]) -> bool {
    match (a, b) {
        ([], []) => true,
        ([a, rest_of_a @ ..], [b, rest_of_b @ ..]) => *a == *b && is_same(rest_of_a, rest_of_b),
        _ => false,
    }
}
