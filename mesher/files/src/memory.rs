//! The end of a program that gets no more memory: one sentence, exit code 71, and no unfinished files.
//!
//! The standard library ends such a process with SIGABRT, and its hook for that is not stable. A global allocator is.

use crate::interrupt;
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{Cursor, Write, stderr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

/// Exit code of a program that ran out of memory, or whose work does not fit into it.
pub const OUT_OF_MEMORY: i32 = 71;

/// The system's allocator, as the global one of a program. It ends the program when the system has no more memory.
pub struct Heap {
    /// The program's name.
    pub program: &'static str,
    /// What the user can do.
    pub advice: &'static str,
    /// Ends the program with an exit code.
    pub end: fn(i32) -> !,
}

// SAFETY: all calls go to the system's allocator with the caller's arguments, and so do its results, except that null ends the process.
unsafe impl GlobalAlloc for Heap {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        self.obtained(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        self.obtained(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        self.obtained(unsafe { System.realloc(block, layout, size) }, size)
    }

    #[inline]
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, layout) }
    }
}

impl Heap {
    #[inline]
    fn obtained(&self, block: *mut u8, bytes: usize) -> *mut u8 {
        if block.is_null() {
            self.end(bytes);
        }
        block
    }

    /// Ends the program. Nothing in here allocates, unless a library does.
    #[cold]
    fn end(&self, bytes: usize) -> ! {
        static IS_ENDING: AtomicBool = AtomicBool::new(false);
        while IS_ENDING.swap(true, Ordering::AcqRel) {
            // The thread that came first ends the process.
            sleep(Duration::from_secs(1));
        }
        interrupt::abandon(true);
        // The exit code remains if the standard error is full. A launcher puts lines of its own between two writes.
        let mut line = Cursor::new([0; 256]);
        let Self { program, advice, .. } = self;
        let _ =
            writeln!(line, "{program}: memory ran out at a request for {bytes} bytes: {advice}");
        let _ = stderr().write_all(&line.get_ref()[..line.position() as usize]);
        (self.end)(OUT_OF_MEMORY)
    }
}
