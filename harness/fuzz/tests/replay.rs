//! The committed inputs of all targets, among them every input that found a fault.
#![allow(missing_docs)]

use fuzz::{Scratch, TARGETS};
use std::fs;

/// Inputs of a target in the order of their names.
fn inputs(target: &fuzz::Target) -> Vec<(String, Vec<u8>)> {
    let mut paths: Vec<_> = fs::read_dir(target.corpus())
        .expect("every target has a corpus")
        .map(|entry| entry.expect("a readable directory").path())
        .collect();
    paths.sort();
    let named = |path: &std::path::PathBuf| (path.display().to_string(), fs::read(path).unwrap());
    paths.iter().map(named).collect()
}

#[test]
fn no_committed_input_finds_a_fault() {
    let mut scratch = Scratch::default();
    for target in TARGETS {
        let inputs = inputs(&target);
        let mut accepted = 0;
        for (name, bytes) in &inputs {
            println!("{name}");
            accepted += usize::from((target.run)(&mut scratch, bytes));
        }
        println!("{}: {} inputs, {accepted} accepted", target.name, inputs.len());
        // A corpus that no reader accepts anything of would not reach much of it.
        assert!(accepted > 0, "{}", target.name);
    }
}

#[test]
fn the_corpus_is_small() {
    let bytes = TARGETS.iter().flat_map(inputs).map(|(_, bytes)| bytes.len()).sum::<usize>();
    assert!(bytes <= 1 << 20, "{bytes} bytes");
}
