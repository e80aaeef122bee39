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
    let facets = [2.0 * edge + 1.0, -edge - 1.0].map(|x| error(&move |c| c.facets[1][2][0] = x));
    assert!(facets.iter().all(|e| matches!(e, Error::VertexOutside { facet: 1, .. })));
    for x in [f64::NAN, f64::INFINITY] {
        let error = error(&|c| c.facets[1][2][0] = x);
        assert!(matches!(error, Error::VertexNotFinite { facet: 1, .. }));
    }
    // The product of 0 and an infinite scale is not a number.
    assert!(matches!(error(&|c| c.root.edge = 1e-310), Error::VertexNotFinite { facet: 0, .. }));
    let mut limit = valid.clone();
    limit.facets[1][2] = [2.0 * edge, -edge, 0.0];
    mesh(&limit).unwrap();

    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(error(&|c| c.spacing_min = spacing), Error::Spacing { .. }));
        assert!(matches!(error(&|c| c.root.edge = spacing), Error::RootEdge(_)));
    }
    let too_fine = error(&|c| c.spacing_min = 255.9);
    assert!(
        matches!(too_fine, Error::SpacingTooFine { least, .. } if least == edge / 2f64.powi(19))
    );
    assert!(matches!(error(&|c| c.root.origin[1] = f64::NAN), Error::RootOrigin(_)));
    assert!(matches!(error(&|c| c.layer_cells_min = 0), Error::LayerCells));
    let boxed = |min, max, spacing| error(&move |c| c.boxes = vec![BoxSpec { min, max, spacing }]);
    assert!(matches!(boxed([0.0; 3], [1.0, 1.0, 0.0], 1e6), Error::BoxCorners { index: 0, .. }));
    assert!(matches!(boxed([0.0; 3], [f64::INFINITY; 3], 1e6), Error::BoxCorners { .. }));
    assert!(matches!(boxed([0.0; 3], [1.0; 3], 1.0), Error::SpacingTooFine { .. }));
    // At level 19.
    let too_many = boxed([0.0; 3], [edge; 3], 256.0);
    assert!(matches!(too_many, Error::TooManyCells { index: 0, cells } if cells == 2f64.powi(57)));
    assert!(too_many.to_string().contains("1.4e17 cells") && too_many.exit_code() == 71);
    let octant = boxed([edge / 2.0; 3], [edge; 3], 256.0);
    assert!(matches!(octant, Error::TooManyCells { cells, .. } if cells == 2f64.powi(54)));
}
