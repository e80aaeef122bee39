//! The state that simulated ranks share: who may run, and the messages of the current call.

use super::schedule::{Arrival, Schedule};
use crate::{Gathered, MessageBuffer};
use std::sync::{Mutex, MutexGuard};

/// The ranks of a simulated group, and their messages.
pub struct World {
    /// Number of ranks.
    pub(super) size: usize,
    state: Mutex<State>,
}

/// What a rank does.
enum Rank {
    /// It can run, with the result of its last call unless it has taken it.
    Ready(Option<Gathered>),
    /// It waits for the others to make the same call, to which it contributes words.
    Waiting(Call, MessageBuffer),
    Done,
}

struct State {
    ranks: Vec<Rank>,
    schedule: Box<dyn Schedule>,
    broken: bool,
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
        let ranks = (0..size).map(|_| Rank::Ready(None)).collect();
        let state = Mutex::new(State { ranks, schedule: Box::new(schedule), broken: false });
        Self { size, state }
    }

    /// Chooses the next rank, which runs until its next call. None can go on if all have ended, one has panicked, or ranks wait for a call
    /// that a rank that has ended will never make.
    pub fn next(&self) -> Option<usize> {
        let state = &mut *self.lock();
        let is_ready = |rank: &usize| matches!(state.ranks[*rank], Rank::Ready(_));
        let ready: Vec<usize> = (0..self.size).filter(is_ready).collect();
        let can_run = !state.broken && !ready.is_empty();
        can_run.then(|| ready[state.schedule.next(&ready)])
    }

    /// Notes that a rank has ended, normally or by a panic.
    pub fn end(&self, rank: usize, has_panicked: bool) {
        let mut state = self.lock();
        state.ranks[rank] = Rank::Done;
        state.broken |= has_panicked;
    }

    /// A rank's contribution to its next call, which completes the call if it is the last one.
    pub(super) fn post(&self, rank: usize, call: Call, words: MessageBuffer) {
        let mut state = self.lock();
        state.ranks[rank] = Rank::Waiting(call, words);
        state.deliver();
    }

    /// The result of a completed call for a rank.
    pub(super) fn result(&self, rank: usize) -> Gathered {
        match std::mem::replace(&mut self.lock().ranks[rank], Rank::Ready(None)) {
            Rank::Ready(Some(result)) => result,
            _ => unreachable!("a completed call has a result for every rank"),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A poisoned lock means that another rank panicked, which `broken` records as well.
        self.state.lock().unwrap_or_else(|p| p.into_inner())
    }
}

impl State {
    /// Completes the current call once all ranks have contributed.
    fn deliver(&mut self) {
        let posts = self.ranks.iter().map(|rank| match rank {
            Rank::Waiting(call, words) => Some((*call, words)),
            _ => None,
        });
        let Some(posts) = posts.collect::<Option<Vec<_>>>() else { return };
        let call = posts[0].0;
        assert!(posts.iter().all(|post| post.0 == call), "{UNEQUAL}");
        let sent: Vec<&MessageBuffer> = posts.iter().map(|post| post.1).collect();
        let words = || sent.iter().map(|messages| messages.words());
        let by_all = |words: MessageBuffer| vec![Gathered::new(words); sent.len()];
        let results = match call {
            Call::Gather => by_all(
                words().enumerate().map(|(rank, words)| (rank, words.iter().copied())).collect(),
            ),
            Call::Sum => by_all([(0, sums(words()))].into_iter().collect()),
            Call::Send => delivered(&sent, &mut *self.schedule),
        };
        self.ranks = results.into_iter().map(|result| Rank::Ready(Some(result))).collect();
    }
}

/// Messages by receiver, in an order that the schedule chooses, from those by sender.
fn delivered(sent: &[&MessageBuffer], schedule: &mut dyn Schedule) -> Vec<Gathered> {
    let mut by_receiver: Vec<Vec<Arrival>> = vec![Vec::new(); sent.len()];
    for (from, messages) in sent.iter().enumerate() {
        for (to, words) in messages.messages() {
            let is_first = by_receiver[to].last().is_none_or(|l| l.0 != from);
            assert!(is_first, "at most one message to a receiver");
            by_receiver[to].push((from, words));
        }
    }
    let arrived = |(receiver, mut messages): (usize, Vec<Arrival>)| {
        schedule.arrange(receiver, &mut messages);
        Gathered::new(messages.iter().map(|(from, words)| (*from, words.iter().copied())).collect())
    };
    by_receiver.into_iter().enumerate().map(arrived).collect()
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
