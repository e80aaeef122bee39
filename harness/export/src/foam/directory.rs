//! The directories `polyMesh`: one with all cells, or one for each processor.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use contract::octant::UNITS_PER_CELL;
use contract::word;

use super::lists::{self, List, label_max};
use super::{Mesh, narrow};
use crate::error::ExportError;
use crate::options::Style;

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

/// The directories of the cells, of each of which the processor is given; otherwise there is one.
pub fn directories(mesh: &Mesh, processors: Option<&[u32]>) -> Vec<Directory> {
    let of = |cell: u32| processors.map_or(0, |of_cells| of_cells[cell as usize]);
    let count = processors.map_or(1, |of_cells| of_cells.iter().max().map_or(0, |last| last + 1));
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

impl Directory {
    /// The faces in the order of the files.
    fn faces(&self) -> impl Iterator<Item = usize> + Clone {
        let boundary = self.patches.iter().chain(self.between.values()).flatten();
        self.internal.iter().chain(boundary).copied()
    }

    /// Writes the files into a directory. With several processors, `numbers` has the number of each cell on its own.
    ///
    /// # Errors
    /// If a file cannot be written, if labels are too narrow, or if the user interrupts.
    pub fn write(
        &self,
        mesh: &Mesh,
        numbers: Option<&[u32]>,
        dir: &Path,
    ) -> Result<(), ExportError> {
        let all = &mesh.faces;
        let style = mesh.options.foam.style;
        let number = |cell: u32| numbers.map_or(cell, |numbers| numbers[cell as usize]);
        let is_here = |cell: u32| self.cells.get(number(cell) as usize) == Some(&cell);
        // A face that belongs to a cell of another processor is turned.
        let turned = |face: usize| !is_here(all.owner[face]);
        let points = Own::new(mesh, numbers.is_some().then(|| self.faces()));
        let (faces, vertices) = self.faces().fold((0u64, 0u64), |(faces, vertices), face| {
            (faces + 1, vertices + all.vertices(face).len() as u64)
        });
        if vertices.max(points.count()) > label_max(style.label) {
            return Err(narrow());
        }
        let note = format!(
            "nPoints:{} nCells:{} nFaces:{faces} nInternalFaces:{}",
            points.count(),
            self.cells.len(),
            self.internal.len()
        );
        let labels =
            |object: &str, note: &str, count: usize, numbers: &mut dyn Iterator<Item = i64>| {
                let count = count as u64;
                let mut list = List::create(dir, style, "labelList", object, note, count)?;
                for (i, number) in numbers.enumerate() {
                    mesh.options.check_at(i as u64)?;
                    list.label(number)?;
                }
                Ok::<_, ExportError>(list.finish(count)?)
            };
        let owner = |face: usize| {
            let of = if turned(face) { all.neighbour[face] } else { all.owner[face] };
            i64::from(number(of))
        };
        labels("owner", &note, faces as usize, &mut self.faces().map(owner))?;
        let neighbour = |&face: &usize| i64::from(number(all.neighbour[face]));
        labels("neighbour", &note, self.internal.len(), &mut self.internal.iter().map(neighbour))?;
        let words: Vec<u64> = mesh.leaves.cells().collect();
        let cells = || self.cells.iter().map(|&cell| cell as usize);
        labels(
            "cellLevel",
            "",
            self.cells.len(),
            &mut cells().map(|c| i64::from(word::level(words[c]))),
        )?;
        if mesh.has_sides {
            labels("side", "", self.cells.len(), &mut cells().map(|c| (words[c] & 3) as i64))?;
        }
        if let Some(ranks) = &mesh.ranks {
            labels("rank", "", self.cells.len(), &mut cells().map(|c| i64::from(ranks[c])))?;
        }
        let turned_face = self.faces().map(|face| (face, turned(face)));
        write_faces(mesh, &points, turned_face.clone(), (faces, vertices), dir)?;
        let mut list = List::create(dir, style, "vectorField", "points", "", points.count())?;
        for (i, point) in points.iter().enumerate() {
            mesh.options.check_at(i as u64)?;
            list.point(
                mesh.root.to_user(mesh.points.at(point).map(|c| i64::from(c) * UNITS_PER_CELL)),
            )?;
        }
        list.finish(points.count())?;
        if numbers.is_some() && mesh.has_addressing() {
            // What reconstructPar needs: the numbers in the whole mesh, those of faces counted from 1 so that each has a sign.
            let signed = |(face, turned): (usize, bool)| {
                if turned { -(face as i64 + 1) } else { face as i64 + 1 }
            };
            labels("faceProcAddressing", "", faces as usize, &mut turned_face.map(signed))?;
            labels(
                "pointProcAddressing",
                "",
                points.count() as usize,
                &mut points.iter().map(i64::from),
            )?;
            labels("cellProcAddressing", "", self.cells.len(), &mut cells().map(|c| c as i64))?;
            let (of_mesh, between) = (self.patches.len(), self.between.len());
            let mut patches = (0..of_mesh as i64).chain(std::iter::repeat_n(-1, between));
            labels("boundaryProcAddressing", "", of_mesh + between, &mut patches)?;
        }
        self.write_boundary(mesh, dir)
    }

    fn write_boundary(&self, mesh: &Mesh, dir: &Path) -> Result<(), ExportError> {
        let style = Style { is_ascii: true, ..mesh.options.foam.style };
        let mut text = lists::header(style, "polyBoundaryMesh", "boundary", "");
        let _ = writeln!(text, "{}\n(", self.patches.len() + self.between.len());
        let mut start = self.internal.len();
        let mut entry = |name: String, kind: &str, faces: usize, more: &str| {
            let _ = writeln!(
                text,
                "    {name}\n    {{\n        type {kind};\n        nFaces {faces};\n        startFace {start};\n{more}    }}"
            );
            start += faces;
        };
        for (patch, faces) in self.patches.iter().enumerate() {
            let (name, kind) = (mesh.patches.names[patch].clone(), mesh.patches.type_of(patch));
            entry(name, kind, faces.len(), "");
        }
        let here = self.processor;
        for (there, faces) in &self.between {
            let more = format!(
                "        inGroups 1(processor);\n        matchTolerance 0.0001;\n        transform unknown;\n        \
                 myProcNo {here};\n        neighbProcNo {there};\n"
            );
            entry(format!("procBoundary{here}to{there}"), "processor", faces.len(), &more);
        }
        text.push_str(")\n");
        let mut file = std::fs::File::create(dir.join("boundary"))?;
        file.write_all(text.as_bytes())?;
        Ok(file.sync_all()?)
    }
}

/// Writes faces with their directions, whose number and that of their vertices are given.
fn write_faces(
    mesh: &Mesh,
    points: &Own,
    faces: impl Iterator<Item = (usize, bool)> + Clone,
    (count, vertices): (u64, u64),
    dir: &Path,
) -> Result<(), ExportError> {
    let style = mesh.options.foam.style;
    let mut polygon = Vec::new();
    let mut of = |face: usize, is_turned: bool| {
        polygon.clear();
        polygon.extend(mesh.faces.vertices(face).iter().map(|&point| points.number(point)));
        if is_turned {
            polygon[1..].reverse();
        }
        polygon.clone()
    };
    if style.is_ascii {
        let mut list = List::create(dir, style, "faceList", "faces", "", count)?;
        for (face, is_turned) in faces {
            mesh.options.check_at(face as u64)?;
            list.face(&of(face, is_turned))?;
        }
        return Ok(list.finish(count)?);
    }
    let mut list = List::create(dir, style, "faceCompactList", "faces", "", count + 1)?;
    let mut position = 0;
    list.label(position)?;
    for (face, _) in faces.clone() {
        position += mesh.faces.vertices(face).len() as i64;
        list.label(position)?;
    }
    list.next(vertices)?;
    for (face, is_turned) in faces {
        mesh.options.check_at(face as u64)?;
        of(face, is_turned).iter().try_for_each(|&v| list.label(i64::from(v)))?;
    }
    Ok(list.finish(vertices)?)
}

/// The points of a directory: all, or those of its faces, with their numbers there.
struct Own {
    all: u32,
    numbers: Option<Vec<u32>>,
}

/// In place of a number: the directory does not have the point.
const NONE: u32 = u32::MAX;

impl Own {
    fn new(mesh: &Mesh, faces: Option<impl Iterator<Item = usize>>) -> Self {
        let all = mesh.points.count();
        let numbers = faces.map(|faces| {
            let mut numbers = vec![NONE; all as usize];
            faces.for_each(|face| {
                mesh.faces.vertices(face).iter().for_each(|&v| numbers[v as usize] = 0)
            });
            let own = numbers.iter_mut().filter(|number| **number != NONE);
            own.zip(0..).for_each(|(number, next)| *number = next);
            numbers
        });
        Self { all, numbers }
    }

    fn number(&self, point: u32) -> u32 {
        self.numbers.as_ref().map_or(point, |numbers| numbers[point as usize])
    }

    fn iter(&self) -> impl Iterator<Item = u32> {
        (0..self.all).filter(|&point| self.number(point) != NONE)
    }

    fn count(&self) -> u64 {
        self.iter().count() as u64
    }
}
