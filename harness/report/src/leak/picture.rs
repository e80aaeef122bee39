//! A slice through the narrowest place of a leak as SVG: the plane that contains the direction of the path and a point
//! of the rim. It shows the leaves, the section of the facets, the largest ball that passes and the path.

use crate::figure::canvas::{Canvas, LINE, WIDTH, document};
use crate::figure::palette::colour;
use crate::section::{Planar, Window};
use contract::case::Case;
use contract::number::number;
use contract::word::{self, Side};
use geometry::leak::report::Passage;
use geometry::tree::Point;
use plotters::style::colors::BLACK;

/// Half of the window's edge, in widths of the narrowest place and in cells; the larger one counts.
const HALF: (f64, f64) = (2.0, 6.0);
/// Space above the window for the legend, and below it for text.
const MARGIN: (f64, f64) = (150.0, 140.0);
/// Space at the left and at the right of the window.
const SIDES: f64 = 40.0;
/// Fill of crossing leaves.
const CROSSING: &str = "#D9D9D9";
/// Colour of the edges of leaves.
const FAINT: &str = "#AAAAAA";

/// The slice as an SVG document; `words` are the leaves of the base tree that the path leads through.
pub fn svg(case: &Case, words: &[u64], passage: &Passage) -> String {
    let window = window(passage);
    let title =
        format!("The narrowest place of the widest path, {} wide", number(passage.narrowest.width));
    document(&title, |canvas| {
        draw_leaves(canvas, &window, case, words);
        draw_facets(canvas, &window, case);
        draw_passage(canvas, &window, passage);
        let (left, top) = on_page(&window, [-window.half[0], window.half[1]]);
        let (right, bottom) = on_page(&window, [window.half[0], -window.half[1]]);
        canvas.frame((left, top), (right, bottom));
        draw_legend(canvas, passage);
        describe(canvas, &window, passage);
        (bottom + MARGIN.1) as u32
    })
}

/// The square around the narrowest place. Its abscissa is the direction of the path.
fn window(passage: &Passage) -> Window {
    let narrowest = &passage.narrowest;
    let along = Point::from(narrowest.direction);
    let to_rim = Point::from(narrowest.touches) - Point::from(narrowest.at);
    // The part of the vector to the rim that is perpendicular to the path, unless they are nearly parallel.
    let across = to_rim.reject_from_normalized(along);
    let is_parallel = across.length() <= 0.1 * to_rim.length();
    let across = if is_parallel { along.any_orthonormal_vector() } else { across.normalize() };
    let half = (HALF.0 * narrowest.width).max(HALF.1 * passage.spacing.spacing);
    Window { centre: narrowest.at, axes: [along.to_array(), across.to_array()], half: [half; 2] }
}

fn on_page(window: &Window, p: Planar) -> (f64, f64) {
    let edge = f64::from(WIDTH) - 2.0 * SIDES;
    let [half, _] = window.half;
    let scale = edge / (2.0 * half);
    (SIDES + (p[0] + half) * scale, MARGIN.0 + (half - p[1]) * scale)
}

fn draw_leaves(canvas: &mut Canvas, window: &Window, case: &Case, words: &[u64]) {
    let (mut crossing, mut free) = (Vec::new(), Vec::new());
    let reach = window.half[0] * 2f64.sqrt();
    for &w in words {
        let (low, high) = word::octant(w).bounds();
        let (low, high) = (case.root.to_user(low), case.root.to_user(high));
        let is_near = (0..3)
            .all(|a| low[a] <= window.centre[a] + reach && high[a] >= window.centre[a] - reach);
        let polygon = if is_near { window.of_box(low, high) } else { Vec::new() };
        if polygon.len() > 2 {
            let polygon: Vec<_> = polygon.into_iter().map(|p| on_page(window, p)).collect();
            if w & 3 == Side::Crossing as u64 { crossing.push(polygon) } else { free.push(polygon) }
        }
    }
    canvas.polygons(&free, "none", FAINT);
    canvas.polygons(&crossing, CROSSING, FAINT);
}

fn draw_facets(canvas: &mut Canvas, window: &Window, case: &Case) {
    for facet in &case.facets {
        if let Some(ends) = window.of_facet(facet.map(|v| v.map(f64::from))) {
            canvas.line(&ends.map(|p| on_page(window, p)), BLACK, 5, None);
        }
    }
}

fn draw_passage(canvas: &mut Canvas, window: &Window, passage: &Passage) {
    for pair in passage.points.windows(2) {
        if let Some(ends) =
            window.of_segment([window.project(pair[0].at), window.project(pair[1].at)])
        {
            canvas.line(&ends.map(|p| on_page(window, p)), colour(0), 5, None);
        }
    }
    let radius = passage.narrowest.width / 2.0;
    let on_circle = |i: usize| {
        let (sin, cos) = (i as f64 * std::f64::consts::TAU / 96.0).sin_cos();
        on_page(window, [radius * cos, radius * sin])
    };
    let circle: Vec<_> = (0..=96).map(on_circle).collect();
    canvas.line(&circle, colour(1), 6, None);
}

fn draw_legend(canvas: &mut Canvas, passage: &Passage) {
    let ball = format!("largest ball, width {}", number(passage.narrowest.width));
    let names = ["leaf crossed by facets", "facets", "projected path", &ball];
    let lines = [BLACK, colour(0), colour(1)];
    canvas.legend([SIDES; 2], &names, |canvas, (x, y), i| match i {
        0 => {
            let [left, right, top, bottom] = [x, x + 50.0, y - 22.0, y + 22.0];
            let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
            canvas.polygons(&[corners.to_vec()], CROSSING, FAINT);
        }
        _ => canvas.line(&[(x, y), (x + 50.0, y)], lines[i - 1], 6, None),
    });
}

/// The edge of a cell of the base tree, and the place and orientation of the plane.
fn describe(canvas: &Canvas, window: &Window, passage: &Passage) {
    let vector = |v: [f64; 3]| {
        let [x, y, z] = v.map(|c| format!("{:?}", (c * 1e3).round() / 1e3 + 0.0));
        format!("({x}, {y}, {z})")
    };
    let centre = window.centre.map(|c| format!("{:?}", c as f32)).join(", ");
    let [along, across] = window.axes.map(vector);
    let cell = number(passage.spacing.spacing);
    let (left, bottom) = on_page(window, window.half.map(|h| -h));
    for (line, text) in (1..).zip([
        format!("cell {cell}, centre ({centre})"),
        format!("to the right {along}, upwards {across}"),
    ]) {
        canvas.text(&text, (left, bottom + f64::from(line) * LINE));
    }
}

#[cfg(test)]
mod tests {
    use super::{Passage, *};
    use crate::figure::palette::{COLOURS, hex};
    use contract::testing::words_with_sides;
    use geometry::leak::report::{Narrowest, Point, Spacing};

    #[test]
    fn the_slice_shows_leaves_facets_path_and_ball() {
        let facet = [[2.0f32, 0.0, 0.0], [2.0, 8.0, 0.0], [2.0, 0.0, 8.0]];
        let text = "spacing_min = 1.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0";
        let case = Case::from_parts(text, vec![facet]).unwrap();
        let side = |corner: u32| if corner == 1 << 17 { Side::Crossing } else { Side::Outside };
        let words = words_with_sides(|o| o.level < 3, |o| Some(side(o.corner[0])));
        let point = |x: f64| Point { at: [x, 4.5, 4.5], width: 1.0 };
        let passage = Passage {
            spacing: Spacing::of(3, &case.root),
            narrowest: Narrowest {
                at: [2.0, 4.5, 4.5],
                width: 1.0,
                width_min: 0.99,
                width_max: 1.03,
                width_cells: 1.0,
                direction: [1.0, 0.0, 0.0],
                touches: [2.0, 4.0, 4.5],
                facets: vec![0],
                index: 1,
                is_end: false,
            },
            length: 3.0,
            inner: (0, 2),
            points: vec![point(1.0), point(2.0), point(4.0)],
        };
        let svg = svg(&case, &words, &passage);
        assert!(svg.contains("width 1.00") && svg.contains("cell 1.00"));
        let strokes = |ink: &str| svg.matches(&format!("stroke=\"{ink}\"")).count();
        // Two segments of the path and its symbol, the ball with its symbol.
        assert_eq!((strokes(&hex(COLOURS[0])), strokes(&hex(COLOURS[1]))), (3, 2));
        assert_eq!(svg.matches(CROSSING).count(), 2);
    }
}
