//! Axes around a rectangle of the page, by `plotters`.

use super::Axis;
use super::canvas::{At, Canvas, FAINT, WIDTH, font, width};
use super::scale::{tick_labels, ticks};
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::ops::Range;

/// Least space at the left of the data, for ticks and label.
const LEFT: f64 = 190.0;
/// Space at the left of ticks.
const BESIDE_TICKS: f64 = 100.0;
/// Space below the data, for ticks and label.
pub const BELOW: f64 = 130.0;

/// Space at the left of data on this axis.
pub fn left(axis: &Axis, ends: &Range<f64>) -> f64 {
    let labels = tick_labels(&ticks(axis, ends));
    labels.iter().map(|label| BESIDE_TICKS + width(label)).fold(LEFT, f64::max)
}

/// A linear coordinate with these ticks.
struct Scale(RangedCoordf64, Vec<f64>);

impl Ranged for Scale {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.0.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.1.clone()
    }

    fn range(&self) -> Range<f64> {
        self.0.range()
    }
}

/// Where values are on the page.
pub type ToPage = Box<dyn Fn(f64, f64) -> At>;

/// Draws the axes around a rectangle of the page, given by two opposite corners, with the ends of their values and perhaps a grid;
/// returns where values are.
pub fn axes(
    canvas: &Canvas,
    axes: [&Axis; 2],
    ends: [Range<f64>; 2],
    (from, to): (At, At),
    grid: bool,
) -> ToPage {
    // What is linear on the page.
    let place = |axis: &Axis, value: f64| if axis.log { value.log10() } else { value };
    let scales = [0, 1].map(|i| {
        let Range { start, end } = ends[i];
        RangedCoordf64::from(place(axes[i], start)..place(axes[i], end))
    });
    let all = [0, 1].map(|i| ticks(axes[i], &ends[i]));
    let labels = all.each_ref().map(|ticks| tick_labels(ticks));
    let at = [0, 1].map(|i| all[i].iter().map(|v| place(axes[i], *v)).collect::<Vec<f64>>());
    let label = |i: usize, value: &f64| {
        let index = at[i].iter().position(|at| at == value);
        index.map_or_else(String::new, |index| labels[i][index].clone())
    };
    let [x, y] = [0, 1].map(|i| Scale(scales[i].clone(), at[i].clone()));
    let space = |i: usize, space: f64| if axes[i].label.is_empty() { 0.0 } else { space };
    // The label of the vertical axis keeps clear of the edge of the page.
    let [left, below] = [space(1, left(axes[1], &ends[1]) - 14.0), space(0, BELOW)];
    let height = f64::from(canvas.area.dim_in_pixel().1);
    let whole =
        canvas.area.margin(from.1, height - to.1 - below, from.0 - left, f64::from(WIDTH) - to.0);
    let mut chart = ChartBuilder::on(&whole)
        .set_label_area_size(LabelAreaPosition::Left, left)
        .set_label_area_size(LabelAreaPosition::Bottom, below)
        .build_cartesian_2d(x, y)
        .expect("the rectangle lies on the page");
    let (of_x, of_y) = (|value: &f64| label(0, value), |value: &f64| label(1, value));
    let mut mesh = chart.configure_mesh();
    let grid = if grid { FAINT.to_rgba() } else { TRANSPARENT };
    mesh.light_line_style(TRANSPARENT).bold_line_style(grid).axis_style(BLACK.stroke_width(2));
    mesh.label_style(font()).axis_desc_style(font()).set_all_tick_mark_size(12);
    mesh.x_label_formatter(&of_x).y_label_formatter(&of_y);
    mesh.x_desc(axes[0].label.as_str()).y_desc(axes[1].label.as_str());
    mesh.draw().expect("a string accepts every element");
    canvas.frame(from, to);
    let limits = [(from.0 as i32, to.0 as i32), (to.1 as i32, from.1 as i32)];
    let axes = axes.map(Axis::clone);
    Box::new(move |x, y| {
        let at = |i: usize, value: f64| {
            let Range { start, end } = ends[i];
            let within = value.clamp(start.min(end), start.max(end));
            f64::from(scales[i].map(&place(&axes[i], within), limits[i]))
        };
        (at(0, x), at(1, y))
    })
}
