//! `harness leak`: the widest path through an opening of the geometry, and the spacing that closes it.

use crate::options::{Input, Output, examples, point, whole_seconds};
use crate::output::put_forms;
use clap::Args;
use contract::case::Case;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, Result, progress, uninterrupted};
use contract::leafset::LeafSet;
use contract::manifest::{Keep, Leak, Manifest};
use contract::plain::PlainCase;
use geometry::leak::{Leaks, Target};
use report::pretty;
use run::engine::layout::SERIAL;
use run::engine::paths::Paths;
use run::engine::runner::Engine;
use std::cell::Cell;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// `harness leak`.
#[derive(Args, Debug)]
#[command(after_help = examples(include_str!("../../../doc/leak.md")))]
pub struct Arguments {
    /// Name in geometries/catalogue.toml or path of a case file
    case: String,
    /// Start of the path [default: a point of every region that leaked between a coarser spacing and the case's]
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    from: Option<[f64; 3]>,
    /// End of the path: a point, or `far` for the root's boundary [default: far, or a seed from what leaked into the flow of seeds]
    #[arg(long, value_name = "X,Y,Z|far", value_parser = target, allow_hyphen_values = true)]
    to: Option<Target>,
    /// Write the answer as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Time limit of every single run of the mesher
    #[arg(long, value_name = "SECONDS", default_value = "600", value_parser = whole_seconds)]
    timeout: Duration,
    /// The mesher [default: next to the harness]
    #[arg(long, value_name = "PATH")]
    mesher: Option<Input>,
}

/// Searches, prints and writes; returns the exit code.
///
/// # Errors
/// If the case cannot be read or meshed, or a file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8> {
    let paths = Paths::find();
    let mesher = Engine::find("mesher", arguments.mesher.as_deref(), &paths)?;
    let path = paths.catalogue.case_file(&arguments.case, Path::new(""))?;
    let case = Case::read(&path)?;
    let place = tempfile::tempdir()?;
    let tree = |level: u8| -> Result<LeafSet> {
        let mut plain = PlainCase::of(&case);
        if level != case.level_surface {
            // The base tree does not depend on seeds, but one in a crossing leaf of a coarser tree would be refused.
            plain.table.remove("seeds");
        }
        plain.table.insert("spacing_min".into(), case.root.edge_of(level).into());
        let file = plain.write(place.path())?;
        let mesh = mesher.mesh(&file, &SERIAL, true, (place.path(), arguments.timeout))?;
        let tree = mesher.read_mesh(&mesh)?;
        fs::remove_dir_all(mesh)?;
        Ok(tree)
    };
    let (of_case, mut unexamined) = (Cell::new(None), None);
    let make = |level| match of_case.take() {
        Some(words) if level == case.level_surface => Ok(words),
        _ => Ok(tree(level)?.words),
    };
    let mut leaks = Leaks::new(&case, make)?;
    let ends = match (arguments.from, arguments.to) {
        (Some(from), to) => vec![(from, to.unwrap_or(Target::Far))],
        (None, Some(to)) => {
            vec![(leaks.seed(to)?.ok_or_else(|| format!("the case has no seeds: {START}"))?, to)]
        }
        (None, None) => {
            progress("meshing the base tree of the case");
            let LeafSet { words, manifest, .. } = tree(case.level_surface)?;
            of_case.set(Some(words));
            let is_flow = case.keep == Keep::Outside && case.seeds.is_empty();
            let cut = if is_flow { leaks.cut()? } else { Vec::new() };
            let leaked = leaked(&case, &manifest);
            unexamined = leaked.as_ref().err().filter(|_| !cut.is_empty()).cloned();
            let leaked = if unexamined.is_some() { Vec::new() } else { leaked? };
            let regions = leaks.regions(&leaked)?.into_iter();
            // Seeds lie in the flow, into which the region leaked.
            let seed = |from| Ok((from, leaks.seed(Target::Point(from))?));
            let ends = regions.map(seed).chain(cut.into_iter().map(|at| Ok((at, None))));
            let ends = ends.collect::<Result<Vec<_>>>()?.into_iter();
            ends.map(|(from, seed)| (from, seed.map_or(Target::Far, Target::Point))).collect()
        }
    };
    let answers = leaks.answers(&ends)?;
    progress("");
    uninterrupted()?;
    if ends.is_empty() {
        println!(
            "no leak: the mesher finds no region of {} that is closed at 2 or 4 times its spacing and open at it (not examined, but for --from: a region that is open at all three, and surroundings of the body that are inside, of which the mesher warns)",
            case.name
        );
    }
    print!("{answers}");
    let is_leak = answers.examined.iter().any(|report| report.is_leak);
    let code = if is_leak { EXIT_FAILED } else { EXIT_HOLDS };
    let code = put_forms(code, &[(arguments.json.as_deref(), &|| pretty(&answers))], None)?;
    unexamined.map_or(Ok(code), |why| Err(why.into()))
}

/// What to do where there is no start.
const START: &str = "give a start with --from X,Y,Z, in the space that should be closed";

/// What leaked between coarser spacings and the case's, as the mesher reports it, if there is something that may.
fn leaked(case: &Case, manifest: &Manifest) -> Result<Vec<Leak>, String> {
    let leaks = manifest.leaks.clone();
    let leaks = leaks.ok_or_else(|| format!("the program does not report leaks: {START}"))?;
    let sides = manifest.leaves_by_side;
    // Seeds lie in the flow, and what they do not reach has the other side.
    let is_flow_inside = case.keep == Keep::Inside && !case.seeds.is_empty();
    let closed = if is_flow_inside { sides.outside } else { sides.inside };
    if leaks.is_empty() && closed == 0 {
        let fact = match case.seeds.is_empty() {
            true => {
                "no leaf is inside by its rays at this spacing, as where an opening is wider than four cells or every facet appears twice"
            }
            false => "the flow of the seeds reaches all leaves at this spacing",
        };
        return Err(format!("{fact}, so there is no closed space to examine: {START}"));
    }
    Ok(leaks)
}

fn target(text: &str) -> Result<Target, String> {
    match text {
        "far" => Ok(Target::Far),
        _ => point(text).map(Target::Point).map_err(|why| format!("{why}, or far")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_a_point_or_far() {
        assert_eq!(target("far"), Ok(Target::Far));
        assert_eq!(target("0,0,1"), Ok(Target::Point([0.0, 0.0, 1.0])));
    }
}
