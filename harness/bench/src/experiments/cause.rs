//! The largest loss of efficiency of a run, explained in one sentence.

use super::entry::{Comm, Network, Phase, Run};
use super::pop::{self, messages_s};

/// Losses below this fraction are not explained.
const LOSS_MIN: f64 = 0.03;

/// What a phase contributes to a loss.
type Weight<'a> = &'a dyn Fn(&Phase) -> f64;

/// Returns the sentence for a run relative to its reference run, with the reason for an efficiency above 1.
pub fn sentence(run: &Run, reference: &Run, network: &Network) -> String {
    let e = pop::efficiency(run, reference, network);
    let (ranks, global) = (run.setup.ranks, 100.0 * e.global());
    let per_cell = |phase: &Phase, run: &Run| phase.useful_s.sum / run.cells.max(1) as f64;
    let uneven = |phase: &Phase| phase.useful_s.max - phase.useful_s.sum / ranks as f64;
    let idle = |phase: &Phase| match run.setup.comm {
        Comm::Sim => messages_s(phase, network),
        Comm::Mpi | Comm::Solo => phase.wall_s.max - phase.useful_s.max,
    };
    let more = |phase: &Phase| {
        let before = reference.phases.iter().find(|before| before.name == phase.name);
        per_cell(phase, run) - before.map_or(0.0, |before| per_cell(before, reference))
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
    let why = match phase {
        _ if factor > 1.0 - LOSS_MIN => "no single cause costs more than 3 %".to_owned(),
        None => "the program reports no phases".to_owned(),
        Some(Phase { name, useful_s, .. }) => {
            let (percent, lambda) = (100.0 * (1.0 - factor), useful_s.lambda(ranks));
            let rank = useful_s.at;
            let part = heaviest_base_leaf(run).filter(|leaf| leaf * ranks as f64 > 1.0);
            let leaf = part.map_or(String::new(), |leaf| {
                format!("; a single base leaf holds {:.1} % of the cells", 100.0 * leaf)
            });
            format!(
                "{loss} ({percent:.0} %), mostly in `{name}`, where rank {rank} is slowest (lambda {lambda:.2}){leaf}"
            )
        }
    };
    let s = if ranks == 1 { "" } else { "s" };
    let above = pop::above_one(&[e]);
    let above = above.map_or(String::new(), |reason| format!(". {reason}"));
    format!("{global:.0} % at {ranks} rank{s}: {why}{above}")
}

/// Returns the fraction of all cells in the largest base leaf, if the program reports it.
pub fn heaviest_base_leaf(run: &Run) -> Option<f64> {
    let heaviest = run.counters.get("base_leaf_cells_max")?.max;
    (run.cells > 0).then(|| heaviest / run.cells as f64)
}

#[cfg(test)]
mod tests {
    use super::super::entry::Spread;
    use super::*;
    use crate::testing::run;

    const FREE: Network = Network { latency_s: 0.0, bandwidth_bytes_per_s: 1e30, measured: false };

    fn why(run_: &Run, one: &Run, network: &Network) -> String {
        sentence(run_, one, network)
    }

    #[test]
    fn the_largest_loss_is_named() {
        let one = run(Comm::Sim, 100, &[("read", &[0.1]), ("grade", &[4.0])]);
        let mut two = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[3.0, 1.0])]);
        let text = why(&two, &one, &FREE);
        assert!(
            text.starts_with("67 % at 2 ranks: the work of the ranks is uneven (33 %), mostly in `grade`, where rank 0"),
            "{text}"
        );
        two.counters.insert("base_leaf_cells_max".into(), Spread::of(&[70.0, 10.0]));
        assert!(why(&two, &one, &FREE).contains("a single base leaf holds 70.0 %"));

        let mut fine = run(Comm::Sim, 100, &[("read", &[0.05, 0.05]), ("grade", &[2.0, 2.0])]);
        assert!(why(&fine, &one, &FREE).contains("no single cause"));
        fine.phases[1].messages = Spread::of(&[10.0, 10.0]);
        let slow = Network { latency_s: 0.1, bandwidth_bytes_per_s: 1e9, measured: false };
        assert!(why(&fine, &one, &slow).contains("messages take time"));

        let redundant = run(Comm::Sim, 100, &[("read", &[2.05, 2.05]), ("grade", &[2.0, 2.0])]);
        assert!(why(&redundant, &one, &FREE).contains("mostly in `read`"));

        let crossed = run(Comm::Sim, 100, &[("read", &[0.05, 2.0]), ("grade", &[2.0, 0.05])]);
        assert!(why(&crossed, &one, &FREE).contains("not within phases"));
    }
}
