//! The plan of a run: its cells, time, memory and files, estimated before it is made; and the refusal of a run that would not fit.
//!
//! First the cells are estimated roughly, from the extents and areas of facets and from the volumes of boxes. A run whose memory
//! is far from every [limit](Limit) is made without a plan. Otherwise pilot runs (`pilot`) of the same case at coarser spacings are
//! extrapolated: two of them, of which the finer has at most a 64th of the cells. A case with few cells is its own pilot.
//!
//! The memory of a rank is what it has resident after the pilots, with its facets, plus the growth of its sets. Nothing here is
//! counted as communication of the mesher. The mesher knows nothing of its planner: [`mesh`] asks before it lets it run.
//!
//! Invariants of a plan, which [`Plan::check_invariants`] executes before it is returned:
//! - it fits if and only if the tightest limit leaves what is needed; only otherwise does it name a factor, above 1, and its spacing;
//! - pilots become finer; the last one is the run itself, with its cells, if the source is the mesh, and coarser otherwise;
//! - each rank has an entry; times are finite; the leaf words take about 8 bytes for each cell.

#![deny(missing_docs)]

#[cfg(test)]
#[path = "../../tests/support/cases.rs"]
mod cases;
mod pilot;
mod room;
mod shared;
#[cfg(test)]
mod tests;
mod text;
mod volumes;

pub use room::Limit;
pub use shared::Tightest;

use bricks::facet::Facet;
use bricks::octant::{Level, ROOT_EDGE, edge};
use bricks::tree::Tree;
use mesher::error::Error;
use mesher::input::case::Case;
use mesher::input::lattice::{Bounds, Rules};
use mesher::input::quantise::Quantised;
use mesher::output::leaves;
use mesher::output::report::Report;
use mesher::output::write::Output;
use mesher::partition::area;
use mesher::partition::cost::Counts;
use mesher::partition::ownership::Ownership;
use mesher::record::Recorder;
use mesher::{Job, Options, grow};
use pilot::{Amounts, Pilots};
use ranks::{Comm, gather, uncounted};
use serde::Serialize;
use shared::Ranks;
use volumes::Volumes;

/// What a plan is made for.
struct Problem<'a> {
    /// The rules on the lattice.
    rules: &'a Rules,
    /// The bounds of all facets.
    bounds: &'a Bounds,
    /// This rank's slice of the facets.
    facets: &'a [Facet],
    /// The spacing at the surface that the case gives.
    spacing_min: f64,
    /// The parts of the boxes.
    volumes: &'a Volumes,
    /// CPU time of this rank so far, in seconds.
    time_cpu_s: f64,
    /// What is written.
    output: Option<&'a Output>,
    /// All ranks.
    comm: &'a dyn Comm,
}

/// A pilot run, coarser by some levels: the amounts of this rank. Collective.
type Pilot<'a> = &'a mut dyn FnMut(Level) -> Result<Amounts, Error>;

/// The source of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The case was meshed.
    Mesh,
    /// Two pilot runs were extrapolated.
    Pilots,
}

/// One pilot run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PilotEntry {
    /// The factor by which its spacings were larger.
    pub spacing_factor: f64,
    /// Its leaves.
    pub cells: u64,
    /// Its CPU time over all ranks, in seconds.
    pub time_cpu_s: f64,
}

/// An estimate of what a run takes. In JSON, under `schema`, `octree-mesher-plan/1`. The same on all ranks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    schema: &'static str,
    program: &'static str,
    /// Number of ranks.
    pub ranks: usize,
    /// The source of the estimate.
    pub source: Source,
    /// The pilot runs, coarsest first.
    pub pilots: Vec<PilotEntry>,
    /// Leaves of the mesh.
    pub cells: u64,
    /// CPU time over all ranks, in seconds, at the rate of the pilot runs.
    pub time_cpu_s: f64,
    /// Peak resident memory by rank, in bytes.
    pub memory_peak_bytes: Vec<u64>,
    /// Size of the leaf words (`--write words`) by rank, in bytes.
    pub words_bytes: Vec<u64>,
    /// Size of the tree (`--write htg`), in bytes.
    pub tree_bytes: u64,
    /// The limit that the run comes closest to; none if nothing limits memory.
    pub tightest: Option<Tightest>,
    /// Whether the memory suffices.
    pub fits: bool,
    /// If it does not: the least factor, a power of two, by which all spacings must be multiplied.
    pub spacing_factor_fits: Option<f64>,
    /// `spacing_min` times that factor.
    pub spacing_min_fits: Option<f64>,
}

/// Cells below which a run is too small to be planned, at a byte for each: it fits wherever the program does.
const CELLS_SMALL: f64 = 64e6;
/// Bytes per cell of a rough estimate; a quarter of it is usual.
const BYTES_ROUGH: f64 = 2.0;
/// A pilot run has at most this fraction of the cells, so that two take about 2 % of the time.
const PART_OF_CELLS: f64 = 64.0;
/// Cells of a pilot run that takes a moment, a fraction of a second.
const CELLS_MOMENT: f64 = 8.4e6;
/// Greatest number of cells of a pilot run: layers of many cells fill the far field, and only a large pilot shows how that grows.
const CELLS_PILOT: f64 = 1e9;
/// Bytes per cell of the tree's file with layers of at least four cells: the surface takes most of them, and thinner layers have fewer cells
/// for it.
const TREE_BYTES_PER_CELL: f64 = 0.055;
/// CPU time to write the leaf word of a cell, in seconds, and its part of the tree.
const TIMES_WRITTEN_S: [f64; 2] = [4e-9, 2.5e-9];
/// Bytes of the header of a file of leaf words.
const WORDS_HEADER: u64 = 128;

/// Bytes that the limit on the address space leaves this process; infinite without one.
pub fn address_space_left() -> f64 {
    room::Room::read().address_space
}

impl<'a> Problem<'a> {
    fn new(quantised: &'a Quantised, case: &Case, volumes: &'a Volumes, job: &Job<'a>) -> Self {
        Self {
            rules: &quantised.rules,
            bounds: &quantised.bounds,
            facets: &quantised.facets,
            spacing_min: case.spacing_min,
            volumes,
            output: job.options.out.as_ref(),
            time_cpu_s: job.record.phases().iter().map(|p| p.time_cpu_s).sum(),
            comm: job.comm,
        }
    }

    /// Whether the run is small for certain, from the extent of the facets alone.
    fn is_small(&self) -> bool {
        let h = edge(self.rules.level_surface);
        let layers = 2.0 * (f64::from(self.rules.layer_cells_min) + 2.0);
        let cells: f64 = (0..3)
            .map(|a| {
                let ends = [self.bounds.lo[a], self.bounds.hi[a]];
                let ends = ends.map(|x| self.rules.root.quantise(a, x).clamp(0, ROOT_EDGE));
                (ends[1] - ends[0]) as f64 / h as f64 + layers
            })
            .product();
        2.0 * (cells + self.volumes.cells()) < CELLS_SMALL
    }

    /// A rough estimate of the cells, and the part of the tightest limit that their mesh takes at most. Collective.
    fn rough(&self) -> ([f64; 2], f64) {
        let cells = self.cells_rough();
        let ranks = Ranks::gather(self.comm, Amounts::default(), 0);
        (cells, used(&ranks, cells.iter().sum()))
    }

    /// A rough estimate of the cells: around facets, and in boxes. Collective.
    fn cells_rough(&self) -> [f64; 2] {
        let face = (edge(self.rules.level_surface) as f64).powi(2);
        let faces = self.comm.sum((area::total(self.facets) / face) as u64) as f64;
        [faces * area::leaves_per_surface_cell(self.rules) as f64, self.volumes.cells()]
    }
}

/// Meshes a case, if it fits into memory or the user insists. Collective.
///
/// # Errors
/// The same on all ranks. Then nothing is left in the output directory.
pub fn mesh(
    case: &Case,
    options: &Options,
    is_forced: bool,
    comm: &dyn Comm,
    record: &mut Recorder,
) -> Result<Report, Error> {
    mesher::mesh_if(case, &mut Job::new(options, comm, record), |quantised, job| {
        let volumes = Volumes::new(&quantised.rules.boxes);
        let problem = Problem::new(quantised, case, &volumes, job);
        let pilot = &mut |shift| pilot(quantised, &volumes, shift, options, comm);
        if is_forced { Ok(()) } else { before_run(&problem, pilot) }
    })
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
    let mut job = Job::new(options, comm, record);
    let quantised = mesher::quantised(case, &mut job)?;
    let volumes = Volumes::new(&quantised.rules.boxes);
    job.record.report_status("plan");
    let problem = Problem::new(&quantised, case, &volumes, &job);
    of_case(&problem, &mut |shift| pilot(&quantised, &volumes, shift, options, comm))
}

/// A pilot run, coarser by `shift` levels: what this rank needs for it. Collective.
fn pilot(
    quantised: &Quantised,
    volumes: &Volumes,
    shift: Level,
    options: &Options,
    comm: &dyn Comm,
) -> Result<Amounts, Error> {
    let options = Options { check: false, out: None, strict: false, ..options.clone() };
    let run = |rules: Rules| {
        let mut record = Recorder::default();
        let job = &mut Job::new(&options, comm, &mut record);
        let mut base = Amounts::default();
        let count = |tree: &Tree, ownership: &Ownership| {
            base = pilot::of_base_tree(tree, &Counts::of_rank(tree, ownership));
        };
        let facets = &quantised.facets[..];
        let &Quantised { bounds, counts, .. } = quantised;
        let mesh = grow(Quantised { rules, bounds, facets, counts }, job, count)?;
        let (counts, ..) = job.phase("leaves", |comm| leaves::emit(&mesh, None, comm))?;
        Ok(pilot::of_mesh(base, &mesh, counts.total(), job, volumes))
    };
    let rules = pilot::coarser(&quantised.rules, shift);
    match run(rules.clone()) {
        // A seed may lie in a coarser cell that crosses.
        Err(_) if shift > 0 && !rules.seeds.is_empty() => run(Rules { seeds: Vec::new(), ..rules }),
        result => result,
    }
}

/// Refuses a run that would not fit. Collective.
///
/// # Errors
/// If it would not; the same on all ranks.
fn before_run(problem: &Problem, pilot: Pilot) -> Result<(), Error> {
    if problem.is_small() {
        return Ok(());
    }
    uncounted(problem.comm, || {
        let (rough, used) = problem.rough();
        if used <= 0.5 {
            return Ok(());
        }
        let plan = from_pilots(problem, rough, cells_max(rough, used, 0.0), pilot)?;
        if plan.fits { Ok(()) } else { Err(plan.refusal()) }
    })
}

/// The plan of a case, whatever it takes. Collective.
///
/// # Errors
/// If a pilot run fails.
fn of_case(problem: &Problem, pilot: Pilot) -> Result<Plan, Error> {
    uncounted(problem.comm, || {
        let (rough, used) = problem.rough();
        from_pilots(problem, rough, cells_max(rough, used, CELLS_MOMENT), pilot)
    })
}

/// The part of the tightest limit that a mesh of some cells takes at most.
fn used(ranks: &Ranks, cells: f64) -> f64 {
    let more = vec![cells * BYTES_ROUGH / ranks.count() as f64; ranks.count()];
    let part = |t: Tightest| t.needed_bytes as f64 / (t.left_bytes as f64).max(1.0);
    ranks.tightest(&more).map_or(0.0, part)
}

/// Greatest number of cells of a pilot run; `least` of them in any case. Where there is no doubt that the run does not fit, few.
fn cells_max(rough: [f64; 2], used: f64, least: f64) -> f64 {
    let cells: f64 = rough.iter().sum();
    if used > 100.0 {
        CELLS_MOMENT / 4.0
    } else {
        (cells / PART_OF_CELLS).max(least).min(CELLS_PILOT)
    }
}

/// Makes the pilot runs and extrapolates them. Collective.
fn from_pilots(
    problem: &Problem,
    rough: [f64; 2],
    cells_max: f64,
    pilot: Pilot,
) -> Result<Plan, Error> {
    let comm = problem.comm;
    let coarsest = problem.rules.level_deepest();
    let rough_at =
        |shift: Level| rough[0] / 4f64.powi(shift as i32) + rough[1] / 8f64.powi(shift as i32);
    let mut runs: Vec<(Level, Ranks)> = Vec::new();
    let mut run = |shift: Level| {
        runs.push((shift, Ranks::gather(comm, pilot(shift)?, problem.facets.len())));
        Ok::<_, Error>(extrapolation(&runs, rough[1]))
    };
    let first = (0..coarsest).find(|&s| rough_at(s) <= cells_max / 4.0).unwrap_or(coarsest);
    let mut pilots = run(first)?;
    if first > 0 {
        let last = (0..first).find(|&s| pilots.at(s).cells <= cells_max).unwrap_or(first - 1);
        if 0 < last && last + 1 < first {
            run(last + 1)?;
        }
        pilots = run(last)?;
    }
    let entry = |(shift, ranks): &(Level, Ranks)| {
        let total = ranks.total();
        let (cells, time_cpu_s) = (total.cells as u64, total.time_cpu_s());
        PilotEntry { spacing_factor: factor(*shift), cells, time_cpu_s }
    };
    let entries = runs.iter().map(entry).collect();
    let (finest, ranks) = runs.pop().expect("a pilot was run");
    let source = if finest == 0 { Source::Mesh } else { Source::Pilots };
    let at = |shift| Plan::new(source, &ranks, pilots.at(shift), ranks.growth(&pilots.at(shift)));
    let before: f64 = gather(comm, &[problem.time_cpu_s]).into_iter().sum();
    let mut plan = at(0);
    plan.pilots = entries;
    let thin = f64::max(4.0 / f64::from(problem.rules.layer_cells_min), 1.0);
    plan.tree_bytes = (plan.tree_bytes as f64 * thin) as u64;
    let written = |o: &Output| [o.words, o.tree].map(|is| f64::from(u8::from(is)));
    let written = problem.output.map_or([0.0; 2], written);
    let per_cell: f64 = written.iter().zip(TIMES_WRITTEN_S).map(|(is, time)| is * time).sum();
    plan.time_cpu_s = before + pilots.at(0).time_cpu_s() + per_cell * pilots.at(0).cells;
    plan.check_invariants();
    if !plan.fits {
        let fitting = (1..=coarsest).find(|&shift| at(shift).fits).map(factor);
        plan.spacing_factor_fits = fitting;
        plan.spacing_min_fits = fitting.map(|factor| factor * problem.spacing_min);
    }
    Ok(plan)
}

/// The factor between spacings that are some levels apart.
fn factor(shift: Level) -> f64 {
    2f64.powi(shift as i32)
}

/// The last two of some pilot runs.
fn extrapolation(runs: &[(Level, Ranks)], cells_boxed: f64) -> Pilots {
    let mut latest = runs.iter().rev().map(|(shift, ranks)| (*shift, ranks.total()));
    let fine = latest.next().expect("a pilot was run");
    Pilots { fine, coarse: latest.next(), cells_boxed }
}

impl Plan {
    /// # Panics
    /// If an invariant at the head of this file is violated.
    pub fn check_invariants(&self) {
        let lists = [&self.memory_peak_bytes, &self.words_bytes];
        assert!(lists.iter().all(|l| l.len() == self.ranks), "an entry for each rank");
        let words: u64 = self.words_bytes.iter().sum();
        assert!(words / 8 >= self.cells / 2, "{words} bytes of words for {} cells", self.cells);
        let fits = self.tightest.is_none_or(|t| t.needed_bytes <= t.left_bytes);
        assert_eq!(self.fits, fits, "the tightest limit must decide: {:?}", self.tightest);
        let factor = self.spacing_factor_fits;
        assert_eq!(factor.is_some(), self.spacing_min_fits.is_some(), "a factor and its spacing");
        assert!(factor.is_none_or(|f| !fits && f > 1.0), "{factor:?} for a plan that fits");
        let time = self.time_cpu_s;
        assert!(time.is_finite() && time >= 0.0, "{time} s of CPU time");
        let factors = |p: &[PilotEntry]| p[0].spacing_factor > p[1].spacing_factor;
        assert!(self.pilots.windows(2).all(factors), "pilots must become finer");
        let last = self.pilots.last().map(|p| (p.spacing_factor == 1.0, p.cells));
        match self.source {
            Source::Pilots => assert!(last.is_some_and(|l| !l.0), "a pilot must be coarser"),
            Source::Mesh => assert_eq!(last, Some((true, self.cells)), "the run is its own plan"),
        }
    }

    /// The plan of a mesh with these amounts, for which each rank takes as many bytes as given beyond what it has.
    fn new(source: Source, ranks: &Ranks, amounts: Amounts, more: Vec<f64>) -> Self {
        let count = ranks.count();
        let tightest = ranks.tightest(&more);
        let words = (amounts.cells / count as f64 * 8.0) as u64 + WORDS_HEADER;
        Self {
            schema: "octree-mesher-plan/1",
            program: concat!("mesher ", env!("CARGO_PKG_VERSION")),
            ranks: count,
            source,
            pilots: Vec::new(),
            cells: amounts.cells as u64,
            time_cpu_s: 0.0,
            memory_peak_bytes: ranks.peaks(&more),
            words_bytes: vec![words; count],
            tree_bytes: (amounts.cells * TREE_BYTES_PER_CELL) as u64,
            tightest,
            fits: tightest.is_none_or(|t| t.needed_bytes <= t.left_bytes),
            spacing_factor_fits: None,
            spacing_min_fits: None,
        }
    }
}
