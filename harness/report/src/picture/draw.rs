//! The layout of a picture: the squares, the section line, axes, a legend and a scale.

use super::Picture;
use super::colour::short;
use super::sheet::Sheet;
use super::squares::Square;
use crate::figure::canvas::{Anchor, INK, SIZE, WIDTH, document};
use crate::figure::palette::hex;
use crate::section::Planar;
use std::collections::BTreeSet;

/// Least space for the ticks and the label of the vertical axis, and space at the right.
const SIDES: (f64, f64) = (200.0, 40.0);
/// Space for the label of the vertical axis and for its ticks, without their labels.
const BESIDE_TICKS: f64 = 100.0;
/// Greatest height of the window: it and its margins fit on a page.
const HEIGHT_MAX: f64 = 1650.0;
/// Space below the window for ticks, label and scale.
const BELOW: f64 = 270.0;
/// Height of a row of the legend, and width of its symbols.
const ROW: f64 = SIZE + 16.0;
const SYMBOL: f64 = 50.0;
/// Width of the section line, and of the light line below it, which separates it from dark cells.
const SECTION: (f64, f64) = (2.5, 5.0);

/// Estimated width of a text that consists mainly of digits, which are wide.
fn width(text: &str) -> f64 {
    text.chars().count() as f64 * SIZE * 0.62
}

/// Left edge of a window on the page.
fn left(window: &[Planar; 2]) -> f64 {
    let ticks = Ticks::of(window[0][1], window[1][1]);
    let widest = ticks.values().iter().map(|&t| width(&ticks.label(t))).fold(0.0, f64::max);
    SIDES.0.max(BESIDE_TICKS + widest)
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
pub fn draw(picture: &Picture, sheet: &mut dyn Sheet) -> u32 {
    let top = legend(picture, sheet) + 14.0;
    let left = left(&picture.window);
    let page = Page { picture, left, top, scale: scale(&picture.window) };
    // Where there is no leaf, the page is white, on a dark one too: the colours are chosen for it.
    let (low, high) = (page.at(picture.window[0]), page.at(picture.window[1]));
    sheet.rectangles(&[[low.0, high.1, high.0 - low.0, low.1 - high.1]], "#FFFFFF", None);
    squares(&page, sheet);
    section(&page, sheet);
    let corners = [low, (high.0, low.1), high, (low.0, high.1), low];
    let frame: Vec<_> = corners.windows(2).map(|w| [w[0], w[1]]).collect();
    sheet.segments(&frame, INK, 2.0);
    axes(&page, sheet);
    below(&page, sheet);
    (low.1 + BELOW) as u32
}

/// Draws the legend in as many rows as it needs; returns its lower end.
fn legend(picture: &Picture, sheet: &mut dyn Sheet) -> f64 {
    let (entries, remark) = picture.colour.legend(&picture.key);
    let right = f64::from(WIDTH) - SIDES.1;
    let left = left(&picture.window);
    let (mut x, mut y) = (left, ROW / 2.0);
    let title = if remark.is_empty() { picture.colour.to_string() } else { remark };
    sheet.text(&title, (x, y), Anchor::Start);
    x += width(&title) + 40.0;
    let line = picture.section.as_ref().map(|_| "geometry");
    let names = entries.iter().map(|(name, fill)| (*name, Some(*fill)));
    for (name, fill) in names.chain(line.map(|name| (name, None))) {
        let entry = SYMBOL + 14.0 + width(name) + 30.0;
        if x + entry > right {
            (x, y) = (left, y + ROW);
        }
        match fill {
            Some(fill) => {
                let symbol = [x, y - 18.0, SYMBOL, 36.0];
                sheet.rectangles(&[symbol], &hex(fill), Some(&outline(fill)));
            }
            None => sheet.segments(&[[(x, y), (x + SYMBOL, y)]], INK, SECTION.0),
        }
        sheet.text(name, (x + SYMBOL + 14.0, y), Anchor::Start);
        x += entry;
    }
    y + ROW / 2.0
}

/// The colour of outlines around a fill: the same hue, so that small cells look like those of the legend.
fn outline(fill: [u8; 3]) -> String {
    let is_light = fill.iter().map(|&c| u32::from(c)).sum::<u32>() > 360;
    hex(fill.map(|c| if is_light { c / 2 } else { c / 2 + 105 }))
}

fn squares(page: &Page, sheet: &mut dyn Sheet) {
    let Picture { squares, key, .. } = page.picture;
    // Outlines are drawn last, so that no fill covers half of one.
    for outlined in [false, true] {
        for entry in key {
            let shown = |s: &&Square| {
                s.value == entry.value && (s.level <= squares.level_outlined) == outlined
            };
            let rectangles: Vec<[f64; 4]> =
                squares.squares.iter().filter(shown).filter_map(|s| page.rectangle(s)).collect();
            if !rectangles.is_empty() {
                let fill = hex(entry.fill);
                let outline = outlined.then(|| outline(entry.fill));
                sheet.rectangles(&rectangles, &fill, outline.as_deref());
            }
        }
    }
}

fn section(page: &Page, sheet: &mut dyn Sheet) {
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
        sheet.segments(&segments, "#FFFFFF", SECTION.1);
        sheet.segments(&segments, "#000000", SECTION.0);
    }
}

fn axes(page: &Page, sheet: &mut dyn Sheet) {
    let Picture { window: [low, high], slice, .. } = page.picture;
    let names = super::squares::plane_axes(slice.axis).map(|a| ["x", "y", "z"][a]);
    let (corner, opposite) = (page.at(*low), page.at(*high));
    let mut marks = Vec::new();
    let ticks = [0, 1].map(|i| Ticks::of(low[i], high[i]));
    for t in ticks[0].values() {
        let (x, y) = page.at([t, low[1]]);
        marks.push([(x, y), (x, y + 12.0)]);
        sheet.text(&ticks[0].label(t), (x, y + 22.0), Anchor::Below);
    }
    for t in ticks[1].values() {
        let (x, y) = page.at([low[0], t]);
        marks.push([(x, y), (x - 12.0, y)]);
        sheet.text(&ticks[1].label(t), (x - 20.0, y), Anchor::End);
    }
    sheet.segments(&marks, INK, 2.0);
    let middle = ((corner.0 + opposite.0) / 2.0, (corner.1 + opposite.1) / 2.0);
    sheet.text(names[0], (middle.0, corner.1 + 76.0), Anchor::Below);
    sheet.text(names[1], (50.0, middle.1), Anchor::Turned);
}

/// The scale, and the plane and number of cells.
fn below(page: &Page, sheet: &mut dyn Sheet) {
    let Picture { window: [low, high], squares, slice, root, .. } = page.picture;
    let y = page.at(*low).1 + 170.0;
    let length = Ticks::of(0.0, high[0] - low[0]).step;
    let (left, right) = (page.left, page.left + length * page.scale);
    let bar = [
        [(left, y), (right, y)],
        [(left, y - 12.0), (left, y + 12.0)],
        [(right, y - 12.0), (right, y + 12.0)],
    ];
    sheet.segments(&bar, INK, 4.0);
    let label = short(length);
    sheet.text(&label, (right + 16.0, y), Anchor::Start);
    let plane = super::plane_name(root, *slice);
    sheet.text(&plane, (right + 16.0 + width(&label) + 60.0, y), Anchor::Start);
    let noun = if squares.leaves == 1 { "cell" } else { "cells" };
    let merged = if squares.is_merged { ", the smallest merged" } else { "" };
    let cells = format!("{} {noun} in the plane{merged}", squares.leaves);
    sheet.text(&cells, (page.left, y + ROW), Anchor::Start);
}

/// Ticks at multiples of a round step.
struct Ticks {
    low: f64,
    high: f64,
    step: f64,
}

impl Ticks {
    fn of(low: f64, high: f64) -> Self {
        let step_min = (high - low) / 6.0;
        let power = 10f64.powf(step_min.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|f| f * power);
        let step = steps.into_iter().find(|s| *s >= step_min).unwrap_or(step_min);
        Self { low, high, step }
    }

    fn values(&self) -> Vec<f64> {
        let slack = (self.high - self.low) * 1e-9;
        let (first, last) = ((self.low - slack) / self.step, (self.high + slack) / self.step);
        (first.ceil() as i64..=last.floor() as i64).map(|i| i as f64 * self.step).collect()
    }

    /// A label that differs from that of the next tick.
    fn label(&self, value: f64) -> String {
        let decimals = (-self.step.log10().floor()).max(0.0) as usize;
        // Adding zero turns -0 into 0.
        let value = (value / self.step).round() * self.step + 0.0;
        if decimals > 6 || value.abs() >= 1e6 {
            short(value)
        } else {
            format!("{value:.decimals$}")
        }
    }
}
