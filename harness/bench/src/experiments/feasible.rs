//! Which runs are worth starting: a slow program is not started on a mesh that it would not finish.

use super::entry::{Line, Run, Setup};
use std::time::Duration;

/// Returns the reason for which a run would exceed `limit` or the memory of the machine, extrapolated from the finest coarser
/// mesh of the same program; `None` if it would not, or if the lines have no such mesh.
pub(crate) fn excess(lines: &[Line], setup: &Setup, limit: Duration) -> Option<String> {
    let is_coarser = |run: &&Run| {
        let [wanted, found] =
            [setup, &run.setup].map(|s| (&s.engine, &s.case, s.layer_cells_min, s.ranks, s.comm));
        wanted == found && run.setup.spacing_min > setup.spacing_min
    };
    let coarser = lines.iter().filter_map(Line::run).filter(is_coarser);
    let spacing = |run: &&Run| run.setup.spacing_min;
    let finest = coarser.min_by(|a, b| spacing(a).total_cmp(&spacing(b)))?;
    // Cells, and with them time and memory, grow with the inverse square of the spacing.
    let growth = (finest.setup.spacing_min / setup.spacing_min).powi(2);
    let (time_s, bytes) = (finest.time_launch_s * growth, finest.peak_rss_bytes.sum * growth);
    let memory = lines.iter().find_map(Line::session)?.machine.memory_bytes as f64;
    let [needed, available] = [bytes, memory].map(|b| b / 1e9);
    let would = match () {
        () if time_s > limit.as_secs_f64() => {
            format!("take {time_s:.0} s, more than --timeout {}", limit.as_secs())
        }
        () if bytes > memory => {
            format!("need {needed:.0} GB of memory, and the machine has {available:.0} GB")
        }
        () => return None,
    };
    let (program, cells) = (&setup.engine, finest.cells as f64);
    Some(format!("{program} would {would}, extrapolated from {cells:.1e} cells"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{Comm, Entry, Machine, Session};
    use crate::testing::{line, run};

    #[test]
    fn a_run_is_left_out_if_a_coarser_one_was_too_long_or_too_large() {
        let of = |bytes: f64| {
            let mut coarse = run(Comm::Solo, 1000, &[("a", &[2.0])]);
            (coarse.time_launch_s, coarse.peak_rss_bytes.sum) = (2.0, bytes);
            let machine = Machine { memory_bytes: 8 << 30, ..Machine::default() };
            let session = Session { machine, ..Session::default() };
            [line(Entry::Session(Box::new(session))), line(Entry::Run(Box::new(coarse)))]
        };
        let finer = |lines: &[Line], spacing_min: f64, limit: u64| {
            let setup = run(Comm::Solo, 1, &[("a", &[0.0])]).setup;
            excess(lines, &Setup { spacing_min, ..setup }, Duration::from_secs(limit))
        };
        let (small, large) = (of(1e6), of(1e13));
        assert_eq!(finer(&small, 0.01, 300), None);
        assert!(finer(&small, 0.01, 100).unwrap().contains("take 200 s, more than --timeout 100"));
        assert!(finer(&large, 0.05, 300).unwrap().contains("need 40000 GB of memory"));
        // The same spacing is no coarser mesh.
        assert_eq!(finer(&large, 0.1, 1), None);
    }
}
