//! Finds the spacing that gives a requested number of cells from coarser meshes.
//!
//! The number of cells follows a power of the spacing, close to -2 if cells fill layers around a surface. Meshes become finer until one
//! has at least half of the requested cells; an overshooting mesh would cost more than the requested one. A large mesh is then
//! extrapolated. Small ones grow unevenly, as levels begin, so that one is searched between its neighbours.

/// Tolerated relative deviation of the number of cells.
const TOLERANCE: f64 = 0.02;
/// Up to this number of cells, the answer is the spacing of a mesh that was made.
const MADE_MAX: f64 = 1e7;
/// Maximum number of meshes for one answer.
const MESHES_MAX: usize = 16;
/// Maximum growth of cells from mesh to mesh: a distant extrapolation may be far off.
const STEP: f64 = 40.0;

/// Known sizes of one case at one n.
#[derive(Clone, Debug, Default)]
pub struct Sizes {
    /// Spacing and cells of the meshes so far.
    meshes: Vec<(f64, f64)>,
    /// Requested cells and the spacing returned, so that a repeated request returns the same spacing.
    answers: Vec<(f64, f64)>,
}

impl Sizes {
    /// Returns the spacing for about `cells`. `mesh` returns the number of cells at a spacing; `coarse` is the first spacing.
    ///
    /// # Errors
    /// Those of `mesh`.
    pub fn spacing<E>(
        &mut self,
        cells: f64,
        coarse: f64,
        mut mesh: impl FnMut(f64) -> Result<u64, E>,
    ) -> Result<f64, E> {
        if let Some(answer) = self.answers.iter().find(|answer| answer.0 == cells) {
            return Ok(answer.1);
        }
        let mut answer = None;
        for count in 0..MESHES_MAX {
            let next = match self.nearest(cells, |_| true) {
                None => coarse,
                Some(made) if (made.1 / cells).ln().abs() < TOLERANCE => break,
                Some(made) if made.1 < cells / 2.0 => {
                    let more = (cells / 2.0 / made.1).clamp(1.5, STEP);
                    // The exponent grows with refinement up to about 2; a smaller one would overshoot.
                    made.0 / more.powf(1.0 / self.power(cells).max(2.0))
                }
                Some(_) if cells > MADE_MAX => {
                    answer = Some(self.guess(cells));
                    break;
                }
                Some(_) => self.between(cells, count),
            };
            let made = mesh(next)?.max(1) as f64;
            self.meshes.push((next, made));
        }
        let nearest = self.nearest(cells, |_| true);
        let answer = answer.or(nearest.map(|made| made.0)).unwrap_or(coarse);
        self.answers.push((cells, answer));
        Ok(answer)
    }

    /// Returns the mesh whose size is nearest, of those with such a number of cells.
    fn nearest(&self, cells: f64, is_wanted: impl Fn(f64) -> bool) -> Option<(f64, f64)> {
        let off = |made: &(f64, f64)| (made.1 / cells).ln().abs();
        let made = self.meshes.iter().filter(|made| is_wanted(made.1)).copied();
        made.min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// The spacing to try next. The number of cells jumps, so extrapolation alone may return to the same meshes: every second time, the middle
    /// between the nearest meshes with fewer and with more cells.
    fn between(&self, cells: f64, count: usize) -> f64 {
        let below = self.nearest(cells, |count| count < cells);
        let ends = below.zip(self.nearest(cells, |count| count > cells));
        match ends.filter(|_| count % 2 == 1) {
            Some((below, above)) => (below.0 * above.0).sqrt(),
            None => self.guess(cells),
        }
    }

    /// The extrapolated spacing; there is a mesh.
    fn guess(&self, cells: f64) -> f64 {
        let near = self.nearest(cells, |_| true);
        near.map_or(1.0, |made| made.0 * (made.1 / cells).powf(1.0 / self.power(cells)))
    }

    /// Returns the exponent p in cells ~ spacing^-p, from the two meshes nearest to the requested size.
    fn power(&self, cells: f64) -> f64 {
        let ends = self.nearest(cells, |_| true);
        let other = ends.and_then(|one| self.nearest(cells, |count| count != one.1));
        let power = |(a, b): ((f64, f64), (f64, f64))| (a.1 / b.1).ln() / (b.0 / a.0).ln();
        ends.zip(other).map_or(2.0, |both| power(both).clamp(1.0, 3.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let spacing = sizes.spacing(target, 0.2, mesh).unwrap();
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
            let spacing = Sizes::default().spacing(target, 0.2, |s| Ok::<u64, ()>(truth(s)));
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
            sizes.spacing(cells, 0.1, mesh).unwrap();
            count
        };
        let first = request(1e6);
        assert_eq!(request(1e6), first);
        assert!(request(9e5) <= first + 1);
        let second = request(9e5);
        assert_eq!(request(9e5), second);
    }

    #[test]
    fn errors_are_passed_on() {
        assert_eq!(Sizes::default().spacing(1e6, 0.1, |_| Err("no")), Err("no"));
    }
}
