//! A geometry with its root and the cell's edge length, from an STL file or from a case, and its position in the root.

use std::path::Path;

use contract::case::{Case, Facet};
use contract::failure::{Failure, Result};
use contract::lattice::Root;
use contract::manifest::{Enclosed, ExtentBox, Keep};
use contract::octant::LEVEL_MAX;
use contract::parity::Parity;
use contract::stl::{self, Body};
use parry3d_f64::bounding_volume::BoundingVolume as _;
use serde::Serialize;
use toml::Table;

use super::tree::{Aabb, Point, bounds};

/// What a case file would have, in the user's units. It takes precedence over that of a case.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Requested {
    /// Upper bound on the edge length of a cell at the surface.
    pub spacing_min: Option<f64>,
    /// Minimum corner and edge length of the root.
    pub root: Option<Root>,
    /// Edge length of the root, in longest edges of the bounding box.
    pub root_scale: Option<f64>,
}

/// The bounding box and its distances from the root's faces.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Extent {
    /// Least coordinates, in the user's units.
    pub low: [f64; 3],
    /// Greatest coordinates, in the user's units.
    pub high: [f64; 3],
    /// Least distance to a face of the root, negative if the body extends beyond it, in the user's units.
    pub margin: f64,
}

/// A geometry, ready for diagnosis.
#[derive(Clone, Debug)]
pub struct Input {
    /// A case of at least one and at most 2^31 / 3 facets, without seeds.
    pub case: Case,
    /// Whether all seeds lie beyond the body's bounding box, and only what they reach is kept; none without seeds.
    pub are_seeds_beyond: Option<bool>,
    /// Whether rays of what is kept count an odd number of facets: those of the seeds, if there are any.
    rays: Vec<bool>,
    /// Edge length of the cells at the surface, in the user's units; none if no spacing was given.
    pub cell: Option<f64>,
}

impl Input {
    /// Reads an STL file, or a case file if the name ends in `.toml`.
    ///
    /// # Errors
    /// If a file cannot be read or the geometry cannot be meshed.
    pub fn read(path: &Path, requested: Requested) -> Result<Self> {
        let is_case = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let (mut table, Body { facets, solids }, seeds) = match is_case {
            true => {
                let Case { table, facets, solids, seeds, .. } = Case::read(path)?;
                (table, Body { facets, solids }, seeds)
            }
            false => (Table::new(), stl::read(path)?, Vec::new()),
        };
        // A seed may lie beyond another root.
        table.retain(|key, _| key != "seeds" && (key != "root" || requested.root_scale.is_none()));
        let input = Self::of(table, facets, requested);
        let mut input = input.map_err(|why| Failure::about(path, why))?;
        input.case.solids = solids;
        if !seeds.is_empty() {
            let at = seeds.iter().filter_map(|&seed| input.case.root.quantise(seed));
            let parity = Parity::new(&input.case.facets_lattice);
            input.rays = at.flat_map(|at| parity.inside(at)).collect();
            let body = bounds(&input.case.facets);
            let is_beyond = |&seed: &[f64; 3]| !body.contains_local_point(Point::from(seed));
            let are_beyond = seeds.iter().all(is_beyond) && input.case.keep != Keep::All;
            input.are_seeds_beyond = Some(are_beyond);
        }
        Ok(input)
    }

    /// A geometry with the keys of its case file, if it has one, that no other ones replace.
    ///
    /// # Errors
    /// One sentence if the geometry cannot be meshed: it has no facets or too many, a vertex is not finite or too
    /// far outside the root, or root and spacing contradict the definition; or if a key is not one of a case file.
    pub fn of(mut table: Table, facets: Vec<Facet>, requested: Requested) -> Result<Self, String> {
        match facets.len() {
            0 => return Err("the geometry has no facets".to_owned()),
            1..=FACETS_MAX => {}
            n => return Err(format!("{n} facets exceed the limit of {FACETS_MAX}")),
        }
        table.extend(Table::try_from(requested).expect("numbers are representable in TOML"));
        let is_known = table.contains_key("spacing_min");
        // A spacing above every root edge stands for level 0.
        table.entry("spacing_min").or_insert(f64::MAX.into());
        let case = Case::from_parts(&table.to_string(), facets)?;
        let cell = is_known.then(|| case.root.edge_of(case.level_surface));
        Ok(Self { rays: vec![case.keep == Keep::Inside], case, are_seeds_beyond: None, cell })
    }

    /// Whether the mesh has leaves within the body, or outside of it: by what the case keeps or, if it has seeds, by their rays.
    pub fn is_meshed(&self, is_inside: bool) -> bool {
        self.case.keep == Keep::All || self.rays.contains(&is_inside)
    }

    /// Whether a space that rays take for outside is meshed: with the inside, with enclosed space, or from a seed in the body's bounding box.
    pub fn is_space_meshed(&self) -> bool {
        let by_rays = || self.is_meshed(true) || self.case.enclosed == Enclosed::Keep;
        self.are_seeds_beyond.map_or_else(by_rays, |are_beyond| !are_beyond)
    }

    /// Whether a wall between solids can change the region: within it, or by the crossing leaves on the wall.
    pub fn are_walls_meshed(&self) -> bool {
        self.is_meshed(true) || self.case.keep_crossing
    }

    /// Whether an overlap of solids can change the region: such a space, crossing leaves in it, or one that may reach the root's boundary.
    pub fn are_overlaps_meshed(&self) -> bool {
        let cell = self.cell.unwrap_or(self.case.root.edge_of(LEVEL_MAX));
        let is_cut = || self.are_seeds_beyond.is_none() && self.extent().margin <= cell;
        self.case.keep_crossing || self.is_space_meshed() || is_cut()
    }

    /// Edge length of the finest cells at a surface in a region of the user's units: those of the boxes that meet it, if they are finer.
    pub fn cell_in(&self, region: &Aabb) -> Option<f64> {
        let corner = |at| Point::from(self.case.root.to_user(at));
        let meets = |b: &&ExtentBox| Aabb::new(corner(b.min), corner(b.max)).intersects(region);
        let boxes = self.case.boxes.iter().filter(|b| b.is_in_root());
        let edges = boxes.filter(meets).map(|b| self.case.root.edge_of(b.level));
        self.cell.map(|cell| edges.fold(cell, f64::min))
    }

    /// The centroid of a facet, in the user's units.
    pub fn centroid(&self, facet: u32) -> [f64; 3] {
        let corners = self.case.facets[facet as usize].map(|v| v.map(f64::from));
        std::array::from_fn(|a| (corners[0][a] + corners[1][a] + corners[2][a]) / 3.0)
    }

    /// The extent of the facets.
    pub fn extent(&self) -> Extent {
        let Aabb { mins, maxs } = bounds(&self.case.facets);
        let origin = Point::from(self.case.root.origin);
        let margin =
            (mins - origin).min(origin + Point::splat(self.case.root.edge) - maxs).min_element();
        Extent { low: mins.to_array(), high: maxs.to_array(), margin }
    }
}

/// Corners are numbered in 32 bits, three per facet, with one bit left for a direction.
const FACETS_MAX: usize = (1 << 31) / 3;

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: Facet = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn root_and_cell_follow_the_definition() {
        let requested =
            Requested { spacing_min: Some(0.3), root_scale: Some(2.0), ..Requested::default() };
        let input = Input::of(Default::default(), vec![FACET], requested).unwrap();
        assert_eq!(input.case.root, Root { origin: [-1.0, -1.5, -2.0], edge: 4.0 });
        assert_eq!(input.cell, Some(0.25));
        assert_eq!(
            Input::of(Default::default(), vec![FACET], Requested::default()).unwrap().cell,
            None
        );
    }

    #[test]
    fn a_case_file_gives_root_and_cell_unless_others_are_requested() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("body.toml");
        let own = Root { origin: [-4.0, -3.0, -2.0], edge: 8.0 };
        let text = format!(
            "spacing_min = 0.5\nkeep = 'inside'\nroot = {{ origin = {:?}, edge = {:?} }}\n\
             generator = {{ shape = 'cube', facets = 12 }}\n",
            own.origin, own.edge
        );
        std::fs::write(&path, &text).unwrap();
        let read = |requested| {
            let input = Input::read(&path, requested).unwrap();
            assert_eq!((input.case.keep, input.case.facets.len()), (Keep::Inside, 12));
            (input.case.root, input.cell)
        };
        assert_eq!(read(Requested::default()), (own, Some(0.5)));
        let spacing_min = Some(0.125);
        assert_eq!(read(Requested { spacing_min, ..Requested::default() }), (own, Some(0.125)));
        let other = Root { origin: [-2.0; 3], edge: 4.0 };
        assert_eq!(
            read(Requested { root: Some(other), ..Requested::default() }),
            (other, Some(0.5))
        );
        // The generated cube has edge 1. The spacing is that of the file, not its cell's.
        let root_scale = Some(4.2);
        let (root, cell) = read(Requested { root_scale, ..Requested::default() });
        assert_eq!((root.edge, cell), (4.2, Some(0.525 / 2.0)));
        std::fs::write(&path, text.replace("0.5", "0.6")).unwrap();
        assert_eq!(read(Requested { root_scale, ..Requested::default() }).1, Some(0.525));
        let a_box = "[[box]]\nmin = [0.0, 0.0, 0.0]\nmax = [1.0, 1.0, 1.0]\nspacing = 0.1\n";
        std::fs::write(&path, format!("{text}{a_box}")).unwrap();
        let input = Input::read(&path, Requested::default()).unwrap();
        let within = |at: f64| input.cell_in(&Aabb::new(Point::splat(at), Point::splat(at)));
        assert_eq!([0.5, 1.5].map(within), [Some(0.0625), Some(0.5)]);
    }

    #[test]
    fn a_geometry_that_cannot_be_meshed_is_refused() {
        let why = |facets: Vec<Facet>, requested| {
            Input::of(Default::default(), facets, requested).unwrap_err()
        };
        let mut broken = FACET;
        broken[1][2] = f32::NAN;
        let root = Some(Root { origin: [0.0; 3], edge: 4.0 });
        assert!(why(vec![FACET, broken], Requested::default()).contains("facet 1"));
        assert!(why(vec![broken], Requested { root, ..Requested::default() }).contains("facet 0"));
        assert!(why(vec![], Requested::default()).contains("no facets"));
        let both = Requested { root, root_scale: Some(2.0), ..Requested::default() };
        assert!(why(vec![FACET], both).contains("exclude"));
        for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-12] {
            let spacing_min = Some(spacing);
            why(vec![FACET], Requested { spacing_min, root, ..Requested::default() });
        }
    }
}
