//! The largest loss of efficiency of a run, explained in one sentence.

use super::entry::{Network, Phase, Run};
use super::pop::{self, Efficiency, messages_s};

/// Losses below this fraction are not explained.
const LOSS_MIN: f64 = 0.03;

/// Returns the sentence for a run relative to its reference run. It states the reason for an efficiency above 1.
pub fn sentence(run: &Run, reference: &Run, network: &Network) -> String {
    let e = pop::efficiency(run, reference, network);
    match above_one(&e, run, reference) {
        Some(why) => format!("{}, {why}", loss(&e, run, reference, network)),
        None => loss(&e, run, reference, network),
    }
}

/// Returns the reason for an efficiency above 1; `None` if there is none.
///
/// # Panics
/// If no factor can be the reason: then a factor is wrong.
pub fn above_one(e: &Efficiency, run: &Run, reference: &Run) -> Option<String> {
    if !e.is_above_one() {
        return None;
    }
    assert!(
        e.transfer.max(e.computation_scaling) > 1.0,
        "an efficiency above 1 has a reason: {e:?}"
    );
    let (ranks, of) = (run.setup.ranks, reference.setup.ranks);
    Some(match e.transfer > e.computation_scaling {
        true => format!(
            "above 1 because ranks do not wait at the end of every phase: phase by phase, the slowest ranks take {:.2} times the run",
            e.transfer
        ),
        false => format!(
            "above 1 because {ranks} compute {:.2} times as much per cell as {of}",
            1.0 / e.computation_scaling
        ),
    })
}

fn loss(e: &Efficiency, run: &Run, reference: &Run, network: &Network) -> String {
    let ranks = run.setup.ranks;
    let head = format!(
        "{} at {ranks} {}: ",
        percent(e.global()),
        if ranks == 1 { "rank" } else { "ranks" }
    );
    let losses = [
        (e.load_balance, imbalance(run)),
        (e.serialisation, serial(run)),
        (e.transfer, transfer(run, network, e)),
        (e.computation_scaling, more_work(run, reference)),
    ];
    let worst = losses.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let (factor, why) = worst.expect("four losses are compared");
    if factor > 1.0 - LOSS_MIN {
        return head + "no single cause costs more than 3 %";
    }
    head + &why
}

fn percent(fraction: f64) -> String {
    format!("{:.0} %", fraction * 100.0)
}

/// Returns the phase with the greatest `weight`.
fn worst_phase(run: &Run, weight: impl Fn(&Phase) -> f64) -> Option<&Phase> {
    run.phases.iter().max_by(|a, b| weight(a).total_cmp(&weight(b)))
}

/// Describes load imbalance: the rank, the phase, and whether a single base leaf causes it.
fn imbalance(run: &Run) -> String {
    let ranks = run.setup.ranks as f64;
    let waits = |p: &Phase| p.useful_s.max - p.useful_s.sum / ranks;
    let Some(phase) = worst_phase(run, waits) else { return "the work is uneven".to_owned() };
    let fraction = phase.useful_s.max / phase.useful_s.sum.max(1e-12);
    if let Some(leaf) = heaviest_base_leaf(run)
        && leaf * ranks > 0.7 * run.useful_s.lambda(run.setup.ranks)
        && leaf * ranks > 1.0
    {
        return format!(
            "a single base leaf holds {:.1} % of the cells, more than the mean load of a rank",
            leaf * 100.0
        );
    }
    format!(
        "work is uneven (lambda {:.2}): rank {} does {:.1} % of `{}`, the mean is {:.1} %",
        run.useful_s.lambda(run.setup.ranks),
        phase.useful_s.at,
        fraction * 100.0,
        phase.name,
        100.0 / ranks
    )
}

/// Returns the fraction of all cells in the largest base leaf, if the program reports it.
pub fn heaviest_base_leaf(run: &Run) -> Option<f64> {
    let heaviest = run.counters.get("base_leaf_cells_max")?.max;
    (run.cells > 0).then(|| heaviest / run.cells as f64)
}

fn serial(run: &Run) -> String {
    let ranks = run.setup.ranks as f64;
    let waits = |p: &Phase| p.useful_s.max - p.useful_s.sum / ranks;
    match worst_phase(run, waits) {
        Some(p) => format!(
            "work is balanced in total but not within phases; in `{}` ranks wait longest, for rank {} (lambda {:.2})",
            p.name,
            p.useful_s.at,
            p.useful_s.lambda(run.setup.ranks)
        ),
        None => "ranks wait for each other at the end of phases".to_owned(),
    }
}

fn transfer(run: &Run, network: &Network, e: &Efficiency) -> String {
    if run.setup.comm != super::entry::Comm::Sim {
        let lost = |p: &Phase| p.wall_s.max - p.useful_s.max;
        let Some(p) = worst_phase(run, lost) else {
            return "ranks are idle part of the time".to_owned();
        };
        let crowd = if run.oversubscribed { ", oversubscribed" } else { "" };
        return format!(
            "{} of the time no rank computes{crowd}, mostly in `{}`",
            percent(1.0 - e.transfer),
            p.name
        );
    }
    match worst_phase(run, |p| messages_s(p, network)) {
        Some(p) => format!(
            "messages take {} of the modelled time, mostly in `{}` with {:.0} messages and {:.1} MB per rank",
            percent(1.0 - e.transfer),
            p.name,
            p.messages.max,
            p.message_bytes.max / 1e6
        ),
        None => "messages take the time".to_owned(),
    }
}

/// Describes redundant work relative to the reference run, and the phase that adds most.
fn more_work(run: &Run, reference: &Run) -> String {
    let per_cell = |p: &Phase, r: &Run| p.useful_s.sum / r.cells.max(1) as f64;
    let in_reference = |p: &Phase| reference.phases.iter().find(|b| b.name == p.name);
    let grown =
        |p: &Phase| per_cell(p, run) - in_reference(p).map_or(0.0, |b| per_cell(b, reference));
    let all = run.useful_s.sum / run.cells.max(1) as f64;
    match worst_phase(run, grown) {
        Some(p) => format!(
            "the ranks together compute {:.2} times as much as {}, mostly in `{}` ({} of the total)",
            all * reference.cells.max(1) as f64 / reference.useful_s.sum.max(1e-12),
            if reference.setup.ranks == 1 {
                "one".to_owned()
            } else {
                reference.setup.ranks.to_string()
            },
            p.name,
            percent(grown(p) / all)
        ),
        None => "the total work grows".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::entry::{Comm, Spread};
    use super::*;
    use crate::testing::run;

    const FREE: Network = Network { latency_s: 0.0, bandwidth_bytes_per_s: 1e30, measured: false };

    fn why(run_: &Run, one: &Run, network: &Network) -> String {
        sentence(run_, one, network)
    }

    #[test]
    fn an_efficiency_above_1_has_a_reason() {
        let one = run(Comm::Sim, 100, &[("grade", &[6.0])]);
        let less = run(Comm::Sim, 100, &[("grade", &[2.0, 2.0])]);
        let text = why(&less, &one, &FREE);
        assert!(
            text.contains("above 1 because 2 compute 0.67 times as much per cell as 1"),
            "{text}"
        );
        let mut overlapping = run(Comm::Mpi, 100, &[("a", &[3.0, 1.0]), ("b", &[1.0, 3.0])]);
        overlapping.time_wall_s = 3.9;
        let text = why(&overlapping, &run(Comm::Mpi, 100, &[("a", &[8.0])]), &FREE);
        assert!(text.contains("above 1 because ranks do not wait"), "{text}");
        assert!(!why(&one, &one.clone(), &FREE).contains("above 1"));
    }

    #[test]
    #[should_panic(expected = "an efficiency above 1 has a reason")]
    fn an_efficiency_above_1_without_a_reason_is_noticed() {
        let one = run(Comm::Sim, 100, &[("grade", &[4.0])]);
        let wrong = Efficiency { load_balance: 2.0, ..pop::efficiency(&one, &one, &FREE) };
        above_one(&wrong, &one, &one);
    }

    #[test]
    fn the_largest_loss_is_named() {
        let one = run(Comm::Sim, 100, &[("read", &[0.1]), ("grade", &[4.0])]);
        let mut two = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[3.0, 1.0])]);
        let text = why(&two, &one, &FREE);
        assert!(
            text.starts_with("67 % at 2 ranks: ") && text.contains("rank 0 does 75.0 % of `grade`"),
            "{text}"
        );
        two.counters.insert("base_leaf_cells_max".into(), Spread::of(&[70.0, 10.0]));
        assert!(why(&two, &one, &FREE).contains("a single base leaf holds 70.0 %"));

        let mut fine = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[2.0, 2.0])]);
        assert!(why(&fine, &one, &FREE).contains("no single cause"));
        fine.phases[1].messages = Spread::of(&[10.0, 10.0]);
        let slow = Network { latency_s: 0.1, bandwidth_bytes_per_s: 1e9, measured: false };
        assert!(why(&fine, &one, &slow).contains("`grade` with 10 messages"));

        let redundant = run(Comm::Sim, 100, &[("read", &[2.05, 2.05]), ("grade", &[2.0, 2.0])]);
        assert!(why(&redundant, &one, &FREE).contains("mostly in `read`"));

        let crossed = run(Comm::Sim, 100, &[("read", &[0.05, 2.0]), ("grade", &[2.0, 0.05])]);
        assert!(why(&crossed, &one, &FREE).contains("not within phases"));
    }
}
