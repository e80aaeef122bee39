//! The least distances of opposite facets, which bound those of the places to list.

use std::collections::BinaryHeap;

/// The least squared distances of facets from opposite ones, as many as determine the places to list.
pub struct Least {
    /// Bits of the distances, which have the order of the distances.
    least: BinaryHeap<u64>,
    /// Maximum number of distances: a place is listed for at most two facets.
    count: usize,
    /// Distances that are not below it are not needed.
    pub bound: f64,
}

impl Least {
    /// No distances yet, for this number of places. Distances that are not below the bound are not needed.
    pub fn new(first: usize, bound: f64) -> Self {
        Self { least: BinaryHeap::new(), count: first.saturating_mul(2), bound }
    }

    /// Adds an upper bound on the distance of a facet that was not added before.
    pub fn add(&mut self, squared: f64) {
        if squared >= self.bound {
            return;
        }
        self.least.push(squared.to_bits());
        if self.least.len() > self.count {
            self.least.pop();
        }
        if self.least.len() == self.count {
            let greatest = self.least.peek().map_or(0.0, |&bits| f64::from_bits(bits));
            self.bound = self.bound.min(greatest);
        }
    }
}
