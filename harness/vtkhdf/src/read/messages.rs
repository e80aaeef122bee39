//! Messages of object headers, decoded.

use crate::format::{
    FILTER_DEFLATE, INDEX_FIXED_ARRAY, Kind, LAYOUT_CHUNKED, LAYOUT_COMPACT, LAYOUT_VERSION,
    PAGE_BITS, ReadError, Value,
};

pub(super) type Result<T> = std::result::Result<T, ReadError>;

pub(super) fn unknown<T>(what: impl Into<String>) -> Result<T> {
    Err(ReadError::Unknown(what.into()))
}

pub(super) fn damaged<T>(what: impl Into<String>) -> Result<T> {
    Err(ReadError::Damaged(what.into()))
}

/// The messages of an array.
#[derive(Default)]
pub(super) struct ArrayHeader {
    /// See [`dataspace`].
    pub(super) dataspace: Option<Option<u64>>,
    pub(super) datatype: Option<Datatype>,
    pub(super) layout: Option<Layout>,
    pub(super) is_compressed: bool,
}

#[derive(Clone, Copy)]
pub(super) enum Datatype {
    Kind(Kind),
    Text(u32),
}

pub(super) enum Layout {
    Compact(Vec<u8>),
    Chunked { dims: [u32; 2], table: u64 },
}

pub(super) fn link(body: &mut Input) -> Result<(String, u64)> {
    if body.take(2)? != [1, 0] {
        return unknown("a link that is not hard");
    }
    let length = usize::from(body.u8()?);
    Ok((text(body.take(length)?)?, body.u64()?))
}

pub(super) fn attribute(body: &mut Input) -> Result<(String, Value)> {
    if body.take(2)? != [3, 0] {
        return unknown("an attribute of another version");
    }
    let sizes = [body.u16()?, body.u16()?, body.u16()?].map(usize::from);
    if body.u8()? != 0 {
        return unknown("an attribute with a name that is not in ASCII");
    }
    let name = text(body.take(sizes[0])?.strip_suffix(&[0]).unwrap_or_default())?;
    let datatype = datatype(&mut Input(body.take(sizes[1])?))?;
    let len = dataspace(&mut Input(body.take(sizes[2])?))?;
    Ok((name, value(datatype, len, body.0)?))
}

/// The number of elements; none for a single one that is not in an array.
pub(super) fn dataspace(body: &mut Input) -> Result<Option<u64>> {
    match body.take(4)? {
        [2, 0, 0, 0] => Ok(None),
        [2, 1, 0, 1] => Ok(Some(body.u64()?)),
        _ => unknown("an array with more than one dimension, or one that can grow"),
    }
}

pub(super) fn datatype(body: &mut Input) -> Result<Datatype> {
    if let Some(kind) = Kind::ALL.into_iter().find(|kind| kind.encode() == body.0) {
        return Ok(Datatype::Kind(kind));
    }
    match body.take(4)? {
        [0x13, 1, 0, 0] => Ok(Datatype::Text(body.u32()?)),
        _ => unknown("elements of another type"),
    }
}

pub(super) fn layout(body: &mut Input) -> Result<Layout> {
    match body.take(2)? {
        [LAYOUT_VERSION, LAYOUT_COMPACT] => {
            let size = usize::from(body.u16()?);
            Ok(Layout::Compact(body.take(size)?.to_vec()))
        }
        [LAYOUT_VERSION, LAYOUT_CHUNKED] => {
            if body.take(2)? != [0, 2] {
                return unknown("chunks of more than one dimension");
            }
            let bytes = usize::from(body.u8()?.clamp(1, 4));
            let mut dim = || -> Result<u32> {
                let mut dim = [0; 4];
                dim[..bytes].copy_from_slice(body.take(bytes)?);
                Ok(u32::from_le_bytes(dim))
            };
            let dims = [dim()?, dim()?];
            if body.take(2)? != [INDEX_FIXED_ARRAY, PAGE_BITS] {
                return unknown("an index of chunks that is not a fixed array");
            }
            Ok(Layout::Chunked { dims, table: body.u64()? })
        }
        _ => unknown("an array that is neither in its header nor in chunks"),
    }
}

pub(super) fn is_deflate(body: &[u8]) -> bool {
    // One filter with one parameter, the level.
    let [low, high] = FILTER_DEFLATE.to_le_bytes();
    body.len() == 12 && body[..8] == [2, 1, low, high, 0, 0, 1, 0]
}

pub(super) fn value(datatype: Datatype, len: Option<u64>, data: &[u8]) -> Result<Value> {
    let (size, is_array) = match &datatype {
        Datatype::Kind(kind) => (kind.bytes() as u64, len.is_some()),
        Datatype::Text(bytes) => (u64::from(*bytes), false),
    };
    if len.unwrap_or(1).checked_mul(size) != Some(data.len() as u64) {
        return damaged("the size of a value is not that of its type");
    }
    let eights = || data.chunks_exact(8).map(|b| b.try_into().unwrap_or_default());
    match datatype {
        Datatype::Text(_) if len.is_none() => Ok(Value::Text(text(data)?)),
        Datatype::Kind(Kind::Int64) if !is_array => {
            Ok(Value::Number(eights().map(i64::from_le_bytes).sum()))
        }
        Datatype::Kind(Kind::Int64) => Ok(Value::Ints(eights().map(i64::from_le_bytes).collect())),
        Datatype::Kind(Kind::Double) if is_array => {
            Ok(Value::Doubles(eights().map(f64::from_le_bytes).collect()))
        }
        Datatype::Kind(Kind::Int32) if is_array => {
            let fours = data.chunks_exact(4).map(|b| b.try_into().unwrap_or_default());
            Ok(Value::Ints32(fours.map(i32::from_le_bytes).collect()))
        }
        _ => unknown("a small array of another type"),
    }
}

fn text(bytes: &[u8]) -> Result<String> {
    match std::str::from_utf8(bytes) {
        Ok(text) if text.is_ascii() => Ok(text.to_owned()),
        _ => unknown("a name or text that is not in ASCII"),
    }
}

/// The bytes of a block that remain.
pub(super) struct Input<'a>(pub(super) &'a [u8]);

impl<'a> Input<'a> {
    pub(super) fn take(&mut self, bytes: usize) -> Result<&'a [u8]> {
        let Some((head, rest)) = self.0.split_at_checked(bytes) else {
            return damaged("a block ends too early");
        };
        self.0 = rest;
        Ok(head)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        Ok(self.take(N)?.try_into().expect("as many bytes as were taken"))
    }

    pub(super) fn u8(&mut self) -> Result<u8> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    pub(super) fn u16(&mut self) -> Result<u16> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64> {
        Ok(u64::from_le_bytes(self.array()?))
    }
}
