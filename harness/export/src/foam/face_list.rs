//! The faces between two directories, which are written after all others, in 3 to 5 bytes each.

/// A face of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Face {
    /// The cell.
    pub cell: u32,
    /// Index of the face among the squares of the cell.
    pub square: usize,
    /// Number of the face.
    pub number: u64,
}

/// Faces with ascending cells and numbers: what they differ by from the face before and their squares, seven bits per byte.
#[derive(Debug, Default)]
pub struct FaceList {
    bytes: Vec<u8>,
    last: Face,
    count: u64,
}

impl FaceList {
    /// Number of faces.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Adds a face.
    pub fn push(&mut self, face: Face) {
        let Face { cell, square, number } = face;
        for mut rest in [(cell - self.last.cell) as u64, square as u64, number - self.last.number] {
            while rest >= 0x80 {
                self.bytes.push(rest as u8 | 0x80);
                rest >>= 7;
            }
            self.bytes.push(rest as u8);
        }
        self.last = face;
        self.count += 1;
    }

    /// The faces.
    pub fn iter(&self) -> impl Iterator<Item = Face> + Clone {
        let mut bytes = self.bytes.iter();
        let mut next = move || {
            let (mut value, mut shift) = (0, 0);
            loop {
                let byte = *bytes.next()?;
                value |= u64::from(byte & 0x7f) << shift;
                if byte < 0x80 {
                    return Some(value);
                }
                shift += 7;
            }
        };
        let mut last = Face::default();
        std::iter::from_fn(move || {
            last.cell += next()? as u32;
            last.square = next()? as usize;
            last.number += next()?;
            Some(last)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_list_returns_its_faces(steps in prop::collection::vec((0u32..300, 0usize..20_000, 0u64..1 << 40), 0..50)) {
            let mut face = Face::default();
            let mut list = FaceList::default();
            let faces: Vec<Face> = steps.into_iter().map(|(cell, square, number)| {
                face = Face { cell: face.cell + cell, square, number: face.number + number };
                list.push(face);
                face
            }).collect();
            prop_assert_eq!(list.count(), faces.len() as u64);
            prop_assert_eq!(list.iter().collect::<Vec<_>>(), faces);
        }
    }
}
