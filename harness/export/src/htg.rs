//! Selected leaves as a hyper-tree grid in VTKHDF: the whole tree in one file, a twentieth of a byte per leaf. Leaves that are not
//! selected are masked.
//!
//! The file has the nodes level by level, and the leaves come in Morton order. So the nodes of all levels are in memory first, in families of eight
//! siblings of half a byte per node: about 1.2 bytes per leaf while they are put in the order of the file.

use std::io::BufWriter;
use std::path::Path;

use contract::failure::{Failure, Result};
use contract::files;
use contract::lattice::Root;
use contract::mesh::Leaf;
use contract::octant::LEVEL_MAX;
use contract::word::{self, Side};
use vtkhdf::tree::{Shape, Siblings, TreeWriter, Window, groups};
use vtkhdf::write::Deflater;

use crate::options::{Export, Summary};

/// Writes the file.
///
/// # Errors
/// If the sides of the mesh are unknown, no leaf is selected, if the mesh cannot be read or the file cannot be written, or if the user interrupts.
pub fn write(export: &Export<'_>, path: &Path) -> Result<Summary> {
    let Export { mesh, options, .. } = export;
    mesh.require_sides()?;
    let leaves = export.count()?;
    let mut families = Families::default();
    export.visit(&mut |leaf| {
        families.push(&leaf);
        Ok(())
    })?;
    let Root { origin, edge } = mesh.manifest.root;
    let below_root = families.levels[1..].iter().map(|level| 8 * level.len() as u64);
    let shape = Shape { origin, edge, nodes: std::iter::once(1).chain(below_root).collect() };
    // The root, then the groups of siblings as the file numbers them.
    let families = families.levels.concat();
    let shown = |[split, deleted, ..]: &[u8; 4]| u64::from((split | deleted).count_zeros());
    let shown: u64 = families.iter().map(shown).sum();
    assert_eq!(shown, leaves, "nodes that are neither split nor masked, and leaves");
    let named = |error| Failure::at(path, error);
    let bytes = files::fill_atomically(path, |file| {
        let out = BufWriter::with_capacity(1 << 20, file);
        let mut out = TreeWriter::new(out, shape.clone()).map_err(named)?;
        let mut deflater = Deflater::default();
        for index in 0..shape.windows() {
            options.check()?;
            let mut window = Window::new(index);
            if index == 0 {
                window.put_root(siblings(families[0]));
            }
            for group in groups(index).take_while(|&group| group + 1 < families.len() as u64) {
                window.put(group, siblings(families[group as usize + 1]));
            }
            out.add(index, &window.compress(&shape, &mut deflater)).map_err(named)?;
        }
        out.finish().map(drop).map_err(named)
    })?;
    Ok(Summary { leaves, bytes, notes: Vec::new() })
}

/// Eight siblings of four bytes instead of four words.
fn siblings(family: [u8; 4]) -> Siblings {
    let [split, deleted, crossing, inside] = family.map(u64::from);
    Siblings { split, deleted, crossing, inside }
}

/// Families of siblings, level by level, each as the bits split, deleted, crossing and inside; level 0 has the root in place of the first of its family.
#[derive(Debug, Default)]
struct Families {
    levels: Vec<Vec<[u8; 4]>>,
    /// Morton code of the last leaf. Its family and those of the octants that contain it are the last ones of their levels.
    key: u64,
}

impl Families {
    /// Adds a leaf, which follows the last one.
    fn push(&mut self, leaf: &Leaf) {
        let (key, level) = (word::key_of(leaf.octant.corner), usize::from(leaf.octant.level));
        // The first octants that differ from those of the last leaf are siblings. Below them, families are new.
        let differ = (self.key ^ key).checked_ilog2().map_or(0, |bit| LEVEL_MAX - bit as u8 / 3);
        let new = if self.levels.is_empty() { 0 } else { usize::from(differ) + 1 };
        self.key = key;
        self.levels.resize_with(self.levels.len().max(level + 1), Vec::new);
        for level in new..=level {
            self.levels[level].push([0, 0xff, 0, 0]);
        }
        for level in new.saturating_sub(1)..level {
            let ([split, deleted, ..], bit) = self.last(level, key);
            *split |= bit;
            *deleted &= !bit;
        }
        let ([_, deleted, crossing, inside], bit) = self.last(level, key);
        *deleted &= !bit;
        match leaf.side {
            Side::Crossing => *crossing |= bit,
            Side::Inside => *inside |= bit,
            Side::Outside => {}
        }
    }

    /// The last family of a level, and the bit of the octant in it that contains a level-19 cell.
    fn last(&mut self, level: usize, key: u64) -> (&mut [u8; 4], u8) {
        let digit = if level == 0 { 0 } else { (key / word::span(level as u8)) & 7 };
        let family = self.levels[level].last_mut().expect("families are added from the root on");
        (family, 1 << digit)
    }
}
