//! What a picture is drawn on: SVG or TikZ. Coordinates are those of [`Canvas`].

use crate::figure::canvas::{Anchor, Canvas};

/// A sheet that accepts shapes and text.
pub trait Sheet {
    /// Rectangles of one colour, each given by its corner and size, with outlines of another colour or without.
    fn rectangles(&mut self, rectangles: &[[f64; 4]], fill: &str, outline: Option<&str>);
    /// Segments of one colour and width, with round ends.
    fn segments(&mut self, segments: &[[(f64, f64); 2]], colour: &str, width: f64);
    /// A text.
    fn text(&mut self, text: &str, at: (f64, f64), anchor: Anchor);
}

impl Sheet for Canvas<'_> {
    fn rectangles(&mut self, rectangles: &[[f64; 4]], fill: &str, outline: Option<&str>) {
        match outline {
            Some(outline) => self.outlined(rectangles, fill, outline),
            None => self.fill(rectangles, fill),
        }
    }

    fn segments(&mut self, segments: &[[(f64, f64); 2]], colour: &str, width: f64) {
        Canvas::segments(self, segments, colour, width);
    }

    fn text(&mut self, text: &str, at: (f64, f64), anchor: Anchor) {
        Canvas::text(self, text, at, anchor);
    }
}
