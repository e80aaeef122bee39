//! Where paths start and end if the user does not say: at the regions that leaked, and at seeds.

use super::ends::{self, Target};
use super::space::Space;
use super::{Leaks, Point};
use contract::failure::Failure;
use contract::manifest::Leak;

impl<F: FnMut(u8) -> Result<Vec<u64>, Failure>> Leaks<'_, F> {
    /// A point of each region that leaked. One that is closed at several coarser spacings is listed once, with the finest of them.
    ///
    /// # Errors
    /// If a base tree cannot be made.
    pub fn regions(&mut self, leaks: &[Leak]) -> Result<Vec<[f64; 3]>, Failure> {
        let edge = self.case.root.edge;
        let level = |leak: &Leak| (edge / leak.spacing_coarse).log2().round() as u8;
        let Some(finest) = leaks.iter().map(level).max() else { return Ok(Vec::new()) };
        let (of_finest, others): (Vec<&Leak>, Vec<&Leak>) =
            leaks.iter().partition(|leak| level(leak) == finest);
        let mut points: Vec<_> = of_finest.iter().map(|leak| leak.point).collect();
        for leak in others {
            if self.joined(finest, leak.point, &points[..of_finest.len()])?.is_none() {
                points.push(leak.point);
            }
        }
        Ok(points)
    }

    /// The first seed that is joined to an end at the case's spacing, or else the first one; `None` without seeds.
    ///
    /// # Errors
    /// If the end is outside the root, or a base tree cannot be made.
    pub fn seed(&mut self, end: Target) -> Result<Option<[f64; 3]>, Failure> {
        let seeds = &self.case.seeds;
        let joined = match end {
            Target::Point(at) if seeds.len() > 1 => {
                self.joined(self.case.level_surface, at, seeds)?
            }
            _ => None,
        };
        Ok(joined.or_else(|| seeds.first().copied()))
    }

    /// The first of some places that free leaves of the base tree of a level join to an end.
    fn joined(
        &mut self,
        level: u8,
        end: [f64; 3],
        places: &[[f64; 3]],
    ) -> Result<Option<[f64; 3]>, Failure> {
        let root = self.case.root;
        let on_lattice = |at| -> Result<Point, String> { ends::on_lattice("--to", at, &root) };
        let end = on_lattice(end)?;
        self.make_tree(level)?;
        let space = Space::new(&self.trees[&level], &self.facets)?;
        let reached = space.reached(space.locate(end));
        let is_reached = |place: Point| reached[space.locate(place) as usize];
        Ok(places.iter().copied().find(|&place| on_lattice(place).is_ok_and(is_reached)))
    }
}
