//! The tree in one file that VTK reads: a hyper-tree grid in VTKHDF.
//!
//! The file needs all nodes level by level, while a rank has a part of each level. So the file is made window by window
//! ([`vtkhdf::tree`]): every rank sends its nodes in a window to the rank that compresses it, and that rank sends the
//! compressed chunks to rank 0, the only one that writes. In one round each of up to `WINDOWS_MAX` ranks
//! compresses one window, so memory does not grow with the mesh, and the file does not depend on the number of ranks.

mod numbering;
mod siblings;

use crate::Mesh;
use crate::error::Error;
use crate::output::write::{OutDir, TREE};
use files::Draft;
use numbering::Numbering;
use ranks::{Comm, MessageBuffer, pack_bytes, unpack_bytes};
use siblings::{own_siblings, root};
use std::io::{self, BufWriter};
use std::iter::Peekable;
use std::ops::Range;
use vtkhdf::tree::{Chunks, Shape, Siblings, TreeWriter, Window, groups};
use vtkhdf::write::Deflater;

type TreeFile = TreeWriter<BufWriter<Draft>>;

/// Greatest number of windows of a round. One rank may have to send all of their nodes, half a byte each.
const WINDOWS_MAX: u64 = 256;

/// Writes the file. Collective.
///
/// # Errors
/// If the file cannot be written or the user interrupts the run; the same on all ranks.
pub fn write(mesh: &Mesh, out: &OutDir, comm: &dyn Comm) -> Result<(), Error> {
    let numbering = Numbering::new(mesh, comm);
    let (origin, edge) = (mesh.rules.root.origin, mesh.rules.root.edge);
    let shape = Shape { origin, edge, nodes: numbering.nodes.clone() };
    let is_first = comm.rank() == 0;
    let begin = || TreeWriter::new(out.file(TREE)?, shape.clone());
    let failed = out.failed(TREE);
    let file = is_first.then(begin).transpose().map_err(&failed);
    let mut file = ranks::agree(comm, file)?;
    let mut own = Source { siblings: own_siblings(mesh, &numbering).peekable(), last: None };
    let mut deflater = Deflater::default();
    let round = WINDOWS_MAX.min(comm.size() as u64);
    let mut begin = 0;
    while begin < shape.windows() {
        let windows = begin..shape.windows().min(begin + round);
        let mine = comm.sparse_all_to_all(own.messages(windows.clone()));
        let mut chunks = MessageBuffer::default();
        let window = begin + comm.rank() as u64;
        if windows.contains(&window) {
            let filled = fill(mesh, window, &mine);
            pack(window, &filled.compress(&shape, &mut deflater), &mut chunks);
        }
        let compressed = comm.sparse_all_to_all(chunks);
        let written = file.as_mut().map_or(Ok(()), |file| add(&compressed, file));
        ranks::agree(comm, written.map_err(&failed))?;
        begin = windows.end;
    }
    let publish = |file: TreeFile| file.finish()?.into_inner()?.publish();
    ranks::agree(comm, file.map_or(Ok(()), publish).map_err(&failed))
}

/// The nodes that this rank owns, sent window by window.
struct Source<S: Iterator<Item = (u64, Siblings)>> {
    siblings: Peekable<S>,
    /// The last siblings sent: some of them may belong to the following window.
    last: Option<(u64, Siblings)>,
}

impl<S: Iterator<Item = (u64, Siblings)>> Source<S> {
    /// The messages with this rank's nodes in some windows; window by window, they go to ranks 0, 1, ... . A message consists of
    /// runs of siblings: number of the first, how many, and the siblings in pairs.
    fn messages(&mut self, windows: Range<u64>) -> MessageBuffer {
        let mut messages = MessageBuffer::default();
        let mut found = Vec::new();
        for (to, window) in windows.enumerate() {
            let range = groups(window);
            found.clear();
            found.extend(self.last.filter(|(group, _)| range.contains(group)));
            while let Some(next) = self.siblings.next_if(|(group, _)| *group < range.end) {
                found.push(next);
            }
            self.last = found.last().copied();
            for run in found.chunk_by(|a, b| a.0 + 1 == b.0) {
                messages.append(to, |words| {
                    words.extend([run[0].0, run.len() as u64]);
                    words.extend(run.chunks(2).map(|pair| {
                        let code = |at: usize| pair.get(at).map_or(0, |&(_, s)| encode(s));
                        code(0) | code(1) << 32
                    }));
                });
            }
        }
        messages
    }
}

fn encode(s: Siblings) -> u64 {
    u64::from(u32::from_le_bytes([s.split, s.deleted, s.crossing, s.inside]))
}

fn decode(code: u32) -> Siblings {
    let [split, deleted, crossing, inside] = code.to_le_bytes();
    Siblings { split, deleted, crossing, inside }
}

/// A window with the nodes that all ranks have sent for it.
fn fill(mesh: &Mesh, window: u64, messages: &MessageBuffer) -> Window {
    let mut filled = Window::new(window);
    if window == 0 {
        // All ranks hold the root.
        filled.put_root(root(mesh));
    }
    for (_, mut words) in messages.messages() {
        while let [first, count, rest @ ..] = words {
            let (pairs, after) = rest.split_at(count.div_ceil(2) as usize);
            let codes = pairs.iter().flat_map(|&w| [w as u32, (w >> 32) as u32]);
            for (group, code) in (*first..first + count).zip(codes) {
                filled.put(group, decode(code));
            }
            words = after;
        }
    }
    filled
}

/// Appends a window's chunks to the message to rank 0: its number, then for each array the bytes of its chunk, none for no
/// chunk.
fn pack(window: u64, chunks: &Chunks, messages: &mut MessageBuffer) {
    messages.append(0, |words| {
        words.extend([window, chunks.len() as u64]);
        chunks.iter().for_each(|c| pack_bytes(c.as_deref().unwrap_or_default(), words));
    });
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
