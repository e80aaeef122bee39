//! The values of a figure as CSV.

use super::{Body, Figure};

/// The values as CSV, one per line. Comments at the head, starting with `#`, name the title and the axes.
pub fn csv(figure: &Figure) -> String {
    let mut head = format!("# {}\n# x: {}; y: {}\n", figure.title, figure.x.label, figure.y.label);
    let rows = match &figure.body {
        Body::Points { series, .. } => series
            .iter()
            .flat_map(|s| s.points.iter().map(move |p| (s, p)))
            .map(|(s, p)| {
                let numbers = [p.x, p.y, p.low, p.high].map(|v| v.to_string());
                let mut row = vec![s.name.clone(), s.provenance.word().to_owned()];
                row.extend(numbers);
                row.extend([p.count.to_string(), format!("{:.4}", p.coverage)]);
                row
            })
            .collect(),
        Body::Bars(bars) => {
            let word = bars.provenance.word();
            let bar = |(i, category): (usize, &String)| {
                let value = |(name, values): &(String, Vec<f64>)| {
                    vec![category.clone(), name.clone(), word.to_owned(), values[i].to_string()]
                };
                bars.segments.iter().map(value).collect::<Vec<_>>()
            };
            let reference = |(name, level): &(String, f64)| {
                vec![String::new(), name.clone(), "bound".to_owned(), level.to_string()]
            };
            let mut rows: Vec<_> = bars.categories.iter().enumerate().flat_map(bar).collect();
            rows.extend(bars.references.iter().map(reference));
            rows
        }
        Body::HeatMap(map) => {
            head.push_str(&format!("# {}\n", map.command));
            let entries = map.layers.iter().flat_map(|l| l.entries.iter().map(move |e| (l, e)));
            let row = |(layer, (row, column, value)): (&super::Layer, &(usize, usize, f64))| {
                vec![row.to_string(), column.to_string(), layer.label.clone(), value.to_string()]
            };
            entries.map(row).collect::<Vec<_>>()
        }
    };
    let columns: &[&str] = match figure.body {
        Body::Points { .. } => &["series", "how", "x", "y", "low", "high", "count", "coverage"],
        Body::Bars(_) => &["bar", "part", "how", "value"],
        Body::HeatMap(_) => &["row", "column", "quantity", "value"],
    };
    head + &table(columns, rows)
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
    use super::super::samples::{figure, heat_map, series};
    use super::*;

    #[test]
    fn a_matrix_has_its_command_and_a_line_per_entry() {
        let text = csv(&heat_map());
        assert!(text.contains("# mesher a,b\nrow,column,quantity,value\n0,1,bytes,10\n"), "{text}");
        assert_eq!(text.lines().count(), 4 + 3);
    }

    #[test]
    fn every_point_is_a_line() {
        let both = vec![series(Provenance::Measured), series(Provenance::Projected)];
        let text = csv(&figure(Body::points(both)));
        assert_eq!(text.lines().count(), 3 + 6);
        assert!(text.contains("\"UAV, projected\",projected,4,4,3.6,4.4,6,0.9700"), "{text}");
    }
}
