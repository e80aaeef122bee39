//! Output files of all programs of this workspace. A file with its final name is complete; after an error or an interrupt, none
//! that this process has begun remains; a file that another run has made is never removed.
//!
//! - [`open`] and [`read`] open inputs; no output may be one of them, also under another name.
//! - [`Draft`] is a file, [`write_atomically`] writes one in one call. Devices, FIFOs and sockets are written through.
//! - [`Claim`] is a directory of files that become visible together, with the last of them.
//! - [`Heap`] is the allocator of a program that ends when it gets no more memory.
//! - [`interrupt::install`] makes signals remove whatever is unfinished and end the process.

#![deny(missing_docs)]

mod claim;
mod draft;
pub mod interrupt;
mod memory;
mod text;
mod unfinished;
mod uses;

pub use claim::{Claim, ClaimError};
pub use draft::{Draft, check_writable, write_atomically};
pub use memory::{Heap, OUT_OF_MEMORY, ends_with};
pub use text::{Plain, message};
pub use uses::{
    append_log, clash, name_output, open, read, read_log, read_text, register_input,
    register_output,
};

/// Exit code of a program with a bug: it panicked.
pub const BUG: i32 = 70;
