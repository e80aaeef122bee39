//! Metadata of HDF5 files: tables of chunks, object headers and the superblock; and compressed chunks.

use crate::format::{Chunked, SIGNATURE, TABLE_HEAD_BYTES, UNDEFINED, lookup3};
use flate2::{Compress, Compression, FlushCompress, Status};

/// Codes of messages in object headers.
mod message {
    pub(super) const DATASPACE: u8 = 1;
    pub(super) const LINK_INFO: u8 = 2;
    pub(super) const DATATYPE: u8 = 3;
    pub(super) const FILL_VALUE: u8 = 5;
    pub(super) const LINK: u8 = 6;
    pub(super) const LAYOUT: u8 = 8;
    pub(super) const GROUP_INFO: u8 = 10;
    pub(super) const FILTERS: u8 = 11;
    pub(super) const ATTRIBUTE: u8 = 12;
}

/// Layouts of arrays: in the object header, or in chunks.
const LAYOUT_VERSION: u8 = 4;
const LAYOUT_COMPACT: u8 = 0;
const LAYOUT_CHUNKED: u8 = 2;
/// The index of chunks is a *fixed array*: a table of as many entries as chunks.
const INDEX_FIXED_ARRAY: u8 = 3;
/// Base-2 logarithm of the entries from which on the table would have pages: more than any file of ours has.
const PAGE_BITS: u8 = 24;

/// Fill value messages: the value is zero, and space is allocated early, or chunk by chunk.
const ALLOCATED_EARLY: [u8; 2] = [3, 0b1001];
const ALLOCATED_BY_CHUNK: [u8; 2] = [3, 0b1011];

/// The types of an array's elements. All are little-endian.
pub(crate) mod datatype {
    pub(crate) const BYTE: &[u8] = &[0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0];
    pub(crate) const INT32: &[u8] = &[0x10, 8, 0, 0, 4, 0, 0, 0, 0, 0, 32, 0];
    pub(crate) const INT64: &[u8] = &[0x10, 8, 0, 0, 8, 0, 0, 0, 0, 0, 64, 0];
    /// An implied leading bit of the mantissa, the sign at bit 63; exponent at bit 52 with 11 bits, mantissa at bit 0 with 52 bits, bias 1023.
    pub(crate) const DOUBLE: &[u8] =
        &[0x11, 0x20, 63, 0, 8, 0, 0, 0, 0, 0, 64, 0, 52, 11, 0, 52, 0xff, 3, 0, 0];
}

/// A small array, or the value of an attribute, as HDF5 describes it.
pub(crate) struct Value {
    datatype: Vec<u8>,
    dataspace: Vec<u8>,
    data: Vec<u8>,
}

impl Value {
    /// One text, in ASCII.
    pub(crate) fn text(text: &str) -> Self {
        // Padded with zeros, of which there are none.
        let datatype = [&[0x13, 1, 0, 0], &(text.len() as u32).to_le_bytes()[..]].concat();
        Self { datatype, dataspace: vec![2, 0, 0, 0], data: text.into() }
    }

    /// One number.
    pub(crate) fn number(number: u64) -> Self {
        Self { dataspace: vec![2, 0, 0, 0], ..Self::ints(&[number]) }
    }

    /// A one-dimensional array of numbers of a type, which has `N` bytes.
    pub(crate) fn array<const N: usize>(datatype: &[u8], numbers: &[[u8; N]]) -> Self {
        let (dataspace, data) = (simple(numbers.len() as u64), numbers.as_flattened().to_vec());
        Self { datatype: datatype.to_vec(), dataspace, data }
    }

    /// The same of whole numbers.
    pub(crate) fn ints(numbers: &[u64]) -> Self {
        Self::array(datatype::INT64, &numbers.iter().map(|n| n.to_le_bytes()).collect::<Vec<_>>())
    }

    /// The same of floating-point numbers.
    pub(crate) fn doubles(numbers: &[f64]) -> Self {
        Self::array(datatype::DOUBLE, &numbers.iter().map(|n| n.to_le_bytes()).collect::<Vec<_>>())
    }
}

/// The metadata of a file: blocks that follow each other. What they refer to precedes them.
pub(crate) struct Metadata {
    bytes: Vec<u8>,
    start: u64,
}

impl Metadata {
    /// No metadata yet, which will begin at byte `start` and end with the file.
    pub(crate) fn new(start: u64) -> Self {
        Self { bytes: Vec::new(), start }
    }

    /// The metadata with this root group; and the superblock, which begins the file.
    pub(crate) fn finish(self, root: u64) -> (Vec<u8>, Vec<u8>) {
        let mut superblock = SIGNATURE.to_vec();
        superblock.extend([3, 8, 8, 0]);
        superblock.extend([0, UNDEFINED, self.end(), root].map(u64::to_le_bytes).as_flattened());
        close(&mut superblock);
        (self.bytes, superblock)
    }

    fn end(&self) -> u64 {
        self.start + self.bytes.len() as u64
    }

    /// Adds a group with the addresses of its members; returns its address.
    pub(crate) fn group(&mut self, attributes: &[(&str, Value)], members: &[(&str, u64)]) -> u64 {
        let mut header = Vec::new();
        // No index of links: all are in the header.
        add_message(&mut header, message::LINK_INFO, &[&[0, 0][..], &[0xff; 16]].concat());
        add_message(&mut header, message::GROUP_INFO, &[0, 0]);
        for (name, value) in attributes {
            add_message(&mut header, message::ATTRIBUTE, &attribute(name, value));
        }
        for (name, address) in members {
            add_message(&mut header, message::LINK, &link(name, *address));
        }
        self.header(&header)
    }

    /// Adds an object header with these messages; returns its address.
    fn header(&mut self, messages: &[u8]) -> u64 {
        self.block([b"OHDR\x02\x02", &(messages.len() as u32).to_le_bytes()[..], messages].concat())
    }

    /// Adds a block and its checksum; returns its address.
    fn block(&mut self, mut block: Vec<u8>) -> u64 {
        let address = self.end();
        close(&mut block);
        self.bytes.extend(block);
        address
    }

    /// Adds a small array, which is stored in its object header.
    pub(crate) fn small(&mut self, Value { datatype, dataspace, data }: &Value) -> u64 {
        let mut header = Vec::new();
        add_message(&mut header, message::DATASPACE, dataspace);
        add_message(&mut header, message::DATATYPE, datatype);
        add_message(&mut header, message::FILL_VALUE, &ALLOCATED_EARLY);
        let size = (data.len() as u16).to_le_bytes();
        let layout = [&[LAYOUT_VERSION, LAYOUT_COMPACT], &size[..], data].concat();
        add_message(&mut header, message::LAYOUT, &layout);
        self.header(&header)
    }

    /// Adds an array in chunks.
    pub(crate) fn chunked(&mut self, array: &Chunked) -> u64 {
        let table = self.table(array);
        let mut header = Vec::new();
        add_message(&mut header, message::DATASPACE, &simple(array.len));
        add_message(&mut header, message::DATATYPE, datatype::BYTE);
        add_message(&mut header, message::FILL_VALUE, &ALLOCATED_BY_CHUNK);
        // As few as encode the length of a chunk, which the library verifies.
        let bytes = 1 + array.chunk_len.ilog2() as usize / 8;
        let mut layout = vec![LAYOUT_VERSION, LAYOUT_CHUNKED, 0, 2, bytes as u8];
        [array.chunk_len, 1].iter().for_each(|dim| layout.extend(&dim.to_le_bytes()[..bytes]));
        layout.extend([INDEX_FIXED_ARRAY, PAGE_BITS].into_iter().chain(table.to_le_bytes()));
        add_message(&mut header, message::LAYOUT, &layout);
        // One filter, zlib (1), not optional, with one parameter.
        add_message(&mut header, message::FILTERS, &[2, 1, 1, 0, 0, 0, 1, 0, LEVEL as u8, 0, 0, 0]);
        self.header(&header)
    }

    /// Adds the table of an array's chunks; returns the address of the table's header, which the table follows.
    fn table(&mut self, array: &Chunked) -> u64 {
        let size_bytes = array.size_bytes();
        let sizes = [8 + size_bytes as u8 + 4, PAGE_BITS];
        let numbers = [array.chunks.len() as u64, self.end() + TABLE_HEAD_BYTES];
        let numbers = numbers.map(u64::to_le_bytes);
        let header_at = self.block([b"FAHD\x00\x01", &sizes[..], numbers.as_flattened()].concat());
        let mut table = [b"FADB\x00\x01", &header_at.to_le_bytes()[..]].concat();
        for chunk in &array.chunks {
            let stored = chunk.as_ref().map(|at| (at.start, at.end - at.start));
            let (address, bytes) = stored.unwrap_or((UNDEFINED, 0));
            table.extend(address.to_le_bytes());
            table.extend(&bytes.to_le_bytes()[..size_bytes]);
            // All filters were applied.
            table.extend([0; 4]);
        }
        self.block(table);
        header_at
    }
}

/// The message of an attribute, which ends with the value.
pub(crate) fn attribute(name: &str, Value { datatype, dataspace, data }: &Value) -> Vec<u8> {
    let size = |bytes: usize| (bytes as u16).to_le_bytes();
    let sizes = [size(name.len() + 1), size(datatype.len()), size(dataspace.len())].concat();
    let head = [&[3, 0], &sizes[..], &[0], name.as_bytes(), &[0]].concat();
    [&head, datatype, dataspace, data].map(Vec::as_slice).concat()
}

/// The message of a group's member, which ends with the address.
pub(crate) fn link(name: &str, address: u64) -> Vec<u8> {
    [&[1, 0, name.len() as u8], name.as_bytes(), &address.to_le_bytes()].concat()
}

/// Appends a message of an object header.
fn add_message(header: &mut Vec<u8>, code: u8, body: &[u8]) {
    let bytes = u16::try_from(body.len()).expect("a message has less than 64 KiB");
    header.extend([&[code], &bytes.to_le_bytes()[..], &[0], body].concat());
}

/// Appends the checksum of a block.
fn close(block: &mut Vec<u8>) {
    block.extend(lookup3(block).to_le_bytes());
}

/// The dataspace of a one-dimensional array.
fn simple(len: u64) -> Vec<u8> {
    [&[2, 1, 0, 1], &len.to_le_bytes()[..]].concat()
}

/// Level of compression. On a tree of 1e9 leaves, levels 1 to 6 take 2.8, 3.1, 3.7, 4.1, 4.7, 6.8 s of CPU time for 107, 64, 57, 49,
/// 46, 40 MB.
const LEVEL: u32 = 4;

/// Compresses chunks.
pub struct Deflater(Compress);

impl Default for Deflater {
    fn default() -> Self {
        Self(Compress::new(Compression::new(LEVEL), true))
    }
}

impl Deflater {
    /// The compressed chunk; none if all bytes are zero, since such a chunk is not stored.
    pub fn compress(&mut self, chunk: &[u8]) -> Option<Vec<u8>> {
        if chunk.iter().all(|&b| b == 0) {
            return None;
        }
        self.0.reset();
        // Incompressible bytes grow by less than this.
        let mut out = Vec::with_capacity(chunk.len() + chunk.len() / 256 + 64);
        let status = self.0.compress_vec(chunk, &mut out, FlushCompress::Finish);
        assert!(matches!(status, Ok(Status::StreamEnd)), "a chunk fits the buffer: {status:?}");
        out.shrink_to_fit();
        Some(out)
    }
}
