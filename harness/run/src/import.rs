//! Meshes in the formats of other programs. VTK reads its own formats, in Python; `harness/oracles/import_vtk.py` describes
//! how. The crate `contract` reads all others.

use crate::engine::failure::{End, Failure};
use crate::engine::paths::Paths;
use crate::engine::python;
use contract::digest::Digest;
use contract::import::cells::Cells;
use contract::import::{self, Format, ImportError, Request};
use contract::lattice::Root;
use serde::Deserialize;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Exit code of the script for a file that is not such a mesh.
const CODE_INPUT: i32 = 2;
/// The field of sides in the table that the script writes.
const SIDES: &str = "side";

/// Why a mesh was not imported.
#[derive(Debug)]
pub enum Refusal {
    /// The file is not a usable mesh.
    Input(ImportError),
    /// Python or VTK is missing.
    Missing(String),
    /// The user interrupted the harness.
    Interrupted,
}

impl Refusal {
    /// The same with the file's name.
    #[must_use]
    pub fn of_file(self, path: &Path) -> Self {
        match self {
            Self::Input(error) => Self::Input(error.of_file(path)),
            other => other,
        }
    }
}

impl From<ImportError> for Refusal {
    fn from(error: ImportError) -> Self {
        Self::Input(error)
    }
}

/// Reads the cells of a file in any format. A child process that exceeds `limit` is killed.
///
/// # Errors
/// If the file is not a mesh of this format, or if what its format requires is missing.
pub fn read(
    path: &Path,
    format: Format,
    request: &Request,
    paths: &Paths,
    limit: Duration,
) -> Result<Cells, Refusal> {
    match format {
        Format::Vtk => read_vtk(path, request, paths, limit),
        _ => Ok(import::read(path, format, request)?),
    }
}

fn read_vtk(
    path: &Path,
    request: &Request,
    paths: &Paths,
    limit: Duration,
) -> Result<Cells, Refusal> {
    let place = tempfile::tempdir().map_err(ImportError::from)?;
    let table = place.path().join("cells.npy");
    let files = [path.as_os_str(), table.as_os_str()];
    let arguments = files.into_iter().chain(request.sides.iter().map(OsStr::new));
    let finished = python::run("vtk", "import_vtk.py", arguments, paths, limit, place.path())
        .map_err(|failure| refusal(&failure))?;
    let Stated { root, has_sides, digest } = fs::read(&finished.stdout)
        .ok()
        .and_then(|text| serde_json::from_slice(&text).ok())
        .ok_or_else(|| ImportError::content("was read, but the script reported no root"))?;
    let sides = has_sides.then(|| SIDES.to_owned());
    let cells = import::npy::read(&table, &Request { sides, ..Request::default() })?;
    Ok(Cells { root, digest, ..cells })
}

/// What a file states besides its cells.
#[derive(Deserialize)]
struct Stated {
    root: Option<Root>,
    has_sides: bool,
    digest: Option<Digest>,
}

fn refusal(failure: &Failure) -> Refusal {
    match &failure.end {
        End::Interrupted => Refusal::Interrupted,
        End::Missing(why) => Refusal::Missing(format!("VTK's formats need VTK, and it {why}")),
        End::Exited { code: CODE_INPUT, error } => Refusal::Input(ImportError::content(error)),
        _ => Refusal::Input(ImportError::content(format!("cannot be read: {failure}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// Reads a file with a shell script instead of Python, which gets the table's path as $4 and the array's name as $5.
    fn read_with(script: &str, sides: Option<&str>) -> Result<Cells, Refusal> {
        let place = tempfile::tempdir().unwrap();
        let python = place.path().join("python");
        fs::write(&python, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
        let paths = Paths { python, ..Paths::find() };
        let request = Request { sides: sides.map(str::to_owned), ..Request::default() };
        read(Path::new("mesh.vtu"), Format::Vtk, &request, &paths, Duration::from_millis(2000))
    }

    /// A script that writes one cell, and this line.
    fn writing(line: &str) -> String {
        let text = "{'descr': [('x', '<f8'), ('y', '<f8'), ('z', '<f8'), ('edge', '<f8'), ('side', '|u1')], \
                    'fortran_order': False, 'shape': (1,), }\n";
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        [1.0f64, 2.0, 3.0, 0.5].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.push(2);
        let octal: String = bytes.iter().map(|byte| format!("\\{byte:03o}")).collect();
        format!("printf '{octal}' > \"$4\"; echo '{line}'")
    }

    #[test]
    fn cells_sides_and_root_come_from_the_script() {
        let stated = r#"{"root": {"origin": [1, 2, 3], "edge": 4.0}, "has_sides": true, "digest": "000000000000000000000000000000ff"}"#;
        let script = writing(stated);
        let cells = read_with(
            &format!("[ \"$3 $5\" = 'mesh.vtu body' ] || exit 9\n{script}"),
            Some("body"),
        )
        .unwrap();
        assert_eq!((cells.corners[0], cells.edges[0]), ([1.0, 2.0, 3.0], 0.5));
        assert_eq!((cells.root.unwrap().edge, cells.digest), (4.0, Some(Digest(255))));
        assert_eq!(cells.sides, Some(vec![contract::word::Side::Crossing]));
        let nothing = r#"{"root": null, "has_sides": false, "digest": null}"#;
        let cells = read_with(&writing(nothing), None).unwrap();
        assert_eq!((cells.root, cells.sides), (None, None));
    }

    #[test]
    fn each_failure_of_the_script_has_its_own_sentence() {
        let sentence = |script: &str| match read_with(script, None).unwrap_err() {
            Refusal::Input(error) => error.to_string(),
            other => panic!("{other:?}"),
        };
        assert_eq!(sentence("echo has no cells >&2; exit 2"), "has no cells");
        assert_eq!(sentence("kill -11 $$"), "cannot be read: vtk was killed by signal 11");
        assert_eq!(
            sentence("sleep 60"),
            "cannot be read: vtk did not end within 2 s and was killed"
        );
        let no_table = r#"echo '{"root": null, "has_sides": false, "digest": null}'"#;
        assert!(sentence(no_table).starts_with("cannot be read"));
        assert!(sentence(&writing("")).contains("no root"));
        let missing = read_with("echo no module >&2; exit 3", None).unwrap_err();
        assert!(matches!(missing, Refusal::Missing(why) if why.contains("no module")));
    }
}
