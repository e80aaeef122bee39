//! The paper in figures. All of its numbers are those of `reports/paper.md`.

use crate::figure::{Point, Provenance, Series};
use contract::paper::{number, speedup};

/// Whether a case is the counterpart of the paper's UAV, around which its meshes with a run time are.
pub fn is_counterpart(case: &str) -> bool {
    case.starts_with("uav")
}

/// Cells, ranks and run time in seconds of the runs of which the text states all three; a lower bound of the time on 2 ranks, an upper
/// bound on 64.
pub fn runs() -> [(f64, f64, f64); 4] {
    [
        (number("serial_cells"), 1.0, 60.0 * number("serial_min")),
        (number("second_cells"), number("second_ranks"), 60.0 * number("second_min")),
        (number("serial_cells"), number("parallel_ranks"), number("parallel_s")),
        (number("largest_cells"), number("largest_ranks"), 60.0 * number("largest_min")),
    ]
}

/// These runs as a sentence of a caption, and that they are in no figure.
pub fn runs_text() -> String {
    let million = |name: &str| number(name) / 1e6;
    format!(
        "The points of the paper are from its text, not from its figures: {} million cells in {} min on 1 rank and in {} s on {} (section V), {} million \
         in just over {} min on {} ranks (section V), and {:e} in under {} min on {} (section IV.B); around another UAV, on Intel X5355 CPUs.",
        million("serial_cells"),
        number("serial_min"),
        number("parallel_s"),
        number("parallel_ranks"),
        million("second_cells"),
        number("second_min"),
        number("second_ranks"),
        number("largest_cells"),
        number("largest_min"),
        number("largest_ranks"),
    )
}

/// Ranks and speedup over one rank, of the two runs of one mesh.
pub fn speedups() -> [(f64, f64); 2] {
    [(1.0, 1.0), (number("parallel_ranks"), speedup())]
}

/// Values of the paper, which are not joined.
pub fn cited(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Series {
    let points = points.into_iter().map(|(x, y)| Point::exact(x, y)).collect();
    Series::new(name, Provenance::Cited, 5, points).not_joined()
}
