//! The faces of the mesh towards the body: those at which leaves on a side border crossing leaves, deleted or not. A near-body
//! mesh meets the off-body mesh there, so they are work for the ranks that own the leaves.
//!
//! A face of a leaf is counted once if crossing leaves cover it. If they cover part of it, each quarter that is a crossing
//! leaf's is counted: touching leaves differ by at most one level.
//!
//! Crossing leaves are few, so they are moved by one position in each of the six directions and sent to the ranks that hold the
//! bricks in which they arrive. There, bit operations find the leaves of the same level, of the next finer one, and of the next coarser
//! one. Nothing is done per leaf.

use crate::mesh::Mesh;
use crate::partition::ownership::Ownership;
use bricks::brick::{self, AXES, Brick};
use bricks::brickset::{BrickSet, ones};
use bricks::octant::{self, Level};
use bricks::tree::{PerLevel, per_level};
use ranks::{Comm, MessageBuffer};
use std::collections::BTreeMap;

/// The six directions: an axis, and whether it is followed upwards.
const DIRECTIONS: [(usize, bool); 6] =
    [(0, false), (0, true), (1, false), (1, true), (2, false), (2, true)];

/// Exposed faces of the leaves in a brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InBrick {
    /// The brick's level.
    pub level: Level,
    /// The brick's key.
    pub key: u64,
    /// Number of exposed faces.
    pub faces: u32,
}

/// The exposed faces in bricks that this rank owns; a brick may occur several times. The mesh must be graded. Collective.
pub fn faces(mesh: &Mesh, comm: &dyn Comm) -> Vec<InBrick> {
    let mut search = Search { mesh, crossing: crossing(mesh), found: Vec::new() };
    let rules = &mesh.rules;
    for l in rules.level_surface.max(1)..=rules.level_deepest() {
        let arrived = search.moved(l);
        let (arrived, _) = mesh.ownership.redistribute(l, arrived, comm);
        for (set, direction) in arrived.iter().zip(DIRECTIONS) {
            search.same_and_finer(l, set, direction);
        }
        // All leaves that touch a crossing leaf of the surface level are in its layer, if that has two cells. Deeper ones may have been split
        // after their level was swept.
        if l > rules.level_surface || rules.layer_cells_min < 2 {
            let quarters = MessageBuffer::of_entries(search.quarters(l, &arrived));
            search.coarser(l - 1, comm.sparse_all_to_all(quarters).words());
        }
    }
    search.found
}

/// The number of faces in bricks that this rank owns, of the faces that all ranks found, perhaps before a repartition. Collective.
pub fn owned(found: &[InBrick], ownership: &Ownership, comm: &dyn Comm) -> u64 {
    let mut by_owner: BTreeMap<usize, u64> = BTreeMap::new();
    for brick in found {
        *by_owner.entry(ownership.owner(brick.level, brick.key)).or_default() +=
            u64::from(brick.faces);
    }
    let messages =
        MessageBuffer::of_entries(by_owner.into_iter().map(|(rank, n)| (rank, [n])).collect());
    comm.sparse_all_to_all(messages).words().iter().sum()
}

/// The octants in crossing leaves of T0: these and, where gradation has split one, all that it consists of.
fn crossing(mesh: &Mesh) -> PerLevel {
    let mut crossing = per_level();
    for l in 0..crossing.len() {
        crossing[l] = mesh.crossing[l].clone();
        if l > 0 {
            let mut split = mesh.split[l - 1].cursor();
            let mut divided = crossing[l - 1].clone();
            divided.retain(|b| b.bits & split.get(b.key));
            let mut children = BrickSet::default();
            divided.child_bricks().for_each(|b| children.push(b.key, b.bits));
            crossing[l] = std::mem::take(&mut crossing[l]).union(children);
        }
    }
    crossing
}

struct Search<'a> {
    mesh: &'a Mesh,
    /// Octants in crossing leaves of T0, split or not.
    crossing: PerLevel,
    found: Vec<InBrick>,
}

impl Search<'_> {
    /// The face neighbours, in each direction, of the crossing leaves of level `l` in bricks that this rank owns.
    fn moved(&self, l: Level) -> [BrickSet; 6] {
        let mut split = self.mesh.split[l as usize].cursor();
        let leaves: Vec<Brick> = self.crossing[l as usize]
            .bricks()
            .filter(|b| self.mesh.ownership.owns(l, b.key))
            .map(|b| Brick { bits: b.bits & !split.get(b.key), ..b })
            .collect();
        DIRECTIONS.map(|(axis, up)| {
            let mut bricks = Vec::new();
            for b in leaves.iter().filter(|b| b.bits != 0) {
                let within = brick::moved(b.bits, axis, up) & brick::valid(l);
                bricks.push(Brick { key: b.key, bits: within });
                let beyond = brick::across(b.bits, axis, up);
                let next = (l >= 2).then(|| octant::neighbour(l - 2, b.key, axis, up)).flatten();
                bricks.extend(next.map(|key| Brick { key, bits: beyond }));
            }
            BrickSet::from_unsorted(bricks)
        })
    }

    /// The octants of a brick of level `l` that exist.
    fn existing(&self, l: Level, key: u64) -> u64 {
        match l {
            0 => 1,
            _ => {
                let above = self.mesh.split[l as usize - 1].get(key >> 3);
                brick::children(brick::byte(above, key & 7))
            }
        }
    }

    /// The octants of a brick that are neither split, nor in a crossing leaf, nor deleted.
    fn on_a_side(&self, l: Level, key: u64) -> u64 {
        let l = l as usize;
        let deleted = &self.mesh.sides.deleted()[l];
        !(self.mesh.split[l].get(key) | self.crossing[l].get(key) | deleted.get(key))
    }

    /// Counts the faces of leaves on a side in a brick of level `l`, if this rank owns it.
    fn count(&mut self, level: Level, key: u64, among: u64) {
        if among != 0 && self.mesh.ownership.owns(level, key) {
            let leaves = among & self.existing(level, key) & self.on_a_side(level, key);
            let faces = leaves.count_ones();
            self.found.extend((faces > 0).then_some(InBrick { level, key, faces }));
        }
    }

    /// Counts the leaves of level `l`, and of the next finer one, in the octants at which crossing leaves of level `l` arrived.
    fn same_and_finer(&mut self, l: Level, arrived: &BrickSet, (axis, up): (usize, bool)) {
        // The half of every group of eight siblings from which the crossing leaves came.
        let lower = AXES[axis][0] | AXES[axis][2];
        let half = if up { lower } else { !lower };
        for b in arrived.bricks() {
            self.count(l, b.key, b.bits);
            let split = b.bits & self.mesh.split[l as usize].get(b.key);
            for j in ones(u64::from(brick::parents(split))).map(u64::from) {
                let below = brick::children(brick::byte(split, j));
                self.count(l + 1, b.key << 3 | j, below & half);
            }
        }
    }

    /// The parents, of level `l - 1`, of octants that do not exist and at which crossing leaves arrived, in bricks that this rank owns: to
    /// their owners, each code with the number of faces that one direction exposes.
    fn quarters(&self, l: Level, arrived: &[BrickSet; 6]) -> Vec<(usize, [u64; 2])> {
        let ownership = &self.mesh.ownership;
        let mut quarters = Vec::new();
        for b in arrived.iter().flat_map(BrickSet::bricks).filter(|b| ownership.owns(l, b.key)) {
            let missing = b.bits & !self.existing(l, b.key);
            for j in ones(u64::from(brick::parents(missing))).map(u64::from) {
                // Four quarters are one face.
                let faces = match brick::byte(missing, j).count_ones() {
                    4 => 1,
                    few => few,
                };
                let owner = ownership.owner(l - 1, b.key >> 3);
                quarters.push((owner, [b.key << 3 | j, u64::from(faces)]));
            }
        }
        quarters
    }

    /// Counts the faces of octants of a level, given by code, that are leaves on a side.
    fn coarser(&mut self, level: Level, quarters: &[u64]) {
        for &[code, faces] in quarters.as_chunks().0 {
            let key = code >> 6;
            if (self.existing(level, key) & self.on_a_side(level, key)) >> (code & 63) & 1 == 1 {
                self.found.push(InBrick { level, key, faces: faces as u32 });
            }
        }
    }
}
