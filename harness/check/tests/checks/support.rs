//! Correct meshes for tests, made by the reference and passed through files.

use std::path::Path;

use check::selftest::{self, SelftestCase};
use contract::case::Case;
use contract::leafset;
use reference::write::{self, Which};

/// Final mesh and T0 of a built-in case.
pub fn built_in(name: &str) -> SelftestCase {
    selftest_case(name, &selftest::cases()[name])
}

/// Final mesh and T0 of a case file with this text, which includes the geometry.
pub fn selftest_case(name: &str, text: &str) -> SelftestCase {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(format!("{name}.toml"));
    std::fs::write(&path, text).unwrap();
    read_meshes(&path, dir.path())
}

/// Final mesh and T0 of a body given as facets, or the errors of the harness and of the reference if both refuse the
/// case. `text` is the case file without the geometry.
pub fn meshes_of_facets(
    text: &str,
    facets: &[geometries::Facet],
) -> Result<SelftestCase, [String; 2]> {
    let dir = tempfile::tempdir().unwrap();
    let stl = std::fs::File::create(dir.path().join("body.stl")).unwrap();
    geometries::write_stl_binary(facets, stl).unwrap();
    let path = dir.path().join("body.toml");
    std::fs::write(&path, format!("geometry = \"body.stl\"\n{text}")).unwrap();
    match (Case::read(&path), reference::mesh(&reference::case_file::read(&path).unwrap())) {
        (Err(a), Err(b)) => Err([a.to_string(), b.to_string()]),
        (a, b) => {
            let (a, b) = (a.err(), b.err());
            assert!(a.is_none() && b.is_none(), "one refuses the case: {a:?}, {b:?}");
            Ok(read_meshes(&path, dir.path()))
        }
    }
}

fn read_meshes(path: &Path, dir: &Path) -> SelftestCase {
    let given = reference::case_file::read(path).unwrap();
    let write = |which, name: &str, mesh| {
        let dir = dir.join(name);
        write::leaf_set(write::claim(&dir).unwrap(), &dir, which, &given, &mesh).unwrap();
        let mut set = leafset::read(&dir).unwrap();
        // Positions in the manifest, which errors name, must not depend on the version.
        set.manifest.program = "another version".to_owned();
        set
    };
    SelftestCase {
        case: Case::read(path).unwrap(),
        mesh: write(Which::Final, "mesh", reference::mesh(&given).unwrap()),
        base: write(Which::Base, "base", reference::base_tree(&given).unwrap()),
    }
}
