//! The import reads the files back, and notices when they are damaged.

use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn the_import_returns_the_mesh_in_any_style(
        words in random_words(3), is_ascii in any::<bool>(), is_wide in any::<bool>(), parts in 1usize..4
    ) {
        prop_assume!(!words.is_empty());
        let by_part = (0..parts).map(|p| words.iter().copied().skip(p).step_by(parts).collect()).collect();
        let (dir, mesh) = on_disk(&leaf_set(by_part));
        let target = dir.path().join("case/constant/polyMesh");
        let label = if is_wide { Label::Bits64 } else { Label::Bits32 };
        let style = Style { is_ascii, label };
        let summary = write(&mesh, &Selection::default(), &target, &options(style)).unwrap();
        let size: u64 = fs::read_dir(&target).unwrap().map(|f| f.unwrap().metadata().unwrap().len()).sum();
        prop_assert_eq!(summary.bytes, size);
        let request = Request { sides: Some("side".to_owned()), ..Request::default() };
        let cells = import::read(&dir.path().join("case"), Format::Openfoam, &request).unwrap();
        prop_assert_eq!(cells.words(&mesh.manifest.root).unwrap(), words);
        prop_assert_eq!(cells.levels.unwrap().len(), cells.sides.unwrap().len());
    }
}

type Damage = fn(&mut Vec<u8>);

/// Position of the first number in a binary list.
fn first(bytes: &[u8]) -> usize {
    let dictionary = bytes.windows(2).position(|w| w == b"}\n").unwrap();
    dictionary + bytes[dictionary..].iter().position(|&b| b == b'(').unwrap() + 1
}

/// Adds to the 32-bit number at an index.
fn add(bytes: &mut [u8], index: usize, step: i32) {
    let at = first(bytes) + 4 * index;
    let number = i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    bytes[at..at + 4].copy_from_slice(&(number + step).to_le_bytes());
}

fn swap(bytes: &mut [u8], size: usize, i: usize, j: usize) {
    let begin = first(bytes);
    (0..size).for_each(|k| bytes.swap(begin + i * size + k, begin + j * size + k));
}

#[test]
fn damaged_files_are_noticed() {
    let words = words_with_sides(
        |o| o.level < 2 || o.level < 3 && o.corner[2] == 0,
        |_| Some(Side::Inside),
    );
    let (dir, mesh) = on_disk(&leaf_set(vec![words.clone()]));
    let target = dir.path().join("case/constant/polyMesh");
    let style = Style { is_ascii: false, label: Label::Bits32 };
    write(&mesh, &Selection::default(), &target, &options(style)).unwrap();
    let read = || {
        let request = Request { sides: Some("side".to_owned()), ..Request::default() };
        import::read(&target, Format::Openfoam, &request)?.words(&mesh.manifest.root)
    };
    assert_eq!(read().unwrap(), words);
    let half = |bytes: &mut Vec<u8>| bytes.truncate(bytes.len() / 2);
    let damages: [(&str, Damage); 16] = [
        ("points", half),
        ("points", |bytes| swap(bytes, 24, 3, 70)),
        ("points", |bytes| add(bytes, 1, 1 << 30)),
        ("faces", half),
        ("faces", |bytes| add(bytes, 5, 1)),
        ("faces", |bytes| bytes.iter_mut().rev().skip(10).take(2).for_each(|b| *b ^= 1)),
        ("owner", half),
        ("owner", |bytes| add(bytes, 0, 1)),
        ("owner", |bytes| swap(bytes, 4, 1, 200)),
        ("neighbour", half),
        ("neighbour", |bytes| add(bytes, 7, -1)),
        ("cellLevel", half),
        ("cellLevel", |bytes| add(bytes, 9, 1)),
        ("side", half),
        ("side", |bytes| add(bytes, 4, 1)),
        ("side", |bytes| add(bytes, 4, 2)),
    ];
    for (i, (name, damage)) in damages.into_iter().enumerate() {
        let path = target.join(name);
        let sound = fs::read(&path).unwrap();
        let mut bytes = sound.clone();
        damage(&mut bytes);
        assert_ne!(bytes, sound);
        fs::write(&path, bytes).unwrap();
        assert!(read().map_or(true, |read| read != words), "damage {i} to {name} was not noticed");
        fs::write(&path, sound).unwrap();
    }
}
