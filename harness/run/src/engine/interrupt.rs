//! Ctrl-C and SIGTERM: a flag that every loop that waits or runs programs checks.
//!
//! Invariant: a signal makes the harness return in the ordinary way, so that child processes are ended and temporary
//! directories removed by their owners.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Turns Ctrl-C, SIGTERM and SIGHUP into a request to stop. A second signal ends the harness at once.
pub fn install() {
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // If a handler cannot be installed, the signal ends the harness without cleaning up; that does not prevent
        // a run. The order matters: the shutdown is conditional on a flag that the first signal must find unset.
        let _ = flag::register_conditional_shutdown(signal, 130, Arc::clone(&REQUESTED));
        let _ = flag::register(signal, Arc::clone(&REQUESTED));
    }
}

/// Whether the user has interrupted the harness.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
