//! The tree in one file that VTK reads: a hyper-tree grid in VTKHDF.
//!
//! The file needs all nodes level by level, while a rank has a part of each level. So the file is made window by window
//! ([`vtkhdf::tree`]): every rank sends its nodes in a window to the rank that compresses it, and that rank sends the
//! compressed chunks to rank 0, the only one that writes. In one round each of up to `WINDOWS_MAX` ranks
//! compresses one window, so memory does not grow with the mesh, and the file does not depend on the number of ranks.

use crate::Mesh;
use crate::error::{Error, agree};
use crate::output::stream::{LevelCursors, Octants};
use crate::output::write::{OutDir, TREE};
use crate::partition::ownership::{Ownership, brick_start};
use bricks::brick::{byte, children, ones, parents};
use bricks::octant::Level;
use bricks::tree::{LEVELS, Tree};
use files::Draft;
use ranks::{Comm, MessageBuffer, gather, pack_bytes, unpack_bytes};
use std::io::{self, BufWriter};
use std::iter::Peekable;
use std::ops::Range;
use vtkhdf::tree::{Chunks, Shape, Siblings, TreeWriter, Window, groups};
use vtkhdf::write::Deflater;

type TreeFile = TreeWriter<BufWriter<Draft>>;

/// Greatest number of windows of a round. One rank may have to send all of their nodes, in bricks of 40 bytes: usually one byte each.
const WINDOWS_MAX: u64 = 128;

/// Writes the file. Collective.
///
/// # Errors
/// If the file cannot be written or the user interrupts the run; the same on all ranks.
pub fn write(mesh: &Mesh, out: &OutDir, comm: &dyn Comm) -> Result<(), Error> {
    let (nodes, first) = numbering(mesh, comm);
    let (origin, edge) = (mesh.rules.root.origin, mesh.rules.root.edge);
    let shape = Shape { origin, edge, nodes };
    let begin = || TreeWriter::new(out.file(TREE)?, shape.clone());
    let failed = out.failed(TREE);
    let mut file = agree(comm, (comm.rank() == 0).then(begin).transpose().map_err(&failed))?;
    let (mut own, mut last) = (own_siblings(mesh, &first).peekable(), None);
    let mut deflater = Deflater::default();
    let round = WINDOWS_MAX.min(comm.size() as u64);
    for begin in (0..shape.windows()).step_by(round as usize) {
        let windows = begin..shape.windows().min(begin + round);
        let mine = comm.sparse_all_to_all(messages(&mut own, &mut last, windows.clone()));
        let mut chunks = MessageBuffer::default();
        let window = begin + comm.rank() as u64;
        if windows.contains(&window) {
            let compressed = fill(mesh, window, &mine).compress(&shape, &mut deflater);
            // Its number, then for each array the bytes of its chunk, none for no chunk.
            chunks.append(0, |words| {
                words.extend([window, compressed.len() as u64]);
                compressed.iter().for_each(|c| pack_bytes(c.as_deref().unwrap_or_default(), words));
            });
        }
        let compressed = comm.sparse_all_to_all(chunks);
        agree(comm, file.as_mut().map_or(Ok(()), |file| add(&compressed, file)).map_err(&failed))?;
    }
    let publish = |file: TreeFile| file.finish()?.into_inner()?.publish();
    agree(comm, file.map_or(Ok(()), publish).map_err(&failed))
}

/// Groups of siblings with the number of the first.
type Numbered = (u64, Siblings);

/// The messages with this rank's nodes in some windows; window by window, they go to ranks 0, 1, ... . A message has five words for each
/// brick. `last` is the last brick sent: some of its groups may belong to the following window.
fn messages(
    own: &mut Peekable<impl Iterator<Item = Numbered>>,
    last: &mut Option<Numbered>,
    windows: Range<u64>,
) -> MessageBuffer {
    let mut messages = MessageBuffer::default();
    for (to, window) in windows.enumerate() {
        let end = groups(window).end;
        let more = std::iter::from_fn(|| own.next_if(|(first, _)| *first < end));
        let again = last.take().filter(|(first, _)| first + 8 > groups(window).start);
        for (first, siblings) in again.into_iter().chain(more) {
            let Siblings { split, deleted, crossing, inside } = siblings;
            messages.write(to, [first, split, deleted, crossing, inside]);
            *last = Some((first, siblings));
        }
    }
    messages
}

/// A window with the nodes that all ranks have sent for it.
fn fill(mesh: &Mesh, window: u64, messages: &MessageBuffer) -> Window {
    let mut filled = Window::new(window);
    if window == 0 {
        // All ranks hold the root.
        filled.put_root(siblings(Path::new(mesh, 0).load(0, 0), 1));
    }
    for [first, split, deleted, crossing, inside] in messages.values::<[u64; 5]>() {
        filled.put(first, Siblings { split, deleted, crossing, inside });
    }
    filled
}

/// Writes the chunks that all ranks have sent, in the order of their windows.
fn add(messages: &MessageBuffer, file: &mut TreeFile) -> io::Result<()> {
    let mut messages: Vec<&[u64]> = messages.messages().map(|(_, words)| words).collect();
    messages.sort_by_key(|words| words[0]);
    for words in messages {
        let mut rest = &words[2..];
        let chunks: Chunks = std::array::from_fn(|_| {
            let (chunk, after) = unpack_bytes(rest);
            rest = after;
            (!chunk.is_empty()).then(|| chunk.to_vec())
        });
        file.add(words[0], &chunks)?;
    }
    Ok(())
}

/// Where siblings are in the file: the number of nodes of each level that has any, over all ranks, and the first number of siblings in
/// each interval of the curve, level by level. Siblings are numbered from the root's children, which have number 0, level by level, and
/// in Morton order within a level. Collective.
fn numbering(mesh: &Mesh, comm: &dyn Comm) -> (Vec<u64>, Vec<u64>) {
    let ownership = &mesh.ownership;
    let intervals = ownership.boundaries().len();
    let (mut nodes, mut first) = (vec![1], vec![0; LEVELS * intervals]);
    for l in 1..LEVELS as Level {
        let mut before = None;
        for b in Tree::exists(&mesh.split, l).filter(|b| ownership.owns(l, b.key)) {
            assert!(before.replace(b.key) < Some(b.key), "level {l}: bricks must ascend");
            first[place(ownership, l, b.key)] += u64::from(b.bits.count_ones() / 8);
        }
    }
    // Each interval has one owner, which has counted its siblings.
    let counted = (0..).zip(&first).filter(|c| *c.1 > 0);
    let counted: Vec<[u64; 2]> = counted.map(|(place, &count)| [place, count]).collect();
    for [place, count] in gather(comm, &counted) {
        first[place as usize] = count;
    }
    let mut next = 0;
    for level in first.chunks_mut(intervals) {
        let begin = next;
        for count_or_first in level {
            next += std::mem::replace(count_or_first, next);
        }
        nodes.extend((next > begin).then(|| 8 * (next - begin)));
    }
    (nodes, first)
}

/// The place in a numbering of the interval that contains the minimum corner of a brick.
fn place(ownership: &Ownership, l: Level, key: u64) -> usize {
    l as usize * ownership.boundaries().len() + ownership.at(brick_start(l, key))
}

/// The siblings in the bricks that this rank owns, with their numbers, in ascending order.
fn own_siblings(mesh: &Mesh, numbers: &[u64]) -> impl Iterator<Item = Numbered> {
    let of_level = move |l: Level| {
        let mut path = Path::new(mesh, l);
        // The place of the last brick, and the number of the next siblings.
        let (mut last, mut next) = (None, 0);
        let bricks = mesh.split[l as usize - 1].child_bricks();
        bricks.filter(move |b| mesh.ownership.owns(l, b.key)).map(move |b| {
            let place = place(&mesh.ownership, l, b.key);
            if last.replace(place) != Some(place) {
                next = numbers[place];
            }
            let first = next;
            next += u64::from(b.bits.count_ones() / 8);
            (first, siblings(path.load(l, b.key), b.bits))
        })
    };
    (1..LEVELS as Level).flat_map(of_level)
}

/// The siblings in a brick that exist; those of the groups that do not are left out.
#[inline]
fn siblings(brick: Octants, exist: u64) -> Siblings {
    let Octants { split, crossing, inside, deleted } = brick;
    let kept = exist & !split & !deleted;
    let groups = parents(exist);
    let packed = |bits: u64| match groups {
        0xff => bits,
        _ => (0..).zip(ones(groups.into())).map(|(k, j)| (bits >> (8 * j) & 0xff) << (8 * k)).sum(),
    };
    Siblings {
        split: packed(split & exist),
        deleted: packed(deleted & exist & !split),
        crossing: packed(crossing & kept),
        inside: packed(inside & kept),
    }
}

/// Readers of the sets, level by level, and the bricks that contain the current one, each with its key.
struct Path<'a>(Vec<(LevelCursors<'a>, Option<(u64, Octants)>)>);

impl<'a> Path<'a> {
    /// A path to bricks of level `deepest`.
    fn new(mesh: &'a Mesh, deepest: Level) -> Self {
        Self((0..=deepest as usize).map(|l| (LevelCursors::new(mesh, l), None)).collect())
    }

    /// Reads a brick. Keys must not descend.
    fn load(&mut self, l: Level, key: u64) -> Octants {
        if let Some((_, brick)) = self.0[l as usize].1.filter(|current| current.0 == key) {
            return brick;
        }
        let (mut crossing, mut inside) = (0, 0);
        if l > 0 {
            let above = self.load(l - 1, key >> 3);
            let below = |sides: u64| children(byte(sides & above.split, key & 7));
            (crossing, inside) = (below(above.crossing), below(above.inside));
        }
        let (cursors, current) = &mut self.0[l as usize];
        let brick = cursors.read(key, crossing, inside);
        *current = Some((key, brick));
        brick
    }
}
