//! Leaf by leaf the same as another mesh.
//!
//! Section 1 of reference/DEFINITION.md: the mesh is a function of the inputs alone, so what the
//! reference makes of a case is the only right answer. Misses: an error that both programs make;
//! the other checks are for those.

use super::{CheckResult, Subject};
use contract::lattice::Root;
use contract::word::{self, Leaf};

const NAME: &str = "identical";

/// Compares with the reference, if there is one.
pub fn check(subject: &Subject) -> Option<CheckResult> {
    let reference = subject.reference?;
    Some(compare(&subject.mesh.words, &reference.words, &subject.terms.root))
}

/// Compares two sorted sequences of words; the findings name the first difference.
pub fn compare(mesh: &[u64], reference: &[u64], root: &Root) -> CheckResult {
    let mut result = CheckResult::new(NAME);
    result.examined = mesh.len() as u64;
    if mesh == reference {
        return result;
    }
    let first = mesh.iter().zip(reference).take_while(|(a, b)| a == b).count();
    result.find(difference(("mesh", mesh), ("reference", reference), first, root));
    result.findings_total = symmetric_difference(&mesh[first..], &reference[first..]);
    result
}

/// Tells what two sequences hold at the first index where they differ.
pub fn difference(a: (&str, &[u64]), b: (&str, &[u64]), first: usize, root: &Root) -> String {
    let told = |(name, words): (&str, &[u64])| match words.get(first) {
        Some(&word) => format!("{name} has {}", tell(word, root)),
        None => format!("{name} has no more leaves"),
    };
    format!("first difference: {}; {}", told(a), told(b))
}

/// A word for people, be it a leaf or not.
pub fn tell(word: u64, root: &Root) -> String {
    match word::decode(word) {
        Ok(Leaf { octant, side }) => format!("{side} leaf: {}", root.describe(&octant)),
        Err(why) => format!("the word {word:#018x}: {why}"),
    }
}

/// Words in one sorted sequence but not in both.
fn symmetric_difference(mut a: &[u64], mut b: &[u64]) -> u64 {
    let mut count = 0;
    while let (Some(x), Some(y)) = (a.first(), b.first()) {
        count += u64::from(x != y);
        a = &a[usize::from(x <= y)..];
        b = &b[usize::from(y <= x)..];
    }
    count + (a.len() + b.len()) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: Root = Root { origin: [0.0; 3], edge: 8.0 };

    #[test]
    fn the_first_difference_is_told_with_both_levels() {
        let fine: Vec<u64> = (0..8)
            .map(|d| {
                word::encode(&Leaf {
                    octant: contract::octant::Octant::ROOT.child(d),
                    side: word::Side::Outside,
                })
            })
            .collect();
        let mut coarse = fine.clone();
        coarse[3] |= 1;
        assert!(compare(&fine, &fine, &ROOT).holds());
        let result = compare(&coarse, &fine, &ROOT);
        assert_eq!(result.findings_total, 2);
        let told = &result.findings[0].detail;
        assert!(told.contains("mesh has inside leaf: octant 3 (level 1)"), "{told}");
        assert!(told.contains("reference has outside leaf: octant 3 (level 1)"), "{told}");
        assert_eq!(compare(&fine[..7], &fine, &ROOT).findings_total, 1);
    }
}
