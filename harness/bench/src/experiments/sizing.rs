//! Finds the spacing that gives a requested number of cells by extrapolation from coarser meshes.
//!
//! The number of cells follows a power of the spacing, close to -2 if cells fill layers around a surface. The exponent is
//! estimated from the two nearest meshes so far, each a few times finer than the previous one.

/// Tolerated relative deviation of the number of cells.
const TOLERANCE: f64 = 0.02;
/// Up to this number of cells, the answer is the spacing of a mesh that was made: levels make small meshes grow unevenly.
const MADE_MAX: f64 = 1e7;
/// Maximum number of meshes for one answer.
const MESHES_MAX: usize = 16;
/// Two meshes within this factor of the requested size determine the exponent.
const NEAR: f64 = 4.0;
/// Size of the next mesh as a fraction of the requested size: an overshooting mesh would cost more than the requested one.
const AIM: f64 = 0.5;
/// Maximum growth of cells from mesh to mesh: a distant extrapolation may be far off.
const STEP: f64 = 40.0;

/// Known sizes of one case at one n.
#[derive(Clone, Debug, Default)]
pub struct Sizes {
    /// Spacing and cells of the meshes so far, coarsest first.
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
        if let Some(answer) = self.answers.iter().find(|a| a.0 == cells) {
            return Ok(answer.1);
        }
        for _ in 0..MESHES_MAX {
            if self.is_known(cells) {
                break;
            }
            let next = match self.finest_below(cells) {
                None => coarse,
                Some(_) if self.has_two_near(cells) => self.between(cells),
                Some((spacing, count)) => {
                    let more = AIM * cells / count;
                    let more = if count < cells { more.clamp(1.5, STEP) } else { more.min(0.8) };
                    // The exponent grows with refinement up to about 2; a smaller one would overshoot.
                    spacing / more.powf(1.0 / self.power(cells).max(2.0))
                }
            };
            let count = mesh(next)?.max(1) as f64;
            self.meshes.push((next, count));
            self.meshes.sort_by(|a, b| b.0.total_cmp(&a.0));
        }
        let nearest = self.nearest(cells).filter(|_| cells <= MADE_MAX);
        let answer = nearest.map_or_else(|| self.guess(cells), |mesh| mesh.0);
        self.answers.push((cells, answer));
        Ok(answer)
    }

    /// Whether one mesh is close enough, or two determine the exponent and suffice.
    fn is_known(&self, cells: f64) -> bool {
        let is_close = self.nearest(cells).is_some_and(|m| off(m, cells) < TOLERANCE);
        is_close || cells > MADE_MAX && self.has_two_near(cells)
    }

    fn has_two_near(&self, cells: f64) -> bool {
        self.meshes.iter().filter(|m| off(**m, cells) < NEAR.ln()).count() > 1
    }

    fn nearest(&self, cells: f64) -> Option<(f64, f64)> {
        let meshes = self.meshes.iter().copied();
        meshes.min_by(|a, b| off(*a, cells).total_cmp(&off(*b, cells)))
    }

    /// The spacing to try next. The number of cells jumps, so extrapolation alone may return to the same meshes: every second time, the middle
    /// between the nearest meshes with fewer and with more cells.
    fn between(&self, cells: f64) -> f64 {
        let nearest = |of: fn(f64, f64) -> bool| {
            let meshes = self.meshes.iter().filter(|m| of(m.1, cells));
            meshes.min_by(|a, b| off(**a, cells).total_cmp(&off(**b, cells)))
        };
        let ends = nearest(|count, cells| count < cells).zip(nearest(|count, cells| count > cells));
        match ends.filter(|_| self.meshes.len() % 2 == 1) {
            Some((below, above)) => (below.0 * above.0).sqrt(),
            None => self.guess(cells),
        }
    }

    fn guess(&self, cells: f64) -> f64 {
        let scaled = |m: (f64, f64)| m.0 * (m.1 / cells).powf(1.0 / self.power(cells));
        self.nearest(cells).map_or(1.0, scaled)
    }

    fn finest_below(&self, cells: f64) -> Option<(f64, f64)> {
        self.meshes.iter().rev().find(|m| m.1 < cells).copied().or(self.meshes.first().copied())
    }

    /// Returns the exponent p in cells ~ spacing^-p, from the two meshes nearest to the requested size.
    fn power(&self, cells: f64) -> f64 {
        let mut near = self.meshes.clone();
        near.sort_by(|a, b| off(*a, cells).total_cmp(&off(*b, cells)));
        match near[..] {
            [a, b, ..] if a.0 != b.0 => ((a.1 / b.1).ln() / (b.0 / a.0).ln()).clamp(1.0, 3.0),
            _ => 2.0,
        }
    }
}

/// Relative deviation of a mesh from a number of cells, as a logarithm.
fn off(mesh: (f64, f64), cells: f64) -> f64 {
    (mesh.1 / cells).ln().abs()
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
