//! The layout of a picture: a legend, the squares, and the section of the body and axes, or its surface.

use super::colour::Entry;
use super::squares::Square;
use super::view::Face;
use super::{Body, Picture, Planar, plane_axes};
use crate::figure::Axis;
use crate::figure::axes::{self, Scale};
use crate::figure::canvas::{
    Anchor, At, Canvas, INK, Line, SIZE, SYMBOL, WIDTH, document, hex, legend, width,
};
use std::collections::BTreeSet;

/// Least space for the ticks and the label of the vertical axis, and space at the right, which a view has on both sides.
const SIDES: (f64, f64) = (200.0, 40.0);
/// Greatest height of the window: it and its margins fit on a page.
const HEIGHT_MAX: f64 = 1650.0;
/// Space below axes for the name of the plane.
const BELOW: f64 = 80.0;
/// Width of the section line, and of the light line below it, which separates it from dark cells.
const SECTION: (f64, f64) = (2.5, 5.0);
/// Length of a tick.
const TICK: f64 = 12.0;
/// Distances of labels of ticks from the horizontal and from the vertical axis: those at the corner do not touch.
const TO_LABEL: [f64; 2] = [30.0, 18.0];
/// Shades of the surface.
const SHADES: f64 = 24.0;

/// The picture as an SVG document.
pub fn svg(picture: &Picture) -> String {
    document(&picture.title(), |canvas| Page::of(picture).draw(canvas))
}

/// Units of the page per unit of the user.
pub fn scale(picture: &Picture) -> f64 {
    Page::of(picture).scale
}

/// The ticks of an axis.
fn scale_of(low: f64, high: f64) -> Scale {
    Scale::of(&Axis { range: Some((low, high)), ..Axis::linear("") }, [])
}

/// The place of the window on the page.
struct Page<'a> {
    picture: &'a Picture,
    /// Lower left and upper right corner of what is shown, in the plane of the picture.
    shown: [Planar; 2],
    left: f64,
    top: f64,
    scale: f64,
}

impl<'a> Page<'a> {
    fn of(picture: &'a Picture) -> Self {
        let mut window = picture.window;
        let [across, up] = plane_axes(picture.slice.axis);
        let at = picture.root.to_user([picture.slice.at; 3])[picture.slice.axis];
        window.iter_mut().for_each(|corner| corner[picture.slice.axis] = at);
        let [mut beside, mut above] = [window[0]; 2];
        (beside[across], above[up]) = (window[1][across], window[1][up]);
        let corners = [window[0], beside, window[1], above].map(|at| picture.projection.planar(at));
        let faces = match &picture.body {
            Body::Surface(faces) => &faces[..],
            _ => &[],
        };
        let points = || faces.iter().flat_map(|face| face.corners).chain(corners);
        let end =
            |i: usize, of: fn(f64, f64) -> f64, from: f64| points().map(|p| p[i]).fold(from, of);
        let low = [0, 1].map(|i| end(i, f64::min, f64::INFINITY));
        let high = [0, 1].map(|i| end(i, f64::max, f64::NEG_INFINITY));
        let ticks = scale_of(low[1], high[1]).left();
        let left = if picture.is_view() { SIDES.1 } else { ticks.max(SIDES.0) };
        let [across, up] = [0, 1].map(|i| high[i] - low[i]);
        let scale = ((WIDTH - left - SIDES.1) / across).min(HEIGHT_MAX / up);
        Self { picture, shown: [low, high], left, top: 0.0, scale }
    }

    /// A point of the plane on the page.
    fn at(&self, [u, v]: Planar) -> At {
        let [low, high] = self.shown;
        (self.left + (u - low[0]) * self.scale, self.top + (high[1] - v) * self.scale)
    }

    /// A square within the window; `None` if nothing of it is visible.
    fn polygon(&self, square: &Square) -> Option<[At; 4]> {
        let [low, high] = self.picture.window;
        let axes = plane_axes(self.picture.slice.axis);
        let corners = self.picture.corners(square).map(|mut at| {
            axes.into_iter().for_each(|a| at[a] = at[a].clamp(low[a], high[a]));
            at
        });
        let is_visible = axes.into_iter().all(|a| corners[0][a] < corners[2][a]);
        is_visible.then(|| corners.map(|at| self.at(self.picture.projection.planar(at))))
    }

    /// Draws the picture; returns its height.
    fn draw(mut self, canvas: &mut Canvas) -> f64 {
        self.top = self.legend(canvas) - 4.0;
        let [low, high] = self.shown;
        let (from, to) = (self.at([low[0], high[1]]), self.at([high[0], low[1]]));
        match &self.picture.body {
            Body::Surface(faces) => {
                let (before, behind): (Vec<&Face>, Vec<_>) =
                    faces.iter().partition(|f| f.is_before);
                self.faces(canvas, &behind);
                self.squares(canvas);
                self.faces(canvas, &before);
            }
            _ => {
                // Where there is no leaf, the page is white, on a dark one too: the colours are chosen for it.
                let corners = [from, (to.0, from.1), to, (from.0, to.1)];
                canvas.polygons(&[corners], "#FFFFFF", None);
                self.squares(canvas);
            }
        }
        if let Body::Section(segments) = &self.picture.body {
            self.section(canvas, segments);
        }
        let mut bottom = to.1;
        if !self.picture.is_view() {
            self.axes(canvas, from, to);
            bottom += axes::BELOW;
        }
        canvas.text(&self.picture.caption(), (self.left, bottom + BELOW / 2.0), Anchor::Start);
        bottom + BELOW
    }

    fn squares(&self, canvas: &mut Canvas) {
        // Outlined squares are last, so that no fill covers half of an outline.
        let squares = &self.picture.squares;
        for is_outlined in [false, true] {
            for Entry { value, fill, .. } in &self.picture.key {
                let is_shown = |s: &&Square| {
                    s.value == *value && (s.level <= squares.level_outlined) == is_outlined
                };
                let shown = squares.squares.iter().filter(is_shown);
                let polygons: Vec<_> = shown.filter_map(|square| self.polygon(square)).collect();
                let outline = is_outlined.then(|| outline(*fill));
                canvas.polygons(&polygons, &hex(*fill), outline.as_deref());
            }
        }
    }

    /// Draws the legend beside its title; returns its lower end.
    fn legend(&self, canvas: &mut Canvas) -> f64 {
        let (entries, title) = self.picture.colour.legend(&self.picture.key);
        canvas.text(&title, (self.left, 36.0), Anchor::Start);
        let line = matches!(self.picture.body, Body::Section(_)).then_some("geometry");
        let names: Vec<&str> = entries.iter().map(|entry| entry.0).chain(line).collect();
        let start = self.left + width(&title) + 50.0;
        let (places, bottom) = legend([self.left, start], &names);
        for (i, (name, (x, y))) in names.into_iter().zip(places).enumerate() {
            let right = x + SYMBOL - 20.0;
            match entries.get(i) {
                Some((_, fill)) => {
                    let (low, high) = (y + 18.0, y - 18.0);
                    let symbol = [(x, low), (right, low), (right, high), (x, high)];
                    canvas.polygons(&[symbol], &hex(*fill), Some(&outline(*fill)));
                }
                None => {
                    let line = Line { colour: INK, width: SECTION.0, dashes: "" };
                    canvas.line(&[(x, y), (right, y)], line);
                }
            }
            canvas.text(name, (x + SYMBOL, y), Anchor::Start);
        }
        bottom
    }

    /// Draws the axes around the window, whose upper left and lower right corner are given.
    fn axes(&self, canvas: &mut Canvas, from: At, to: At) {
        let [low, high] = self.shown;
        let [mut x, y] = [0, 1].map(|i| scale_of(low[i], high[i]));
        x.clear_labels(|tick| self.at([tick, 0.0]).0);
        let thin = Line { colour: INK, width: 2.0, dashes: "" };
        for (tick, label) in x.ticks.iter().zip(&x.labels) {
            let (place, _) = self.at([*tick, 0.0]);
            canvas.line(&[(place, to.1), (place, to.1 + TICK)], thin);
            canvas.text(label, (place, to.1 + TO_LABEL[0] + SIZE / 2.0), Anchor::Middle);
        }
        for (tick, label) in y.ticks.iter().zip(&y.labels) {
            let (_, place) = self.at([0.0, *tick]);
            canvas.line(&[(from.0, place), (from.0 - TICK, place)], thin);
            canvas.text(label, (from.0 - TO_LABEL[1], place), Anchor::End);
        }
        let names = plane_axes(self.picture.slice.axis).map(|axis| ["x", "y", "z"][axis]);
        let below = to.1 + axes::BELOW - SIZE / 2.0 - 6.0;
        canvas.text(names[0], (from.0.midpoint(to.0), below), Anchor::Middle);
        let beside = from.0 - y.left() + SIZE / 2.0 + 8.0;
        canvas.text(names[1], (beside, from.1.midpoint(to.1)), Anchor::Upwards);
        canvas.line(&[from, (to.0, from.1), to, (from.0, to.1), from], thin);
    }

    fn section(&self, canvas: &mut Canvas, segments: &[[Planar; 2]]) {
        let tenths = |(x, y): At| ((x * 10.0) as i64, (y * 10.0) as i64);
        let mut drawn = BTreeSet::new();
        // Facets that are small on the page have many equal segments, or none.
        let mut is_new = |&[p, q]: &[At; 2]| {
            let [p, q] = [tenths(p), tenths(q)];
            p != q && drawn.insert([p.min(q), p.max(q)])
        };
        let segments = segments.iter().map(|ends| ends.map(|p| self.at(p)));
        let segments: Vec<[At; 2]> = segments.filter(|s| is_new(s)).collect();
        for (colour, width) in [("#FFFFFF", SECTION.1), ("#000000", SECTION.0)] {
            canvas.lines(&segments, Line { colour, width, dashes: "" });
        }
    }

    fn faces(&self, canvas: &mut Canvas, faces: &[&Face]) {
        let shade = |face: &Face| (face.light * SHADES).round();
        for alike in faces.chunk_by(|a, b| shade(a) == shade(b)) {
            let grey = 70.0 + 165.0 * shade(alike[0]) / SHADES;
            let fill = hex([grey as u8; 3]);
            let polygons: Vec<_> = alike.iter().map(|f| f.corners.map(|p| self.at(p))).collect();
            canvas.polygons(&polygons, &fill, Some(&fill));
        }
    }
}

/// The colour of outlines around a fill: the same hue, so that small cells look like those of the legend.
fn outline(fill: [u8; 3]) -> String {
    let is_light = fill.iter().map(|&c| u32::from(c)).sum::<u32>() > 360;
    hex(fill.map(|c| if is_light { c / 2 } else { c / 2 + 105 }))
}
