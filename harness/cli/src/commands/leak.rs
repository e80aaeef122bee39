//! `harness leak`: the widest path through an opening of the geometry, and the spacing that closes it.

use crate::options::{Output, point, whole_seconds, with_extension};
use clap::Args;
use contract::case::Case;
use contract::failure::{EXIT_FAILED, EXIT_HOLDS, Failure};
use contract::files::{Content, write_together};
use contract::leafset::LeafSet;
use contract::manifest::{Keep, Leak};
use contract::watch::Watch;
use export::polydata;
use geometry::leak::Leaks;
use geometry::leak::ends::Target;
use geometry::leak::report::{Answers, Passage};
use report::json::pretty;
use run::base_tree::BaseTrees;
use run::engine::interrupt;
use run::engine::programs::{Given, Programs};
use run::progress::Progress;
use std::path::Path;
use std::time::Duration;

/// `harness leak`.
#[derive(Args, Debug)]
#[command(after_help = "\
Two places are joined if a path of leaves of the base tree that no facet touches leads from one to the other, through \
shared parts of faces. The widest path is the one whose narrowest place is widest. The width of a place is the diameter \
of the largest ball centred there that no facet enters; the narrowest place is reported with bounds on the width of the \
largest ball that passes it, at most 5 % apart.

Without --from, every region is examined that is inside at a coarser spacing and outside at the case's, as the mesher \
reports it. With --to alone, the path starts at the first seed of the case that reaches the end.

Examples:
  harness leak car.toml                                  where does the body leak?
  harness leak car.toml --from 0,0,1                     does the cabin leak?
  harness leak duct.toml --from 0,0,0 --to 9,0,0         are two rooms joined?
  harness leak car.toml --from 0,0,1 --vtk leak.vtp      its path for ParaView

Exit codes: 0 no path at the case's spacing, whatever a finer one would do; 1 a path was found; 2 invalid input, or nothing to \
examine; 3 the mesher is missing; 130 interrupted.")]
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
    /// Write the paths as VTK polylines with the free width at each point
    #[arg(long, value_name = "FILE.vtp", value_parser = with_extension("vtp"))]
    vtk: Option<Output>,
    /// Time limit of every single run of the mesher
    #[arg(long, value_name = "SECONDS", default_value = "600", value_parser = whole_seconds)]
    timeout: Duration,
    /// Paths of the programs.
    #[command(flatten)]
    programs: Given,
}

/// Searches, prints and writes; returns the exit code.
///
/// # Errors
/// If the case cannot be read or meshed, or a file cannot be written.
pub fn run(arguments: &Arguments) -> Result<u8, Failure> {
    let programs = Programs::find("mesher", &arguments.programs)?;
    let path = programs.paths.catalogue.case_file(&arguments.case, Path::new(""))?;
    let case = Case::read(&path)?;
    let mut trees = BaseTrees::new(&programs.mesher, &path, &case, arguments.timeout)?;
    let progress = Progress::new();
    let (mut first, leaked) = match (arguments.from, arguments.to) {
        (None, None) => {
            progress.step("meshing the base tree of the case");
            let tree = trees.at(case.level_surface, true)?;
            let leaked = leaked(&case, &tree)?;
            (Some(tree.words), leaked)
        }
        _ => (None, Vec::new()),
    };
    let make = |level| match first.take_if(|_| level == case.level_surface) {
        Some(words) => Ok(words),
        None => Ok(trees.at(level, false)?.words),
    };
    let mut leaks = Leaks::new(&case, make, &progress)?;
    let ends = match (arguments.from, arguments.to) {
        (Some(from), to) => vec![(from, to.unwrap_or(Target::Far))],
        (None, Some(to)) => {
            let seed = leaks.seed(to)?.ok_or_else(|| format!("the case has no seeds: {START}"))?;
            vec![(seed, to)]
        }
        (None, None) => {
            let regions = leaks.regions(&leaked)?.into_iter();
            // Seeds lie in the flow, into which the region leaked.
            let seed = |from| Ok((from, leaks.seed(Target::Point(from))?));
            let ends = regions.map(seed).collect::<Result<Vec<_>, Failure>>()?.into_iter();
            ends.map(|(from, seed)| (from, seed.map_or(Target::Far, Target::Point))).collect()
        }
    };
    let answers = leaks.answers(&ends)?;
    progress.finish();
    write(arguments, &answers)?;
    if ends.is_empty() {
        println!(
            "no leak: the mesher finds no region of {} that is closed at 2 or 4 times its spacing and open at it",
            case.name
        );
    }
    print!("{answers}");
    let leaks = answers.examined.iter().any(|report| report.is_leak);
    Ok(if leaks { EXIT_FAILED } else { EXIT_HOLDS })
}

/// What to do where there is no start.
const START: &str = "give a start with --from X,Y,Z, in the space that should be closed";

/// What leaked between coarser spacings and the case's, as the mesher reports it.
fn leaked(case: &Case, tree: &LeafSet) -> Result<Vec<Leak>, String> {
    let leaks = tree.manifest.leaks.clone();
    let leaks = leaks.ok_or_else(|| format!("the program does not report leaks: {START}"))?;
    let sides = tree.manifest.leaves_by_side;
    // Seeds lie in the flow, and what they do not reach has the other side.
    let is_flow_inside = case.keep == Keep::Inside && !case.seeds.is_empty();
    let closed = if is_flow_inside { sides.outside } else { sides.inside };
    if leaks.is_empty() && closed == 0 {
        return Err(format!(
            "the facets enclose no leaf at this spacing, so there is nothing to examine: {START}"
        ));
    }
    Ok(leaks)
}

/// Writes the requested files, unless the user has interrupted.
fn write(arguments: &Arguments, answers: &Answers) -> Result<(), Failure> {
    let passages: Vec<&Passage> =
        answers.examined.iter().filter_map(|r| r.passage.as_ref()).collect();
    let json: Content<'_> = &|out| out.write_all(pretty(answers).as_bytes());
    let vtk: Content<'_> = &|out| polydata::paths(&passages, out);
    if passages.is_empty() && arguments.vtk.is_some() {
        eprintln!(
            "harness: there is no path, so --vtk writes nothing: a file of this name is from an earlier run"
        );
    }
    let of_path = arguments.vtk.as_deref().filter(|_| !passages.is_empty());
    let all = [(arguments.json.as_deref(), json), (of_path, vtk)];
    let files: Vec<_> = all.into_iter().filter_map(|(file, fill)| Some((file?, fill))).collect();
    if interrupt::requested() {
        return Err(Failure::interrupted());
    }
    write_together(&files)
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
