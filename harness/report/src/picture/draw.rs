//! The layout of a picture: the squares, the section line, axes and a legend.

use super::colour::Entry;
use super::squares::Square;
use super::{Picture, Planar};
use crate::figure::Axis;
use crate::figure::axes;
use crate::figure::canvas::{Canvas, INK, SYMBOL, WIDTH, document, width};
use crate::figure::palette::hex;
use std::collections::BTreeSet;

/// Least space for the ticks and the label of the vertical axis, and space at the right.
const SIDES: (f64, f64) = (200.0, 40.0);
/// Greatest height of the window: it and its margins fit on a page.
const HEIGHT_MAX: f64 = 1650.0;
/// Space below the window for ticks, label and the name of the plane.
const BELOW: f64 = 210.0;
/// Width of the section line, and of the light line below it, which separates it from dark cells.
const SECTION: (f64, f64) = (2.5, 5.0);

/// Left edge of a window on the page.
fn left(window: &[Planar; 2]) -> f64 {
    axes::left(&Axis::linear(""), &(window[0][1]..window[1][1])).max(SIDES.0)
}

/// Units of the page per unit of the user in a window.
pub fn scale(window: &[Planar; 2]) -> f64 {
    let [across, up] = [0, 1].map(|i| window[1][i] - window[0][i]);
    ((f64::from(WIDTH) - left(window) - SIDES.1) / across).min(HEIGHT_MAX / up)
}

/// The picture as an SVG document.
pub fn svg(picture: &Picture) -> String {
    document(&picture.title(), |canvas| draw(picture, canvas))
}

/// The place of the window on the page.
struct Page<'a> {
    picture: &'a Picture,
    left: f64,
    top: f64,
    scale: f64,
}

impl Page<'_> {
    /// A point of the plane on the page, to a tenth of a unit, so that neighbouring squares have common corners.
    fn at(&self, [u, v]: Planar) -> (f64, f64) {
        let [low, high] = self.picture.window;
        let tenth = |value: f64| (value * 10.0).round() / 10.0;
        (tenth(self.left + (u - low[0]) * self.scale), tenth(self.top + (high[1] - v) * self.scale))
    }

    /// The rectangle of a square within the window; `None` if nothing of it is visible.
    fn rectangle(&self, square: &Square) -> Option<[f64; 4]> {
        let [low, high] = self.picture.window;
        let within = |p: Planar| [0, 1].map(|i| p[i].clamp(low[i], high[i]));
        let [(left, bottom), (right, top)] =
            self.picture.corners(square).map(|p| self.at(within(p)));
        (left < right && top < bottom).then_some([left, top, right - left, bottom - top])
    }
}

/// Draws the picture; returns its height.
fn draw(picture: &Picture, canvas: &mut Canvas) -> u32 {
    let top = legend(picture, canvas) - 4.0;
    let page = Page { picture, left: left(&picture.window), top, scale: scale(&picture.window) };
    // Where there is no leaf, the page is white, on a dark one too: the colours are chosen for it.
    let [low, high] = picture.window;
    let ((left, bottom), (right, top)) = (page.at(low), page.at(high));
    canvas.fill(&[[left, top, right - left, bottom - top]], "#FFFFFF");
    // Outlined squares are last, so that no fill covers half of an outline.
    for outlined in [false, true] {
        for Entry { value, fill, .. } in &picture.key {
            let shown = |s: &&Square| {
                s.value == *value && (s.level <= picture.squares.level_outlined) == outlined
            };
            let squares = picture.squares.squares.iter().filter(shown);
            let rectangles: Vec<_> = squares.filter_map(|square| page.rectangle(square)).collect();
            match outlined {
                _ if rectangles.is_empty() => {}
                true => canvas.outlined(&rectangles, &hex(*fill), &hex(outline(*fill))),
                false => canvas.fill(&rectangles, &hex(*fill)),
            }
        }
    }
    section(&page, canvas);
    let [x, y] = picture.axes().map(Axis::linear);
    let ends = [low[0]..high[0], low[1]..high[1]];
    let _ = axes::axes(canvas, [&x, &y], ends, ((left, top), (right, bottom)), false);
    below(&page, canvas);
    (bottom + BELOW) as u32
}

/// Draws the legend beside its title; returns its lower end.
fn legend(picture: &Picture, canvas: &mut Canvas) -> f64 {
    let (entries, title) = picture.colour.legend(&picture.key);
    let left = left(&picture.window);
    canvas.text(&title, (left, 36.0));
    let line = picture.section.as_ref().map(|_| "geometry");
    let names: Vec<&str> = entries.iter().map(|entry| entry.0).chain(line).collect();
    let start = left + width(&title) + 50.0;
    canvas.legend([left, start], &names, |canvas, (x, y), i| match entries.get(i) {
        Some((_, fill)) => {
            let symbol = [x, y - 18.0, SYMBOL - 20.0, 36.0];
            canvas.outlined(&[symbol], &hex(*fill), &hex(outline(*fill)));
        }
        None => canvas.segments(&[[(x, y), (x + SYMBOL - 20.0, y)]], INK, SECTION.0),
    })
}

/// The colour of outlines around a fill: the same hue, so that small cells look like those of the legend.
fn outline(fill: [u8; 3]) -> [u8; 3] {
    let is_light = fill.iter().map(|&c| u32::from(c)).sum::<u32>() > 360;
    fill.map(|c| if is_light { c / 2 } else { c / 2 + 105 })
}

fn section(page: &Page, canvas: &mut Canvas) {
    let Some(section) = &page.picture.section else { return };
    let tenths = |(x, y): (f64, f64)| ((x * 10.0) as i64, (y * 10.0) as i64);
    let mut drawn = BTreeSet::new();
    // Facets that are small on the page have many equal segments, or none.
    let segments: Vec<_> = section
        .iter()
        .map(|ends| ends.map(|p| page.at(p)))
        .filter(|&[p, q]| {
            p != q && drawn.insert([tenths(p).min(tenths(q)), tenths(p).max(tenths(q))])
        })
        .collect();
    if !segments.is_empty() {
        canvas.segments(&segments, "#FFFFFF", SECTION.1);
        canvas.segments(&segments, "#000000", SECTION.0);
    }
}

/// The plane and the number of cells.
fn below(page: &Page, canvas: &mut Canvas) {
    let picture = page.picture;
    let plane = super::plane_name(&picture.root, picture.slice);
    let at = (page.left, page.at(picture.window[0]).1 + 170.0);
    canvas.text(&format!("{plane}; {}", picture.count()), at);
}
