//! The state that simulated ranks share, who may run and the messages of the current call, and the schedules that choose which rank runs
//! next and in which order messages arrive.

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
        let state = &mut *self.lock();
        state.ranks[rank] = Rank::Waiting(call, words);
        let posts = state.ranks.iter().map(|rank| match rank {
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
            Call::Send => delivered(&sent, &mut *state.schedule),
        };
        state.ranks = results.into_iter().map(|result| Rank::Ready(Some(result))).collect();
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

/// A message that arrives: its sender and its words.
pub type Arrival<'a> = (usize, &'a [u64]);

/// Chooses what MPI leaves open.
pub trait Schedule: Send {
    /// The position in `ready` of the rank that runs next. `ready` is ascending and not empty.
    fn next(&mut self, ready: &[usize]) -> usize;

    /// Permutes the messages that a receiver gets in a sparse all-to-all into the order of their arrival; they come in the order of
    /// their senders.
    fn arrange(&mut self, receiver: usize, messages: &mut [Arrival]);
}

/// A schedule drawn from a seed. Ranks run, and messages arrive, in an order of all ranks that is drawn: at every choice, now and then, or
/// once. So a rank may be starved, which runs only when all others wait for it, or preferred, and its messages may always arrive late.
pub struct Adversary {
    random: u64,
    /// Determines the order of the ranks.
    order: u64,
    /// One in this number of choices is in another order than the one before it.
    change: usize,
}

/// An order lasts for one choice, for some, for many, or for the whole run.
const CHANGES: [usize; 4] = [1, 4, 32, usize::MAX];

impl Adversary {
    /// The schedule of a seed.
    pub fn new(seed: u64) -> Self {
        let mut adversary = Self { random: seed, order: 0, change: 1 };
        adversary.change = CHANGES[adversary.draw() as usize % CHANGES.len()];
        adversary.order = adversary.draw();
        adversary
    }

    /// A number from the generator splitmix64.
    fn draw(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.random)
    }

    /// The order of the ranks for the next choice.
    fn drawn_order(&mut self) -> impl Fn(usize) -> u64 + use<> {
        if self.draw().is_multiple_of(self.change as u64) {
            self.order = self.draw();
        }
        let order = self.order;
        move |rank| mix(order ^ rank as u64)
    }
}

fn mix(z: u64) -> u64 {
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

impl Schedule for Adversary {
    fn next(&mut self, ready: &[usize]) -> usize {
        let order = self.drawn_order();
        (0..ready.len()).min_by_key(|&at| order(ready[at])).unwrap_or(0)
    }

    fn arrange(&mut self, _: usize, messages: &mut [Arrival]) {
        let order = self.drawn_order();
        messages.sort_by_key(|message| order(message.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// The ranks that run next in forty choices between five, and the senders in the order of arrival.
    fn choices(adversary: &mut Adversary) -> Vec<(usize, Vec<usize>)> {
        let words = [0];
        let choice = |_| {
            let next = adversary.next(&[0, 1, 2, 3, 4]);
            let mut messages: Vec<Arrival> = (0..5).map(|from| (from, &words[..])).collect();
            adversary.arrange(0, &mut messages);
            (next, messages.iter().map(|m| m.0).collect())
        };
        (0..40).map(choice).collect()
    }

    /// Seeds of failures that were found are kept.
    #[test]
    fn a_seed_means_the_same_schedule_for_ever() {
        let first = |seed| choices(&mut Adversary::new(seed)).swap_remove(0);
        assert_eq!([1, 2, 3].map(first), [1, 2, 3].map(first));
        assert_eq!(mix(1), 0x5692_161d_100b_05e5);
    }

    #[test]
    fn an_order_lasts_for_one_choice_some_or_all() {
        let of = |change| choices(&mut Adversary { random: 7, order: 9, change });
        let different = |change| of(change).into_iter().collect::<BTreeSet<_>>().len();
        assert_eq!(different(usize::MAX), 1);
        assert!((2..40).contains(&different(32)) && different(1) > 30, "{}", different(32));
        let (next, arrivals) = &of(usize::MAX)[0];
        assert_eq!(*next, arrivals[0], "the preferred rank's messages arrive first");
        let mut adversary = Adversary { random: 7, order: 9, change: usize::MAX };
        // The last rank of the order is starved: it runs when no other can.
        let last = arrivals[4];
        for other in (0..5).filter(|&rank| rank != last) {
            let ready = [last.min(other), last.max(other)];
            assert_eq!(ready[adversary.next(&ready)], other);
        }
    }

    #[test]
    fn seeds_have_all_changes_and_many_orders() {
        let all: Vec<Adversary> = (0..40).map(Adversary::new).collect();
        assert_eq!(all.iter().map(|a| a.change).collect::<BTreeSet<_>>().len(), CHANGES.len());
        let orders = all.into_iter().map(|mut adversary| choices(&mut adversary).swap_remove(0).1);
        assert!(orders.collect::<BTreeSet<_>>().len() > 20);
    }
}
