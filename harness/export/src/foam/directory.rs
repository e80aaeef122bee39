//! The directories `polyMesh`: one with all cells, or one for each processor.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use contract::octant::UNITS_PER_CELL;
use contract::word;

use super::lists::{ListFile, header, label_max};
use super::{Mesh, narrow};
use contract::failure::Failure;

/// The cells and faces of a directory.
#[derive(Clone, Debug, Default)]
pub struct Directory {
    /// Number of the processor.
    pub processor: u32,
    /// The cells, in ascending order.
    pub cells: Vec<u32>,
    /// The faces between two of these cells.
    pub internal: Vec<usize>,
    /// The faces in each patch of the mesh.
    pub patches: Vec<Vec<usize>>,
    /// The faces at the cells of each other processor, in the same order as there.
    pub between: BTreeMap<u32, Vec<usize>>,
}

/// The directories of the cells, of each of which the processor is given.
pub fn directories(mesh: &Mesh, processors: &[u32]) -> Vec<Directory> {
    let of = |cell: u32| processors[cell as usize];
    let count = processors.iter().max().map_or(0, |last| last + 1);
    let faces = &mesh.faces;
    let empty = |processor| Directory {
        processor,
        patches: vec![Vec::new(); faces.starts.len() - 1],
        ..Directory::default()
    };
    let mut all: Vec<Directory> = (0..count).map(empty).collect();
    (0..mesh.leaves.count()).for_each(|cell| all[of(cell) as usize].cells.push(cell));
    for (face, (&owner, &neighbour)) in faces.owner.iter().zip(&faces.neighbour).enumerate() {
        let (here, there) = (of(owner), of(neighbour));
        if here == there {
            all[here as usize].internal.push(face);
        } else {
            for (here, there) in [(here, there), (there, here)] {
                all[here as usize].between.entry(there).or_default().push(face);
            }
        }
    }
    for (patch, ends) in faces.starts.windows(2).enumerate() {
        for face in ends[0]..ends[1] {
            all[of(faces.owner[face]) as usize].patches[patch].push(face);
        }
    }
    all
}

/// In place of a number: the directory does not have the point.
const NONE: u32 = u32::MAX;

impl Directory {
    /// The faces in the order of the files.
    fn faces(&self) -> impl Iterator<Item = usize> + Clone {
        let boundary = self.patches.iter().chain(self.between.values()).flatten();
        self.internal.iter().chain(boundary).copied()
    }

    /// Writes the files into a directory. `numbers` has the number of each cell on its own processor; `is_part` if there are several.
    ///
    /// # Errors
    /// If a file cannot be written, if labels are too narrow, or if the user interrupts.
    pub fn write(
        &self,
        mesh: &Mesh,
        numbers: &[u32],
        is_part: bool,
        dir: &Path,
    ) -> Result<(), Failure> {
        let (all, options) = (&mesh.faces, mesh.options);
        let number = |cell: u32| numbers[cell as usize];
        // A face that belongs to a cell of another processor is turned.
        let turned = |face: usize| {
            self.cells.get(number(all.owner[face]) as usize) != Some(&all.owner[face])
        };
        let (points, point_numbers) = self.points(mesh);
        let faces = self.faces().count() as u64;
        let vertices: u64 = self.faces().map(|face| all.vertices(face).len() as u64).sum();
        if vertices.max(points.len() as u64) > label_max(options.foam.label) {
            return Err(narrow());
        }
        let (cells, internal) = (self.cells.len(), self.internal.len());
        let note = format!(
            "nPoints:{} nCells:{cells} nFaces:{faces} nInternalFaces:{internal}",
            points.len(),
        );
        let labels = |object: &str, note: &str, labels: &mut dyn ExactSizeIterator<Item = i64>| {
            let mut file = ListFile::create(dir, options, "labelList", object, note)?;
            file.labels(labels.len() as u64, labels)?;
            file.finish()
        };
        let order: Vec<usize> = self.faces().collect();
        let owner = |&face: &usize| {
            i64::from(number(if turned(face) { all.neighbour[face] } else { all.owner[face] }))
        };
        let neighbour = |&face: &usize| i64::from(number(all.neighbour[face]));
        labels("owner", &note, &mut order.iter().map(owner))?;
        labels("neighbour", &note, &mut self.internal.iter().map(neighbour))?;
        let words: Vec<u64> = mesh.leaves.cells().collect();
        let of_cells = |object: &str, value: &dyn Fn(usize) -> i64| {
            labels(object, "", &mut self.cells.iter().map(|&cell| value(cell as usize)))
        };
        of_cells("cellLevel", &|cell| i64::from(word::level(words[cell])))?;
        if mesh.has_sides {
            of_cells("side", &|cell| (words[cell] & 3) as i64)?;
        }
        if let Some(ranks) = &mesh.ranks {
            of_cells("rank", &|cell| i64::from(ranks[cell]))?;
        }
        let mut position = 0;
        let ends = order.iter().map(|&face| {
            position += all.vertices(face).len() as i64;
            position
        });
        let mut file = ListFile::create(dir, options, "faceCompactList", "faces", "")?;
        file.labels(faces + 1, std::iter::once(0).chain(ends))?;
        let polygon = |&face: &usize| {
            let (of_face, is_turned) = (all.vertices(face), turned(face));
            let index = move |i: usize| if is_turned && i > 0 { of_face.len() - i } else { i };
            let point = |i: usize| i64::from(point_numbers[of_face[i] as usize]);
            (0..of_face.len()).map(index).map(point)
        };
        file.labels(vertices, order.iter().flat_map(|face| polygon(face).collect::<Vec<_>>()))?;
        file.finish()?;
        let mut file = ListFile::create(dir, options, "vectorField", "points", "")?;
        let place = |&point: &u32| {
            mesh.root.to_user(mesh.points.at(point).map(|c| i64::from(c) * UNITS_PER_CELL))
        };
        file.points(points.len() as u64, points.iter().map(place))?;
        file.finish()?;
        if is_part && mesh.has_addressing() {
            // What reconstructPar needs: the numbers in the whole mesh, those of faces counted from 1 so that each has a sign.
            let signed = |&face: &usize| (face as i64 + 1) * if turned(face) { -1 } else { 1 };
            labels("faceProcAddressing", "", &mut order.iter().map(signed))?;
            labels("pointProcAddressing", "", &mut points.iter().map(|&point| i64::from(point)))?;
            of_cells("cellProcAddressing", &|cell| cell as i64)?;
            let patches = 0..self.patches.len() as i64;
            let patches: Vec<i64> = patches.chain(self.between.keys().map(|_| -1)).collect();
            labels("boundaryProcAddressing", "", &mut patches.into_iter())?;
        }
        self.write_boundary(mesh, dir)
    }

    /// The points of the faces, and the number here of each point of the mesh.
    fn points(&self, mesh: &Mesh) -> (Vec<u32>, Vec<u32>) {
        let (mut points, mut numbers) = (Vec::new(), vec![NONE; mesh.points.count() as usize]);
        for face in self.faces() {
            mesh.faces.vertices(face).iter().for_each(|&point| numbers[point as usize] = 0);
        }
        for (number, point) in numbers.iter_mut().zip(0..).filter(|(number, _)| **number != NONE) {
            *number = points.len() as u32;
            points.push(point);
        }
        (points, numbers)
    }

    fn write_boundary(&self, mesh: &Mesh, dir: &Path) -> Result<(), Failure> {
        let mut text = header("ascii", mesh.options.foam.label, "polyBoundaryMesh", "boundary", "");
        let _ = writeln!(text, "{}\n(", self.patches.len() + self.between.len());
        let mut start = self.internal.len();
        let mut entry = |name: &str, kind: &str, faces: usize, more: &str| {
            let _ = writeln!(
                text,
                "    {name}\n    {{\n        type {kind};\n        nFaces {faces};\n        startFace {start};\n{more}    }}"
            );
            start += faces;
        };
        for (patch, faces) in self.patches.iter().enumerate() {
            entry(&mesh.patches.names[patch], mesh.patches.type_of(patch), faces.len(), "");
        }
        let here = self.processor;
        for (there, faces) in &self.between {
            let more = format!(
                "        inGroups 1(processor);\n        matchTolerance 0.0001;\n        transform unknown;\n        \
                 myProcNo {here};\n        neighbProcNo {there};\n"
            );
            entry(&format!("procBoundary{here}to{there}"), "processor", faces.len(), &more);
        }
        text.push_str(")\n");
        let mut file = std::fs::File::create(dir.join("boundary"))?;
        file.write_all(text.as_bytes())?;
        Ok(file.sync_all()?)
    }
}
