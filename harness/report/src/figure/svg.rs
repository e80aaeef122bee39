//! A figure as SVG, by `plotters`: a chart with its mesh and its series.
//!
//! The legend is ours, above the data in as many rows as it needs, because that of `plotters` is within the chart, where it hides data.
//! Logarithmic axes are linear in the logarithm and are given their key points, because those of `plotters` drop the lowest tick.

use super::axes::{BELOW, Scale};
use super::canvas::{COLOURS, EDGE, FONT, INK, RIGHT, SIZE, SYMBOL, WIDTH, legend};
use super::map::{CAPTION, outline, paint, size};
use super::{Figure, Kind, Provenance, Series};
use bench::order::by_key;
use maud::html;
use plotters::coord::Shift;
use plotters::element::{DashedPathElement, DynElement, IntoDynElement};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Corners of the markers around their centre. The first one is a circle.
pub const MARKERS: [&[(i32, i32)]; 6] = [
    &[],
    &[(-11, -11), (11, -11), (11, 11), (-11, 11)],
    &[(0, -15), (14, 11), (-14, 11)],
    &[(0, -16), (16, 0), (0, 16), (-16, 0)],
    &[(0, 15), (14, -11), (-14, -11)],
    &[(-14, -5), (0, -15), (14, -5), (9, 12), (-9, 12)],
];

/// Length of a line in the legend.
const LENGTH: i32 = SYMBOL as i32 - 18;
/// Length of a tick. Labels at the corner do not touch.
const TICK: i32 = 16;
/// Width of lines of data.
const WIDE: u32 = 4;
/// Colour of grid lines.
const FAINT: RGBColor = RGBColor(170, 170, 170);
/// Part of a bar's width that is between it and the next.
const GAP: f64 = 0.2;
/// Why drawing cannot fail.
const DRAWN: &str = "a string accepts every element";

type Page<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Place = (f64, f64);

/// What is beside a name in the legend.
enum Symbol<'a> {
    Series(&'a Series),
    Cell([u8; 3]),
    Section,
    Nothing,
}

/// The figure as an SVG document.
pub fn svg(figure: &Figure) -> String {
    let legend_entries = entries(figure);
    let names: Vec<&str> = legend_entries.iter().map(|(name, _)| *name).collect();
    let [x, y] = figure.scales();
    let (places, top) = legend(y.left(), &names);
    let (height, right) = match figure.map {
        Some(_) => size(&x, &y, top),
        None => (if figure.is_flat { 560 } else { 1040 }, RIGHT),
    };
    let mut drawn = String::new();
    let page = SVGBackend::with_string(&mut drawn, (WIDTH as u32, height)).into_drawing_area();
    for ((name, of), at) in legend_entries.iter().zip(places) {
        symbol(&page, at, of);
        let beside = if matches!(of, Symbol::Nothing) { 0 } else { SYMBOL as i32 };
        page.draw(&text(name, (at.0 + beside, at.1))).expect(DRAWN);
    }
    if let Some(map) = &figure.map {
        page.draw(&text(&map.caption, (y.left() as i32, height as i32 - CAPTION as i32 / 2)))
            .expect(DRAWN);
    }
    let above = chart(figure, (&page, top, right), [x, y]);
    drop(page);
    // The title describes the drawing to those who do not see it.
    let title = html! { (figure.title) }.into_string();
    let described = format!("<svg role=\"img\" aria-label=\"{title}\" stroke-linejoin=\"round\"");
    let drawn = drawn.replacen("<svg", &described, 1).replace(" opacity=\"1\"", "");
    // A text is on the line of its element.
    let drawn = drawn.replace("\">\n", "\">").replace("\n</text>", "</text>");
    let drawn = drawn.replace("\"#000000\"", &format!("\"{INK}\""));
    let elements = drawn.trim_end().strip_suffix("</svg>").expect("it ends the document");
    format!("{elements}{}\n</svg>\n", above.join("\n"))
}

/// Names and symbols of the legend. Series of one name have one entry.
fn entries(figure: &Figure) -> Vec<(&str, Symbol<'_>)> {
    let Figure { series, map, .. } = figure;
    let mut all = Vec::new();
    if let Some(map) = map {
        all.push((map.title.as_str(), Symbol::Nothing));
        all.extend(map.key.iter().map(|(name, fill)| (name.as_str(), Symbol::Cell(*fill))));
        all.extend(map.section.iter().map(|_| ("geometry", Symbol::Section)));
    }
    let named = by_key(series, |s| s.name.as_str()).into_iter();
    all.extend(named.map(|(name, of)| (name, Symbol::Series(of[0]))));
    all
}

/// Draws a symbol of the legend at its left end.
fn symbol(page: &Page, (x, y): (i32, i32), symbol: &Symbol) {
    let (right, middle) = (x + LENGTH, x + LENGTH / 2);
    let corners = [(x, y - 16), (right, y + 16)];
    let line_of = |ends: [_; 2], style: ShapeStyle| {
        page.draw(&PathElement::new(ends.to_vec(), style)).expect(DRAWN);
    };
    match symbol {
        Symbol::Series(s) if s.kind == Kind::Bars => {
            bar(corners, s.style).iter().for_each(|part| page.draw(part).expect(DRAWN));
        }
        Symbol::Series(s) if s.kind == Kind::Line => {
            line_of([(middle, y - 18), (middle, y + 18)], line(s.style));
        }
        Symbol::Series(s) => {
            page.draw(&path(vec![(x, y), (right, y)], s)).expect(DRAWN);
            marker(page, (middle, y), s);
        }
        Symbol::Cell(fill) => {
            page.draw(&Rectangle::new(corners, rgb(*fill).filled())).expect(DRAWN);
            page.draw(&Rectangle::new(corners, rgb(outline(*fill)))).expect(DRAWN);
        }
        Symbol::Section => line_of([(x, y), (right, y)], BLACK.stroke_width(3)),
        Symbol::Nothing => {}
    }
}

/// Draws the chart of a figure below the legend, and returns the elements over it: cells of a map, and notes that are shown while the
/// pointer is near a point. The axes of `plotters` are linear in the places of values.
fn chart(
    figure: &Figure,
    (page, top, right): (&Page, f64, f64),
    [mut x, y]: [Scale; 2],
) -> Vec<String> {
    // The axis is not partial, but what plotters makes of one with key points has no labels.
    let axis = |scale: &Scale| {
        let ticks = scale.ticks.iter().map(|(tick, _)| scale.place(*tick));
        scale.places().with_key_points(ticks.collect()).partial_axis(scale.places())
    };
    let mut chart = ChartBuilder::on(page)
        .margin_top(top)
        .margin_right(right)
        .margin_left(EDGE)
        .margin_bottom(if figure.map.is_some() { CAPTION } else { 0.0 })
        .x_label_area_size(BELOW)
        .y_label_area_size(y.left() - EDGE)
        .build_cartesian_2d(axis(&x), axis(&y))
        .expect("the chart is smaller than the page");
    let (across, up) = (x.places(), y.places());
    x.clear_labels(|place| f64::from(chart.backend_coord(&(place, up.start)).0));
    let (label_x, label_y) = (|place: &f64| x.label(*place), |place: &f64| y.label(*place));
    let mut mesh = chart.configure_mesh();
    mesh.light_line_style(TRANSPARENT).bold_line_style(FAINT).axis_style(BLACK.stroke_width(2));
    mesh.label_style(font()).axis_desc_style(font()).set_all_tick_mark_size(TICK);
    mesh.x_label_formatter(&label_x).y_label_formatter(&label_y);
    if figure.map.is_some() {
        mesh.disable_mesh();
    }
    mesh.x_desc(&figure.x.label).y_desc(&figure.y.label).draw().expect(DRAWN);
    let (least, most) = (up.start.min(up.end), up.start.max(up.end));
    let at = |x_of: f64, y_of: f64| (x.place(x_of), y.place(y_of).clamp(least, most));
    let mut above = Vec::new();
    if let Some(map) = &figure.map {
        above = paint(map, [&across, &up], chart.plotting_area().get_pixel_range());
    }
    let mut begins = vec![0.0; figure.y.names.len()];
    for s in &figure.series {
        let points: Vec<Place> = s.points.iter().map(|p| at(p.x, p.y)).collect();
        if s.kind == Kind::Bars {
            chart.draw_series(segments(&points, &mut begins, s.style)).expect(DRAWN);
            continue;
        }
        chart.draw_series([path(points.clone(), s)]).expect(DRAWN);
        if s.provenance == Provenance::Modelled {
            let low = s.points.iter().map(|p| at(p.x, p.low));
            let around = low.chain(s.points.iter().rev().map(|p| at(p.x, p.high))).collect();
            let band = Polygon::<Place>::new::<Vec<Place>, _>(around, colour(s.style).mix(0.2));
            chart.draw_series([band]).expect(DRAWN);
            continue;
        }
        for p in s.points.iter().filter(|p| p.low < p.high) {
            let ends = [p.low, p.high].map(|value| at(p.x, value));
            chart.draw_series([PathElement::new(ends.to_vec(), line(s.style))]).expect(DRAWN);
            let cap = |end| {
                EmptyElement::at(end) + PathElement::new(vec![(-10, 0), (10, 0)], line(s.style))
            };
            chart.draw_series(ends.map(cap)).expect(DRAWN);
        }
        let places: Vec<_> = points.iter().map(|point| chart.backend_coord(point)).collect();
        places.iter().for_each(|at| marker(page, *at, s));
        for (note, (x, y)) in s.notes.iter().zip(places) {
            let area = html! { circle cx=(x) cy=(y) r="16" fill-opacity="0" { title { (note) } } };
            above.push(area.into_string());
        }
    }
    above
}

fn rgb([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

fn colour(style: usize) -> RGBColor {
    rgb(COLOURS[style % COLOURS.len()])
}

fn line(style: usize) -> ShapeStyle {
    colour(style).stroke_width(WIDE)
}

/// The font of all text.
fn font() -> TextStyle<'static> {
    // plotters divides the size by this factor in SVG.
    (FONT, SIZE * 1.24).into_font().color(&BLACK)
}

/// A text whose left end is at a point.
fn text(text: &str, at: (i32, i32)) -> Text<'static, (i32, i32), String> {
    Text::new(text.to_owned(), at, font().pos(Pos::new(HPos::Left, VPos::Center)))
}

/// The line of a series through points.
fn path<'a, C: Clone + 'static>(at: Vec<C>, s: &Series) -> DynElement<'static, SVGBackend<'a>, C> {
    let (style, dashes) = match (s.kind, s.provenance) {
        (Kind::Line, _) | (_, Provenance::Measured | Provenance::Modelled) => (line(s.style), None),
        (_, Provenance::Bound) => (BLACK.stroke_width(3), Some((14, 10))),
        _ => (line(s.style), Some((22, 15))),
    };
    match dashes {
        _ if s.kind == Kind::Scattered => PathElement::new(Vec::new(), style).into_dyn(),
        None => PathElement::new(at, style).into_dyn(),
        Some((dash, gap)) => DashedPathElement::new(at, dash, gap, style).into_dyn(),
    }
}

/// Draws the marker of a series, filled or hollow; bounds and models have none.
fn marker(page: &Page, at: (i32, i32), s: &Series) {
    let (ink, is_filled) = (colour(s.style), s.provenance == Provenance::Measured);
    let corners = MARKERS[s.style % MARKERS.len()].iter().map(|c| (at.0 + c.0, at.1 + c.1));
    let mut corners: Vec<(i32, i32)> = corners.collect();
    if matches!(s.provenance, Provenance::Bound | Provenance::Modelled) {
        return;
    }
    if corners.is_empty() {
        let shape = if is_filled { ink.filled() } else { line(s.style) };
        return page.draw(&Circle::new(at, if is_filled { 14 } else { 12 }, shape)).expect(DRAWN);
    }
    if is_filled {
        page.draw(&Polygon::new(corners.clone(), ink.filled())).expect(DRAWN);
    }
    // Twice the first edge, so that the corner where the line ends is like the others.
    corners.extend_from_within(..2);
    page.draw(&PathElement::new(corners, line(s.style))).expect(DRAWN);
}

/// A bar, filled with its colour or with a tint of it: bars with odd styles are lighter, so that neighbours differ in grey too.
fn bar<C: Clone>(corners: [C; 2], style: usize) -> [Rectangle<C>; 2] {
    let fill = colour(style).mix(if style % 2 == 1 { 0.35 } else { 1.0 }).filled();
    let outline = colour(style).stroke_width(2);
    [Rectangle::new(corners.clone(), fill), Rectangle::new(corners, outline)]
}

/// The segments of bars that begin where the ones before them end.
fn segments(lengths: &[Place], begins: &mut [f64], style: usize) -> Vec<Rectangle<Place>> {
    let (half, mut drawn) = ((1.0 - GAP) / 2.0, Vec::new());
    for ((length, middle), begin) in lengths.iter().zip(begins).filter(|(of, _)| of.0 > 0.0) {
        drawn.extend(bar([(*begin, middle - half), (*begin + length, middle + half)], style));
        *begin += length;
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::super::samples::{bars, figure, series};
    use super::*;

    #[test]
    fn measured_points_are_filled_and_projected_ones_hollow() {
        let circles = |provenance, kind: &str| {
            let svg = svg(&figure(vec![series(provenance)]));
            svg.lines().filter(|l| l.starts_with("<circle") && l.contains(kind)).count()
        };
        // Three points and the legend.
        let counts =
            |provenance| (circles(provenance, "fill=\"#"), circles(provenance, "fill=\"none\""));
        assert_eq!(counts(Provenance::Measured), (4, 0));
        assert_eq!(counts(Provenance::Projected), (0, 4));
        assert_eq!(counts(Provenance::Bound), (0, 0));
    }

    #[test]
    fn text_is_escaped_and_points_have_their_notes() {
        let mut noted = series(Provenance::Measured);
        noted.name = "a < b".into();
        noted.notes = vec!["first & <best>".into()];
        let svg = svg(&figure(vec![noted]));
        assert!(
            svg.contains("a &lt; b") && svg.contains("<title>first &amp; &lt;best&gt;</title>")
        );
        assert!(
            svg.contains("viewBox=\"0 0 1600 1040\"") && svg.contains("aria-label=\"Speedup\"")
        );
    }

    #[test]
    fn lines_of_one_name_share_an_entry_of_the_legend() {
        let mark = |x| Series::vertical("increase", 1, x, (1.0, 4.0));
        let svg = svg(&figure(vec![series(Provenance::Measured), mark(1.5), mark(3.0)]));
        assert_eq!(svg.matches("increase").count(), 1);
        assert_eq!(svg.matches("stroke=\"#D55E00\"").count(), 3);
    }

    #[test]
    fn segments_are_stacked_and_empty_ones_are_not_drawn() {
        let svg = svg(&bars());
        assert!(svg.contains(">grade<") && svg.contains(">mean, 3<"));
        // Three segments and two entries of the legend, each with its outline.
        assert_eq!(svg.matches("<rect").count(), 10, "{svg}");
    }
}
