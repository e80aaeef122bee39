//! A limit for calls: the rank that the others wait for is named, and the job ends.
//!
//! A rank that has waited for longer than the limit asks all others for a sign, on a communicator of its own. Ranks that wait themselves
//! answer at once, as they look for questions while they wait. Those that do not answer compute, hang, or have been stopped. The rank that
//! names them informs the others before, which then say nothing, however long the end of the job takes.

use crate::STALLED;
use files::interrupt;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Destination, Source};
use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::io::{Write, stderr};
use std::time::{Duration, Instant};

/// Least time for an answer.
const PATIENCE: Duration = Duration::from_secs(1);
const QUESTION: i32 = 1;
const ANSWER: i32 = 2;
const END: i32 = 3;

/// Watches the calls of a rank.
pub struct Watch {
    side: SimpleCommunicator,
    limit: Duration,
    /// The phase that the rank is in.
    pub phase: Cell<&'static str>,
    /// The start of the present call, or the time of the question.
    since: Cell<Instant>,
    /// The ranks that have answered; none if there was no question.
    answered: RefCell<Option<BTreeSet<i32>>>,
}

impl Watch {
    /// Watches calls on a communicator. Collective.
    pub fn new(world: &SimpleCommunicator, limit: Duration) -> Self {
        Self {
            side: world.duplicate(),
            limit,
            phase: Cell::new("start"),
            since: Cell::new(Instant::now()),
            answered: RefCell::new(None),
        }
    }

    /// Begins a call.
    pub fn start(&self) {
        self.since.set(Instant::now());
        *self.answered.borrow_mut() = None;
    }

    /// Answers questions, and asks when the limit is exceeded. Again and again during a call.
    pub fn poll(&self) {
        let mut answered = self.answered.borrow_mut();
        while let Some((message, status)) = self.side.any_process().immediate_matched_probe() {
            let _ = message.matched_receive::<u64>();
            let from = status.source_rank();
            match status.tag() {
                QUESTION => self.side.process_at_rank(from).send_with_tag(&0u64, ANSWER),
                END => {
                    self.since.set(Instant::now());
                    *answered = None;
                }
                _ => answered.iter_mut().for_each(|ranks| _ = ranks.insert(from)),
            }
        }
        let waited = self.since.get().elapsed();
        // A rank that waits answers when the machine runs it.
        let patience = PATIENCE.max(self.limit / 2);
        match &*answered {
            None if waited > self.limit => {
                self.tell_others(QUESTION);
                *answered = Some(BTreeSet::from([self.side.rank()]));
                self.since.set(Instant::now());
            }
            Some(ranks) if waited > patience => {
                if ranks.len() as i32 == self.side.size() {
                    // All ranks wait: the call takes long by itself.
                    drop(answered);
                    self.start();
                } else if ranks.first() == Some(&self.side.rank()) || waited > 3 * patience {
                    self.end(ranks);
                }
            }
            _ => {}
        }
    }

    fn tell_others(&self, tag: i32) {
        let me = self.side.rank();
        for rank in (0..self.side.size()).filter(|&rank| rank != me) {
            self.side.process_at_rank(rank).send_with_tag(&0u64, tag);
        }
    }

    fn end(&self, answered: &BTreeSet<i32>) -> ! {
        self.tell_others(END);
        let silent: Vec<String> = (0..self.side.size())
            .filter(|r| !answered.contains(r))
            .map(|r| r.to_string())
            .collect();
        let line = format!(
            "mesher: the other ranks have waited in phase {} for {} s, and rank {} does not answer: look at it with a debugger, or \
             give a greater --stall-limit\n",
            self.phase.get(),
            self.limit.as_secs_f64(),
            silent.join(", ")
        );
        // A launcher puts lines of its own between two writes.
        let _ = stderr().write_all(line.as_bytes());
        interrupt::abandon(true);
        self.side.abort(STALLED)
    }
}
