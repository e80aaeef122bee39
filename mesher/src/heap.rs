//! How the C library's heap treats large blocks.

/// Blocks from this size, in bytes, are their own mappings, which are given back when they are freed. A rank of a
/// large mesh keeps its sets there.
const MAPPED: i32 = 4 << 20;
/// Free bytes at the heap's end that it keeps. A rank of many has its sets in the heap, and asks for as much again
/// in every phase.
const KEPT: i32 = 64 << 20;

/// Fixes the sizes above, where the C library is glibc. By itself it learns them from what is freed: of 940 M cells on
/// one rank it then keeps a tenth of the memory for nothing, and of 64 ranks with small sets it gives back
/// what they ask for again (a page costs 2 us on a virtual machine).
pub fn fix_thresholds() {
    for (parameter, bytes) in [(libc::M_MMAP_THRESHOLD, MAPPED), (libc::M_TRIM_THRESHOLD, KEPT)] {
        // SAFETY: `mallopt` only sets a number, under the heap's own lock; any size is valid.
        unsafe { libc::mallopt(parameter, bytes) };
    }
}
