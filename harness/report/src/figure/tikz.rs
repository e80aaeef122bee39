//! A figure as PGF/TikZ, so that it is set in the fonts of the document. Requires `\usepackage{pgfplots}`, compat 1.16.

use super::palette::{COLOURS, SHADES, shade};
use super::scale::{Number, Scale};
use super::{Axis, Bars, Body, Figure, HeatMap, Layer, Mark, Provenance, Series, heat};
use std::fmt::Write;

/// Filled and hollow marker of every style.
const MARKERS: [(&str, &str); super::palette::MARKERS] = [
    ("*", "o"),
    ("square*", "square"),
    ("triangle*", "triangle"),
    ("diamond*", "diamond"),
    ("triangle*, mark options={rotate=180}", "triangle, mark options={rotate=180}"),
    ("pentagon*", "pentagon"),
];

/// The figure as a `tikzpicture`. That of a heat map includes the images that [`image`] names.
pub fn tikz(figure: &Figure) -> String {
    let mut out = String::from(
        "% Requires \\usepackage{pgfplots} \\pgfplotsset{compat=1.16}\n\\begin{tikzpicture}\n",
    );
    for (i, [r, g, b]) in COLOURS.iter().enumerate() {
        // Writing into a string cannot fail, here and below.
        let _ = writeln!(out, "\\definecolor{{style{i}}}{{RGB}}{{{r},{g},{b}}}");
    }
    let options = vec![
        "width=\\linewidth".to_owned(),
        "height=0.65\\linewidth".to_owned(),
        format!("xlabel={{{}}}", escape(&figure.x.label)),
        format!("ylabel={{{}}}", escape(&figure.y.label)),
        "grid=major".to_owned(),
        "legend style={at={(0.5,1.03)},anchor=south,legend columns=2,draw=none,font=\\footnotesize}".to_owned(),
        "legend cell align=left".to_owned(),
    ];
    match &figure.body {
        Body::Points { series, marks } => points(&mut out, options, figure, series, marks),
        Body::Bars(b) => bars(&mut out, options, b),
        Body::HeatMap(map) => heat_maps(&mut out, figure, map),
    }
    out.push_str("\\end{tikzpicture}\n");
    out
}

/// Name of the image of a layer, without directory.
pub fn image(figure: &Figure, layer: &Layer) -> String {
    format!("{}-{}.png", figure.id, layer.label.replace(' ', "-"))
}

fn begin(out: &mut String, options: &[String]) {
    let _ = writeln!(out, "\\begin{{axis}}[\n  {}\n]", options.join(",\n  "));
}

fn points(
    out: &mut String,
    mut options: Vec<String>,
    figure: &Figure,
    series: &[Series],
    marks: &[Mark],
) {
    let all = || series.iter().flat_map(|s| &s.points);
    options.extend(axis_options("x", &figure.x, all().map(|p| p.x)));
    options.extend(axis_options("y", &figure.y, all().flat_map(|p| [p.y, p.low, p.high])));
    begin(out, &options);
    series.iter().for_each(|s| plot(out, s));
    for mark in marks {
        let (style, x) = (mark.style % COLOURS.len(), mark.x);
        let _ = writeln!(
            out,
            "\\draw[style{style}] ({{axis cs:{x},0}}|-{{rel axis cs:0,0}}) -- ({{axis cs:{x},0}}|-{{rel axis cs:0,1}});"
        );
    }
    out.push_str("\\end{axis}\n");
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
    if axis.log || !axis.ticks.is_empty() {
        // The default ticks of a short logarithmic axis are fractional powers of ten.
        let ticks = match axis.ticks.is_empty() {
            true => Scale::of(axis, values).ticks,
            false => axis.ticks.clone(),
        };
        let labels: Vec<String> = ticks.iter().map(|t| number(*t)).collect();
        let ticks: Vec<String> = ticks.iter().map(f64::to_string).collect();
        options.push(format!("{name}tick={{{}}}", ticks.join(",")));
        options.push(format!("{name}ticklabels={{{}}}", labels.join(",")));
    }
    options
}

fn number(value: f64) -> String {
    match Number::of(value) {
        Number::Decimal(text) => text,
        Number::Scientific(mantissa, exponent) if mantissa.is_empty() => {
            format!("$10^{{{exponent}}}$")
        }
        Number::Scientific(mantissa, exponent) => format!("${mantissa}\\cdot10^{{{exponent}}}$"),
    }
}

fn plot(out: &mut String, s: &Series) {
    let (filled, hollow) = MARKERS[s.style % MARKERS.len()];
    let colour = s.style % COLOURS.len();
    let options = match s.provenance {
        Provenance::Bound => "black, densely dotted, no markers".to_owned(),
        provenance => {
            let (solid, joined) = (provenance.is_solid(), s.joined);
            format!(
                "style{colour}, {}, mark={}, every mark/.append style={{solid}}, error bars/.cd, y dir=both, y explicit",
                if joined { if solid { "solid" } else { "dashed" } } else { "only marks" },
                if solid { filled } else { hollow },
            )
        }
    };
    let _ = writeln!(out, "\\addplot[{options}] coordinates {{");
    for p in &s.points {
        let _ = match s.provenance {
            Provenance::Bound => writeln!(out, "  ({},{})", p.x, p.y),
            _ => {
                writeln!(out, "  ({},{}) += (0,{}) -= (0,{})", p.x, p.y, p.high - p.y, p.y - p.low)
            }
        };
    }
    let _ = writeln!(out, "}};\n\\addlegendentry{{{}}}", escape(&s.name));
}

fn bars(out: &mut String, mut options: Vec<String>, b: &Bars) {
    let positions: Vec<String> = (0..b.categories.len()).map(|i| i.to_string()).collect();
    let names: Vec<String> = b.categories.iter().map(|c| format!("{{{}}}", escape(c))).collect();
    options.extend([
        "ybar stacked".to_owned(),
        format!("bar width={}", if b.categories.len() > 20 { "2pt" } else { "8pt" }),
        "ymin=0".to_owned(),
        format!("xtick={{{}}}", positions.join(",")),
        format!("xticklabels={{{}}}", names.join(",")),
        "x tick label style={rotate=45,anchor=east,font=\\footnotesize}".to_owned(),
    ]);
    begin(out, &options);
    for (i, (name, values)) in b.segments.iter().enumerate() {
        let style = i % COLOURS.len();
        let lighter = if i % 2 == 1 { "!35" } else { "" };
        let points: Vec<String> =
            values.iter().enumerate().map(|(i, v)| format!("({i},{v})")).collect();
        let _ = writeln!(
            out,
            "\\addplot+[fill=style{style}{lighter}, draw=style{style}] coordinates {{{}}};\n\\addlegendentry{{{}}}",
            points.join(" "),
            escape(name)
        );
    }
    for (i, (name, level)) in b.references.iter().enumerate() {
        let last = b.categories.len() as f64 - 0.5;
        let dashes = ["densely dotted", "dashed", "solid"][i % 3];
        let _ = writeln!(
            out,
            "\\draw[{dashes}] (axis cs:-0.5,{level}) -- (axis cs:{last},{level});\n\\addlegendimage{{{dashes}, legend image code/.code={{\\draw (0,0) \
             -- (0.6cm,0);}}}}\n\\addlegendentry{{{}}}",
            escape(name)
        );
    }
    out.push_str("\\end{axis}\n");
}

/// An axis per layer around its image, each with its colour scale below it.
fn heat_maps(out: &mut String, figure: &Figure, map: &HeatMap) {
    out.push_str("\\providecommand{\\figures}{figures}\n");
    for i in 0..SHADES {
        let [r, g, b] = shade(i);
        let _ = writeln!(out, "\\definecolor{{shade{i}}}{{RGB}}{{{r},{g},{b}}}");
    }
    let shades = (0..SHADES).map(|s| format!("color=(shade{s})")).collect::<Vec<_>>();
    let _ = writeln!(out, "\\pgfplotsset{{colormap={{shades}}{{{}}}}}", shades.join(" "));
    for (i, layer) in map.layers.iter().enumerate() {
        heat_map(out, figure, map.order, layer, i as f64 / map.layers.len() as f64);
    }
}

fn heat_map(out: &mut String, figure: &Figure, order: usize, layer: &Layer, left: f64) {
    let ticks = heat::ticks(order).iter().map(usize::to_string).collect::<Vec<_>>().join(",");
    let (low, high) = heat::range(layer);
    let (low, high) = (low.log10().round() as i32, high.log10().round() as i32);
    let every = ((high - low) as usize).div_ceil(4).max(1);
    let powers: Vec<String> = (low..=high).step_by(every).map(|p| p.to_string()).collect();
    let labels: Vec<String> = powers.iter().map(|p| format!("$10^{{{p}}}$")).collect();
    let (first, last) = (-0.5, order as f64 - 0.5);
    let options = [
        format!("at={{({left}\\linewidth,0)}}"),
        "width=0.36\\linewidth, height=0.36\\linewidth, scale only axis".to_owned(),
        format!("xmin={first}, xmax={last}, ymin={first}, ymax={last}, y dir=reverse"),
        format!("xtick={{{ticks}}}, ytick={{{ticks}}}, tick align=outside"),
        format!("xlabel={{{}}}, ylabel={{{}}}", escape(&figure.x.label), escape(&figure.y.label)),
        "axis on top, colorbar horizontal, colormap name=shades".to_owned(),
        format!("point meta min={low}, point meta max={high}"),
        format!(
            "colorbar style={{xlabel={{{}}}, xtick={{{}}}, xticklabels={{{}}}, at={{(0,-0.32)}}, anchor=north west}}",
            escape(&layer.label),
            powers.join(","),
            labels.join(",")
        ),
    ];
    begin(out, &options);
    // A colour scale is drawn only if a plot has values.
    out.push_str("\\addplot[draw=none, point meta=0] coordinates {(0,0)};\n");
    // `\addplot graphics` would turn the image upside down with the axis; a node does not.
    let _ = writeln!(
        out,
        "\\node[inner sep=0, anchor=north west] at (axis cs:{first},{first}) {{\\includegraphics[width=0.36\\linewidth, \
         height=0.36\\linewidth]{{\\figures/{}}}}};\n\\end{{axis}}",
        image(figure, layer)
    );
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
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::samples::{figure, heat_map, series};
    use super::*;

    /// Asserts that braces and environments are closed.
    fn assert_closed(text: &str) {
        assert_eq!(text.matches('{').count(), text.matches('}').count(), "{text}");
        assert_eq!(text.matches("\\begin").count(), text.matches("\\end").count(), "{text}");
    }

    #[test]
    fn measured_points_are_filled_and_oversubscribed_ones_hollow() {
        let both = vec![series(Provenance::Measured), series(Provenance::Oversubscribed)];
        let text = tikz(&figure(Body::points(both)));
        assert!(text.contains("mark=*") && text.contains("mark=o"));
        assert!(text.contains("xmode=log") && text.contains("xtick={1,2,4}"));
        assert_closed(&text);
    }

    #[test]
    fn heat_maps_are_images_beside_axes() {
        let text = tikz(&heat_map());
        assert!(text.contains("{\\figures/messages-bytes.png}"), "{text}");
        assert!(text.contains("xticklabels={$10^{1}$,$10^{3}$,$10^{5}$}"), "{text}");
        assert!(text.lines().count() < 70);
        assert_closed(&text);
    }

    #[test]
    fn numbers_of_axes_are_short() {
        let all = [0.3, 200.0, 0.01, 1e-4, 5e6, 1e9, 2.5e-4].map(number);
        let expected = [
            "0.3",
            "200",
            "0.01",
            "$10^{-4}$",
            "$5\\cdot10^{6}$",
            "$10^{9}$",
            "$2.5\\cdot10^{-4}$",
        ];
        assert_eq!(all, expected);
    }

    #[test]
    fn special_characters_are_escaped() {
        assert_eq!(escape("50 % of A_1 & {B}"), "50 \\% of A\\_1 \\& \\{B\\}");
    }
}
