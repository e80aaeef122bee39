//! Measurements in the text of O'Connell and Karman, made on Intel X5355 CPUs with 4 GB of memory each.
//!
//! The paper does not state the number of facets of its UAV. Its largest mesh (1.6e9 cells in 132 min) has no number of
//! ranks either and is not among the runs here: it was made with thicker layers on "the same hardware".

use crate::figure::{Point, Provenance, Series};

/// Cells, ranks and run time in seconds of the runs of which the text states all three. It gives the time of the last one as an upper
/// bound.
pub const RUNS: [(f64, f64, f64); 3] =
    [(50e6, 1.0, 22.0 * 60.0), (50e6, 32.0, 117.0), (1e9, 64.0, 45.0 * 60.0)];

/// Number of cells of the meshes in the paper's figures of load balance (Figures 21 to 23).
pub const CELLS_OF_BALANCE: f64 = 100e6;

/// Ranks and speedup over one rank, of the two runs of one mesh.
pub fn speedups() -> [(f64, f64); 2] {
    [(1.0, 1.0), (RUNS[1].1, RUNS[0].2 / RUNS[1].2)]
}

/// Values of the paper, which are not joined.
pub fn cited(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Series {
    let points = points.into_iter().map(|(x, y)| Point::exact(x, y)).collect();
    Series::new(name, Provenance::Cited, 5, points).not_joined()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn efficiency_on_32_ranks_is_that_of_the_paper() {
        let [_, (ranks, speedup)] = speedups();
        assert!((speedup / ranks - 0.35).abs() < 0.005);
    }
}
