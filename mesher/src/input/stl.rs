//! STL files, binary and text, including common deviations from the format.

mod text;

use crate::error::Error;
use geometries::Facet;
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

const HEADER: u64 = 84;
const RECORD: u64 = 50;

/// An open STL file of known format.
#[derive(Debug)]
pub struct Stl {
    path: PathBuf,
    file: File,
    length: u64,
    /// Number of facets if the file is binary.
    pub binary: Option<u64>,
}

/// Opens a file and determines whether it is binary: whether its length is that of the facets which the header
/// counts.
///
/// # Errors
/// If the file cannot be read or is no STL file.
pub fn open(path: &Path) -> Result<Stl, Error> {
    let fail = |e: std::io::Error| {
        Error::input(format!("{}: {e}: give a readable STL file", path.display()))
    };
    let file = files::open(path).map_err(fail)?;
    let length = file.metadata().map_err(fail)?.len();
    if length == 0 {
        return Err(Error::input(format!(
            "{} is empty: give an STL file with facets",
            path.display()
        )));
    }
    let mut stl = Stl { path: path.to_owned(), file, length, binary: None };
    if length >= HEADER {
        let mut count = [0; 4];
        stl.file.read_exact_at(&mut count, 80).map_err(fail)?;
        let count = u64::from(u32::from_le_bytes(count));
        if length == HEADER + RECORD * count {
            stl.binary = Some(count);
        } else if !stl.looks_like_text()? {
            let wanted = HEADER + RECORD * count;
            let how = if length < wanted { "truncated" } else { "longer" };
            return Err(Error::input(format!(
                "{}: the header promises {count} facets, which take {wanted} bytes, but the file has {length}: it is {how} or not an STL; export it again",
                path.display()
            )));
        }
    }
    Ok(stl)
}

impl Stl {
    fn fail(&self, what: impl std::fmt::Display) -> Error {
        Error::input(format!("{}: {what}", self.path.display()))
    }

    /// Whether the beginning of the file may be that of text: the first word, if there is one, is `solid`, and no byte is zero.
    fn looks_like_text(&self) -> Result<bool, Error> {
        let mut head = vec![0; self.length.min(1024) as usize];
        self.file.read_exact_at(&mut head, 0).map_err(|e| self.fail(e))?;
        Ok(text::may_begin_with_solid(&head) && !head.contains(&0))
    }

    /// Facets `first..end` of a binary file.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn read(&self, first: u64, end: u64) -> Result<Vec<Facet>, Error> {
        const CHUNK: u64 = 8192;
        let mut out = Vec::with_capacity((end - first) as usize);
        let mut buffer = vec![0; (CHUNK.min(end - first) * RECORD) as usize];
        for at in (first..end).step_by(CHUNK as usize) {
            let count = CHUNK.min(end - at);
            let bytes = &mut buffer[..(count * RECORD) as usize];
            self.file
                .read_exact_at(bytes, HEADER + RECORD * at)
                .map_err(|e| self.fail(format!("{e} at facet {at}: export it again")))?;
            out.extend(bytes.as_chunks::<{ RECORD as usize }>().0.iter().map(record));
        }
        Ok(out)
    }

    /// The facets of all solids of a text file.
    ///
    /// # Errors
    /// If the file cannot be read, or is malformed or truncated.
    pub fn read_text(mut self) -> Result<Vec<Facet>, Error> {
        if !self.looks_like_text()? {
            return Err(self.fail("is neither a binary STL nor a text STL, which begins with \"solid\": give an STL file"));
        }
        let mut bytes = Vec::new();
        self.file.read_to_end(&mut bytes).map_err(|e| self.fail(e))?;
        text::parse(&bytes).map_err(|why| self.fail(format!("{why}: export it again")))
    }
}

/// The vertices of a binary record. They follow the normal, which is not used.
fn record(bytes: &[u8; RECORD as usize]) -> Facet {
    let coordinate =
        |i: usize| f32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]);
    std::array::from_fn(|v| std::array::from_fn(|a| coordinate(12 + 12 * v + 4 * a)))
}

/// Checks that all coordinates are finite; `first` is the index of the first facet, for the error.
///
/// # Errors
/// Names the first facet that has another coordinate.
pub fn check_finite(facets: &[Facet], first: u64) -> Result<(), Error> {
    // 0 * x is NaN if and only if x is infinite or NaN; the sum keeps the loop free of branches.
    let flat: &[f32] = facets.as_flattened().as_flattened();
    if flat.iter().map(|x| 0.0 * x).sum::<f32>() == 0.0 {
        return Ok(());
    }
    let bad =
        facets.iter().position(|f| !f.as_flattened().iter().all(|x| x.is_finite())).unwrap_or(0);
    Err(Error::input(format!(
        "facet {} has a vertex that is not finite: {:?}: repair the geometry",
        first + bad as u64,
        facets[bad]
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn text(s: &str) -> Result<Vec<Facet>, Error> {
        let mut f = tempfile::NamedTempFile::new().unwrap();
        f.write_all(s.as_bytes()).unwrap();
        let stl = open(f.path())?;
        assert!(stl.binary.is_none());
        stl.read_text()
    }

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e-1 0\nendloop\nendfacet\n";

    #[test]
    fn text_is_read_with_any_case_line_ends_and_names() {
        let plain = format!("solid a b\n{FACET}{FACET}endsolid a b\n");
        let two = format!("solid\n{FACET}endsolid\nsolid z\n{FACET}endsolid z\n");
        for s in [
            plain.clone(),
            plain.replace('\n', "\r\n"),
            plain.replace('\n', "\r"),
            plain.to_uppercase(),
            format!("\n\n  {plain}"),
            two,
        ] {
            let facets = text(&s).unwrap_or_else(|e| panic!("{e}\n{s}"));
            assert_eq!(facets, [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.1, 0.0]]; 2], "{s}");
        }
        assert!(text("solid nothing\nendsolid nothing\n").unwrap().is_empty());
    }

    #[test]
    fn malformed_text_is_refused() {
        let plain = format!("solid a\n{FACET}endsolid a\n");
        for s in [
            "hello",
            "solid a\n",
            &plain[..60],
            &plain[..plain.len() - 11],
            &plain.replace("1 0 0", "1 0"),
            &plain.replace("1 0 0", "1 x 0"),
        ] {
            assert!(matches!(text(s), Err(Error::Input(_))), "{s:?}");
        }
        assert!(text(&plain.replace("1e-1", "1e99")).is_err());
        let bad = [[[0.0; 3]; 3], [[0.0, 1.0, f32::NAN]; 3]];
        assert!(check_finite(&bad, 7).unwrap_err().to_string().contains("facet 8"));
        assert!(check_finite(&bad[..1], 7).is_ok());
    }

    #[test]
    fn a_binary_file_is_recognised_by_its_length() {
        let mut bytes = b"solid but binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(2u32.to_le_bytes());
        for i in 0..2 * 12 {
            bytes.extend((i as f32).to_le_bytes());
            if i % 12 == 11 {
                bytes.extend([0, 0]);
            }
        }
        let try_open = |b: &[u8]| {
            let mut f = tempfile::NamedTempFile::new().unwrap();
            f.write_all(b).unwrap();
            open(f.path()).and_then(|s| match s.binary {
                Some(n) => s.read(0, n),
                None => s.read_text(),
            })
        };
        let facets = try_open(&bytes).unwrap();
        assert_eq!(facets[1], [[15.0, 16.0, 17.0], [18.0, 19.0, 20.0], [21.0, 22.0, 23.0]]);
        for cut in [0, 1, 83, 84, 100, bytes.len() - 1] {
            assert!(matches!(try_open(&bytes[..cut]), Err(Error::Input(_))), "cut at {cut}");
        }
        bytes.push(0);
        assert!(try_open(&bytes).is_err());
    }
}
