//! Figures for LaTeX, set in the fonts of the document: the values as CSV, and an axis of `pgfplots` that reads them.

use super::axes::{SUPERSCRIPTS, Scale};
use super::canvas::COLOURS;
use super::svg::MARKERS;
use super::{Axis, Figure, Kind, Point, Provenance, Series};
use crate::table::Table;

/// What a document needs before it can include figures.
const PREAMBLE: &str = "\\usepackage{pgfplots} \\pgfplotsset{compat=1.16}";

/// Filled and hollow marker of every style.
const MARKS: [(&str, &str); MARKERS.len()] = [
    ("*", "o, mark options=solid"),
    ("square*", "square, mark options=solid"),
    ("triangle*", "triangle, mark options=solid"),
    ("diamond*", "diamond, mark options=solid"),
    ("triangle*, mark options={rotate=180}", "triangle, mark options={solid, rotate=180}"),
    ("pentagon*", "pentagon, mark options=solid"),
];

/// The intervals of points.
const ERRORS: &str = ", y error plus expr=\\thisrow{high}-\\thisrow{y}, y error minus expr=\\thisrow{y}-\\thisrow{low}";

/// The values as CSV, one per line. Comments at the head, starting with `#`, name the title and the axes. Rows of one series have the same
/// number `plot`. Numbers come first and text has no commas, so that `pgfplots` can read it.
pub fn csv(figure: &Figure) -> String {
    let Figure { title, x, y, series, .. } = figure;
    let columns = match y.names.is_empty() {
        true => "plot,x,y,low,high,series,how",
        false => "plot,x,y,bar,part,how",
    };
    let row = |plot: usize, s: &Series, p: &Point| {
        let between = match (y.names.is_empty(), s.kind) {
            (true, _) => format!("{},{}", p.low, p.high),
            (_, Kind::Bars) => plain(&y.names[p.y as usize]),
            // A line begins and ends beside the bars.
            _ => String::new(),
        };
        let (name, how) = (plain(&s.name), s.provenance.word());
        format!("{plot},{},{},{between},{name},{how}\n", p.x, p.y)
    };
    let series = series.iter().enumerate();
    let rows = series.flat_map(|(plot, s)| s.points.iter().map(move |p| row(plot, s, p)));
    format!("# {title}\n# x: {}; y: {}\n{columns}\n{}", x.label, y.label, rows.collect::<String>())
}

/// Greatest length of names of which a legend has two columns at the width of a text's column.
const NAME_MAX: usize = 22;

fn longest<'a>(names: impl IntoIterator<Item = &'a String>) -> usize {
    names.into_iter().map(|name| name.chars().count()).max().unwrap_or(0)
}

/// A name without what ends a field or means something to TeX.
fn plain(text: &str) -> String {
    text.replace(", ", "; ")
        .replace([',', '"', '%', '#', '\\', '{', '}', '$', '&', '~', '^', '\n', '\r'], " ")
}

/// The figure as a `tikzpicture`. `\figures` is the directory of its other files.
pub fn tex(figure: &Figure) -> String {
    let mut out = format!(
        "% Requires {PREAMBLE}\n\\providecommand{{\\figures}}{{figures}}\n\\begin{{tikzpicture}}\n"
    );
    for (i, [r, g, b]) in COLOURS.iter().enumerate() {
        out += &format!("\\definecolor{{style{i}}}{{RGB}}{{{r},{g},{b}}}\n");
    }
    let [x, y] = figure.scales();
    let kind = if figure.y.names.is_empty() { "" } else { "xbar stacked, bar width=8pt, " };
    let columns = if longest(figure.series.iter().map(|s| &s.name)) > NAME_MAX { 1 } else { 2 };
    // Of the width, pgfplots keeps 45 pt for labels of four digits.
    let beyond = (4.2 * longest(y.ticks.iter().map(|tick| &tick.1)) as f64 - 14.0).max(4.0);
    out += &format!(
        "\\begin{{axis}}[\n  width=\\linewidth-{beyond:.0}pt, height=0.65\\linewidth, {kind}grid=major, legend cell align=left,\n  \
         scaled ticks=false, tick label style={{font=\\footnotesize}}, label style={{font=\\footnotesize}},\n  \
         legend style={{at={{(1,1.03)}},anchor=south east,legend columns={columns},draw=none,font=\\footnotesize}},\n  {},\n  {}\n]\n",
        axis_options("x", &figure.x, &x),
        axis_options("y", &figure.y, &y)
    );
    let plot = |(plot, s): (usize, &Series)| {
        let (style, id, name) = (s.style % COLOURS.len(), &figure.id, escape(&s.name));
        let bars = s.provenance != Provenance::Modelled && s.points.iter().any(|p| p.low < p.high);
        let errors = if bars { ERRORS } else { "" };
        match (s.kind, &s.points[..]) {
            (Kind::Line, [Point { x, .. }, ..]) => format!(
                "\\draw[style{style}] ({{axis cs:{x},0}}|-{{rel axis cs:0,0}}) -- ({{axis cs:{x},0}}|-{{rel axis cs:0,1}});\n\
                 \\addlegendimage{{legend image code/.code={{\\draw[style{style}] (0pt,0pt) -- (15pt,0pt);}}}}\n\\addlegendentry{{{name}}}\n"
            ),
            _ => {
                let drawn = |options: &str, y: &str, errors: &str| {
                    format!(
                        "\\addplot[{options}] table[col sep=comma, comment chars={{\\#}}, \
                         restrict expr to domain={{\\thisrow{{plot}}}}{{{plot}:{plot}}}, x=x, y={y}{errors}] {{\\figures/{id}.csv}};\n"
                    )
                };
                let edge = format!("style{style}, densely dotted, no marks, forget plot");
                let values = match s.provenance {
                    Provenance::Modelled => ["low", "high"].map(|y| drawn(&edge, y, "")).concat(),
                    _ => String::new(),
                } + &drawn(&plot_options(s), "y", errors);
                format!("{values}\\addlegendentry{{{name}}}\n")
            }
        }
    };
    out.extend(figure.series.iter().enumerate().map(plot));
    out + "\\end{axis}\n\\end{tikzpicture}\n"
}

/// Colour, line and markers of a plot.
fn plot_options(s: &Series) -> String {
    let (style, (filled, hollow)) = (s.style % COLOURS.len(), MARKS[s.style % MARKS.len()]);
    let is_filled = s.provenance == Provenance::Measured;
    let (line, mark) = if is_filled { ("solid", filled) } else { ("dashed", hollow) };
    let line = if s.kind == Kind::Scattered { "only marks" } else { line };
    match (s.kind, s.provenance) {
        (Kind::Bars, _) => {
            let tint = if s.style % 2 == 1 { "!35" } else { "" };
            format!("fill=style{style}{tint}, draw=style{style}")
        }
        (_, Provenance::Bound) => "black, densely dotted, no marks".to_owned(),
        (_, Provenance::Modelled) => format!("style{style}, solid, no marks"),
        _ => format!(
            "style{style}, {line}, mark={mark}, error bars/.cd, y dir=both, y explicit, error bar style={{solid}}"
        ),
    }
}

/// Label, kind, ends and ticks of an axis. Names of bars are from top to bottom.
fn axis_options(name: &str, axis: &Axis, scale: &Scale) -> String {
    let ticks = scale.ticks.iter().map(|(tick, label)| (tick.to_string(), escape(label)));
    let (at, labels): (Vec<String>, Vec<String>) = ticks.unzip();
    let (start, end) = (scale.ends.start, scale.ends.end);
    format!(
        "{name}label={{{}}}, {name}mode={}, {name}min={}, {name}max={}, {}{name}tick={{{}}}, {name}ticklabels={{{}}}",
        escape(&axis.label),
        if axis.log { "log" } else { "linear" },
        start.min(end),
        start.max(end),
        if start > end { format!("{name} dir=reverse, ") } else { String::new() },
        at.join(","),
        labels.join(",")
    )
}

/// The figures with captions and labels, for `\input` in a document. LaTeX holds only 52 of them back unless it is asked for more.
pub fn fragment(figures: &[Figure]) -> String {
    let included = |Figure { id, caption, .. }: &Figure| {
        format!(
            "\n\\begin{{figure}}\n  \\centering\n  \\input{{\\figures/{id}.tex}}\n  \\caption{{{}}}\n  \\label{{fig:{id}}}\n\\end{{figure}}\n",
            escape(caption)
        )
    };
    format!(
        "% Made by `harness report`. Requires {PREAMBLE}.\n\
         % \\figures is the directory of the .tex files and of the .csv files that they read.\n\
         \\providecommand{{\\figures}}{{figures}}\n\\extrafloats{{{}}}\n{}",
        figures.len(),
        figures.iter().map(included).collect::<String>()
    )
}

/// A table with its title and remarks, for `\input` in a document. Columns of long fields are wider, and have fields
/// of several lines.
pub fn table(table: &Table) -> String {
    let row = |fields: Vec<String>| fields.join(" & ") + " \\\\\n";
    let head = row(table.columns.iter().map(|title| escape(&title.replace('\n', " "))).collect());
    // Long names of counters have no other place to break.
    let field = |f: &String| escape(f).replace("\\_", "\\_\\allowbreak{}");
    let rows = table.rows.iter().map(|fields| row(fields.iter().map(field).collect()));
    let length = |i: usize| (longest(table.rows.iter().map(|row| &row[i])) as f64).sqrt();
    let lengths: Vec<f64> = (0..table.columns.len()).map(length).collect();
    let share = |length: &f64| 0.94 * length / lengths.iter().sum::<f64>();
    format!(
        "\n\\subsection*{{{}}}\n{{\\scriptsize\\raggedright\\tabcolsep=0.007\\linewidth\n\\noindent\\begin{{tabular}}{{{}}}\n\\hline\n\
         {head}\\hline\n{}\\hline\n\\end{{tabular}}\\par\n{}}}\n",
        escape(&table.title),
        lengths.iter().map(|of| format!("p{{{:.3}\\linewidth}}", share(of))).collect::<String>(),
        rows.collect::<String>(),
        table.notes.iter().map(|note| escape(note) + "\\par\n").collect::<String>()
    )
}

/// The text with what is special to LaTeX escaped.
fn escape(text: &str) -> String {
    let escaped = |c: char| match SUPERSCRIPTS.iter().position(|s| *s == c) {
        Some(digit) => format!("$^{digit}$"),
        None => ESCAPES
            .split(' ')
            .find_map(|of| of.strip_prefix(c))
            .map_or_else(|| c.to_string(), str::to_owned),
    };
    text.chars().map(escaped).collect()
}

/// Characters that are special to LaTeX, each with what stands for it.
const ESCAPES: &str = r"\\textbackslash{} &\& %\% $\$ #\# _\_ {\{ }\} ~\textasciitilde{} ^\textasciicircum{} <\textless{} >\textgreater{} `' ·$\cdot$ λ$\lambda$ –-- µ$\mu$ ×$\times$ ⁻$^-$ √$\surd$ ₂$_2$ ⌈$\lceil$ ⌉$\rceil$ ⌊$\lfloor$ ⌋$\rfloor$";

#[cfg(test)]
mod tests {
    use super::super::samples::{bars, figure, series};
    use super::*;

    #[test]
    fn all_signs_of_formulas_are_known_to_latex() {
        let formulas = include_str!("../../../bench/src/experiments/model.rs");
        let signs: String = formulas.chars().filter(|c| !c.is_ascii()).collect();
        assert!(signs.contains('√') && escape(&signs).is_ascii(), "{}", escape(&signs));
    }

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
        // A factor beside the axis would change what our ticks say.
        assert!(text.contains("scaled ticks=false"));
        assert!(text.contains("xmode=log") && text.contains("xtick={1,2,4}, xticklabels={1,2,4}"));
        assert!(
            text.contains("{\\thisrow{plot}}{1:1}") && text.contains("{\\figures/speedup.csv}")
        );
        assert_eq!(text.matches('{').count(), text.matches('}').count(), "{text}");
        assert_eq!(text.matches("\\begin").count(), text.matches("\\end").count(), "{text}");
    }

    #[test]
    fn segments_of_bars_are_plots_and_the_fragment_has_captions_and_labels() {
        let figure = bars();
        let text = csv(&figure);
        assert!(text.contains("\n1,3,0,1,grade,projected\n"), "{text}");
        assert!(text.contains("\n2,3,1.5,,mean; 3,bound\n"), "{text}");
        let text = tex(&figure);
        assert!(text.contains("xbar stacked") && text.contains("y dir=reverse"), "{text}");
        assert!(text.contains("ytick={0,1}, yticklabels={1,2}"), "{text}");
        assert!(text.contains("({axis cs:3,0}|-{rel axis cs:0,0})"), "{text}");
        assert_eq!(text.matches('{').count(), text.matches('}').count(), "{text}");
        let text = fragment(&[figure]);
        assert!(text.contains("\\input{\\figures/speedup.tex}"), "{text}");
        assert!(text.contains("\\label{fig:speedup}"), "{text}");
        assert!(text.contains("Speedup \\& \\textless{}more\\textgreater{}"), "{text}");
    }

    #[test]
    fn special_characters_are_escaped() {
        assert_eq!(escape("5·10⁻⁷"), "5$\\cdot$10$^-$$^7$");
        assert_eq!(escape("50 % of A_1 & {B}"), "50 \\% of A\\_1 \\& \\{B\\}");
    }
}
