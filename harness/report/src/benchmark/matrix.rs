//! Figures of message matrices: how much every rank sends to every other.

use super::figure::{Axis, Body, Claims, Figure, Heat, Layer};
use super::scaling::about;
use bench::experiments::entry::Run;
use bench::experiments::group::Groups;
use bench::experiments::table::{division, grouped};

/// One of every mesh and number of ranks that is on record.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    groups.matrices.iter().map(figure).collect()
}

fn figure(run: &Run) -> Figure {
    let s = &run.setup;
    let layer = |label: &str, of: usize| {
        let cell = |e: &[u64; 4]| (e[0] as usize, e[1] as usize, e[of] as f64);
        Layer { label: label.to_owned(), cells: run.message_matrix.iter().map(cell).collect() }
    };
    let total = |of: usize| run.message_matrix.iter().map(|e| e[of]).sum::<u64>();
    let pairs = s.ranks * s.ranks.saturating_sub(1);
    Figure {
        id: format!("messages-{}-{}-{}", s.case, about(run.cells), s.ranks),
        title: format!(
            "Messages from rank to rank: {}, {} cells, {} ranks",
            s.case,
            grouped(run.cells),
            s.ranks
        ),
        caption: format!(
            "Bytes and messages that every rank sends to every other in exchanges: {}, {} cells, n = {}, on {} simulated ranks, partition: {}. In \
             total {} messages with {:.1} MB between {} of {} pairs of sender and receiver; white is none. Collective calls, which are between no \
             pair, are left out{}. The counts repeat exactly.",
            s.case,
            grouped(run.cells),
            s.layer_cells_min,
            s.ranks,
            division(s),
            grouped(total(2)),
            total(3) as f64 / 1e6,
            grouped(run.message_matrix.len() as u64),
            grouped(pairs as u64),
            of_all(run, total(3))
        ),
        x: Axis::linear("to rank"),
        y: Axis::linear("from rank"),
        body: Body::Heat(Heat {
            side: s.ranks,
            layers: vec![layer("bytes", 3), layer("messages", 2)],
            command: run.command.clone(),
        }),
        claims: Claims { deterministic: true, ..Claims::default() },
    }
}

/// What part of all bytes that is, where the program counts those.
fn of_all(run: &Run, bytes: u64) -> String {
    let all = run.counters.get("message_bytes").map(|c| c.sum).filter(|sum| *sum > 0.0);
    all.map_or(String::new(), |sum| {
        let part = 100.0 * (1.0 - bytes as f64 / sum);
        format!(": {part:.0} % of all bytes")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::{Comm, Spread, What};
    use bench::testing::line;
    use bench::testing::run;

    #[test]
    fn a_caption_tells_totals_and_what_is_left_out() {
        let mut warm = run(Comm::Sim, 2_000_000, &[("a", &[1.0, 1.0, 1.0])]);
        (warm.warm_up, warm.message_matrix) =
            (true, vec![[0, 1, 2, 3_000_000], [2, 0, 1, 1_000_000]]);
        warm.counters.insert("message_bytes".into(), Spread::brief(&[4e6, 0.0, 1e6]));
        let figures = figures(&Groups::of(&[line(What::Run(Box::new(warm)))]));
        let [f] = &figures[..] else { panic!("{figures:?}") };
        assert_eq!(f.id, "messages-cube-2M-3");
        for words in [
            "n = 4, on 3 simulated ranks, partition: metis area",
            "3 messages with 4.0 MB between 2 of 6 pairs",
            "Collective calls, which are between no pair, are left out: 20 % of all bytes",
        ] {
            assert!(f.caption.contains(words), "{words} is missing in {}", f.caption);
        }
        assert!(matches!(&f.body, Body::Heat(h) if h.layers[0].cells[1] == (2, 0, 1e6)));
    }
}
