//! Variants of a case with a different spacing or n. Their geometry is a binary STL file, so that all programs and ranks
//! read the same bytes.
//!
//! Each level halves the edge length, so a given root offers only spacings that differ by factors of two. A variant therefore
//! has its own root, between one and two times as large as the case's, whose edge at the surface level is
//! exactly the requested spacing. Cell counts then follow the spacing smoothly, as weak scaling requires.

use contract::case::Case;
use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A case to vary; its geometry is written once.
#[derive(Clone, Debug)]
pub struct Base {
    /// The case's name.
    pub name: String,
    /// Edge length of the finest cell at the surface in the unchanged case.
    pub spacing_min: f64,
    /// n of the unchanged case.
    pub layer_cells_min: u32,
    table: Table,
    origin: [f64; 3],
    edge: f64,
    directory: PathBuf,
}

impl Base {
    /// Reads a case file; writes its geometry into `directory`.
    ///
    /// # Errors
    /// One sentence, if the case is invalid or the directory cannot be written.
    pub fn read(path: &Path, directory: &Path) -> Result<Self, String> {
        let case = Case::read(path).map_err(|error| error.to_string())?;
        let text = contract::files::read_text(path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let mut table: Table =
            text.parse().map_err(|error| format!("{}: {error}", path.display()))?;
        let stl = directory.join(format!("{}.stl", case.name));
        let write = || {
            let file = BufWriter::new(fs::File::create(&stl)?);
            geometries::write_stl_binary(&case.facets, file)
        };
        write().map_err(|error| format!("{}: {error}", stl.display()))?;
        for key in ["generator", "root_scale", "root"] {
            table.remove(key);
        }
        table.insert("geometry".into(), stl.to_string_lossy().into_owned().into());
        Ok(Self {
            name: case.name,
            spacing_min: case.root.edge / f64::from(1u32 << case.level_surface),
            layer_cells_min: case.layer_cells_min,
            table,
            origin: case.root.origin,
            edge: case.root.edge,
            directory: directory.to_owned(),
        })
    }

    /// Returns an initial spacing that gives at most some thousand cells.
    pub fn coarse(&self) -> f64 {
        self.spacing_min.max(self.edge / 512.0)
    }

    /// Writes the case with this spacing and n; returns the path.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn variant(&self, spacing_min: f64, layer_cells_min: u32) -> Result<PathBuf, String> {
        self.write(root(self.origin, self.edge, spacing_min), spacing_min, layer_cells_min)
    }

    /// Writes the case with its own root and this spacing and n; returns the path. The finest cells are then between once and
    /// twice as fine as the spacing.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn in_own_root(&self, spacing_min: f64, layer_cells_min: u32) -> Result<PathBuf, String> {
        self.write((self.origin, self.edge), spacing_min, layer_cells_min)
    }

    fn write(
        &self,
        (origin, edge): ([f64; 3], f64),
        spacing_min: f64,
        layer_cells_min: u32,
    ) -> Result<PathBuf, String> {
        let mut table = self.table.clone();
        table.insert("spacing_min".into(), spacing_min.into());
        table.insert("layer_cells_min".into(), i64::from(layer_cells_min).into());
        let mut of_root = Table::new();
        of_root.insert("origin".into(), Value::Array(origin.map(Value::from).to_vec()));
        of_root.insert("edge".into(), edge.into());
        table.insert("root".into(), of_root.into());
        let name = format!("{}-{spacing_min:e}-{layer_cells_min}-{edge:e}.toml", self.name);
        let path = self.directory.join(name);
        fs::write(&path, table.to_string())
            .map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(path)
    }
}

/// Returns the smallest concentric root that is not smaller and has `spacing` as the edge of a level.
fn root(origin: [f64; 3], edge: f64, spacing: f64) -> ([f64; 3], f64) {
    let mut wider = spacing;
    // Doubling is exact, so the edge equals the spacing bit by bit.
    while wider < edge {
        wider *= 2.0;
    }
    (origin.map(|o| o + edge * 0.5 - wider * 0.5), wider)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_of_a_level_equals_the_spacing() {
        let (origin, edge) = root([-5.0; 3], 10.0, 0.3);
        assert_eq!(edge, 0.3 * 64.0);
        assert_eq!(edge / 64.0, 0.3);
        assert!((origin[0] + edge * 0.5).abs() < 1e-12);
        assert_eq!(root([0.0; 3], 8.0, 0.5), ([0.0; 3], 8.0));
    }

    #[test]
    fn a_variant_is_a_complete_case() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("ball.toml");
        let text = "spacing_min = 0.1\nroot_scale = 3.0\nkeep = \"all\"\n[generator]\nshape = \"sphere\"\nfacets = 80\n\
                    [[box]]\nmin = [0.0, 0.0, 0.0]\nmax = [1.0, 1.0, 1.0]\nspacing = 0.2\n";
        fs::write(&path, text).unwrap();
        let base = Base::read(&path, place.path()).unwrap();
        let original = Case::read(&path).unwrap();
        let made = Case::read(&base.variant(0.07, 3).unwrap()).unwrap();
        assert_eq!((made.layer_cells_min, made.boxes.len(), made.keep), (3, 1, original.keep));
        assert_eq!(made.facets, original.facets);
        assert_eq!(made.root.edge / f64::from(1u32 << made.level_surface), 0.07);
        // With its own spacing, the case keeps its root.
        let same = Case::read(&base.variant(base.spacing_min, 4).unwrap()).unwrap();
        assert_eq!((same.root, same.level_surface), (original.root, original.level_surface));
        let kept = Case::read(&base.in_own_root(0.07, 3).unwrap()).unwrap();
        assert_eq!((kept.root, kept.layer_cells_min), (original.root, 3));
    }
}
