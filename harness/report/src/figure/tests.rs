//! Drawings as PNG and PDF, and the place of their text, measured with the typeface that PNG and PDF have.

use super::format::rendered::{pdf, png, tree};
use super::samples::{bars, figure, series};
use super::svg::svg;
use super::{Axis, Figure, Point, Provenance};
use resvg::tiny_skia::Rect;
use resvg::usvg::{Group, Node};
use std::collections::BTreeSet;

fn texts(group: &Group, found: &mut Vec<(String, Rect)>) {
    for node in group.children() {
        match node {
            Node::Group(group) => texts(group, found),
            Node::Text(text) => {
                let content = text.chunks().iter().map(|chunk| chunk.text()).collect();
                found.push((content, text.abs_bounding_box()));
            }
            _ => {}
        }
    }
}

/// Asserts that no text lies on another one or beyond the page.
pub(crate) fn assert_legible(svg: &str) {
    let tree = tree(svg).unwrap();
    let mut found = Vec::new();
    texts(tree.root(), &mut found);
    assert!(found.len() > 2, "{svg:.300}");
    for (i, (name, a)) in found.iter().enumerate() {
        let is_on_page = a.left() >= 0.0
            && a.top() >= 0.0
            && a.right() <= tree.size().width()
            && a.bottom() <= tree.size().height();
        assert!(is_on_page, "{name:?} is cut: {a:?}");
        for (other, b) in &found[..i] {
            let is_apart = a.right() < b.left()
                || b.right() < a.left()
                || a.bottom() <= b.top()
                || b.bottom() <= a.top();
            assert!(is_apart, "{name:?} lies on {other:?}: {a:?} {b:?}");
        }
    }
}

#[test]
fn png_and_pdf_contain_the_text() {
    let drawn = svg(&figure(vec![series(Provenance::Measured)]));
    let image = png(&drawn).unwrap();
    assert_eq!(&image[1..4], b"PNG");
    let textless = drawn.replace(">speedup<", "><").replace(">ranks<", "><");
    assert_ne!(image, png(&textless).unwrap());
    let page = pdf(&drawn).unwrap();
    assert!(page.starts_with(b"%PDF"));
    assert!(page.windows(10).any(|w| w == b"DejaVuSans"), "the typeface is in the file");
}

/// A figure in a repository changes only with its data. Transparent areas, of which this one has four, are resources of the page.
#[test]
fn a_pdf_has_the_same_bytes_whenever_it_is_made() {
    let drawn = svg(&figure(vec![series(Provenance::Modelled); 4]));
    let made: BTreeSet<Vec<u8>> = (0..8).map(|_| pdf(&drawn).unwrap()).collect();
    assert_eq!(made.len(), 1);
    let page = String::from_utf8_lossy(made.first().unwrap()).into_owned();
    let (at, lines) = (page.find("/gs0 ").unwrap(), ["/gs1 ", "/gs2 ", "/gs3 "]);
    assert!(lines.map(|of| page.find(of)).is_sorted() && page.find(lines[0]) > Some(at), "{page}");
}

/// Names in the legend as long as a page, numbers of many digits, a single value.
#[test]
fn no_text_of_a_figure_is_cut_or_lies_on_another() {
    let mut drawn = figure(
        [
            Provenance::Measured,
            Provenance::Oversubscribed,
            Provenance::Projected,
            Provenance::Cited,
            Provenance::Bound,
        ]
        .map(series)
        .to_vec(),
    );
    assert_legible(&svg(&drawn));
    for (i, s) in drawn.series.iter_mut().enumerate() {
        s.name = "mesher, 64 ranks ".repeat(1 + i / 2);
        s.points.iter_mut().for_each(|p| *p = Point::exact(p.x, 1e-7 * p.y));
    }
    assert_legible(&svg(&drawn));
    drawn.series.truncate(1);
    drawn.series[0].points.truncate(1);
    assert_legible(&svg(&drawn));
    let mut stacked = bars();
    for count in [2u32, 11, 64] {
        stacked.y.names =
            (0..count).map(|i| format!("morton rebalance W={}", 10_i32.pow(i % 5))).collect();
        for s in &mut stacked.series {
            s.points = (0..count).map(|i| Point::exact(98_765.4, i.into())).collect();
        }
        assert_legible(&svg(&stacked));
    }
    let (x, y) = (Axis::linear("rank"), Axis::linear("a longer name of a quantity / s"));
    for factor in [1e-9f64, 0.37, 123_456.0, -98_765.4, 1e12] {
        drawn.series = vec![series(Provenance::Measured)];
        for p in &mut drawn.series[0].points {
            *p = Point::exact(p.x * factor.abs(), p.y * factor);
        }
        assert_legible(&svg(&Figure { x: x.clone(), y: y.clone(), ..drawn.clone() }));
    }
}
