//! Stretches of a set: taken off its ends, put on, and sent.

use super::{BrickSet, LOW_BITS, Run, high_of};

impl BrickSet {
    /// Number of bricks before `key`.
    fn position(&self, key: u64) -> usize {
        let run = self.runs.partition_point(|r| r.high < high_of(key));
        let start = |run: usize| self.runs.get(run).map_or(self.len(), |r| r.start);
        match self.runs.get(run).filter(|r| r.high == high_of(key)) {
            None => start(run),
            Some(r) => {
                let low = &self.low[r.start..start(run + 1)];
                r.start + low.partition_point(|&low| low < key as u32)
            }
        }
    }

    /// Takes off the bricks before `key`.
    pub fn take_before(&mut self, key: u64) -> Self {
        let at = self.position(key);
        let behind = self.runs_from(at);
        let mut runs = std::mem::replace(&mut self.runs, behind);
        runs.retain(|r| r.start < at);
        Self { low: self.low.drain(..at).collect(), bits: self.bits.drain(..at).collect(), runs }
    }

    /// Takes off the bricks from `key` on.
    pub fn take_from(&mut self, key: u64) -> Self {
        let at = self.position(key);
        let runs = self.runs_from(at);
        self.runs.retain(|r| r.start < at);
        Self { low: self.low.split_off(at), bits: self.bits.split_off(at), runs }
    }

    /// The runs of the bricks from position `at` on, as if those were all.
    fn runs_from(&self, at: usize) -> Vec<Run> {
        let first = self.runs.partition_point(|r| r.start <= at).max(1) - 1;
        let runs = self.runs.get(first..).unwrap_or_default().iter();
        let behind = runs.map(|r| Run { start: r.start.max(at) - at, ..*r });
        if at < self.len() { behind.collect() } else { Vec::new() }
    }

    /// Puts on bricks that are all behind those of the set.
    ///
    /// # Panics
    /// If they are not.
    pub fn append(&mut self, behind: Self) {
        let (Some((_, last)), Some((first, _))) = (self.ends(), behind.ends()) else {
            return if self.is_empty() { *self = behind };
        };
        assert!(last < first, "bricks must be added in Morton order");
        let before = self.len();
        let same = usize::from(high_of(last) == high_of(first));
        let runs = behind.runs[same..].iter();
        self.runs.extend(runs.map(|r| Run { start: r.start + before, ..*r }));
        self.low.extend(behind.low);
        self.bits.extend(behind.bits);
    }

    /// The union of sets; quick where they follow each other, or one is much larger than the others.
    pub fn union_of(mut sets: Vec<Self>) -> Self {
        sets.retain(|s| !s.is_empty());
        sets.sort_by_key(Self::ends);
        let follows = |w: &[Self]| w[0].ends().map(|e| e.1) < w[1].ends().map(|e| e.0);
        if !sets.windows(2).all(follows) {
            sets.sort_by_key(Self::len);
            return sets.into_iter().reduce(Self::union).unwrap_or_default();
        }
        let more = sets.iter().skip(1).map(Self::len).sum();
        let mut sets = sets.into_iter();
        let mut all = sets.next().unwrap_or_default();
        all.reserve_exact(more);
        sets.for_each(|set| all.append(set));
        all
    }

    /// Writes the set behind some words: how many runs and bricks, the runs, the lower halves of the keys two to a
    /// word, the bits.
    pub fn pack(&self, words: &mut Vec<u64>) {
        words.extend([self.runs.len() as u64, self.len() as u64]);
        words.extend(self.runs.iter().flat_map(|r| [r.high, r.start as u64]));
        let (pairs, last) = self.low.as_chunks::<2>();
        words.extend(pairs.iter().map(|&[a, b]| u64::from(a) | u64::from(b) << LOW_BITS));
        words.extend(last.iter().map(|&low| u64::from(low)));
        words.extend_from_slice(&self.bits);
    }

    /// Reads what [`pack`](Self::pack) wrote at the front of some words; returns the others, too.
    ///
    /// # Panics
    /// If the words end early.
    pub fn unpack(words: &[u64]) -> (Self, &[u64]) {
        let (head, words) = words.split_at(2);
        let (runs, words) = words.split_at(2 * head[0] as usize);
        let (low, words) = words.split_at((head[1] as usize).div_ceil(2));
        let (bits, words) = words.split_at(head[1] as usize);
        let mut set = Self {
            low: low.iter().flat_map(|w| [*w as u32, (w >> LOW_BITS) as u32]).collect(),
            bits: bits.to_vec(),
            runs: runs.as_chunks().0.iter().map(|&[high, start]| Run { high, start: start as usize }).collect(),
        };
        set.low.truncate(bits.len());
        (set, words)
    }
}
