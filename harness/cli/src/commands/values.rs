//! Parsers of option values.

use clap::builder::{PathBufValueParser, TypedValueParser, ValueParser, ValueParserFactory};
use contract::case::Case;
use contract::failure::Failure;
use contract::lattice::Root;
use run::engine::paths::Paths;
pub use run::verify::options::whole_seconds;
use std::io;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A file or a directory that the command writes or reads. It is checked when the command line is parsed, before any work: what is written
/// can be written, and is nothing that the command reads. Files of a directory are inputs when they are opened.
#[derive(Clone, Debug)]
pub struct Place<const WRITTEN: bool>(PathBuf);

/// A file that the command writes.
pub type Output = Place<true>;
/// A file or a directory that the command reads.
pub type Input = Place<false>;

impl<const WRITTEN: bool> Deref for Place<WRITTEN> {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl<const WRITTEN: bool> ValueParserFactory for Place<WRITTEN> {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        let check = if WRITTEN { writable } else { files::register_input };
        PathBufValueParser::new().try_map(move |path| check(&path).map(|()| Self(path))).into()
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
        writable(&path).map(|()| Place(path))
    })
}

fn writable(path: &Path) -> io::Result<()> {
    files::name_output(path).and_then(|()| files::check_writable(path))
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

/// A point in the user's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point(pub [f64; 3]);

impl FromStr for Point {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        numbers(text).map(Self).ok_or_else(|| "give three numbers: X,Y,Z".to_owned())
    }
}

/// As many finite numbers, separated by commas.
pub fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let finite = |n: &str| n.trim().parse().ok().filter(|c: &f64| c.is_finite());
    text.split(',').map(finite).collect::<Option<Vec<f64>>>()?.try_into().ok()
}

/// Reads the case with this name in geometries/catalogue.toml, or the case file with this path.
///
/// # Errors
/// If it cannot be read.
pub fn read_case(name: &str) -> Result<Case, Failure> {
    Ok(Case::read(&Paths::find().catalogue.case_file(name, Path::new(""))?)?)
}

/// Parses a root from four numbers.
pub fn root(text: &str) -> Result<Root, String> {
    let [x, y, z, edge] =
        numbers(text).ok_or_else(|| "give four numbers: X,Y,Z,EDGE".to_owned())?;
    Ok(Root { origin: [x, y, z], edge })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_three_finite_numbers() {
        assert_eq!("-1, 2.5,3e2".parse(), Ok(Point([-1.0, 2.5, 300.0])));
        for wrong in ["1,2", "1,2,3,4", "1,2,x", "1,2,nan", ""] {
            assert!(wrong.parse::<Point>().is_err(), "{wrong}");
        }
    }

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
