use super::*;
use proptest::prelude::*;

fn facet() -> impl Strategy<Value = FacetLattice> {
    let corner = || prop::array::uniform3(-50i64..50);
    let any = prop::array::uniform3(corner());
    prop_oneof![9 => any, 1 => (corner(), corner()).prop_map(|(a, b)| [a, b, a])]
}

fn facets() -> impl Strategy<Value = Vec<FacetLattice>> {
    prop::collection::vec(facet(), 1..80)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|x| a[x] * b[x]).sum()
}

proptest! {
    #[test]
    fn every_node_encloses_its_facets_and_each_facet_is_in_one_group(lattice in facets()) {
        let with_area: Vec<u32> = (0..lattice.len() as u32).filter(|&i| !is_degenerate(&lattice[i as usize])).collect();
        for (boxes, expected) in [
            (Boxes::new(&lattice), with_area.clone()),
            (Boxes::by_normal(&lattice), with_area),
            (Boxes::of_all(&lattice), (0..lattice.len() as u32).collect()),
        ] {
            let mut sorted = boxes.facets.clone();
            sorted.sort_unstable();
            prop_assert_eq!(sorted, expected);
            let mut at = 0;
            for (_, members) in boxes.groups() {
                prop_assert!(members.start == at && members.len() <= GROUP);
                at = members.end;
            }
            prop_assert_eq!(at, boxes.facets.len());
            for node in 0..boxes.nodes() {
                let members = boxes.members(node);
                for axis in 0..3 {
                    let facets = || members.clone().map(|i| lattice[boxes.facets[i] as usize]);
                    let coordinates = || facets().flat_map(|facet| facet.map(|v| v[axis]));
                    if let (Some(low), Some(high)) = (coordinates().min(), coordinates().max()) {
                        let bounds = boxes.bounds(node);
                        prop_assert_eq!([i64::from(bounds.low[axis]), i64::from(bounds.high[axis])], [low, high]);
                    }
                }
                if let Some([a, b]) = boxes.children(node) {
                    let [a, b] = [a, b].map(|child| boxes.members(child));
                    prop_assert!(a.start == members.start && a.end == b.start && b.end == members.end);
                    prop_assert!(!a.is_empty() && !b.is_empty() && members.len() > GROUP);
                }
            }
        }
    }

    #[test]
    fn bounds_of_two_facets_bound_their_distance_heights_and_normals(f in facet(), g in facet()) {
        let (a, b) = (Bounds::of(&f), Bounds::of(&g));
        let gap = |x: usize| {
            let [[al, ah], [bl, bh]] = [&f, &g].map(|t| [t.iter().map(|v| v[x]).min().unwrap(), t.iter().map(|v| v[x]).max().unwrap()]);
            if bl > ah { bl - ah } else if al > bh { al - bh } else { 0 }
        };
        let squared = (0..3).map(|x| gap(x) * gap(x)).sum::<i64>() as f64;
        prop_assert_eq!(a.distance_squared(&b), squared);
        prop_assert_eq!(a.distance_squared_to_box(b.low.map(f64::from), b.high.map(f64::from)), squared);
        prop_assert_eq!(a.overlaps(&b), squared == 0.0);
        let (n, m) = (unit_normal(&f), unit_normal(&g));
        let cosine = f64::from(a.cosine_min(&b));
        prop_assert!(cosine <= dot(n, m) + 1e-6 && cosine >= dot(n, m) - 1e-5);
        let (lowest, highest) = a.height_range(&b);
        let corner = |bounds: &Bounds, i: usize| -> [f64; 3] {
            std::array::from_fn(|x| f64::from(if i >> x & 1 == 1 { bounds.high[x] } else { bounds.low[x] }))
        };
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..64 {
            let (p, q) = (corner(&a, i & 7), corner(&b, i >> 3));
            let height = dot(std::array::from_fn(|x| q[x] - p[x]), n);
            (least, greatest) = (least.min(height), greatest.max(height));
        }
        // Bounds on the normal are rounded outward.
        prop_assert!(lowest <= least && lowest > least - 1e-3 && highest >= greatest && highest < greatest + 1e-3);
        let length = dot(n, n);
        prop_assert!((length - f64::from(u8::from(!is_degenerate(&f)))).abs() < 1e-9);
    }

    #[test]
    fn a_search_enters_every_node_that_it_may_nearer_children_first(lattice in facets(), to in prop::array::uniform3(-60.0f64..60.0)) {
        let boxes = Boxes::of_all(&lattice);
        let order = |bounds: &Bounds| bounds.distance_squared_to_box(to, to);
        let (mut entered, mut members) = (0, Vec::new());
        let mut first_leaf = None;
        boxes.search(
            |bounds, of_leaf| {
                entered += 1;
                if of_leaf.is_some() {
                    first_leaf.get_or_insert(order(bounds));
                }
                members.extend(of_leaf.into_iter().flatten());
                true
            },
            order,
        );
        members.sort_unstable();
        prop_assert_eq!((entered, members), (boxes.nodes(), (0..boxes.facets.len()).collect()));
        let mut node = 0;
        while let Some([a, b]) = boxes.children(node) {
            node = if order(boxes.bounds(a)) <= order(boxes.bounds(b)) { a } else { b };
        }
        prop_assert_eq!(first_leaf, Some(order(boxes.bounds(node))));
        let mut visits = 0;
        boxes.search(|_, _| { visits += 1; false }, order);
        prop_assert_eq!(visits, 1);
    }
}

#[test]
fn the_direction_is_the_axis_of_the_longest_component_and_its_sign() {
    let square = |axis: usize, sign: i64| -> FacetLattice {
        let mut facet = [[0; 3]; 3];
        facet[1][(axis + 1) % 3] = 4;
        facet[2][(axis + 2) % 3] = 4 * sign;
        facet
    };
    for axis in 0..3 {
        assert_eq!(direction(&square(axis, 1)), 2 * axis as u8 + 1);
        assert_eq!(direction(&square(axis, -1)), 2 * axis as u8);
    }
    assert_eq!(direction(&[[0, 0, 0], [9, 0, 1], [0, 9, 1]]), 5);
    assert_eq!(direction(&[[0, 0, 0], [0, 9, 1], [9, 0, 1]]), 4);
    assert_eq!(direction(&[[0, 0, 0], [1, 9, 0], [1, 0, 9]]), 1);
}
