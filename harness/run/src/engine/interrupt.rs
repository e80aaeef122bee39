//! Ctrl-C and SIGTERM: remembered here, asked for by everything that waits.
//!
//! Invariant: a signal ends the harness the ordinary way, by returning, so that children are ended and
//! temporary directories removed by their owners.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Makes Ctrl-C, SIGTERM and SIGHUP a request to end. A second one, from an impatient user, ends at once.
pub fn install() {
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // Without a handler a signal ends the harness without cleaning up: worse, but no reason not to run.
        // The two run in this order, so that the first signal finds the flag down.
        let _ = flag::register_conditional_shutdown(signal, 130, Arc::clone(&REQUESTED));
        let _ = flag::register(signal, Arc::clone(&REQUESTED));
    }
}

/// Whether the user has asked to end.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
