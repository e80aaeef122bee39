//! The selected leaves of a mesh in pieces of limited size: consecutive along the Morton curve, and computed independently.

use std::ops::Range;

use crate::error::ExportError;
use crate::leaf::Leaf;
use crate::mesh::{Block, Mesh, Visitor};
use crate::options::Options;
use crate::ordered::in_order;
use crate::selection::Selection;

/// A range of Morton codes and the number of selected leaves in it, which is not 0.
pub type Piece = Block;

/// The selected leaves in pieces of at most `leaves_max`, in order. Pieces depend on the mesh and the selection alone.
///
/// # Errors
/// If no leaf is selected, if the mesh cannot be read, or if the user interrupts.
pub fn pieces(
    mesh: &Mesh,
    selection: &Selection,
    leaves_max: u64,
    options: &Options<'_>,
) -> Result<Vec<Piece>, ExportError> {
    let blocks = mesh.blocks(selection, leaves_max)?;
    let visitor = mesh.visitor();
    let mut pieces: Vec<Piece> = Vec::new();
    let add = |_: usize, block: Block| {
        match pieces.last_mut() {
            Some(last) if last.leaves + block.leaves <= leaves_max => {
                last.keys.end = block.keys.end;
                last.leaves += block.leaves;
            }
            _ => pieces.extend((block.leaves > 0).then_some(block)),
        }
        Ok::<_, ExportError>(())
    };
    let count = |index: usize| {
        let Block { keys, leaves } = blocks[index].clone();
        let all = *selection == Selection::default();
        let leaves = if all { leaves } else { count(&visitor, keys.clone(), selection, options)? };
        Ok(Block { keys, leaves })
    };
    in_order(blocks.len(), options.jobs, count, add)?;
    if pieces.is_empty() { Err(nothing_selected(mesh)) } else { Ok(pieces) }
}

/// The error of an export without leaves.
pub(crate) fn nothing_selected(mesh: &Mesh) -> ExportError {
    let why = match mesh.is_empty() {
        true => "the mesh has no leaves",
        false => "no leaf satisfies all conditions of the selection: remove one of them",
    };
    ExportError::Request(why.to_owned())
}

/// Number of selected leaves with these Morton codes.
fn count(
    visitor: &Visitor,
    keys: Range<u64>,
    selection: &Selection,
    options: &Options<'_>,
) -> Result<u64, ExportError> {
    options.check()?;
    let mut leaves = 0;
    visitor.visit(keys, selection, &mut |_: Leaf| {
        leaves += 1;
        Ok::<(), ExportError>(())
    })?;
    Ok(leaves)
}
