//! Arrays as VTK stores them: in blocks, each compressed by zlib (`vtkZLibDataCompressor`).
//!
//! An array is a header of 64-bit numbers - blocks, bytes per block, bytes of the last block if it is shorter and otherwise 0,
//! and the compressed bytes of each - followed by the compressed blocks.

use flate2::{Compress, Compression, FlushCompress, Status};

/// Bytes per block before compression. Larger blocks gain nothing, because zlib looks back 32 KiB.
const BLOCK: usize = 1 << 17;
/// Level 1: higher levels take several times as long and gain a tenth.
const LEVEL: Compression = Compression::new(1);

/// Appends an array to `out`.
pub fn append(array: &[u8], out: &mut Vec<u8>) {
    let blocks = array.len().div_ceil(BLOCK);
    let mut numbers = vec![blocks, BLOCK, array.len() % BLOCK];
    let header = out.len();
    out.resize(header + 8 * (numbers.len() + blocks), 0);
    let mut compressor = Compress::new(LEVEL, true);
    for block in array.chunks(BLOCK) {
        numbers.push(deflate(&mut compressor, block, out));
    }
    for (place, number) in out[header..].chunks_exact_mut(8).zip(numbers) {
        place.copy_from_slice(&(number as u64).to_le_bytes());
    }
}

/// Appends a block as one zlib stream; returns its length.
fn deflate(compressor: &mut Compress, block: &[u8], out: &mut Vec<u8>) -> usize {
    let start = out.len();
    compressor.reset();
    // More than zlib's bound for data that it cannot compress, so that one call suffices.
    out.reserve(block.len() + block.len() / 1000 + 128);
    let status = compressor.compress_vec(block, out, FlushCompress::Finish);
    assert!(matches!(status, Ok(Status::StreamEnd)), "{status:?} for {} bytes", block.len());
    out.len() - start
}
