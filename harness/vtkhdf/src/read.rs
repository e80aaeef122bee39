//! Reader of the HDF5 files that [`write`](mod@crate::write) makes. It refuses everything else, and allocates no memory for a count
//! before the file has been seen to be long enough for it.

mod messages;

use crate::checksum::lookup3;
use crate::format::{
    ALLOCATED_BY_CHUNK, ALLOCATED_EARLY, Chunked, Extent, Group, Kind, Member, PAGE_BITS,
    SIGNATURE, SUPERBLOCK_BYTES, UNDEFINED, message,
};
use flate2::{Decompress, FlushDecompress, Status};
use std::fs;
use std::os::unix::fs::FileExt;
use std::path::Path;

use messages::{
    ArrayHeader, Datatype, Input, Layout, Result, attribute, damaged, dataspace, datatype,
    is_deflate, layout, link, unknown, value,
};

/// Greatest depth of groups in groups.
const DEPTH_MAX: usize = 8;
/// Greatest number of objects.
const OBJECTS_MAX: usize = 1000;
/// Greatest size of an object header.
const HEADER_BYTES_MAX: u32 = 1 << 20;
/// Greatest size of a chunk, before compression.
const CHUNK_BYTES_MAX: u64 = 1 << 24;

/// An open file.
#[derive(Debug)]
pub struct File {
    file: fs::File,
    bytes: u64,
    root: u64,
}

impl File {
    /// Opens a file and reads its superblock.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or has another version of the format.
    pub fn open(path: &Path) -> Result<Self> {
        let file = files::open(path)?;
        let bytes = file.metadata()?.len();
        let this = Self { file, bytes, root: 0 };
        let head = this.bytes_at(Extent { address: 0, bytes: bytes.min(8) })?;
        if head != SIGNATURE {
            return unknown("another signature than HDF5 files");
        }
        let block = this.bytes_at(Extent { address: 0, bytes: SUPERBLOCK_BYTES as u64 })?;
        let mut input = Input(&block[head.len()..]);
        if input.take(4)? != [3, 8, 8, 0] {
            return unknown("a superblock that is not of version 3");
        }
        verify(&block, "superblock")?;
        let (base, extension, end, root) = (input.u64()?, input.u64()?, input.u64()?, input.u64()?);
        if base != 0 || extension != UNDEFINED {
            return unknown("a user block or an extension of the superblock");
        }
        if end != bytes {
            return damaged(format!("it has {bytes} bytes instead of {end}"));
        }
        Ok(Self { root, ..this })
    }

    /// The root group with all that is in it.
    ///
    /// # Errors
    /// If the file is damaged or has anything that this reader does not know.
    pub fn root(&self) -> Result<Group> {
        let mut objects = 0;
        match self.object(self.root, 0, &mut objects)? {
            Member::Group(group) => Ok(group),
            _ => damaged("its root is not a group"),
        }
    }

    /// The elements of a chunk, little-endian; `into` gets as many bytes as a chunk has.
    ///
    /// # Errors
    /// If the chunk is damaged.
    pub fn read_chunk(&self, array: &Chunked, index: usize, into: &mut Vec<u8>) -> Result<()> {
        into.clear();
        into.resize(array.chunk_bytes(), 0);
        let Some(extent) = array.chunks[index] else { return Ok(()) };
        let stored = self.bytes_at(extent)?;
        let mut inflater = Decompress::new(true);
        let status = inflater.decompress(&stored, into, FlushDecompress::Finish);
        let is_whole = matches!(status, Ok(Status::StreamEnd))
            && inflater.total_in() == extent.bytes
            && inflater.total_out() == into.len() as u64;
        if is_whole { Ok(()) } else { damaged(format!("the chunk at byte {}", extent.address)) }
    }

    fn bytes_at(&self, Extent { address, bytes }: Extent) -> Result<Vec<u8>> {
        if address.checked_add(bytes).is_none_or(|end| end > self.bytes) {
            return damaged(format!("it ends before byte {}", address.saturating_add(bytes)));
        }
        let mut block = vec![0; bytes as usize];
        self.file.read_exact_at(&mut block, address)?;
        Ok(block)
    }

    fn object(&self, address: u64, depth: usize, objects: &mut usize) -> Result<Member> {
        *objects += 1;
        if depth > DEPTH_MAX || *objects > OBJECTS_MAX {
            return unknown("more groups and arrays than expected");
        }
        let block = self.header(address)?;
        let mut input = Input(&block);
        let (mut group, mut links) = (Group::default(), Vec::new());
        let mut array = ArrayHeader::default();
        while !input.0.is_empty() {
            let (code, size, flags) = (input.u8()?, input.u16()?, input.u8()?);
            let mut body = Input(input.take(usize::from(size))?);
            if flags != 0 {
                return unknown("a shared message");
            }
            match code {
                message::LINK_INFO
                    if body.take(2)? == [0, 0] && body.0.iter().all(|&b| b == 0xff) => {}
                message::GROUP_INFO if body.0 == [0, 0] => {}
                message::LINK => links.push(link(&mut body)?),
                message::ATTRIBUTE => group.attributes.push(attribute(&mut body)?),
                message::DATASPACE => array.dataspace = Some(dataspace(&mut body)?),
                message::DATATYPE => array.datatype = Some(datatype(&mut body)?),
                message::LAYOUT => array.layout = Some(layout(&mut body)?),
                message::FILTERS if is_deflate(body.0) => array.is_compressed = true,
                message::FILL_VALUE
                    if [ALLOCATED_EARLY, ALLOCATED_BY_CHUNK]
                        .contains(&body.0.try_into().unwrap_or_default()) => {}
                _ => return unknown(format!("a message of type {code}")),
            }
        }
        if array.layout.is_some() {
            return self.array(array);
        }
        for (name, address) in links {
            group.members.push((name, self.object(address, depth + 1, objects)?));
        }
        Ok(Member::Group(group))
    }

    /// The messages of an object header.
    fn header(&self, address: u64) -> Result<Vec<u8>> {
        let head = self.bytes_at(Extent { address, bytes: 10 })?;
        let mut input = Input(&head);
        if input.take(4)? != b"OHDR" {
            return damaged(format!("there is no object header at byte {address}"));
        }
        if input.take(2)? != [2, 2] {
            return unknown("an object header of another version");
        }
        let size = input.u32()?;
        if size > HEADER_BYTES_MAX {
            return unknown(format!("an object header of {size} bytes"));
        }
        let mut block = self.bytes_at(Extent { address, bytes: 10 + u64::from(size) + 4 })?;
        verify(&block, "object header")?;
        block.truncate(10 + size as usize);
        Ok(block.split_off(10))
    }

    fn array(&self, header: ArrayHeader) -> Result<Member> {
        let ArrayHeader { dataspace, datatype, layout, is_compressed } = header;
        let (Some(len), Some(datatype), Some(layout)) = (dataspace, datatype, layout) else {
            return damaged("an array has no type or no size");
        };
        match (layout, datatype, len) {
            (Layout::Compact(data), _, _) => Ok(Member::Small(value(datatype, len, &data)?)),
            (
                Layout::Chunked { dims: [chunk_len, bytes], table },
                Datatype::Kind(kind),
                Some(len),
            ) if is_compressed && bytes as usize == kind.bytes() => {
                let chunk_bytes = u64::from(chunk_len) * u64::from(bytes);
                if chunk_len == 0 || chunk_bytes > CHUNK_BYTES_MAX || u64::from(chunk_len) > len {
                    return unknown(format!("chunks of {chunk_bytes} bytes"));
                }
                Ok(Member::Chunked(self.table(kind, len, chunk_len, table)?))
            }
            _ => unknown("an array of chunks that are not compressed with zlib alone"),
        }
    }

    fn table(&self, kind: Kind, len: u64, chunk_len: u32, address: u64) -> Result<Chunked> {
        let count = len.div_ceil(u64::from(chunk_len));
        let head = self.bytes_at(Extent { address, bytes: 28 })?;
        verify(&head, "table of chunks")?;
        let mut array = Chunked { kind, len, chunk_len, chunks: Vec::new() };
        let (size_bytes, entry) = (array.size_bytes(), 12 + array.size_bytes());
        let mut input = Input(&head);
        if input.take(6)? != b"FAHD\x00\x01"
            || input.take(2)? != [entry as u8, PAGE_BITS]
            || count >= 1 << PAGE_BITS
        {
            return unknown("a table of chunks of another kind");
        }
        if input.u64()? != count {
            return damaged("its table of chunks has another length than the array");
        }
        let bytes = 14 + count * entry as u64 + 4;
        let block = self.bytes_at(Extent { address: input.u64()?, bytes })?;
        verify(&block, "table of chunks")?;
        let mut input = Input(&block);
        if input.take(6)? != b"FADB\x00\x01" || input.u64()? != address {
            return damaged("its table of chunks is not in its place");
        }
        for _ in 0..count {
            let address = input.u64()?;
            let mut size = [0; 8];
            size[..size_bytes].copy_from_slice(input.take(size_bytes)?);
            let extent = Extent { address, bytes: u64::from_le_bytes(size) };
            if input.u32()? != 0 {
                return unknown("chunks without compression");
            }
            let is_stored = address != UNDEFINED;
            if is_stored && extent.bytes > 2 * array.chunk_bytes() as u64 + 64 {
                return damaged(format!("its chunk at byte {address} has {} bytes", extent.bytes));
            }
            array.chunks.push(is_stored.then_some(extent));
        }
        Ok(array)
    }
}

/// Verifies the checksum at the end of a block.
fn verify(block: &[u8], what: &str) -> Result<()> {
    let (content, sum) = block.split_at(block.len() - 4);
    if sum == lookup3(content).to_le_bytes() {
        Ok(())
    } else {
        damaged(format!("the checksum of a {what} is wrong"))
    }
}
