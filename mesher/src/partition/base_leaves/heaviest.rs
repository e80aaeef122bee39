//! The number of leaves in the heaviest base leaf, which bounds the load balance of any partition.

use bricks::octant::{LEVEL_MAX, Level};

/// Counts this rank's leaves by base leaf, as they are streamed in Morton order.
pub struct Heaviest<'a> {
    /// Level-19 codes at which base leaves begin; none if these are the octants of one level.
    starts: &'a [u64],
    /// Bits of a code within an octant of that level.
    shift: u32,
    /// The end of the current base leaf, and its leaves so far.
    end: u64,
    leaves: u64,
    max: u64,
}

impl<'a> Heaviest<'a> {
    /// Base leaves that begin at `starts` or, if there are none, the octants of `level`.
    pub fn new(starts: &'a [u64], level: Level) -> Self {
        Self { starts, shift: 3 * (LEVEL_MAX - level), end: 0, leaves: 0, max: 0 }
    }

    /// Counts the next leaves. One that is larger than a base leaf counts for the first in it.
    pub fn add(&mut self, mut words: &[u64]) {
        while let Some(code) = words.first().map(|w| w >> 7) {
            if code >= self.end {
                self.leaves = 0;
                self.end = match self.starts.get(self.starts.partition_point(|s| *s <= code)) {
                    Some(end) => *end,
                    None if self.starts.is_empty() => ((code >> self.shift) + 1) << self.shift,
                    None => u64::MAX,
                };
            }
            let is_last = words[words.len() - 1] >> 7 < self.end;
            let count =
                if is_last { words.len() } else { words.partition_point(|w| w >> 7 < self.end) };
            self.leaves += count as u64;
            self.max = self.max.max(self.leaves);
            words = &words[count..];
        }
    }

    /// Leaves in the heaviest base leaf.
    pub fn max(&self) -> u64 {
        self.max
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::octant::{Side, start57, word};

    #[test]
    fn leaves_are_counted_by_base_leaf_whatever_the_pieces() {
        let of = |l, codes: &[u64]| -> Vec<u64> {
            codes.iter().map(|c| word(l, *c, Side::Outside)).collect()
        };
        let words =
            [of(2, &[1, 3]), of(1, &[1]), of(3, &[128, 129, 130, 200]), of(2, &[32, 63])].concat();
        for (starts, level, want) in
            [(&[0, 2, 5][..], 1, 5), (&[0, 4], 1, 7), (&[], 1, 3), (&[], 0, 9), (&[], 2, 3)]
        {
            let starts: Vec<u64> = starts.iter().map(|c| start57(1, *c)).collect();
            for piece in 1..=words.len() {
                let mut heaviest = Heaviest::new(&starts, level);
                words.chunks(piece).for_each(|piece| heaviest.add(piece));
                assert_eq!(heaviest.max(), want, "{starts:?}, level {level}, pieces of {piece}");
            }
        }
    }
}
