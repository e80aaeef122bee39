//! What an engine wrote, as a leaf-set directory: leaf words without a manifest get one, and any other format is imported.

use super::description::{self, Description};
use super::failure::End;
use super::layout::RunOptions;
use super::paths::Paths;
use crate::import::{Imported, import};
use contract::case::Case;
use contract::failure::{EXIT_INTERRUPTED, EXIT_MISSING};
use contract::import::{Format, Request};
use contract::leafset::{self, LeafSet};
use contract::manifest::{self, Tree};
use contract::mesh::Mesh;
use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// What ends a path within a command of a shell.
const ENDS: [char; 6] = [' ', '\'', '"', ';', '&', '|'];

/// The beginning of the paths that a run writes in a format that is imported: the value of `{out}`.
pub(super) fn foreign(place: &Path) -> PathBuf {
    place.join("written/mesh")
}

/// Makes the place of these paths, empty: what an earlier run wrote must not be mistaken for this run's.
pub(super) fn clear(place: &Path, mesh: &Path) -> std::io::Result<()> {
    let written = place.join("written");
    let _ = (fs::remove_dir_all(&written), fs::remove_dir_all(mesh));
    fs::create_dir_all(written)
}

/// The path that a command writes: `{out}` and what follows it there, such as an extension.
fn path_in(command: &Command, out: &Path) -> PathBuf {
    let out = out.to_string_lossy();
    let words = command.get_args().map(|word| word.to_string_lossy().into_owned());
    let rest = words.filter_map(|word| Some(word.split_once(&*out)?.1.to_owned())).next();
    let rest = rest.unwrap_or_default();
    PathBuf::from(format!("{out}{}", rest.split(ENDS).next().unwrap_or_default()))
}

/// Makes the mesh of a run that ended well a leaf-set directory, unless it is one, and opens it. Its manifest has the inputs of the
/// case, and names `label` as the program.
pub(super) fn complete(
    engine: &Description,
    label: String,
    command: &Command,
    case: &Path,
    mesh: &Path,
    options: &RunOptions,
) -> Result<Mesh, End> {
    let unusable = |why: String| Err(End::Unusable(why));
    let unreadable =
        |why: &dyn Display| End::Unusable(format!("wrote a mesh that cannot be read: {why}"));
    let read_case = || Case::read(case).map_err(|error| End::Unusable(error.to_string()));
    let tree = if options.ungraded { Tree::Base } else { Tree::Final };
    let is_complete = mesh.join(manifest::FILE).exists();
    if let Some(format) = engine.run.format {
        let written = path_in(command, &foreign(options.place));
        if !written.exists() {
            return unusable(format!(
                "wrote no {}, which {{out}} stands for in [run] of {}",
                written.display(),
                engine.name
            ));
        }
        let (case, limit) = (read_case()?, options.limit);
        let mut imported = imported(engine, format, &written, &case, label, limit)?;
        imported.manifest().tree = tree;
        imported.create(mesh, true).map_err(|error| unreadable(&error))?;
    } else if !is_complete && description::is_own(&engine.name) {
        // Our programs write it last: without it their mesh is incomplete.
        return unusable(format!("wrote no {}", manifest::FILE));
    } else if !mesh.exists() {
        return unusable(format!(
            "wrote no directory of leaf words {}: if it writes another format to a path that begins so, [run] of {} must state it, as in \
             format = \"vtk\"",
            mesh.display(),
            engine.name
        ));
    } else if !is_complete {
        let parts = leafset::read_parts(mesh).map_err(|error| unreadable(&error))?;
        let (names, words): (Vec<String>, Vec<Vec<u64>>) = parts.into_iter().unzip();
        let empty = read_case()?.manifest(tree, label);
        let mut set = LeafSet::new(empty, Vec::new()).with_parts(words);
        set.manifest.parts.iter_mut().zip(names).for_each(|(part, name)| part.file = name);
        let written = set.manifest.write(mesh);
        written.map_err(|error| unreadable(&format!("{}: {error}", mesh.display())))?;
    }
    Mesh::open(mesh).map_err(|error| unreadable(&error))
}

/// The mesh that a run has written in a format of another program.
fn imported(
    engine: &Description,
    format: Format,
    written: &Path,
    case: &Case,
    label: String,
    limit: Duration,
) -> Result<Imported, End> {
    let (sides, position) = (engine.run.sides.clone(), engine.run.position);
    let request = Request { sides, position, root: Some(case.root), ..Request::default() };
    let read = import(written, Some(format), &request, Some(case), label, &Paths::find(), limit);
    read.map_err(|failure| {
        let why = format!("wrote a mesh that cannot be imported: {failure}");
        match failure.code {
            EXIT_INTERRUPTED => End::Interrupted,
            EXIT_MISSING => End::Missing(why),
            _ => End::Unusable(why),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever surrounds `{out}` in a word, the path begins with it and ends where a shell would end it.
        #[test]
        fn a_path_begins_with_out(before in "[a-z=-]{0,8}", rest in "[a-z./_0-9]{0,12}", after in "([ ;'\"&|][ -~]{0,8})?") {
            let out = Path::new("/a place/written/mesh");
            let mut command = Command::new("sh");
            command.arg("-c").arg(format!("{before}{}{rest}{after}", out.display()));
            prop_assert_eq!(path_in(&command, out), PathBuf::from(format!("{}{rest}", out.display())));
        }
    }
}
