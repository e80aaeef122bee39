//! The state that simulated ranks share: who may run, and the messages of the current call.

use super::schedule::Schedule;
use crate::{Gathered, MessageBuffer};
use std::sync::{Mutex, MutexGuard};

/// The ranks of a simulated group, and their messages.
pub struct World {
    size: usize,
    state: Mutex<State>,
}

/// What happens next in a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// This rank runs until its next call.
    Run(usize),
    /// All ranks have ended.
    End,
    /// No rank can go on: one has panicked, or ranks wait for a call that a rank that has ended will never make.
    Stop,
}

#[derive(Clone, Copy, PartialEq)]
enum RankState {
    Ready,
    Waiting,
    Done,
}

struct State {
    ranks: Vec<RankState>,
    /// The contribution of each rank to the current call.
    posted: Vec<Option<Post>>,
    /// The result of the current call for each rank.
    results: Vec<Option<Delivery>>,
    schedule: Box<dyn Schedule>,
    /// Scratch: the ranks that can run.
    ready: Vec<usize>,
    broken: bool,
}

struct Post {
    /// The number of the call.
    call: u64,
    words: Words,
}

/// The contribution of a rank to a call.
pub(super) enum Words {
    /// Gathered by all ranks.
    Gather(Vec<u64>),
    /// Summed over the ranks.
    Sum(Vec<u64>),
    /// Messages by receiver.
    Send(MessageBuffer),
}

/// The result of a call for a rank.
pub(super) enum Delivery {
    Gathered(Gathered),
    Summed(Vec<u64>),
    Received(MessageBuffer),
}

pub(super) const UNEQUAL: &str = "ranks must make the same collective calls in the same order";

impl World {
    /// A group of ranks that have not yet begun.
    ///
    /// # Panics
    /// If there are no ranks.
    pub fn new(size: usize, schedule: impl Schedule + 'static) -> Self {
        assert!(size > 0, "a group has at least one rank");
        let state = Mutex::new(State {
            ranks: vec![RankState::Ready; size],
            posted: (0..size).map(|_| None).collect(),
            results: (0..size).map(|_| None).collect(),
            schedule: Box::new(schedule),
            ready: Vec::with_capacity(size),
            broken: false,
        });
        Self { size, state }
    }

    /// Number of ranks.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Chooses the next rank to run.
    pub fn next(&self) -> Next {
        let state = &mut *self.lock();
        state.ready.clear();
        state.ready.extend((0..self.size).filter(|&r| state.ranks[r] == RankState::Ready));
        if state.broken {
            Next::Stop
        } else if !state.ready.is_empty() {
            Next::Run(state.ready[state.schedule.next(&state.ready)])
        } else if state.ranks.contains(&RankState::Waiting) {
            state.broken = true;
            Next::Stop
        } else {
            Next::End
        }
    }

    /// Notes that a rank has ended, normally or by a panic.
    pub fn end(&self, rank: usize, has_panicked: bool) {
        let mut state = self.lock();
        state.ranks[rank] = RankState::Done;
        state.broken |= has_panicked;
    }

    /// A rank's contribution to its next call, which completes the call if it is the last one.
    pub(super) fn post(&self, rank: usize, call: u64, words: Words) {
        let mut state = self.lock();
        state.posted[rank] = Some(Post { call, words });
        state.ranks[rank] = RankState::Waiting;
        state.deliver();
    }

    /// The result of a completed call for a rank.
    pub(super) fn result(&self, rank: usize) -> Delivery {
        self.lock().results[rank].take().expect("a completed call has a result for every rank")
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A poisoned lock means that another rank panicked, which `broken` records as well.
        self.state.lock().unwrap_or_else(|p| p.into_inner())
    }
}

impl State {
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
        self.ranks.iter_mut().for_each(|d| *d = RankState::Ready);
    }

    /// Messages by receiver, in an order that the schedule chooses, from those by sender.
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
        for (receiver, messages) in by_receiver.iter_mut().enumerate() {
            self.schedule.arrange(receiver, messages);
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
