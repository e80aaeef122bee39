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

/// Returns cells per second on one processor.
pub fn cells_per_s() -> f64 {
    number("serial_cells") / (60.0 * number("serial_min"))
}

/// Returns the speedup on [`parallel_ranks`](number) ranks over one.
pub fn speedup() -> f64 {
    60.0 * number("serial_min") / number("parallel_s")
}

/// Returns the greatest load imbalance λ that its speedup allows on as many ranks: by time, and without the part of the time for partitioning. No
/// rank can have done more than λ / p of the serial work in the time of the parallel run.
pub fn imbalance_max() -> [f64; 2] {
    let by_time = number("parallel_ranks") / speedup();
    [by_time, by_time * (1.0 - number("partitioning") / 100.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_numbers_are_those_of_the_page() {
        let shown = [cells_per_s(), speedup(), imbalance_max()[0], imbalance_max()[1]];
        assert_eq!(shown.map(|v| (v * 100.0).round()), [3_787_879.0, 1_128.0, 284.0, 238.0]);
        for text in ["37,879 ", "11.28 ", "2.84 ", "2.38 "] {
            assert!(PAGE.contains(text), "{text}");
        }
    }
}
