//! Parsers of option values.

use contract::lattice::Root;

/// Parses a number of cells, such as `1e9`.
pub fn cell_count(text: &str) -> Result<u64, String> {
    let cells = text.trim().parse::<f64>().ok().filter(|c| (1e3..=1e12).contains(c));
    cells.map(|c| c as u64).ok_or_else(|| "give a number of cells from 1e3 to 1e12".to_owned())
}

/// Parses a root from four numbers.
pub fn root(text: &str) -> Result<Root, String> {
    let numbers: Vec<f64> = text.split(',').map_while(|n| n.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, z, edge] if text.split(',').count() == 4 => Ok(Root { origin: [x, y, z], edge }),
        _ => Err("give four numbers: X,Y,Z,EDGE".to_owned()),
    }
}
