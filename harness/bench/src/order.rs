//! Items by key, in the order in which the keys first occur.

/// Returns the items of every key.
pub fn by_key<T: Copy, K: PartialEq>(
    items: impl IntoIterator<Item = T>,
    key: impl Fn(T) -> K,
) -> Vec<(K, Vec<T>)> {
    let mut found: Vec<(K, Vec<T>)> = Vec::new();
    for item in items {
        let key = key(item);
        match found.iter_mut().find(|(other, _)| *other == key) {
            Some((_, items)) => items.push(item),
            None => found.push((key, vec![item])),
        }
    }
    found
}

/// Returns the items without repetitions.
pub fn distinct<T: PartialEq>(items: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for item in items {
        if !found.contains(&item) {
            found.push(item);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_in_the_order_of_their_first_items() {
        assert_eq!(by_key([3, 4, 1, 2], |i| i % 2), [(1, vec![3, 1]), (0, vec![4, 2])]);
        assert_eq!(distinct([3, 1, 3, 2, 1]), [3, 1, 2]);
    }
}
