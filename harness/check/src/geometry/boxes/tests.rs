use super::*;
use proptest::prelude::*;

fn facet() -> impl Strategy<Value = FacetLattice> {
    let corner = || prop::array::uniform3(-50i64..50);
    let any = prop::array::uniform3(corner());
    let small = (corner(), prop::array::uniform3(prop::array::uniform3(-2i64..2)))
        .prop_map(|(at, corners)| corners.map(|v| [0, 1, 2].map(|a| at[a] + v[a])));
    prop_oneof![5 => any, 4 => small, 1 => (corner(), corner()).prop_map(|(a, b)| [a, b, a])]
}

fn facets() -> impl Strategy<Value = Vec<FacetLattice>> {
    prop::collection::vec(facet(), 1..80)
}

/// Whether facets are within six times the largest of them, by the sums of the edges of bounding boxes.
fn is_compact(facets: &[Bounds]) -> bool {
    let end =
        |f: fn(&Bounds, usize) -> i32| (0..3).map(move |a| facets.iter().map(move |b| f(b, a)));
    let low = end(|b, a| b.low[a]).map(|ends| ends.min().unwrap());
    let high = end(|b, a| b.high[a]).map(|ends| ends.max().unwrap());
    let size = |b: &Bounds| (0..3).map(|a| b.high[a] - b.low[a]).sum::<i32>();
    high.sum::<i32>() - low.sum::<i32>() <= 6 * facets.iter().map(size).max().unwrap()
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
            (Boxes::by_class(&lattice, |facet| facet[0][0].rem_euclid(5) as u16), with_area),
            (Boxes::of_all(&lattice), (0..lattice.len() as u32).collect()),
        ] {
            let mut sorted = boxes.facets.clone();
            sorted.sort_unstable();
            prop_assert_eq!(sorted, expected);
            let mut at = 0;
            for (_, members) in boxes.groups() {
                prop_assert!(members.start == at && members.len() <= GROUP);
                prop_assert!(members.len() < 2 || is_compact(&boxes.bounds[members.clone()]));
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
                    prop_assert!(!a.is_empty() && !b.is_empty());
                    prop_assert!(members.len() > GROUP || !is_compact(&boxes.bounds[members]));
                }
            }
        }
    }

    #[test]
    fn bounds_of_two_facets_bound_their_distance_and_normals_have_unit_length(f in facet(), g in facet()) {
        let (a, b) = (Bounds::of(&f), Bounds::of(&g));
        let gap = |x: usize| {
            let [[al, ah], [bl, bh]] = [&f, &g].map(|t| [t.iter().map(|v| v[x]).min().unwrap(), t.iter().map(|v| v[x]).max().unwrap()]);
            if bl > ah { bl - ah } else if al > bh { al - bh } else { 0 }
        };
        let squared = (0..3).map(|x| gap(x) * gap(x)).sum::<i64>() as f64;
        prop_assert_eq!(a.distance_squared_to_box(b.low.map(f64::from), b.high.map(f64::from)), squared);
        prop_assert_eq!(a.overlaps(&b), squared == 0.0);
        let n = unit_normal(&f);
        prop_assert!((dot(n, n) - f64::from(u8::from(!is_degenerate(&f)))).abs() < 1e-9);
    }

    #[test]
    fn a_search_enters_every_node_that_it_may_nearer_children_first(lattice in facets(), to in prop::array::uniform3(-60.0f64..60.0)) {
        let boxes = Boxes::of_all(&lattice);
        let order = |bounds: &Bounds| bounds.distance_squared_to_box(to, to);
        let (mut entered, mut members) = (0, Vec::new());
        let mut first_leaf = None;
        boxes.search(
            |bounds, at, of_leaf| {
                entered += 1;
                assert_eq!(at, order(bounds));
                if of_leaf.is_some() {
                    first_leaf.get_or_insert(at);
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
        boxes.search(|_, _, _| { visits += 1; false }, order);
        prop_assert_eq!(visits, 1);
    }
}
