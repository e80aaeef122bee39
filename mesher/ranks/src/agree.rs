//! Errors and texts that all ranks agree on.

use crate::{Comm, gather};
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher, Hash};

/// Makes ranks agree on errors: all return the error of the lowest rank that has one. An error is an exit code and a sentence.
/// Collective.
///
/// # Panics
/// Never: a rank without a value has an error.
pub fn agree<T, E>(comm: &dyn Comm, mine: Result<T, E>) -> Result<T, E>
where
    E: Into<(i32, String)> + From<(i32, String)>,
{
    let mut packed = Vec::new();
    let value = mine.map_err(|error| {
        let (code, sentence) = error.into();
        packed.push(code as u64);
        pack_bytes(sentence.as_bytes(), &mut packed);
    });
    match comm.all_gather(&packed).messages().next() {
        None => Ok(value.expect("no rank has an error")),
        Some((_, words)) => {
            let (sentence, _) = unpack_bytes(&words[1..]);
            Err(E::from((words[0] as i32, String::from_utf8_lossy(sentence).into_owned())))
        }
    }
}

/// The first rank with another value than rank 0, by its hash. Collective.
pub fn first_other(comm: &dyn Comm, value: &impl Hash) -> Option<usize> {
    let hashes = gather(comm, &[BuildHasherDefault::<DefaultHasher>::new().hash_one(value)]);
    hashes.iter().position(|&hash| hash != hashes[0])
}

/// The text of rank 0. Collective.
pub fn text_of_first(comm: &dyn Comm, text: &str) -> String {
    let mut packed = Vec::new();
    if comm.rank() == 0 {
        pack_bytes(text.as_bytes(), &mut packed);
    }
    let gathered = comm.all_gather(&packed);
    String::from_utf8_lossy(unpack_bytes(gathered.words()).0).into_owned()
}

/// Appends bytes to a message, after their number.
pub fn pack_bytes(bytes: &[u8], words: &mut Vec<u64>) {
    words.push(bytes.len() as u64);
    let start = words.len();
    words.resize(start + bytes.len().div_ceil(8), 0);
    bytemuck::cast_slice_mut(&mut words[start..])[..bytes.len()].copy_from_slice(bytes);
}

/// The bytes at the front of a message, and the words after them.
pub fn unpack_bytes(words: &[u64]) -> (&[u8], &[u64]) {
    let bytes = words[0] as usize;
    let (packed, rest) = words[1..].split_at(bytes.div_ceil(8));
    (&bytemuck::cast_slice(packed)[..bytes], rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim;

    #[test]
    fn all_ranks_have_the_error_of_the_lowest_rank_that_has_one() {
        for sentence in ["", "no space", "häßlich: 'x'", "12345678"] {
            let results = sim::run(4, 1, |comm| {
                let mine = match comm.rank() {
                    0 | 2 => Ok(comm.rank()),
                    rank => Err((rank as i32, sentence.to_owned())),
                };
                agree(comm, mine)
            });
            assert!(results.iter().all(|r| *r == Err((1, sentence.to_owned()))), "{results:?}");
        }
        let results = sim::run(3, 1, |comm| agree::<_, (i32, String)>(comm, Ok(comm.rank())));
        assert_eq!(results, [Ok(0), Ok(1), Ok(2)]);
    }
}
