//! The mesh does not depend on the order of messages: every order, on 2 and 3 ranks and trees of at most three levels.
//!
//! A run is determined by two things: the order in which ranks run between their calls, and the order in which the messages of
//! each sparse all-to-all arrive at each receiver. Most of these orders are equivalent, and only one of each class is run
//! (partial-order reduction):
//! - Two ranks share no memory that either of them changes: the library has no mutable static, and what a gather returns to several ranks is
//!   immutable. So their steps between two calls commute, and one order of the ranks stands for all. The
//!   premise is tested: every order of the ranks before every single call.
//! - All calls are collective, so no step of a call overlaps one of the next. What gathers and sums return does not
//!   depend on the order of their contributions (`MPI_Allgather` returns them by rank; sums are of integers).
//! - A receiver reads no message before all have arrived. So arrivals at different receivers commute, and of the arrivals at
//!   one receiver only their order matters. That a message is late is such an order, too.
//!
//! What remains is one permutation of the messages for each receiver of each sparse all-to-all. All combinations of these
//! permutations are run, not only each by itself. `ORDERS` is the number of drawn cases; `ci/schedules` runs more of them.

use crate::support::schedules::{Orders, Serial, Turns, cases, drawn, permute, run_fibres};
use crate::support::{Run, Small, cuboid, run};
use bricks::octant::position;
use cpu_time::ProcessTime;
use mesher::input::case::BoxSpec;
use mesher::input::lattice::{Enclosed, Keep, Root};
use mesher::partition::{Division, Partitioner, Weights};
use proptest::prelude::*;
use ranks::sim::Sim;
use ranks::{Comm, Gathered, MessageBuffer, Traffic};
use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;

/// Deepest level of the trees.
const LEVEL: u32 = 3;
/// Greatest number of orders of a case; cases with more are left out and counted.
const ORDERS_MAX: f64 = 20_000.0;

/// Runs a case in every order, until the mesh is another one: the number of orders, and whether all had the serial mesh. None if there are
/// more than [`ORDERS_MAX`].
fn every_order(
    serial: &Serial,
    run: &Run,
    wrap: impl Fn(&Sim, &mut dyn FnMut(&dyn Comm)) + Clone + 'static,
) -> Option<(u64, bool)> {
    let orders = Orders::default();
    for number in 1.. {
        let got = catch_unwind(AssertUnwindSafe(|| {
            serial.on_ranks(run, orders.clone(), false, wrap.clone())
        }));
        if !got.is_ok_and(|got| serial.equals(&got)) {
            return Some((number, false));
        }
        if orders.product() > ORDERS_MAX {
            return None;
        }
        if !orders.advance() {
            return Some((number, true));
        }
    }
    unreachable!("the number of orders is finite")
}

/// The rank without errors.
fn plain(sim: &Sim, work: &mut dyn FnMut(&dyn Comm)) {
    work(&Faulty::new(sim, Bug::None, &Cell::new(0)));
}

/// A case whose tree has at most three levels: all spacings are those of level 3 or more.
fn shallow(mut case: Small) -> Small {
    let finest = case.root.edge / f64::from(1 << LEVEL);
    case.spacing_min = case.spacing_min.max(finest);
    case.boxes.iter_mut().for_each(|b| b.spacing = b.spacing.max(finest));
    case
}

fn level_max(serial: &Serial) -> u64 {
    let words = serial.meshed.iter().flat_map(|m| &m.outcome.words);
    words.map(|w| w >> 2 & 31).max().unwrap_or(0)
}

/// Runs of 2 and 3 ranks, with many kinds of division.
fn runs() -> impl Strategy<Value = Run> {
    let level_base = prop_oneof![1 => Just(None), 3 => (1u32..4).prop_map(Some)];
    (run(), 2usize..4, level_base).prop_map(|(run, ranks, level_base)| {
        let division = Division { level_base, ..run.division };
        Run { ranks, division, ..run }
    })
}

#[derive(Default)]
struct Counts {
    runs: [u64; 2],
    orders: [u64; 2],
    greatest: u64,
    left_out: u64,
}

impl Counts {
    fn add(&mut self, what: &str, serial: &Serial, run: &Run) {
        assert!(level_max(serial) <= u64::from(LEVEL));
        match every_order(serial, run, plain) {
            None => self.left_out += 1,
            Some((orders, is_serial)) => {
                assert!(is_serial, "{what}: order {orders} of {run:?}, {:?}", serial.small);
                self.runs[run.ranks - 2] += 1;
                self.orders[run.ranks - 2] += orders;
                self.greatest = self.greatest.max(orders);
            }
        }
    }

    fn print(&self, what: &str, since: ProcessTime) {
        let Self { runs, orders, greatest, left_out } = self;
        println!(
            "{what}: {} runs on 2 ranks in {} orders, {} runs on 3 ranks in {} orders, at most {greatest} of a run; left out {left_out} runs with more than {ORDERS_MAX}; {:.1} s of CPU time",
            runs[0],
            orders[0],
            runs[1],
            orders[1],
            since.elapsed().as_secs_f64(),
        );
    }
}

/// A tree in which the octants of level 1 in `split` are split.
fn tree(split: u8) -> Small {
    let of_octant = |code: u64| {
        // Codes of level 19; the root has edge 64.
        let min = position(code << 54).map(|c| f64::from(c) / 8192.0);
        BoxSpec { min, max: min.map(|c| c + 32.0), spacing: 16.0 }
    };
    Small {
        facets: cuboid([20.0; 3], [44.0; 3]),
        root: Root { origin: [0.0; 3], edge: 64.0 },
        spacing_min: 32.0,
        layer_cells_min: 1,
        keep: Keep::Outside,
        keep_crossing: true,
        boxes: (0..8).filter(|code| split >> code & 1 == 1).map(of_octant).collect(),
        seeds: Vec::new(),
        enclosed: Enclosed::Delete,
    }
}

#[test]
fn every_order_makes_the_serial_mesh_on_every_tree_of_two_levels() {
    let (mut counts, started) = (Counts::default(), ProcessTime::now());
    for split in 0..=255 {
        let serial = Serial::new(tree(split));
        for ranks in [2, 3] {
            for level_base in [None, Some(1)] {
                let division = Division {
                    partitioner: Partitioner::Morton,
                    weights: Weights::Unit,
                    level_base,
                };
                let run = Run { ranks, seed: 0, division };
                counts.add(&format!("tree {split:08b}"), &serial, &run);
            }
        }
    }
    counts.print("trees of two levels", started);
    assert!(counts.runs.iter().all(|&runs| runs > 0));
}

#[test]
fn every_order_makes_the_serial_mesh_of_drawn_cases() {
    let number = std::env::var("ORDERS").map_or(40, |n| n.parse().expect("a number of cases"));
    let (cases, runs) = (cases(), runs().boxed());
    let (mut counts, started) = (Counts::default(), ProcessTime::now());
    for number in 0..number {
        let serial = Serial::new(shallow(drawn(&cases, number)));
        let run = drawn(&runs, number);
        counts.add(&format!("case {number}"), &serial, &run);
    }
    counts.print("drawn cases", started);
    assert!(counts.runs.iter().all(|&runs| runs > 0));
    assert!(counts.left_out * 2 < number, "most cases have few enough orders");
}

/// The premise that the steps of different ranks commute.
#[test]
fn every_order_of_ranks_before_every_call_makes_the_serial_mesh() {
    let (cases, runs) = (cases(), runs().boxed());
    let mut orders = 0;
    for number in 0..8 {
        let serial = Serial::new(shallow(drawn(&cases, number)));
        for ranks in [2, 3] {
            let run = Run { ranks, ..drawn(&runs, number) };
            for permutation in 1..(2..=ranks).product() {
                let mut order: Vec<usize> = (0..ranks).collect();
                permute(&mut order, permutation);
                for call in 0.. {
                    let calls = Rc::new(Cell::new(0));
                    let counted = calls.clone();
                    let turns = Turns { order: order.clone(), call, turns: 0 };
                    let got = serial.on_ranks(&run, turns, false, move |sim, work| {
                        work(&Faulty::new(sim, Bug::None, &counted));
                    });
                    assert!(serial.equals(&got), "{order:?} before call {call} of {run:?}");
                    orders += 1;
                    if call * ranks > calls.get() {
                        break;
                    }
                }
            }
        }
    }
    println!("{orders} orders of ranks");
}

#[test]
fn the_walk_visits_every_combination_of_orders_once() {
    let (orders, seen) = (Orders::default(), Rc::new(RefCell::new(BTreeSet::new())));
    let mut runs = 0;
    loop {
        // All send to all, then ranks 0 and 1 to rank 2: three permutations of three messages, and one of two.
        let received = run_fibres(3, orders.clone(), |c: &Sim| {
            let senders = |m: MessageBuffer| m.messages().map(|m| m.0).collect::<Vec<_>>();
            let all = c.sparse_all_to_all((0..3).map(|r| (r, [1])).collect());
            let to_last = (c.rank() < 2).then_some((2, [1]));
            [senders(all), senders(c.sparse_all_to_all(to_last.into_iter().collect()))]
        });
        seen.borrow_mut().insert(received);
        runs += 1;
        if !orders.advance() {
            break;
        }
    }
    assert_eq!((runs, seen.borrow().len()), (6 * 6 * 6 * 2, 6 * 6 * 6 * 2));
}

/// An error planted in a rank's communication, which acts in some orders only.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bug {
    None,
    /// A message that arrives after one of a higher rank is lost.
    LostIfLate,
    /// In one sparse all-to-all, one rank loses the last message if all arrive in descending order of their senders.
    LostInOneOrder {
        call: usize,
        rank: usize,
    },
}

/// A rank that may have an error. What is not counted, such as checks of invariants, communicates by gathers: the orders of its
/// messages would multiply those of the phases.
struct Faulty<'a> {
    sim: &'a Sim<'a>,
    bug: Bug,
    calls: &'a Cell<usize>,
    /// Number of calls of the phases.
    of_phases: Cell<usize>,
    is_uncounted: Cell<bool>,
}

impl<'a> Faulty<'a> {
    /// `calls` counts the collective calls.
    fn new(sim: &'a Sim<'a>, bug: Bug, calls: &'a Cell<usize>) -> Self {
        Self { sim, bug, calls, of_phases: Cell::new(0), is_uncounted: Cell::new(false) }
    }

    fn count(&self) {
        self.calls.set(self.calls.get() + 1);
        self.of_phases.set(self.of_phases.get() + usize::from(!self.is_uncounted.get()));
    }

    /// A sparse all-to-all by a gather, so that no order can differ.
    fn by_gather(&self, to: &MessageBuffer) -> MessageBuffer {
        let packed = |(to, words): (usize, &[u64])| {
            [to as u64, words.len() as u64].into_iter().chain(words.to_vec())
        };
        let mine: Vec<u64> = to.messages().flat_map(packed).collect();
        let mut received = Vec::new();
        for (from, mut rest) in self.sim.all_gather(&mine).messages() {
            while let [to, length, words @ ..] = rest {
                let (words, others) = words.split_at(*length as usize);
                if *to as usize == self.rank() {
                    received.push((from, words.to_vec()));
                }
                rest = others;
            }
        }
        received.into_iter().collect()
    }
}

impl Comm for Faulty<'_> {
    fn rank(&self) -> usize {
        self.sim.rank()
    }

    fn size(&self) -> usize {
        self.sim.size()
    }

    fn all_gather(&self, mine: &[u64]) -> Gathered {
        self.count();
        self.sim.all_gather(mine)
    }

    fn sums(&self, mine: &[u64]) -> Vec<u64> {
        self.count();
        self.sim.sums(mine)
    }

    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer {
        self.count();
        if self.is_uncounted.get() {
            return self.by_gather(&to);
        }
        let call = self.of_phases.get();
        let received = self.sim.sparse_all_to_all(to);
        let messages: Vec<(usize, Vec<u64>)> =
            received.messages().map(|(from, words)| (from, words.to_vec())).collect();
        let is_lost = |at: usize| match self.bug {
            Bug::None => false,
            Bug::LostIfLate => messages[..at].iter().any(|before| before.0 > messages[at].0),
            Bug::LostInOneOrder { call: at_call, rank } => {
                let is_descending = messages.windows(2).all(|pair| pair[0].0 > pair[1].0);
                at > 0
                    && at + 1 == messages.len()
                    && (call, self.rank()) == (at_call, rank)
                    && is_descending
            }
        };
        let kept = (0..messages.len()).filter(|&at| !is_lost(at));
        kept.map(|at| (messages[at].0, messages[at].1.iter().copied())).collect()
    }

    fn traffic(&self) -> Traffic {
        self.sim.traffic()
    }

    fn uncounted(&self, body: &mut dyn FnMut()) {
        let outer = self.is_uncounted.replace(true);
        body();
        self.is_uncounted.set(outer);
    }
}

/// Whether some order of a run reveals a bug. The first order, in which messages arrive by sender, never does.
fn reveals(bug: Bug, serial: &Serial, run: &Run) -> bool {
    let wrap = move |sim: &Sim, work: &mut dyn FnMut(&dyn Comm)| {
        work(&Faulty::new(sim, bug, &Cell::new(0)));
    };
    let found = every_order(serial, run, wrap);
    assert!(found != Some((1, false)), "the first order has no bug");
    found.is_some_and(|(_, is_serial)| !is_serial)
}

#[test]
fn planted_errors_that_depend_on_the_order_are_found() {
    let (cases, runs) = (cases(), runs().boxed());
    // On two ranks no receiver has a choice in most cases.
    let (mut late, mut one, ranks) = (0, 0, 3);
    for number in 0..2 {
        let serial = Serial::new(shallow(drawn(&cases, number)));
        let run = Run { ranks, ..drawn(&runs, number) };
        late += u64::from(reveals(Bug::LostIfLate, &serial, &run));
        for call in 0..40 {
            let bug = Bug::LostInOneOrder { call, rank: number as usize % ranks };
            one += u64::from(reveals(bug, &serial, &run));
        }
    }
    println!(
        "found in {late} cases if it acts in all calls, {one} times if it acts in one order of one call"
    );
    assert!(late > 0 && one > 0);
}
