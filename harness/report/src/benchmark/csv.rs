//! A figure's numbers, for whoever wants to draw it again.

use super::figure::{Body, Figure};
use std::fmt::Write;

/// The figure's numbers as CSV, one line per point.
pub fn csv(figure: &Figure) -> String {
    let mut out = format!("# {}\n# x: {}; y: {}\n", figure.title, figure.x.label, figure.y.label);
    match &figure.body {
        Body::Points(all) => {
            out.push_str("series,how,x,y,low,high,count,coverage\n");
            for s in all {
                for p in &s.points {
                    let _ = writeln!(
                        out,
                        "{},{},{},{},{},{},{},{:.4}",
                        quoted(&s.name),
                        s.how.word(),
                        p.x,
                        p.y,
                        p.low,
                        p.high,
                        p.count,
                        p.coverage
                    );
                }
            }
        }
        Body::Bars(bars) => {
            out.push_str("bar,part,how,value\n");
            for (i, category) in bars.categories.iter().enumerate() {
                for (name, values) in &bars.parts {
                    let _ = writeln!(
                        out,
                        "{},{},{},{}",
                        quoted(category),
                        quoted(name),
                        bars.how.word(),
                        values[i]
                    );
                }
            }
            for (name, level) in &bars.lines {
                let _ = writeln!(out, ",{},bound,{level}", quoted(name));
            }
        }
        Body::Heat(heat) => {
            let _ = writeln!(out, "# {}\nrow,column,quantity,value", heat.command);
            for layer in &heat.layers {
                for (row, column, value) in &layer.cells {
                    let _ = writeln!(out, "{row},{column},{},{value}", quoted(&layer.label));
                }
            }
        }
    }
    out
}

/// A field that may hold commas.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::super::figure::How;
    use super::super::paint::tests::{figure, series};
    use super::*;

    #[test]
    fn a_matrix_has_its_command_and_a_line_for_every_cell() {
        let text = csv(&super::super::heat::tests::figure());
        assert!(text.contains("# mesher a,b\nrow,column,quantity,value\n0,1,bytes,10\n"), "{text}");
        assert_eq!(text.lines().count(), 4 + 3);
    }

    #[test]
    fn every_point_is_a_line() {
        let text = csv(&figure(Body::Points(vec![series(How::Measured), series(How::Projected)])));
        assert_eq!(text.lines().count(), 3 + 6);
        assert!(text.contains("\"UAV, projected\",projected,4,4,3.6,4.4,6,0.9700"));
    }
}
