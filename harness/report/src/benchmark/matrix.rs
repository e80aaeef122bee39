//! Figures of message matrices: bytes and messages between pairs of ranks.

use super::groups::{Subject, cells_label};
use crate::figure::{Axis, Body, Figure, HeatMap, Layer};
use bench::experiments::entry::{Run, Setup};
use bench::experiments::number::grouped;

/// The figure of a message matrix.
pub fn figure(run: &Run) -> Figure {
    let Setup { ranks, layer_cells_min: n, .. } = run.setup;
    let (subject, division) = (Subject::of(&run.setup), run.setup.division());
    let matrix = &run.message_matrix;
    let layer = |label: &str, quantity: usize| {
        let entry = |e: &[u64; 4]| (e[0] as usize, e[1] as usize, e[quantity] as f64);
        Layer { label: label.to_owned(), entries: matrix.iter().map(entry).collect() }
    };
    let total = |quantity: usize| matrix.iter().map(|e| e[quantity]).sum::<u64>();
    let cells = grouped(run.cells);
    let caption = format!(
        "Bytes and messages sent between pairs of ranks in point-to-point communication: {subject}, {cells} cells, n = {n}, {ranks} simulated ranks, \
         partition: {division}. The total is {} messages with {:.1} MB between {} of {} ordered pairs; white pairs exchange nothing. Collective \
         calls are not included{}. The counts repeat exactly.",
        grouped(total(2)),
        total(3) as f64 / 1e6,
        grouped(matrix.len() as u64),
        grouped((ranks * ranks.saturating_sub(1)) as u64),
        collective_fraction(run, total(3))
    );
    let map = HeatMap {
        order: ranks,
        layers: vec![layer("bytes", 3), layer("messages", 2)],
        command: run.command.clone(),
    };
    Figure::new(
        format!("messages-{}-{}-{ranks}", subject.file(), cells_label(run.cells)),
        format!("Messages between pairs of ranks: {subject}, {cells} cells, {ranks} ranks"),
        caption,
        [Axis::linear("to rank"), Axis::linear("from rank")],
        Body::HeatMap(map),
    )
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
    use bench::experiments::group::Groups;
    use bench::testing::{line, run};

    #[test]
    fn the_caption_has_the_totals_and_the_fraction_of_collective_calls() {
        let mut warm_up = run(Comm::Sim, 2_000_000, &[("a", &[1.0, 1.0, 1.0])]);
        warm_up.warm_up = true;
        warm_up.message_matrix = vec![[0, 1, 2, 3_000_000], [2, 0, 1, 1_000_000]];
        warm_up.counters.insert("message_bytes".into(), Spread::brief(&[4e6, 0.0, 1e6]));
        let groups = Groups::of(&[line(Entry::Run(Box::new(warm_up)))]);
        let [run] = &groups.matrices[..] else { panic!("{:?}", groups.matrices) };
        let f = figure(run);
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
