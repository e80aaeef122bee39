//! Results that are computed on several threads and used in order.

use std::num::NonZero;
use std::sync::mpsc;
use std::thread;

/// Calls `take(i, make(i))` for every `i` below `count`, in order, with `make` on `jobs` threads, each of which holds one result until it
/// is taken.
///
/// # Errors
/// The first error of either function, after which `take` is not called again.
pub fn in_order<T: Send, E: Send>(
    count: usize,
    jobs: NonZero<usize>,
    make: impl Fn(usize) -> Result<T, E> + Sync,
    mut take: impl FnMut(usize, T) -> Result<(), E>,
) -> Result<(), E> {
    let (jobs, make) = (jobs.get().min(count), &make);
    thread::scope(|scope| {
        let worker = |first: usize| {
            let (to, from) = mpsc::sync_channel(0);
            // Nobody receives after an error.
            let work = move || {
                (first..count).step_by(jobs).try_for_each(|i| to.send(make(i)).map_err(drop))
            };
            scope.spawn(work);
            from
        };
        let workers: Vec<_> = (0..jobs).map(worker).collect();
        for index in 0..count {
            // A thread that panicked sends nothing; its panic is passed on where the scope ends.
            let Ok(made) = workers[index % jobs].recv() else { break };
            take(index, made?)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::{AtomicUsize, Ordering};

    const JOBS: [NonZero<usize>; 3] =
        [NonZero::new(1).unwrap(), NonZero::new(3).unwrap(), NonZero::new(20).unwrap()];

    #[test]
    fn results_are_used_in_order_and_each_thread_holds_one() {
        for jobs in JOBS {
            let (made, alive) = (AtomicUsize::new(0), AtomicUsize::new(0));
            let mut taken = Vec::new();
            let make = |i: usize| {
                made.fetch_add(1, Ordering::Relaxed);
                // One that is being taken, too.
                assert!(alive.fetch_add(1, Ordering::Relaxed) <= jobs.get());
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
