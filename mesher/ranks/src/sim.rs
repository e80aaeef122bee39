//! Simulated ranks in one process, for tests and projections.
//!
//! Only one rank runs at a time. It passes the token on when it has to wait for others. The next rank and the order in which messages
//! arrive are a [`Schedule`]'s choices; [`run`] draws one from a seed, so a failure can be replayed from its seed. In [`run`] each rank is a
//! thread, so that the CPU time of a rank is not disturbed by the others. Tests of many schedules run ranks as coroutines, which takes a
//! fifth of the time.

mod world;

pub use world::{Adversary, Arrival, Schedule, World};

use super::{Comm, Gathered, MessageBuffer, Metered};
use files::OUT_OF_MEMORY;
use std::any::Any;
use std::cell::RefCell;
use std::io::{Write, stderr};
use std::panic::{AssertUnwindSafe, catch_unwind, panic_any, resume_unwind};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::vec::IntoIter;
use world::Call;

/// One rank of a simulated group.
pub struct Sim<'a> {
    rank: usize,
    world: &'a World,
    pass: &'a dyn Fn(),
    /// The calls so far and their results, if they are kept.
    kept: RefCell<Option<Vec<(Call, Gathered)>>>,
    /// The calls that are made again, if this rank is alone.
    again: RefCell<Option<IntoIter<(Call, Gathered)>>>,
}

/// Runs `body` on `size` ranks under the schedule of `seed`; returns what each rank returned.
///
/// # Panics
/// With the panic of the lowest rank that panicked; the other ranks are stopped.
pub fn run<T: Send>(size: usize, seed: u64, body: impl Fn(&Metered<Sim>) -> T + Sync) -> Vec<T> {
    let results: Vec<_> = (0..size).map(|_| Mutex::new(None)).collect();
    run_ranks(size, seed, &|sim| *results[sim.rank()].lock().expect("no panic") = Some(body(sim)));
    results.into_iter().map(|r| r.into_inner().ok().flatten().expect("the rank ended")).collect()
}

/// Without type parameters, as a test suite has dozens of bodies.
fn run_ranks(size: usize, seed: u64, body: &(dyn Fn(&Metered<Sim>) + Sync)) {
    let world = World::new(size, Adversary::new(seed));
    // What a rank waits for: true when it runs next, false when no rank can go on.
    let (turns, turns_of): (Vec<Sender<bool>>, Vec<_>) = (0..size).map(|_| channel()).unzip();
    let pass_on = || match world.next() {
        Some(rank) => _ = turns[rank].send(true),
        None => turns.iter().for_each(|turn| _ = turn.send(false)),
    };
    pass_on();
    let panics: Vec<Box<dyn Any + Send>> = std::thread::scope(|scope| {
        let spawn = |(rank, turn): (usize, Receiver<bool>)| {
            let (world, pass_on) = (&world, &pass_on);
            let run = move || {
                let wait = || turn.recv() == Ok(true) || panic_any(STOPPED);
                wait();
                let pass = || {
                    pass_on();
                    wait();
                };
                let sim = Metered::new(Sim::new(rank, world, &pass));
                let result = catch_unwind(AssertUnwindSafe(|| body(&sim)));
                world.end(rank, result.is_err());
                pass_on();
                result
            };
            let builder = std::thread::Builder::new().stack_size(16 << 20);
            builder.spawn_scoped(scope, run).unwrap_or_else(|e| {
                let line = format!("mesher: no thread for simulated rank {rank}: {e}: {LIMITS}\n");
                // A launcher puts lines of its own between two writes.
                let _ = stderr().write_all(line.as_bytes());
                crate::launch::abort(OUT_OF_MEMORY)
            })
        };
        let handles: Vec<_> = turns_of.into_iter().enumerate().map(spawn).collect();
        handles.into_iter().filter_map(|t| t.join().flatten().err()).collect()
    });
    if let Some(p) = panics.into_iter().min_by_key(|p| p.downcast_ref() == Some(&STOPPED)) {
        resume_unwind(p);
    }
}

const LIMITS: &str = "simulate fewer ranks, or raise the limits (ulimit -v, ulimit -u)";
const UNEQUAL_ALONE: &str = "a rank alone must make the same calls";
const STOPPED: &str = "stopped because another simulated rank panicked";

impl<'a> Sim<'a> {
    /// A rank of a world, which has been chosen to run. `pass` passes the token on, and returns when the world has chosen this rank again.
    pub fn new(rank: usize, world: &'a World, pass: &'a dyn Fn()) -> Self {
        Self { rank, world, pass, kept: RefCell::default(), again: RefCell::default() }
    }

    fn call(&self, call: Call, words: MessageBuffer) -> Gathered {
        if let Some(again) = &mut *self.again.borrow_mut() {
            return again.next().filter(|kept| kept.0 == call).expect(UNEQUAL_ALONE).1;
        }
        self.world.post(self.rank, call, words);
        (self.pass)();
        let result = self.world.result(self.rank);
        self.kept.borrow_mut().iter_mut().for_each(|kept| kept.push((call, result.clone())));
        result
    }

    /// The same for words that all ranks receive.
    fn to_all(&self, call: Call, words: &[u64]) -> Gathered {
        self.call(call, [(self.rank, words.iter().copied())].into_iter().collect())
    }
}

impl Comm for Sim<'_> {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.world.size
    }

    fn all_gather(&self, mine: &[u64]) -> Gathered {
        self.to_all(Call::Gather, mine)
    }

    fn sums(&self, mine: &[u64]) -> Vec<u64> {
        self.to_all(Call::Sum, mine).words().to_vec()
    }

    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer {
        Gathered::unwrap_or_clone(self.call(Call::Send, to))
    }

    fn repeat_alone(&self, body: &mut dyn FnMut()) {
        self.kept.replace(Some(Vec::new()));
        body();
        // Results are kept to the end: freed by this rank, they would go back to the heaps of other ranks.
        let kept = self.kept.take().unwrap_or_default();
        self.again.replace(Some(kept.clone().into_iter()));
        body();
        assert!(self.again.take().is_some_and(|rest| rest.len() == 0), "{UNEQUAL_ALONE}");
    }

    fn ranks_in_process(&self) -> usize {
        self.size()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    #[test]
    fn all_messages_arrive_for_every_seed() {
        for seed in 0..20 {
            let sums = run(7, seed, |c| {
                let to = (0..c.size())
                    .filter(|r| r % 2 == 0)
                    .map(|r| (r, vec![c.rank() as u64; 2]))
                    .collect();
                let received: u64 = c.sparse_all_to_all(to).messages().map(|l| l.1[0]).sum();
                (c.sum(c.rank() as u64), received)
            });
            for (rank, (sum, received)) in sums.into_iter().enumerate() {
                assert_eq!(sum, 21);
                assert_eq!(received, if rank % 2 == 0 { 21 } else { 0 });
            }
        }
    }

    #[test]
    fn the_order_of_arrival_depends_on_the_seed_alone() {
        let order = |seed| {
            let senders = |message_buffer: MessageBuffer| {
                message_buffer.messages().map(|l| l.0).collect::<Vec<_>>()
            };
            run(6, seed, |c| {
                senders(c.sparse_all_to_all(MessageBuffer::of_entries(vec![(0, [1])])))
            })
            .swap_remove(0)
        };
        assert_eq!(order(3), order(3));
        assert!((0..10).any(|s| order(s) != order(3)));
    }

    #[test]
    fn a_rank_repeats_its_work_alone_with_the_same_results() {
        for (sums, senders) in run(5, 7, |c| {
            let (mut sums, mut senders) = (Vec::new(), Vec::new());
            c.repeat_alone(&mut || {
                let to = (c.rank() + 1) % c.size();
                let received = c.sparse_all_to_all([(to, [1])].into_iter().collect());
                senders.push(received.messages().map(|m| m.0).collect::<Vec<_>>());
                // A result cannot depend on what a rank adds when it is alone.
                sums.push([c.sum((sums.len() * 100 + c.rank()) as u64), c.traffic().messages]);
            });
            sums.push([c.sum(1), c.traffic().messages]);
            (sums, senders)
        }) {
            // A message, its acknowledgement and three of a barrier; then three of a sum, each time from the same start.
            assert_eq!(sums, [[10, 8], [10, 8], [5, 11]]);
            assert!(senders.len() == 2 && senders[0] == senders[1], "{senders:?}");
        }
    }

    #[test]
    fn a_rank_that_makes_other_calls_alone_is_found() {
        let calls: [fn(&dyn Comm); 3] =
            [|_| {}, |c| _ = (c.sum(1), c.sum(1)), |c| _ = c.all_gather(&[1])];
        for alone in calls {
            let is_second = AtomicBool::new(false);
            let repeated = || {
                run(1, 1, |c| {
                    c.repeat_alone(&mut || match is_second.swap(true, Ordering::Relaxed) {
                        true => alone(c),
                        false => _ = c.sum(1),
                    });
                })
            };
            let panic = catch_unwind(AssertUnwindSafe(repeated)).expect_err("other calls");
            let text = panic.downcast_ref::<String>().cloned();
            let text = text.or(panic.downcast_ref::<&str>().map(|s| s.to_string()));
            assert!(text.is_some_and(|text| text.contains(UNEQUAL_ALONE)));
        }
    }

    #[test]
    #[should_panic(expected = "rank two fails")]
    fn a_panic_on_one_rank_stops_all() {
        run(4, 1, |c| {
            assert!(c.rank() != 2, "rank two fails");
            c.sum(1)
        });
    }

    #[test]
    #[should_panic(expected = "another simulated rank")]
    fn a_rank_that_ends_early_does_not_leave_the_others_waiting() {
        run(3, 1, |c| if c.rank() == 0 { 0 } else { c.sum(1) });
    }
}
