#![allow(missing_docs)]
use vtkhdf::tree::*;
use vtkhdf::write::Deflater;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let depth: u32 = std::env::args().nth(2).unwrap().parse().unwrap();
    // level 0 root, level 1 8 nodes, of which nodes 0 and 7 split.
    let shape = if depth == 1 {
        Shape { origin: [0.0; 3], edge: 1.0, nodes: vec![1] }
    } else {
        Shape { origin: [-1.0, 0.0, 2.0], edge: 4.0, nodes: vec![1, 8, 16] }
    };
    let mut w = Window::new(0, true);
    if depth == 1 {
        w.put_root(Siblings { crossing: 1, ..Default::default() }, 3);
    } else {
        w.put_root(Siblings { split: 1, ..Siblings::default() }, 0);
        w.put(0, Siblings { split: 0b1000_0001, deleted: 2, crossing: 4, inside: 8 }, 1);
        w.put(1, Siblings { split: 0, deleted: 0, crossing: 0xf0, inside: 0 }, 2);
        w.put(2, Siblings { split: 0, deleted: 0x80, crossing: 0, inside: 1 }, 3);
    }
    let file = std::fs::File::create(path).unwrap();
    let mut out = TreeWriter::new(file, shape.clone(), true).unwrap();
    let chunks = w.compress(&shape, &mut Deflater::default());
    out.add(0, chunks.iter().map(|c| c.as_deref())).unwrap();
    out.finish().unwrap();
}
