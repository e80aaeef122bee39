//! Results that are computed on several threads and used in order.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

/// Calls `take(i, make(i))` for every `i` below `count`, in order, with `make` on `jobs` threads. At most `jobs` results exist
/// at a time.
///
/// # Errors
/// The first error of either function, after which neither is called again.
pub fn in_order<T, E: Send>(
    count: usize,
    jobs: NonZero<usize>,
    make: impl Fn(usize) -> Result<T, E> + Sync,
    take: impl FnMut(usize, T) -> Result<(), E> + Send,
) -> Result<(), E> {
    let next = AtomicUsize::new(0);
    let turn = Turn { state: Mutex::new(State::default()), changed: Condvar::new() };
    let take = Mutex::new(take);
    let work = || {
        let _guard = StopOnPanic(&turn);
        while let Some(index) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < count) {
            let made = make(index);
            if !turn.wait_for(index) {
                return;
            }
            let taken = made.and_then(|made| {
                // Only the thread whose turn it is locks, so this does not wait.
                let mut take = take.lock().unwrap_or_else(PoisonError::into_inner);
                take(index, made)
            });
            turn.end(taken.err());
        }
    };
    thread::scope(|scope| {
        (1..jobs.get().min(count)).for_each(|_| drop(scope.spawn(work)));
        work();
    });
    turn.state.into_inner().unwrap_or_else(PoisonError::into_inner).error.map_or(Ok(()), Err)
}

/// Whose turn it is.
struct Turn<E> {
    state: Mutex<State<E>>,
    changed: Condvar,
}

struct State<E> {
    index: usize,
    is_stopped: bool,
    error: Option<E>,
}

impl<E> Default for State<E> {
    fn default() -> Self {
        Self { index: 0, is_stopped: false, error: None }
    }
}

impl<E> Turn<E> {
    fn lock(&self) -> MutexGuard<'_, State<E>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the turn of a result; whether it comes.
    fn wait_for(&self, index: usize) -> bool {
        let waits = |state: &mut State<E>| state.index != index && !state.is_stopped;
        let waited = self.changed.wait_while(self.lock(), waits);
        !waited.unwrap_or_else(PoisonError::into_inner).is_stopped
    }

    /// Ends the turn of a result; an error is the end of all turns.
    fn end(&self, error: Option<E>) {
        let mut state = self.lock();
        state.index += 1;
        state.is_stopped |= error.is_some();
        state.error = error;
        self.changed.notify_all();
    }
}

/// Ends all turns if its thread panics, because the others would wait for it forever.
struct StopOnPanic<'a, E>(&'a Turn<E>);

impl<E> Drop for StopOnPanic<'_, E> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.lock().is_stopped = true;
            self.0.changed.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    const JOBS: [NonZero<usize>; 3] =
        [NonZero::new(1).unwrap(), NonZero::new(3).unwrap(), NonZero::new(20).unwrap()];

    #[test]
    fn results_are_used_in_order_and_at_most_one_per_thread_exists() {
        for jobs in JOBS {
            let (made, alive) = (AtomicUsize::new(0), AtomicUsize::new(0));
            let mut taken = Vec::new();
            let make = |i: usize| {
                made.fetch_add(1, Ordering::Relaxed);
                assert!(alive.fetch_add(1, Ordering::Relaxed) < jobs.get());
                // Later results are ready first.
                thread::sleep(std::time::Duration::from_micros(500 * (i as u64 % 3)));
                Ok::<_, ()>(i * i)
            };
            let take = |i: usize, square: usize| {
                taken.push((i, square));
                alive.fetch_sub(1, Ordering::Relaxed);
                Ok(())
            };
            in_order(10, jobs, make, take).unwrap();
            assert_eq!(taken, (0..10).map(|i| (i, i * i)).collect::<Vec<_>>());
            assert_eq!(made.into_inner(), 10);
        }
        in_order(0, JOBS[1], |_| Err::<(), _>("made"), |_, ()| Err("taken")).unwrap();
    }

    #[test]
    fn an_error_ends_all_threads_after_the_results_before_it() {
        for jobs in JOBS {
            let mut taken = 0;
            let make = |i: usize| if i == 4 { Err(i) } else { Ok(()) };
            let error = in_order(10, jobs, make, |_, ()| {
                taken += 1;
                Ok(())
            });
            assert_eq!((error, taken), (Err(4), 4));
            assert_eq!(in_order(10, jobs, |_| Ok(()), |i, ()| Err(i)), Err(0));
        }
    }

    #[test]
    fn a_panic_ends_all_threads() {
        for jobs in JOBS {
            let make = |i: usize| match i {
                4 => panic!("on purpose"),
                _ => Ok::<(), ()>(()),
            };
            let run = || in_order(10, jobs, make, |_, ()| Ok(()));
            assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
        }
    }
}
