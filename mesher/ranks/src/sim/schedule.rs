//! Schedules: which rank runs next, and in which order messages arrive.

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
