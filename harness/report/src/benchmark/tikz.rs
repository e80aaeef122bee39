//! A figure as PGF/TikZ, so that it takes the paper's fonts. Wants `\usepackage{pgfplots}`, compat 1.16.

use super::figure::{Axis, Bars, Body, Figure, Heat, How, Layer, Series};
use super::heat;
use super::scale::Scale;
use std::fmt::Write;

const COLOURS: [&str; 7] =
    ["0,114,178", "213,94,0", "0,158,115", "204,121,167", "86,180,233", "230,159,0", "90,90,90"];
const MARKS: [(&str, &str); 6] = [
    ("*", "o"),
    ("square*", "square"),
    ("triangle*", "triangle"),
    ("diamond*", "diamond"),
    ("triangle*, mark options={rotate=180}", "triangle, mark options={rotate=180}"),
    ("pentagon*", "pentagon"),
];

/// The figure as a `tikzpicture`.
pub fn tikz(figure: &Figure) -> String {
    let mut out = String::from(
        "% Drawn with \\usepackage{pgfplots} \\pgfplotsset{compat=1.16}\n\\begin{tikzpicture}\n",
    );
    for (i, rgb) in COLOURS.iter().enumerate() {
        let _ = writeln!(out, "\\definecolor{{look{i}}}{{RGB}}{{{rgb}}}");
    }
    let mut options = vec![
        "width=\\linewidth".to_owned(),
        "height=0.65\\linewidth".to_owned(),
        format!("xlabel={{{}}}", escape(&figure.x.label)),
        format!("ylabel={{{}}}", escape(&figure.y.label)),
        "grid=major".to_owned(),
        "legend style={at={(0.5,1.03)},anchor=south,legend columns=2,draw=none,font=\\footnotesize}".to_owned(),
        "legend cell align=left".to_owned(),
    ];
    match &figure.body {
        Body::Points(series) => {
            let all = || series.iter().flat_map(|s| &s.points);
            options.extend(axis_options("x", &figure.x, all().map(|p| p.x)));
            options.extend(axis_options("y", &figure.y, all().flat_map(|p| [p.y, p.low, p.high])));
            open(&mut out, &options);
            series.iter().for_each(|s| plot(&mut out, s));
        }
        Body::Bars(b) => bars(&mut out, options, b),
        Body::Heat(h) => return out + &heat_maps(figure, h) + "\\end{tikzpicture}\n",
    }
    out.push_str("\\end{axis}\n\\end{tikzpicture}\n");
    out
}

fn open(out: &mut String, options: &[String]) {
    let _ = writeln!(out, "\\begin{{axis}}[\n  {}\n]", options.join(",\n  "));
}

fn axis_options(name: &str, axis: &Axis, values: impl Iterator<Item = f64>) -> Vec<String> {
    let mut options = Vec::new();
    if axis.log {
        options.push(format!("{name}mode=log"));
    } else if axis.range.is_none() {
        options.push(format!("{name}min=0"));
    }
    if let Some((low, high)) = axis.range {
        options.extend([format!("{name}min={low}"), format!("{name}max={high}")]);
    }
    if !axis.ticks.is_empty() {
        let ticks: Vec<String> = axis.ticks.iter().map(f64::to_string).collect();
        options.push(format!("{name}tick={{{}}}", ticks.join(",")));
        options.push(format!("{name}ticklabels={{{}}}", ticks.join(",")));
    } else if axis.log {
        // Left to itself, a short axis has powers of ten between the whole ones.
        let ticks = Scale::of(axis, &values.collect::<Vec<_>>()).ticks;
        let labels: Vec<String> = ticks.iter().map(|t| number(*t)).collect();
        let ticks: Vec<String> = ticks.iter().map(f64::to_string).collect();
        options.push(format!("{name}tick={{{}}}", ticks.join(",")));
        options.push(format!("{name}ticklabels={{{}}}", labels.join(",")));
    }
    options
}

/// A number for an axis: plain where that is short, else with a power of ten.
fn number(v: f64) -> String {
    let power = v.log10().floor();
    let digits = (v / 10f64.powf(power) * 10.0).round() / 10.0;
    match (power, digits) {
        (-2.0..=3.0, _) => ((v * 1e4).round() / 1e4).to_string(),
        (_, 1.0) => format!("$10^{{{power}}}$"),
        _ => format!("${digits}\\cdot10^{{{power}}}$"),
    }
}

fn plot(out: &mut String, s: &Series) {
    let (solid, hollow) = MARKS[s.look % MARKS.len()];
    let colour = s.look % COLOURS.len();
    let style = match (s.how, s.joined) {
        (How::Bound, _) => "black, densely dotted, no markers".to_owned(),
        (how, joined) => format!(
            "look{colour}, {}, mark={}{}",
            if joined { if how.is_solid() { "solid" } else { "dashed" } } else { "only marks" },
            if how.is_solid() { solid } else { hollow },
            ", every mark/.append style={solid}, error bars/.cd, y dir=both, y explicit"
        ),
    };
    let _ = writeln!(out, "\\addplot[{style}] coordinates {{");
    for p in &s.points {
        let _ = match s.how {
            How::Bound => writeln!(out, "  ({},{})", p.x, p.y),
            _ => {
                writeln!(out, "  ({},{}) += (0,{}) -= (0,{})", p.x, p.y, p.high - p.y, p.y - p.low)
            }
        };
    }
    let _ = writeln!(out, "}};\n\\addlegendentry{{{}}}", escape(&s.name));
}

fn bars(out: &mut String, mut options: Vec<String>, b: &Bars) {
    let places: Vec<String> = (0..b.categories.len()).map(|i| i.to_string()).collect();
    let names: Vec<String> = b.categories.iter().map(|c| format!("{{{}}}", escape(c))).collect();
    let wide = if b.categories.len() > 20 { "2pt" } else { "8pt" };
    options.extend([
        "ybar stacked".to_owned(),
        format!("bar width={wide}"),
        "ymin=0".to_owned(),
        format!("xtick={{{}}}", places.join(",")),
        format!("xticklabels={{{}}}", names.join(",")),
        "x tick label style={rotate=45,anchor=east,font=\\footnotesize}".to_owned(),
    ]);
    open(out, &options);
    for (look, (name, values)) in b.parts.iter().enumerate() {
        let fill = if look % 2 == 1 {
            format!("look{}!35", look % COLOURS.len())
        } else {
            format!("look{}", look % COLOURS.len())
        };
        let points: Vec<String> =
            values.iter().enumerate().map(|(i, v)| format!("({i},{v})")).collect();
        let _ = writeln!(
            out,
            "\\addplot+[fill={fill}, draw=look{}] coordinates {{{}}};",
            look % COLOURS.len(),
            points.join(" ")
        );
        let _ = writeln!(out, "\\addlegendentry{{{}}}", escape(name));
    }
    for (i, (name, level)) in b.lines.iter().enumerate() {
        let last = b.categories.len() as f64 - 0.5;
        let dash = ["densely dotted", "dashed", "solid"][i % 3];
        let _ = writeln!(
            out,
            "\\draw[{dash}] (axis cs:-0.5,{level}) -- (axis cs:{last},{level});\n\\addlegendimage{{{dash}, legend image code/.code={{\\draw (0,0) \
             -- (0.6cm,0);}}}}\n\\addlegendentry{{{}}}",
            escape(name)
        );
    }
}

/// An axis for every layer, each with its own scale below it.
fn heat_maps(figure: &Figure, h: &Heat) -> String {
    let mut out = String::new();
    for step in 0..heat::STEPS {
        let [r, g, b] = heat::shade(step);
        let _ = writeln!(out, "\\definecolor{{shade{step}}}{{RGB}}{{{r},{g},{b}}}");
    }
    let shades = (0..heat::STEPS).map(|s| format!("color=(shade{s})")).collect::<Vec<_>>();
    let _ = writeln!(out, "\\pgfplotsset{{colormap={{shades}}{{{}}}}}", shades.join(" "));
    for (i, layer) in h.layers.iter().enumerate() {
        heat_map(&mut out, figure, h.side, layer, i as f64 / h.layers.len() as f64);
    }
    out
}

fn heat_map(out: &mut String, figure: &Figure, side: usize, layer: &Layer, at: f64) {
    let ticks = heat::ticks(side).iter().map(usize::to_string).collect::<Vec<_>>().join(",");
    let (low, high) = heat::ends(layer);
    let (low, high) = (low.log10().round() as i32, high.log10().round() as i32);
    let every = ((high - low) as usize).div_ceil(4).max(1);
    let powers: Vec<String> = (low..=high).step_by(every).map(|p| p.to_string()).collect();
    let raised: Vec<String> = powers.iter().map(|p| format!("$10^{{{p}}}$")).collect();
    let last = side as f64 - 0.5;
    let options = [
        format!("at={{({at}\\linewidth,0)}}"),
        "width=0.36\\linewidth, height=0.36\\linewidth, scale only axis".to_owned(),
        format!("xmin=-0.5, xmax={last}, ymin=-0.5, ymax={last}, y dir=reverse"),
        format!("xtick={{{ticks}}}, ytick={{{ticks}}}, tick align=outside"),
        format!("xlabel={{{}}}, ylabel={{{}}}", escape(&figure.x.label), escape(&figure.y.label)),
        "colorbar horizontal, colormap name=shades".to_owned(),
        format!("point meta min={low}, point meta max={high}"),
        format!(
            "colorbar style={{xlabel={{{}}}, xtick={{{}}}, xticklabels={{{}}}, at={{(0,-0.32)}}, anchor=north west}}",
            escape(&layer.label),
            powers.join(","),
            raised.join(",")
        ),
    ];
    open(out, &options);
    // Something has to be plotted for a scale to be drawn.
    out.push_str("\\addplot[draw=none, point meta=0] coordinates {(0,0)};\n");
    for s in heat::spans(layer) {
        let (x0, x1) = (s.first as f64 - 0.5, s.end as f64 - 0.5);
        let (y0, y1) = (s.row as f64 - 0.5, s.row as f64 + 0.5);
        let _ = writeln!(
            out,
            "\\fill[shade{}] (axis cs:{x0},{y0}) rectangle (axis cs:{x1},{y1});",
            s.step
        );
    }
    out.push_str("\\end{axis}\n");
}

/// Words as LaTeX wants them.
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
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::paint::tests::{figure, series};
    use super::*;

    #[test]
    fn hollow_stays_hollow_and_braces_match() {
        let text =
            tikz(&figure(Body::Points(vec![series(How::Measured), series(How::Oversubscribed)])));
        assert!(text.contains("mark=*") && text.contains("mark=o"));
        assert!(text.contains("xmode=log") && text.contains("xtick={1,2,4}"));
        let count = |c| text.chars().filter(|x| *x == c).count();
        assert_eq!(count('{'), count('}'));
        assert_eq!(text.matches("\\begin").count(), text.matches("\\end").count());
    }

    #[test]
    fn maps_are_rectangles_with_a_scale() {
        let text = tikz(&heat::tests::figure());
        assert_eq!(text.matches("\\fill[").count(), 2, "{text}");
        assert!(text.contains("\\fill[shade0] (axis cs:0.5,-0.5) rectangle (axis cs:2.5,0.5);"));
        assert!(text.contains("xticklabels={$10^{1}$,$10^{3}$,$10^{5}$}"), "{text}");
        let count = |c| text.chars().filter(|x| *x == c).count();
        assert_eq!(count('{'), count('}'));
        assert_eq!(text.matches("\\begin").count(), text.matches("\\end").count());
    }

    #[test]
    fn numbers_of_an_axis() {
        let all = [0.3, 200.0, 0.01, 1e-3, 5e6, 1e9, 2.5e-4].map(number);
        let want = [
            "0.3",
            "200",
            "0.01",
            "$10^{-3}$",
            "$5\\cdot10^{6}$",
            "$10^{9}$",
            "$2.5\\cdot10^{-4}$",
        ];
        assert_eq!(all, want);
    }

    #[test]
    fn words_are_made_safe() {
        assert_eq!(escape("50 % of A_1 & {B}"), "50 \\% of A\\_1 \\& \\{B\\}");
    }
}
