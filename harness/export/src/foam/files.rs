//! The files of a mesh in OpenFOAM's binary format: the dictionary `FoamFile`, then one list, or two.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use bytemuck::NoUninit;
use contract::manifest::{Manifest, Sides};
use contract::word;

use super::Mesh;
use crate::points::to_user;
use contract::failure::{Result, uninterrupted};

impl Mesh {
    /// Writes the files into a directory, with labels of 64 bits if they are wide, and else of 32.
    ///
    /// # Errors
    /// If a file cannot be written, or if the user interrupts.
    pub fn write(&self, manifest: &Manifest, is_wide: bool, dir: &Path) -> Result<()> {
        let faces = &self.faces;
        let (points, cells) = (self.points.all.len() as u64, self.leaves.count);
        let vertices = faces.vertices.corners.len() as u64;
        let (count, inner) = (faces.count(), faces.neighbour.len());
        let note = format!("nPoints:{points} nCells:{cells} nFaces:{count} nInternalFaces:{inner}");
        let labels = |object: &str, note: &str, labels: &mut dyn ExactSizeIterator<Item = i64>| {
            let mut file = ListFile::create(dir, is_wide, ["labelList", object, note])?;
            file.labels(labels.len() as u64, labels)?;
            file.finish()
        };
        labels("owner", &note, &mut faces.owner.iter().map(|&cell| cell.into()))?;
        labels("neighbour", &note, &mut faces.neighbour.iter().map(|&cell| cell.into()))?;
        let words: Vec<u64> = self.leaves.cells().collect();
        labels("cellLevel", "", &mut words.iter().map(|&word| word::level(word).into()))?;
        if manifest.sides == Sides::Known {
            labels("side", "", &mut words.iter().map(|word| (word & 3) as i64))?;
        }
        if let Some(ranks) = &self.ranks {
            labels("rank", "", &mut ranks.iter().map(|&rank| rank.into()))?;
        }
        let ends = faces.vertices.ends.iter().map(|&end| end as i64);
        let mut file = ListFile::create(dir, is_wide, ["faceCompactList", "faces", ""])?;
        file.labels(count as u64 + 1, std::iter::once(0).chain(ends))?;
        file.labels(vertices, faces.vertices.corners.iter().map(|&point| point.into()))?;
        file.finish()?;
        let mut file = ListFile::create(dir, is_wide, ["vectorField", "points", ""])?;
        file.list(points, self.points.all.iter().map(|at| to_user(at, &manifest.root)))?;
        file.finish()?;
        self.write_boundary(is_wide, dir)
    }

    fn write_boundary(&self, is_wide: bool, dir: &Path) -> Result<()> {
        let Self { patches, faces, .. } = self;
        let mut text = header("ascii", is_wide, "polyBoundaryMesh", "boundary", "");
        let _ = writeln!(text, "{}\n(", patches.names.len());
        for ((patch, name), ends) in patches.names.iter().enumerate().zip(faces.starts.windows(2)) {
            let (kind, start, count) = (patches.type_of(patch), ends[0], ends[1] - ends[0]);
            let _ = writeln!(
                text,
                "    {name}\n    {{\n        type {kind};\n        nFaces {count};\n        startFace {start};\n    }}"
            );
        }
        text.push_str(")\n");
        let mut file = File::create(dir.join("boundary"))?;
        file.write_all(text.as_bytes())?;
        Ok(file.sync_all()?)
    }
}

/// The dictionary at the beginning of a file.
fn header(format: &str, is_wide: bool, class: &str, object: &str, note: &str) -> String {
    let bits = if is_wide { 64 } else { 32 };
    let note = if note.is_empty() { String::new() } else { format!("    note \"{note}\";\n") };
    format!(
        "FoamFile\n{{\n    version 2.0;\n    format {format};\n    arch \"LSB;label={bits};scalar=64\";\n{note}    \
         class {class};\n    location \"constant/polyMesh\";\n    object {object};\n}}\n\n"
    )
}

/// A file with lists.
struct ListFile {
    out: BufWriter<File>,
    is_wide: bool,
}

impl ListFile {
    /// Begins a file.
    fn create(dir: &Path, is_wide: bool, [class, object, note]: [&str; 3]) -> Result<Self> {
        let mut out = BufWriter::with_capacity(1 << 16, File::create(dir.join(object))?);
        out.write_all(header("binary", is_wide, class, object, note).as_bytes())?;
        Ok(Self { out, is_wide })
    }

    /// Adds a list of `count` labels.
    fn labels(&mut self, count: u64, labels: impl Iterator<Item = i64>) -> Result<()> {
        match self.is_wide {
            true => self.list(count, labels),
            false => self.list(count, labels.map(|label| label as i32)),
        }
    }

    /// Adds a list of `n` items. A list without items has no parentheses.
    fn list<T: NoUninit>(&mut self, n: u64, items: impl Iterator<Item = T>) -> Result<()> {
        let [begin, end] = if n == 0 { [""; 2] } else { ["(", ")"] };
        write!(self.out, "{n}\n{begin}")?;
        for item in items {
            uninterrupted()?;
            self.out.write_all(bytemuck::bytes_of(&item))?;
        }
        Ok(writeln!(self.out, "{end}")?)
    }

    /// Waits until the file is on disk.
    fn finish(self) -> Result<()> {
        Ok(self.out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?)
    }
}
