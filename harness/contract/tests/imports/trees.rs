//! Trees of the mesher, read as they are and leaf by leaf.

use super::*;

fn tree(path: &Path) -> Result<Option<ImportedTree>, Failure> {
    ImportedTree::open(path, None, None, None, "test".to_owned())
}

/// The digest and the counts are those of the reference.
#[test]
fn a_tree_of_the_mesher_has_the_leaves_of_the_reference_as_words_and_as_a_link() {
    let imported = tree(&sample("sphere.vtkhdf")).unwrap().unwrap();
    assert_eq!(imported.manifest.digest.to_string(), "f15f7dd9863232f4ff3c659161a5c2e9");
    assert_eq!((imported.manifest.leaves, imported.manifest.lacks_inputs), (9056, true));
    assert_eq!(imported.manifest.root, root([-2.0, -2.0, -2.0, 4.0]));
    let place = tempfile::tempdir().unwrap();
    let (words, link) = (place.path().join("new/words"), place.path().join("link"));
    imported.create(&words).unwrap();
    assert!(imported.create(&words).is_err(), "the directory is not empty");
    fs::create_dir(&link).unwrap();
    imported.link(&link).unwrap();
    let (words, link) = (leafset::read(&words).unwrap(), leafset::read(&link).unwrap());
    assert_eq!((words.words.len(), &words.words), (9056, &link.words));
    assert!(words.words.is_sorted());
}

/// A tree with another root than is wanted must be read cell by cell, as must other layouts; a damaged one is no tree at all.
#[test]
fn a_tree_is_opened_as_such_only_with_its_own_root() {
    let path = sample("sphere.vtkhdf");
    let open = |path: &Path, sides, root| {
        ImportedTree::open(path, sides, root, None, "test".to_owned()).map(|tree| tree.is_some())
    };
    let own = root([-2.0, -2.0, -2.0, 4.0]);
    assert!(open(&path, None, Some(own)).unwrap() && open(&path, Some("side"), None).unwrap());
    assert!(!open(&path, None, Some(root([-2.0, -2.0, -2.0, 8.0]))).unwrap());
    assert!(!open(&path, Some("body"), None).unwrap());
    assert!(!open(&sample("brick.p8est"), None, None).unwrap());
    let (_place, damaged) = edited("sphere.vtkhdf", |bytes| {
        let end = bytes.len() - 40;
        bytes.truncate(end);
    });
    let why = open(&damaged, None, None).unwrap_err().to_string();
    assert!(why.contains("is damaged"), "{why}");
    assert!(open(&damaged, None, Some(own)).is_err());
}

#[test]
fn a_truncated_tree_is_refused() {
    let bytes = fs::read(sample("sphere.vtkhdf")).unwrap();
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("mesh.vtkhdf");
    for length in (0..bytes.len()).step_by(37) {
        fs::write(&path, &bytes[..length]).unwrap();
        assert!(!matches!(tree(&path), Ok(Some(_))), "{length} bytes");
    }
}
