//! Finds the spacing that gives a requested number of cells by extrapolation from coarser meshes.
//!
//! The number of cells follows a power of the spacing, close to -2 if cells fill layers around a surface. The exponent is
//! estimated from the two nearest meshes so far, each a few times finer than the previous one.

/// Tolerated relative deviation of the number of cells.
const TOLERANCE: f64 = 0.02;
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
        for _ in 0..10 {
            if self.is_known(cells) {
                break;
            }
            let next = match self.finest_below(cells) {
                None => coarse,
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
        let answer = self.guess(cells);
        self.answers.push((cells, answer));
        Ok(answer)
    }

    /// Whether one mesh is close enough, or two determine the exponent.
    fn is_known(&self, cells: f64) -> bool {
        let off = |m: &&(f64, f64)| (m.1 / cells).ln().abs();
        let close = self.meshes.iter().any(|m| off(&m) < TOLERANCE);
        close || self.meshes.iter().filter(|m| off(m) < NEAR.ln()).count() > 1
    }

    fn guess(&self, cells: f64) -> f64 {
        let nearest = self
            .meshes
            .iter()
            .min_by(|a, b| (a.1 / cells).ln().abs().total_cmp(&(b.1 / cells).ln().abs()));
        nearest.map_or(1.0, |m| m.0 * (m.1 / cells).powf(1.0 / self.power(cells)))
    }

    fn finest_below(&self, cells: f64) -> Option<(f64, f64)> {
        self.meshes.iter().rev().find(|m| m.1 < cells).copied().or(self.meshes.first().copied())
    }

    /// Returns the exponent p in cells ~ spacing^-p, from the two meshes nearest to the requested size.
    fn power(&self, cells: f64) -> f64 {
        let mut near = self.meshes.clone();
        near.sort_by(|a, b| (a.1 / cells).ln().abs().total_cmp(&(b.1 / cells).ln().abs()));
        match near[..] {
            [a, b, ..] if a.0 != b.0 => ((a.1 / b.1).ln() / (b.0 / a.0).ln()).clamp(1.0, 3.0),
            _ => 2.0,
        }
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
