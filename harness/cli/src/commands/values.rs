//! Parsers of option values.

use clap::builder::{PathBufValueParser, TypedValueParser, ValueParser, ValueParserFactory};
use contract::lattice::Root;
pub use run::verify::options::whole_seconds;
use std::io;
use std::ops::Deref;
use std::path::{Path, PathBuf};

/// A file that the command writes. It is checked when the command line is parsed, before any work: it can be written, and the
/// command does not read it.
#[derive(Clone, Debug)]
pub struct Output(PathBuf);

/// A file or a directory that the command reads. Files of a directory are inputs when they are opened.
#[derive(Clone, Debug)]
pub struct Input(PathBuf);

impl Deref for Output {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl Deref for Input {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl ValueParserFactory for Output {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        let parse = |path: PathBuf| files::check_writable(&path).map(|()| Self(path));
        PathBufValueParser::new().try_map(parse).into()
    }
}

impl ValueParserFactory for Input {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        let parse = |path: PathBuf| files::register_input(&path).map(|()| Self(path));
        PathBufValueParser::new().try_map(parse).into()
    }
}

/// A parser of outputs with one of these extensions.
pub fn with_extension(
    extensions: &'static [&'static str],
) -> impl TypedValueParser<Value = Output> {
    PathBufValueParser::new().try_map(move |path| {
        if !path.extension().is_some_and(|e| extensions.iter().any(|wanted| e == *wanted)) {
            let endings = extensions.join(" or .");
            return Err(io::Error::other(format!("the file name must end in .{endings}")));
        }
        files::check_writable(&path).map(|()| Output(path))
    })
}

/// Parses a number of cells, such as `1e9`.
pub fn cell_count(text: &str) -> Result<u64, String> {
    let cells = text.trim().parse::<f64>().ok().filter(|c| (1e3..=1e12).contains(c));
    cells.map(|c| c as u64).ok_or_else(|| "give a number of cells from 1e3 to 1e12".to_owned())
}

/// Parses a probability that is not 0.
pub fn probability(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|n| *n > 0.0 && *n <= 1.0);
    number.ok_or_else(|| "give a number greater than 0 and at most 1".to_owned())
}

/// Parses a percentage from 0 to 1000.
pub fn percentage(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|n| (0.0..=1000.0).contains(n));
    number.ok_or_else(|| "give a percentage from 0 to 1000".to_owned())
}

/// Parses a root from four numbers.
pub fn root(text: &str) -> Result<Root, String> {
    let numbers: Vec<f64> = text.split(',').map_while(|n| n.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, z, edge] if text.split(',').count() == 4 => Ok(Root { origin: [x, y, z], edge }),
        _ => Err("give four numbers: X,Y,Z,EDGE".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_limit_is_at_least_a_second_and_at_most_a_week() {
        assert_eq!((whole_seconds("1"), whole_seconds(" 604800 ")), (Ok(1), Ok(604_800)));
        for wrong in ["0", "-1", "604801", "1.5", ""] {
            assert_eq!(
                whole_seconds(wrong),
                Err("give a whole number of seconds from 1 to 604800".to_owned())
            );
        }
    }
}
