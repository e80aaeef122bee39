//! Variants of a case with a different spacing or n, and the spacing that gives a requested number of cells. Their geometry is a
//! binary STL file, so that all programs and ranks read the same bytes.
//!
//! Each level halves the edge length, so a given root offers only spacings that differ by factors of two. A variant therefore
//! has its own root, between one and two times as large as the case's, whose edge at the surface level is
//! exactly the requested spacing. Cell counts then follow the spacing smoothly, as weak scaling requires.
//!
//! The number of cells follows a power of the spacing, close to -2 if cells fill layers around a surface. Meshes become finer until one
//! has at least half of the requested cells; an overshooting mesh would cost more than the requested one. A large mesh is then
//! extrapolated. Small ones grow unevenly, as levels begin, so that one is searched between its neighbours.

use super::machine::digest_of;
use crate::read_toml;
use contract::case::Case;
use contract::failure::{Failure, Result};
use contract::lattice::Root;
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A case to vary; its geometry is written once.
#[derive(Clone, Debug)]
pub struct Base {
    /// The name in results: that of the case, or of all variants of it with as many facets per rank.
    pub name: String,
    /// How the names of its files begin.
    pub stem: String,
    /// Edge length of the finest cell at the surface in the unchanged case.
    pub spacing_min: f64,
    /// n of the unchanged case.
    pub layer_cells_min: u32,
    /// Digest of the rules and the geometry of the unchanged case.
    pub inputs: String,
    /// Number of facets of the geometry.
    pub facets: u64,
    table: Table,
    root: Root,
    directory: PathBuf,
}

impl Base {
    /// Reads a case file; writes its geometry into `place`. If they are given, its generator makes a number of facets for each of so many
    /// ranks.
    ///
    /// # Errors
    /// If the case is invalid, it has no generator for other facets, or the directory cannot be written.
    pub fn read(path: &Path, per_rank: Option<[usize; 2]>, place: &Path) -> Result<Self> {
        let mut case = Case::read(path)?;
        let (mut name, mut stem) = (case.name.clone(), case.name.clone());
        if let Some([facets, ranks]) = per_rank {
            let all = facets * ranks;
            (name, stem) = (grown(&name, facets), format!("{name}-{all}-facets"));
            let mut of_file: Table = read_toml(path)?;
            let generator = of_file.get_mut("generator").and_then(Value::as_table_mut);
            let generator = generator.ok_or_else(|| {
                let file = path.display();
                Failure::input(format!("{file}: facets cannot grow without a [generator]"))
            })?;
            generator.insert("facets".into(), (all as i64).into());
            let path = place.join(format!("{stem}.toml"));
            fs::write(&path, of_file.to_string()).map_err(|error| Failure::at(&path, error))?;
            case = Case::read(&path)?;
        }
        let mut table = case.table.clone();
        let [rules, stl] = ["rules", "stl"].map(|kind| place.join(format!("{stem}.{kind}")));
        fs::write(&rules, table.to_string()).map_err(|error| Failure::at(&rules, error))?;
        File::create(&stl)
            .and_then(|file| geometries::write_stl_binary(&case.facets, BufWriter::new(file)))
            .map_err(|error| Failure::at(&stl, error))?;
        table.insert("geometry".into(), stl.to_string_lossy().into_owned().into());
        Ok(Self {
            name,
            stem,
            spacing_min: case.root.edge_of(case.level_surface),
            layer_cells_min: case.layer_cells_min,
            inputs: digest_of([rules, stl]),
            facets: case.facets.len() as u64,
            table,
            root: case.root,
            directory: place.to_owned(),
        })
    }

    /// Returns an initial spacing that gives at most some thousand cells.
    pub fn coarse(&self) -> f64 {
        self.spacing_min.max(self.root.edge / 512.0)
    }

    /// Writes the case with this spacing and n; returns the path. In its own root, the finest cells are between once and twice as fine
    /// as the spacing; else the root fits the spacing.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, spacing_min: f64, n: u32, in_own_root: bool) -> Result<PathBuf> {
        let root = if in_own_root { self.root } else { fitted(self.root, spacing_min) };
        let mut table = self.table.clone();
        table.insert("spacing_min".into(), spacing_min.into());
        table.insert("layer_cells_min".into(), i64::from(n).into());
        let of_root = Value::try_from(root).expect("a root is representable in TOML");
        table.insert("root".into(), of_root);
        let name = format!("{}-{spacing_min:e}-{n}-{:e}.toml", self.stem, root.edge);
        let path = self.directory.join(name);
        fs::write(&path, table.to_string()).map_err(|error| Failure::at(&path, error))?;
        Ok(path)
    }
}

/// The name in results of a case with so many facets per rank.
pub(crate) fn grown(case: &str, facets: usize) -> String {
    format!("{case}-{facets}-facets-per-rank")
}

/// Returns the smallest concentric root that is not smaller and has `spacing` as the edge of a level.
fn fitted(Root { origin, edge }: Root, spacing: f64) -> Root {
    let mut wider = spacing;
    // Doubling is exact, so the edge equals the spacing bit by bit.
    while wider < edge {
        wider *= 2.0;
    }
    Root { origin: origin.map(|o| o + edge * 0.5 - wider * 0.5), edge: wider }
}

/// Tolerated relative deviation of the number of cells.
const TOLERANCE: f64 = 0.02;
/// Up to this number of cells, the answer is the spacing of a mesh that was made.
const MADE_MAX: f64 = 1e7;
/// Maximum number of meshes for one answer.
const MESHES_MAX: usize = 16;
/// Maximum growth of cells from mesh to mesh: a distant extrapolation may be far off.
const STEP: f64 = 40.0;

/// Known sizes of one case at one n: cells of the meshes so far, by the bits of their spacing.
pub type Sizes = HashMap<u64, f64>;

/// Returns the spacing for about `cells`. `mesh` returns the number of cells at a spacing; `coarse` is the first spacing. The answer does
/// not depend on earlier ones, so that a part of a study measures the meshes of the whole: what is known is only not meshed again.
///
/// # Errors
/// Those of `mesh`.
pub fn spacing<E>(
    known: &mut Sizes,
    cells: f64,
    coarse: f64,
    mut mesh: impl FnMut(f64) -> Result<u64, E>,
) -> Result<f64, E> {
    let (mut next, mut answer, mut tried) = (coarse, coarse, Vec::<(f64, f64)>::new());
    for count in 0..=MESHES_MAX {
        let off = |mesh: &&(f64, f64)| (mesh.1 / cells).ln().abs();
        let nearest_of = |is_wanted: &dyn Fn(f64) -> bool| {
            let wanted = tried.iter().filter(|mesh| is_wanted(mesh.1));
            wanted.min_by(|a, b| off(a).total_cmp(&off(b))).copied()
        };
        if let Some((spacing, made)) = nearest_of(&|_| true) {
            answer = spacing;
            if count == MESHES_MAX || (made / cells).ln().abs() < TOLERANCE {
                break;
            }
            // The exponent p in cells ~ spacing^-p.
            let power = nearest_of(&|other| other != made).map_or(2.0, |other| {
                ((made / other.1).ln() / (other.0 / spacing).ln()).clamp(1.0, 3.0)
            });
            let guess = spacing * (made / cells).powf(1.0 / power);
            next = match nearest_of(&|other| (other < cells) != (made < cells)) {
                _ if made < cells / 2.0 => {
                    let more = (cells / 2.0 / made).clamp(1.5, STEP);
                    // The exponent grows with refinement up to about 2; a smaller one would overshoot.
                    spacing / more.powf(1.0 / power.max(2.0))
                }
                _ if cells > MADE_MAX => {
                    answer = guess;
                    break;
                }
                // The number of cells jumps, so extrapolation alone may return to the same meshes.
                Some(other) if count % 2 == 1 => (spacing * other.0).sqrt(),
                _ => guess,
            };
        }
        let made = match known.get(&next.to_bits()) {
            Some(made) => *made,
            None => mesh(next)?.max(1) as f64,
        };
        known.insert(next.to_bits(), made);
        tried.push((next, made));
    }
    Ok(answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_of_a_level_equals_the_spacing() {
        let Root { origin, edge } = fitted(Root { origin: [-5.0; 3], edge: 10.0 }, 0.3);
        assert_eq!(edge, 0.3 * 64.0);
        assert_eq!(edge / 64.0, 0.3);
        assert!((origin[0] + edge * 0.5).abs() < 1e-12);
        let same = Root { origin: [0.0; 3], edge: 8.0 };
        assert_eq!(fitted(same, 0.5), same);
    }

    #[test]
    fn a_variant_is_a_complete_case() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("ball.toml");
        let text = "spacing_min = 0.1\nroot_scale = 3.0\nkeep = \"all\"\n[generator]\nshape = \"sphere\"\nfacets = 80\n\
                    [[box]]\nmin = [0.0, 0.0, 0.0]\nmax = [1.0, 1.0, 1.0]\nspacing = 0.2\n";
        fs::write(&path, text).unwrap();
        let base = Base::read(&path, None, place.path()).unwrap();
        let original = Case::read(&path).unwrap();
        let made = Case::read(&base.write(0.07, 3, false).unwrap()).unwrap();
        assert_eq!((made.layer_cells_min, made.boxes.len(), made.keep), (3, 1, original.keep));
        assert_eq!(made.facets, original.facets);
        assert_eq!(made.root.edge / f64::from(1u32 << made.level_surface), 0.07);
        // With its own spacing, the case keeps its root.
        let same = Case::read(&base.write(base.spacing_min, 4, false).unwrap()).unwrap();
        assert_eq!((same.root, same.level_surface), (original.root, original.level_surface));
        let kept = Case::read(&base.write(0.07, 3, true).unwrap()).unwrap();
        assert_eq!((kept.root, kept.layer_cells_min), (original.root, 3));
    }

    #[test]
    fn facets_grow_if_a_generator_makes_them() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("ball.toml");
        let text =
            "spacing_min = 0.1\nroot_scale = 3.0\n[generator]\nshape = \"sphere\"\nfacets = 80\n";
        fs::write(&path, text).unwrap();
        let [small, large] =
            [1, 4].map(|ranks| Base::read(&path, Some([80, ranks]), place.path()).unwrap());
        assert_eq!((&small.name[..], &small.root), ("ball-80-facets-per-rank", &large.root));
        assert_eq!((&small.name, small.stem == large.stem), (&large.name, false));
        let made =
            [&small, &large].map(|base| Case::read(&base.write(0.1, 4, false).unwrap()).unwrap());
        assert_eq!(made.map(|case| case.facets.len()), [80, 320]);
        let given = place.path().join("given.toml");
        fs::write(&given, "spacing_min = 0.1\ngeometry = \"ball-80-facets.stl\"\n").unwrap();
        let refused = Base::read(&given, Some([80, 1]), place.path()).unwrap_err();
        // A case that is called like one of grown facets keeps its geometry.
        let files = place.path().join("files");
        fs::create_dir(&files).unwrap();
        let other = place.path().join("ball-320.toml");
        fs::write(&other, text.replace("sphere", "cube")).unwrap();
        Base::read(&other, None, &files).unwrap();
        let stl = fs::read(files.join("ball-320.stl")).unwrap();
        Base::read(&path, Some([80, 4]), &files).unwrap();
        assert!(fs::read(files.join("ball-320.stl")).unwrap() == stl);
        assert!(refused.why.ends_with("facets cannot grow without a [generator]"), "{refused:?}");
    }

    #[test]
    fn a_spacing_is_found_from_coarser_meshes() {
        let truth = |s: f64| (3.0 / (s * s) + 50.0 / s + 700.0) as u64;
        for target in [5e4, 3e6, 1e9] {
            let mut sizes = Sizes::default();
            let mut most = 0;
            let mesh = |s: f64| {
                most = most.max(truth(s));
                Ok::<u64, ()>(truth(s))
            };
            let spacing = spacing(&mut sizes, target, 0.2, mesh).unwrap();
            let error = truth(spacing) as f64 / target - 1.0;
            assert!(error.abs() < 0.08, "{target}: {error}");
            // Overshooting would be expensive.
            assert!(most as f64 <= target.max(1e5) * 1.1, "{most}");
        }
    }

    #[test]
    fn a_small_mesh_that_grows_unevenly_is_within_five_percent() {
        // Layers of every level begin at another spacing.
        let truth = |s: f64| {
            let level = (1.0 / s).log2();
            (40.0 / (s * s) * (1.0 + 0.3 * (level * 3.0).sin())) as u64
        };
        for target in [2e4, 8e4, 3.2e5, 5e6] {
            let spacing = spacing(&mut Sizes::default(), target, 0.2, |s| Ok::<u64, ()>(truth(s)));
            let error = truth(spacing.unwrap()) as f64 / target - 1.0;
            assert!(error.abs() < 0.05, "{target}: {error}");
        }
    }

    #[test]
    fn known_sizes_are_not_meshed_again() {
        let mut sizes = Sizes::default();
        let mut count = 0;
        let mut request = |cells| {
            let mesh = |s: f64| {
                count += 1;
                Ok::<u64, ()>((1.0 / (s * s)) as u64)
            };
            (spacing(&mut sizes, cells, 0.1, mesh).unwrap(), count)
        };
        let first = request(1e6);
        assert_eq!(request(1e6), first);
        let second = request(9e5);
        assert!(second.1 < 2 * first.1, "{second:?} after {first:?}");
        assert_eq!(request(9e5), second);
        // As without what is known.
        let alone =
            spacing(&mut Sizes::default(), 9e5, 0.1, |s| Ok::<u64, ()>((1.0 / (s * s)) as u64));
        assert_eq!(Ok(second.0), alone);
    }

    #[test]
    fn errors_are_passed_on() {
        assert_eq!(spacing(&mut Sizes::default(), 1e6, 0.1, |_| Err("no")), Err("no"));
    }
}
