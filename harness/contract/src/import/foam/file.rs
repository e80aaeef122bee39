//! OpenFOAM's files: the dictionary `FoamFile` at the beginning, and the tokens of what follows. `lists` reads the lists.

use crate::files;
use crate::import::ImportError;
use std::path::{Path, PathBuf};

/// A file whose dictionary has been read.
pub struct FoamFile {
    path: PathBuf,
    pub(super) bytes: Vec<u8>,
    /// Position of the next byte.
    pub(super) at: usize,
    pub(super) binary: bool,
    pub(super) class: String,
    pub(super) label_bytes: usize,
    pub(super) scalar_bytes: usize,
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
        let bytes = files::read(path).map_err(|error| ImportError::from(error).of_file(path))?;
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

    pub(super) fn expect(&mut self, byte: u8) -> Result<(), ImportError> {
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
    pub(super) fn token(&mut self) -> Result<&[u8], ImportError> {
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

    pub(super) fn number<T: std::str::FromStr>(&mut self) -> Result<T, ImportError> {
        let token = self.token()?;
        let parsed = std::str::from_utf8(token).ok().and_then(|text| text.parse().ok());
        let shown = String::from_utf8_lossy(&token[..token.len().min(20)]).into_owned();
        parsed.ok_or_else(|| {
            self.error(format!("has {shown:?} before byte {}, where a number belongs", self.at))
        })
    }
}
