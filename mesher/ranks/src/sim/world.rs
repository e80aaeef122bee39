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
    results: Vec<Option<Gathered>>,
    schedule: Box<dyn Schedule>,
    /// Scratch: the ranks that can run.
    ready: Vec<usize>,
    broken: bool,
}

struct Post {
    /// The number of the call.
    number: u64,
    call: Call,
    words: MessageBuffer,
}

/// A collective call.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Call {
    /// The words of each rank are received by all.
    Gather,
    /// The sums of the words are received by all.
    Sum,
    /// Messages, by receiver.
    Send,
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
    pub(super) fn post(&self, rank: usize, number: u64, call: Call, words: MessageBuffer) {
        let mut state = self.lock();
        state.posted[rank] = Some(Post { number, call, words });
        state.ranks[rank] = RankState::Waiting;
        state.deliver();
    }

    /// The result of a completed call for a rank.
    pub(super) fn result(&self, rank: usize) -> Gathered {
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
        let call = posts[0].call;
        assert!(posts.iter().all(|p| (p.number, p.call) == (posts[0].number, call)), "{UNEQUAL}");
        let words = || posts.iter().map(|post| post.words.words());
        let by_all = |words: MessageBuffer| vec![Some(Gathered::new(words)); posts.len()];
        self.results = match call {
            Call::Gather => by_all(
                words().enumerate().map(|(rank, words)| (rank, words.iter().copied())).collect(),
            ),
            Call::Sum => by_all([(0, sums(words()))].into_iter().collect()),
            Call::Send => {
                self.delivered(&posts).into_iter().map(|m| Some(Gathered::new(m))).collect()
            }
        };
        self.ranks.iter_mut().for_each(|d| *d = RankState::Ready);
    }

    /// Messages by receiver, in an order that the schedule chooses, from those by sender.
    fn delivered(&mut self, sent: &[Post]) -> Vec<MessageBuffer> {
        let mut by_receiver: Vec<Vec<(usize, &[u64])>> = vec![Vec::new(); sent.len()];
        for (from, post) in sent.iter().enumerate() {
            for (to, words) in post.words.messages() {
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

/// The sums of equally many words of each rank.
fn sums<'a>(ranks: impl Iterator<Item = &'a [u64]>) -> Vec<u64> {
    let add = |mut sums: Vec<u64>, words: &[u64]| {
        assert!(words.len() == sums.len(), "{UNEQUAL}");
        sums.iter_mut().zip(words).for_each(|(sum, w)| *sum = sum.wrapping_add(*w));
        sums
    };
    ranks.map(<[u64]>::to_vec).reduce(|sums, words| add(sums, &words)).unwrap_or_default()
}
