"""Facts about octants, bricks and dilation."""
import z3
from kernels import AXES, BIT_AT, BRICK, OCTANT, OCTANTS, ROOT, TILE, any_bit, bit, code_of, fact, no, octant, u32, union, usize, wide, word
from rust import Number, plain, Range, Run, term


# Octants


@fact(OCTANT, ("(v | v << 4) & 0x10c3_0c30_c30c_30c3", "(v | v << 4) & 0x10c3_0c30_c30c_30c2"), ("v & 0x1f_ffff;", "v & 0xf_ffff;"))
def spread(k):
    """`spread` moves bit i to bit 3i, for the lowest 21 bits of any word, and clears all other bits."""
    v = k.bits("u64")
    yield k("spread", v).x == word(no(i) if i % 3 or i > 60 else bit(v, i // 3) for i in range(64))


@fact(OCTANT, ("(v | v >> 8) & 0x001f_0000_ff00_00ff", "(v | v >> 8) & 0x001f_0000_ff00_007f"))
def gather(k):
    """`gather` moves bit 3i to bit i, whatever the other bits are: y and z do not disturb x."""
    v = k.bits("u64")
    yield k("gather", v).x == word(bit(v, 3 * i) if i < 21 else no(i) for i in range(64))


@fact(OCTANT, ("spread(p[2] as u64) << 2", "spread(p[2] as u64) << 3"), ("gather(code >> 2) as u32]", "gather(code >> 3) as u32]"))
def morton(k):
    """`morton` of a position below 2^20 has bit i of axis a at 3i + a, and `position` is its inverse."""
    p = [k.bits("u32", 1 << 20) for _ in AXES]
    code = k("morton", p)
    yield code.x == word(bit(p[i % 3], i // 3) if i < 60 else no(i) for i in range(64))
    yield z3.And([q.x == c.x for q, c in zip(k("position", code), p)])


@fact(OCTANT, ("gather(code >> 1) as u32", "gather(code) as u32"))
def codes(k):
    """Codes below 8^l are the octants of level l, up to level 20: positions are below 2^l, and `morton` is the inverse of `position`."""
    for l in range(21):
        code = code_of(k, l)
        p = k("position", code)
        yield z3.And(k("morton", p).x == code.x, *[z3.ULT(q.x, 1 << l) for q in p])


@fact(OCTANT, ("gather(code) as u32,", "gather(code >> 3) as u32,"))
def families(k):
    """The parent of a code is `code >> 3` and its children are `code << 3 | child`, by position."""
    code, child = code_of(k, 19), k.bits("u64", 8)
    p, below = k("position", code), k("position", Number("u64", code.x << 3 | child.x))
    yield z3.And([q.x == z3.LShR(c.x, 1) for q, c in zip(k("position", Number("u64", z3.LShR(code.x, 3))), p)])
    yield z3.And([q.x == c.x << 1 | z3.ZeroExt(31, bit(child, a)) for a, (q, c) in enumerate(zip(below, p))])


@fact(OCTANT, ("position(code).map(|p| i64::from(p) << (ROOT_BITS - l))", "position(code).map(|p| i64::from(p) << (LEVEL_MAX - l))"),
      ("1 << (ROOT_BITS - l)", "1 << (ROOT_BITS + 1 - l)"))
def corners(k):
    """An octant lies in the root: its `corner` is a multiple of its `edge`, and corner + edge is at most 2^27, up to level 20."""
    for l in range(21):
        p, edge = k("corner", u32(l), code_of(k, l), file=OCTANT), k("edge", u32(l), file=OCTANT)
        yield z3.And([z3.And(c.x >= 0, c.x <= ROOT - edge.x, c.x & edge.x - 1 == 0) for c in p])


@fact(OCTANT, ("code << (3 * (LEVEL_MAX - l))", "code << (2 * (LEVEL_MAX - l))"))
def starts(k):
    """`start57` of an octant is the code of the level-19 cell at its minimum corner, and stays below 2^57."""
    l, code = octant(k, 20)
    start = k("start57", l, code)
    cell = k("position", start)
    yield z3.And(z3.ULT(start.x, 1 << 57), *[c.x == p.x << 19 - l.x for c, p in zip(cell, k("position", code))])


@fact(OCTANT, ("start57(l, code) << 7 | (l as u64) << 2", "start57(l, code) << 6 | (l as u64) << 2"))
def words(k):
    """A leaf `word` holds start, level and side without overlap, for every level and side."""
    (l, code), side = octant(k, 20), k.bits("u64", 3)
    w = k("word", l, code, side, file=OCTANT)
    yield z3.And(z3.LShR(w.x, 7) == k("start57", l, code).x, z3.LShR(w.x, 2) & 31 == wide(l, 64), w.x & 3 == side.x)


@fact(OCTANT, ("<< 7 | (l as u64) << 2 | side as u64", "<< 7 | (side as u64) << 5 | l as u64"))
def order(k):
    """Words sort in Morton order: a leaf that starts before another has the lesser word, whatever levels and sides are; of two with one
    start, the coarser."""
    def leaf():
        (l, code), side = octant(k, 20), k.bits("u64", 3)
        return l, k("start57", l, code), k("word", l, code, side, file=OCTANT)
    (l, a, v), (m, b, w) = leaf(), leaf()
    yield z3.Implies(z3.ULT(a.x, b.x), z3.ULT(v.x, w.x))
    yield z3.Implies(z3.And(a.x == b.x, z3.ULT(l.x, m.x)), z3.ULT(v.x, w.x))


@fact(OCTANT, ("filter(|&v| v < 1 << l)", "filter(|&v| v <= 1 << l)"), ("if up { 1 } else { -1 }", "if up { 1 } else { -2 }"))
def neighbours(k):
    """`neighbour` moves one position along one axis, and is none exactly where that leaves the root, at every level."""
    for axis in AXES:
        for up in (False, True):
            l, code = octant(k, 21)
            some, n = k.option("neighbour", l, code, usize(axis), up, file=OCTANT)
            p, q = k("position", code), k("position", n)
            yield some == (p[axis].x != ((z3.BitVecVal(1, 32) << l.x) - 1 if up else 0))
            yield z3.Implies(some, z3.And([q[a].x == p[a].x + ((1 if up else -1) if a == axis else 0) for a in AXES]))


# Bricks


def beside(i, axis, up):
    """The octant of a brick next to octant i, and whether it lies in the neighbouring brick."""
    p = list(OCTANTS[i])
    p[axis] += 1 if up else -1
    beyond = p[axis] not in range(4)
    p[axis] %= 4
    return BIT_AT[tuple(p)], beyond


@fact(BRICK, ("let v = v | v >> 2;\n    let v = (v | v >> 1) &", "let v = v | v >> 3;\n    let v = (v | v >> 1) &"), ("0x0102_0408_1020_4080", "0x0102_0408_1020_4081"))
def parents(k):
    """`parents` has bit j if and only if byte j of the brick is not 0, for all 2^64 bricks."""
    w = k.bits("u64")
    yield k("parents", w).x == word(z3.Extract(8 * j + 7, 8 * j, w.x) != 0 for j in range(8))


@fact(BRICK, ("0x7f7f_7f7f_7f7f_7f7f", "0x7f7f_7f7f_7f7f_7f6f"))
def groups(k):
    """`children` of `parents` is the union of all groups of eight siblings that have an octant in the brick."""
    w = k.bits("u64")
    yield k("children", k("parents", w)).x == union(w, lambda i: range(i & ~7, (i & ~7) + 8))


@fact(BRICK, ("swap::<4, 2>(w); // z1 z0 y0 y1 x1 x0", "swap::<4, 3>(w); // z1 z0 y0 y1 x1 x0"), ("w ^ t ^ t << distance", "w ^ t << distance"))
def rows(k):
    """`to_rows` moves octant (x, y, z) to bit x + 4y + 16z, for all octants of all bricks at once."""
    w = k.bits("u64")
    yield k("to_rows", w).x == word(bit(w, BIT_AT[i & 3, i >> 2 & 3, i >> 4]) for i in range(64))


@fact(BRICK, ("let w = swap::<3, 2>(w);\n", "let w = swap::<5, 2>(w);\n"))
def rows_back(k):
    """`from_rows` is the inverse of `to_rows`, on both sides."""
    w = k.bits("u64")
    yield z3.And(k("from_rows", k("to_rows", w)).x == w.x, k("to_rows", k("from_rows", w)).x == w.x)


@fact(BRICK, ("(w & low) << unit | (w & one) << gap }", "(w & low) << unit | (w & low) << gap }"),
      ("(m[0][0] | m[2][2], m[1][1], 1 << axis, 7 << axis)", "(m[0][0] | m[1][1], m[1][1], 1 << axis, 7 << axis)"))
def moved(k):
    """`moved` moves every octant by one position along an axis within the brick, and drops those that leave it, in all six directions."""
    for axis in AXES:
        for up in (False, True):
            w = k.bits("u64")
            yield k("moved", w, usize(axis), up).x == union(w, lambda i: [j for j, beyond in [beside(i, axis, not up)] if not beyond])


@fact(BRICK, ("(w & SPANS[axis][3][3]) >> shift", "(w & SPANS[axis][2][2]) >> shift"))
def across(k):
    """`across` moves the octants at a face of the brick to the opposite face, and drops all others, in all six directions."""
    for axis in AXES:
        for up in (False, True):
            w = k.bits("u64")
            yield k("across", w, usize(axis), up).x == union(w, lambda i: [j for j, beyond in [beside(i, axis, not up)] if beyond])


@fact(BRICK, ("let index = (bit >> axis & 1) | (bit >> (axis + 3) & 1) << 1", "let index = (bit >> axis & 1) | (bit >> (axis + 2) & 1) << 1"))
def spans(k):
    """`SPANS` of an axis, first and last is the mask of the octants between these positions."""
    table = k.sources.constant("SPANS", BRICK)
    for axis in AXES:
        for first in range(4):
            for last in range(first, 4):
                yield table[axis][first][last].x == sum(1 << i for i in range(64) if first <= OCTANTS[i][axis] <= last)


# Dilation


def row(k):
    """A row of a tile: its own octants are the middle 32 bits."""
    return Number("u64", z3.Concat(z3.BitVecVal(0, 16), k.bits("u32").x, z3.BitVecVal(0, 16)))


def dilated(w, r): return union(w, lambda i: range(max(0, i - r), min(64, i + r + 1)))


@fact(TILE, ("let step = run.min(2 * r + 1 - run);", "let step = run.min(2 * r + 2 - run);"), ("let mut wide = row >> r;", "let mut wide = row >> (r & 15);"))
def dilate_row(k):
    """`dilate_row` sets each bit within r of a set one, for every r up to 16, and loses none: the margin of 16 bits suffices."""
    for r in range(17):
        w = row(k)
        yield k("dilate_row", w, usize(r)).x == dilated(w, r)


@fact(TILE, ("while run < 2 * r + 1 {", "while run < 2 * r {"))
def dilations_compose(k):
    """`dilate_row` by a and then by b is `dilate_row` by a + b, for all a + b up to 16: a great radius takes several passes."""
    for a in range(17):
        for b in range(17 - a):
            w = row(k)
            yield k("dilate_row", k("dilate_row", w, usize(a)), usize(b)).x == k("dilate_row", w, usize(a + b)).x


@fact(TILE, ("(v | v >> 4) & 0x00ff_00ff_00ff_00ff", "(v | v >> 4) & 0x00ff_00ff_00ff_00fe"))
def pairs(k):
    """`pairs` has bit i if and only if the row has bit 2i or 2i + 1, for all 2^64 rows."""
    w = k.bits("u64")
    yield k("pairs", w).x == word(any_bit([bit(w, 2 * i), bit(w, 2 * i + 1)]) if i < 32 else no(i) for i in range(64))


@fact(TILE, ("let v = (row | row >> 1) &", "let v = (row | row << 1) &"))
def halved_radius(k):
    """Dilation by 2r and then coarsening is coarsening and then dilation by r, along a row, for r up to 8: the identity of `dilate_children`."""
    for r in range(9):
        w = row(k)
        yield k("pairs", k("dilate_row", w, usize(2 * r))).x == k("dilate_row", k("pairs", w), usize(r)).x


@fact(TILE, ("(2, 0x00ff_00ff_00ff_00ff)", "(2, 0x00ff_00ff_00ff_0fff)"), ("rows[i] ^= t << (4 * step);", "rows[i] ^= t << (2 * step);"))
def transpose(k):
    """`transpose` exchanges nibble j of word i with nibble i of word j, for all 16 x 16 nibbles at once."""
    m = [k.bits("u64") for _ in range(16)]
    out = list(m)
    Run(k.sources).call("transpose", [out], TILE)
    for i in range(16):
        yield out[i].x == word(bit(m[b // 4], 4 * i + b % 4) for b in range(64))


@fact(TILE, ("(8, u64::MAX >> 32)", "(8, u64::MAX >> 31)"))
def bricks_of_rows(k):
    """After `transpose` and `from_rows`, brick i has octant (x, y, z) if and only if row y + 4z of the tile has bit 4i + x."""
    m = [k.bits("u64") for _ in range(16)]
    out = list(m)
    Run(k.sources).call("transpose", [out], TILE)
    for i in range(16):
        yield k("from_rows", out[i]).x == word(bit(m[y + 4 * z], 4 * i + x) for x, y, z in OCTANTS)


@fact(TILE, ("bits.trailing_zeros() as usize", "bits.trailing_zeros() as usize + 1"), ("(u32::BITS - bits.leading_zeros())", "(u32::BITS - 1 - bits.leading_zeros())"))
def span(k):
    """`span` starts at the first set bit and ends after the last, for all masks but 0."""
    w = k.bits("u32")
    k.given.append(w.x != 0)
    of = k("span", w)
    first, last = z3.Extract(31, 0, of.start.x), z3.Extract(31, 0, of.end.x) - 1
    yield z3.And(z3.ULE(first, last), z3.ULT(last, 32), z3.LShR(w.x, first) & 1 == 1, z3.LShR(w.x, last) == 1, (w.x & (z3.BitVecVal(1, 32) << first) - 1) == 0)


def dilations(k, w, at, r, spans):
    """By path, that a tile has exactly the octants within r of one of the brick `w`, which is the only one, if `spans` are those of its rows."""
    margin, side = 8, 48
    low = [16 + 4 * at[0], margin + 4 * at[1], margin + 4 * at[2]]
    def reached(z, y):
        near = [i for i, p in enumerate(OCTANTS) if max(abs(low[1] + p[1] - y), abs(low[2] + p[2] - z)) <= r]
        return word(any_bit(bit(w, i) for i in near if abs(low[0] + OCTANTS[i][0] - x) <= r) for x in range(64)) if near else z3.BitVecVal(0, 64)
    want = [reached(z, y) for z in range(side) for y in range(side)]
    replaced = {"span": lambda run, bits: spans(run, bits, 4 * at[1]),
                "ones": lambda run, bits: [u32(i) for i in range(64) if plain(bits) >> i & 1],
                "to_rows": lambda run, w: Number("u64", word(bit(w, BIT_AT[i & 3, i >> 2 & 3, i >> 4]) for i in range(64)))}
    key = sum((c >> b & 1) << 3 * b + a for a, c in enumerate(at) for b in range(3))
    for path, tile in k.tiles(w, key, r, margin, side, [Number("u64", 0)] * side ** 2, replaced):
        yield z3.Implies(path, z3.And([term(row, Number("u64", x)) == x for row, x in zip(tile["rows"], want)]))


@fact(TILE, ("for s in (0..=2 * r).filter(|s| *s != r)", "for s in (1..=2 * r).filter(|s| *s != r)"), ("for to in z - r..=z + r {", "for to in z - r..=z {"),
      ("*row |= (four >> (4 * dy) & 15) << shift;", "*row |= (four >> (4 * dy) & 7) << shift;"), ("out.copy_from_slice(rows);", ""))
def bricks_dilated(k):
    """`put` and `dilate_lanes`: the tile then has exactly the octants within r of one of the brick, along all three axes, for all 2^64 bricks
    at two places of a tile, one with r = 1 and one with r = 2, if all four rows of its layers are dilated."""
    for at, r in (((0, 7, 7), 1), ((7, 0, 3), 2)):
        yield from dilations(k, k.bits("u64"), at, r, lambda run, bits, y: Range(usize(y), usize(y + 4), []))


@fact(TILE, ("& 0xffff) * 0x1248)", "& 0xffff) * 0x1240)"), ("let pairs = rows | rows >> 1;", "let pairs = rows | rows >> 2;"),
      ("self.columns_at[z + dz] |= columns << y;", "self.columns_at[z + dz] |= columns << (y + 1);"), ("m + start - r..m + end + r)", "m + start - r..m + end)"))
def layers_dilated(k):
    """The same for all 2^16 sources in the highest layer of a brick alone, with r = 2, whose rows are dilated only from the first source to the last."""
    def first_and_last(run, bits, y):
        has = lambda i: run.truth(z3.Extract(i, i, bits.x) == 1)
        first = next((i for i in range(y, y + 3) if has(i)), y + 3)
        return Range(usize(first), usize(next((i for i in range(y + 3, first, -1) if has(i)), first) + 1), [])
    w = k.bits("u64")
    of_layer = Number("u64", word(bit(w, i) if p[2] == 3 else no(i) for i, p in enumerate(OCTANTS)))
    yield from dilations(k, of_layer, (7, 0, 3), 2, first_and_last)
