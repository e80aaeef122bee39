//! Small cases drawn from a number, the same mesh on simulated ranks and on one rank, and the command that repeats a schedule.
//!
//! Simulated ranks run as coroutines: many schedules of small cases in a short time. Beside drawn schedules, every order in which
//! messages can arrive is enumerated, and orders of ranks.
#![allow(dead_code, missing_docs)]

use super::draw::{leaky_on_rays, soup, thin};
use super::{Outcome, Run, Small, options, small, words};
use corosensei::stack::DefaultStack;
use corosensei::{Coroutine, CoroutineResult, Yielder};
use mesher::error::Error;
use mesher::input::case::Case;
use mesher::record::Recorder;
use mesher::sides::Summary;
use mesher::sides::leaks::Leak;
use mesher::{Job, Options, mesh};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use ranks::sim::{Adversary, Arrival, Schedule, Sim, World};
use ranks::{Comm, Solo};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard};

/// What must not depend on the schedule.
#[derive(Clone, Debug, PartialEq)]
pub struct Meshed {
    pub outcome: Outcome,
    /// Digest and number of cells in the report, if it was asked for.
    pub reported: Option<(String, u64)>,
}

/// A case, and its mesh on one rank.
pub struct Serial {
    pub small: Small,
    pub case: Rc<Case>,
    pub meshed: Result<Meshed, Error>,
}

impl Serial {
    pub fn new(small: Small) -> Self {
        let case = Rc::new(small.mesher_case());
        let meshed = merge(vec![part(&case, &options(Run::SOLO.division, false), true, &Solo)]);
        Self { small, case, meshed }
    }

    /// Whether this is the mesh of the case.
    pub fn equals(&self, got: &Result<Meshed, Error>) -> bool {
        match (got, &self.meshed) {
            (Ok(got), Ok(want)) => {
                got.outcome == want.outcome
                    && (got.reported.is_none() || got.reported == want.reported)
            }
            (Err(got), Err(want)) => got == want,
            _ => false,
        }
    }

    /// The mesh on the ranks of a run, each of which communicates through what `wrap` makes of it. With all phases, the report and the
    /// checks of invariants if `whole` is true, otherwise with phases 1 to 8.
    pub fn on_ranks(
        &self,
        run: &Run,
        schedule: impl Schedule + 'static,
        whole: bool,
        wrap: impl Fn(&Sim, &mut dyn FnMut(&dyn Comm)) + 'static,
    ) -> Result<Meshed, Error> {
        let options = Options { check: whole, ..options(run.division, false) };
        on_ranks(self.case.clone(), options, run.ranks, schedule, whole, wrap)
    }

    /// The same under the schedule of the run's seed.
    pub fn on_seed(&self, run: &Run, whole: bool) -> Result<Meshed, Error> {
        self.on_ranks(run, Adversary::new(run.seed), whole, plain)
    }
}

/// A rank that communicates as it is.
pub fn plain(sim: &Sim, work: &mut dyn FnMut(&dyn Comm)) {
    work(sim);
}

/// The mesh of a case on simulated ranks.
pub fn on_ranks(
    case: Rc<Case>,
    options: Options,
    ranks: usize,
    schedule: impl Schedule + 'static,
    whole: bool,
    wrap: impl Fn(&Sim, &mut dyn FnMut(&dyn Comm)) + 'static,
) -> Result<Meshed, Error> {
    merge(run_fibres(ranks, schedule, move |sim: &Sim| {
        let mut result = None;
        let mut work = |comm: &dyn Comm| result = Some(part(&case, &options, whole, comm));
        // Counting messages needs the clocks, which take longer than passing the token on.
        sim.uncounted(&mut || wrap(sim, &mut work));
        result.expect("the work has been done")
    }))
}

/// Leaf words, components and leaks, and digest and number of cells in the report if it was asked for.
pub type Part = Result<(Vec<u64>, Common, Option<(String, u64)>), Error>;

/// Components and leaks, the same on all ranks.
pub type Common = (Summary, Vec<Leak>);

/// A rank's part of the mesh.
pub fn part(case: &Case, options: &Options, whole: bool, comm: &dyn Comm) -> Part {
    let reported = match whole {
        false => None,
        true => {
            let mut record = Recorder::default();
            let report = mesh(case, &mut Job::new(options, comm, &mut record), |_, _| Ok(()))?;
            Some((report.mesh.digest, report.cells))
        }
    };
    let (words, summary, leaks) = words(case, options, comm)?;
    Ok((words, (summary, leaks), reported))
}

/// The mesh of which these are the parts of all ranks.
///
/// # Panics
/// If ranks do not agree on the error, the components or the leaks, or a part is not sorted.
pub fn merge(parts: Vec<Part>) -> Result<Meshed, Error> {
    let (mut all, mut same) = (Vec::new(), None);
    for part in parts {
        let (words, common) = match part {
            Ok((words, common, reported)) => (words, Ok((common, reported))),
            Err(e) => (Vec::new(), Err(e)),
        };
        assert!(words.is_sorted(), "parts must be sorted");
        all.extend(words);
        assert!(*same.get_or_insert(common.clone()) == common, "ranks must agree on the result");
    }
    all.sort_unstable();
    let ((summary, leaks), reported) = same.expect("at least one rank")?;
    let leak = |Leak { spacing_coarse, spacing_fine, volume, point, .. }| reference::Leak {
        spacing_coarse,
        spacing_fine,
        volume,
        point,
    };
    let leaks = leaks.into_iter().map(leak).collect();
    Ok(Meshed { outcome: Outcome { words: all, summary, leaks }, reported })
}

/// Draws a value that depends on the number alone.
pub fn drawn<T: std::fmt::Debug>(strategy: &impl Strategy<Value = T>, number: u64) -> T {
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&number.to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut runner = TestRunner::new_with_rng(Config::default(), rng);
    strategy.new_tree(&mut runner).expect("the strategies reject nothing").current()
}

/// Cases of all kinds, some with seeds. Boxed, as the strategies of unoptimised builds would fill the stack of a test.
pub fn cases() -> BoxedStrategy<Small> {
    let soup = small(soup().boxed()).boxed();
    let case = prop_oneof![3 => soup, 1 => thin().boxed(), 1 => leaky_on_rays().boxed()].boxed();
    let point = [0.0f64..64.0, 0.0f64..64.0, 0.0f64..64.0];
    let seeds = prop_oneof![3 => Just(vec![]), 1 => prop::collection::vec(point, 1..3)];
    (case, seeds).prop_map(|(case, seeds)| Small { seeds, ..case }).boxed()
}

/// The first case of at most `cells` cells that is drawn from a number.
pub fn case(strategy: &impl Strategy<Value = Small>, number: u64, cells: usize) -> Serial {
    let tries = (0..).map(|again| Serial::new(drawn(strategy, number ^ again << 48)));
    let is_small = |s: &Serial| s.meshed.as_ref().map_or(true, |m| m.outcome.words.len() <= cells);
    tries.into_iter().find(is_small).expect("small cases are frequent")
}

/// Writes the case for the mesher's program; returns the path of the case file.
pub fn write(case: &Small, folder: &Path, name: &str) -> PathBuf {
    std::fs::create_dir_all(folder).expect("the folder can be made");
    let mut bytes = Vec::new();
    geometries::write_stl_binary(&case.facets, &mut bytes).expect("memory can be written to");
    std::fs::write(folder.join(format!("{name}.stl")), bytes).expect("the folder is writable");
    let lower = |value: String| value.to_lowercase();
    let mut text = format!(
        "geometry = \"{name}.stl\"\nspacing_min = {:?}\nlayer_cells_min = {}\nkeep = \"{}\"\nkeep_crossing = {}\n",
        case.spacing_min,
        case.layer_cells_min,
        lower(format!("{:?}", case.keep)),
        case.keep_crossing,
    );
    text += &format!("enclosed = \"{}\"\n", lower(format!("{:?}", case.enclosed)));
    text += &format!("seeds = {:?}\n", case.seeds);
    text += &format!("[root]\norigin = {:?}\nedge = {:?}\n", case.root.origin, case.root.edge);
    for b in &case.boxes {
        text +=
            &format!("[[box]]\nmin = {:?}\nmax = {:?}\nspacing = {:?}\n", b.min, b.max, b.spacing);
    }
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, text).expect("the folder is writable");
    path
}

/// The options of the mesher's program for a run.
pub fn run_words(run: &Run) -> String {
    let lower = |value: String| value.to_lowercase();
    let base = run.division.level_base.map_or("auto".to_owned(), |l| l.to_string());
    format!(
        "--comm sim:{}:{} --partitioner {} --weights {} --level-base {base} --check",
        run.ranks,
        run.seed,
        lower(format!("{:?}", run.division.partitioner)),
        lower(format!("{:?}", run.division.weights)),
    )
}

/// Bytes of a coroutine's stack; only pages that are used take memory.
const STACK: usize = 4 << 20;

thread_local! {
    /// Kept, because mapping and releasing them takes longer than a small mesh.
    static STACKS: RefCell<Vec<DefaultStack>> = const { RefCell::new(Vec::new()) };
}

/// Runs `body` on `size` ranks; returns what each rank returned.
///
/// # Panics
/// With the panic of the first rank that panics. The other ranks are unwound.
pub fn run_fibres<T: 'static>(
    size: usize,
    schedule: impl Schedule + 'static,
    body: impl Fn(&Sim) -> T + 'static,
) -> Vec<T> {
    let world = Rc::new(World::new(size, schedule));
    let body = Rc::new(body);
    let mut ranks: Vec<_> = (0..size)
        .map(|rank| {
            let (world, body) = (world.clone(), body.clone());
            let kept = STACKS.with_borrow_mut(Vec::pop);
            let stack = kept.unwrap_or_else(|| DefaultStack::new(STACK).expect("address space"));
            Coroutine::with_stack(stack, move |yielder: &Yielder<(), ()>, ()| {
                body(&Sim::new(rank, &world, &|| yielder.suspend(())))
            })
        })
        .collect();
    let mut results: Vec<Option<T>> = (0..size).map(|_| None).collect();
    while let Some(rank) = world.next() {
        if let CoroutineResult::Return(result) = ranks[rank].resume(()) {
            results[rank] = Some(result);
            world.end(rank, false);
        }
    }
    let is_done = ranks.iter().all(Coroutine::done);
    assert!(is_done, "ranks wait for a call that another rank does not make");
    STACKS.with_borrow_mut(|s| s.extend(ranks.into_iter().map(Coroutine::into_stack)));
    results.into_iter().map(|r| r.expect("every rank has ended")).collect()
}

/// A depth-first walk over the orders of arrival: the choices of one run, in the order in which they are made.
#[derive(Clone, Default)]
pub struct Orders(Arc<Mutex<Walk>>);

#[derive(Default)]
struct Walk {
    /// For each choice, the number of the permutation and the number of permutations.
    choices: Vec<(usize, usize)>,
    /// Choices made in the current run.
    made: usize,
}

impl Orders {
    /// Goes to the next order; returns false after the last one.
    pub fn advance(&self) -> bool {
        let walk = &mut *self.lock();
        // A run whose choices depend on the order of earlier messages may make fewer of them.
        walk.choices.truncate(walk.made);
        walk.made = 0;
        while let Some((choice, of)) = walk.choices.pop() {
            if choice + 1 < of {
                walk.choices.push((choice + 1, of));
                return true;
            }
        }
        false
    }

    /// The product of the numbers of permutations in the last run: the number of orders, if the choices are the same in all of them.
    pub fn product(&self) -> f64 {
        self.lock().choices.iter().map(|c| c.1 as f64).product()
    }

    fn lock(&self) -> MutexGuard<'_, Walk> {
        self.0.lock().unwrap_or_else(|p| p.into_inner())
    }
}

impl Schedule for Orders {
    fn next(&mut self, _: &[usize]) -> usize {
        0
    }

    fn arrange(&mut self, _: usize, messages: &mut [Arrival]) {
        if messages.len() < 2 {
            return;
        }
        let walk = &mut *self.lock();
        if walk.made == walk.choices.len() {
            walk.choices.push((0, (2..=messages.len()).product()));
        }
        permute(messages, walk.choices[walk.made].0);
        walk.made += 1;
    }
}

/// Puts items into their permutation of this number; number 0 leaves them as they are.
pub fn permute<T>(items: &mut [T], mut number: usize) {
    for first in 0..items.len() {
        let rest = items.len() - first;
        items[first..][..=number % rest].rotate_right(1);
        number /= rest;
    }
}

/// All ranks run in ascending order, but in another order before one call.
#[derive(Clone, Debug)]
pub struct Turns {
    /// The order, and the number of the call.
    pub order: Vec<usize>,
    pub call: usize,
    /// Turns so far.
    pub turns: usize,
}

impl Schedule for Turns {
    fn next(&mut self, ready: &[usize]) -> usize {
        let (call, turn) = (self.turns / self.order.len(), self.turns % self.order.len());
        self.turns += 1;
        let wanted = if call == self.call { self.order[turn] } else { turn };
        ready.binary_search(&wanted).expect("every rank runs once between two calls")
    }

    fn arrange(&mut self, _: usize, _: &mut [Arrival]) {}
}
