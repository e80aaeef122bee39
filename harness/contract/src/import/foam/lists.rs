//! The lists in OpenFOAM's files, in ASCII or binary.
//!
//! An ASCII list is `N(...)`, or `N{value}` if all items are equal. A binary list is `N`, white space, `(`, the items
//! without separators, `)`. The faces of a binary mesh are a `faceCompactList`: two lists of labels, the
//! first of which holds the position of each face in the second.

use super::file::FoamFile;
use crate::import::ImportError;

impl FoamFile {
    /// The number of items of a list. Each needs at least `bytes_min` bytes of the file.
    fn count(&mut self, bytes_min: usize) -> Result<usize, ImportError> {
        let count: usize = self.number()?;
        let left = self.bytes.len() - self.at;
        if count > left / bytes_min {
            return Err(self.error(format!(
                "states {count} items, but has only {left} bytes for them: it is incomplete"
            )));
        }
        Ok(count)
    }

    /// The bytes of a binary list.
    fn raw(&mut self, count: usize, size: usize) -> Result<&[u8], ImportError> {
        if count == 0 {
            return Ok(&[]);
        }
        self.expect(b'(')?;
        let (begin, end) = (self.at, self.at + count * size);
        if self.bytes.get(end) != Some(&b')') {
            return Err(self.error(format!(
                "has no \")\" after {count} items of {size} bytes: it is incomplete or damaged"
            )));
        }
        self.at = end + 1;
        Ok(&self.bytes[begin..end])
    }

    /// A list of labels. A list of equal items has `count_uniform` at most.
    ///
    /// # Errors
    /// If the file has no such list.
    pub fn labels(&mut self, count_uniform: usize) -> Result<Vec<i64>, ImportError> {
        if self.binary {
            let size = self.label_bytes;
            let count = self.count(size)?;
            return Ok(self.raw(count, size)?.chunks_exact(size).map(label).collect());
        }
        let count: usize = self.number()?;
        if self.token()? == b"{" {
            let value = self.number()?;
            self.expect(b'}')?;
            return match count <= count_uniform {
                true => Ok(vec![value; count]),
                false => Err(self.error(format!(
                    "states {count} equal items, and at most {count_uniform} are possible"
                ))),
            };
        }
        self.at -= 1;
        if count > (self.bytes.len() - self.at) / 2 {
            return Err(self.error(format!("states {count} items: it is incomplete")));
        }
        self.parenthesised(count, Self::number)
    }

    /// The items between parentheses.
    fn parenthesised<T>(
        &mut self,
        count: usize,
        item: impl Fn(&mut Self) -> Result<T, ImportError>,
    ) -> Result<Vec<T>, ImportError> {
        self.expect(b'(')?;
        let items = (0..count).map(|_| item(self)).collect::<Result<_, _>>()?;
        self.expect(b')')?;
        Ok(items)
    }

    /// A list of points.
    ///
    /// # Errors
    /// If the file has no such list.
    pub fn points(&mut self) -> Result<Vec<[f64; 3]>, ImportError> {
        if !self.binary {
            let count = self.count(7)?;
            return self.parenthesised(count, |file| {
                file.expect(b'(')?;
                let point = [file.number()?, file.number()?, file.number()?];
                file.expect(b')')?;
                Ok(point)
            });
        }
        let size = self.scalar_bytes;
        let count = self.count(3 * size)?;
        let scalar = |bytes: &[u8]| match bytes.try_into() {
            Ok(eight) => f64::from_le_bytes(eight),
            Err(_) => f64::from(f32::from_le_bytes(bytes.try_into().expect("four or eight bytes"))),
        };
        let point = |bytes: &[u8]| [0, 1, 2].map(|a| scalar(&bytes[a * size..][..size]));
        Ok(self.raw(count, 3 * size)?.chunks_exact(3 * size).map(point).collect())
    }

    /// A list of indices below `length`. A list of equal items has `count_uniform` at most.
    ///
    /// # Errors
    /// If the file has no such list.
    pub fn indices(
        &mut self,
        count_uniform: usize,
        length: usize,
    ) -> Result<Vec<usize>, ImportError> {
        let labels = self.labels(count_uniform)?;
        self.as_indices(labels, length)
    }

    fn as_indices(&self, labels: Vec<i64>, length: usize) -> Result<Vec<usize>, ImportError> {
        let index = |(i, label): (usize, i64)| {
            let index = usize::try_from(label).ok().filter(|&index| index < length);
            index.ok_or_else(|| {
                self.error(format!("has {label} as item {i}, where {length} objects are possible"))
            })
        };
        labels.into_iter().enumerate().map(index).collect()
    }

    /// The faces: the end of each in the list of all vertices, and that list, of indices of the points.
    ///
    /// # Errors
    /// If the file has no faces of these points.
    pub fn faces(&mut self, points: usize) -> Result<(Vec<usize>, Vec<usize>), ImportError> {
        let (ends, labels) = match (self.class.as_str(), self.binary) {
            ("faceCompactList", _) => self.faces_compact()?,
            (_, false) => self.faces_listed()?,
            _ => {
                return Err(self.error(format!(
                    "is a binary {}, and faceCompactList is supported",
                    self.class
                )));
            }
        };
        Ok((ends, self.as_indices(labels, points)?))
    }

    fn faces_compact(&mut self) -> Result<(Vec<usize>, Vec<i64>), ImportError> {
        let (begins, labels) = (self.labels(0)?, self.labels(0)?);
        let sound = begins.first() == Some(&0)
            && begins.is_sorted()
            && begins.last().is_some_and(|&last| last == labels.len() as i64);
        match sound {
            true => Ok((begins[1..].iter().map(|&end| end as usize).collect(), labels)),
            false => Err(self
                .error("has positions of faces that do not ascend from 0 to the number of labels")),
        }
    }

    fn faces_listed(&mut self) -> Result<(Vec<usize>, Vec<i64>), ImportError> {
        let count = self.count(4)?;
        let (mut ends, mut labels) = (Vec::with_capacity(count), Vec::new());
        self.expect(b'(')?;
        for _ in 0..count {
            labels.extend(self.labels(0)?);
            ends.push(labels.len());
        }
        self.expect(b')')?;
        Ok((ends, labels))
    }
}

/// A label of four or eight bytes.
fn label(bytes: &[u8]) -> i64 {
    match bytes.try_into() {
        Ok(eight) => i64::from_le_bytes(eight),
        Err(_) => i64::from(i32::from_le_bytes(bytes.try_into().expect("four or eight bytes"))),
    }
}
