//! Invalid cases: each kind has its own error, and the limits of valid values are exact.
use crate::support;

use reference::{BoxSpec, Case, Error, mesh};
use support::{ROOT_EDGE, case};

#[test]
fn each_invalid_input_has_its_own_error() {
    let valid = case(&[[[0; 3]; 3], [[1; 3]; 3]], 3);
    let error = |change: &dyn Fn(&mut Case)| {
        let mut invalid = valid.clone();
        change(&mut invalid);
        mesh(&invalid).unwrap_err()
    };
    let edge = ROOT_EDGE as f64;
    let refused = |error: Error, part: &str| {
        assert!(matches!(&error, Error::Invalid(why) if why.contains(part)), "{error}: not {part}");
    };
    for x in [2.0 * edge + 1.0, -edge - 1.0] {
        refused(error(&|c| c.facets[1][2][0] = x), "facet 1 has a vertex [");
        refused(error(&|c| c.facets[1][2][0] = x), "more than one root edge outside the root");
    }
    for x in [f64::NAN, f64::INFINITY] {
        let error = error(&|c| c.facets[1][2][0] = x);
        assert!(error.to_string().starts_with("facet 1 has a vertex ["), "{error}");
        refused(error, "that is not finite");
    }
    // The product of 0 and an infinite scale is not a number.
    refused(error(&|c| c.root.edge = 1e-310), "facet 0 has a vertex [0.0, 0.0, 0.0] that is not");
    let mut limit = valid.clone();
    limit.facets[1][2] = [2.0 * edge, -edge, 0.0];
    mesh(&limit).unwrap();

    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let must = format!("is {spacing}: it must be finite and greater than 0");
        refused(error(&|c| c.spacing_min = spacing), &format!("spacing_min {must}"));
        refused(error(&|c| c.root.edge = spacing), &format!("the root's edge {must}"));
    }
    let least = edge / 2f64.powi(19);
    let too_fine = format!("spacing_min is 255.9, less than {least}, the cell edge");
    refused(error(&|c| c.spacing_min = 255.9), &too_fine);
    refused(error(&|c| c.root.origin[1] = f64::NAN), "the root's origin [");
    refused(error(&|c| c.layer_cells_min = 0), "layer_cells_min is 0");
    let boxed = |min, max, spacing| error(&move |c| c.boxes = vec![BoxSpec { min, max, spacing }]);
    for max in [[1.0, 1.0, 0.0], [f64::INFINITY; 3]] {
        refused(boxed([0.0; 3], max, 1e6), "box 0 extends from");
    }
    refused(boxed([0.0; 3], [1.0; 3], 1.0), "the spacing of box 0 is 1, less than");
    // At level 19.
    let too_many = boxed([0.0; 3], [edge; 3], 256.0);
    assert!(matches!(too_many, Error::TooManyCells { index: 0, cells } if cells == 2f64.powi(57)));
    assert!(too_many.to_string().contains("1.4e17 cells") && too_many.exit_code() == 71);
    let octant = boxed([edge / 2.0; 3], [edge; 3], 256.0);
    assert!(matches!(octant, Error::TooManyCells { cells, .. } if cells == 2f64.powi(54)));
}
