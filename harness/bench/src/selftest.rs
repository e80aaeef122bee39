//! Generates a mesh of a requested size and its T0 for the self test.

use crate::experiments::entry::{Comm, Setup};
use crate::experiments::execute::{Failed, Runner};
use crate::experiments::sizing::Sizes;
use crate::experiments::variant::Base;
use check::selftest::scale::Source;
use run::engine::launcher::Launcher;
use run::engine::layout::SERIAL;
use run::engine::options::RunOptions;
use run::engine::programs::Programs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Writes the mesh of a case file and its T0 into `place`. If `cells` is given, the spacing is chosen for about that many
/// cells.
///
/// # Errors
/// If the case is invalid or the mesher fails.
pub fn source(
    programs: &Programs,
    case: &Path,
    cells: Option<u64>,
    place: &Path,
    limit: Duration,
) -> Result<Source, Failed> {
    let base = Base::read(case, place).map_err(Failed::Reason)?;
    let n = base.layer_cells_min;
    let path = match cells {
        None => base.in_own_root(base.spacing_min, n),
        Some(cells) => base.variant(spacing(programs, &base, cells, place, limit)?, n),
    };
    let path = path.map_err(Failed::Reason)?;
    let mut made = Vec::new();
    for (name, ungraded) in [("mesh", false), ("base", true)] {
        let out = place.join(format!("{}-{name}", base.name));
        let options = RunOptions {
            mesh: Some(&out),
            report: false,
            ungraded,
            ..RunOptions::new(place, limit)
        };
        programs.mesher.run(&path, &SERIAL, &options)?;
        made.push(out);
    }
    let [mesh, base_tree] = <[PathBuf; 2]>::try_from(made).expect("two meshes were made");
    Ok(Source { name: base.name, mesh, base: Some(base_tree) })
}

/// Returns the spacing that gives about `cells` cells.
fn spacing(
    programs: &Programs,
    base: &Base,
    cells: u64,
    place: &Path,
    limit: Duration,
) -> Result<f64, Failed> {
    let launcher = Launcher::parse("mpirun -n {ranks}").expect("the template contains {ranks}");
    let runner = Runner { programs, launcher: &launcher, limit, place };
    let count = |spacing_min: f64| {
        let layer_cells_min = base.layer_cells_min;
        let setup = Setup {
            experiment: String::new(),
            engine: "mesher".to_owned(),
            case: base.name.clone(),
            spacing_min,
            layer_cells_min,
            ranks: 1,
            comm: Comm::Solo,
            partitioner: String::new(),
            weights: String::new(),
            weight_exposed: None,
        };
        let case = base.variant(spacing_min, layer_cells_min).map_err(Failed::Reason)?;
        runner.run(&setup, &case, 0, true).map(|run| run.cells)
    };
    Sizes::default().spacing(cells as f64, base.coarse(), count)
}
