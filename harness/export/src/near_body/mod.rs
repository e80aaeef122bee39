//! The surface that an off-body mesh hands over to a near-body mesher: the faces exposed by deleted crossing leaves.

pub mod front;
pub mod polygons;

#[cfg(test)]
mod testing {
    use crate::mesh::Mesh;
    use contract::lattice::Root;
    use contract::leafset::LeafSet;
    use contract::manifest::{Manifest, Tree};

    /// A mesh on disk whose leaves are dealt to parts by `part`.
    pub fn on_disk(
        words: &[u64],
        parts: usize,
        part: impl Fn(usize) -> usize,
    ) -> (tempfile::TempDir, Mesh) {
        let mut dealt = vec![Vec::new(); parts];
        words.iter().enumerate().for_each(|(i, &w)| dealt[part(i) % parts].push(w));
        let root = Root { origin: [0.0; 3], edge: 1.0 };
        let empty = Manifest::without_leaves(Tree::Final, root, "test".to_owned());
        let dir = tempfile::tempdir().unwrap();
        LeafSet::new(empty, Vec::new()).with_parts(dealt).write(dir.path()).unwrap();
        let mesh = Mesh::open(dir.path()).unwrap();
        (dir, mesh)
    }
}
