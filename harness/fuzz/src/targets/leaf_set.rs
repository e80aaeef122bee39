//! Leaf-set directories.

use crate::Scratch;
use check::audit::audit;
use contract::import::{self, Format, Request};
use contract::leafset;
use contract::manifest;
use contract::npy::{self, PartFile};

/// Stands for the digests of the 512 octants, which are 18 kB: inputs are short, and mostly of what matters.
const DIGESTS: &str = "@DIGESTS@";

/// The bytes with the digests of empty octants where [`DIGESTS`] stands first.
fn with_digests(bytes: &[u8]) -> Vec<u8> {
    let digests = DIGESTS.as_bytes();
    let Some(at) = bytes.windows(digests.len()).position(|window| window == digests) else {
        return bytes.to_vec();
    };
    let zeros = vec![format!("\"{:032x}\"", 0); manifest::OCTANTS].join(",");
    [&bytes[..at], zeros.as_bytes(), &bytes[at + digests.len()..]].concat()
}

/// Between the manifest and the words of the only part; without it, the root is the only leaf.
const SEPARATOR: &[u8] = b"\n@@@@\n";

/// A manifest and a part: the manifest is read back as it was written, and the directory is audited.
pub(super) fn manifest(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let at = bytes.windows(SEPARATOR.len()).position(|window| window == SEPARATOR);
    let (text, words) =
        at.map_or((bytes, &[0; 8][..]), |at| (&bytes[..at], &bytes[at + SEPARATOR.len()..]));
    scratch.file("mesh/mesh.json", &with_digests(text));
    let mesh = scratch.path().join("mesh");
    let Ok(manifest) = leafset::read_manifest(&mesh) else { return false };
    scratch.file("again/mesh.json", manifest.text().as_bytes());
    let again = leafset::read_manifest(&scratch.path().join("again")).expect("what was written");
    assert!(again == manifest, "{manifest:?}\n{again:?}");
    let words = &words[..words.len() / 8 * 8];
    let part = [&npy::header("<u8", &format!("({},)", words.len() / 8))[..], words].concat();
    scratch.file("mesh/leaves-00000.npy", &part);
    let Ok(set) = leafset::read(&mesh) else { return false };
    assert_eq!(set.words.len() % (words.len() / 8).max(1), 0);
    audit(&mesh);
    true
}

/// A file of leaf words, as a part of a leaf set and as an import.
pub(super) fn words(scratch: &mut Scratch, bytes: &[u8]) -> bool {
    let path = scratch.file("words.npy", bytes);
    let part = PartFile::open(path);
    let words = part.as_ref().ok().map(|part| part.read_all().expect("a file of this length"));
    let request = Request { sides: Some("side".to_owned()), ..Request::default() };
    let cells = import::read(path, Format::LeafWords, &request);
    assert!(
        cells.is_err()
            || words.is_some_and(|words| words.len() == cells.as_ref().map_or(0, |c| c.len()))
    );
    part.is_ok()
}
