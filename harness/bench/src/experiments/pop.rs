//! Efficiencies as the POP centre of excellence defines them, measured or projected.
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
//! What a rank does is the same in every repetition, only the time that the machine takes for it wavers. So
//! where runs tell it rank by rank, `u[p][r]` is the median over the repetitions (see [`Group`](super::group::Group)),
//! taken before any maximum over ranks: the greatest of many wavering times is the most disturbed rank's.
//!
//! C is what the phases would take on a network that costs nothing, as ranks wait for each other at the
//! end of a phase. Where ranks are simulated, T is projected: C plus what a latency-bandwidth model says
//! of the counted messages.

use super::entry::{Comm, Network, Phase, Run};

/// How a time splits into causes. All are fractions, 1 being perfect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Efficiency {
    /// Mean useful time over the greatest.
    pub load_balance: f64,
    /// Lost to ranks that wait at the ends of phases although all have as much to do in total.
    pub serialisation: f64,
    /// Lost to messages (and, on real MPI, to everything else that is no CPU time of the rank).
    pub transfer: f64,
    /// Useful work per cell of the reference run over that of this one.
    pub computation_scaling: f64,
    /// Greatest over mean useful time.
    pub lambda: f64,
    /// T.
    pub time_s: f64,
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
}

/// What a rank's messages cost by the model.
pub fn messages_s(phase: &Phase, network: &Network) -> f64 {
    phase.messages.max * network.latency_s + phase.message_bytes.max / network.bandwidth_bytes_per_s
}

/// The critical path: phases end when their slowest rank ends, and messages cost what the model says.
pub fn projected_s(run: &Run, network: &Network) -> f64 {
    run.phases.iter().map(|p| p.useful_s.max + messages_s(p, network)).sum()
}

/// The critical path on a network that costs nothing: what simulated and real ranks must have in common,
/// also on a machine that is busy with other work. A program that tells no phases has one.
pub fn path_s(run: &Run) -> f64 {
    if run.phases.is_empty() {
        return run.useful_s.max;
    }
    run.phases.iter().map(|p| p.useful_s.max).sum()
}

/// Time that a run took: measured where that means something, projected where ranks took turns.
pub fn time_s(run: &Run, network: &Network) -> f64 {
    match run.setup.comm {
        Comm::Sim => projected_s(run, network),
        Comm::Mpi | Comm::Solo => run.time_wall_s,
    }
}

/// The efficiencies of a run against a reference run, usually the one on fewest ranks.
pub fn efficiency(run: &Run, reference: &Run, network: &Network) -> Efficiency {
    let time_s = time_s(run, network);
    let path_s = path_s(run);
    let per_cell = |r: &Run| r.useful_s.sum / r.cells.max(1) as f64;
    let lambda = run.useful_s.lambda(run.setup.ranks);
    Efficiency {
        load_balance: 1.0 / lambda,
        serialisation: ratio(run.useful_s.max, path_s),
        transfer: ratio(path_s, time_s),
        computation_scaling: ratio(per_cell(reference), per_cell(run)),
        lambda,
        time_s,
    }
}

/// The efficiencies of one phase against the same one of the reference run, if that has it.
pub fn phase_efficiency(
    run: &Run,
    phase: &Phase,
    reference: &Run,
    network: &Network,
) -> Efficiency {
    let time_s = match run.setup.comm {
        Comm::Sim => phase.useful_s.max + messages_s(phase, network),
        Comm::Mpi | Comm::Solo => phase.wall_s.max,
    };
    let lambda = phase.useful_s.lambda(run.setup.ranks);
    let before = reference.phases.iter().find(|p| p.name == phase.name);
    let per_cell = |p: &Phase, r: &Run| p.useful_s.sum / r.cells.max(1) as f64;
    let scaling = before.map_or(0.0, |b| ratio(per_cell(b, reference), per_cell(phase, run)));
    Efficiency {
        load_balance: 1.0 / lambda,
        serialisation: 1.0,
        transfer: ratio(phase.useful_s.max, time_s),
        computation_scaling: scaling,
        lambda,
        time_s,
    }
}

/// 1 where both are nothing, as nothing was lost.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::entry::Spread;
    use super::*;
    use crate::testing::run;

    const FREE: Network = Network { latency_s: 0.0, bandwidth_bytes_per_s: 1e30, measured: false };

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9, "{a} is not {b}");
    }

    #[test]
    fn a_worked_example() {
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
        let slow = Network { latency_s: 0.5, bandwidth_bytes_per_s: 1.0, measured: false };
        close(projected_s(&two, &slow), 6.0 + 1.0 + 3.0);
        close(efficiency(&two, &one, &slow).transfer, 0.6);
    }

    #[test]
    fn load_balance_is_mean_over_max_and_lambda_its_inverse() {
        let one = run(Comm::Sim, 100, &[("a", &[4.0])]);
        let two = run(Comm::Sim, 100, &[("a", &[3.0, 1.0])]);
        let e = efficiency(&two, &one, &FREE);
        close(e.load_balance, 2.0 / 3.0);
        close(e.lambda, 1.5);
        close(e.global(), 4.0 / 3.0 / 2.0);
    }

    #[test]
    fn weak_scaling_is_per_cell() {
        let one = run(Comm::Sim, 100, &[("a", &[4.0])]);
        let two = run(Comm::Sim, 200, &[("a", &[4.0, 4.0])]);
        close(efficiency(&two, &one, &FREE).global(), 1.0);
    }

    #[test]
    fn a_program_without_phases_loses_nothing_between_them() {
        let mut silent = run(Comm::Solo, 100, &[("all", &[3.0])]);
        silent.phases.clear();
        let e = efficiency(&silent, &silent.clone(), &FREE);
        close(e.serialisation * e.transfer, 1.0);
        close(e.global(), 1.0);
    }

    #[test]
    fn real_time_is_not_projected() {
        let mut two = run(Comm::Mpi, 100, &[("a", &[3.0, 1.0])]);
        two.time_wall_s = 5.0;
        let e = efficiency(&two, &two.clone(), &FREE);
        close(e.time_s, 5.0);
        close(e.parallel(), 2.0 / 5.0);
        let phase = phase_efficiency(&two, &two.phases[0], &two, &FREE);
        close(phase.load_balance, 2.0 / 3.0);
    }
}
