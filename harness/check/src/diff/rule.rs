//! Which rule of reference/DEFINITION.md decides between two meshes where they differ first, and for whom.
//!
//! Where one mesh has a leaf and the other has split it, the split must be asked for: by a facet or a box
//! (section 3), or by a leaf near enough (section 6). That leaf is the witness. A witness that both meshes have
//! settles the matter; one that only the split mesh has is itself in dispute, and the dispute is followed
//! to it. Gradation goes from fine to coarse, so this ends at the first difference in the definition's order.
//!
//! Sources that were deleted afterwards (crossing leaves where `keep_crossing` is false) are in neither mesh
//! and so can be no witnesses; the ruling says so where it matters.

use crate::checks::Terms;
use crate::checks::identical::describe;
use contract::case::Case;
use contract::manifest::Keep;
use contract::octant::Octant;
use contract::parity::Parity;
use contract::triangle::Triangle;
use contract::word::{self, Leaf, Side};

/// A dispute is followed so far: one step per level is the most that refinement can need.
const STEPS_MAX: usize = 20;

/// Two meshes, and what is known of what they should be.
pub struct Dispute<'a> {
    /// Words of mesh A, sorted.
    pub a: &'a [u64],
    /// Words of mesh B, sorted.
    pub b: &'a [u64],
    /// What was asked for.
    pub terms: &'a Terms,
    /// The case, where it is given.
    pub case: Option<&'a Case>,
}

/// Whose leaf it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    A,
    B,
}

impl Who {
    fn name(self) -> char {
        if self == Self::A { 'A' } else { 'B' }
    }

    fn other(self) -> Self {
        if self == Self::A { Self::B } else { Self::A }
    }
}

/// Why an octant must be split, or not.
enum Reason {
    /// Undisputed: the text.
    Settled(String),
    /// By a leaf that only the mesh with the split has.
    Disputed(String, Octant),
    /// Nothing asks for it.
    None,
}

impl Dispute<'_> {
    /// The rules that decide where these words, the first that differ, stand.
    pub fn rule(&self, a: Option<u64>, b: Option<u64>) -> Vec<String> {
        let leaf = |word: Option<u64>| word.map(word::decode).transpose();
        let (a, b) = match (leaf(a), leaf(b)) {
            (Ok(a), Ok(b)) => (a, b),
            _ => {
                return vec!["section 8: a word that is no leaf is wrong whatever the case".into()];
            }
        };
        match (a, b) {
            (Some(a), Some(b)) if a.octant == b.octant => vec![self.side(&a, &b)],
            (Some(a), Some(b)) if a.octant.contains(&b.octant) => self.split(Who::A, a),
            (Some(a), Some(b)) if b.octant.contains(&a.octant) => self.split(Who::B, b),
            (Some(a), Some(b)) if word::encode(&a) > word::encode(&b) => {
                vec![self.absence(Who::B, &b)]
            }
            (Some(a), _) => vec![self.absence(Who::A, &a)],
            (None, Some(b)) => vec![self.absence(Who::B, &b)],
            (None, None) => Vec::new(),
        }
    }

    /// One octant, two sides.
    fn side(&self, a: &Leaf, b: &Leaf) -> String {
        let Some(case) = self.case else {
            return "section 4: the side. Give the case file (--case) to have it decided".into();
        };
        if let Some(facet) = crossed_by(&a.octant, case) {
            let right = if a.side == Side::Crossing { "A" } else { "B" };
            return format!(
                "section 4: facet {facet} crosses it, so it is crossing: {right} is right"
            );
        }
        let votes = Parity::new(&case.facets_lattice).inside(a.octant.centre());
        let inside = votes.iter().filter(|&&vote| vote).count();
        let told = format!("section 4: no facet crosses it, and {inside} of its 6 rays say inside");
        let side = match inside {
            0 => Side::Outside,
            6 => Side::Inside,
            _ => return format!("{told}: an earlier candidate of its component decides"),
        };
        // A component's side is its first agreeing candidate's; only on a leak may another leaf's rays differ.
        let right = [(a, "A"), (b, "B")].into_iter().find(|(leaf, _)| leaf.side == side);
        match right {
            Some((_, name)) => format!("{told}: {name} is right, unless the surface leaks"),
            None => format!("{told}: neither is right, unless the surface leaks"),
        }
    }

    /// A leaf where the other mesh has nothing.
    fn absence(&self, who: Who, leaf: &Leaf) -> String {
        let (has, lacks, side) = (who.name(), who.other().name(), leaf.side);
        let keep = self.terms.keep;
        let kept = match side {
            Side::Crossing => self.terms.keep_crossing,
            Side::Outside => keep != Keep::Inside,
            Side::Inside => keep != Keep::Outside,
        };
        let keep = format!("{keep:?}").to_lowercase();
        match (side, kept) {
            (Side::Crossing, false) => {
                format!("section 7: keep_crossing is false, so {has} must not have a crossing leaf")
            }
            (_, false) => {
                format!("section 5: keep is {keep}, so {has} must not have a leaf that is {side}")
            }
            _ => format!(
                "section 5: keep is {keep}, so a leaf that is {side} stays; {lacks} has nothing there: it lost \
                 the leaf, or section 4 gave its component another side"
            ),
        }
    }

    /// A leaf that the other mesh has split, followed to what is undisputed.
    fn split(&self, who: Who, leaf: Leaf) -> Vec<String> {
        let (mut who, mut leaf) = (who, leaf);
        let mut told = Vec::new();
        let mut seen = vec![leaf.octant];
        for _ in 0..STEPS_MAX {
            let (coarse, fine) = (who.name(), who.other().name());
            let what = format!("{coarse} has the leaf {}, {fine} has split it", leaf.octant);
            match self.reason(who, &leaf) {
                Reason::Settled(why) => told.push(format!("{what}: {why}: {fine} is right")),
                Reason::None => told.push(format!(
                    "{what}: nothing in either mesh asks for that, and refinement is least (sections 3 and 6): {coarse} \
                     is right{}", self.caveat()
                )),
                Reason::Disputed(why, witness) => {
                    told.push(format!("{what}: {why}, which {coarse} does not have"));
                    // What the other mesh has there: a coarser leaf, or finer ones.
                    let next = match self.holder(who, &witness) {
                        Some(next) => Some((who, next)),
                        None => self.holder(who.other(), &witness).filter(|_| self.has_within(who, &witness)).map(|next| (who.other(), next)),
                    };
                    let Some((whose, next)) = next else {
                        told.push(format!("{coarse} has nothing at {witness}: section 5 decides, or a leaf was lost"));
                        return told;
                    };
                    if seen.contains(&next.octant) {
                        return told;
                    }
                    seen.push(next.octant);
                    (who, leaf) = (whose, next);
                    continue;
                }
            }
            return told;
        }
        told
    }

    fn caveat(&self) -> &'static str {
        match (self.terms.keep_crossing, self.case) {
            (false, _) => ", unless a crossing leaf that was deleted afterwards does",
            (_, None) if self.terms.keep != Keep::All => {
                ", unless a facet does (give the case file: --case)"
            }
            _ => "",
        }
    }

    /// Why this leaf of one mesh must be split.
    fn reason(&self, who: Who, leaf: &Leaf) -> Reason {
        let octant = &leaf.octant;
        if octant.level < self.terms.level_surface {
            let d = self.terms.level_surface;
            if let Some(facet) = self.case.and_then(|case| crossed_by(octant, case)) {
                return Reason::Settled(format!(
                    "section 3: facet {facet} crosses it, so it has level >= D = {d}"
                ));
            }
            if self.case.is_none() && leaf.side == Side::Crossing {
                return Reason::Settled(format!(
                    "section 3: it is crossing, so it has level >= D = {d}"
                ));
            }
        }
        let meets = |b: &&contract::manifest::ExtentBox| {
            let (low, high) = octant.bounds();
            b.level > octant.level && (0..3).all(|a| low[a].max(b.min[a]) < high[a].min(b.max[a]))
        };
        if let Some(b) = self.terms.boxes.iter().find(meets) {
            return Reason::Settled(format!(
                "section 3: it meets the box {:?} to {:?}, so it has level >= {}",
                b.min, b.max, b.level
            ));
        }
        let Some((word, undisputed)) = self.witness(who, octant) else { return Reason::None };
        let source = word::octant(word);
        let why =
            format!("{}, by the leaf {source}", self.asks(&source, octant).unwrap_or_default());
        match undisputed {
            true => Reason::Settled(format!("{why}, which both have")),
            false => Reason::Disputed(why, source),
        }
    }
}

/// The first facet that crosses an octant.
fn crossed_by(octant: &Octant, case: &Case) -> Option<usize> {
    case.facets_lattice.iter().position(|facet| {
        let (low, high) = octant.bounds();
        Triangle::new(facet).meets(low, high)
    })
}

/// Both sides of the first difference, for people.
pub fn sides(a: Option<u64>, b: Option<u64>, root: &contract::lattice::Root) -> String {
    let told =
        |word: Option<u64>| word.map_or("no more leaves".to_owned(), |word| describe(word, root));
    format!("first difference:\n  A has {}\n  B has {}", told(a), told(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::lattice::Root;

    fn terms(n: u32) -> Terms {
        let root = Root { origin: [0.0; 3], edge: 8.0 };
        Terms {
            root,
            level_surface: 3,
            layer_cells_min: n,
            keep: Keep::All,
            keep_crossing: true,
            boxes: vec![],
        }
    }

    /// Sorted words of octants given by paths, all outside.
    fn mesh(paths: &[&[u8]]) -> Vec<u64> {
        let octant =
            |path: &&[u8]| path.iter().fold(Octant::ROOT, |octant, &digit| octant.child(digit));
        let leaf = |path| word::encode(&Leaf { octant: octant(path), side: Side::Outside });
        let mut words: Vec<u64> = paths.iter().map(leaf).collect();
        words.sort_unstable();
        words
    }

    fn rule(a: &[u64], b: &[u64], n: u32) -> String {
        let first = a.iter().zip(b).take_while(|(x, y)| x == y).count();
        let terms = terms(n);
        let dispute = Dispute { a, b, terms: &terms, case: None };
        dispute.rule(a.get(first).copied(), b.get(first).copied()).join("\n")
    }

    /// The root's child 0 with its own children; child 1 whole or split.
    fn pair(fine: &[u8]) -> (Vec<u64>, Vec<u64>) {
        let whole = mesh(&[fine, &[1]]);
        let split = mesh(&[fine, &[1, 0], &[1, 1], &[1, 2]]);
        (whole, split)
    }

    #[test]
    fn layer_and_balance_are_told_with_their_witness() {
        let (whole, split) = pair(&[0, 1]);
        let told = rule(&whole, &split, 2);
        assert!(
            told.contains("step 2 (layer)")
                && told.ends_with("by the leaf octant 0.1 (level 2), which both have: B is right"),
            "{told}"
        );
        let told = rule(&whole, &split, 1);
        assert!(
            told.contains("nothing in either mesh asks") && told.contains("A is right"),
            "{told}"
        );
        let (whole, split) = pair(&[0, 1, 1]);
        let told = rule(&split, &whole, 1);
        assert!(told.contains("step 3 (balance)") && told.contains("A is right"), "{told}");
    }

    #[test]
    fn a_disputed_witness_is_followed() {
        // 1.1 is split in B alone, for no reason; its children ask for the split of 3.
        let a = mesh(&[&[1, 2], &[3]]);
        let b = mesh(&[&[1, 2, 2], &[3, 0], &[3, 1]]);
        let (first_a, first_b) = (mesh(&[&[3]])[0], mesh(&[&[3, 0]])[0]);
        let terms = terms(1);
        let told =
            Dispute { a: &a, b: &b, terms: &terms, case: None }.rule(Some(first_a), Some(first_b));
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].contains("octant 1.2.2 (level 3), which A does not have"), "{told:?}");
        assert!(
            told[1].contains("leaf octant 1.2 (level 2)") && told[1].contains("A is right"),
            "{told:?}"
        );
    }

    #[test]
    fn sides_and_absences_have_their_sections() {
        let outside = mesh(&[&[0], &[1]]);
        let inside = vec![outside[0] | 1, outside[1]];
        assert!(rule(&outside, &inside, 1).starts_with("section 4"));
        assert!(rule(&outside[1..], &outside, 1).starts_with("section 5: keep is all"));
        assert!(rule(&[3], &[0], 1).starts_with("section 8"));
    }

    #[test]
    fn a_case_decides_about_facets_and_rays() {
        let cube =
            "spacing_min = 1.0\nkeep = 'all'\n[root]\norigin = [-4.0, -4.0, -4.0]\nedge = 8.0\n";
        let facet = [[-1.5, -1.5, -1.5], [-1.2, -1.5, -1.5], [-1.5, -1.2, -1.5]];
        let case = Case::from_parts(cube, vec![facet]).unwrap();
        let terms = Terms::of_case(&case);
        let told = |a: &[u64], b: &[u64]| {
            Dispute { a, b, terms: &terms, case: Some(&case) }
                .rule(a.first().copied(), b.first().copied())
                .join("")
        };
        let (coarse, fine) = (mesh(&[&[0]]), mesh(&[&[0, 0]]));
        assert!(told(&coarse, &fine).contains("section 3: facet 0 crosses it"));
        assert!(told(&[coarse[0] | 2], &coarse).contains("crossing: A is right"));
        let far = mesh(&[&[7]]);
        assert!(told(&[far[0] | 1], &far).contains("0 of its 6 rays say inside: B is right"));
    }
}
