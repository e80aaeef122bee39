//! A cause is checked by meshing without it. With `keep = "all"` a split has a sufficient cause among single facets and
//! boxes: the mesh of that facet or box alone has the split. Removing all sufficient ones removes the split.

use super::*;
use contract::octant::Octant;
use contract::word;

/// Whether the leaves split an octant.
fn splits(words: &[u64], octant: &Octant) -> bool {
    words
        .iter()
        .map(|&w| word::octant(w))
        .any(|leaf| leaf.level > octant.level && octant.contains(&leaf))
}

/// The facets and boxes of a case in which everything is kept.
struct Inputs {
    level: i32,
    n: u32,
    facets: Vec<Facet>,
    boxes: Vec<String>,
}

impl Inputs {
    /// The case of some of the facets and boxes.
    fn made(&self, facets: impl Fn(usize) -> bool, boxes: impl Fn(usize) -> bool) -> SelftestCase {
        let spacing = 16.0 * 0.5f64.powi(self.level);
        let n = self.n;
        let mut text =
            format!("spacing_min = {spacing:?}\nlayer_cells_min = {n}\nkeep = 'all'\n{ROOT}");
        (0..self.boxes.len()).filter(|&b| boxes(b)).for_each(|b| text += &self.boxes[b]);
        let facets = (0..self.facets.len()).filter(|&f| facets(f)).map(|f| self.facets[f]);
        super::made(&text, &facets.collect::<Vec<_>>())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_split_disappears_with_its_sufficient_causes_and_each_reported_one_is_sufficient(
        level in 3i32..=5, n in 1u32..=4, facets in soup(1..4), boxes in boxes(0..2, 6),
        picks in prop::collection::vec(any::<prop::sample::Index>(), 4),
    ) {
        let inputs = Inputs { level, n, facets, boxes };
        let correct = inputs.made(|_| true, |_| true);
        // The meshes of single facets and of single boxes.
        let facet_alone: Vec<Vec<u64>> =
            (0..inputs.facets.len()).map(|f| inputs.made(|i| i == f, |_| false).mesh.words).collect();
        let box_alone: Vec<Vec<u64>> =
            (0..inputs.boxes.len()).map(|b| inputs.made(|_| false, |i| i == b).mesh.words).collect();
        let answers = with_mesh(&correct.mesh, Some(&correct.case), |mesh| {
            let leaf = |pick: &prop::sample::Index| word::octant(*pick.get(&correct.mesh.words));
            let centre = |octant: Octant| correct.case.root.to_user(octant.centre());
            picks.iter().map(|pick| mesh.at(centre(leaf(pick))).unwrap()).collect::<Vec<_>>()
        });
        for split in answers.iter().flat_map(|answer| &answer.split) {
            let octant = &split.octant;
            let cause = split.cause.as_ref().unwrap();
            prop_assert!(!cause.facets.is_empty() || !cause.boxes.is_empty());
            for &facet in &cause.facets {
                prop_assert!(splits(&facet_alone[facet as usize], octant), "facet {facet}: {split:#?}");
            }
            for &b in &cause.boxes {
                prop_assert!(splits(&box_alone[b], octant), "box {b}: {split:#?}");
            }
            let rest = inputs.made(|f| !splits(&facet_alone[f], octant), |b| !splits(&box_alone[b], octant));
            prop_assert!(!splits(&rest.mesh.words, octant), "{split:#?}");
        }
    }
}
