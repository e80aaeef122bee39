//! The answer for a terminal.

use std::fmt;

use super::report::{Destination, Meshed, Passage, Report, Spacing};
use crate::geometry::meaning::number;

/// Rows of the path that are printed.
const POINTS_MAX: usize = 24;
/// Facets at the rim that are printed.
const FACETS_MAX: usize = 24;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let to = match &self.to {
            Destination::Point(at) => point(at),
            Destination::Far(_) => "the far field".to_owned(),
        };
        writeln!(f, "from      {}", point(&self.from))?;
        writeln!(f, "to        {to}")?;
        writeln!(f, "spacing   {}", spacing(&self.spacing))?;
        writeln!(f, "\n{:>5} {:>12} {:>12}  path", "level", "spacing", "leaves")?;
        self.levels.iter().try_for_each(|level| row(level, f))?;
        match (self.is_leak, &self.closes, &self.opens, &self.limit) {
            (true, Some(closes), ..) => {
                let why = self.levels.last().and_then(|level| level.why);
                let why = why.map_or(String::new(), |why| format!(", where {why}"));
                writeln!(f, "\n{}; closed at spacing {}{why}", self.verdict(), spacing(closes))?;
            }
            (true, None, ..) => writeln!(f, "\n{}, at every spacing", self.verdict())?,
            (false, _, Some(opens), _) => {
                writeln!(
                    f,
                    "\nno leak at this spacing; it would open at spacing {}",
                    spacing(opens)
                )?;
            }
            (false, ..) if self.is_separated => {
                writeln!(
                    f,
                    "\nno leak at any spacing: the facets form a closed surface between start and end"
                )?;
            }
            (false, _, _, limit) => {
                let limit = limit.as_deref().unwrap_or_default();
                writeln!(
                    f,
                    "\nno leak at this spacing, nor at any finer one that was tried; whether one leaks is not known: {limit}"
                )?;
            }
        }
        self.passage.iter().try_for_each(|passage| describe(passage, f))
    }
}

impl Report {
    /// What it means that free leaves join start and end.
    fn verdict(&self) -> &'static str {
        match &self.passage {
            Some(passage) if passage.narrowest.is_end => {
                "JOINED: start and end lie in one space, or one of them within the opening"
            }
            _ => "LEAK: free leaves join start and end",
        }
    }
}

fn row(meshed: &Meshed, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let path = match (meshed.is_joined, meshed.why) {
        (true, _) => "open".to_owned(),
        (false, None) => "closed".to_owned(),
        (false, Some(why)) => format!("closed: {why}"),
    };
    let Spacing { level, spacing } = meshed.spacing;
    writeln!(f, "{level:>5} {:>12} {:>12}  {path}", rounded_up(spacing), meshed.leaves)
}

fn describe(passage: &Passage, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let narrowest = &passage.narrowest;
    let (width, cells) = (number(narrowest.width), number(narrowest.width_cells));
    writeln!(f, "\nThe narrowest place of the widest path (level {})", passage.spacing.level)?;
    writeln!(
        f,
        "width     {width} ({cells} cells of the case's spacing): diameter of the largest ball that passes"
    )?;
    if !narrowest.is_end {
        writeln!(
            f,
            "          Spacings above {width} close it wherever the lattice lies; a finer one may close it on this lattice only."
        )?;
    }
    writeln!(f, "at        {}", point(&narrowest.at))?;
    let [x, y, z] = narrowest.direction;
    writeln!(f, "direction ({x:.3}, {y:.3}, {z:.3})")?;
    let listed = narrowest.facets.iter().take(FACETS_MAX).map(ToString::to_string);
    let listed: Vec<String> = listed.collect();
    let more = match narrowest.facets.len().saturating_sub(FACETS_MAX) {
        0 => String::new(),
        more => format!(" and {more} more (--json)"),
    };
    writeln!(f, "facets    {}{more}", listed.join(", "))?;
    if narrowest.is_end {
        writeln!(
            f,
            "          This is an end of the path: no place on the way is narrower, so there is no opening between the ends."
        )?;
    }
    let (points, length) = (&passage.points, number(passage.length));
    writeln!(f, "\nThe path: {} points, length {length}", points.len())?;
    writeln!(f, "{:>12}  point", "free width")?;
    let every = points.len().div_ceil(POINTS_MAX).max(1);
    for (i, p) in points.iter().enumerate() {
        let is_last = i + 1 == points.len();
        if i % every == 0 || i == narrowest.index || is_last {
            let mark = if i == narrowest.index { "  narrowest" } else { "" };
            writeln!(f, "{:>12}  {}{mark}", number(p.width), point(&p.at))?;
        }
    }
    if every > 1 {
        writeln!(f, "              one in {every} points is printed; --json and --vtk write all")?;
    }
    Ok(())
}

fn spacing(spacing: &Spacing) -> String {
    format!("{} (level {})", rounded_up(spacing.spacing), spacing.level)
}

/// A spacing with three significant digits, rounded up: a case with this spacing has the same level.
fn rounded_up(spacing: f64) -> String {
    let unit = 10f64.powi(spacing.log10().floor() as i32 - 2);
    let text = number(spacing);
    match text.parse::<f64>() {
        Ok(rounded) if rounded < spacing => number(spacing + unit),
        _ => text,
    }
}

fn point(at: &[f64; 3]) -> String {
    let [x, y, z] = at;
    format!("({x}, {y}, {z})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_spacing_has_the_level_of_the_exact_one() {
        for exact in [8.265 / 512.0, 4.28 / 128.0, 0.25, 0.9996, 1.0 / 3.0, 1234.5, 7.3e-9, 8.1e12]
        {
            let printed: f64 = rounded_up(exact).parse().unwrap();
            assert!(printed >= exact && printed < 1.02 * exact, "{exact}: {printed}");
        }
    }
}
