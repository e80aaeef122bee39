//! Shells: components of facets that are connected by shared edges.

use contract::lattice::{FacetLattice, dot, normal};
use contract::parity::Parity;
use contract::sets::Sets;
use parry3d_f64::bounding_volume::BoundingVolume as _;

use super::edges::Edges;
use super::finding::{Finding, Kind, Place};
use super::input::Input;
use super::tree::{Aabb, triangle};
use std::collections::{HashMap, HashSet};

/// A shell.
pub struct Shell {
    /// Index of the first facet.
    pub facet_first: u32,
    /// Whether an even number of facets meets at every edge, so that rays agree about the inside.
    pub is_closed: bool,
    /// Whether it is closed, or open only at T-junctions and where the root cuts it.
    is_tight: bool,
    /// Whether as many facets traverse every edge in one direction as in the other, but for edges with one facet.
    is_oriented: bool,
    /// Six times the enclosed volume on the lattice, negative if the facets are wound inward; without meaning unless `is_oriented` and `is_tight`.
    volume_sixfold: i128,
    /// Whether it is tight and lies in an odd number of other shells, by all rays, so that its interior is outside.
    is_nested: bool,
    /// Whether it is wound the other way than the shells around it, by the sum of all rays: one flipped facet changes nothing.
    is_cavity: bool,
    /// On the lattice, whose coordinates are exact in f64.
    bounds: Aabb,
}

impl Shell {
    /// Whether the bounding box lies in the interior of that of the other shell.
    fn may_be_in(&self, other: &Self) -> bool {
        let (inner, outer) = (self.bounds, other.bounds);
        outer.mins.cmplt(inner.mins).all() && inner.maxs.cmplt(outer.maxs).all()
    }
}

/// The shells of a geometry.
pub struct Shells {
    /// All shells, in the order of their first facets.
    pub all: Vec<Shell>,
    /// The index of every facet's shell; [`u32::MAX`] for a facet without edges, which belongs to none.
    pub of: Vec<u32>,
}

impl Shells {
    /// Connects the facets that share edges; those at openings are `torn`.
    pub fn new(edges: &Edges, lattice: &[FacetLattice], torn: &HashSet<u32>) -> Self {
        let mut sets = Sets::new(edges.corners.len());
        for uses in edges.iter() {
            uses[1..].iter().for_each(|other| sets.union(uses[0].facet, other.facet));
        }
        let mut all: Vec<Shell> = Vec::new();
        let mut of = vec![u32::MAX; edges.corners.len()];
        for (facet, _) in edges.corners.iter().enumerate().filter(|(_, ends)| ends.is_some()) {
            // The representative is the lowest facet, so its shell exists before those of its other facets.
            let first = sets.root(facet as u32);
            if first as usize == facet {
                of[facet] = all.len() as u32;
                all.push(Shell {
                    facet_first: first,
                    is_closed: true,
                    is_tight: true,
                    is_oriented: true,
                    volume_sixfold: 0,
                    is_nested: false,
                    is_cavity: false,
                    bounds: Aabb::new_invalid(),
                });
            }
            of[facet] = of[first as usize];
            let shell = &mut all[of[facet] as usize];
            shell.volume_sixfold += dot(lattice[facet][0], normal(&lattice[facet]));
            shell.bounds.merge(&triangle(&lattice[facet]).local_aabb());
        }
        for uses in edges.iter() {
            let shell = &mut all[of[uses[0].facet as usize] as usize];
            let n = uses.len();
            shell.is_closed &= n % 2 == 0;
            shell.is_tight &= n % 2 == 0 || n == 1 && !torn.contains(&uses[0].facet);
            shell.is_oriented &= n == 1 || 2 * uses.iter().filter(|one| one.is_down).count() == n;
        }
        let mut own = vec![Vec::new(); all.len()];
        for (facet, shell) in lattice.iter().zip(&of).filter(|(_, shell)| **shell != u32::MAX) {
            own[*shell as usize].push(*facet);
        }
        let mut interiors: HashMap<usize, Parity> = HashMap::new();
        let tight: Vec<usize> = (0..all.len()).filter(|&i| all[i].is_tight).collect();
        for &index in &tight {
            // Within an open shell, it may matter which corner: it does not depend on the order of the facets.
            let corner = *own[index].iter().flatten().min().expect("a shell has facets");
            let winding = |other: usize| {
                let interior = interiors.entry(other).or_insert_with(|| Parity::new(&own[other]));
                let windings = interior.windings(corner);
                windings.iter().all(|n| n % 2 != 0).then(|| windings.iter().sum::<i64>())
            };
            let may_be_in = |other: &usize| all[index].may_be_in(&all[*other]);
            // Not only closed ones: edges at T-junctions and narrow holes are open, too.
            let around: Vec<i64> = (0..all.len()).filter(may_be_in).filter_map(winding).collect();
            all[index].is_nested = around.len() % 2 == 1;
            let is_inward = around.iter().sum::<i64>() < 0;
            all[index].is_cavity = is_inward != (all[index].volume_sixfold < 0);
        }
        Self { all, of }
    }

    /// Whether the normal of a facet points out of the solid that its shell bounds; none if its shell is open, its winding inconsistent, or its
    /// volume zero, as where a solid appears twice, once inside out.
    pub fn outward(&self, facet: u32) -> Option<bool> {
        let shell = self.all.get(self.of[facet as usize] as usize)?;
        let is_inward = (shell.volume_sixfold < 0) != shell.is_nested;
        (shell.is_closed && shell.is_oriented && shell.volume_sixfold != 0).then_some(!is_inward)
    }

    /// Whether two shells, by index, are different solids: closed, and neither can contain the other, by their bounding boxes, nor are both within a third.
    pub fn are_different_solids(&self, a: u32, b: u32) -> bool {
        let [Some(p), Some(q)] = [a, b].map(|i| self.all.get(i as usize)) else { return false };
        let may_be_one = p.is_nested && q.is_nested || p.may_be_in(q) || q.may_be_in(p);
        a != b && p.is_closed && q.is_closed && !may_be_one
    }

    /// Closed shells that are inside out, and those that lie in an odd number of others.
    pub fn findings(&self, input: &Input, first: usize) -> [Finding; 2] {
        let mut findings = [Kind::InsideOut, Kind::Nested].map(Finding::new);
        for shell in &self.all {
            let is_wound_inward = shell.is_closed && shell.is_oriented && shell.volume_sixfold < 0;
            if !shell.is_nested && !is_wound_inward {
                continue;
            }
            let at = usize::from(shell.is_nested);
            // A solid in a solid is a space, like an overlap.
            let is_space = shell.is_nested && !(shell.is_oriented && shell.is_cavity);
            findings[at].count_changing += u64::from(is_space && input.are_overlaps_meshed());
            let facet = shell.facet_first;
            findings[at].add(first, || Place::new(vec![facet], input.centroid(facet)));
        }
        findings
    }
}
