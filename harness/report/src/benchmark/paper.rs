//! What the text of O'Connell and Karman tells of their own measurements, on hardware of 2013.

/// A run in the paper's text.
#[derive(Clone, Copy, Debug)]
pub struct Cited {
    /// Cells of its mesh.
    pub cells: f64,
    /// Ranks, where the text tells.
    pub ranks: Option<usize>,
    /// Its run time.
    pub time_s: f64,
}

/// All that are told.
pub const RUNS: [Cited; 4] = [
    Cited { cells: 50e6, ranks: Some(1), time_s: 22.0 * 60.0 },
    Cited { cells: 50e6, ranks: Some(32), time_s: 117.0 },
    Cited { cells: 1e9, ranks: Some(64), time_s: 45.0 * 60.0 },
    Cited { cells: 1.6e9, ranks: None, time_s: 132.0 * 60.0 },
];

/// Part of the run time that partitioning took.
pub const PARTITIONING: f64 = 0.16;

/// The two runs of one mesh: ranks, and speedup over one rank.
pub fn speedups() -> [(f64, f64); 2] {
    [(1.0, 1.0), (32.0, RUNS[0].time_s / RUNS[1].time_s)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn efficiency_at_32_ranks_is_what_the_paper_says() {
        let [_, (ranks, speedup)] = speedups();
        assert!((speedup / ranks - 0.35).abs() < 0.005);
    }
}
