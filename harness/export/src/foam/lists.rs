//! OpenFOAM's files: the dictionary `FoamFile`, then one list, in ASCII or binary.
//!
//! Faces are a `faceList` in ASCII. In binary they are a `faceCompactList`, two lists of labels of which the first has the
//! position of each face in the second; both are written at the same time, from two places of the file on.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;

use crate::options::{Label, Style};

/// Greatest label.
pub fn label_max(label: Label) -> u64 {
    match label {
        Label::Bits32 => i32::MAX as u64,
        Label::Bits64 => i64::MAX as u64,
    }
}

fn label_bytes(label: Label) -> u64 {
    match label {
        Label::Bits32 => 4,
        Label::Bits64 => 8,
    }
}

const BUFFER_BYTES: usize = 1 << 16;
/// Room for a count that is written after its list.
const COUNT_DIGITS: usize = 20;

/// The dictionary at the beginning of a file.
pub fn header(style: Style, class: &str, object: &str, note: &str) -> String {
    let format = if style.is_ascii { "ascii" } else { "binary" };
    let bits = 8 * label_bytes(style.label);
    let note = if note.is_empty() { String::new() } else { format!("    note \"{note}\";\n") };
    format!(
        "FoamFile\n{{\n    version 2.0;\n    format {format};\n    arch \"LSB;label={bits};scalar=64\";\n{note}    \
         class {class};\n    location \"constant/polyMesh\";\n    object {object};\n}}\n\n"
    )
}

fn write_label(out: &mut impl Write, style: Style, label: i64) -> io::Result<()> {
    debug_assert!(label.unsigned_abs() <= label_max(style.label));
    match (style.is_ascii, style.label) {
        (true, _) => out.write_all(itoa::Buffer::new().format(label).as_bytes()),
        (false, Label::Bits32) => out.write_all(&(label as i32).to_le_bytes()),
        (false, Label::Bits64) => out.write_all(&label.to_le_bytes()),
    }
}

/// A file with one list, whose length is known.
#[derive(Debug)]
pub struct List {
    out: BufWriter<File>,
    style: Style,
    /// A binary list without items has no parentheses.
    has_end: bool,
}

impl List {
    /// Begins a list of `count` items.
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
        let mut out = BufWriter::with_capacity(BUFFER_BYTES, File::create(dir.join(object))?);
        let has_end = style.is_ascii || count > 0;
        writeln!(out, "{}{count}", header(style, class, object, note))?;
        out.write_all(match (has_end, style.is_ascii) {
            (false, _) => b"",
            (true, false) => b"(",
            (true, true) => b"(\n",
        })?;
        Ok(Self { out, style, has_end })
    }

    /// Adds a label.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn label(&mut self, label: i64) -> io::Result<()> {
        write_label(&mut self.out, self.style, label)?;
        self.end_line()
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
    fn face(&mut self, vertices: &[u64]) -> io::Result<()> {
        write_label(&mut self.out, self.style, vertices.len() as i64)?;
        for (i, &vertex) in vertices.iter().enumerate() {
            self.out.write_all(if i == 0 { b"(" } else { b" " })?;
            write_label(&mut self.out, self.style, vertex as i64)?;
        }
        self.out.write_all(b")\n")
    }

    fn end_line(&mut self) -> io::Result<()> {
        if self.style.is_ascii { self.out.write_all(b"\n") } else { Ok(()) }
    }

    /// Ends the list, and waits until the file is on disk.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.write_all(if self.has_end { b")\n" } else { b"\n" })?;
        self.out.into_inner()?.sync_all()
    }
}

/// The file `faces`.
#[derive(Debug)]
pub enum Faces {
    /// A `faceList`.
    Listed(List),
    /// A `faceCompactList`.
    Compact(Compact),
}

/// The two lists of a `faceCompactList`.
#[derive(Debug)]
pub struct Compact {
    positions: List,
    vertices: BufWriter<File>,
    /// Position of the second list's length in the file.
    at_count: u64,
    count: u64,
}

impl Faces {
    /// Begins a list of `count` faces.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn create(dir: &Path, style: Style, count: u64) -> io::Result<Self> {
        if style.is_ascii {
            return Ok(Self::Listed(List::create(dir, style, "faceList", "faces", "", count)?));
        }
        let mut positions = List::create(dir, style, "faceCompactList", "faces", "", count + 1)?;
        let begin = positions.out.stream_position()?;
        let at_count = begin + (count + 1) * label_bytes(style.label) + ")\n".len() as u64;
        let mut file = File::options().write(true).open(dir.join("faces"))?;
        file.seek(SeekFrom::Start(at_count + COUNT_DIGITS as u64))?;
        let mut vertices = BufWriter::with_capacity(BUFFER_BYTES, file);
        vertices.write_all(b"\n(")?;
        positions.label(0)?;
        Ok(Self::Compact(Compact { positions, vertices, at_count, count: 0 }))
    }

    /// Adds a face. Returns false if its vertices exceed what labels can count.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn push(&mut self, vertices: &[u64]) -> io::Result<bool> {
        match self {
            Self::Listed(list) => list.face(vertices)?,
            Self::Compact(Compact { positions, vertices: out, count, .. }) => {
                *count += vertices.len() as u64;
                if *count > label_max(positions.style.label) {
                    return Ok(false);
                }
                positions.label(*count as i64)?;
                vertices.iter().try_for_each(|&v| write_label(out, positions.style, v as i64))?;
            }
        }
        Ok(true)
    }

    /// Ends the list, and waits until the file is on disk.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self) -> io::Result<()> {
        let Compact { positions, mut vertices, at_count, count } = match self {
            Self::Listed(list) => return list.finish(),
            Self::Compact(compact) => compact,
        };
        vertices.write_all(b")\n")?;
        let file = vertices.into_inner()?;
        file.write_all_at(format!("{count:<COUNT_DIGITS$}").as_bytes(), at_count)?;
        positions.finish()
    }
}
