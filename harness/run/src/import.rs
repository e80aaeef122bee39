//! Meshes in the formats of other programs. Those that the crate `contract` does not read are read in Python;
//! `harness/oracles/imports.py` describes how. What an engine wrote becomes a leaf-set directory: leaf words without a manifest get one,
//! and any other format is imported.

use crate::engine::description::{self, Description};
use crate::engine::failure::{CODE_INPUT, End};
use crate::engine::layout::RunOptions;
use crate::engine::paths::Paths;
use crate::python;
use contract::case::Case;
use contract::digest::Digest;
use contract::failure::{EXIT_INTERRUPTED, EXIT_MISSING, Failure, Result, named};
use contract::import::cells::Cells;
use contract::import::{self, Format, ImportedTree, Position, Request};
use contract::lattice::Root;
use contract::leafset::{self, LeafSet};
use contract::manifest::{self, Manifest, Tree};
use contract::mesh::Mesh;
use serde::Deserialize;
use serde_json::json;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use std::{fs, io};

/// A mesh that was read.
pub enum Imported {
    /// Its leaves are in memory.
    Words {
        /// The leaves.
        set: Box<LeafSet>,
        /// Whether neither a request, a case nor the file states the root.
        is_root_derived: bool,
    },
    /// Its leaves are in a tree of any size.
    Tree(Box<ImportedTree>),
}

impl Imported {
    /// The manifest of its leaves.
    pub fn manifest(&mut self) -> &mut Manifest {
        match self {
            Self::Words { set, .. } => &mut set.manifest,
            Self::Tree(tree) => &mut tree.manifest,
        }
    }

    /// Writes a leaf-set directory. A tree may become a link, so the file that was imported must remain.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn create(&self, dir: &Path, may_link: bool) -> io::Result<()> {
        match self {
            Self::Words { set, .. } => set.create(dir),
            Self::Tree(tree) if may_link => fs::create_dir_all(dir).and_then(|()| tree.link(dir)),
            Self::Tree(tree) => tree.create(dir),
        }
    }
}

/// Reads a mesh in any format, by default the one that its content shows. The root is that of the request, of the case, or of the
/// file, and else derived. The manifest states the requirements of the case, and names `program`. A child process that exceeds
/// `limit` is killed.
///
/// # Errors
/// If the file is not a usable mesh, or if what its format requires is missing.
pub fn import(
    path: &Path,
    format: Option<Format>,
    request: &Request,
    case: Option<&Case>,
    program: String,
    limit: Duration,
) -> Result<Imported> {
    let input = |error: Failure| error.of_file(path);
    let root = request.root.or(case.map(|case| case.root));
    parts(path).iter().try_for_each(|part| files::register_input(part))?;
    let format = format.map_or_else(|| import::guess(path), Ok).map_err(input)?;
    let has_use = format == Format::Table || request.position == Position::default();
    Failure::unless(has_use, "the position of cells is for tables: omit it").map_err(input)?;
    if format == Format::Vtk {
        let tree = ImportedTree::open(path, request.sides.as_deref(), root, case, program.clone());
        if let Some(tree) = tree.map_err(input)? {
            return Ok(Imported::Tree(Box::new(tree)));
        }
    }
    let request = Request { root, is_root_of_case: request.root.is_none(), ..request.clone() };
    let cells = read(path, format, &request, &Paths::find(), limit).map_err(input)?;
    let set = Box::new(import::leaf_set(&cells, root, case, program).map_err(input)?);
    Ok(Imported::Words { set, is_root_derived: root.is_none() && cells.root.is_none() })
}

/// The files of a mesh that consists of several: of a directory of OpenFOAM, and the pieces that a `.pvtu` names.
fn parts(path: &Path) -> Vec<PathBuf> {
    let within = [path.to_owned(), path.join("constant/polyMesh")];
    let entries = within.iter().filter_map(|dir| fs::read_dir(dir).ok()).flatten().flatten();
    let text = match path.extension().is_some_and(|e| e.eq_ignore_ascii_case("pvtu")) {
        true => contract::files::read_text(path).unwrap_or_default(),
        false => String::new(),
    };
    let named = text.split("Source=").skip(1).filter_map(|rest| {
        let quote = rest.chars().next()?;
        rest[quote.len_utf8()..].split(quote).next()
    });
    entries.map(|entry| entry.path()).chain(named.map(|name| path.with_file_name(name))).collect()
}

/// What a file states besides corners and edges of its cells.
#[derive(Deserialize)]
struct Stated {
    root: Option<Root>,
    has_levels: bool,
    has_sides: bool,
    digest: Option<Digest>,
}

/// Reads the cells of a file.
fn read(
    path: &Path,
    format: Format,
    request: &Request,
    paths: &Paths,
    limit: Duration,
) -> Result<Cells> {
    let (name, script) = match format {
        Format::LeafWords => return import::words::read(path, request),
        Format::P4est => return import::p4est::read(path, request),
        Format::Vtk => ("vtk", "import_vtk.py"),
        Format::Openfoam | Format::Table | Format::Discretize => ("numpy", "import_cells.py"),
    };
    let mesh = match format {
        Format::Openfoam => import::poly_mesh(path).ok_or_else(|| {
            Failure::input("has no polyMesh: give a case, its directory constant, or polyMesh, and reconstruct a decomposed mesh")
        })?,
        _ => path.to_owned(),
    };
    let place = tempfile::tempdir().map_err(Failure::unreadable)?;
    let table = place.path().join("cells");
    let mut asked = json!(request);
    (asked["format"], asked["is_case"]) = (json!(format), json!(mesh != path));
    let asked = asked.to_string();
    let arguments = [mesh.as_os_str(), table.as_os_str(), asked.as_ref()];
    let finished = python::run(name, script, arguments, paths, limit, place.path());
    let finished = finished.map_err(|failure| match &failure.end {
        End::Interrupted => Failure::interrupted(),
        End::Missing(why) => {
            Failure::missing(format!("this format is read with {name} in Python, which {why}"))
        }
        End::Exited { code: CODE_INPUT, error } => Failure::input(error),
        _ => Failure::input(format!("cannot be read: {failure}")),
    })?;
    let stated = fs::read(&finished.stdout).ok();
    let stated: Stated = stated
        .and_then(|text| serde_json::from_slice(&text).ok())
        .ok_or_else(|| Failure::input("was read, but the script reported no root"))?;
    cells(&fs::read(&table).map_err(Failure::unreadable)?, stated)
}

/// The cells of rows of numbers: corner, edge, and level and side if they are known.
fn cells(bytes: &[u8], stated: Stated) -> Result<Cells> {
    let Stated { root, has_levels, has_sides, digest } = stated;
    let (numbers, _) = bytes.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let columns = 4 + usize::from(has_levels) + usize::from(has_sides);
    let is_whole = bytes.len().is_multiple_of(8 * columns);
    Failure::unless(is_whole, "was read, but the script's table ends within a row")?;
    let mut cells = Cells { root, digest, ..Cells::default() };
    numbers.chunks_exact(columns).for_each(|row| cells.push([row[0], row[1], row[2]], row[3]));
    let rows = || numbers.chunks_exact(columns).enumerate();
    cells.levels = has_levels.then(|| rows().map(|(_, row)| row[4] as i64).collect());
    let sides = || rows().map(|(cell, row)| import::side(row[columns - 1], cell)).collect();
    cells.sides = has_sides.then(sides).transpose()?;
    Ok(cells)
}

/// What ends a path within a command of a shell.
const ENDS: [char; 11] = [' ', '\t', '\n', '\'', '"', ';', '&', '|', '<', '>', ')'];

/// The beginning of the paths that a run writes in a format that is imported: the value of `{out}`.
pub(crate) fn foreign(place: &Path) -> PathBuf {
    place.join("written/mesh")
}

/// Makes the place of these paths, empty: what an earlier run wrote must not be mistaken for this run's.
pub(crate) fn clear(place: &Path, mesh: &Path) -> std::io::Result<()> {
    let written = place.join("written");
    let _ = (fs::remove_dir_all(&written), fs::remove_dir_all(mesh));
    fs::create_dir_all(written)
}

/// The path that a command writes: `{out}` and what follows it there, such as an extension.
fn path_in(command: &Command, out: &Path) -> PathBuf {
    let out = out.to_string_lossy();
    let mut words = command.get_args().map(|word| word.to_string_lossy().into_owned());
    let end = words.find_map(|word| Some(word.split_once(&*out)?.1.to_owned())).unwrap_or_default();
    PathBuf::from(format!("{out}{}", end.split(ENDS).next().unwrap_or_default()))
}

/// Makes the mesh of a run that ended well a leaf-set directory, unless it is one, and opens it. Its manifest has the inputs of the
/// case, and names `label` as the program.
pub(crate) fn complete(
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
            let (written, name) = (written.display(), &engine.name);
            let why = format!("wrote no {written}, which {{out}} stands for in [run] of {name}");
            return unusable(why);
        }
        let case = read_case()?;
        let (sides, position) = (engine.run.sides.clone(), engine.run.position);
        // Without a root, so that what lies elsewhere is not moved.
        let request = Request { sides, position, ..Request::default() };
        let read = import(&written, Some(format), &request, Some(&case), label, options.limit);
        let mut imported = read.map_err(not_imported)?;
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
        set.manifest.write(mesh).map_err(|error| unreadable(&named(mesh, &error)))?;
    }
    Mesh::open(mesh).map_err(|error| unreadable(&error))
}

/// The end of a run whose mesh, in a format of another program, could not be imported.
fn not_imported(failure: Failure) -> End {
    let why = format!("wrote a mesh that cannot be imported: {failure}");
    match failure.code {
        EXIT_INTERRUPTED => End::Interrupted,
        EXIT_MISSING => End::Missing(why),
        _ => End::Unusable(why),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::failure::EXIT_INPUT;
    use std::os::unix::fs::PermissionsExt;

    /// Reads a file with a shell script instead of Python, which gets the table's path as $4 and the request as $5.
    fn read_with(script: &str, sides: Option<&str>) -> Result<Cells> {
        let place = tempfile::tempdir().unwrap();
        let python = place.path().join("python");
        fs::write(&python, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
        let paths = Paths { python, ..Paths::find() };
        let request = Request { sides: sides.map(str::to_owned), ..Request::default() };
        let limit = Duration::from_millis(2000);
        read(Path::new("mesh.vtu"), Format::Vtk, &request, &paths, limit)
    }

    /// A script that writes one cell, and this line.
    fn writing(line: &str) -> String {
        let row = [1.0f64, 2.0, 3.0, 0.5, 2.0];
        let bytes: Vec<u8> = row.iter().flat_map(|v| v.to_le_bytes()).collect();
        let octal: String = bytes.iter().map(|byte| format!("\\{byte:03o}")).collect();
        format!("printf '{octal}' > \"$4\"; echo '{line}'")
    }

    #[test]
    fn cells_sides_and_root_come_from_the_script() {
        let stated = r#"{"root": {"origin": [1, 2, 3], "edge": 4.0}, "has_levels": false, "has_sides": true, "digest": "000000000000000000000000000000ff"}"#;
        let script = writing(stated);
        let cells = read_with(
            &format!("case \"$3 $5\" in 'mesh.vtu {{'*'\"sides\":\"body\"'*) ;; *) exit 9 ;; esac\n{script}"),
            Some("body"),
        )
        .unwrap();
        assert_eq!((cells.corners[0], cells.edges[0]), ([1.0, 2.0, 3.0], 0.5));
        assert_eq!((cells.root.unwrap().edge, cells.digest), (4.0, Some(Digest(255))));
        assert_eq!(cells.sides, Some(vec![contract::word::Side::Crossing]));
        let nothing = r#"{"root": null, "has_levels": true, "has_sides": false, "digest": null}"#;
        let cells = read_with(&writing(nothing), None).unwrap();
        assert_eq!((cells.root, cells.sides, cells.levels), (None, None, Some(vec![2])));
    }

    #[test]
    fn each_failure_of_the_script_has_its_own_sentence() {
        let sentence = |script: &str| match read_with(script, None).unwrap_err() {
            Failure { code: EXIT_INPUT, why } => why,
            other => panic!("{other:?}"),
        };
        assert_eq!(sentence("echo has no cells >&2; exit 2"), "has no cells");
        assert_eq!(sentence("kill -11 $$"), "cannot be read: vtk was killed by signal 11");
        assert_eq!(
            sentence("sleep 60"),
            "cannot be read: vtk did not end within 2 s and was killed"
        );
        let no_table =
            r#"echo '{"root": null, "has_levels": true, "has_sides": false, "digest": null}'"#;
        assert!(sentence(no_table).starts_with("cannot be read"));
        assert!(sentence(&writing("")).contains("no root"));
        let missing = read_with("echo no module >&2; exit 3", None).unwrap_err();
        assert!(missing.code == EXIT_MISSING && missing.why.contains("no module"), "{missing}");
    }

    use proptest::prelude::*;

    proptest! {
        /// Whatever surrounds `{out}` in a word, the path begins with it and ends where a shell would end it.
        #[test]
        fn a_path_begins_with_out(before in "[a-z=-]{0,8}", rest in "[a-z./_0-9]{0,12}", after in "([ \t\n;'\"&|<>)][ -~]{0,8})?") {
            let out = Path::new("/a place/written/mesh");
            let mut command = Command::new("sh");
            command.arg("-c").arg(format!("{before}{}{rest}{after}", out.display()));
            prop_assert_eq!(path_in(&command, out), PathBuf::from(format!("{}{rest}", out.display())));
        }
    }
}
