//! Efficiencies as the POP centre of excellence defines them, measured or projected, and the cause of the largest loss.
//!
//! With `u[p][r]` the useful time (CPU outside calls to other ranks) of rank r in phase p and T the time
//! that the run took:
//!
//! ```text
//!   load balance      = mean over r of U[r] / max over r of U[r],  U[r] = sum over p of u[p][r]
//!   serialisation     = max over r of U[r] / C,                    C = sum over p of max over r of u[p][r]
//!   transfer          = C / T
//!   communication     = serialisation * transfer
//!   parallel          = load balance * communication = mean U / T
//!   computation scaling = useful time of the reference run, per cell / that of this run, per cell
//!   global            = parallel * computation scaling
//! ```
//!
//! The work of a rank is the same in every repetition; only its time varies. If runs report times by rank, `u[p][r]` is
//! therefore the median over the repetitions (see [`Group`](super::group::Group)), taken before any maximum over ranks: the
//! maximum of many noisy times would select the most disturbed rank.
//!
//! Of a program that reports no phases, useful times are unknown, and so are all factors.
//!
//! C is the time on an ideal network, as ranks wait for each other at the end of a phase. For simulated ranks T is projected:
//! C plus the cost of the counted messages in a latency-bandwidth model.

use super::entry::{Comm, Network, Phase, Run, Spread};

/// The factors of efficiency; 1 is ideal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Efficiency {
    /// Mean useful time over the greatest.
    pub load_balance: f64,
    /// Loss to ranks that wait at the end of phases although the total work is balanced.
    pub serialisation: f64,
    /// Loss to messages and, on MPI, to everything else that is not CPU time of the rank.
    pub transfer: f64,
    /// Useful work per cell of the reference run over that of this one.
    pub computation_scaling: f64,
}

impl Efficiency {
    /// Serialisation and transfer together.
    pub fn communication(&self) -> f64 {
        self.serialisation * self.transfer
    }

    /// Useful time in the ranks' time.
    pub fn parallel(&self) -> f64 {
        self.load_balance * self.communication()
    }

    /// Speedup per rank, for the same number of cells.
    pub fn global(&self) -> f64 {
        self.parallel() * self.computation_scaling
    }

    /// Whether an efficiency needs an explanation: it is above 1, beyond what rounding to percents shows.
    pub(crate) fn is_above_one(&self) -> bool {
        self.global().max(self.parallel()) > ABOVE_ONE
    }

    /// Ranks wait for each other at the end of phases, so neither their balance nor their waiting can gain time.
    /// `off` are the relative errors of both by rounding.
    fn check_invariants(&self, off: [f64; 2]) {
        let Self { load_balance, serialisation, transfer, computation_scaling, .. } = *self;
        assert!(load_balance <= 1.0 + off[0], "load balance of at most 1: {self:?}");
        assert!(serialisation <= 1.0 + off[1], "serialisation of at most 1: {self:?}");
        let are_positive = transfer >= 0.0 && computation_scaling >= 0.0;
        assert!(are_positive, "efficiencies of at least 0: {self:?}");
    }
}

/// Why times, and no factor, are those of an efficiency above 1.
pub const DISTURBED: &str = "A speedup per rank above 1 means that the base case was disturbed, or that its cells took more CPU time where \
     that is unknown.";
/// Efficiencies up to this are 1.
pub(crate) const ABOVE_ONE: f64 = 1.005;
/// Factors up to this are shown as 1.
const SHOWN_AS_ONE: f64 = 1.0005;
/// Error of a time that is stored to the microsecond.
const ROUNDING_S: f64 = 1e-6;

/// Returns the modelled time of a phase's messages on one rank, in seconds.
fn messages_s(phase: &Phase, network: &Network) -> f64 {
    network.time_s(phase.messages.max, phase.message_bytes.max)
}

/// Returns the time of a phase on its slowest rank in seconds: measured, or projected with its messages for simulated ranks.
pub fn phase_s(run: &Run, phase: &Phase, network: &Network) -> f64 {
    match run.setup.comm {
        Comm::Sim => phase.useful_s.max + messages_s(phase, network),
        Comm::Mpi | Comm::Solo => phase.wall_s.max,
    }
}

/// Returns the time of a run in seconds: measured, or projected for simulated ranks.
pub fn time_s(run: &Run, network: &Network) -> f64 {
    if run.setup.comm != Comm::Sim {
        return run.time_wall_s;
    }
    let phases = run.phases.iter().map(|phase| phase_s(run, phase, network));
    phases.reduce(|a, b| a + b).unwrap_or(run.useful_s.max)
}

/// Why factors are left out, as the end of a sentence.
pub const UNKNOWN: &str = "the program reports no phases with the CPU times of all ranks";

/// Returns max / mean of the useful times; `None` if they are unknown.
pub fn imbalance(run: &Run) -> Option<f64> {
    (!run.phases.is_empty()).then(|| run.useful_s.lambda(run.setup.ranks).max(1.0))
}

/// Returns the efficiencies of a run relative to a reference run, usually the one on the fewest ranks; `None` if useful times of one are
/// unknown.
pub fn efficiency(run: &Run, reference: &Run, network: &Network) -> Option<Efficiency> {
    // Without phases, useful times are unknown.
    run.phases.first().and(reference.phases.first())?;
    let (time_s, path_s) = (time_s(run, network), run.path_s());
    let [before, now] = [reference, run].map(|run| per_cell(&run.useful_s, run));
    let efficiency = Efficiency {
        load_balance: 1.0 / run.useful_s.lambda(run.setup.ranks),
        serialisation: ratio(run.useful_s.max, path_s),
        transfer: ratio(path_s, time_s),
        computation_scaling: ratio(before, now),
    };
    // A sum of stored times has the errors of all.
    let off = |of_s: f64| 1e-9 + ROUNDING_S * (run.phases.len() + 1) as f64 / of_s.max(ROUNDING_S);
    efficiency.check_invariants([run.useful_s.max, path_s].map(off));
    let [load_balance, serialisation] =
        [efficiency.load_balance, efficiency.serialisation].map(|factor| factor.min(1.0));
    Some(Efficiency { load_balance, serialisation, ..efficiency })
}

fn per_cell(useful_s: &Spread, run: &Run) -> f64 {
    useful_s.sum / run.cells.max(1) as f64
}

/// Returns why factors of these efficiencies exceed 1, as sentences; `None` if none does.
///
/// # Panics
/// If an efficiency exceeds 1 and no factor can be the reason: then a factor is wrong.
pub fn above_one(all: &[Efficiency]) -> Option<String> {
    let exceeds = |factor: fn(&Efficiency) -> f64| all.iter().any(|e| factor(e) > SHOWN_AS_ONE);
    let scaling = exceeds(|e| e.computation_scaling).then_some(
        "Computation scaling is above 1 where all ranks together take less CPU time per cell than the base case: the cost of the \
         same facets does not grow with the mesh, smaller parts of a mesh fit into caches better, or the base case was disturbed.",
    );
    let transfer = exceeds(|e| e.transfer).then_some(
        "Transfer is above 1 where ranks do not wait at the end of every phase, where the clocks disagree, or where medians by phase exceed those of whole runs.",
    );
    let reasons: Vec<&str> = [scaling, transfer].into_iter().flatten().collect();
    let above = all.iter().find(|e| e.is_above_one());
    let has_reason = above.is_none() || !reasons.is_empty();
    assert!(has_reason, "an efficiency above 1 has a reason: {above:?}");
    (!reasons.is_empty()).then(|| reasons.join(" "))
}

/// Returns a / b, or 1 for b = 0: nothing was lost.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 1.0 }
}

/// Losses below this fraction are not explained.
const LOSS_MIN: f64 = 0.03;

/// What a phase contributes to a loss.
type Weight<'a> = &'a dyn Fn(&Phase) -> f64;

/// Returns the sentence for a run relative to its reference run, with the reason for an efficiency above 1.
pub fn cause(run: &Run, reference: &Run, network: &Network) -> String {
    let Some(e) = efficiency(run, reference, network) else {
        return format!("no cause is known at {} ranks: {UNKNOWN}", run.setup.ranks);
    };
    let (ranks, percent) = (run.setup.ranks, 100.0 * e.global());
    // Its own base has a computation scaling of 1.
    let of = if reference.setup == run.setup { "parallel" } else { "global" };
    let uneven = |phase: &Phase| phase.useful_s.max - phase.useful_s.sum / ranks as f64;
    let idle = |phase: &Phase| match run.setup.comm {
        Comm::Sim => messages_s(phase, network),
        Comm::Mpi | Comm::Solo => phase.wall_s.max - phase.useful_s.max,
    };
    let more = |phase: &Phase| {
        let before = reference.phases.iter().find(|before| before.name == phase.name);
        per_cell(&phase.useful_s, run)
            - before.map_or(0.0, |before| per_cell(&before.useful_s, reference))
    };
    let losses: [(f64, &str, Weight); 4] = [
        (e.load_balance, "the work of the ranks is uneven", &uneven),
        (e.serialisation, "work is balanced in total but not within phases", &uneven),
        (e.transfer, "messages take time, or no rank computes", &idle),
        (e.computation_scaling, "the ranks together compute more than the base case", &more),
    ];
    let worst = losses.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let (factor, loss, weight) = worst.expect("four losses are compared");
    let phase = run.phases.iter().max_by(|a, b| weight(a).total_cmp(&weight(b)));
    let Phase { name, useful_s, .. } = phase.expect("without phases, efficiencies are unknown");
    let why = if factor > 1.0 - LOSS_MIN {
        "no single cause costs more than 3 %".to_owned()
    } else {
        let (percent, lambda) = (100.0 * (1.0 - factor), useful_s.lambda(ranks));
        let rank = useful_s.at;
        let part = heaviest_base_leaf(run).filter(|leaf| leaf * ranks as f64 > 1.0);
        let leaf = part.map_or(String::new(), |leaf| {
            format!("; a single base leaf holds {:.1} % of the cells", 100.0 * leaf)
        });
        format!(
            "{loss} ({percent:.0} %), mostly in the phase {name}, where rank {rank} is slowest (lambda {lambda:.2}){leaf}"
        )
    };
    let above = above_one(&[e]).map_or(String::new(), |reason| format!(". {reason}"));
    format!("{of} efficiency of {percent:.0} % at {ranks} ranks: {why}{above}")
}

/// Returns the fraction of all cells in the largest base leaf, if the program reports it.
pub fn heaviest_base_leaf(run: &Run) -> Option<f64> {
    let heaviest = run.counters.get("base_leaf_cells_max")?.max;
    (run.cells > 0).then(|| heaviest / run.cells as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::ASSUMED;
    use crate::testing::run;
    use proptest::prelude::*;

    const FREE: Network = Network { latency_s: 0.0, bandwidth_bytes_per_s: 1e30, ..ASSUMED };

    fn efficiency(run: &Run, reference: &Run, network: &Network) -> Efficiency {
        super::efficiency(run, reference, network).unwrap()
    }

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9, "{a} is not {b}");
    }

    #[test]
    fn efficiencies_match_a_worked_example() {
        // Rank 0 works 3 then 1, rank 1 works 1 then 3: balanced in total, each phase waits for its slowest.
        let one = run(Comm::Sim, 100, &[("a", &[3.5]), ("b", &[3.5])]);
        let mut two = run(Comm::Sim, 100, &[("a", &[3.0, 1.0]), ("b", &[1.0, 3.0])]);
        let e = efficiency(&two, &one, &FREE);
        close(e.load_balance, 1.0);
        close(e.serialisation, 4.0 / 6.0);
        close(e.transfer, 1.0);
        close(e.computation_scaling, 7.0 / 8.0);
        close(e.parallel(), 4.0 / 6.0);
        // Speedup 7 / 6 on two ranks.
        close(e.global(), 7.0 / 6.0 / 2.0);
        // Two messages of half a second each, and 3 bytes at one byte a second.
        two.phases[1].messages = Spread::of(&[2.0, 0.0]);
        two.phases[1].message_bytes = Spread::of(&[0.0, 3.0]);
        let slow = Network { latency_s: 0.5, bandwidth_bytes_per_s: 1.0, ..ASSUMED };
        close(time_s(&two, &slow), 6.0 + 1.0 + 3.0);
        close(efficiency(&two, &one, &slow).transfer, 0.6);
    }

    #[test]
    fn load_balance_is_mean_over_max() {
        let one = run(Comm::Sim, 100, &[("a", &[4.0])]);
        let two = run(Comm::Sim, 100, &[("a", &[3.0, 1.0])]);
        let e = efficiency(&two, &one, &FREE);
        close(e.load_balance, 2.0 / 3.0);
        close(e.global(), 4.0 / 3.0 / 2.0);
    }

    proptest! {
        #[test]
        fn efficiencies_of_drawn_runs_satisfy_the_invariants(
            times in prop::collection::vec(prop::collection::vec(0.0..9.0f64, 3), 1..12), wall_s in 0.1..9.0f64, one in 0.0..9.0f64,
            unit_s in prop::sample::select(vec![1.0, 1e-4, 1e-6]),
        ) {
            // A small mesh takes microseconds, which are rounded.
            let times: Vec<Vec<f64>> = times.iter().map(|t| t.iter().map(|t| t * unit_s).collect()).collect();
            let phases: Vec<(&str, &[f64])> = times.iter().map(|times| ("a", &times[..])).collect();
            let mut many = run(Comm::Mpi, 100, &phases);
            many.time_wall_s = wall_s * unit_s;
            let one = run(Comm::Solo, 90, &[("a", &[one * unit_s])]);
            above_one(&[efficiency(&many, &one, &FREE)]);
        }
    }

    #[test]
    #[should_panic(expected = "load balance of at most 1")]
    fn ranks_that_are_balanced_better_than_evenly_are_noticed() {
        let mut two = run(Comm::Mpi, 100, &[("a", &[3.0, 1.0])]);
        two.useful_s.max = 1.5;
        efficiency(&two, &two.clone(), &FREE);
    }

    #[test]
    fn an_efficiency_above_1_has_a_reason() {
        let one = run(Comm::Sim, 100, &[("grade", &[6.0])]);
        let less = run(Comm::Sim, 100, &[("grade", &[2.0, 2.0])]);
        let ideal = efficiency(&one, &one, &FREE);
        let scaled = efficiency(&less, &one, &FREE);
        assert_eq!(above_one(&[ideal]), None);
        assert!(above_one(&[ideal, scaled]).unwrap().contains("caches"));
        let mut overlapping = run(Comm::Mpi, 100, &[("a", &[3.0, 1.0]), ("b", &[1.0, 3.0])]);
        overlapping.time_wall_s = 3.9;
        let early = above_one(&[efficiency(&overlapping, &one, &FREE)]).unwrap();
        assert!(early.contains("Transfer"), "{early}");
    }

    #[test]
    #[should_panic(expected = "an efficiency above 1 has a reason")]
    fn an_efficiency_above_1_without_a_reason_is_noticed() {
        let one = run(Comm::Sim, 100, &[("grade", &[4.0])]);
        above_one(&[Efficiency { load_balance: 2.0, ..efficiency(&one, &one, &FREE) }]);
    }

    #[test]
    fn weak_scaling_is_per_cell() {
        let one = run(Comm::Sim, 100, &[("a", &[4.0])]);
        let two = run(Comm::Sim, 200, &[("a", &[4.0, 4.0])]);
        close(efficiency(&two, &one, &FREE).global(), 1.0);
    }

    #[test]
    fn the_factors_of_a_program_without_phases_are_unknown() {
        let mut without_phases = run(Comm::Solo, 100, &[("all", &[3.0])]);
        without_phases.phases.clear();
        assert_eq!(super::efficiency(&without_phases, &without_phases, &FREE), None);
        assert_eq!(imbalance(&without_phases), None);
        let cause = cause(&without_phases, &without_phases, &FREE);
        assert_eq!(cause, format!("no cause is known at 1 ranks: {UNKNOWN}"));
        without_phases.setup.comm = Comm::Sim;
        close(time_s(&without_phases, &FREE), 3.0);
    }

    #[test]
    fn times_on_mpi_are_not_projected() {
        let mut two = run(Comm::Mpi, 100, &[("a", &[3.0, 1.0])]);
        two.time_wall_s = 5.0;
        let e = efficiency(&two, &two.clone(), &FREE);
        close(e.parallel(), 2.0 / 5.0);
    }

    #[test]
    fn the_largest_loss_is_named() {
        let one = run(Comm::Sim, 100, &[("read", &[0.1]), ("grade", &[4.0])]);
        let mut two = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[3.0, 1.0])]);
        let text = cause(&two, &one, &FREE);
        assert!(
            text.starts_with("global efficiency of 67 % at 2 ranks: the work of the ranks is uneven (33 %), mostly in the phase grade, where rank 0"),
            "{text}"
        );
        two.counters.insert("base_leaf_cells_max".into(), Spread::of(&[70.0, 10.0]));
        assert!(cause(&two, &one, &FREE).contains("a single base leaf holds 70.0 %"));

        let mut fine = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[2.0, 2.0])]);
        assert!(cause(&fine, &one, &FREE).contains("no single cause"));
        fine.phases[1].messages = Spread::of(&[10.0, 10.0]);
        let slow = Network { latency_s: 0.1, bandwidth_bytes_per_s: 1e9, ..ASSUMED };
        assert!(cause(&fine, &one, &slow).contains("messages take time"));

        let redundant = run(Comm::Sim, 100, &[("read", &[2.05, 2.05]), ("grade", &[2.0, 2.0])]);
        assert!(cause(&redundant, &one, &FREE).contains("mostly in the phase read"));

        let crossed = run(Comm::Sim, 100, &[("read", &[0.05, 2.0]), ("grade", &[2.0, 0.05])]);
        assert!(cause(&crossed, &one, &FREE).contains("not within phases"));
    }
}
