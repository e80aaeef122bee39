//! Simulated ranks as coroutines: many schedules of small cases in a short time.
#![allow(dead_code, missing_docs)]

use corosensei::stack::DefaultStack;
use corosensei::{Coroutine, CoroutineResult, Yielder};
use ranks::sim::{Next, Schedule, Sim, Token, World};
use std::rc::Rc;

/// Bytes of a coroutine's stack; only pages that are used take memory.
const STACK: usize = 4 << 20;

/// Runs worlds one after the other. Keeps the stacks: mapping and releasing them would take longer than a small mesh.
#[derive(Default)]
pub struct Fibres {
    stacks: Vec<DefaultStack>,
}

/// A rank's coroutine, seen from inside.
struct Fibre<'a>(&'a Yielder<(), ()>);

impl Token for Fibre<'_> {
    fn pass(&self, _: usize) {
        self.0.suspend(());
    }
}

impl Fibres {
    /// Runs `body` on `size` ranks; returns what each rank returned.
    ///
    /// # Panics
    /// With the panic of the first rank that panics. The other ranks are unwound.
    pub fn run<T: 'static>(
        &mut self,
        size: usize,
        schedule: impl Schedule + 'static,
        body: impl Fn(&Sim) -> T + 'static,
    ) -> Vec<T> {
        let world = Rc::new(World::new(size, schedule));
        let body = Rc::new(body);
        let mut ranks: Vec<_> = (0..size)
            .map(|rank| {
                let (world, body) = (world.clone(), body.clone());
                let stack = self.stacks.pop().unwrap_or_else(stack);
                Coroutine::with_stack(stack, move |yielder: &Yielder<(), ()>, ()| {
                    body(&Sim::new(rank, &world, &Fibre(yielder)))
                })
            })
            .collect();
        let mut results: Vec<Option<T>> = (0..size).map(|_| None).collect();
        loop {
            match world.next() {
                Next::Run(rank) => {
                    if let CoroutineResult::Return(result) = ranks[rank].resume(()) {
                        results[rank] = Some(result);
                        world.end(rank, false);
                    }
                }
                Next::End => break,
                Next::Stop => panic!("ranks wait for a call that another rank does not make"),
            }
        }
        self.stacks.extend(ranks.into_iter().map(Coroutine::into_stack));
        results.into_iter().map(|r| r.expect("every rank has ended")).collect()
    }
}

fn stack() -> DefaultStack {
    DefaultStack::new(STACK).expect("address space for a stack")
}
