//! The files of one directory that have a label for each cell.

use std::io;
use std::path::Path;

use super::lists::List;
use super::points::Near;
use super::survey::Model;
use super::walk::Around;

/// The lists that are written cell by cell: the level of each, and its side and rank where they are known.
pub struct CellFiles {
    level: List,
    side: Option<List>,
    rank: Option<List>,
}

impl CellFiles {
    /// Begins the lists of `count` cells.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn create(model: &Model, count: u64, dir: &Path) -> io::Result<Self> {
        let list = |object: &str| labels(model, object, "", count, dir);
        Ok(Self {
            level: list("cellLevel")?,
            side: model.has_sides.then(|| list("side")).transpose()?,
            rank: model.ranks.is_some().then(|| list("rank")).transpose()?,
        })
    }

    /// Adds a cell.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn push(&mut self, model: &Model, cell: u32, around: &Around<Near>) -> io::Result<()> {
        self.level.label(i64::from(around.octant.level))?;
        if let Some(side) = &mut self.side {
            side.label(i64::from(around.side()))?;
        }
        if let (Some(rank), Some(ranks)) = (&mut self.rank, &model.ranks) {
            rank.label(i64::from(ranks.place(cell).0))?;
        }
        Ok(())
    }

    /// Ends the lists.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(self) -> io::Result<()> {
        let all = [Some(self.level), self.side, self.rank];
        all.into_iter().flatten().try_for_each(List::finish)
    }
}

/// Begins a list of labels.
///
/// # Errors
/// If the file cannot be written.
pub fn labels(model: &Model, object: &str, note: &str, count: u64, dir: &Path) -> io::Result<List> {
    List::create(dir, model.options.foam.style, "labelList", object, note, count)
}
