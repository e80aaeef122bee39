//! Ranks of a real MPI job, through `rsmpi`.
//!
//! A sparse all-to-all sends point-to-point messages only to the ranks that need one: of a thousand ranks each sends to dozens. A
//! dense all-to-all of mostly empty messages was measured to take a hundred times as long with several ranks per core. MPI counts words
//! in i32: a message, or all that an allgather brings, of 16 GiB or more is a panic.
//!
//! # A limit for calls
//! With a limit, collective calls are non-blocking. The rank that the others wait for is then named, and the job ends:
//! a rank that has waited for longer than the limit asks all others for a sign, on a communicator of its own. Ranks that wait themselves
//! answer at once, as they look for questions while they wait. Those that do not answer compute, hang, or have been stopped. The rank that
//! names them informs the others before, which then say nothing, however long the end of the job takes.

use crate::{Comm, Gathered, MessageBuffer, Metered, STALLED};
use files::interrupt;
use mpi::collective::SystemOperation;
use mpi::environment::Universe;
use mpi::request::{Request, Scope};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Destination, Equivalence, Source};
use std::cell::{Cell, OnceCell, RefCell};
use std::collections::BTreeSet;
use std::io::{Write, stderr};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Tag of the message that begins another run. Sparse all-to-alls have 0 and 1.
const NEXT_RUN: i32 = 2;
const TOO_LONG: &str = "MPI must be able to count the words of a message";
/// Longest sleep of a rank between two runs.
const PAUSE_MAX: Duration = Duration::from_millis(50);

/// One rank of an MPI job.
struct Mpi {
    /// Present if calls have a limit.
    watch: OnceCell<Watch>,
    world: mpi::topology::SimpleCommunicator,
    /// Whether the number of sparse all-to-alls so far is odd.
    odd: Cell<bool>,
    /// Finalises MPI when dropped; must outlive `world`, so it comes last.
    _universe: Universe,
}

/// Joins the job of MPI that the launcher has started. Once per process.
///
/// # Panics
/// If MPI was initialised before.
pub fn join() -> Box<dyn Comm> {
    // A launcher that is interrupted twice ends at once and leaves its ranks running: its end interrupts them. Where that is impossible, they end
    // when they next communicate.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM));
    let universe = mpi::initialize().expect("MPI is initialised once");
    Box::new(Metered::new(Mpi {
        watch: OnceCell::new(),
        world: universe.world(),
        odd: Cell::new(false),
        _universe: universe,
    }))
}

/// Ends all ranks of the job at once, between initialisation and finalisation; outside of that time there is none, and this returns.
pub fn abort(code: i32) {
    // SAFETY: MPI_Abort may be called at any time between initialisation and finalisation.
    unsafe {
        let (mut up, mut down) = (0, 0);
        mpi::ffi::MPI_Initialized(&mut up);
        mpi::ffi::MPI_Finalized(&mut down);
        if up != 0 && down == 0 {
            mpi::ffi::MPI_Abort(mpi::ffi::RSMPI_COMM_WORLD, code);
        }
    }
}

impl Comm for Mpi {
    fn rank(&self) -> usize {
        self.world.rank() as usize
    }

    fn size(&self) -> usize {
        self.world.size() as usize
    }

    fn all_gather(&self, mine: &[u64]) -> Gathered {
        let length = i32::try_from(mine.len()).expect(TOO_LONG);
        let mut lengths = vec![0; self.size()];
        match self.watch.get() {
            None => self.world.all_gather_into(&length, &mut lengths[..]),
            Some(watch) => mpi::request::scope(|scope| {
                let all = &mut lengths[..];
                complete(watch, self.world.immediate_all_gather_into(scope, &length, all));
            }),
        }
        let mut all = MessageBuffer::default();
        for (rank, &words) in lengths.iter().enumerate() {
            all.room(rank, words as usize);
        }
        i32::try_from(all.words().len()).expect(TOO_LONG);
        let starts: Vec<i32> =
            lengths.iter().scan(0, |s, &n| Some(std::mem::replace(s, *s + n))).collect();
        let mut target = mpi::datatype::PartitionMut::new(all.words_mut(), lengths, &starts[..]);
        match self.watch.get() {
            None => self.world.all_gather_varcount_into(mine, &mut target),
            Some(watch) => mpi::request::scope(|scope| {
                let to = &mut target;
                complete(watch, self.world.immediate_all_gather_varcount_into(scope, mine, to));
            }),
        }
        all.into()
    }

    fn sums(&self, mine: &[u64]) -> Vec<u64> {
        let mut sums = vec![0; mine.len()];
        match self.watch.get() {
            None => self.world.all_reduce_into(mine, &mut sums[..], SystemOperation::sum()),
            Some(watch) => mpi::request::scope(|scope| {
                let (to, sum) = (&mut sums[..], SystemOperation::sum());
                complete(watch, self.world.immediate_all_reduce_into(scope, mine, to, sum));
            }),
        }
        sums
    }

    /// Sends the messages and receives until all ranks know that their messages have arrived. A synchronous send completes when its
    /// receiver has started to receive; a rank whose sends are complete enters a non-blocking barrier (NBX: Hoefler,
    /// Siebert, Lumsdaine 2010, "Scalable communication protocols for dynamic sparse data exchange").
    fn sparse_all_to_all(&self, to: MessageBuffer) -> MessageBuffer {
        let me = self.rank();
        // A rank that has passed the barrier may start the next sparse all-to-all while others still receive in this one. No rank can be
        // two calls ahead, so two tags suffice.
        let tag = i32::from(self.odd.replace(!self.odd.get()));
        let mut received = MessageBuffer::default();
        mpi::request::scope(|scope| {
            let mut sends = Vec::new();
            for (to, words) in to.messages() {
                if to == me {
                    received.write(me, words.iter().copied());
                    continue;
                }
                let process = self.world.process_at_rank(to as i32);
                sends.push(process.immediate_synchronous_send_with_tag(scope, words, tag));
            }
            let mut barrier = None;
            self.watch.get().into_iter().for_each(Watch::start);
            loop {
                self.watch.get().into_iter().for_each(Watch::poll);
                while let Some((message, status)) =
                    self.world.any_process().immediate_matched_probe_with_tag(tag)
                {
                    let words = status.count(u64::equivalent_datatype()) as usize;
                    let from = status.source_rank() as usize;
                    message.matched_receive_into(received.room(from, words));
                }
                sends = sends.into_iter().filter_map(|send| send.test().err()).collect();
                if sends.is_empty() {
                    let entered = barrier.take().unwrap_or_else(|| self.world.immediate_barrier());
                    match entered.test() {
                        Ok(_) => break,
                        Err(pending) => barrier = Some(pending),
                    }
                }
            }
        });
        received
    }

    fn next_run(&self) {
        if self.rank() == 0 {
            return tell_others(&self.world, NEXT_RUN);
        }
        // MPI itself would wait by computing.
        let first = self.world.process_at_rank(0);
        let mut pause = Duration::from_micros(100);
        while first.immediate_probe_with_tag(NEXT_RUN).is_none() {
            sleep(pause);
            pause = (pause * 3 / 2).min(PAUSE_MAX);
        }
        first.receive_with_tag::<u64>(NEXT_RUN);
    }

    fn limit_calls(&self, limit: Duration) {
        self.watch.get_or_init(|| Watch {
            side: self.world.duplicate(),
            limit,
            phase: Cell::new("start"),
            since: Cell::new(Instant::now()),
            answered: RefCell::new(None),
        });
    }

    fn enter(&self, phase: &'static str) {
        if let Some(watch) = self.watch.get() {
            watch.phase.set(phase);
        }
    }
}

/// Sends all other ranks a message that is its tag.
fn tell_others(comm: &SimpleCommunicator, tag: i32) {
    for rank in (0..comm.size()).filter(|&rank| rank != comm.rank()) {
        comm.process_at_rank(rank).send_with_tag(&0u64, tag);
    }
}

/// Waits for a collective call under a limit.
fn complete<'a, D: ?Sized, S: Scope<'a>>(watch: &Watch, mut request: Request<'a, D, S>) {
    watch.start();
    while let Err(pending) = request.test() {
        watch.poll();
        request = pending;
    }
}

/// Least time for an answer.
const PATIENCE: Duration = Duration::from_secs(1);
const QUESTION: i32 = 1;
const ANSWER: i32 = 2;
const END: i32 = 3;

/// Watches the calls of a rank.
struct Watch {
    side: SimpleCommunicator,
    limit: Duration,
    /// The phase that the rank is in.
    phase: Cell<&'static str>,
    /// The start of the present call, or the time of the question.
    since: Cell<Instant>,
    /// The ranks that have answered; none if there was no question.
    answered: RefCell<Option<BTreeSet<i32>>>,
}

impl Watch {
    /// Begins a call.
    fn start(&self) {
        self.since.set(Instant::now());
        *self.answered.borrow_mut() = None;
    }

    /// Answers questions, and asks when the limit is exceeded. Again and again during a call.
    fn poll(&self) {
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
                tell_others(&self.side, QUESTION);
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

    fn end(&self, answered: &BTreeSet<i32>) -> ! {
        tell_others(&self.side, END);
        let silent = (0..self.side.size()).filter(|rank| !answered.contains(rank));
        let silent: Vec<String> = silent.map(|rank| rank.to_string()).collect();
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
