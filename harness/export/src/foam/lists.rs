//! OpenFOAM's files in binary: the dictionary `FoamFile`, then one list, or two.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::options::{Label, Options};
use contract::failure::Failure;

/// Greatest label.
pub fn label_max(label: Label) -> u64 {
    match label {
        Label::Bits32 => i32::MAX as u64,
        Label::Bits64 => i64::MAX as u64,
    }
}

/// The dictionary at the beginning of a file.
pub fn header(format: &str, label: Label, class: &str, object: &str, note: &str) -> String {
    let bits = if label == Label::Bits32 { 32 } else { 64 };
    let note = if note.is_empty() { String::new() } else { format!("    note \"{note}\";\n") };
    format!(
        "FoamFile\n{{\n    version 2.0;\n    format {format};\n    arch \"LSB;label={bits};scalar=64\";\n{note}    \
         class {class};\n    location \"constant/polyMesh\";\n    object {object};\n}}\n\n"
    )
}

/// A file with lists.
pub struct ListFile<'a> {
    out: BufWriter<File>,
    options: &'a Options<'a>,
}

impl<'a> ListFile<'a> {
    /// Begins a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create(
        dir: &Path,
        options: &'a Options<'a>,
        class: &str,
        object: &str,
        note: &str,
    ) -> Result<Self, Failure> {
        let mut out = BufWriter::with_capacity(1 << 16, File::create(dir.join(object))?);
        out.write_all(header("binary", options.foam.label, class, object, note).as_bytes())?;
        Ok(Self { out, options })
    }

    /// Adds a list of `count` labels.
    ///
    /// # Errors
    /// If it cannot be written, or if the user interrupts.
    pub fn labels(&mut self, count: u64, labels: impl Iterator<Item = i64>) -> Result<(), Failure> {
        match self.options.foam.label {
            Label::Bits32 => self.list(count, labels.map(|label| (label as i32).to_le_bytes())),
            Label::Bits64 => self.list(count, labels.map(i64::to_le_bytes)),
        }
    }

    /// Adds a list of `count` points.
    ///
    /// # Errors
    /// As [`Self::labels`].
    pub fn points(
        &mut self,
        count: u64,
        points: impl Iterator<Item = [f64; 3]>,
    ) -> Result<(), Failure> {
        let bytes = |point: [f64; 3]| -> [u8; 24] {
            let all = point.map(f64::to_le_bytes);
            std::array::from_fn(|i| all[i / 8][i % 8])
        };
        self.list(count, points.map(bytes))
    }

    /// A list without items has no parentheses.
    fn list<const N: usize>(
        &mut self,
        count: u64,
        items: impl Iterator<Item = [u8; N]>,
    ) -> Result<(), Failure> {
        let [begin, end] = if count == 0 { [""; 2] } else { ["(", ")"] };
        write!(self.out, "{count}\n{begin}")?;
        for (item, number) in items.zip(0..) {
            self.options.check_at(number)?;
            self.out.write_all(&item)?;
        }
        Ok(writeln!(self.out, "{end}")?)
    }

    /// Waits until the file is on disk.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> Result<(), Failure> {
        let file = self.out.into_inner().map_err(std::io::IntoInnerError::into_error)?;
        Ok(file.sync_all()?)
    }
}
