//! temporary
#![allow(missing_docs)]
use check::geometry::boxes::Boxes;
use check::geometry::edges::Edges;
use check::geometry::input::{Input, Requested};
use check::geometry::shells::Shells;
use check::geometry::sheets::sheets;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let body = contract::stl::read(std::path::Path::new(&args[1])).unwrap();
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for v in body.facets.as_flattened() { for a in 0..3 { low[a] = low[a].min(v[a]); high[a] = high[a].max(v[a]); } }
    let length = (0..3).map(|a| f64::from(high[a] - low[a])).fold(0.0, f64::max);
    let facets = body.facets;
    let input = Input::new(facets.clone(), &Requested { spacing_min: Some(0.1), root: None, root_scale: None }).unwrap();
    let edges = Edges::new(&input.facets);
    let shells = Shells::new(&edges, &input.lattice);
    let t = Instant::now();
    let boxes = Boxes::by_normal(&input.lattice);
    println!("tree {:?} nodes {}", t.elapsed(), boxes.nodes());
    for h in &args[2..] {
        let h: f64 = h.parse().unwrap();
        let input = Input::new(facets.clone(), &Requested { spacing_min: Some(h * length), root: None, root_scale: None }).unwrap();
        let t = Instant::now();
        let f = sheets(&input, (&edges, &shells), &boxes, input.cell.unwrap(), 5);
        println!("{h} {:?} walls {} {:?} gaps {} {:?}", t.elapsed(), f[0].count, f[0].places.first().map(|p| p.width), f[1].count, f[1].places.first().map(|p| p.width));
    }
}
