//! Ctrl-C and SIGTERM: remembered here, asked for by everything that waits.
//!
//! Invariant: a signal ends the harness the ordinary way, by returning, so that children are ended and
//! temporary directories removed by their owners.

use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Makes Ctrl-C, SIGTERM and SIGHUP a request to end. A second one, from an impatient user, ends at once.
pub fn install() {
    let handler = || {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    };
    // Without a handler a signal ends the harness without cleaning up: worse, but no reason not to run.
    let _ = ctrlc::set_handler(handler);
}

/// Whether the user has asked to end.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
