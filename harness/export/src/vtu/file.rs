//! One `.vtu` file, written piece by piece.
//!
//! The XML precedes the data that it describes. Its place is reserved for as many pieces as there will be, and it is written last.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

use super::header::{Content, Place};
use super::piece::Encoded;

const END: &str = "\n  </AppendedData>\n</VTKFile>\n";

/// A `.vtu` file that is being written.
#[derive(Debug)]
pub struct VtuFile {
    file: File,
    content: Content,
    places: Vec<Place>,
    pieces: usize,
    header_bytes: usize,
    data_bytes: u64,
}

impl VtuFile {
    /// Begins an empty file of at most `pieces` pieces.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn begin(mut file: File, content: Content, pieces: usize) -> io::Result<Self> {
        let header_bytes = content.vtu(&vec![Place::longest(); pieces], 0).len();
        file.seek(SeekFrom::Start(header_bytes as u64))?;
        Ok(Self { file, content, places: Vec::new(), pieces, header_bytes, data_bytes: 0 })
    }

    /// Appends a piece.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn append(&mut self, piece: &Encoded) -> io::Result<()> {
        self.file.write_all(&piece.bytes)?;
        // The user's interrupt waits for a flush to end, so none may have much to flush.
        self.file.sync_data()?;
        self.places.push(piece.place(self.data_bytes));
        self.data_bytes += piece.bytes.len() as u64;
        self.content.digest.merge(piece.digest);
        Ok(())
    }

    /// Whether it has all its pieces.
    pub fn is_full(&self) -> bool {
        self.places.len() == self.pieces
    }

    /// Writes the XML and flushes the file to disk; returns its size in bytes.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> io::Result<u64> {
        self.file.write_all(END.as_bytes())?;
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(self.content.vtu(&self.places, self.header_bytes).as_bytes())?;
        self.file.sync_all()?;
        Ok(self.header_bytes as u64 + self.data_bytes + END.len() as u64)
    }
}
