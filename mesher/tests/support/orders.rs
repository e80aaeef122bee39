//! Enumerates every order in which messages can arrive, and orders of ranks.
#![allow(dead_code, missing_docs)]

use ranks::sim::{Arrival, Schedule};
use std::sync::{Arc, Mutex, MutexGuard};

/// A depth-first walk over the orders of arrival: the choices of one run, in the order in which they are made.
#[derive(Clone, Default)]
pub struct Orders(Arc<Mutex<Walk>>);

#[derive(Default)]
struct Walk {
    /// For each choice, the number of the permutation and the number of permutations.
    choices: Vec<(usize, usize)>,
    /// Choices made in the current run.
    made: usize,
}

impl Orders {
    /// Goes to the next order; returns false after the last one.
    pub fn advance(&self) -> bool {
        let walk = &mut *self.lock();
        // A run whose choices depend on the order of earlier messages may make fewer of them.
        walk.choices.truncate(walk.made);
        walk.made = 0;
        while let Some((choice, of)) = walk.choices.pop() {
            if choice + 1 < of {
                walk.choices.push((choice + 1, of));
                return true;
            }
        }
        false
    }

    /// The product of the numbers of permutations in the last run: the number of orders, if the choices are the same in all of them.
    pub fn product(&self) -> f64 {
        self.lock().choices.iter().map(|c| c.1 as f64).product()
    }

    fn lock(&self) -> MutexGuard<'_, Walk> {
        self.0.lock().unwrap_or_else(|p| p.into_inner())
    }
}

impl Schedule for Orders {
    fn next(&mut self, _: &[usize]) -> usize {
        0
    }

    fn arrange(&mut self, _: usize, messages: &mut [Arrival]) {
        if messages.len() < 2 {
            return;
        }
        let walk = &mut *self.lock();
        if walk.made == walk.choices.len() {
            walk.choices.push((0, (2..=messages.len()).product()));
        }
        permute(messages, walk.choices[walk.made].0);
        walk.made += 1;
    }
}

/// Puts items into their permutation of this number; number 0 leaves them as they are.
pub fn permute<T>(items: &mut [T], mut number: usize) {
    for first in 0..items.len() {
        let rest = items.len() - first;
        items[first..][..=number % rest].rotate_right(1);
        number /= rest;
    }
}

/// All ranks run in ascending order, but in another order before one call.
#[derive(Clone, Debug)]
pub struct Turns {
    /// The order, and the number of the call.
    pub order: Vec<usize>,
    pub call: usize,
    /// Turns so far.
    pub turns: usize,
}

impl Schedule for Turns {
    fn next(&mut self, ready: &[usize]) -> usize {
        let (call, turn) = (self.turns / self.order.len(), self.turns % self.order.len());
        self.turns += 1;
        let wanted = if call == self.call { self.order[turn] } else { turn };
        ready.binary_search(&wanted).expect("every rank runs once between two calls")
    }

    fn arrange(&mut self, _: usize, _: &mut [Arrival]) {}
}
