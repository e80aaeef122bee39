//! The plan of a run: its cells, time, memory and files, estimated before it is made; and the refusal of a run that would not fit.
//!
//! First the cells are estimated roughly, from the extents and areas of facets and from the volumes of boxes. A run whose memory
//! is far from every [limit](Limit) needs no more. Otherwise [pilot runs](pilot) of the same case at coarser spacings are
//! extrapolated: two of them, of which the finer has at most a 64th of the cells. A case with few cells is its own pilot.
//!
//! The memory of a rank is what it has resident after the pilots, with its facets, plus the growth of its sets. Nothing here is
//! counted as communication of the mesher.

pub mod pilot;
mod ranks;
mod room;
mod text;
mod volumes;

pub use ranks::Tightest;
pub use room::Limit;
pub use volumes::Volumes;

use crate::comm::{Comm, uncounted};
use crate::error::Error;
use crate::facet::Facet;
use crate::lattice::{Bounds, Rules};
use crate::octant::{Level, ROOT_EDGE, edge};
use crate::partition::area;
use pilot::{Amounts, Pilots};
use ranks::Ranks;
use serde::Serialize;

/// What a plan is made for.
pub struct Problem<'a> {
    /// The rules on the lattice.
    pub rules: &'a Rules,
    /// The bounds of all facets.
    pub bounds: &'a Bounds,
    /// This rank's slice of the facets.
    pub facets: &'a [Facet],
    /// Number of facets on all ranks.
    pub facets_total: u64,
    /// The spacing at the surface that the case gives.
    pub spacing_min: f64,
    /// The parts of the boxes.
    pub volumes: &'a Volumes,
    /// CPU time of this rank so far, in seconds.
    pub time_cpu_s: f64,
    /// All ranks.
    pub comm: &'a dyn Comm,
}

/// A pilot run, coarser by some levels: the amounts of this rank. Collective.
pub type Pilot<'a> = &'a mut dyn FnMut(Level) -> Result<Amounts, Error>;

/// The source of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The case was meshed.
    Mesh,
    /// Two pilot runs were extrapolated.
    Pilots,
    /// The areas of facets and the volumes of boxes: a guess.
    Areas,
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
    /// CPU time over all ranks, in seconds, at the rate of the pilot runs; none without any.
    pub time_cpu_s: Option<f64>,
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
/// Bytes per cell that are usual.
const BYTES_USUAL: f64 = 0.6;
/// A pilot run has at most this fraction of the cells, so that two take about 2 % of the time.
const PART_OF_CELLS: f64 = 64.0;
/// Cells per facet below which pilot runs would take more than that, because their time does not fall with the cells.
const CELLS_PER_FACET: f64 = 2048.0;
/// Cells of a pilot run that takes a moment, a fraction of a second.
const CELLS_MOMENT: f64 = 8.4e6;
/// Greatest number of cells of a pilot run.
const CELLS_PILOT: f64 = 67e6;
/// Bytes per cell of the tree's file.
const TREE_BYTES_PER_CELL: f64 = 0.055;
/// Bytes of the header of a file of leaf words.
const WORDS_HEADER: u64 = 128;

/// Bytes that the limit on the address space leaves this process; infinite without one.
pub fn address_space_left() -> f64 {
    room::Room::read().address_space
}

impl Problem<'_> {
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

    /// A rough estimate of the cells: around facets, and in boxes. Collective.
    fn cells_rough(&self) -> [f64; 2] {
        let face = (edge(self.rules.level_surface) as f64).powi(2);
        let faces = self.comm.sum((area::total(self.facets) / face) as u64) as f64;
        [faces * area::leaves_per_surface_cell(self.rules) as f64, self.volumes.cells()]
    }
}

/// The plan of a run that is about to be made: only if it `is_shown` or might not fit. Collective.
///
/// # Errors
/// If the run would not fit and is not forced; the same on all ranks.
pub fn before_run(
    problem: &Problem,
    is_forced: bool,
    is_shown: bool,
    pilot: Pilot,
) -> Result<Option<Plan>, Error> {
    let comm = problem.comm;
    let is_shown = uncounted(comm, || comm.max(u64::from(is_shown))) == 1;
    if !is_shown && (is_forced || problem.is_small()) {
        return Ok(None);
    }
    uncounted(comm, || {
        let rough = problem.cells_rough();
        let cells: f64 = rough.iter().sum();
        let ranks = Ranks::gather(comm, Amounts::default(), 0);
        let used = used(&ranks, cells);
        let is_close = !is_forced && used > 0.5;
        let is_cheap =
            cells >= CELLS_SMALL && cells >= CELLS_PER_FACET * problem.facets_total as f64;
        if !is_close && !is_cheap {
            let amounts = Amounts { cells, ..Amounts::default() };
            let more = vec![cells * BYTES_USUAL / ranks.count() as f64; ranks.count()];
            return Ok(is_shown.then(|| Plan::new(Source::Areas, &ranks, amounts, more)));
        }
        let plan = from_pilots(problem, rough, cells_max(cells, used, 0.0), pilot)?;
        if is_forced || plan.fits { Ok(Some(plan)) } else { Err(plan.refusal()) }
    })
}

/// The plan of a case, whatever it takes. Collective.
///
/// # Errors
/// If a pilot run fails.
pub fn of_case(problem: &Problem, pilot: Pilot) -> Result<Plan, Error> {
    uncounted(problem.comm, || {
        let rough = problem.cells_rough();
        let cells: f64 = rough.iter().sum();
        let used = used(&Ranks::gather(problem.comm, Amounts::default(), 0), cells);
        from_pilots(problem, rough, cells_max(cells, used, CELLS_MOMENT), pilot)
    })
}

/// The part of the tightest limit that a mesh of some cells takes at most.
fn used(ranks: &Ranks, cells: f64) -> f64 {
    let more = vec![cells * BYTES_ROUGH / ranks.count() as f64; ranks.count()];
    let part = |t: Tightest| t.needed_bytes as f64 / (t.left_bytes as f64).max(1.0);
    ranks.tightest(&more).map_or(0.0, part)
}

/// Greatest number of cells of a pilot run; `least` of them in any case. Where there is no doubt that the run does not fit, few.
fn cells_max(cells: f64, used: f64, least: f64) -> f64 {
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
    let before = comm.all_gather(&[problem.time_cpu_s.to_bits()]);
    let before: f64 = before.words().iter().map(|&time| f64::from_bits(time)).sum();
    let mut plan = at(0);
    plan.pilots = entries;
    plan.time_cpu_s = Some(before + pilots.at(0).time_cpu_s());
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
            time_cpu_s: None,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comm::Solo;
    use crate::lattice::{Enclosed, ExtentBox, Keep, Root};

    const ROUGH: f64 = 268_435_456.0;

    fn rules(level_surface: Level) -> Rules {
        Rules {
            root: Root { origin: [-1.0; 3], edge: 2.0 },
            level_surface,
            layer_cells_min: 4,
            keep: Keep::Outside,
            keep_crossing: true,
            boxes: Vec::new(),
            seeds: Vec::new(),
            enclosed: Enclosed::Delete,
        }
    }

    /// Runs `test` with the problem of half of a face of the root: at level 13, [`ROUGH`] cells.
    fn with_problem<T>(
        level_surface: Level,
        boxes: &[ExtentBox],
        test: impl FnOnce(&Problem) -> T,
    ) -> T {
        let h = ROOT_EDGE as i32;
        let facets = [Facet { v: [[0, 0, 1], [h, 0, 1], [0, h, 1]] }];
        test(&Problem {
            rules: &rules(level_surface),
            bounds: &Bounds { lo: [-1.0; 3], hi: [1.0; 3] },
            facets: &facets,
            facets_total: 1,
            spacing_min: 0.5,
            volumes: &Volumes::new(boxes),
            time_cpu_s: 2.0,
            comm: &Solo,
        })
    }

    /// Cells and bytes of a mesh that is coarser by some levels.
    fn amounts(cells: f64, bytes: f64, shift: Level) -> Amounts {
        let part = 0.25f64.powi(shift as i32);
        Amounts {
            cells: cells * part,
            bytes_graded: bytes * part,
            time_fixed_s: 3.0,
            ..Amounts::default()
        }
    }

    /// A plan of the case, and the levels by which the pilots were coarser.
    fn planned(cells: f64, bytes: f64) -> (Plan, Vec<Level>) {
        let mut asked = Vec::new();
        let plan = with_problem(13, &[], |problem| {
            let rough = problem.cells_rough();
            assert_eq!(rough, [ROUGH, 0.0]);
            let mut pilot = |shift| {
                asked.push(shift);
                Ok(amounts(cells, bytes, shift))
            };
            from_pilots(problem, rough, cells_max(ROUGH, 1.0, 0.0), &mut pilot)
        });
        (plan.expect("the pilots succeed"), asked)
    }

    #[test]
    fn the_finer_pilot_has_a_64th_of_the_cells() {
        let (plan, asked) = planned(ROUGH, 1.0);
        assert_eq!(asked, [4, 3]);
        assert!(plan.cells.abs_diff(ROUGH as u64) <= 1, "{}", plan.cells);
        let cells: Vec<(f64, u64)> =
            plan.pilots.iter().map(|p| (p.spacing_factor, p.cells)).collect();
        assert_eq!(cells, [(16.0, 1 << 20), (8.0, 1 << 22)]);
        assert_eq!(
            (plan.source, plan.fits, plan.spacing_factor_fits),
            (Source::Pilots, true, None)
        );
        assert_eq!((plan.time_cpu_s, plan.pilots[0].time_cpu_s), (Some(5.0), 3.0));
        let words = ROUGH as u64 * 8 + WORDS_HEADER;
        assert!(plan.words_bytes[0].abs_diff(words) <= 8, "{:?}", plan.words_bytes);
        assert!(plan.tree_bytes.abs_diff((ROUGH * TREE_BYTES_PER_CELL) as u64) <= 1);
        // Fewer cells than the areas suggest: the next pilots are finer, and the mesh itself if it is small.
        assert_eq!(planned(ROUGH / 16.0, 1.0).1, [4, 2, 1]);
        let (plan, asked) = planned(ROUGH / 64.0, 1.0);
        assert_eq!((plan.source, plan.cells, asked), (Source::Mesh, 1 << 22, vec![4, 0]));
        // More cells: the finer one is one level finer in any case.
        assert_eq!(planned(ROUGH * 64.0, 1.0).1, [4, 3]);
    }

    #[test]
    fn the_least_factor_that_fits_is_found() {
        let (plan, _) = planned(ROUGH, 1e18);
        assert!(!plan.fits);
        let factor = plan.spacing_factor_fits.expect("a spacing fits");
        assert_eq!(plan.spacing_min_fits, Some(0.5 * factor));
        let left = plan.tightest.expect("memory is limited").left_bytes as f64;
        // The pilot has 1e18 / 64 bytes already.
        let more = |factor: f64| 1e18 / (factor * factor) - 1e18 / 64.0;
        assert!(more(factor) <= left && more(factor / 2.0) > left, "{factor} for {left} bytes");
        let grown = plan.memory_peak_bytes[0] as f64 / (1e18 * 63.0 / 64.0);
        assert!((grown - 1.0).abs() < 1e-6, "{grown}");
    }

    #[test]
    fn only_runs_that_may_not_fit_or_are_shown_are_planned() {
        let unasked = &mut |_| panic!("no pilot is needed");
        let before = |problem: &Problem, is_forced, is_shown, pilot: Pilot| {
            before_run(problem, is_forced, is_shown, pilot)
        };
        // The extent makes it large, but not its area.
        with_problem(10, &[], |problem| {
            assert!(!problem.is_small());
            assert_eq!(before(problem, false, false, unasked), Ok(None));
            let plan = before(problem, false, true, unasked).unwrap().expect("a plan");
            assert_eq!((plan.source, plan.cells), (Source::Areas, 1 << 22));
            let used = |plan: &Plan| plan.tightest.expect("memory is limited").needed_bytes;
            assert_eq!(used(&plan), ((1 << 22) as f64 * BYTES_USUAL) as u64);
        });
        let few = &mut |shift| Ok(amounts(ROUGH, 1.0, shift));
        let many = &mut |shift| Ok(amounts(ROUGH, 1e18, shift));
        with_problem(13, &[], |problem| {
            assert_eq!(before(problem, true, false, unasked), Ok(None));
            let source = |plan: Result<Option<Plan>, Error>| plan.unwrap().expect("a plan").source;
            assert_eq!(source(before(problem, false, true, few)), Source::Pilots);
            assert_eq!(source(before(problem, true, true, many)), Source::Pilots);
            assert!(matches!(before(problem, false, true, many), Err(Error::Memory(_))));
            // Pilots of many facets take long.
            let facets_total = (ROUGH / CELLS_PER_FACET) as u64;
            let shown = |facets_total: u64, pilot: Pilot| {
                source(before(&Problem { facets_total, ..copy(problem) }, false, true, pilot))
            };
            assert_eq!(shown(facets_total, few), Source::Pilots);
            assert_eq!(shown(facets_total + 1, unasked), Source::Areas);
        });
        // A small case is meshed.
        let plan = with_problem(8, &[], |problem| {
            of_case(problem, &mut |shift| Ok(amounts(9.0, 1.0, shift)))
        });
        let plan = plan.unwrap();
        assert_eq!((plan.source, plan.cells, plan.pilots.len()), (Source::Mesh, 9, 1));
    }

    fn copy<'a>(problem: &Problem<'a>) -> Problem<'a> {
        Problem { ..*problem }
    }

    #[test]
    fn extents_and_boxes_decide_whether_a_run_is_small() {
        let is_small = |cells: [f64; 3], boxes: &[ExtentBox]| {
            let at = |cells: f64| -0.5 + cells * 2.0 / 1024.0;
            let bounds = Bounds { lo: [-0.5; 3], hi: cells.map(at) };
            let (volumes, rules) = (Volumes::new(boxes), rules(10));
            with_problem(10, &[], |problem| {
                Problem { bounds: &bounds, volumes: &volumes, rules: &rules, ..copy(problem) }
                    .is_small()
            })
        };
        // Two times 32e6 cells are the limit; layers add 12 along each axis.
        assert!(is_small([305.0, 305.0, 305.0], &[]) && !is_small([305.0, 306.0, 308.0], &[]));
        // 4 x 1024 x 1024 cells of level 10 in each of eight.
        let slab = |thickness: i64| ExtentBox {
            min: [0; 3],
            max: [thickness * edge(10), ROOT_EDGE, ROOT_EDGE],
            level: 10,
        };
        assert!(is_small([0.0; 3], &[slab(30)]) && !is_small([0.0; 3], &[slab(31)]));
        assert!(!is_small([101.0; 3], &[slab(30)]), "both are added");
    }

    #[test]
    fn pilots_of_runs_that_cannot_fit_are_short() {
        assert_eq!(cells_max(6.4e9, 100.0, 0.0), 67e6);
        assert_eq!(cells_max(6.4e9, 101.0, 0.0), 2.1e6);
        assert_eq!(cells_max(6.4e8, 1.0, 0.0), 1e7);
        assert_eq!(cells_max(6.4e8, 1.0, 2e7), 2e7);
        let ranks = Ranks::gather(&Solo, Amounts::default(), 0);
        let left = ranks.tightest(&[1.0]).expect("memory is limited").left_bytes as f64;
        assert!((used(&ranks, left) - BYTES_ROUGH).abs() < 1e-6);
    }
}
