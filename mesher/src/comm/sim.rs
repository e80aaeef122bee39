//! Many ranks in one process, for tests and projections.
//!
//! Each rank is a thread, but only the one that holds the token runs; it hands the token on when it
//! has to wait for others. Who gets it next, and in which order messages arrive, is drawn from a seed: a
//! failure is replayed by its seed, and a rank's CPU time is not disturbed by the others.

use super::{Comm, Gathered, MessageBuffer, Meter, Traffic, matrix};
use std::any::Any;
use std::cell::Cell;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};

/// One rank of a simulated group.
pub struct Sim {
    rank: usize,
    world: Arc<World>,
    meter: Meter,
    /// Number of collective calls made, to notice ranks that do not make the same ones.
    calls: Cell<u64>,
}

struct World {
    size: usize,
    state: Mutex<State>,
    /// One per rank, so that handing the token on wakes one thread and not all.
    turns: Vec<Condvar>,
}

#[derive(Clone, Copy, PartialEq)]
enum Doing {
    Ready,
    Waiting,
    Done,
}

struct State {
    running: usize,
    doing: Vec<Doing>,
    /// What each rank has put into the call under way.
    posted: Vec<Option<Post>>,
    /// What each rank takes out of it.
    inbox: Vec<Option<Delivery>>,
    random: u64,
    broken: bool,
}

struct Post {
    /// The call's number.
    call: u64,
    words: Words,
}

/// What a rank puts into a call.
enum Words {
    /// For everybody.
    Gather(Vec<u64>),
    /// To be summed up.
    Sum(Vec<u64>),
    /// By receiver.
    Exchange(MessageBuffer),
}

/// What it takes out.
enum Delivery {
    Gathered(Gathered),
    Summed(Vec<u64>),
    Exchanged(MessageBuffer),
}

/// Runs `body` on `size` ranks under the schedule of `seed`; returns what each rank returned.
///
/// # Panics
/// With the panic of the first rank that panics; the others are ended.
pub fn run<T: Send>(size: usize, seed: u64, body: impl Fn(&Sim) -> T + Sync) -> Vec<T> {
    assert!(size > 0, "a group has at least one rank");
    let world = Arc::new(World {
        size,
        state: Mutex::new(State {
            running: 0,
            doing: vec![Doing::Ready; size],
            posted: (0..size).map(|_| None).collect(),
            inbox: (0..size).map(|_| None).collect(),
            random: seed ^ 0x9e37_79b9_7f4a_7c15,
            broken: false,
        }),
        turns: (0..size).map(|_| Condvar::new()).collect(),
    });
    let results: Vec<std::thread::Result<T>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..size)
            .map(|rank| {
                let (world, body) = (world.clone(), &body);
                std::thread::Builder::new()
                    .stack_size(16 << 20)
                    .spawn_scoped(scope, move || {
                        let sim = Sim {
                            rank,
                            world: world.clone(),
                            meter: Meter::default(),
                            calls: Cell::new(0),
                        };
                        sim.wait_for_turn();
                        let guard = Leaving(&sim);
                        let result = body(&sim);
                        drop(guard);
                        result
                    })
                    .expect("a thread per simulated rank")
            })
            .collect();
        threads.into_iter().map(|t| t.join()).collect()
    });
    let told = |p: &Box<dyn Any + Send>| p.downcast_ref::<&str>().is_some_and(|m| *m == ENDED);
    if let Some(at) = results.iter().position(|r| r.as_ref().is_err_and(|p| !told(p))) {
        let panic = results.into_iter().nth(at).and_then(Result::err);
        std::panic::resume_unwind(panic.expect("position found an error"));
    }
    results.into_iter().map(|r| r.unwrap_or_else(|p| std::panic::resume_unwind(p))).collect()
}

const UNEQUAL: &str = "ranks must make the same collective calls in the same order";
const ENDED: &str = "ended because another simulated rank panicked";

/// Hands the token on when a rank ends, in good order or by a panic.
struct Leaving<'a>(&'a Sim);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.doing[self.0.rank] = Doing::Done;
        state.broken |= std::thread::panicking();
        self.0.hand_on(&mut state);
    }
}

impl State {
    /// splitmix64.
    fn draw(&mut self, below: usize) -> usize {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.random ^ self.random >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % below as u64) as usize
    }

    /// Delivers the call under way once everyone has posted.
    fn deliver(&mut self) {
        if !self.posted.iter().all(Option::is_some) {
            return;
        }
        let posts: Vec<Post> = self.posted.iter_mut().filter_map(Option::take).collect();
        let (ranks, call) = (posts.len(), posts[0].call);
        let (mut gathered, mut summed, mut exchanged) = (Vec::new(), Vec::new(), Vec::new());
        for post in posts {
            assert!(post.call == call, "{UNEQUAL}");
            match post.words {
                Words::Gather(words) => gathered.push(words),
                Words::Sum(words) => summed.push(words),
                Words::Exchange(message_buffer) => exchanged.push(message_buffer),
            }
        }
        self.inbox = match [gathered.len(), summed.len(), exchanged.len()].map(|n| n == ranks) {
            [true, false, false] => {
                let all: Gathered =
                    gathered.into_iter().enumerate().collect::<MessageBuffer>().into();
                (0..ranks).map(|_| Some(Delivery::Gathered(all.clone()))).collect()
            }
            [false, true, false] => {
                let sums = summed_up(&summed);
                (0..ranks).map(|_| Some(Delivery::Summed(sums.clone()))).collect()
            }
            [false, false, true] => {
                self.sorted(&exchanged).into_iter().map(|m| Some(Delivery::Exchanged(m))).collect()
            }
            _ => panic!("{UNEQUAL}"),
        };
        self.doing.iter_mut().for_each(|d| *d = Doing::Ready);
    }

    /// Letters by receiver, in an order that is drawn, from those by sender.
    fn sorted(&mut self, sent: &[MessageBuffer]) -> Vec<MessageBuffer> {
        let mut inbox: Vec<Vec<(usize, &[u64])>> = vec![Vec::new(); sent.len()];
        for (from, message_buffer) in sent.iter().enumerate() {
            for (to, words) in message_buffer.messages() {
                assert!(inbox[to].last().is_none_or(|l| l.0 != from), "one letter to a receiver");
                inbox[to].push((from, words));
            }
        }
        for messages in &mut inbox {
            for i in (1..messages.len()).rev() {
                let j = self.draw(i + 1);
                messages.swap(i, j);
            }
        }
        let copied = |messages: Vec<(usize, &[u64])>| {
            let mut message_buffer =
                MessageBuffer::with_capacity(messages.iter().map(|l| l.1.len()).sum());
            messages
                .iter()
                .for_each(|(from, words)| message_buffer.write(*from, words.iter().copied()));
            message_buffer
        };
        inbox.into_iter().map(copied).collect()
    }
}

/// The sums of as many words on each rank.
fn summed_up(ranks: &[Vec<u64>]) -> Vec<u64> {
    let mut sums = vec![0u64; ranks[0].len()];
    for words in ranks {
        assert!(words.len() == sums.len(), "{UNEQUAL}");
        sums.iter_mut().zip(words).for_each(|(sum, w)| *sum = sum.wrapping_add(*w));
    }
    sums
}

impl Sim {
    fn lock(&self) -> MutexGuard<'_, State> {
        // A poisoned lock means that another rank panicked; `broken` tells the same.
        self.world.state.lock().unwrap_or_else(|p| p.into_inner())
    }

    /// Draws the rank that runs next.
    fn hand_on(&self, state: &mut State) {
        let ready: Vec<usize> =
            (0..self.world.size).filter(|&r| state.doing[r] == Doing::Ready).collect();
        if !ready.is_empty() {
            state.running = ready[state.draw(ready.len())];
            self.world.turns[state.running].notify_one();
        } else if state.doing.contains(&Doing::Waiting) {
            // Some wait for a call that those who are done will never make.
            state.broken = true;
        }
        if state.broken {
            self.world.turns.iter().for_each(Condvar::notify_one);
        }
    }

    fn wait_for_turn(&self) {
        let mut state = self.lock();
        while !(state.broken
            || state.running == self.rank && state.doing[self.rank] == Doing::Ready)
        {
            state = self.world.turns[self.rank].wait(state).unwrap_or_else(|p| p.into_inner());
        }
        if state.broken {
            drop(state);
            std::panic::panic_any(ENDED);
        }
    }

    fn call(&self, words: Words) -> Delivery {
        let call = self.calls.replace(self.calls.get() + 1);
        let mut state = self.lock();
        state.posted[self.rank] = Some(Post { call, words });
        state.doing[self.rank] = Doing::Waiting;
        state.deliver();
        self.hand_on(&mut state);
        drop(state);
        self.wait_for_turn();
        self.lock().inbox[self.rank].take().expect("a delivered call has an inbox for every rank")
    }
}

impl Comm for Sim {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.world.size
    }

    fn all_gather(&self, mine: &[u64]) -> Gathered {
        match self.meter.call(|| self.call(Words::Gather(mine.to_vec()))) {
            Delivery::Gathered(all) => {
                self.meter.gather(self.size(), all.words().len() as u64);
                all
            }
            _ => unreachable!("{UNEQUAL}"),
        }
    }

    fn sums(&self, mine: &[u64]) -> Vec<u64> {
        self.meter.sum(self.size(), mine.len() as u64);
        match self.meter.call(|| self.call(Words::Sum(mine.to_vec()))) {
            Delivery::Summed(sums) => sums,
            _ => unreachable!("{UNEQUAL}"),
        }
    }

    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer {
        let counted = || {
            let sent = to.messages().filter(|l| l.0 != self.rank);
            sent.for_each(|l| self.meter.send(l.0, l.1.len()));
            self.meter.arrived(self.size());
            self.call(Words::Exchange(to))
        };
        match self.meter.call(counted) {
            Delivery::Exchanged(message_buffer) => message_buffer,
            _ => unreachable!("{UNEQUAL}"),
        }
    }

    fn ranks_in_process(&self) -> usize {
        self.size()
    }

    fn traffic(&self) -> Traffic {
        self.meter.get()
    }

    fn sent(&self) -> Vec<matrix::Entry> {
        self.meter.sent(self.rank)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everyone_hears_everyone_whatever_the_seed() {
        for seed in 0..20 {
            let sums = run(7, seed, |c| {
                let to = (0..c.size())
                    .filter(|r| r % 2 == 0)
                    .map(|r| (r, vec![c.rank() as u64; 2]))
                    .collect();
                let heard: u64 = c.sparse_all_to_all(to).messages().map(|l| l.1[0]).sum();
                (c.sum(c.rank() as u64), heard)
            });
            for (rank, (sum, heard)) in sums.into_iter().enumerate() {
                assert_eq!(sum, 21);
                assert_eq!(heard, if rank % 2 == 0 { 21 } else { 0 });
            }
        }
    }

    #[test]
    fn orders_differ_by_seed_and_repeat_by_seed() {
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
    #[should_panic(expected = "rank two fails")]
    fn a_panic_on_one_rank_ends_all() {
        run(4, 1, |c| {
            assert!(c.rank() != 2, "rank two fails");
            c.sum(1)
        });
    }

    #[test]
    #[should_panic(expected = "another simulated rank")]
    fn a_rank_that_leaves_early_does_not_hang_the_rest() {
        run(3, 1, |c| if c.rank() == 0 { 0 } else { c.sum(1) });
    }
}
