//! The report as a table for people.

use super::{PhaseEntry, Report};
use crate::partition::Partitioner;
use std::fmt;

/// The greatest value divided by the mean: 1 is perfect balance.
fn imbalance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    if mean > 0.0 { values.iter().fold(0.0, |m: f64, v| m.max(*v)) / mean } else { 1.0 }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { root_edge, level_surface, level_base, ranks, digest, .. } = self;
        let [outside, inside, crossing] = self.cells_by_side.map(grouped);
        let [facets, cells] = [self.facets, self.cells].map(grouped);
        writeln!(f, "facets         {facets}")?;
        writeln!(f, "root edge      {root_edge} (level 0), surface level {level_surface}")?;
        writeln!(f, "cells          {cells}")?;
        writeln!(f, "  by side      outside {outside}, inside {inside}, crossing {crossing}")?;
        for (l, &n) in self.cells_by_level.iter().enumerate().filter(|(_, n)| **n > 0) {
            let (cells, edge) = (grouped(n), root_edge / f64::from(1u32 << l));
            writeln!(f, "  level {l:>2}     {cells:>16}   edge {edge:e}")?;
        }
        writeln!(f, "components     {}", components(self))?;
        writeln!(f, "digest         {digest}")?;
        let by_rank =
            |counts: &[u64]| imbalance(&counts.iter().map(|n| *n as f64).collect::<Vec<_>>());
        let lambda = by_rank(&self.counters["leaves"]);
        let partitioned = match self.partitioner {
            None => "",
            Some(Partitioner::Metis) => ", partitioned by METIS",
            Some(Partitioner::Morton) => ", partitioned along the curve",
            Some(Partitioner::Paper) => ", partitioned as in the paper",
        };
        writeln!(
            f,
            "ranks          {ranks}, cells max/mean {lambda:.3}, base level {level_base}{partitioned}"
        )?;
        writeln!(f, "phase              wall s     cpu s   cpu max/mean")?;
        for PhaseEntry { name, time_wall_s, time_cpu_s, .. } in &self.phases {
            let wall = time_wall_s.iter().copied().fold(0.0, f64::max);
            let (cpu, lambda) = (time_cpu_s.iter().sum::<f64>(), imbalance(time_cpu_s));
            writeln!(f, "  {name:<12} {wall:>10.3} {cpu:>9.3}   {lambda:>8.3}")?;
        }
        let (cells, wall) = (self.cells.max(1) as f64, self.time_wall_s);
        let rate = cells / wall.max(1e-9) / 1e6;
        writeln!(f, "time           {wall:.3} s wall, {rate:.2} M cells/s")?;
        let peak = self.peak_rss_bytes.iter().sum::<u64>() as f64;
        let (peak_mb, per_cell) = (peak / 1e6, peak / cells);
        write!(f, "peak memory    {peak_mb:.1} MB over all ranks, {per_cell:.2} bytes per cell")
    }
}

/// The components in one line: by side, and those that were deleted as enclosed or decided by majority.
fn components(report: &Report) -> String {
    let [outside, inside, enclosed, leaves, ambiguous] = [
        report.components_outside,
        report.components_inside,
        report.components_enclosed,
        report.enclosed_leaves,
        report.components_ambiguous,
    ]
    .map(grouped);
    let mut line = format!("outside {outside}, inside {inside}");
    if let Some([x, y, z]) = report.enclosed_example {
        line += &format!(
            "; {enclosed} outside deleted as enclosed ({leaves} leaves of the base tree, one at ({x}, {y}, {z}))"
        );
    }
    if let Some([x, y, z]) = report.ambiguous_example {
        line += &format!("; {ambiguous} decided by majority, one at ({x}, {y}, {z})");
    }
    line
}

/// A number with a comma before each group of three digits.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(d);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_grouped_in_threes() {
        assert_eq!(
            [0, 12, 123, 1234, 1_234_567].map(grouped),
            ["0", "12", "123", "1,234", "1,234,567"]
        );
    }

    #[test]
    fn imbalance_is_greatest_over_mean() {
        assert_eq!(imbalance(&[1.0, 3.0]), 1.5);
        assert_eq!(imbalance(&[0.0]), 1.0);
    }

    #[test]
    fn a_report_shows_its_numbers() {
        use super::super::Geometry;
        let phase = PhaseEntry {
            name: "sides".into(),
            time_wall_s: vec![0.25, 0.5],
            time_cpu_s: vec![1.0, 3.0],
            time_comm_wall_s: vec![],
            time_comm_cpu_s: vec![],
            messages: vec![],
            message_bytes: vec![],
        };
        let mut report = Report {
            schema: "",
            program: "",
            facets: 1280,
            geometry: Geometry { facets: 1280, digest: String::new() },
            cells: 3_000_000,
            cells_by_level: vec![0, 0, 1234],
            cells_by_side: [1000, 2000, 3],
            digest: "abc".into(),
            root_edge: 8.0,
            level_surface: 2,
            level_base: 1,
            components: 3,
            components_outside: 1500,
            components_inside: 1,
            components_enclosed: 0,
            enclosed_leaves: 0,
            enclosed_example: None,
            components_ambiguous: 0,
            ambiguous_example: None,
            leaks: vec![],
            partitioner: None,
            warnings: vec![],
            ranks: 2,
            time_wall_s: 0.5,
            peak_rss_bytes: vec![2_000_000, 4_000_000],
            phases: vec![phase],
            counters: [("leaves".into(), vec![1, 3])].into(),
        };
        let text = "facets         1,280\n\
                    root edge      8 (level 0), surface level 2\n\
                    cells          3,000,000\n  by side      outside 1,000, inside 2,000, crossing 3\n  \
                    level  2                1,234   edge 2e0\n\
                    components     outside 1,500, inside 1\n\
                    digest         abc\n\
                    ranks          2, cells max/mean 1.500, base level 1\n\
                    phase              wall s     cpu s   cpu max/mean\n  \
                    sides             0.500     4.000      1.500\n\
                    time           0.500 s wall, 6.00 M cells/s\n\
                    peak memory    6.0 MB over all ranks, 2.00 bytes per cell";
        assert_eq!(report.to_string(), text);
        (report.components_enclosed, report.enclosed_leaves) = (1000, 2000);
        report.enclosed_example = Some([1.0, 2.0, 0.5]);
        (report.components_ambiguous, report.ambiguous_example) = (7, Some([0.0, 1.0, 4.0]));
        let added = [
            "outside 1,500, inside 1; 1,000 outside deleted as enclosed (2,000 leaves of the base tree, one at (1, 2, 0.5)); \
             7 decided by majority, one at (0, 1, 4)\n",
        ];
        let text = report.to_string();
        assert!(added.iter().all(|line| text.contains(line)), "{text}");
    }
}
