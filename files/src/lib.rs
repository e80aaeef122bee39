//! Output files of all programs of this workspace. A file with its final name is complete; after an error or an interrupt, none
//! that this process has begun remains; a file that another run has made is never removed.
//!
//! - [`Draft`] is a file, [`write_atomically`] writes one in one call. Devices, FIFOs and sockets are written through.
//! - [`Claim`] is a directory of files that become visible together, with the last of them.
//! - [`interrupt::install`] makes SIGINT, SIGTERM and SIGHUP remove whatever is unfinished and end the process.

#![deny(missing_docs)]

mod claim;
mod draft;
pub mod interrupt;
mod unfinished;

pub use claim::{Claim, ClaimError};
pub use draft::{Draft, check_writable, write_atomically};
