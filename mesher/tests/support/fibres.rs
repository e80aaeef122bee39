//! Simulated ranks as coroutines: many schedules of small cases in a short time.
#![allow(dead_code, missing_docs)]

use corosensei::stack::DefaultStack;
use corosensei::{Coroutine, CoroutineResult, Yielder};
use ranks::sim::{Schedule, Sim, World};
use std::cell::RefCell;
use std::rc::Rc;

/// Bytes of a coroutine's stack; only pages that are used take memory.
const STACK: usize = 4 << 20;

thread_local! {
    /// Kept, because mapping and releasing them takes longer than a small mesh.
    static STACKS: RefCell<Vec<DefaultStack>> = const { RefCell::new(Vec::new()) };
}

/// Runs `body` on `size` ranks; returns what each rank returned.
///
/// # Panics
/// With the panic of the first rank that panics. The other ranks are unwound.
pub fn run<T: 'static>(
    size: usize,
    schedule: impl Schedule + 'static,
    body: impl Fn(&Sim) -> T + 'static,
) -> Vec<T> {
    let world = Rc::new(World::new(size, schedule));
    let body = Rc::new(body);
    let mut ranks: Vec<_> = (0..size)
        .map(|rank| {
            let (world, body) = (world.clone(), body.clone());
            let kept = STACKS.with_borrow_mut(Vec::pop);
            let stack = kept.unwrap_or_else(|| DefaultStack::new(STACK).expect("address space"));
            Coroutine::with_stack(stack, move |yielder: &Yielder<(), ()>, ()| {
                body(&Sim::new(rank, &world, &|| yielder.suspend(())))
            })
        })
        .collect();
    let mut results: Vec<Option<T>> = (0..size).map(|_| None).collect();
    while let Some(rank) = world.next() {
        if let CoroutineResult::Return(result) = ranks[rank].resume(()) {
            results[rank] = Some(result);
            world.end(rank, false);
        }
    }
    let is_done = ranks.iter().all(Coroutine::done);
    assert!(is_done, "ranks wait for a call that another rank does not make");
    STACKS.with_borrow_mut(|s| s.extend(ranks.into_iter().map(Coroutine::into_stack)));
    results.into_iter().map(|r| r.expect("every rank has ended")).collect()
}
