//! Thin sheets, compared with all pairs of facets.

use check::geometry::boxes::unit_normal;
use check::geometry::distance::{cross, dot, length, nearest, sub};
use check::geometry::edges::Edges;
use check::geometry::finding::Kind;
use check::geometry::input::{Input, Requested};
use check::geometry::intersections::{Relation, relation};
use check::geometry::narrowest::Narrowest;
use check::geometry::pairs::Pairs;
use check::geometry::patches::Patches;
use check::geometry::settled::Settled;
use check::geometry::shells::Shells;
use check::geometry::{Options, diagnose};
use contract::case::Facet;
use contract::lattice::UNITS_PER_EDGE;
use geometries::{Generator, Shape};
use proptest::prelude::*;
use proptest::strategy::ValueTree;

use super::{ROOT, shape};

/// The distance of two facets and their side, by the definition.
fn distance(input: &Input, f: usize, g: usize) -> Option<(f64, usize)> {
    let [a, b] = [f, g].map(|i| &input.lattice[i]);
    let [n, m] = [a, b].map(unit_normal);
    if dot(n, m) > -0.5 {
        return None;
    }
    let [p, q] = [a, b].map(|t| t.map(|v| v.map(|c| c as f64)));
    let (squared, p, q) = nearest(&p, &q);
    let line = sub(q, p).map(|x| x / squared.sqrt());
    let (of_f, of_g) = (dot(line, n), -dot(line, m));
    let shares_vertex = input.facets[f].iter().any(|v| input.facets[g].contains(v));
    let is_opposite = of_f.abs().min(of_g.abs()) >= 0.5
        && of_f * of_g > 0.0
        && !shares_vertex
        && relation(a, b, true) == Relation::Disjoint;
    let unit = ROOT.edge / UNITS_PER_EDGE as f64;
    is_opposite.then_some((squared.sqrt() * unit, usize::from(of_f > 0.0)))
}

/// For walls and for gaps: the number of facets, and the widths of the pairs of a facet and its nearest opposite one.
fn all_pairs(input: &Input) -> [(u64, Vec<f64>); 2] {
    let facets = input.facets.len();
    [0, 1].map(|side| {
        let nearest_of = |f: usize| {
            let others = (0..facets).filter(|&g| g != f);
            let opposite = others.filter_map(|g| Some((distance(input, f.min(g), f.max(g))?, g)));
            let thin = opposite.filter(|((d, s), _)| *s == side && *d < input.cell.unwrap());
            thin.min_by(|a, b| a.0.0.total_cmp(&b.0.0)).map(|((d, _), g)| (d, f.min(g), f.max(g)))
        };
        let mut found: Vec<(f64, usize, usize)> = (0..facets).filter_map(nearest_of).collect();
        let count = found.len() as u64;
        found.sort_by(|a, b| a.partial_cmp(b).unwrap());
        found.dedup();
        (count, found.into_iter().map(|(d, _, _)| d).collect())
    })
}

fn compare(facets: Vec<Facet>, spacing: f64, firsts: &[usize]) -> Result<u64, TestCaseError> {
    let requested = Requested { spacing_min: Some(spacing), root: Some(ROOT), root_scale: None };
    let input = Input::new(facets, &requested).unwrap();
    let expected = all_pairs(&input);
    for &first in firsts {
        let found = diagnose(&input, &Options { intersections: false, first });
        for (kind, (count, widths)) in [Kind::ThinWalls, Kind::ThinGaps].iter().zip(&expected) {
            let finding = found.finding(*kind).unwrap();
            prop_assert_eq!(finding.count, *count);
            prop_assert_eq!(finding.places.len(), widths.len().min(first));
            for (place, width) in finding.places.iter().zip(widths) {
                prop_assert!((place.width.unwrap() - width).abs() <= 1e-9 * width);
            }
        }
    }
    Ok(expected[0].0 + expected[1].0)
}

/// A facet and, by chance, one that is nearly parallel to it and has the opposite normal.
fn facets() -> impl Strategy<Value = Vec<Facet>> {
    let point = |size: f64| prop::array::uniform3(-size..size);
    let corners = prop::array::uniform3(point(0.5));
    (point(2.0), corners, prop::option::of((-0.8..0.8, prop::array::uniform3(point(0.1)))))
        .prop_map(|(at, corners, partner)| {
            let moved = corners.map(|v| sub(v, at));
            let n = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
            let opposite = partner.map(|(height, jitter)| {
                let shift = n.map(|x| x / length(n) * height);
                let v = |i: usize| std::array::from_fn(|a| moved[i][a] + shift[a] + jitter[i][a]);
                [v(0), v(2), v(1)]
            });
            let single = |facet: [[f64; 3]; 3]| facet.map(|v| v.map(|x| x as f32));
            [Some(moved), opposite].into_iter().flatten().map(single).collect()
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn sheets_of_random_facets_are_those_of_all_pairs(
        facets in prop::collection::vec(facets(), 1..50), spacing in 0.2f64..2.0
    ) {
        compare(facets.concat(), spacing, &[1, 3, usize::MAX])?;
    }

    /// Facets with common vertices are often equally far from a third one, and any of them may be listed, so only the narrowest
    /// place is certain.
    #[test]
    fn sheets_of_closed_shapes_are_those_of_all_pairs(facets in shape(), spacing in 0.1f64..2.0) {
        let facets = facets.into_iter().take(100).collect();
        compare(facets, spacing, &[1])?;
    }
}

#[test]
fn most_random_facets_have_sheets() {
    // Otherwise the comparison above would compare nothing.
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let strategy = prop::collection::vec(facets(), 40);
    let sheets = |_| {
        let facets = strategy.new_tree(&mut runner).unwrap().current().concat();
        compare(facets, 1.0, &[1]).unwrap()
    };
    assert!((0..4).map(sheets).sum::<u64>() > 80);
}

/// The work of both searches: pairs of nodes and of facets examined by each.
#[test]
fn the_searches_examine_as_few_pairs_as_ever() {
    let examined = |shape: Shape, facets: usize, spacing: f64| {
        let centre = Some([0.01, 0.02, 0.03]);
        let facets = Generator { centre, ..Generator::new(shape, facets) }.facets().unwrap();
        let turned = facets.iter().map(|facet| {
            facet.map(|[x, y, z]| {
                // By an angle with the sine 0.6, about two axes.
                let [x, y] = [0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y];
                [x, 0.8 * y - 0.6 * z, 0.6 * y + 0.8 * z]
            })
        });
        let requested =
            Requested { spacing_min: Some(spacing), root: Some(ROOT), root_scale: None };
        let input = Input::new(turned.collect(), &requested).unwrap();
        let edges = Edges::new(&input.facets);
        let shells = Shells::new(&edges, &input.lattice);
        let patches = Patches::new(&input.lattice, &shells);
        let unit = ROOT.edge / UNITS_PER_EDGE as f64;
        let limit = (input.cell.unwrap() / unit).powi(2);
        let pairs =
            Pairs { input: &input, edges: &edges, shells: &shells, patches: &patches, limit };
        let settled = Settled::new(&pairs, 5);
        let narrowest = Narrowest::new(&pairs, &settled, 5);
        [settled.examined, narrowest.examined]
    };
    assert_eq!(examined(Shape::Sphere, 5_120, 0.1), [[480, 0], [1, 0]]);
    assert_eq!(examined(Shape::Sphere, 1_280, 4.0), [[3402, 1829], [24_394, 43_105]]);
    assert_eq!(examined(Shape::NestedSpheres, 2_560, 0.5), [[21_810, 8662], [30_644, 20_565]]);
    assert_eq!(examined(Shape::Torus, 4_000, 1.0), [[44_918, 16_450], [65_600, 49_807]]);
    assert_eq!(examined(Shape::Pipe, 2_000, 0.5), [[5140, 2889], [14_912, 21_711]]);
}
