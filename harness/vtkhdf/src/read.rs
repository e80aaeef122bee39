//! Reader of the files that [`TreeWriter`](crate::tree::TreeWriter) makes, and of no others.
//!
//! The shape of the tree and the places of its chunks are looked up where the writer puts them, without further checks. Then the metadata
//! that the writer would make of them must be those of the file, byte by byte, their checksums included. No memory is allocated for a
//! count before the file has been seen to be long enough for it.

use crate::format::{
    Chunked, Extent, ReadError, SIGNATURE, SUPERBLOCK_BYTES, TABLE_HEAD_BYTES, UNDEFINED, message,
};
use crate::tree::{
    CELL_DATA, COORDINATES, EDGE, GROUP, MASK, NODES, RANK, SIDE, SPLIT, Shape, arrays, group,
    has_chunks,
};
use crate::write::metadata;
use flate2::{Decompress, FlushDecompress, Status};
use std::collections::HashMap;
use std::fs;
use std::os::unix::fs::FileExt;
use std::path::Path;

type Result<T> = std::result::Result<T, ReadError>;

/// Bytes of an object header before its messages.
const HEADER_BYTES: u64 = 10;
/// Bytes of a table of chunks before its entries.
const TABLE_BYTES: u64 = 14;

fn unknown(what: &str) -> ReadError {
    ReadError::Unknown(what.to_owned())
}

/// A file whose metadata were read.
#[derive(Debug)]
pub struct TreeReader {
    file: fs::File,
    bytes: u64,
    /// The root and the nodes.
    pub shape: Shape,
    /// The bits of split nodes.
    pub split: Chunked,
    /// The bits of leaves that are not in the mesh, if there are any.
    pub masked: Option<Chunked>,
    /// The sides of all nodes.
    pub sides: Chunked,
    /// The ranks of all nodes, if they are known.
    pub ranks: Option<Chunked>,
}

impl TreeReader {
    /// Opens a file and reads its metadata.
    ///
    /// # Errors
    /// If the file cannot be read, or is another one than the writer makes.
    pub fn open(path: &Path) -> Result<Self> {
        let file = files::open(path)?;
        let source = Source { bytes: file.metadata()?.len(), file: &file };
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
        let expected = metadata(&group(&shape, &arrays), start);
        let found = (source.bytes_at(start, end.saturating_sub(start))?, head);
        if expected != found {
            let what = "its metadata are not those of its tree".to_owned();
            let is_ours = found.0.windows(EDGE.len()).any(|bytes| bytes == EDGE.as_bytes());
            let error = if is_ours { ReadError::Damaged } else { ReadError::Unknown };
            return Err(error(what));
        }
        let bytes = source.bytes;
        let mut arrays = arrays.into_iter();
        let mut next = || arrays.next().expect("three arrays or more");
        let (split, masked, sides) = (next(), Some(next()).filter(has_chunks), next());
        Ok(Self { file, bytes, shape, split, masked, sides, ranks: arrays.next() })
    }

    /// The elements of a chunk, little-endian; `into` gets as many bytes as a chunk has.
    ///
    /// # Errors
    /// If the chunk is damaged.
    pub fn read_chunk(&self, array: &Chunked, index: usize, into: &mut Vec<u8>) -> Result<()> {
        into.clear();
        into.resize(array.chunk_bytes(), 0);
        let Some(Extent { address, bytes }) = array.chunks[index] else { return Ok(()) };
        let stored = Source { file: &self.file, bytes: self.bytes }.bytes_at(address, bytes)?;
        let mut inflater = Decompress::new(true);
        let status = inflater.decompress(&stored, into, FlushDecompress::Finish);
        let is_whole = matches!(status, Ok(Status::StreamEnd))
            && inflater.total_in() == bytes
            && inflater.total_out() == into.len() as u64;
        if is_whole {
            Ok(())
        } else {
            Err(ReadError::Damaged(format!("the chunk at byte {address}")))
        }
    }
}

/// The bytes of a file.
struct Source<'a> {
    file: &'a fs::File,
    bytes: u64,
}

impl Source<'_> {
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
    fn tree(&self, root: u64) -> Result<(Shape, Vec<Chunked>, u64)> {
        let missing = || unknown("it has no tree");
        let grid = *self.links(root)?.get(GROUP).ok_or_else(missing)?;
        let links = self.links(grid)?;
        let link = |name: &str| links.get(name).copied().ok_or_else(missing);
        let data = self.links(link(CELL_DATA)?)?;
        let nodes = self.numbers(link(NODES)?)?;
        let mut origin = [0.0; 3];
        for (low, name) in origin.iter_mut().zip(COORDINATES) {
            *low = f64::from_bits(*self.numbers(link(name)?)?.first().ok_or_else(missing)?);
        }
        // The edge is the last attribute.
        let attribute = self.last(grid, message::ATTRIBUTE)?;
        let edge = f64::from_bits(tail(&attribute).ok_or_else(missing)?);
        let shape = Shape { origin, edge, nodes };
        if !shape.is_tree() {
            return Err(unknown("its nodes are not those of an oct-tree"));
        }
        // Each window has an entry in a table.
        if shape.windows().saturating_mul(12) > self.bytes {
            return Err(missing());
        }
        let mut arrays = arrays(&shape, data.contains_key(RANK));
        let sources = [links.get(SPLIT), links.get(MASK), data.get(SIDE), data.get(RANK)];
        for (array, address) in arrays.iter_mut().zip(sources) {
            address.map_or(Ok(()), |address| self.fill(array, *address))?;
        }
        Ok((shape, arrays, *links.values().min().ok_or_else(missing)?))
    }

    /// The messages of the object header at an address: code and content.
    fn messages(&self, address: u64) -> Result<Vec<(u8, Vec<u8>)>> {
        let head = self.bytes_at(address, HEADER_BYTES)?;
        let block = self.bytes_at(address + HEADER_BYTES, number(&head[6..]))?;
        let (mut messages, mut rest) = (Vec::new(), &block[..]);
        while let [code, low, high, _, after @ ..] = rest {
            let size = usize::from(u16::from_le_bytes([*low, *high]));
            let split = after.split_at_checked(size);
            let (body, next) =
                split.ok_or_else(|| unknown("a message is longer than its header"))?;
            messages.push((*code, body.to_vec()));
            rest = next;
        }
        Ok(messages)
    }

    /// The members of a group: addresses by name.
    fn links(&self, address: u64) -> Result<HashMap<String, u64>> {
        let link = |(code, body): (u8, Vec<u8>)| {
            let (name, address) = body.get(3..)?.split_last_chunk::<8>()?;
            let name = String::from_utf8(name.to_vec()).ok()?;
            (code == message::LINK).then_some((name, u64::from_le_bytes(*address)))
        };
        Ok(self.messages(address)?.into_iter().filter_map(link).collect())
    }

    /// The last message with a code.
    fn last(&self, address: u64, code: u8) -> Result<Vec<u8>> {
        let found = self.messages(address)?.into_iter().rfind(|(other, _)| *other == code);
        found.map(|(_, body)| body).ok_or_else(|| unknown("a message is missing"))
    }

    /// The numbers of a small array, as bits.
    fn numbers(&self, address: u64) -> Result<Vec<u64>> {
        let layout = self.last(address, message::LAYOUT)?;
        Ok(layout.get(4..).unwrap_or_default().chunks_exact(8).map(number).collect())
    }

    /// Sets the places of an array's chunks.
    fn fill(&self, array: &mut Chunked, address: u64) -> Result<()> {
        // The layout ends with the address of the table's header.
        let layout = self.last(address, message::LAYOUT)?;
        let header = tail(&layout).filter(|&header| header < self.bytes);
        let header = header.ok_or_else(|| unknown("an array has no table of chunks"))?;
        let size = 8 + array.size_bytes();
        let bytes = array.chunks.len() as u64 * (size as u64 + 4);
        let entries = self.bytes_at(header + TABLE_HEAD_BYTES + TABLE_BYTES, bytes)?;
        for (slot, entry) in array.chunks.iter_mut().zip(entries.chunks_exact(size + 4)) {
            let extent = Extent { address: number(&entry[..8]), bytes: number(&entry[8..size]) };
            *slot = (extent.address != UNDEFINED).then_some(extent);
        }
        Ok(())
    }
}

/// The number in some bytes, little-endian.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte))
}

/// The number in the last eight bytes.
fn tail(bytes: &[u8]) -> Option<u64> {
    bytes.last_chunk().map(|bytes| u64::from_le_bytes(*bytes))
}
