//! Draws the mesh of one small case after every phase, for `mesher/walkthrough/README.md`.
//!
//! ```text
//! cargo run -p mesher-library --example walkthrough          # rewrites mesher/walkthrough/*.svg
//! ```
//!
//! Every drawing is a section through the tree just beside the plane y = 0, made from the mesher's own leaf words on four
//! simulated ranks. The tests at the end fail when a committed drawing, or a number on the page, differs from what this program makes.

use bricks::octant::{LEVEL_MAX, Side};
use mesher::Options;
use mesher::input::case::Case;
use mesher::input::ingest;
use mesher::partition::{Division, Partitioner, Weights};
use ranks::sim;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use words::words;

#[path = "../tests/support/words.rs"]
mod words;

/// Ranks that share the mesh.
const RANKS: usize = 4;
/// Where the section cuts the y axis, in level-19 cells: inside the leaves beside the root's mid-plane, and not on their faces.
const SECTION: u32 = (1 << (LEVEL_MAX - 1)) + 1;
/// Edge of the root, which is centred on the origin, as in `case.toml`.
const ROOT_EDGE: f64 = 1.6;
/// Edge of a drawing, in SVG user units.
const EDGE: f64 = 480.0;
/// Fill by rank: Okabe and Ito's colours, which colour-blind readers can distinguish.
const RANK_FILL: [&str; RANKS] = ["#56b4e9", "#e69f00", "#009e73", "#cc79a7"];

/// A leaf that the section cuts: its rectangle in drawing units, its side and the rank that emits it.
struct CutLeaf {
    corner: [f64; 2],
    edge: f64,
    side: u64,
    rank: usize,
}

/// The case of the walk-through.
fn case() -> Case {
    case_file::read(&directory().join("case.toml")).expect("the walk-through's case is valid")
}

/// Where the case is, and the drawings.
fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("walkthrough")
}

/// The leaf words of each rank after refinement (`ungraded`) or after gradation, partitioned by `weights`.
fn leaves_by_rank(ungraded: bool, weights: Weights) -> Vec<Vec<u64>> {
    let division = Division { partitioner: Partitioner::Morton, weights, level_base: None };
    let options = Options { division, ungraded, check: true, ..Options::default() };
    sim::run(RANKS, 1, |comm| {
        words(&case(), &options, comm).expect("the walk-through's case is valid").0
    })
}

/// The leaves in the section, in Morton order.
fn section(ungraded: bool, weights: Weights) -> Vec<CutLeaf> {
    let by_rank = leaves_by_rank(ungraded, weights);
    let leaves =
        (0..).zip(&by_rank).flat_map(|(rank, words)| words.iter().map(move |&w| (rank, w)));
    leaves.filter_map(|(rank, word)| cut(rank, word)).collect()
}

/// The part of a leaf that lies in the section, if any.
fn cut(rank: usize, word: u64) -> Option<CutLeaf> {
    let [x, y, z] = bricks::octant::position(word >> 7);
    let cells = 1u32 << (LEVEL_MAX - (word >> 2 & 31) as u32);
    let unit = EDGE / f64::from(1u32 << LEVEL_MAX);
    // The drawing shows x to the right and z upwards; SVG's second axis points down.
    let top = EDGE - f64::from(z + cells) * unit;
    (y..y + cells).contains(&SECTION).then(|| CutLeaf {
        corner: [f64::from(x) * unit, top],
        edge: f64::from(cells) * unit,
        side: word & 3,
        rank,
    })
}

/// The body's outline in the section: one line segment per facet that crosses the plane.
fn outline() -> String {
    let geometry = ingest::read(&case().source, &ranks::Solo).expect("a generated shape");
    let plane = (f64::from(SECTION) / f64::from(1u32 << LEVEL_MAX) - 0.5) * ROOT_EDGE;
    let mut lines = String::new();
    for facet in geometry.facets {
        let vertices = facet.map(|vertex| vertex.map(f64::from));
        let edges = (0..3).map(|i| [vertices[i], vertices[(i + 1) % 3]]);
        let ends: Vec<[f64; 2]> = edges.filter_map(|edge| meet(edge, plane)).collect();
        if let [[x1, y1], [x2, y2]] = ends[..] {
            writeln!(lines, "<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\"/>")
                .expect("writing to a string");
        }
    }
    format!("<g stroke=\"#d00\" stroke-width=\"1.5\">\n{lines}</g>\n")
}

/// Where an edge of a facet meets the plane `y = plane`, in drawing units.
fn meet([a, b]: [[f64; 3]; 2], plane: f64) -> Option<[f64; 2]> {
    let t = (plane - a[1]) / (b[1] - a[1]);
    let along = |axis: usize| (a[axis] + t * (b[axis] - a[axis])) / ROOT_EDGE;
    ((a[1] < plane) != (b[1] < plane)).then(|| [(0.5 + along(0)) * EDGE, (0.5 - along(2)) * EDGE])
}

/// One drawing: leaves filled by `fill`, with the outline on top.
fn draw(
    leaves: &[CutLeaf],
    title: &str,
    fill: impl Fn(&CutLeaf) -> &'static str,
    extra: &str,
) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-4 -4 {0} {0}\" width=\"{0}\" role=\"img\">\n<title>{title}</title>\n\
         <rect x=\"-4\" y=\"-4\" width=\"{0}\" height=\"{0}\" fill=\"#fff\"/>\n\
         <rect width=\"{EDGE}\" height=\"{EDGE}\" fill=\"none\" stroke=\"#444\"/>\n<g stroke=\"#444\" stroke-width=\"0.4\">\n",
        EDGE + 8.0
    );
    for leaf in leaves {
        let CutLeaf { corner: [x, y], edge, .. } = leaf;
        let fill = fill(leaf);
        writeln!(
            svg,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{edge}\" height=\"{edge}\" fill=\"{fill}\"/>"
        )
        .expect("writing to a string");
    }
    svg + "</g>\n" + &outline() + extra + "</svg>\n"
}

/// The path through the centres of the leaves in the section, in the order in which they are emitted.
fn emission_order(leaves: &[CutLeaf]) -> String {
    let centre = |leaf: &CutLeaf| {
        format!("{:.2} {:.2}", leaf.corner[0] + leaf.edge / 2.0, leaf.corner[1] + leaf.edge / 2.0)
    };
    let path: Vec<String> = leaves.iter().map(centre).collect();
    format!(
        "<path d=\"M{}\" fill=\"none\" stroke=\"#06c\" stroke-width=\"0.7\"/>\n",
        path.join("L")
    )
}

fn by_rank(leaf: &CutLeaf) -> &'static str {
    RANK_FILL[leaf.rank]
}

fn by_side(leaf: &CutLeaf) -> &'static str {
    match leaf.side {
        s if s == Side::Outside as u64 => "#dcebf7",
        s if s == Side::Inside as u64 => "#f6d9a8",
        _ => "#b5b5b5",
    }
}

fn crossing_only(leaf: &CutLeaf) -> &'static str {
    if leaf.side == Side::Crossing as u64 { "#b5b5b5" } else { "#fff" }
}

/// Every drawing with its file name.
fn drawings() -> Vec<(&'static str, String)> {
    let base_tree = section(true, Weights::Area);
    let repartitioned = section(true, Weights::Rebalance);
    let graded = section(false, Weights::Area);
    let mesh = section(false, Weights::Rebalance);
    vec![
        ("1-geometry.svg", draw(&[], "The facets in the root", crossing_only, "")),
        ("2-partition.svg", draw(&base_tree, "The initial partition, by facet area", by_rank, "")),
        (
            "3-refine.svg",
            draw(&base_tree, "The base tree T0; crossing leaves are grey", crossing_only, ""),
        ),
        (
            "4-repartition.svg",
            draw(&repartitioned, "The partition after refinement, by leaves", by_rank, ""),
        ),
        ("5-sides.svg", draw(&base_tree, "Sides of the leaves of T0", by_side, "")),
        ("6-gradation.svg", draw(&graded, "The graded tree: layers and 2:1 balance", by_side, "")),
        ("7-repartition.svg", draw(&mesh, "The partition after gradation, by leaves", by_rank, "")),
        (
            "8-leaves.svg",
            draw(&mesh, "The leaves in Morton order", |_| "#fff", &emission_order(&mesh)),
        ),
    ]
}

fn main() -> std::io::Result<()> {
    for (name, svg) in drawings() {
        std::fs::write(directory().join(name), svg)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn committed_drawings_are_those_of_this_mesher() {
        for (name, drawn) in drawings() {
            let path = directory().join(name);
            let committed = std::fs::read_to_string(&path).unwrap_or_default();
            assert!(
                committed == drawn,
                "{} is out of date: run cargo run -p mesher-library --example walkthrough, and look at the drawing",
                path.display()
            );
        }
    }

    #[test]
    fn leaf_counts_on_the_page_are_those_of_this_mesher() {
        let page = std::fs::read_to_string(directory().join("README.md")).expect("the page");
        let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
        for (ungraded, weights) in
            [(true, Weights::Area), (true, Weights::Rebalance), (false, Weights::Rebalance)]
        {
            let leaves: Vec<String> = leaves_by_rank(ungraded, weights)
                .iter()
                .map(|words| thousands(words.len()))
                .collect();
            let [a, b, c, d] = &leaves[..] else { panic!("the walk-through has four ranks") };
            let counts = format!("{a}, {b}, {c} and {d}");
            assert!(page.contains(&counts), "the page lacks the leaf counts {counts}");
        }
    }

    /// A number below a million with its digits in groups of three.
    fn thousands(n: usize) -> String {
        if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) }
    }
}
