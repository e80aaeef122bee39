//! Comparison of compiled functions with the values that the proofs of `reference/kernels` find in the sources. The crates that have
//! such functions share this file.

use std::collections::BTreeSet;

/// A function of the numbers in a line.
type Kernel<'a> = &'a dyn Fn(&[i128]) -> Vec<i128>;

/// Compares the functions of a file, by name. `None` is no numbers.
///
/// # Panics
/// If a value differs, or the functions are not those of the file that have values.
pub fn compare(file: &str, kernels: &[(&str, Kernel)]) {
    let mut compared = BTreeSet::new();
    for line in include_str!("../../../reference/kernels/values.txt").lines() {
        let Some(line) = line.strip_prefix(file) else { continue };
        let (call, values) = line.split_once(" =").expect("a call and its values");
        let (name, inputs) = call.trim().split_once(' ').unwrap_or((call.trim(), ""));
        let numbers = |text: &str| -> Vec<i128> {
            let words = text.split_whitespace().filter(|word| *word != "None");
            words.map(|word| word.parse().expect(word)).collect()
        };
        let kernel = kernels.iter().find(|kernel| kernel.0 == name).expect(name);
        assert_eq!(kernel.1(&numbers(inputs)), numbers(values), "{file}{line}");
        compared.insert(name);
    }
    assert_eq!(compared.len(), kernels.len(), "{file} has values of {compared:?} only");
}
