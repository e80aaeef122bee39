use super::*;
use crate::testing::{in_root, on_disk, options};
use contract::testing::words_with_sides;
use contract::word::Side;
use std::collections::HashMap;
use std::fs;

/// Two facets at z = 3.3 through a root of edge 8, without the cells of edge 1 that they cross.
fn plate() -> (Case, Vec<u64>) {
    let corner = |x: f32, y: f32| [x, y, 3.3];
    let facets = vec![
        [corner(-1.0, -1.0), corner(9.0, -1.0), corner(9.0, 9.0)],
        [corner(-1.0, -1.0), corner(9.0, 9.0), corner(-1.0, 9.0)],
    ];
    let text = "spacing_min = 8.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0";
    let words =
        words_with_sides(|o| o.level < 3, |o| (o.corner[2] >> 16 != 3).then_some(Side::Outside));
    (Case::from_parts(text, facets).unwrap(), words)
}

#[test]
fn the_gap_to_a_plate_is_the_height_above_it() {
    let (case, words) = plate();
    let (dir, mesh) = in_root(&words, 2, |i| i / 256, case.root);
    let faces = front(&mesh, &Selection::default(), &options()).unwrap();
    let gaps = gaps(&case, &faces, &options()).unwrap();
    assert_eq!(faces.len(), 128);
    for (face, gap) in faces.iter().zip(&gaps) {
        let expected = if face.is_leaf_above() { 0.7 } else { 0.3 };
        assert!((gap - expected).abs() < 1e-6, "{gap} of {face:?}");
    }
    // Both sheets end at the root's boundary, along 32 edges each.
    let options = Options { case: Some(&case), ..options() };
    let path = dir.path().join("front.vtp");
    let summary = vtp(&mesh, &Selection::default(), &path, &options).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!((summary.leaves, summary.bytes), (128, text.len() as u64));
    assert!(summary.notes[0].starts_with("a surface of area 128, open at 64 edges"), "{summary:?}");
    for array in ["level", "side", "spacing", "gap"] {
        assert!(text.contains(&format!("Name=\"{array}\"")), "{array}");
    }
    let other = in_root(&words, 1, |_| 0, Root { edge: 4.0, ..case.root }).1;
    let refused = vtp(&other, &Selection::default(), &path, &options).unwrap_err();
    assert!(refused.to_string().contains("the mesh is not of the case"), "{refused}");
}

#[test]
fn the_triangles_of_a_file_are_as_closed_as_the_polygons() {
    // A hole of level 3 beside leaves of levels 2 and 3.
    let words = words_with_sides(
        |o| o.level < 2 || o.level < 3 && o.corner.iter().all(|&c| c >> 17 == 1),
        |o| (o.corner.iter().any(|&c| c >> 17 != 1 && c >> 17 != 2)).then_some(Side::Outside),
    );
    let (dir, mesh) = on_disk(&words, 1, |_| 0);
    let path = dir.path().join("front.stl");
    let summary = stl(&mesh, &Selection::default(), &path, &options()).unwrap();
    assert!(summary.notes[0].ends_with("closed"), "{summary:?}");
    let bytes = fs::read(path).unwrap();
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let (mut edges, mut volume) = (HashMap::<_, u32>::new(), 0.0);
    for facet in (84..bytes.len()).step_by(50) {
        let [a, b, c]: [[f32; 3]; 3] = std::array::from_fn(|v| {
            std::array::from_fn(|axis| number(facet + 12 + 12 * v + 4 * axis))
        });
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let (p, q) = (p.map(f32::to_bits), q.map(f32::to_bits));
            *edges.entry((p.min(q), p.max(q))).or_default() += 1;
        }
        volume += (0..3)
            .map(|x| a[x] * (b[(x + 1) % 3] * c[(x + 2) % 3] - b[(x + 2) % 3] * c[(x + 1) % 3]))
            .sum::<f32>()
            / 6.0;
    }
    assert!(edges.values().all(|count| count % 2 == 0));
    assert!((volume - 0.125).abs() < 1e-6, "{volume}");
}
