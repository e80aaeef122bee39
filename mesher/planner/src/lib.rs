//! The plan of a run: its cells, time, memory and files, estimated before it is made; and the refusal of a run that would not fit.
//!
//! First the cells are estimated roughly, from the areas of facets and the volumes of boxes. A run whose memory is far from every
//! [limit](Tightest) is made without a plan. Otherwise pilot runs (`pilot`) of the same case at ever finer spacings are made, at least
//! two, as long as they have at most a 64th of the cells or take a moment, and the last two are extrapolated. A case with few cells is its own pilot.
//!
//! The memory of a rank is what it has resident after the pilots plus the growth of its sets. Nothing here is
//! counted as communication of the mesher. The mesher knows nothing of its planner: [`mesh`] asks before it lets it run.
//!
//! Invariants of a plan, which [`Plan::check_invariants`] executes before it is returned:
//! - pilots become finer; if the last one is the run itself, the cells are its cells;
//! - times are finite; the leaf words take about 8 bytes for each cell.

mod memory;
mod pilot;
#[cfg(test)]
mod tests;

pub use memory::{Tightest, address_space_left};

use bricks::octant::Level;
use memory::Ranks;
use mesher::error::Error;
use mesher::input::case::Case;
use mesher::input::lattice::Rules;
use mesher::input::quantise::Quantised;
use mesher::output::leaves;
use mesher::output::report::{Report, grouped};
use mesher::output::stream::total;
use mesher::partition::{Division, PAPER_DEPTH, area};
use mesher::record::Recorder;
use mesher::{Job, Options, grow};
use pilot::{Amounts, Pilot, boxed_in};
use ranks::{Comm, gather, uncounted};
use serde::Serialize;
use std::fmt;

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

/// An estimate of what a run takes. In JSON, under `schema`, `octree-mesher-plan/2`. The same on all ranks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    schema: &'static str,
    /// Number of ranks.
    pub ranks: usize,
    /// The pilot runs, coarsest first.
    pub pilots: Vec<PilotEntry>,
    /// Whether one of the last two is without the seeds, as they lie in its crossing cells.
    pub is_without_seeds: bool,
    /// Leaves of the mesh.
    pub cells: u64,
    /// CPU time over all ranks, in seconds, at the rate of the pilot runs.
    pub time_cpu_s: f64,
    /// Peak resident memory by rank, in bytes.
    pub memory_peak_bytes: Vec<u64>,
    /// Size of the leaf words (`--write words`) of a rank, in bytes.
    pub words_bytes: u64,
    /// Size of the tree (`--write htg`), in bytes.
    pub tree_bytes: u64,
    /// The limit that the run comes closest to; none if nothing limits memory.
    pub tightest: Option<Tightest>,
    /// Whether the memory suffices.
    pub fits: bool,
    /// If it does not: the least factor, a power of two, by which all spacings must be multiplied.
    pub spacing_factor_fits: Option<f64>,
}

/// Cells below which a run is too small to be planned, at a byte for each: it fits wherever the program does.
const CELLS_SMALL: f64 = 64e6;
/// Bytes per cell of a rough estimate; a quarter of it is usual.
const BYTES_ROUGH: f64 = 2.0;
/// Part of the memory that a rough estimate of a run with layers of four cells takes which does certainly not fit. Cells of thicker layers
/// take less, down to a sixteenth.
const USED_UNDOUBTED: f64 = 8.0;
/// A pilot run has at most this fraction of the cells, so that all of them take about 2 % of the time.
const PART_OF_CELLS: f64 = 64.0;
/// Cells of a pilot run that takes a moment, a fraction of a second. Of layers thicker than four cells up to 16 times as many take no longer.
const CELLS_MOMENT: f64 = 8.4e6;
/// Bytes per cell of the tree's file with layers of at least four cells: the surface takes most of them, and thinner layers have fewer cells
/// for it.
const TREE_BYTES_PER_CELL: f64 = 0.055;
/// CPU time to write the leaf word of a cell, in seconds, and its part of the tree.
const TIMES_WRITTEN_S: [f64; 2] = [4e-9, 2.5e-9];
/// Bytes of the header of a file of leaf words.
const WORDS_HEADER: u64 = 128;
/// Bytes of the tree's file but for its cells.
const TREE_HEADER: u64 = 1850;

/// What a plan is made for. The functions of this type are collective.
struct Problem<'a> {
    rules: &'a Rules,
    /// A rough estimate of the cells: around facets, and in boxes.
    rough: [f64; 2],
    /// CPU time of all ranks before the mesh, and to write a cell, in seconds.
    times_s: [f64; 2],
    /// Bytes of the tree's file for a cell.
    tree_bytes_per_cell: f64,
    comm: &'a dyn Comm,
}

/// Makes a pilot run that is coarser by some levels, and returns the amounts of this rank, and whether it is without the seeds.
type Run<'a> = &'a mut dyn FnMut(Level) -> Result<(Amounts, bool), Error>;

/// Meshes a case, if it fits into memory or the user insists. Collective.
///
/// # Errors
/// The same on all ranks. Then nothing is left in the output directory.
pub fn mesh(case: &Case, is_forced: bool, job: &mut Job) -> Result<Report, Error> {
    mesher::mesh(case, job, |quantised, job| {
        if is_forced {
            return Ok(());
        }
        job.record.report_status("plan");
        let run = &mut |shift| pilot(quantised, shift, job);
        uncounted(job.comm, || Problem::new(quantised, job).check(run))
    })
}

/// The plan of a case: what a run with these options takes. Makes pilot runs and no mesh. Collective.
///
/// # Errors
/// The same on all ranks.
pub fn plan(case: &Case, job: &mut Job) -> Result<Plan, Error> {
    let quantised = mesher::quantised(case, job)?;
    job.record.report_status("plan");
    let run = &mut |shift| pilot(&quantised, shift, job);
    uncounted(job.comm, || Problem::new(&quantised, job).plan(run))
}

/// A pilot run, coarser by `shift` levels: what this rank needs for it, and whether it is without the seeds. Collective.
fn pilot(quantised: &Quantised, shift: Level, job: &Job) -> Result<(Amounts, bool), Error> {
    let run = |rules: Rules, division: Division| {
        let options = job.options.clone();
        let options = Options { division, check: false, out: None, strict: false, ..options };
        let mut record = Recorder::default();
        let job = &mut Job::new(&options, job.comm, &mut record);
        let facets = &quantised.facets[..];
        let counts = quantised.counts;
        let mesh = grow(Quantised { rules, facets, counts }, job)?;
        let (counts, ..) = job.phase("leaves", |comm| leaves::emit(&mesh, None, comm))?;
        Ok(pilot::amounts(&mesh, total(&counts), job, &quantised.rules.boxes))
    };
    let rules = pilot::coarser(&quantised.rules, shift);
    let own = job.options.division;
    let mut result = run(rules.clone(), own);
    // METIS may have too few base leaves for the ranks where those of the pilot are coarser.
    let shallowest = rules.boxes.iter().map(|b| b.level).fold(rules.level_surface, Level::min);
    let is_coarser = shift > 0 && shallowest < own.level_base.unwrap_or(PAPER_DEPTH);
    let other = if is_coarser { Division::default() } else { own };
    if result.is_err() && other != own {
        result = run(rules.clone(), other);
    }
    // A seed may lie in a coarser cell that crosses.
    let may_cross = !rules.seeds.is_empty() && rules.seeds.iter().all(|seed| seed.is_in_root());
    let is_unseeded = result.is_err() && shift > 0 && may_cross;
    if is_unseeded {
        result = run(Rules { seeds: Vec::new(), ..rules }, other);
    }
    result.map(|amounts| (amounts, is_unseeded))
}

impl<'a> Problem<'a> {
    fn new(quantised: &'a Quantised, job: &Job<'a>) -> Self {
        let rules = &quantised.rules;
        let around_facets = area::leaves_at_surface(&quantised.facets, rules, job.comm);
        let before: f64 = job.record.phases.iter().map(|p| p.time_cpu_s).sum();
        let written = job.options.out.as_ref().map_or([false; 2], |o| [o.words, o.tree]);
        // The surface takes as much of T0, which has no layers, as of layers of two cells.
        let layers = if job.options.ungraded { 2.0 } else { f64::from(rules.layer_cells_min) };
        let times = written.iter().zip(TIMES_WRITTEN_S).filter(|(is, _)| **is);
        Self {
            rules,
            rough: [around_facets, boxed_in(&rules.boxes, 0, 0)],
            times_s: [gather(job.comm, &[before]).iter().sum(), times.map(|(_, time)| time).sum()],
            tree_bytes_per_cell: TREE_BYTES_PER_CELL * f64::max(4.0 / layers, 1.0),
            comm: job.comm,
        }
    }

    /// The part of the tightest limit that the run takes at most, by the rough estimate.
    fn used_rough(&self) -> f64 {
        let ranks = Ranks::gather(self.comm, Amounts::default());
        let more = self.rough.iter().sum::<f64>() * BYTES_ROUGH / self.comm.size() as f64;
        let part = |t: Tightest| t.needed_bytes as f64 / (t.left_bytes as f64).max(1.0);
        ranks.tightest(&vec![more; self.comm.size()]).map_or(0.0, part)
    }

    /// Refuses a run that would not fit.
    fn check(&self, run: Run) -> Result<(), Error> {
        if self.rough.iter().sum::<f64>() < CELLS_SMALL || self.used_rough() <= 0.5 {
            return Ok(());
        }
        let plan = self.plan(run)?;
        if plan.fits { Ok(()) } else { Err(plan.refusal()) }
    }

    /// Makes the pilot runs and extrapolates them.
    fn plan(&self, run: Run) -> Result<Plan, Error> {
        let coarsest = self.rules.level_deepest();
        let [rough, rough_boxed] = self.rough;
        let fine = Vec::from_iter(self.rules.boxes.iter().filter(|b| b.level == coarsest).copied());
        let part_deepest = boxed_in(&fine, 0, 0) / rough_boxed.max(1.0);
        let rough_at = |s: Level| rough / 4f64.powi(s as i32) + rough_boxed / 8f64.powi(s as i32);
        // Without doubt that the run does not fit, its pilots are short.
        let thick = (f64::from(self.rules.layer_cells_min) / 4.0).clamp(1.0, 16.0);
        let doubted = if self.used_rough() > USED_UNDOUBTED * thick { 0.0 } else { rough_at(0) };
        let cells_max = (doubted / PART_OF_CELLS).max(CELLS_MOMENT * thick);
        let first = (0..coarsest).find(|&s| rough_at(s) <= cells_max / 4.0).unwrap_or(coarsest);
        let mut pilots = Vec::new();
        let (mut coarser, mut before) = (None, false);
        for shift in (0..=first).rev() {
            let (amounts, is_unseeded) = run(shift)?;
            let ranks = Ranks::gather(self.comm, amounts);
            let amounts = ranks.total();
            pilots.push(PilotEntry {
                spacing_factor: 2f64.powi(shift as i32),
                cells: amounts.cells as u64,
                time_cpu_s: amounts.time_cpu_s(),
            });
            let pilot = Pilot { shift, amounts, coarser, cells_boxed: rough_boxed, part_deepest };
            let next = shift - shift.min(1);
            // A pilot also makes the cells in boxes that it deletes.
            let cells = pilot.at(next).cells.max(rough_boxed / 8f64.powi(next as i32));
            if shift == 0 || coarser.is_some() && cells > cells_max {
                let plan = self.plan_of(pilots, &pilot, &ranks);
                return Ok(Plan { is_without_seeds: is_unseeded || before && shift > 0, ..plan });
            }
            (coarser, before) = (Some(amounts), is_unseeded);
        }
        unreachable!("the last pilot is the run itself")
    }

    /// The plan that the last pilot run results in.
    fn plan_of(&self, pilots: Vec<PilotEntry>, pilot: &Pilot, ranks: &Ranks) -> Plan {
        let tightest_at = |shift| ranks.tightest(&ranks.growth(&pilot.at(shift)));
        let fits = |t: Option<Tightest>| t.is_none_or(|t| t.needed_bytes <= t.left_bytes);
        let fitting = (0..=self.rules.level_deepest()).find(|&s| fits(tightest_at(s)));
        let ([before, written], cells) = (self.times_s, pilot.at(0).cells);
        let plan = Plan {
            schema: "octree-mesher-plan/2",
            is_without_seeds: false,
            ranks: self.comm.size(),
            pilots,
            cells: cells as u64,
            time_cpu_s: before + pilot.at(0).time_cpu_s() + written * cells,
            memory_peak_bytes: ranks.peaks(&ranks.growth(&pilot.at(0))),
            words_bytes: (cells / self.comm.size() as f64 * 8.0) as u64 + WORDS_HEADER,
            tree_bytes: (cells * self.tree_bytes_per_cell) as u64 + TREE_HEADER,
            tightest: tightest_at(0),
            fits: fitting == Some(0),
            spacing_factor_fits: fitting.filter(|s| *s > 0).map(|s| 2f64.powi(s as i32)),
        };
        plan.check_invariants();
        plan
    }
}

impl Plan {
    /// # Panics
    /// If an invariant at the head of this file is violated.
    pub fn check_invariants(&self) {
        let words = self.words_bytes * self.ranks as u64;
        assert!(words / 8 >= self.cells / 2, "{words} bytes of words for {} cells", self.cells);
        let time = self.time_cpu_s;
        assert!(time.is_finite() && time >= 0.0, "{time} s of CPU time");
        let factors = |p: &[PilotEntry]| p[0].spacing_factor > p[1].spacing_factor;
        assert!(self.pilots.windows(2).all(factors), "pilots must become finer");
        let last = self.pilots.last().expect("a pilot");
        let is_own = last.spacing_factor > 1.0 || last.cells == self.cells;
        assert!(is_own, "the run is its own plan: {last:?}");
    }

    /// The error that refuses a run that does not fit.
    pub fn refusal(&self) -> Error {
        let Tightest { limit, left_bytes, needed_bytes } = self.tightest.expect("a limit too low");
        let fitting = match self.spacing_factor_fits {
            Some(factor) => format!("multiply all spacings by {factor}, which fits"),
            None => "no spacing of this case fits".into(),
        };
        let (cells, [needed, left]) = (self.about(), [needed_bytes, left_bytes].map(bytes));
        let doubt = self.doubt();
        Error::memory(format!(
            "the mesh would have {cells} cells and need {needed} of memory, but the {limit} has {left} left: {fitting}, use more machines, or \
             try with --force{doubt}"
        ))
    }

    /// What makes the estimate unsafe, if anything does.
    fn doubt(&self) -> &'static str {
        let why = "; seeds lie in crossing cells of a pilot run, whose sides are by rays, so this may be far off";
        if self.is_without_seeds { why } else { "" }
    }

    /// The number of cells, to the precision of its source.
    fn about(&self) -> String {
        match self.pilots.last() {
            Some(last) if last.spacing_factor > 1.0 => format!("about {:.1e}", self.cells as f64),
            _ => grouped(self.cells),
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "cells          {}{}", self.about(), self.doubt())?;
        writeln!(f, "time           {:.2} s of CPU time over all ranks", self.time_cpu_s)?;
        let peaks = &self.memory_peak_bytes;
        let [all, most] = [peaks.iter().sum(), peaks.iter().copied().max().unwrap_or(0)].map(bytes);
        writeln!(f, "peak memory    {all} over all ranks, {most} on a rank at most")?;
        let [words, tree] = [self.words_bytes, self.tree_bytes].map(bytes);
        writeln!(f, "files          leaf words of {words} per rank; or a tree up to {tree}")?;
        let Some(Tightest { limit, left_bytes, needed_bytes }) = self.tightest else {
            return write!(f, "fits           no limit is known");
        };
        let fits = if self.fits { "yes" } else { "no" };
        let [needed, left] = [needed_bytes, left_bytes].map(bytes);
        write!(f, "fits           {fits}: needs {needed} more, the {limit} has {left} left")
    }
}

/// A number of bytes with three digits.
fn bytes(n: u64) -> String {
    let units = ["bytes", "kB", "MB", "GB", "TB", "PB", "EB"];
    let power = n.max(1).ilog10() / 3;
    let value = n as f64 / 1000f64.powi(power as i32);
    let digits = usize::from(power > 0 && value < 100.0);
    format!("{value:.digits$} {}", units[power as usize])
}
