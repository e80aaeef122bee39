//! The checksum of HDF5's metadata: Bob Jenkins' lookup3, as `H5_checksum_lookup3` computes it, with initial value 0.

/// The checksum of some bytes.
pub fn lookup3(bytes: &[u8]) -> u32 {
    let start = 0xdead_beef_u32.wrapping_add(bytes.len() as u32);
    let mut s = [start; 3];
    let mut rest = bytes;
    while rest.len() > 12 {
        let (block, after) = rest.split_at(12);
        add(&mut s, block);
        mix(&mut s);
        rest = after;
    }
    if rest.is_empty() {
        return s[2];
    }
    add(&mut s, rest);
    finish(&mut s);
    s[2]
}

/// Adds up to twelve bytes, with zeros after them.
fn add(s: &mut [u32; 3], bytes: &[u8]) {
    for (word, part) in s.iter_mut().zip(bytes.chunks(4)) {
        let mut padded = [0; 4];
        padded[..part.len()].copy_from_slice(part);
        *word = word.wrapping_add(u32::from_le_bytes(padded));
    }
}

fn mix(s: &mut [u32; 3]) {
    for (step, rotation) in [4, 6, 8, 16, 19, 4].into_iter().enumerate() {
        let (a, b, c) = (step % 3, (step + 1) % 3, (step + 2) % 3);
        s[a] = s[a].wrapping_sub(s[c]) ^ s[c].rotate_left(rotation);
        s[c] = s[c].wrapping_add(s[b]);
    }
}

fn finish(s: &mut [u32; 3]) {
    for (step, rotation) in [14, 11, 25, 16, 4, 14, 24].into_iter().enumerate() {
        let (to, from) = ((step + 2) % 3, (step + 1) % 3);
        s[to] = (s[to] ^ s[from]).wrapping_sub(s[from].rotate_left(rotation));
    }
}

#[cfg(test)]
mod tests {
    use super::lookup3;

    /// Values that the author of lookup3 published.
    #[test]
    fn the_checksum_is_lookup3() {
        assert_eq!(lookup3(b""), 0xdead_beef);
        assert_eq!(lookup3(b"Four score and seven years ago"), 0x1777_0551);
    }
}
