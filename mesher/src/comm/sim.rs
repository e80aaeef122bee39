//! Simulated ranks in one process, for tests and projections.
//!
//! Each rank is a thread, but only the rank with the token runs. It passes the token on when it has to wait for others. The next
//! rank and the order in which messages arrive are drawn from a seed. So a failure can be replayed from its seed, and the CPU
//! time of a rank is not disturbed by the others.

use super::{Comm, Gathered, MessageBuffer, Meter, Traffic, matrix};
use std::any::Any;
use std::cell::Cell;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};

/// One rank of a simulated group.
pub struct Sim {
    rank: usize,
    world: Arc<World>,
    meter: Meter,
    /// Number of collective calls so far, to detect ranks that do not make the same calls.
    calls: Cell<u64>,
}

struct World {
    size: usize,
    state: Mutex<State>,
    /// One per rank, so that passing the token wakes one thread only.
    turns: Vec<Condvar>,
}

#[derive(Clone, Copy, PartialEq)]
enum RankState {
    Ready,
    Waiting,
    Done,
}

struct State {
    running: usize,
    states: Vec<RankState>,
    /// The contribution of each rank to the current call.
    posted: Vec<Option<Post>>,
    /// The result of the current call for each rank.
    results: Vec<Option<Delivery>>,
    random: u64,
    broken: bool,
}

struct Post {
    /// The number of the call.
    call: u64,
    words: Words,
}

/// The contribution of a rank to a call.
enum Words {
    /// Gathered by all ranks.
    Gather(Vec<u64>),
    /// Summed over the ranks.
    Sum(Vec<u64>),
    /// Messages by receiver.
    Send(MessageBuffer),
}

/// The result of a call for a rank.
enum Delivery {
    Gathered(Gathered),
    Summed(Vec<u64>),
    Received(MessageBuffer),
}

/// Runs `body` on `size` ranks under the schedule of `seed`; returns what each rank returned.
///
/// # Panics
/// With the panic of the lowest rank that panicked; the other ranks are stopped.
pub fn run<T: Send>(size: usize, seed: u64, body: impl Fn(&Sim) -> T + Sync) -> Vec<T> {
    assert!(size > 0, "a group has at least one rank");
    let world = Arc::new(World {
        size,
        state: Mutex::new(State {
            running: 0,
            states: vec![RankState::Ready; size],
            posted: (0..size).map(|_| None).collect(),
            results: (0..size).map(|_| None).collect(),
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
    let is_stopped =
        |p: &Box<dyn Any + Send>| p.downcast_ref::<&str>().is_some_and(|m| *m == STOPPED);
    if let Some(at) = results.iter().position(|r| r.as_ref().is_err_and(|p| !is_stopped(p))) {
        let panic = results.into_iter().nth(at).and_then(Result::err);
        std::panic::resume_unwind(panic.expect("position found an error"));
    }
    results.into_iter().map(|r| r.unwrap_or_else(|p| std::panic::resume_unwind(p))).collect()
}

const UNEQUAL: &str = "ranks must make the same collective calls in the same order";
const STOPPED: &str = "stopped because another simulated rank panicked";

/// Passes the token on when a rank ends, normally or by a panic.
struct Leaving<'a>(&'a Sim);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        let mut state = self.0.lock();
        state.states[self.0.rank] = RankState::Done;
        state.broken |= std::thread::panicking();
        self.0.pass_token(&mut state);
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

    /// Completes the current call once all ranks have contributed.
    fn deliver(&mut self) {
        if !self.posted.iter().all(Option::is_some) {
            return;
        }
        let posts: Vec<Post> = self.posted.iter_mut().filter_map(Option::take).collect();
        let (ranks, call) = (posts.len(), posts[0].call);
        let (mut gathered, mut summed, mut sent) = (Vec::new(), Vec::new(), Vec::new());
        for post in posts {
            assert!(post.call == call, "{UNEQUAL}");
            match post.words {
                Words::Gather(words) => gathered.push(words),
                Words::Sum(words) => summed.push(words),
                Words::Send(messages) => sent.push(messages),
            }
        }
        self.results = match [gathered.len(), summed.len(), sent.len()].map(|n| n == ranks) {
            [true, false, false] => {
                let all: Gathered =
                    gathered.into_iter().enumerate().collect::<MessageBuffer>().into();
                (0..ranks).map(|_| Some(Delivery::Gathered(all.clone()))).collect()
            }
            [false, true, false] => {
                let sums = sums_of(&summed);
                (0..ranks).map(|_| Some(Delivery::Summed(sums.clone()))).collect()
            }
            [false, false, true] => {
                self.delivered(&sent).into_iter().map(|m| Some(Delivery::Received(m))).collect()
            }
            _ => panic!("{UNEQUAL}"),
        };
        self.states.iter_mut().for_each(|d| *d = RankState::Ready);
    }

    /// Messages by receiver, in an order drawn at random, from those by sender.
    fn delivered(&mut self, sent: &[MessageBuffer]) -> Vec<MessageBuffer> {
        let mut by_receiver: Vec<Vec<(usize, &[u64])>> = vec![Vec::new(); sent.len()];
        for (from, messages) in sent.iter().enumerate() {
            for (to, words) in messages.messages() {
                assert!(
                    by_receiver[to].last().is_none_or(|l| l.0 != from),
                    "at most one message to a receiver"
                );
                by_receiver[to].push((from, words));
            }
        }
        for messages in &mut by_receiver {
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
        by_receiver.into_iter().map(copied).collect()
    }
}

/// The sums over the ranks.
fn sums_of(ranks: &[Vec<u64>]) -> Vec<u64> {
    let mut sums = vec![0u64; ranks[0].len()];
    for words in ranks {
        assert!(words.len() == sums.len(), "{UNEQUAL}");
        sums.iter_mut().zip(words).for_each(|(sum, w)| *sum = sum.wrapping_add(*w));
    }
    sums
}

impl Sim {
    fn lock(&self) -> MutexGuard<'_, State> {
        // A poisoned lock means that another rank panicked, which `broken` records as well.
        self.world.state.lock().unwrap_or_else(|p| p.into_inner())
    }

    /// Draws the next rank to run.
    fn pass_token(&self, state: &mut State) {
        let ready: Vec<usize> =
            (0..self.world.size).filter(|&r| state.states[r] == RankState::Ready).collect();
        if !ready.is_empty() {
            state.running = ready[state.draw(ready.len())];
            self.world.turns[state.running].notify_one();
        } else if state.states.contains(&RankState::Waiting) {
            // Some ranks wait for a call that the ranks that have ended will never make.
            state.broken = true;
        }
        if state.broken {
            self.world.turns.iter().for_each(Condvar::notify_one);
        }
    }

    fn wait_for_turn(&self) {
        let mut state = self.lock();
        while !(state.broken
            || state.running == self.rank && state.states[self.rank] == RankState::Ready)
        {
            state = self.world.turns[self.rank].wait(state).unwrap_or_else(|p| p.into_inner());
        }
        if state.broken {
            drop(state);
            std::panic::panic_any(STOPPED);
        }
    }

    fn call(&self, words: Words) -> Delivery {
        let call = self.calls.replace(self.calls.get() + 1);
        let mut state = self.lock();
        state.posted[self.rank] = Some(Post { call, words });
        state.states[self.rank] = RankState::Waiting;
        state.deliver();
        self.pass_token(&mut state);
        drop(state);
        self.wait_for_turn();
        self.lock().results[self.rank].take().expect("a completed call has a result for every rank")
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
            self.call(Words::Send(to))
        };
        match self.meter.call(counted) {
            Delivery::Received(message_buffer) => message_buffer,
            _ => unreachable!("{UNEQUAL}"),
        }
    }

    fn ranks_in_process(&self) -> usize {
        self.size()
    }

    fn traffic(&self) -> Traffic {
        self.meter.get()
    }

    fn uncounted(&self, body: &mut dyn FnMut()) {
        self.meter.pause(body);
    }

    fn sent(&self) -> Vec<matrix::Entry> {
        self.meter.sent(self.rank)
    }
}

#[cfg(test)]
mod tests;
