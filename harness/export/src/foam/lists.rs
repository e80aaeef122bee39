//! OpenFOAM's files: the dictionary `FoamFile`, then one list, in ASCII or binary.
//!
//! Faces are a `faceList` in ASCII. In binary they are a `faceCompactList`, two lists of labels of which the first has the
//! position of each face in the second.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::options::{Label, Style};

/// Greatest label.
pub fn label_max(label: Label) -> u64 {
    match label {
        Label::Bits32 => i32::MAX as u64,
        Label::Bits64 => i64::MAX as u64,
    }
}

/// The dictionary at the beginning of a file.
pub fn header(style: Style, class: &str, object: &str, note: &str) -> String {
    let format = if style.is_ascii { "ascii" } else { "binary" };
    let bits = if style.label == Label::Bits32 { 32 } else { 64 };
    let note = if note.is_empty() { String::new() } else { format!("    note \"{note}\";\n") };
    format!(
        "FoamFile\n{{\n    version 2.0;\n    format {format};\n    arch \"LSB;label={bits};scalar=64\";\n{note}    \
         class {class};\n    location \"constant/polyMesh\";\n    object {object};\n}}\n\n"
    )
}

/// A file with lists.
#[derive(Debug)]
pub struct List {
    out: BufWriter<File>,
    style: Style,
}

impl List {
    /// Begins a file whose list has `count` items.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn create(
        dir: &Path,
        style: Style,
        class: &str,
        object: &str,
        note: &str,
        count: u64,
    ) -> io::Result<Self> {
        let out = BufWriter::with_capacity(1 << 16, File::create(dir.join(object))?);
        let mut list = Self { out, style };
        write!(list.out, "{}{count}\n{}", header(style, class, object, note), list.begin(count))?;
        Ok(list)
    }

    /// A binary list without items has no parentheses.
    fn begin(&self, count: u64) -> &'static str {
        match (self.style.is_ascii, count) {
            (true, _) => "(\n",
            (false, 0) => "",
            (false, _) => "(",
        }
    }

    fn number(&mut self, label: i64) -> io::Result<()> {
        debug_assert!(label.unsigned_abs() <= label_max(self.style.label));
        match (self.style.is_ascii, self.style.label) {
            (true, _) => self.out.write_all(itoa::Buffer::new().format(label).as_bytes()),
            (false, Label::Bits32) => self.out.write_all(&(label as i32).to_le_bytes()),
            (false, Label::Bits64) => self.out.write_all(&label.to_le_bytes()),
        }
    }

    /// Adds a label.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn label(&mut self, label: i64) -> io::Result<()> {
        self.number(label)?;
        if self.style.is_ascii { self.out.write_all(b"\n") } else { Ok(()) }
    }

    /// Adds a point. Its coordinates are written so that they are read back without a change.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn point(&mut self, point: [f64; 3]) -> io::Result<()> {
        if !self.style.is_ascii {
            return point.iter().try_for_each(|c| self.out.write_all(&c.to_le_bytes()));
        }
        for (before, coordinate) in [b"(", b" ", b" "].into_iter().zip(point) {
            self.out.write_all(before)?;
            self.out.write_all(zmij::Buffer::new().format_finite(coordinate).as_bytes())?;
        }
        self.out.write_all(b")\n")
    }

    /// Adds a face to a `faceList`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn face(&mut self, vertices: &[u32]) -> io::Result<()> {
        self.number(vertices.len() as i64)?;
        for (i, &vertex) in vertices.iter().enumerate() {
            self.out.write_all(if i == 0 { b"(" } else { b" " })?;
            self.number(i64::from(vertex))?;
        }
        self.out.write_all(b")\n")
    }

    /// Ends a list, after which another one of `count` items follows.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn next(&mut self, count: u64) -> io::Result<()> {
        write!(self.out, ")\n{count:<20}\n{}", self.begin(count))
    }

    /// Ends the last list, which has `count` items, and waits until the file is on disk.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self, count: u64) -> io::Result<()> {
        self.out.write_all(if self.begin(count).is_empty() { b"\n" } else { b")\n" })?;
        self.out.into_inner()?.sync_all()
    }
}
