//! Reader of the files that [`TreeWriter`](crate::tree::TreeWriter) makes, and of no others.
//!
//! The shape of the tree and the places of its chunks are looked up where the writer puts them, without further checks. Then the metadata
//! that the writer would make of them must be those of the file, byte by byte, their checksums included. No memory is allocated for a
//! count before the file has been seen to be long enough for it.

use crate::format::{Chunked, ReadError, SIGNATURE, SUPERBLOCK_BYTES, TABLE_HEAD_BYTES, UNDEFINED};
use crate::tree::{
    CELL_DATA, COORDINATES, EDGE, FIRST, GROUP, MASK, NODES, SIDE, SPLIT, Shape, arrays, metadata,
};
use crate::write::{Value, attribute, link};
use flate2::{Decompress, FlushDecompress, Status};
use std::fs;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::Path;

type Result<T> = std::result::Result<T, ReadError>;

/// Bytes of an object header before its messages.
const HEADER_BYTES: u64 = 10;
/// Bytes of the filters, the last message in the header of an array of chunks.
const FILTERS_BYTES: usize = 16;
/// Bytes of a table of chunks before its entries.
const TABLE_BYTES: u64 = 14;

fn unknown(what: &str) -> ReadError {
    ReadError::Unknown(what.to_owned())
}

/// A file whose metadata were read.
#[derive(Debug)]
pub struct TreeReader {
    source: Source,
    /// The root and the nodes.
    pub shape: Shape,
    /// The bits of split nodes, those of leaves that are not in the mesh, and the sides of all nodes.
    pub arrays: [Chunked; 3],
}

impl TreeReader {
    /// Opens a file and reads its metadata.
    ///
    /// # Errors
    /// If the file cannot be read, or is another one than the writer makes.
    pub fn open(path: &Path) -> Result<Self> {
        let file = files::open(path)?;
        let source = Source { bytes: file.metadata()?.len(), file };
        let head = source.bytes_at(0, source.bytes.min(SUPERBLOCK_BYTES as u64))?;
        if !head.starts_with(&SIGNATURE) || head.get(8).is_some_and(|&version| version != 3) {
            return Err(unknown("it does not begin with a superblock of HDF5 1.10"));
        }
        if head.len() < SUPERBLOCK_BYTES {
            return Err(ReadError::Damaged("its superblock is incomplete".to_owned()));
        }
        let (end, root) = (number(&head[28..36]), number(&head[36..44]));
        if end != source.bytes {
            let found = source.bytes;
            return Err(ReadError::Damaged(format!("it has {found} bytes instead of {end}")));
        }
        let (shape, arrays, start) = source.tree(root)?;
        let found = (source.bytes_at(start, end.saturating_sub(start))?, head);
        if metadata(&shape, &arrays, start) != found {
            let is_ours = found.0.windows(EDGE.len()).any(|bytes| bytes == EDGE.as_bytes());
            let error = if is_ours { ReadError::Damaged } else { ReadError::Unknown };
            return Err(error("its metadata are not those of its tree".to_owned()));
        }
        Ok(Self { source, shape, arrays })
    }

    /// The bytes of a chunk, as many as every chunk has.
    ///
    /// # Errors
    /// If the chunk is damaged.
    pub fn read_chunk(&self, array: &Chunked, index: usize, into: &mut Vec<u8>) -> Result<()> {
        into.clear();
        into.resize(array.chunk_len as usize, 0);
        let Some(Range { start: address, end }) = array.chunks[index] else { return Ok(()) };
        let bytes = end - address;
        let stored = self.source.bytes_at(address, bytes)?;
        let mut inflater = Decompress::new(true);
        let status = inflater.decompress(&stored, into, FlushDecompress::Finish);
        let is_whole = matches!(status, Ok(Status::StreamEnd))
            && inflater.total_in() == bytes
            && inflater.total_out() == into.len() as u64;
        let why = || ReadError::Damaged(format!("the chunk at byte {address}"));
        if is_whole { Ok(()) } else { Err(why()) }
    }
}

/// The bytes of a file.
#[derive(Debug)]
struct Source {
    file: fs::File,
    bytes: u64,
}

impl Source {
    fn bytes_at(&self, address: u64, bytes: u64) -> Result<Vec<u8>> {
        if address.checked_add(bytes).is_none_or(|end| end > self.bytes) {
            let end = address.saturating_add(bytes);
            return Err(ReadError::Damaged(format!("it ends before byte {end}")));
        }
        let mut block = vec![0; bytes as usize];
        self.file.read_exact_at(&mut block, address)?;
        Ok(block)
    }

    /// The tree below the root group: its shape, its arrays, and where the metadata begin.
    fn tree(&self, root: u64) -> Result<(Shape, [Chunked; 3], u64)> {
        let member = |header: &[u8], name: &str| last_number(header, &link(name, 0));
        let missing = || unknown("it has no tree");
        let grid = self.header(member(&self.header(root)?, GROUP).ok_or_else(missing)?)?;
        let of_grid = |name: &str| member(&grid, name).ok_or_else(missing);
        let nodes = self.numbers(of_grid(NODES)?)?;
        let mut origin = [0.0; 3];
        for (low, name) in origin.iter_mut().zip(COORDINATES) {
            *low = f64::from_bits(*self.numbers(of_grid(name)?)?.first().ok_or_else(missing)?);
        }
        let edge = last_number(&grid, &attribute(EDGE, &Value::doubles(&[0.0])));
        let shape = Shape { origin, edge: f64::from_bits(edge.ok_or_else(missing)?), nodes };
        if !shape.is_tree() {
            return Err(unknown("its nodes are not those of an oct-tree"));
        }
        // Each window has an entry in a table.
        if shape.windows().saturating_mul(12) > self.bytes {
            return Err(missing());
        }
        let mut arrays = arrays(&shape);
        let data = self.header(of_grid(CELL_DATA)?)?;
        let places = [Some(of_grid(SPLIT)?), member(&grid, MASK), member(&data, SIDE)];
        for (array, address) in arrays.iter_mut().zip(places) {
            address.map_or(Ok(()), |address| self.fill(array, address))?;
        }
        Ok((shape, arrays, of_grid(FIRST)?))
    }

    /// The messages of the object header at an address.
    fn header(&self, address: u64) -> Result<Vec<u8>> {
        let head = self.bytes_at(address, HEADER_BYTES)?;
        self.bytes_at(address + HEADER_BYTES, number(&head[6..]))
    }

    /// The numbers of a small array, as bits: after its type and what else describes it.
    fn numbers(&self, address: u64) -> Result<Vec<u64>> {
        let head = self.header(address)?;
        let len = head.get(8..16).map(number).and_then(|n| usize::try_from(n).ok()?.checked_mul(8));
        let begin = len.and_then(|bytes| head.len().checked_sub(bytes));
        let begin = begin.ok_or_else(|| unknown("an array is shorter than it states"))?;
        Ok(head[begin..].chunks_exact(8).map(number).collect())
    }

    /// Sets the places of an array's chunks.
    fn fill(&self, array: &mut Chunked, address: u64) -> Result<()> {
        // The layout ends with the address of the table's header.
        let header = self.header(address)?;
        let layout = header.len().checked_sub(FILTERS_BYTES).map(|end| &header[..end]);
        let table = layout.and_then(|layout| layout.last_chunk::<8>()).map(|at| number(at));
        let table = table.filter(|&table| table < self.bytes);
        let table = table.ok_or_else(|| unknown("an array has no table of chunks"))?;
        let size = 8 + array.size_bytes();
        let bytes = array.chunks.len() as u64 * (size as u64 + 4);
        let entries = self.bytes_at(table + TABLE_HEAD_BYTES + TABLE_BYTES, bytes)?;
        for (slot, entry) in array.chunks.iter_mut().zip(entries.chunks_exact(size + 4)) {
            let (address, bytes) = (number(&entry[..8]), number(&entry[8..size]));
            *slot = (address != UNDEFINED).then(|| address..address.saturating_add(bytes));
        }
        Ok(())
    }
}

/// The number at the end of a message of a header, which is otherwise like this one.
fn last_number(header: &[u8], message: &[u8]) -> Option<u64> {
    let (begin, _) = message.split_last_chunk::<8>()?;
    let at = header.windows(begin.len()).position(|bytes| bytes == begin)? + begin.len();
    header.get(at..at + 8).map(number)
}

/// The number in some bytes, little-endian.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte))
}
