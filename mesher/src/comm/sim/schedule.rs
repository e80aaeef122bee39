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
