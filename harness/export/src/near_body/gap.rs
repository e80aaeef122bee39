//! The gap between a front and the wall: the distance from each face to the nearest facet.
//!
//! Distances are those of the facets on the lattice, on which the mesh was made; a vertex is at most half a lattice unit along each axis
//! from where the user put it. The least distance of a face is positive, because no facet touches a leaf on a side.

use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::UNITS_PER_CELL;
use geometry::tree::{FacetTree, Point};

use super::front::Face;
use contract::failure::Failure;

/// The distances of a face from the wall, in the user's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Least distance of any point of the face.
    pub least: f64,
    /// Distance of its centre.
    pub centre: f64,
}

/// The gap of each face; infinite if the case has no facets.
///
/// # Errors
/// The first error of `check`, which is called from time to time.
pub fn gaps(
    case: &Case,
    faces: &[Face],
    check: &dyn Fn() -> Result<(), Failure>,
) -> Result<Vec<Gap>, Failure> {
    let facets = FacetTree::new(&case.facets_lattice);
    let unit = case.root.edge / UNITS_PER_EDGE as f64;
    let mut gaps = Vec::with_capacity(faces.len());
    for (index, face) in faces.iter().enumerate() {
        if index % (1 << 12) == 0 {
            check()?;
        }
        let units = |c| (i64::from(c) * UNITS_PER_CELL) as f64;
        let corners = face.corners().map(|corner| Point::from(corner.map(units)));
        let centre = facets.distance(corners[0].midpoint(corners[2]));
        let least = facets.distance_of_square(&corners);
        gaps.push(Gap { least: least * unit, centre: centre * unit });
    }
    Ok(gaps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::near_body::files;
    use crate::near_body::front::front;
    use crate::near_body::polygons::Polygons;
    use crate::near_body::report::Report;
    use crate::selection::Selection;
    use crate::testing::{in_root, on_disk};
    use contract::lattice::Root;
    use contract::testing::words_with_sides;
    use contract::word::Side;
    use std::collections::HashMap;

    /// Two facets at z = 3.3 through a root of edge 8, without the cells of edge 1 that they cross.
    fn plate() -> (Case, Vec<u64>) {
        let corner = |x: f32, y: f32| [x, y, 3.3];
        let facets = vec![
            [corner(-1.0, -1.0), corner(9.0, -1.0), corner(9.0, 9.0)],
            [corner(-1.0, -1.0), corner(9.0, 9.0), corner(-1.0, 9.0)],
        ];
        let text = "spacing_min = 8.0\n[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0";
        let words = words_with_sides(
            |o| o.level < 3,
            |o| (o.corner[2] >> 16 != 3).then_some(Side::Outside),
        );
        (Case::from_parts(text, facets).unwrap(), words)
    }

    #[test]
    fn the_gap_to_a_plate_is_the_height_above_it() {
        let (case, words) = plate();
        let (_dir, mesh) = in_root(&words, 2, |i| i / 256, case.root);
        let faces = front(&mesh, &Selection::default(), &|| Ok(())).unwrap();
        let gaps = gaps(&case, &faces, &|| Ok(())).unwrap();
        assert_eq!(faces.len(), 128);
        for (face, gap) in faces.iter().zip(&gaps) {
            let expected = if face.is_leaf_above { 0.7 } else { 0.3 };
            assert!((gap.least - expected).abs() < 1e-6 && (gap.centre - expected).abs() < 1e-6);
        }
        let polygons = Polygons::new(&faces);
        let report = Report::new(&mesh, &faces, &polygons, Some(&gaps), true).unwrap();
        let ranks = report.ranks.as_ref().unwrap();
        let gap = report.gap.as_ref().unwrap();
        for (found, expected) in [
            (gap["least"].min, 0.3),
            (gap["least_cells"].max, 0.7),
            (gap["centre"].p95, 0.7),
            (report.area, 128.0),
            (ranks.lambda_faces, 80.0 / 64.0),
            (ranks.lambda_cells, 1.0 + 64.0 / 448.0),
        ] {
            assert!((found - expected).abs() < 1e-6, "{found} is not {expected}: {report:?}");
        }
        // Both sheets end at the root's boundary, along 32 edges each.
        assert_eq!((report.edges_open, report.faces_by_level[3]), (64, 128));
        let text = report.to_string();
        assert!(text.contains("128 faces") && text.contains("open at 64 edges"), "{text}");
    }

    #[test]
    fn a_case_of_another_mesh_is_refused() {
        let (case, words) = plate();
        let mesh = |root| in_root(&words, 1, |_| 0, root).1;
        let check = |mesh: Mesh| mesh.require_case(&case);
        assert!(check(mesh(case.root)).is_ok());
        let other = mesh(Root { edge: 4.0, ..case.root });
        assert!(check(other).unwrap_err().to_string().contains("the mesh is not of the case"));
    }

    #[test]
    fn the_triangles_of_a_file_are_as_closed_as_the_polygons() {
        // A hole of level 3 beside leaves of levels 2 and 3.
        let words = words_with_sides(
            |o| o.level < 2 || o.level < 3 && o.corner.iter().all(|&c| c >> 17 == 1),
            |o| (o.corner.iter().any(|&c| c >> 17 != 1 && c >> 17 != 2)).then_some(Side::Outside),
        );
        let (_dir, mesh) = on_disk(&words, 1, |_| 0);
        let faces = front(&mesh, &Selection::default(), &|| Ok(())).unwrap();
        let polygons = Polygons::new(&faces);
        let mut bytes = Vec::new();
        files::stl(&mesh.manifest.root, &faces, &polygons, &mut bytes).unwrap();
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
        let mut text = Vec::new();
        files::vtp(&mesh.manifest.root, &faces, &polygons, None, true, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.contains("PolyData") && text.contains("Name=\"rank\""));
    }
}
