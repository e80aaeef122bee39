//! Thresholds of the C library's heap.

/// Blocks of at least this size, in bytes, get mappings of their own, which are returned to the system when freed. On a rank of a
/// large mesh, all large sets are such blocks.
const MAPPED: i32 = 4 << 20;
/// Free bytes that the heap keeps at its end. With many ranks the sets are in the heap, which needs as much again in every
/// phase.
const KEPT: i32 = 64 << 20;

/// Fixes these thresholds, which glibc otherwise adapts to the blocks that are freed. With 940 M cells on one rank it would keep a
/// tenth of the memory unused; with 64 ranks and small sets it would return memory that the next phase requests again (a page fault
/// takes 2 us on a virtual machine).
pub fn fix_thresholds() {
    for (parameter, bytes) in [(libc::M_MMAP_THRESHOLD, MAPPED), (libc::M_TRIM_THRESHOLD, KEPT)] {
        // SAFETY: `mallopt` only sets a number, under the lock of the heap; any size is valid.
        unsafe { libc::mallopt(parameter, bytes) };
    }
}
