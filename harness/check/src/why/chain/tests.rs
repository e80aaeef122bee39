use super::*;
use geometries::Facet;

#[path = "../../../tests/checks/support.rs"]
#[allow(dead_code)]
mod support;

const ROOT: &str = "[root]\norigin = [-8.0, -8.0, -8.0]\nedge = 16.0\n";
const FACET: Facet = [[0.3, 0.2, 0.1], [0.31, 0.2, 0.1], [0.3, 0.21, 0.12]];

const BOX: &str = "[[box]]\nmin = [4.1, -3.0, 2.0]\nmax = [4.3, -2.8, 2.4]\nspacing = 0.5\n";

/// All octants that a mesh has split.
fn splits(mesh: &Mesh) -> Vec<Octant> {
    let mut found = vec![Octant::ROOT];
    let mut next = 0;
    while next < found.len() {
        let (octant, node) = (found[next], mesh.leaves.node(&found[next]));
        found.extend((0..8).filter(|d| node.split >> d & 1 == 1).map(|d| octant.child(d)));
        next += 1;
    }
    found
}

/// The links and the searches of the chains of all splits, and both if the order changes after two searches.
fn effort(settings: &str) -> [usize; 4] {
    let made = support::meshes_of_facets(&format!("{settings}{ROOT}"), &[FACET]).unwrap();
    let dir = tempfile::tempdir().unwrap();
    made.mesh.write(dir.path()).unwrap();
    let mesh = Mesh::open(dir.path(), Some(&made.case)).unwrap();
    let mut effort = [0; 4];
    for octant in splits(&mesh) {
        let mut left = usize::MAX;
        let shortest = mesh.chain(&octant, &mut left).expect("every split has a cause");
        assert!(shortest.is_shortest);
        let mut few = 2;
        let chain = mesh.chain(&octant, &mut few).expect("every split has a cause");
        assert!(chain.links.len() >= shortest.links.len());
        assert!(!chain.is_shortest || chain.links.len() == shortest.links.len());
        let not_proven = usize::from(!chain.is_shortest);
        let of_octant = [shortest.links.len(), usize::MAX - left, chain.links.len(), not_proven];
        effort.iter_mut().zip(of_octant).for_each(|(sum, of_octant)| *sum += of_octant);
    }
    effort
}

/// Bounds that are too low find the same chains, but later.
#[test]
fn chains_are_found_after_as_many_searches_as_expected() {
    let settings = |level: i32, n: u32, more: &str| {
        let spacing = 16.0 * 0.5f64.powi(level);
        format!("spacing_min = {spacing:?}\nlayer_cells_min = {n}\nkeep = 'all'\n{more}")
    };
    let found = [
        effort(&settings(6, 1, "")),
        effort(&settings(5, 2, "")),
        effort(&settings(5, 3, "")),
        effort(&settings(4, 4, "")),
        effort(&settings(5, 2, "keep_crossing = false\n")),
        effort(&settings(4, 3, BOX)),
    ];
    let expected = [
        [28, 28, 28, 0],
        [510, 1578, 510, 173],
        [510, 1218, 510, 117],
        [231, 268, 231, 0],
        [1022, 7407, 1022, 264],
        [380, 683, 383, 137],
    ];
    assert_eq!(found, expected);
}
