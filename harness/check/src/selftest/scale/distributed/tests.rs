use super::*;
use contract::testing::{leaf_set, words_of};

/// A mesh that is refined towards a face and given in two interleaved parts, distributed; and its words.
fn distributed(place: &Path) -> (DistributedMesh, Vec<u64>) {
    let words = words_of(|o| o.level < 4 || o.level < 6 && o.corner[0] == 0);
    let parts = [0, 1].map(|p| words.iter().copied().skip(p).step_by(2).collect()).to_vec();
    let mesh = place.join("given");
    std::fs::create_dir(&mesh).unwrap();
    leaf_set(parts).write(&mesh).unwrap();
    let source = Source { name: "given".into(), mesh, base: None };
    (DistributedMesh::new(&source, place).unwrap(), words)
}

#[test]
fn distribution_keeps_every_leaf_and_finds_it_by_its_index() {
    let place = tempfile::tempdir().unwrap();
    let (original, words) = distributed(place.path());
    assert_eq!((original.leaves(), original.parts().len()), (words.len() as u64, 4));
    for (i, &word) in words.iter().enumerate() {
        let (part, found) = original.leaf(i as u64).unwrap();
        assert_eq!((found, part), (word, i / original.interval as usize % 4));
    }
    let read = leafset::read(original.dir()).unwrap();
    assert_eq!(read.words, words);
    assert_eq!(read.manifest, read.with_parts(read.parts.clone()).manifest);
}

#[test]
fn parts_do_not_depend_on_how_many_words_are_written_at_once() {
    let words = words_of(|o| o.level < 2);
    let written = |run: usize| {
        let place = tempfile::tempdir().unwrap();
        let mut writer = PartWriter::new(place.path(), words.len() as u64, 3, 5).unwrap();
        words.chunks(run).for_each(|run| writer.write(run).unwrap());
        let parts = writer.finish().unwrap();
        let read = |part: &Part| std::fs::read(place.path().join(&part.file)).unwrap();
        let files: Vec<_> = parts.iter().map(read).collect();
        (parts, files)
    };
    let (parts, files) = written(words.len());
    assert_eq!(parts.iter().map(|part| part.leaves).collect::<Vec<_>>(), [24, 20, 20]);
    for run in [1, 2, 3, 7] {
        assert_eq!(written(run), (parts.clone(), files.clone()), "{run} words at once");
    }
}

#[test]
fn a_window_is_an_octant_of_one_part() {
    let place = tempfile::tempdir().unwrap();
    let (original, words) = distributed(place.path());
    for index in (0..words.len()).step_by(97) {
        let window = original.window(index as u64).unwrap().unwrap();
        let leaves = &window.correct.mesh.words;
        assert!(leaves.contains(&words[index]));
        let at = words.binary_search(&leaves[0]).unwrap();
        assert_eq!(words[at..at + leaves.len()], leaves[..]);
        let mut of_part = vec![0; leaves.len()];
        original.parts()[window.part].read_at(window.from, &mut of_part).unwrap();
        assert_eq!(of_part, leaves[..]);
        // The leaves fill an octant: together they have as many cells as an octant of some level.
        let cells: u64 = leaves.iter().map(|&w| word::span(word::level(w))).sum();
        assert!((0..=19).any(|level| word::span(level) == cells), "{cells}");
    }
}

#[test]
fn thirds_are_as_long_as_each_other_up_to_one_word() {
    let words = words_of(|o| o.level < 1);
    let lengths = |count| thirds(&words[..count]).iter().map(Vec::len).collect::<Vec<_>>();
    assert_eq!([lengths(8), lengths(3), lengths(0)], [[2, 3, 3], [1, 1, 1], [0; 3]]);
    assert_eq!(thirds(&words).concat(), words);
}

#[test]
fn the_window_of_a_mesh_of_one_leaf_is_the_root() {
    let place = tempfile::tempdir().unwrap();
    let mesh = place.path().join("given");
    std::fs::create_dir(&mesh).unwrap();
    leaf_set(vec![words_of(|_| false)]).write(&mesh).unwrap();
    let source = Source { name: "given".into(), mesh, base: None };
    let original = DistributedMesh::new(&source, place.path()).unwrap();
    let window = original.window(0).unwrap().unwrap();
    assert_eq!(window.correct.mesh.words, [0]);
}
