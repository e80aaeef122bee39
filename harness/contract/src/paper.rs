//! Numbers of the paper of O'Connell and Karman, from the table in `reports/paper.md`: the only place that has them.

const PAGE: &str = include_str!("../../../reports/paper.md");

/// Returns the value in the row of this name.
///
/// # Panics
/// If there is no such row, or its value is no number.
pub fn number(name: &str) -> f64 {
    let row = PAGE.lines().find_map(|line| line.strip_prefix(&format!("| `{name}` | ")));
    let value = row.and_then(|row| row.split(" |").next()?.parse().ok());
    value.unwrap_or_else(|| panic!("reports/paper.md has no number {name}"))
}

/// Returns the speedup on [`parallel_ranks`](number) ranks over one.
pub fn speedup() -> f64 {
    60.0 * number("serial_min") / number("parallel_s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_numbers_are_those_of_the_page() {
        let cells_per_s = number("serial_cells") / (60.0 * number("serial_min"));
        // The greatest load imbalance λ that the speedup allows: by time, and without the part of the time for partitioning. No rank can
        // have done more than λ / p of the serial work in the time of the parallel run.
        let imbalance_max = number("parallel_ranks") / speedup();
        let without_partitioning = imbalance_max * (1.0 - number("partitioning") / 100.0);
        let shown = [cells_per_s, speedup(), imbalance_max, without_partitioning];
        assert_eq!(shown.map(|v| (v * 100.0).round()), [3_787_879.0, 1_128.0, 284.0, 238.0]);
        for text in ["37,879 ", "11.28 ", "2.84 ", "2.38 "] {
            assert!(PAGE.contains(text), "{text}");
        }
    }
}
