//! Part files: one-dimensional NumPy arrays of type `<u8`.

use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use crate::failure::{Failure, Result};

/// Longer than any header that the programs write, so that one read suffices.
const HEADER_BYTES_MAX: u64 = 1 << 16;

/// An open part file with a valid header, for reading at any position.
#[derive(Debug)]
pub struct PartFile {
    path: PathBuf,
    file: File,
    offset: u64,
    /// Number of words.
    pub leaves: u64,
}

impl PartFile {
    /// Opens a part file and checks its type, its shape and its length.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a part file.
    pub fn open(path: &Path) -> Result<Self> {
        let wrong = |why: String| Failure::input(format!("the part {why}"));
        let unreadable = |error| wrong(Failure::unreadable(error).to_string());
        let file = ::files::open(path).map_err(unreadable)?;
        let mut head = Vec::new();
        (&file).take(HEADER_BYTES_MAX).read_to_end(&mut head).map_err(unreadable)?;
        let (descr, shape, offset) =
            read_header(&head).map_err(|why| wrong(format!("has no npy header: {why}")))?;
        Failure::unless(descr == "<u8", wrong(format!("has type {descr}, not '<u8'")))?;
        let [len] = shape[..] else {
            return Err(wrong(format!("has shape {shape:?}, but must have one dimension")));
        };
        let found = file.metadata().map_err(unreadable)?.len();
        let expected = u128::from(offset) + 8 * u128::from(len);
        let why = format!("has {found} bytes, but its header implies {expected} ({len} leaves)");
        Failure::unless(u128::from(found) == expected, wrong(why))?;
        Ok(Self { path: path.to_owned(), file, offset, leaves: len })
    }

    /// Fills `words` with the words from index `first` on.
    ///
    /// # Errors
    /// If the file cannot be read, or ends too early.
    pub fn read_at(&self, first: u64, words: &mut [u64]) -> Result<()> {
        let bytes = bytemuck::cast_slice_mut(words);
        let read = self.file.read_exact_at(bytes, self.offset + 8 * first);
        read.map_err(|error| Failure::about(&self.path, Failure::unreadable(error)))
    }

    /// All words.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn read_all(&self) -> Result<Vec<u64>> {
        let leaves = usize::try_from(self.leaves).expect("a part fits the address space");
        let mut words = vec![0; leaves];
        self.read_at(0, &mut words)?;
        Ok(words)
    }
}

/// The type and the dimensions in the npy header at the beginning of a file, and the header's length. It is read as NumPy writes it: a dictionary of Python, with its keys in
/// alphabetical order.
fn read_header(head: &[u8]) -> Result<(String, Vec<u64>, u64), &'static str> {
    const { assert!(cfg!(target_endian = "little"), "words are cast to bytes and back") };
    let [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, low, high, ..] = *head else {
        return Err("it is too short, or not of version 1");
    };
    let end = 10 + usize::from(u16::from_le_bytes([low, high]));
    let text = head.get(10..end).ok_or("it is longer than the file")?;
    let text = String::from_utf8_lossy(text);
    let between = |from: &str, to: &str| {
        let (value, _) = text.split_once(from)?.1.split_once(to)?;
        Some(value.trim().to_owned())
    };
    let descr = between("'descr':", ", 'fortran_order': False,").zip(between("'shape': (", ")"));
    let (descr, shape) = descr.ok_or("it has no type or shape")?;
    let dimensions = shape.split(',').map(str::trim).filter(|n| !n.is_empty());
    let shape = dimensions.map(|n| n.parse().map_err(|_| "its shape is not of numbers"));
    Ok((descr.trim_matches('\'').to_owned(), shape.collect::<Result<_, _>>()?, end as u64))
}

/// Writes words as a part file.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, words: &[u64]) -> std::io::Result<()> {
    fs::write(path, bytes(words))
}

/// The bytes of a part file.
pub fn bytes(words: &[u64]) -> Vec<u8> {
    [&header("<u8", &format!("({},)", words.len())), bytemuck::cast_slice(words)].concat()
}

/// An npy header of version 1.0, padded to a multiple of 64 bytes as NumPy does.
pub fn header(descr: &str, shape: &str) -> Vec<u8> {
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    text.push_str(&" ".repeat((64 - (10 + text.len() + 1) % 64) % 64));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn file_of(bytes: &[u8]) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(bytes).unwrap();
        file
    }

    #[test]
    fn written_words_are_read_back() {
        let file = file_of(b"");
        let words: Vec<u64> = (0..100).map(|i| i * i).collect();
        write(file.path(), &words).unwrap();
        let part = PartFile::open(file.path()).unwrap();
        assert_eq!(part.read_all().unwrap(), words);
        assert!(part.leaves > 0);
    }

    #[test]
    fn a_header_ends_with_a_line_end_at_a_multiple_of_64_bytes() {
        for digits in 0..70 {
            let header = header("<u8", &format!("({},)", "1".repeat(digits)));
            assert!(header.len().is_multiple_of(64) && header.len() <= 192, "{digits} digits");
            assert!(header.ends_with(b"\n") && header.starts_with(b"\x93NUMPY\x01\x00"));
            let stated = usize::from(u16::from_le_bytes([header[8], header[9]]));
            assert_eq!(stated + 10, header.len());
        }
    }

    #[test]
    fn the_array_of_a_rank_without_leaves_is_read() {
        let file = file_of(b"");
        write(file.path(), &[]).unwrap();
        let part = PartFile::open(file.path()).unwrap();
        assert_eq!((part.leaves, part.read_all().unwrap()), (0, Vec::new()));
        assert_eq!(part.leaves, 0);
    }

    #[test]
    fn arrays_of_other_type_shape_or_length_are_rejected() {
        let data = [0; 16];
        let refused = |descr, shape, bytes: usize| {
            let file = file_of(&[&header(descr, shape)[..], &data[..bytes]].concat());
            PartFile::open(file.path()).unwrap_err()
        };
        for (descr, shape, bytes, why) in [
            ("<i8", "(2,)", 16, "has type <i8"),
            (">u8", "(2,)", 16, "has type >u8, not '<u8'"),
            ("<u4", "(4,)", 16, "has type <u4"),
            ("<u8", "(1, 2)", 16, "has shape [1, 2]"),
            ("<u8", "()", 8, "has shape []"),
            ("<u8", "(2,)", 15, "its header implies 144 (2 leaves)"),
            ("<u8", "(1,)", 16, "its header implies 136 (1 leaves)"),
            ("<u8", "(4294967296, 4294967296)", 16, "has shape [4294967296, 4294967296]"),
        ] {
            let found = refused(descr, shape, bytes).to_string();
            assert!(found.contains(why), "{found}");
        }
        let headless = file_of(b"not an array");
        let why = PartFile::open(headless.path()).unwrap_err().to_string();
        assert!(why.starts_with("the part has no npy header: "), "{why}");
    }

    #[test]
    fn a_header_longer_than_the_file_or_without_a_shape_is_refused() {
        let refused = |bytes: &[u8]| {
            let why = PartFile::open(file_of(bytes).path()).unwrap_err().to_string();
            assert!(why.starts_with("the part has no npy header: "), "{why}");
            why
        };
        for length in [u16::MAX, 1 << 10, 200] {
            let long = [&b"\x93NUMPY\x01\x00"[..], &length.to_le_bytes(), &[b' '; 100]].concat();
            assert!(refused(&long).ends_with("it is longer than the file"), "{}", refused(&long));
        }
        assert!(refused(b"\x93NUMPY\x02\x00\x00\x00\x00\x00").contains("not of version 1"));
        for shape in ["(five,)", "((5,),)", "(-5,)", "(99999999999999999999,)"] {
            assert!(refused(&header("<u8", shape)).contains("its shape is not"), "{shape}");
        }
        for shape in ["5", "("] {
            assert!(refused(&header("<u8", shape)).contains("no type or shape"), "{shape}");
        }
        assert!(
            refused(&[&b"\x93NUMPY\x01\x00\x02\x00"[..], b"{}"].concat())
                .contains("no type or shape")
        );
        assert!(refused(b"\x93NUMPY\x01").contains("too short"));
    }
}
