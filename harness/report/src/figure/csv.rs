//! The values of a figure as CSV. Numbers come first and text has no commas, so that `pgfplots` can read it.

use super::{Body, Figure, Point, Series};

/// The values as CSV, one per line. Comments at the head, starting with `#`, name the title and the axes. Rows that belong
/// together have the same number `plot`.
pub fn csv(figure: &Figure) -> String {
    let head = format!("# {}\n# x: {}; y: {}\n", figure.title, figure.x.label, figure.y.label);
    let (columns, rows): (&[&str], Vec<Vec<String>>) = match &figure.body {
        Body::Points { series, .. } => {
            let point = |plot: usize, s: &Series, p: &Point| {
                let coverage = (p.coverage * 1e4).round() / 1e4;
                let numbers = [p.x, p.y, p.low, p.high, p.count as f64, coverage];
                row(plot, &numbers, &[&s.name, s.provenance.word()])
            };
            let points = (0..).zip(series);
            let points =
                points.flat_map(|(plot, s)| s.points.iter().map(move |p| point(plot, s, p)));
            let columns = &["plot", "x", "y", "low", "high", "count", "coverage", "series", "how"];
            (columns, points.collect())
        }
        Body::Bars(bars) => {
            let mut rows = Vec::new();
            for (plot, (part, values)) in bars.segments.iter().enumerate() {
                for (i, name) in bars.categories.iter().enumerate() {
                    let text = [name, part, bars.provenance.word()];
                    rows.push(row(plot, &[i as f64, values[i]], &text));
                }
            }
            // A level is a line from the first bar to the last.
            let ends = [-0.5, bars.categories.len() as f64 - 0.5];
            for (plot, (name, level)) in (bars.segments.len()..).zip(&bars.references) {
                rows.extend(ends.map(|x| row(plot, &[x, *level], &["", name, "bound"])));
            }
            (&["plot", "x", "value", "bar", "part", "how"], rows)
        }
    };
    head + &table(columns, rows)
}

fn row(plot: usize, numbers: &[f64], text: &[&str]) -> Vec<String> {
    let numbers = numbers.iter().map(f64::to_string);
    let text = text.iter().map(|text| plain(text));
    std::iter::once(plot.to_string()).chain(numbers).chain(text).collect()
}

/// A name without what ends a field or means something to TeX.
fn plain(text: &str) -> String {
    text.replace(", ", "; ")
        .replace([',', '"', '%', '#', '\\', '{', '}', '$', '&', '~', '^', '\n', '\r'], " ")
}

/// A CSV table with its head.
///
/// # Panics
/// If a row and the head have different numbers of fields.
pub fn table(columns: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let write = || -> Result<(), ::csv::Error> {
        writer.write_record(columns)?;
        rows.into_iter().try_for_each(|row| writer.write_record(row))
    };
    write().expect("memory accepts rows of equal length");
    let bytes = writer.into_inner().expect("memory accepts every write");
    String::from_utf8(bytes).expect("the fields are UTF-8")
}

#[cfg(test)]
mod tests {
    use super::super::Provenance;
    use super::super::samples::{figure, series};
    use super::*;

    #[test]
    fn every_point_is_a_line_and_text_is_plain() {
        let both = vec![series(Provenance::Measured), series(Provenance::Projected)];
        let text = csv(&figure(Body::points(both)));
        assert_eq!(text.lines().count(), 3 + 6);
        assert!(text.contains("\n1,4,4,3.6,4.4,6,0.97,UAV; projected,projected\n"), "{text}");
        assert_eq!(plain("5 % of \"a\", b_1"), "5   of  a ; b_1");
    }
}
