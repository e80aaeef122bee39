//! Messages to or from many ranks, contiguous in memory.
//!
//! One rank of a thousand sends to dozens of others, to most of them a few words. Allocating memory for each message would take
//! longer than writing and reading the message.

use bytemuck::Pod;

/// Words by rank: at most one message for each receiver, or from each sender. No message is empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MessageBuffer {
    words: Vec<u64>,
    /// The rank and the end of each message, which starts where the one before it ends.
    messages: Vec<(usize, usize)>,
}

impl MessageBuffer {
    /// An empty buffer with capacity for a number of words.
    pub fn with_capacity(words: usize) -> Self {
        Self { words: Vec::with_capacity(words), messages: Vec::new() }
    }

    /// One message for each receiver, with its entries in the order given.
    pub fn of_entries<const N: usize>(mut entries: Vec<(usize, [u64; N])>) -> Self {
        entries.sort_by_key(|e| e.0);
        entries.into_iter().collect()
    }

    /// Appends words to the last message if that is for `rank`, else starts a new message.
    pub fn write(&mut self, rank: usize, words: impl IntoIterator<Item = u64>) {
        self.append(rank, |all| all.extend(words));
    }

    /// The same for the words that `write` appends to the vector that it is given.
    pub fn append(&mut self, rank: usize, write: impl FnOnce(&mut Vec<u64>)) {
        let start = self.words.len();
        write(&mut self.words);
        let end = self.words.len();
        match self.messages.last_mut() {
            Some(last) if last.0 == rank => last.1 = end,
            _ if end > start => self.messages.push((rank, end)),
            _ => {}
        }
    }

    /// The same for values, as their bytes, padded to whole words: one call writes all values of a message. A value takes 8 bytes
    /// or more.
    pub fn write_values<T: Pod>(&mut self, rank: usize, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let words = self.room(rank, bytes.len().div_ceil(size_of::<u64>()));
        bytemuck::cast_slice_mut(words)[..bytes.len()].copy_from_slice(bytes);
    }

    /// The same for a number of words that are to be written in place; they are zero at first.
    pub fn room(&mut self, rank: usize, words: usize) -> &mut [u64] {
        let start = self.words.len();
        self.append(rank, |all| all.resize(start + words, 0));
        &mut self.words[start..]
    }

    /// The values of all messages.
    pub fn values<T: Pod>(&self) -> Vec<T> {
        const { assert!(size_of::<T>() >= size_of::<u64>(), "padding is shorter than a value") };
        let mut values = Vec::with_capacity(size_of_val(&*self.words) / size_of::<T>());
        for (_, words) in self.messages() {
            let all = bytemuck::cast_slice::<u64, u8>(words).chunks_exact(size_of::<T>());
            values.extend(all.map(bytemuck::pod_read_unaligned::<T>));
        }
        values
    }

    /// The messages, each with its rank, in the order in which they were written.
    pub fn messages(&self) -> impl Iterator<Item = (usize, &[u64])> {
        let words = |start: &mut usize, &(rank, end): &(usize, usize)| {
            Some((rank, &self.words[std::mem::replace(start, end)..end]))
        };
        self.messages.iter().scan(0, words)
    }

    /// The words of all messages, contiguous.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// The same, to be written in place.
    pub fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }
}

/// Messages with their ranks; consecutive ones of the same rank become one, and empty ones are dropped.
impl<W: IntoIterator<Item = u64>> FromIterator<(usize, W)> for MessageBuffer {
    fn from_iter<I: IntoIterator<Item = (usize, W)>>(messages: I) -> Self {
        let mut message_buffer = Self::default();
        messages.into_iter().for_each(|(rank, words)| message_buffer.write(rank, words));
        message_buffer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn contents(message_buffer: &MessageBuffer) -> Vec<(usize, Vec<u64>)> {
        message_buffer.messages().map(|(rank, words)| (rank, words.to_vec())).collect()
    }

    #[test]
    fn words_for_the_rank_of_the_last_message_lengthen_it() {
        let mut message_buffer = MessageBuffer::default();
        message_buffer.write(3, []);
        message_buffer.write(7, [1, 2]);
        message_buffer.write(7, []);
        message_buffer.room(7, 2)[1] = 5;
        assert!(message_buffer.room(0, 0).is_empty());
        message_buffer.room(4, 1)[0] = 9;
        assert_eq!(contents(&message_buffer), [(7, vec![1, 2, 0, 5]), (4, vec![9])]);
        assert_eq!(message_buffer.words(), [1, 2, 0, 5, 9]);
        assert_eq!(message_buffer, contents(&message_buffer).into_iter().collect());
    }

    #[test]
    fn values_of_any_size_are_read_as_they_were_written() {
        for count in 0..5i32 {
            let values: Vec<[i32; 9]> = (0..count).map(|i| [i32::MIN + i; 9]).collect();
            let mut messages = MessageBuffer::default();
            messages.write_values(4, &values);
            messages.write_values(2, &values[..count.min(1) as usize]);
            let read: Vec<[i32; 9]> = messages.values();
            assert_eq!(read, [&values[..], &values[..count.min(1) as usize]].concat());
        }
    }

    proptest! {
        #[test]
        fn entries_are_sorted_by_rank_and_keep_their_order(entries in prop::collection::vec((0usize..6, any::<[u64; 2]>()), 0..40)) {
            let mut want: BTreeMap<usize, Vec<u64>> = BTreeMap::new();
            entries.iter().for_each(|(rank, words)| want.entry(*rank).or_default().extend(words));
            prop_assert_eq!(contents(&MessageBuffer::of_entries(entries)), want.into_iter().collect::<Vec<_>>());
        }
    }
}
