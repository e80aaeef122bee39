//! Figures for LaTeX, set in the fonts of the document: the values as CSV, and an axis of `pgfplots` that reads them.

use super::axes::{SUPERSCRIPTS, range, tick_label, ticks};
use super::canvas::{COLOURS, MARKERS};
use super::{Axis, Figure, Point, Provenance, Series};
use std::fmt::Write;

/// What a document needs before it can include figures.
const PREAMBLE: &str = "\\usepackage{pgfplots} \\pgfplotsset{compat=1.16}";

/// Filled and hollow marker of every style.
const MARKS: [(&str, &str); MARKERS.len()] = [
    ("*", "o"),
    ("square*", "square"),
    ("triangle*", "triangle"),
    ("diamond*", "diamond"),
    ("triangle*, mark options={rotate=180}", "triangle, mark options={rotate=180}"),
    ("pentagon*", "pentagon"),
];

/// The values as CSV, one per line. Comments at the head, starting with `#`, name the title and the axes. Rows of one series have the same
/// number `plot`. Numbers come first and text has no commas, so that `pgfplots` can read it.
pub fn csv(figure: &Figure) -> String {
    let head = format!("# {}\n# x: {}; y: {}\n", figure.title, figure.x.label, figure.y.label);
    let columns = ["plot", "x", "y", "low", "high", "series", "how"];
    let point = |plot: usize, s: &Series, p: &Point| {
        let numbers = [plot as f64, p.x, p.y, p.low, p.high];
        let numbers = numbers.iter().map(f64::to_string);
        numbers.chain([plain(&s.name), s.provenance.word().to_owned()]).collect()
    };
    let series = figure.series.iter().enumerate();
    let rows = series.flat_map(|(plot, s)| s.points.iter().map(move |p| point(plot, s, p)));
    head + &table(&columns, rows)
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

/// The figure as a `tikzpicture`. `\figures` is the directory of its other files.
pub fn tex(figure: &Figure) -> String {
    let mut out = format!(
        "% Requires {PREAMBLE}\n\\providecommand{{\\figures}}{{figures}}\n\\begin{{tikzpicture}}\n"
    );
    for (i, [r, g, b]) in COLOURS.iter().enumerate() {
        // Writing into a string cannot fail, here and below.
        let _ = writeln!(out, "\\definecolor{{style{i}}}{{RGB}}{{{r},{g},{b}}}");
    }
    let all = || figure.series.iter().flat_map(|s| &s.points);
    let _ = writeln!(
        out,
        "\\begin{{axis}}[\n  width=\\linewidth, height=0.65\\linewidth, grid=major, legend cell align=left,\n  \
         legend style={{at={{(0.5,1.03)}},anchor=south,legend columns=2,draw=none,font=\\footnotesize}},\n  {},\n  {}\n]",
        axis_options("x", &figure.x, all().map(|p| p.x)),
        axis_options("y", &figure.y, all().flat_map(|p| [p.y, p.low, p.high]))
    );
    for (plot, s) in figure.series.iter().enumerate() {
        let (style, (filled, hollow)) = (s.style % COLOURS.len(), MARKS[s.style % MARKS.len()]);
        let (line, mark) = match s.provenance {
            Provenance::Measured => ("solid", filled),
            _ => ("dashed", hollow),
        };
        let line = if s.joined { line } else { "only marks" };
        let options = match s.provenance {
            Provenance::Bound => "black, densely dotted, no marks".to_owned(),
            _ => format!(
                "style{style}, {line}, mark={mark}, error bars/.cd, y dir=both, y explicit, error bar style={{solid}}"
            ),
        };
        let _ = writeln!(
            out,
            "\\addplot[{options}] table[col sep=comma, comment chars={{\\#}}, \
             restrict expr to domain={{\\thisrow{{plot}}}}{{{plot}:{plot}}}, x=x, y=y, \
             y error plus expr=\\thisrow{{high}}-\\thisrow{{y}}, y error minus expr=\\thisrow{{y}}-\\thisrow{{low}}] \
             {{\\figures/{}.csv}};\n\\addlegendentry{{{}}}",
            figure.id,
            escape(&s.name)
        );
    }
    out + "\\end{axis}\n\\end{tikzpicture}\n"
}

/// Label, kind, ends and ticks of an axis.
fn axis_options(name: &str, axis: &Axis, values: impl Iterator<Item = f64>) -> String {
    let ends = range(axis, values);
    let all = ticks(axis, &ends);
    let at: Vec<String> = all.iter().map(f64::to_string).collect();
    let labels: Vec<String> = all.iter().map(|tick| escape(&tick_label(*tick))).collect();
    format!(
        "{name}label={{{}}}, {name}mode={}, {name}min={}, {name}max={}, {name}tick={{{}}}, {name}ticklabels={{{}}}",
        escape(&axis.label),
        if axis.log { "log" } else { "linear" },
        ends.start,
        ends.end,
        at.join(","),
        labels.join(",")
    )
}

/// The text with what is special to LaTeX escaped.
fn escape(text: &str) -> String {
    let escaped = |c: char| match c {
        '\\' => "\\textbackslash{}".to_owned(),
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '<' => "\\textless{}".to_owned(),
        '>' => "\\textgreater{}".to_owned(),
        '`' => "'".to_owned(),
        '·' => "$\\cdot$".to_owned(),
        'λ' => "$\\lambda$".to_owned(),
        '–' => "--".to_owned(),
        'µ' => "$\\mu$".to_owned(),
        '×' => "$\\times$".to_owned(),
        '⁻' => "$^-$".to_owned(),
        _ => match SUPERSCRIPTS.iter().position(|s| *s == c) {
            Some(digit) => format!("$^{digit}$"),
            None => c.to_string(),
        },
    };
    text.chars().map(escaped).collect()
}

#[cfg(test)]
mod tests {
    use super::super::samples::{figure, series};
    use super::*;

    #[test]
    fn every_point_is_a_line_and_text_is_plain() {
        let text = csv(&figure(vec![series(Provenance::Measured), series(Provenance::Projected)]));
        assert_eq!(text.lines().count(), 3 + 6);
        assert!(text.contains("\n1,4,4,3.6,4.4,UAV; projected,projected\n"), "{text}");
        assert_eq!(plain("5 % of \"a\", b_1"), "5   of  a ; b_1");
    }

    #[test]
    fn measured_points_are_filled_and_oversubscribed_ones_hollow() {
        let both = vec![series(Provenance::Measured), series(Provenance::Oversubscribed)];
        let text = tex(&figure(both));
        assert!(text.contains("mark=*") && text.contains("mark=o"));
        assert!(text.contains("xmode=log") && text.contains("xtick={1,2,4}, xticklabels={1,2,4}"));
        assert!(
            text.contains("{\\thisrow{plot}}{1:1}") && text.contains("{\\figures/speedup.csv}")
        );
        assert_eq!(text.matches('{').count(), text.matches('}').count(), "{text}");
        assert_eq!(text.matches("\\begin").count(), text.matches("\\end").count(), "{text}");
    }

    #[test]
    fn special_characters_are_escaped() {
        assert_eq!(escape("5·10⁻⁷"), "5$\\cdot$10$^-$$^7$");
        assert_eq!(escape("50 % of A_1 & {B}"), "50 \\% of A\\_1 \\& \\{B\\}");
    }
}
