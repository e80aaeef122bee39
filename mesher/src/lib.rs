//! Off-body hexahedral oct-tree meshes around facets, on any number of ranks, after O'Connell and
//! Karman, "Advances in Parallelization For Large Scale Oct-Tree Mesh Generation".
//!
//! [`mesh()`] runs ten phases, each in a module: 1 read, 2 quantise, 3 partition, 4 refine, 5 repartition after refinement, 6 sides,
//! 7 gradation, 8 repartition after gradation, 9 leaves, 10 finish; 3 to 8 are called in `grow.rs`. Each phase ends with a
//! check of the invariants of what it has made ([`check`]). The mesh is a function of the facets and the rules alone (see
//! `reference/DEFINITION.md`), not of the ranks, the partitioner or the base level.

#![deny(missing_docs)]

pub mod agreement;
pub mod brick;
pub mod brickset;
pub mod case;
pub mod check;
pub mod comm;
pub mod digest;
pub mod dilate;
pub mod error;
pub mod exposed;
pub mod facet;
pub mod grade;
mod grow;
pub mod htg;
pub mod ingest;
pub mod kept;
pub mod lattice;
pub mod leaves;
pub mod manifest;
mod mesh;
pub mod octant;
pub mod partition;
pub mod plan;
pub mod quantise;
pub mod record;
pub mod refine;
pub mod report;
pub mod sides;
pub mod stl;
pub mod stream;
pub mod tree;
pub mod voxelise;
mod wide;
pub mod write;

pub use mesh::{Mesh, Options};

use case::Case;
use check::debug_check;
use comm::Comm;
use error::Error;
use files::interrupt::stop_at;
use grow::grow;
use lattice::Rules;
use manifest::LeakEntry;
use octant::Level;
use partition::cost::Counts;
use partition::ownership::Ownership;
use plan::pilot::{Amounts, Collector};
use plan::{Plan, Volumes};
use quantise::Quantised;
use record::Recorder;
use report::{Counters, Report};
use tree::Tree;
use write::OutDir;

/// Meshes a case: all ten phases. The recorder keeps this rank's times; the report is the same on all ranks. Collective.
///
/// # Errors
/// The same on all ranks. Then nothing is left in the output directory.
pub fn mesh(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Report, Error> {
    let out = options.out.as_ref().map(|output| OutDir::claim(output, comm)).transpose()?;
    let report = mesh_into(out.as_ref(), case, options, comm, record)?;
    stop_at(format_args!("complete:{}", comm.rank()));
    if let Some(out) = out {
        out.keep();
    }
    Ok(report)
}

fn mesh_into(
    out: Option<&OutDir>,
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Report, Error> {
    let mut counters = Counters::default();
    let mesh = make(case, options, comm, record, &mut counters)?;

    // 9. Leaves: streamed in Morton order into the digest, and to disk on request; and the tree, level by level.
    let (counts, written, heaviest) =
        record.phase("leaves", comm, || leaves::emit(&mesh, out, comm))?;
    debug_check(options, comm, || check::leaves(&mesh, &counts, &written, comm));

    if let Some(out) = out.filter(|out| out.output.tree) {
        record.phase("tree file", comm, || htg::write(&mesh, out, out.output.cell_ranks, comm))?;
    }

    // 10. Finish: sums over the ranks, and the manifest.
    let totals =
        record.phase("finish", comm, || leaves::finish(&mesh, &counts, &written, out, comm))?;
    counters.leaves = written.leaves;
    counters.base_leaf_cells_max = heaviest;
    // The number of rays is a sum over the ranks, the same on all.
    counters.rays = if comm.rank() == 0 { mesh.sides.rays } else { 0 };
    counters.add_traffic(comm.traffic());
    debug_check(options, comm, || check::totals(&totals, &written, comm));
    Ok(Report::gather(&mesh, &totals, &counters, record, comm))
}

/// The leaf words that this rank owns, in order, a summary of the components and the leaks: phases 1 to 8, and no report.
/// Collective.
pub fn words(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
) -> Result<(Vec<u64>, sides::Summary, Vec<LeakEntry>), Error> {
    let mesh = make(case, options, comm, &mut Recorder::default(), &mut Counters::default())?;
    let mut words = Vec::new();
    mesh.leaves().emit(|w| {
        words.extend_from_slice(w);
        Ok::<(), Error>(())
    })?;
    Ok((words, mesh.sides.summary, LeakEntry::of(&mesh)))
}

/// The plan of a case: what a run with these options takes. Makes pilot runs and no mesh. Collective.
///
/// # Errors
/// The same on all ranks.
pub fn plan(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Plan, Error> {
    let quantised = quantised(case, options, comm, record)?;
    let volumes = Volumes::new(&quantised.rules.boxes);
    record.report_status("plan");
    plan::of_case(&quantised.problem(case, &volumes, options, comm, record), &mut |shift| {
        pilot(&quantised, &volumes, shift, options, comm)
    })
}

impl Quantised {
    fn problem<'a>(
        &'a self,
        case: &Case,
        volumes: &'a Volumes,
        options: &'a Options,
        comm: &'a dyn Comm,
        record: &Recorder,
    ) -> plan::Problem<'a> {
        plan::Problem {
            rules: &self.rules,
            bounds: &self.bounds,
            facets: &self.facets,
            facets_total: self.counts.total,
            spacing_min: case.spacing_min,
            volumes,
            output: options.out.as_ref(),
            time_cpu_s: record.phases().iter().map(|p| p.time_cpu_s).sum(),
            comm,
        }
    }
}

/// Phases 1 and 2. Collective.
fn quantised(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Quantised, Error> {
    // 1. Read: each rank reads its slice of the facets.
    let slice = record.phase("read", comm, || ingest::read(&case.source, comm))?;
    debug_check(options, comm, || check::slices(&slice, comm));

    // 2. Quantise: the facets and the rules on the lattice.
    let given = if check::is_on(options) { slice.facets.clone() } else { Vec::new() };
    let quantised = record.phase("quantise", comm, || quantise::quantise(case, slice, comm))?;
    debug_check(options, comm, || {
        check::rules(&quantised.rules, comm);
        check::lattice(&given, case, &quantised);
    });
    Ok(quantised)
}

/// A pilot run, coarser by `shift` levels: what this rank needs for it. Collective.
fn pilot(
    quantised: &Quantised,
    volumes: &Volumes,
    shift: Level,
    options: &Options,
    comm: &dyn Comm,
) -> Result<Amounts, Error> {
    let options =
        Options { check: false, out: None, weight_exposed: None, strict: false, ..options.clone() };
    let run = |rules: Rules| {
        let (mut record, mut counters) = (Recorder::default(), Counters::default());
        let mut collector = Collector::default();
        let count = &mut |tree: &Tree, ownership: &Ownership| {
            collector.base_tree(tree, &Counts::of_rank(tree, ownership));
        };
        let facets = (&quantised.facets[..], quantised.counts);
        let mesh = grow(facets, rules, &options, comm, &mut record, &mut counters, count)?;
        let (_, written, _) = record.phase("leaves", comm, || leaves::emit(&mesh, None, comm))?;
        Ok(collector.finish(&mesh, written.leaves, &counters, &record, volumes))
    };
    let rules = plan::pilot::coarser(&quantised.rules, shift);
    match run(rules.clone()) {
        // A seed may lie in a coarser cell that crosses.
        Err(_) if shift > 0 && !rules.seeds.is_empty() => run(Rules { seeds: Vec::new(), ..rules }),
        result => result,
    }
}

/// Phases 1 to 8, which make the tree. Collective.
fn make(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
    record: &mut Recorder,
    counters: &mut Counters,
) -> Result<Mesh, Error> {
    let quantised = quantised(case, options, comm, record)?;
    let volumes = Volumes::new(&quantised.rules.boxes);
    let planned = plan::before_run(
        &quantised.problem(case, &volumes, options, comm, record),
        options.force,
        record.shows_progress(),
        &mut |shift| pilot(&quantised, &volumes, shift, options, comm),
    )?;
    if let Some(plan) = planned {
        record.report_plan(&plan.line());
    }
    let Quantised { rules, facets, counts, .. } = quantised;
    grow((facets, counts), rules, options, comm, record, counters, &mut |_, _| {})
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::comm::{Solo, sim};
    use crate::lattice::{Enclosed, Keep};
    use case::{BoxSpec, RootSpec};
    use geometries::{Generator, Shape};

    pub fn case() -> Case {
        let extent = BoxSpec { min: [-0.2; 3], max: [0.9, 0.2, 0.2], spacing: 0.03 };
        Case {
            source: ingest::Source::Generated(Generator::new(Shape::Sphere, 1280)),
            spacing_min: 0.01,
            layer_cells_min: 4,
            keep: Keep::Outside,
            keep_crossing: true,
            root: RootSpec::Scale(4.0),
            boxes: vec![extent],
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
        }
    }

    pub fn options() -> Options {
        Options { force: true, ..Options::default() }
    }

    /// The sums over the ranks of pilots that are coarser by 2, 1 and 0 levels.
    fn pilots(ranks: usize) -> (Vec<Amounts>, f64) {
        let options = options();
        let on_rank = |comm: &dyn Comm| {
            let quantised = quantised(&case(), &options, comm, &mut Recorder::default()).unwrap();
            let volumes = Volumes::new(&quantised.rules.boxes);
            let run = |shift| pilot(&quantised, &volumes, shift, &options, comm).unwrap();
            ([2, 1, 0].map(run), volumes.cells())
        };
        let all = match ranks {
            1 => vec![on_rank(&Solo)],
            _ => sim::run(ranks, 7, |comm| on_rank(comm)),
        };
        let sum = |i: usize| Amounts::sum(all.iter().map(|(amounts, _)| amounts[i]));
        ((0..3).map(sum).collect(), all[0].1)
    }

    #[test]
    fn two_pilot_runs_predict_the_mesh() {
        let (amounts, cells_boxed) = pilots(1);
        let [coarse, fine, mesh] = amounts[..] else { unreachable!("three runs") };
        // A single rank has no other phases.
        assert!(mesh.time_fixed_s.abs() < 1e-9, "{mesh:?}");
        for time in [mesh.time_refine_s, mesh.time_sides_s, mesh.time_leaves_s] {
            assert!(time > 0.0 && time < 0.95 * mesh.time_cpu_s(), "{mesh:?}");
        }
        let counted = |a: &Amounts| {
            [a.cells, a.cells_boxed_deleted, a.tests, a.components, a.bytes_sides, a.bytes_graded]
        };
        // These repeat exactly: a change of what is counted shows here.
        assert_eq!(
            counted(&mesh),
            [764868.0, 27894.96431997696, 22726.6, 20723.0, 313493.0, 195327.0]
        );
        assert!(mesh.cells_boxed_deleted > 1000.0 && mesh.cells > 1e5, "{mesh:?}");
        let pilots =
            plan::pilot::Pilots { fine: (1, fine), coarse: Some((2, coarse)), cells_boxed };
        let predicted = pilots.at(0);
        for (name, predicted, measured) in [
            ("cells", predicted.cells, mesh.cells),
            ("bytes", predicted.bytes(), mesh.bytes()),
            ("tests", predicted.tests, mesh.tests),
        ] {
            let error = predicted / measured - 1.0;
            assert!(error.abs() < 0.2, "{name}: {predicted} for {measured}");
        }
    }

    #[test]
    fn pilot_runs_do_without_seeds_in_cells_that_only_they_cross() {
        let run = |x: f64, shift: Level| {
            let case = Case { seeds: vec![[x, 0.0, 0.0]], boxes: Vec::new(), ..case() };
            let quantised = quantised(&case, &options(), &Solo, &mut Recorder::default())?;
            pilot(&quantised, &Volumes::new(&[]), shift, &options(), &Solo)
        };
        // The sphere has radius 0.5, a pilot that is coarser by three levels has cells of 0.0625.
        assert!(run(0.53, 3).is_ok() && run(0.7, 3).is_ok());
        assert!(matches!(run(0.5, 0), Err(Error::Input(_))));
    }

    #[test]
    fn pilot_runs_on_several_ranks_have_the_cells_of_one() {
        let [one, three] = [1, 3].map(|ranks| pilots(ranks).0);
        for (one, three) in one.iter().zip(&three) {
            assert_eq!(one.cells, three.cells);
            // Several ranks also route facets and move boundaries.
            assert!(three.time_fixed_s > 0.0 && three.time_fixed_s < three.time_cpu_s());
            assert!((one.cells_boxed_deleted - three.cells_boxed_deleted).abs() < 1e-6);
        }
    }
}
