//! Disjoint sets of the numbers from 0 on. Each is represented by its least member.

/// The sets.
pub struct Sets(Vec<u32>);

impl Sets {
    /// As many sets of one number each, fewer than 2^32.
    pub fn new(len: usize) -> Self {
        Self((0..u32::try_from(len).expect("fewer than 2^32 members")).collect())
    }

    /// The representative of a number's set. Halves the path to it.
    pub fn root(&mut self, mut of: u32) -> u32 {
        while self.0[of as usize] != of {
            let above = self.0[self.0[of as usize] as usize];
            self.0[of as usize] = above;
            of = above;
        }
        of
    }

    /// Unites the sets of two numbers.
    pub fn union(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
