//! OpenFOAM's files of lists: a dictionary `FoamFile`, then a list in ASCII or binary.
//!
//! An ASCII list is `N(...)`, or `N{value}` if all items are equal. A binary list is `N`, white space, `(`, the items
//! without separators, `)`. The faces of a binary mesh are a `faceCompactList`: two lists of labels, the
//! first of which holds the position of each face in the second.

use crate::import::ImportError;
use std::fs;
use std::path::{Path, PathBuf};

/// A file whose dictionary has been read.
pub struct FoamFile {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Position of the next byte.
    at: usize,
    binary: bool,
    class: String,
    label_bytes: usize,
    scalar_bytes: usize,
}

impl FoamFile {
    /// Opens a file and reads its dictionary.
    ///
    /// # Errors
    /// If it cannot be read, is compressed, or has no usable dictionary.
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        if !path.exists() && path.with_extension("gz").exists() {
            return Err(ImportError::content("is compressed: decompress it with gunzip")
                .of_file(&path.with_extension("gz")));
        }
        let bytes = fs::read(path).map_err(|error| ImportError::from(error).of_file(path))?;
        let mut file = Self {
            path: path.to_owned(),
            bytes,
            at: 0,
            binary: false,
            class: String::new(),
            label_bytes: 4,
            scalar_bytes: 8,
        };
        file.dictionary()?;
        Ok(file)
    }

    /// An error in this file.
    pub fn error(&self, why: impl Into<String>) -> ImportError {
        ImportError::content(why).of_file(&self.path)
    }

    fn dictionary(&mut self) -> Result<(), ImportError> {
        if self.word()? != "FoamFile" || self.word()? != "{" {
            return Err(self.error("does not begin with a dictionary FoamFile"));
        }
        loop {
            let key = self.word()?;
            if key == "}" {
                return Ok(());
            }
            let value = self.value()?;
            match key.as_str() {
                "format" => self.binary = value == "binary",
                "class" => self.class = value,
                "arch" => self.architecture(&value)?,
                _ => {}
            }
        }
    }

    /// The widths of numbers, as in `LSB;label=32;scalar=64`.
    fn architecture(&mut self, value: &str) -> Result<(), ImportError> {
        for field in value.split(';') {
            match field.trim() {
                "LSB" | "label=32" | "scalar=64" | "" => {}
                "label=64" => self.label_bytes = 8,
                "scalar=32" => self.scalar_bytes = 4,
                other => {
                    return Err(
                        self.error(format!("has the architecture {other}, which is not supported"))
                    );
                }
            }
        }
        Ok(())
    }

    /// The value of a dictionary entry, without quotes, up to its semicolon.
    fn value(&mut self) -> Result<String, ImportError> {
        self.skip_blank();
        let quoted = self.bytes.get(self.at) == Some(&b'"');
        let begin = self.at + usize::from(quoted);
        let end_byte = if quoted { b'"' } else { b';' };
        let length = self.bytes[begin..].iter().position(|&b| b == end_byte);
        let end = begin + length.ok_or_else(|| self.ended("its dictionary"))?;
        let value = String::from_utf8_lossy(&self.bytes[begin..end]).trim().to_owned();
        self.at = end;
        self.expect(if quoted { b'"' } else { b';' })?;
        if quoted {
            self.expect(b';')?;
        }
        Ok(value)
    }

    fn ended(&self, within: &str) -> ImportError {
        self.error(format!("ends within {within}: it is incomplete"))
    }

    /// Skips white space and comments.
    fn skip_blank(&mut self) {
        loop {
            let rest = &self.bytes[self.at..];
            let blank = rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
            let rest = &rest[blank..];
            let comment = if rest.starts_with(b"//") {
                rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len())
            } else if rest.starts_with(b"/*") {
                rest.windows(2).position(|w| w == b"*/").map_or(rest.len(), |end| end + 2)
            } else {
                0
            };
            self.at += blank + comment;
            if comment == 0 {
                return;
            }
        }
    }

    fn expect(&mut self, byte: u8) -> Result<(), ImportError> {
        self.skip_blank();
        if self.bytes.get(self.at) != Some(&byte) {
            return Err(self.error(format!("has no {:?} at byte {}", byte as char, self.at)));
        }
        self.at += 1;
        Ok(())
    }

    /// The next word or brace.
    fn word(&mut self) -> Result<String, ImportError> {
        let token = self.token()?;
        Ok(String::from_utf8_lossy(token).into_owned())
    }

    /// The next brace, parenthesis, or run of other characters.
    fn token(&mut self) -> Result<&[u8], ImportError> {
        self.skip_blank();
        let rest = &self.bytes[self.at..];
        let delimiter = |b: &u8| b"(){};".contains(b);
        let length = match rest.first() {
            None => return Err(self.ended("a list or dictionary")),
            Some(b) if delimiter(b) => 1,
            Some(_) => {
                rest.iter().take_while(|b| !delimiter(b) && !b.is_ascii_whitespace()).count()
            }
        };
        self.at += length;
        Ok(&self.bytes[self.at - length..self.at])
    }

    fn number<T: std::str::FromStr>(&mut self) -> Result<T, ImportError> {
        let token = self.token()?;
        let parsed = std::str::from_utf8(token).ok().and_then(|text| text.parse().ok());
        let shown = String::from_utf8_lossy(&token[..token.len().min(20)]).into_owned();
        parsed.ok_or_else(|| {
            self.error(format!("has {shown:?} before byte {}, where a number belongs", self.at))
        })
    }

    /// The number of items of a list. Each needs at least `bytes_min` bytes of the file.
    fn count(&mut self, bytes_min: usize) -> Result<usize, ImportError> {
        let count: usize = self.number()?;
        let left = self.bytes.len() - self.at;
        if count > left / bytes_min {
            return Err(self.error(format!(
                "states {count} items, but has only {left} bytes for them: it is incomplete"
            )));
        }
        Ok(count)
    }

    /// The bytes of a binary list.
    fn raw(&mut self, count: usize, size: usize) -> Result<&[u8], ImportError> {
        if count == 0 {
            return Ok(&[]);
        }
        self.expect(b'(')?;
        let (begin, end) = (self.at, self.at + count * size);
        if self.bytes.get(end) != Some(&b')') {
            return Err(self.error(format!(
                "has no \")\" after {count} items of {size} bytes: it is incomplete or damaged"
            )));
        }
        self.at = end + 1;
        Ok(&self.bytes[begin..end])
    }

    /// A list of labels. A list of equal items has `count_uniform` at most.
    ///
    /// # Errors
    /// If the file has no such list.
    pub fn labels(&mut self, count_uniform: usize) -> Result<Vec<i64>, ImportError> {
        if self.binary {
            let size = self.label_bytes;
            let count = self.count(size)?;
            return Ok(self.raw(count, size)?.chunks_exact(size).map(label).collect());
        }
        let count: usize = self.number()?;
        if self.token()? == b"{" {
            let value = self.number()?;
            self.expect(b'}')?;
            return match count <= count_uniform {
                true => Ok(vec![value; count]),
                false => Err(self.error(format!(
                    "states {count} equal items, and at most {count_uniform} are possible"
                ))),
            };
        }
        self.at -= 1;
        if count > (self.bytes.len() - self.at) / 2 {
            return Err(self.error(format!("states {count} items: it is incomplete")));
        }
        self.parenthesised(count, Self::number)
    }

    /// The items between parentheses.
    fn parenthesised<T>(
        &mut self,
        count: usize,
        item: impl Fn(&mut Self) -> Result<T, ImportError>,
    ) -> Result<Vec<T>, ImportError> {
        self.expect(b'(')?;
        let items = (0..count).map(|_| item(self)).collect::<Result<_, _>>()?;
        self.expect(b')')?;
        Ok(items)
    }

    /// A list of points.
    ///
    /// # Errors
    /// If the file has no such list.
    pub fn points(&mut self) -> Result<Vec<[f64; 3]>, ImportError> {
        if !self.binary {
            let count = self.count(7)?;
            return self.parenthesised(count, |file| {
                file.expect(b'(')?;
                let point = [file.number()?, file.number()?, file.number()?];
                file.expect(b')')?;
                Ok(point)
            });
        }
        let size = self.scalar_bytes;
        let count = self.count(3 * size)?;
        let scalar = |bytes: &[u8]| match bytes.try_into() {
            Ok(eight) => f64::from_le_bytes(eight),
            Err(_) => f64::from(f32::from_le_bytes(bytes.try_into().expect("four or eight bytes"))),
        };
        let point = |bytes: &[u8]| [0, 1, 2].map(|a| scalar(&bytes[a * size..][..size]));
        Ok(self.raw(count, 3 * size)?.chunks_exact(3 * size).map(point).collect())
    }

    /// A list of indices below `length`. A list of equal items has `count_uniform` at most.
    ///
    /// # Errors
    /// If the file has no such list.
    pub fn indices(
        &mut self,
        count_uniform: usize,
        length: usize,
    ) -> Result<Vec<usize>, ImportError> {
        let labels = self.labels(count_uniform)?;
        self.as_indices(labels, length)
    }

    fn as_indices(&self, labels: Vec<i64>, length: usize) -> Result<Vec<usize>, ImportError> {
        let index = |(i, label): (usize, i64)| {
            let index = usize::try_from(label).ok().filter(|&index| index < length);
            index.ok_or_else(|| {
                self.error(format!("has {label} as item {i}, where {length} objects are possible"))
            })
        };
        labels.into_iter().enumerate().map(index).collect()
    }

    /// The faces: the end of each in the list of all vertices, and that list, of indices of the points.
    ///
    /// # Errors
    /// If the file has no faces of these points.
    pub fn faces(&mut self, points: usize) -> Result<(Vec<usize>, Vec<usize>), ImportError> {
        let (ends, labels) = match (self.class.as_str(), self.binary) {
            ("faceCompactList", _) => self.faces_compact()?,
            (_, false) => self.faces_listed()?,
            _ => {
                return Err(self.error(format!(
                    "is a binary {}, and faceCompactList is supported",
                    self.class
                )));
            }
        };
        Ok((ends, self.as_indices(labels, points)?))
    }

    fn faces_compact(&mut self) -> Result<(Vec<usize>, Vec<i64>), ImportError> {
        let (begins, labels) = (self.labels(0)?, self.labels(0)?);
        let sound = begins.first() == Some(&0)
            && begins.is_sorted()
            && begins.last().is_some_and(|&last| last == labels.len() as i64);
        match sound {
            true => Ok((begins[1..].iter().map(|&end| end as usize).collect(), labels)),
            false => Err(self
                .error("has positions of faces that do not ascend from 0 to the number of labels")),
        }
    }

    fn faces_listed(&mut self) -> Result<(Vec<usize>, Vec<i64>), ImportError> {
        let count = self.count(4)?;
        let (mut ends, mut labels) = (Vec::with_capacity(count), Vec::new());
        self.expect(b'(')?;
        for _ in 0..count {
            labels.extend(self.labels(0)?);
            ends.push(labels.len());
        }
        self.expect(b')')?;
        Ok((ends, labels))
    }
}

/// A label of four or eight bytes.
fn label(bytes: &[u8]) -> i64 {
    match bytes.try_into() {
        Ok(eight) => i64::from_le_bytes(eight),
        Err(_) => i64::from(i32::from_le_bytes(bytes.try_into().expect("four or eight bytes"))),
    }
}
