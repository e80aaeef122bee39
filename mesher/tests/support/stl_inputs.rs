//! STL files that are nearly always nearly valid, for the comparison of readers.
#![allow(missing_docs)]

/// A sequence of pseudorandom numbers (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn of<'a>(&mut self, items: &[&'a [u8]]) -> &'a [u8] {
        items[self.below(items.len())]
    }
}

const WORDS: &[&[u8]] = &[
    b"solid",
    b"endsolid",
    b"facet",
    b"normal",
    b"outer",
    b"loop",
    b"vertex",
    b"endloop",
    b"endfacet",
    b"SOLID",
    b"EndSolid",
    b"0",
    b"1",
    b"-2.5e-1",
    b"1.",
    b".5",
    b".",
    b"+3E+2",
    b"1e",
    b"1e99",
    b"-0",
    b"1e-60",
    b"nan",
    b"-NaN",
    b"inf",
    b"infinity",
    b"0x1p3",
    b"1_0",
    b"1,5",
    b"banana",
    b"\xff\xfe",
    b"\xc2\xa0",
    b"\xe2\x80\xa8",
    b"\xef\xbb\xbf",
    b"\0",
    b"x",
    b"16777217",
    b"0.1",
];
const GAPS: &[&[u8]] =
    &[b" ", b" ", b" ", b"\n", b"\n", b"\r\n", b"\r", b"\t", b"\x0b", b"\x0c", b"  \n ", b""];

/// A valid file: one or two solids, with line ends of one kind or anything between words.
fn valid(random: &mut Random) -> Vec<&'static [u8]> {
    let gap: Option<&[u8]> = (random.below(3) > 0).then(|| random.of(&GAPS[..4]));
    let mut tokens: Vec<&[u8]> = Vec::new();
    for _ in 0..=random.below(2) {
        tokens.extend([b"solid" as &[u8], b" name" as &[u8], b"\n"]);
        for _ in 0..random.below(3) {
            let facet: [&[u8]; 21] = [
                b"facet",
                b"normal",
                b"0",
                b"0",
                b"1",
                b"outer",
                b"loop",
                b"vertex",
                b"0",
                b"0",
                b"0",
                b"vertex",
                b"1",
                b".5",
                b"-0",
                b"vertex",
                b"0.1",
                b"1e-3",
                b"7",
                b"endloop",
                b"endfacet",
            ];
            for word in facet {
                tokens.extend([word, gap.unwrap_or_else(|| random.of(&GAPS[..11]))]);
            }
        }
        tokens.extend([
            b"endsolid" as &[u8],
            b" name",
            if random.below(4) > 0 { b"\n" } else { b" " },
        ]);
    }
    tokens
}

/// A file that is nearly always nearly valid.
pub fn input(random: &mut Random) -> Vec<u8> {
    if random.below(16) == 0 {
        return binary(random);
    }
    let mut tokens = valid(random);
    for _ in 0..random.below(4) {
        let at = random.below(tokens.len());
        match random.below(5) {
            0 if tokens.len() > 1 => drop(tokens.remove(at)),
            0 | 1 => tokens[at] = random.of(WORDS),
            2 => tokens[at] = random.of(GAPS),
            3 => {
                tokens.insert(at, b" ");
                tokens.insert(at, random.of(WORDS));
            }
            _ => tokens.truncate(at.max(1)),
        }
    }
    let mut bytes = tokens.concat();
    if random.below(8) == 0 {
        let white = [b"\n", b" ", b"\x0b"][random.below(3)];
        bytes = [b"\xef\xbb\xbf".repeat(random.below(3)), white.repeat(random.below(2000)), bytes]
            .concat();
    }
    if random.below(4) == 0 && !bytes.is_empty() {
        let at = random.below(bytes.len());
        bytes[at] ^= 1 << random.below(8);
    }
    bytes
}

/// A binary file, whose length its header may contradict.
fn binary(random: &mut Random) -> Vec<u8> {
    let mut bytes = if random.below(2) == 0 { b"solid x".to_vec() } else { Vec::new() };
    bytes.resize(80, if random.below(2) == 0 { b' ' } else { 0 });
    let count = random.below(4);
    bytes.extend((count as u32).to_le_bytes());
    bytes.extend((0..50 * count).map(|i| if i % 4 == 3 { 0x3f } else { random.next() as u8 }));
    if random.below(4) == 0 {
        bytes.truncate(random.below(bytes.len() + 1));
    }
    bytes
}
