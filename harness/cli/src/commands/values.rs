//! Parsers of option values.

/// Parses a number of cells, such as `1e9`.
pub fn cell_count(text: &str) -> Result<u64, String> {
    let cells = text.trim().parse::<f64>().ok().filter(|c| (1e3..=1e12).contains(c));
    cells.map(|c| c as u64).ok_or_else(|| "give a number of cells from 1e3 to 1e12".to_owned())
}
