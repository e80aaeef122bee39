//! A figure for LaTeX, set in the fonts of the document: a `pgfplots` axis that reads the CSV file beside it.

use super::palette::{COLOURS, MARKERS};
use super::scale::{SUPERSCRIPTS, range, tick_label, ticks};
use super::{Axis, Bars, Body, Figure, Mark, Provenance, Series};
use std::fmt::Write;

/// What a document needs before it can include figures.
pub const PREAMBLE: &str = "\\usepackage{pgfplots} \\pgfplotsset{compat=1.16}";

/// Filled and hollow marker of every style.
const MARKS: [(&str, &str); MARKERS] = [
    ("*", "o"),
    ("square*", "square"),
    ("triangle*", "triangle"),
    ("diamond*", "diamond"),
    ("triangle*, mark options={rotate=180}", "triangle, mark options={rotate=180}"),
    ("pentagon*", "pentagon"),
];

/// The figure as a `tikzpicture`. `\figures` is the directory of its other files.
pub fn tex(figure: &Figure) -> String {
    let mut out = format!(
        "% Requires {PREAMBLE}\n\\providecommand{{\\figures}}{{figures}}\n\\begin{{tikzpicture}}\n"
    );
    for (i, [r, g, b]) in COLOURS.iter().enumerate() {
        // Writing into a string cannot fail, here and below.
        let _ = writeln!(out, "\\definecolor{{style{i}}}{{RGB}}{{{r},{g},{b}}}");
    }
    match &figure.body {
        Body::Points { series, marks } => points(&mut out, figure, series, marks),
        Body::Bars(b) => bars(&mut out, figure, b),
    }
    out.push_str("\\end{tikzpicture}\n");
    out
}

/// The rows of a plot in the CSV file, with further keys.
fn table(figure: &Figure, plot: usize, keys: &str) -> String {
    format!(
        "table[col sep=comma, comment chars={{\\#}}, restrict expr to domain={{\\thisrow{{plot}}}}{{{plot}:{plot}}}, {keys}] {{\\figures/{}.csv}}",
        figure.id
    )
}

fn begin(out: &mut String, figure: &Figure, more: &[String]) {
    let _ = writeln!(
        out,
        "\\begin{{axis}}[\n  width=\\linewidth, height=0.65\\linewidth, grid=major, legend cell align=left,\n  xlabel={{{}}}, ylabel={{{}}},\n  \
         legend style={{at={{(0.5,1.03)}},anchor=south,legend columns=2,draw=none,font=\\footnotesize}},\n  {}\n]",
        escape(&figure.x.label),
        escape(&figure.y.label),
        more.join(",\n  ")
    );
}

fn points(out: &mut String, figure: &Figure, series: &[Series], marks: &[Mark]) {
    let all = || series.iter().flat_map(|s| &s.points);
    let mut options = axis_options("x", &figure.x, all().map(|p| p.x));
    options.extend(axis_options("y", &figure.y, all().flat_map(|p| [p.y, p.low, p.high])));
    begin(out, figure, &options);
    for (plot, s) in series.iter().enumerate() {
        let (style, solid) = (s.style % COLOURS.len(), s.provenance.is_solid());
        let (filled, hollow) = MARKS[s.style % MARKERS];
        let dashes = if solid { "solid" } else { "dashed" };
        let options = match s.provenance {
            Provenance::Bound => "black, densely dotted, no marks".to_owned(),
            _ => format!(
                "style{style}, {}, mark={}, error bars/.cd, y dir=both, y explicit, error bar style={{solid}}",
                if s.joined { dashes } else { "only marks" },
                if solid { filled } else { hollow }
            ),
        };
        let errors = "y error plus expr=\\thisrow{high}-\\thisrow{y}, y error minus expr=\\thisrow{y}-\\thisrow{low}";
        let rows = table(figure, plot, &format!("x=x, y=y, {errors}"));
        let _ =
            writeln!(out, "\\addplot[{options}] {rows};\n\\addlegendentry{{{}}}", escape(&s.name));
    }
    for mark in marks {
        let (style, x) = (mark.style % COLOURS.len(), mark.x);
        let _ = writeln!(
            out,
            "\\draw[style{style}] ({{axis cs:{x},0}}|-{{rel axis cs:0,0}}) -- ({{axis cs:{x},0}}|-{{rel axis cs:0,1}});"
        );
    }
    out.push_str("\\end{axis}\n");
}

/// Kind, ends and ticks of an axis. `pgfplots` chooses ticks, except for those that an axis has and on short logarithmic axes, where it would take fractional powers.
fn axis_options(name: &str, axis: &Axis, values: impl Iterator<Item = f64>) -> Vec<String> {
    let ends = range(axis, values);
    let mut options = vec![format!("{name}min={}, {name}max={}", ends.start, ends.end)];
    let at = ticks(axis, &ends);
    let is_power = |tick: &f64| (tick.log10() - tick.log10().round()).abs() < 1e-9;
    if axis.log {
        options.push(format!("{name}mode=log"));
    }
    if !axis.ticks.is_empty() || axis.log && !at.iter().all(is_power) {
        let labels: Vec<String> = at.iter().map(|tick| escape(&tick_label(*tick))).collect();
        let at: Vec<String> = at.iter().map(f64::to_string).collect();
        options.push(format!(
            "{name}tick={{{}}}, {name}ticklabels={{{}}}",
            at.join(","),
            labels.join(",")
        ));
    }
    options
}

fn bars(out: &mut String, figure: &Figure, b: &Bars) {
    let every = b.categories.len().div_ceil(16).max(1);
    let shown = || b.categories.iter().enumerate().step_by(every);
    let positions: Vec<String> = shown().map(|(i, _)| i.to_string()).collect();
    let names: Vec<String> = shown().map(|(_, name)| format!("{{{}}}", escape(name))).collect();
    let options = [
        format!(
            "ybar stacked, bar width={}, ymin=0",
            if b.categories.len() > 20 { "2pt" } else { "8pt" }
        ),
        format!("xtick={{{}}}, xticklabels={{{}}}", positions.join(","), names.join(",")),
        "x tick label style={rotate=45,anchor=east,font=\\footnotesize}".to_owned(),
    ];
    begin(out, figure, &options);
    for (plot, (name, _)) in b.segments.iter().enumerate() {
        let style = plot % COLOURS.len();
        let lighter = if plot % 2 == 1 { "!35" } else { "" };
        let rows = table(figure, plot, "x=x, y=value");
        let _ = writeln!(
            out,
            "\\addplot+[fill=style{style}{lighter}, draw=style{style}] {rows};\n\\addlegendentry{{{}}}",
            escape(name)
        );
    }
    for (i, (name, _)) in b.references.iter().enumerate() {
        let dashes = ["densely dotted", "dashed", "solid"][i % 3];
        let rows = table(figure, b.segments.len() + i, "x=x, y=value");
        let _ = writeln!(
            out,
            "\\addplot[black, {dashes}, sharp plot, stack plots=false, update limits=false, line legend] {rows};\n\\addlegendentry{{{}}}",
            escape(name)
        );
    }
    out.push_str("\\end{axis}\n");
}

/// The text with what is special to LaTeX escaped.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' => out.push_str("\\textbackslash{}"),
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => out.extend(['\\', c]),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '<' => out.push_str("\\textless{}"),
            '>' => out.push_str("\\textgreater{}"),
            '`' => out.push('\''),
            '·' => out.push_str("$\\cdot$"),
            'λ' => out.push_str("$\\lambda$"),
            '≤' => out.push_str("$\\leq$"),
            '–' => out.push_str("--"),
            'µ' => out.push_str("$\\mu$"),
            '×' => out.push_str("$\\times$"),
            '⁻' => out.push_str("$^-$"),
            _ if SUPERSCRIPTS.contains(&c) => {
                let digit = SUPERSCRIPTS.iter().position(|s| *s == c);
                let _ = write!(out, "$^{}$", digit.unwrap_or_default());
            }
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::samples::{figure, series};
    use super::*;

    /// Asserts that braces and environments are closed.
    fn assert_closed(text: &str) {
        assert_eq!(text.matches('{').count(), text.matches('}').count(), "{text}");
        assert_eq!(text.matches("\\begin").count(), text.matches("\\end").count(), "{text}");
    }

    #[test]
    fn measured_points_are_filled_and_oversubscribed_ones_hollow() {
        let both = vec![series(Provenance::Measured), series(Provenance::Oversubscribed)];
        let text = tex(&figure(Body::points(both)));
        assert!(text.contains("mark=*") && text.contains("mark=o"));
        assert!(text.contains("xmode=log") && text.contains("xtick={1,2,4}, xticklabels={1,2,4}"));
        assert!(
            text.contains("{\\thisrow{plot}}{1:1}") && text.contains("{\\figures/speedup.csv}")
        );
        assert_closed(&text);
    }

    #[test]
    fn special_characters_are_escaped() {
        assert_eq!(escape("5·10⁻⁷"), "5$\\cdot$10$^-$$^7$");
        assert_eq!(escape("50 % of A_1 & {B}"), "50 \\% of A\\_1 \\& \\{B\\}");
    }
}
