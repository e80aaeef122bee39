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

/// A schedule drawn from a seed: random choices, or one of the regular patterns in which races hide, or a pattern that changes
/// during the run.
#[derive(Clone, Debug)]
pub struct Adversary {
    random: u64,
    ranks: usize,
    turns: Turns,
    arrivals: Arrivals,
    /// One in this number of choices is followed by another pattern; 0 for a pattern that stays.
    change: usize,
}

/// Patterns of turns.
#[derive(Clone, Copy, Debug)]
enum Turns {
    Random,
    RoundRobin,
    Reversed,
    /// One rank runs only when all others wait for it.
    Starved(usize),
    /// One rank runs whenever it can.
    Preferred(usize),
}

/// Patterns of arrivals.
#[derive(Clone, Copy, Debug)]
enum Arrivals {
    Random,
    BySender,
    Reversed,
    /// The messages of one rank arrive after all others.
    Late(usize),
    /// The messages of one rank arrive before all others.
    Early(usize),
}

impl Adversary {
    /// The schedule of a seed for a number of ranks.
    pub fn new(seed: u64, ranks: usize) -> Self {
        let random = seed ^ 0x9e37_79b9_7f4a_7c15;
        let (turns, arrivals) = (Turns::Random, Arrivals::Random);
        let mut adversary = Self { random, ranks, turns, arrivals, change: 0 };
        adversary.change = [0, 0, 4, 32][adversary.draw(4)];
        adversary.redraw();
        adversary
    }

    /// Draws the patterns.
    fn redraw(&mut self) {
        let rank = self.draw(self.ranks);
        self.turns = match self.draw(6) {
            0 => Turns::RoundRobin,
            1 => Turns::Reversed,
            2 => Turns::Starved(rank),
            3 => Turns::Preferred(rank),
            _ => Turns::Random,
        };
        self.arrivals = match self.draw(8) {
            0 => Arrivals::BySender,
            1 => Arrivals::Reversed,
            2 => Arrivals::Late(rank),
            3 => Arrivals::Early(rank),
            _ => Arrivals::Random,
        };
    }

    fn maybe_redraw(&mut self) {
        if self.change > 0 && self.draw(self.change) == 0 {
            self.redraw();
        }
    }

    /// splitmix64.
    fn draw(&mut self, below: usize) -> usize {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.random ^ self.random >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % below as u64) as usize
    }
}

impl Schedule for Adversary {
    fn next(&mut self, ready: &[usize]) -> usize {
        self.maybe_redraw();
        let position = |rank| ready.binary_search(&rank);
        match self.turns {
            Turns::RoundRobin => 0,
            Turns::Reversed => ready.len() - 1,
            Turns::Preferred(rank) if position(rank).is_ok() => position(rank).unwrap_or(0),
            Turns::Starved(rank) if ready.len() > 1 => {
                let drawn = self.draw(ready.len() - 1);
                drawn + usize::from(position(rank).is_ok_and(|starved| drawn >= starved))
            }
            _ => self.draw(ready.len()),
        }
    }

    fn arrange(&mut self, _: usize, messages: &mut [Arrival]) {
        if messages.len() < 2 {
            return;
        }
        self.maybe_redraw();
        match self.arrivals {
            Arrivals::BySender => return,
            Arrivals::Reversed => return messages.reverse(),
            _ => {}
        }
        for i in (1..messages.len()).rev() {
            let j = self.draw(i + 1);
            messages.swap(i, j);
        }
        match self.arrivals {
            Arrivals::Late(rank) => messages.sort_by_key(|m| m.0 == rank),
            Arrivals::Early(rank) => messages.sort_by_key(|m| m.0 != rank),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns and arrivals that a seed chooses among three, all and two of five ranks.
    fn choices(seed: u64) -> Vec<usize> {
        let mut adversary = Adversary::new(seed, 5);
        let mut all = Vec::new();
        for step in 0..40 {
            let ready: &[usize] = [&[0, 2, 4][..], &[0, 1, 2, 3, 4], &[1, 3], &[2]][step % 4];
            all.push(adversary.next(ready));
            let words = [[0]; 5];
            let mut messages: Vec<Arrival> = (0..5).map(|from| (from, &words[from][..])).collect();
            adversary.arrange(0, &mut messages[..5 - step % 5]);
            all.extend(messages.iter().map(|m| m.0));
        }
        all
    }

    /// A failure is replayed from its seed, also by a later program.
    #[test]
    fn a_seed_means_the_same_schedule_for_ever() {
        let fold = |seed| {
            choices(seed).into_iter().fold(seed, |sum: u64, choice| {
                (sum.rotate_left(5) ^ choice as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            })
        };
        let sums: Vec<u64> = (0..48).map(fold).collect();
        let first: Vec<usize> = choices(1).into_iter().take(18).collect();
        assert_eq!(first, [0, 3, 4, 2, 1, 0, 0, 3, 2, 1, 0, 4, 0, 2, 0, 1, 3, 4]);
        assert_eq!(
            sums.iter().fold(0, |all: u64, sum| all.rotate_left(1) ^ sum),
            0x57195d1ebfbcf708,
            "{sums:?}"
        );
    }

    #[test]
    fn patterns_of_turns_and_arrivals_are_kept() {
        let with = |turns, arrivals| Adversary { random: 7, ranks: 5, turns, arrivals, change: 0 };
        let turn = |turns, ready: &[usize]| with(turns, Arrivals::Random).next(ready);
        assert_eq!(turn(Turns::RoundRobin, &[1, 3, 4]), 0);
        assert_eq!(turn(Turns::Reversed, &[1, 3, 4]), 2);
        assert_eq!(turn(Turns::Preferred(3), &[1, 3, 4]), 1);
        assert_eq!(turn(Turns::Starved(3), &[3]), 0);
        let mut starved = with(Turns::Starved(3), Arrivals::Random);
        let turns: std::collections::BTreeSet<usize> =
            (0..50).map(|_| starved.next(&[1, 3, 4])).collect();
        assert!(turns.into_iter().eq([0, 2]));
        let senders = |arrivals| {
            let mut messages: Vec<Arrival> = (0..4).map(|from| (from, &[0][..])).collect();
            with(Turns::Random, arrivals).arrange(0, &mut messages);
            messages.iter().map(|m| m.0).collect::<Vec<_>>()
        };
        assert_eq!(senders(Arrivals::BySender), [0, 1, 2, 3]);
        assert_eq!(senders(Arrivals::Reversed), [3, 2, 1, 0]);
        assert_eq!(senders(Arrivals::Late(1))[3], 1);
        assert_eq!(senders(Arrivals::Early(2))[0], 2);
        let mut sorted = senders(Arrivals::Random);
        sorted.sort_unstable();
        assert_eq!(sorted, [0, 1, 2, 3]);
    }
}
