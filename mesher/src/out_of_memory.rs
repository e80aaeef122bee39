//! The end of a run that gets no more memory: one sentence, exit code 71, and none of the run's files.
//!
//! The standard library ends such a process with SIGABRT. Its hook for that is not stable, but an allocator of one's own is.

use files::interrupt;
use mesher::error::OUT_OF_MEMORY;
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{Cursor, Write, stderr};
use std::process::exit;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// The system's allocator; it ends the job when the system has no more memory.
struct Checked;

#[global_allocator]
static HEAP: Checked = Checked;

/// Ends the job with an exit code.
type End = fn(i32) -> !;

static END: OnceLock<End> = OnceLock::new();

/// Sets how the job ends; without it, the process exits.
#[cfg(feature = "mpi")]
pub fn ends_with(end: End) {
    END.get_or_init(|| end);
}

// SAFETY: all calls go to the system's allocator with the caller's arguments, and so do its results, except that null ends the process.
unsafe impl GlobalAlloc for Checked {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        obtained(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        obtained(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        obtained(unsafe { System.realloc(block, layout, size) }, size)
    }

    #[inline]
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, layout) }
    }
}

#[inline]
fn obtained(block: *mut u8, bytes: usize) -> *mut u8 {
    if block.is_null() {
        end(bytes);
    }
    block
}

/// Ends the job. Nothing in here allocates, unless a library does.
#[cold]
fn end(bytes: usize) -> ! {
    static IS_ENDING: AtomicBool = AtomicBool::new(false);
    if !IS_ENDING.swap(true, Ordering::AcqRel) {
        interrupt::abandon();
        // The exit code remains if the standard error is full. A launcher puts lines of its own between two writes.
        let mut line = Cursor::new([0; 256]);
        let _ = writeln!(
            line,
            "mesher: memory ran out at a request for {bytes} bytes: choose a larger spacing (--plan estimates what fits) or use more machines"
        );
        let _ = stderr().write_all(&line.get_ref()[..line.position() as usize]);
        if let Some(end) = END.get() {
            end(OUT_OF_MEMORY);
        }
    }
    exit(OUT_OF_MEMORY)
}
