//! Figures of message matrices: bytes and messages between pairs of ranks.

use super::groups::{Subject, cells_label};
use crate::figure::{Axis, Body, Claims, Figure, HeatMap, Layer, svg};
use bench::experiments::entry::Run;
use bench::experiments::group::Groups;
use bench::experiments::number::grouped;

/// A figure per recorded message matrix.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    groups.matrices.iter().map(figure).collect()
}

fn figure(run: &Run) -> Figure {
    let s = &run.setup;
    let subject = Subject::of(s);
    let layer = |label: &str, quantity: usize| {
        let entry = |e: &[u64; 4]| (e[0] as usize, e[1] as usize, e[quantity] as f64);
        Layer { label: label.to_owned(), entries: run.message_matrix.iter().map(entry).collect() }
    };
    let total = |quantity: usize| run.message_matrix.iter().map(|e| e[quantity]).sum::<u64>();
    let pairs = s.ranks * s.ranks.saturating_sub(1);
    Figure {
        id: format!("messages-{}-{}-{}", subject.file(), cells_label(run.cells), s.ranks),
        title: format!(
            "Messages between pairs of ranks: {subject}, {} cells, {} ranks",
            grouped(run.cells),
            s.ranks
        ),
        caption: format!(
            "Bytes and messages sent between pairs of ranks in point-to-point communication: {subject}, {} cells, n = {}, {} simulated ranks, partition: \
             {}. The total is {} messages with {:.1} MB between {} of {} ordered pairs; white pairs exchange nothing. Collective calls are not \
             included{}. The counts repeat exactly.",
            grouped(run.cells),
            s.layer_cells_min,
            s.ranks,
            s.division(),
            grouped(total(2)),
            total(3) as f64 / 1e6,
            grouped(run.message_matrix.len() as u64),
            grouped(pairs as u64),
            collective_fraction(run, total(3))
        ),
        x: Axis::linear("to rank"),
        y: Axis::linear("from rank"),
        body: Body::HeatMap(HeatMap {
            order: s.ranks,
            layers: vec![layer("bytes", 3), layer("messages", 2)],
            command: run.command.clone(),
        }),
        height: svg::HEIGHT,
        claims: Claims { deterministic: true, ..Claims::default() },
    }
}

/// The fraction of all bytes that collective calls send, in parentheses; empty if the program does not count all bytes.
fn collective_fraction(run: &Run, point_to_point_bytes: u64) -> String {
    let all = run.counters.get("message_bytes").map(|c| c.sum).filter(|sum| *sum > 0.0);
    all.map_or(String::new(), |sum| {
        let percent = 100.0 * (1.0 - point_to_point_bytes as f64 / sum);
        format!(" ({percent:.0} % of all bytes)")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::{Comm, Entry, Spread};
    use bench::testing::{line, run};

    #[test]
    fn the_caption_has_the_totals_and_the_fraction_of_collective_calls() {
        let mut warm_up = run(Comm::Sim, 2_000_000, &[("a", &[1.0, 1.0, 1.0])]);
        warm_up.warm_up = true;
        warm_up.message_matrix = vec![[0, 1, 2, 3_000_000], [2, 0, 1, 1_000_000]];
        warm_up.counters.insert("message_bytes".into(), Spread::brief(&[4e6, 0.0, 1e6]));
        let figures = figures(&Groups::of(&[line(Entry::Run(Box::new(warm_up)))]));
        let [f] = &figures[..] else { panic!("{figures:?}") };
        assert_eq!(f.id, "messages-cube-2M-3");
        for part in [
            "n = 4, 3 simulated ranks, partition: metis area",
            "3 messages with 4.0 MB between 2 of 6 ordered pairs",
            "Collective calls are not included (20 % of all bytes)",
        ] {
            assert!(f.caption.contains(part), "{part} is missing in {}", f.caption);
        }
        assert!(matches!(&f.body, Body::HeatMap(map) if map.layers[0].entries[1] == (2, 0, 1e6)));
    }
}
