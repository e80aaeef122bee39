//! The committed inputs of all targets, among them every input that found a fault.
#![allow(missing_docs)]

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use fuzz::{Scratch, TARGETS};
use std::fs;
use std::path::Path;

/// Inputs of a target: those that found faults, by name, and those that `ci/fuzz` packed, by line.
fn inputs(target: &fuzz::Target) -> Vec<(String, Vec<u8>)> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    let named = fs::read_dir(corpus.join(target.name)).into_iter().flatten();
    let mut paths: Vec<_> =
        named.map(|entry| entry.expect("a readable directory").path()).collect();
    paths.sort();
    let name = format!("{}.base64", target.name);
    let packed = fs::read_to_string(corpus.join(&name)).expect("every target has a corpus");
    let line = |(number, line): (usize, &str)| {
        let bytes = STANDARD.decode(line).expect("a line in base64");
        (format!("{name}:{}", number + 1), bytes)
    };
    let packed: Vec<_> = packed.lines().enumerate().map(line).collect();
    assert!(packed.len() > 100, "{name}: {} inputs", packed.len());
    let file = |path: &std::path::PathBuf| (path.display().to_string(), fs::read(path).unwrap());
    paths.iter().map(file).chain(packed).collect()
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
