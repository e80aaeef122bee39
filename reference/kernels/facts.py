"""Facts about the mesher's kernels that its code relies on, for all inputs; ci/kernels proves them.

A fact is a function of `Kernels`: it draws inputs, evaluates functions of the Rust sources on them and yields what must hold. Its doc
comment is the sentence that is proven. That nothing overflows in these functions is part of every fact. Beside it are faults to plant in
the sources, each of which must make its proof fail.
"""
import z3
from rust import MESHER, WIDTHS, Number, Run, Struct, coerced, known, limits, plain, term

OCTANT, BRICK, FACET = "bricks/src/octant.rs", "bricks/src/brick.rs", "bricks/src/facet.rs"
DILATE, TILE = "bricks/src/dilate.rs", "bricks/src/dilate/tile.rs"
DIGEST, LATTICE, VOXELISE = "bricks/src/digest.rs", "src/input/lattice.rs", "src/refine/voxelise.rs"
RAYS, VOTE, CHECK_BASE, CHECK_SIDES = "src/sides/rays.rs", "src/sides/vote.rs", "src/check/base.rs", "src/check/sides.rs"
FILES = [OCTANT, BRICK, DILATE, TILE, FACET, DIGEST, LATTICE, VOXELISE, RAYS, VOTE, CHECK_BASE, CHECK_SIDES]

# What DEFINITION.md states, not what the sources do.
ROOT = 1 << 27
VERTEX = (-(1 << 27), 1 << 28)
AXES = range(3)
OCTANTS = [[i & 1 | i >> 2 & 2, i >> 1 & 1 | i >> 3 & 2, i >> 2 & 1 | i >> 4 & 2] for i in range(64)]  # positions in a brick, by bit
BIT_AT = {tuple(p): i for i, p in enumerate(OCTANTS)}

FACTS = []


def fact(file, *mutants):
    def register(f):
        f.file, f.mutants = file, [(file, *m) if len(m) == 2 else m for m in mutants]
        FACTS.append(f)
        return f
    return register


class Kernels:
    def __init__(self, sources): self.sources, self.given, self.checks, self.ranges, self.bounds, self.kept = sources, [], [], [], {}, []

    # Inputs

    def bits(self, type, below=None):
        x = z3.FreshConst(z3.BitVecSort(WIDTHS[type]))
        if below is not None:
            self.given.append(z3.ULT(x, below))
        return Number(type, x)

    def integer(self, type, low, high):
        """A term of unbounded integers, within bounds."""
        x = z3.FreshInt()
        self.given.append(z3.And(low <= x, x <= high))
        self.bounds[x.get_id()] = low, high
        self.kept.append(x)
        return Number(type, x)

    def signed(self, type, low, high):
        """The same as a bit-vector."""
        x = self.bits(type)
        self.given.append(z3.And(low <= x.x, x.x <= high))
        return x

    def float(self): return Number("f64", z3.FreshConst(z3.Float64()))
    def facet(self, draw): return Struct(v=[[draw("i32", *VERTEX) for _ in AXES] for _ in range(3)])

    # Evaluation

    def paths(self, name, *args, file=None, module=None, constants=(), replaced=None):
        """The conditions of all paths through a function, with the results."""
        choices, paths = [], []
        while True:
            run = Run(self.sources, replaced, choices)
            args_now = [a(run) if callable(a) else list(a) if isinstance(a, list) else a for a in args]
            result = run.call(name, args_now, file, module, constants)
            self.checks += run.checks
            self.ranges += run.ranges
            paths.append((z3.And(run.path), result))
            choices = run.choices[:run.made]
            while choices and not choices[-1]:
                choices.pop()
            if not choices:
                return paths
            choices[-1] = False

    def tiles(self, w, key, r, margin, side, zeros, ones):
        """The tiles, by path, in which a brick was put and dilated."""
        choices = []
        while True:
            run = Run(self.sources, {"ones": ones}, choices)
            tile = Struct(radius=usize(r), margin=usize(margin), side=usize(side), rows=list(zeros), spread=list(zeros), layers=u32(0), columns=u32(0), columns_at=[u32(0)] * 32)
            run.call("put", [tile, Struct(key=Number("u64", key), bits=w)], TILE)
            if plain(tile["layers"]):
                run.call("dilate_lanes", [tile], TILE)
            self.checks += run.checks
            yield z3.And(run.path), tile
            choices = run.choices[:run.made]
            while choices and not choices[-1]:
                choices.pop()
            if not choices:
                return
            choices[-1] = False

    def __call__(self, name, *args, **options):
        paths = self.paths(name, *args, **options)
        result = paths[-1][1]
        for condition, other in reversed(paths[:-1]):
            result = merged(condition, other, result)
        return result

    def option(self, name, *args, **options):
        """Whether the result is `Some`, and its value then."""
        paths = self.paths(name, *args, **options)
        found = [p for p in paths if p[1] is not None]
        result = found[-1][1]
        for condition, other in reversed(found[:-1]):
            result = merged(condition, other, result)
        return z3.Or([c for c, _ in found]), result


    def interval(self, x):
        """Bounds of a term of unbounded integers by interval arithmetic: those of products are hard for z3."""
        if x.get_id() not in self.bounds:
            kind, parts = x.decl().kind(), [self.interval(c) for c in x.children() if isinstance(c, z3.ArithRef)]
            if kind == z3.Z3_OP_ANUM:
                found = x.as_long(), x.as_long()
            elif kind == z3.Z3_OP_ADD:
                found = sum(p[0] for p in parts), sum(p[1] for p in parts)
            elif kind == z3.Z3_OP_SUB:
                found = parts[0][0] - sum(p[1] for p in parts[1:]), parts[0][1] - sum(p[0] for p in parts[1:])
            elif kind == z3.Z3_OP_MUL:
                found = parts[0]
                for p in parts[1:]:
                    ends = [a * b for a in found for b in p]
                    found = min(ends), max(ends)
            elif kind == z3.Z3_OP_POWER:
                bound = max(-parts[0][0], parts[0][1]) ** x.arg(1).as_long()
                found = -bound, bound
            elif kind == z3.Z3_OP_UMINUS:
                found = -parts[0][1], -parts[0][0]
            elif kind == z3.Z3_OP_IDIV:
                found = parts[0][0] // parts[1][0], parts[0][1] // parts[1][0]
            elif kind == z3.Z3_OP_ITE:
                test, (a, b) = x.arg(0), x.children()[1:]
                if test.children() and test.arg(0).eq(a) and test.arg(1).eq(b) and test.decl().kind() in (z3.Z3_OP_GE, z3.Z3_OP_LE):
                    each = max if test.decl().kind() == z3.Z3_OP_GE else min
                    found = each(parts[0][0], parts[1][0]), each(parts[0][1], parts[1][1])
                else:
                    found = min(p[0] for p in parts), max(p[1] for p in parts)
            else:
                raise NotImplementedError(x.decl())
            self.bounds[x.get_id()] = found
            self.kept.append(x)
        return self.bounds[x.get_id()]


    def largest(self, type="i128"): return max(abs(end) for _, _, x, high in self.ranges if high == limits(type)[1] for end in self.interval(x))

    def linear(self, goal):
        """A goal that implies this one, in linear arithmetic: products of unknowns become unknowns, within their intervals."""
        goal, products, seen, bounds = z3.simplify(goal, som=True), {}, set(), []
        stack = [goal]
        while stack:
            x = stack.pop()
            if x.get_id() in seen:
                continue
            seen.add(x.get_id())
            stack += x.children()
            if isinstance(x, z3.ArithRef) and x.decl().kind() in (z3.Z3_OP_MUL, z3.Z3_OP_POWER):
                factors = [c for c in x.children() if not z3.is_int_value(c)] if x.decl().kind() == z3.Z3_OP_MUL else [x]
                coefficient = [c for c in x.children() if z3.is_int_value(c)] if x.decl().kind() == z3.Z3_OP_MUL else []
                if len(factors) > 1 or x.decl().kind() == z3.Z3_OP_POWER:
                    key = tuple(sorted(f.get_id() for f in factors))
                    if key not in products:
                        products[key] = z3.FreshInt(), []
                        low, high = self.interval(z3.Product(factors) if len(factors) > 1 else x)
                        bounds.append(z3.And(low <= products[key][0], products[key][0] <= high))
                    products[key][1].append((x, coefficient[0] * products[key][0] if coefficient else products[key][0]))
        return z3.Implies(z3.And(bounds), z3.substitute(goal, *[pair for _, pairs in products.values() for pair in pairs])) if products else goal


def merged(c, a, b):
    if isinstance(a, list):
        return [merged(c, x, y) for x, y in zip(a, b, strict=True)]
    if isinstance(a, Struct):
        return Struct({k: merged(c, a[k], b[k]) for k in a})
    if isinstance(a, Number) or isinstance(b, Number):
        like = b if known(a) else a
        return Number(like.type, z3.If(c, term(a, like), term(b, like)))
    return z3.If(c, a, b)


# Terms of specifications


def bit(n, i): return z3.Extract(i, i, n.x if isinstance(n, Number) else n)
def has(n, i): return bit(n, i) == 1
def word(bits): return z3.Concat([b if isinstance(b, z3.BitVecRef) else z3.If(b, z3.BitVecVal(1, 1), z3.BitVecVal(0, 1)) for b in reversed(list(bits))])
def no(_): return z3.BitVecVal(0, 1)
def any_bit(bits): bits = list(bits); return z3.Or([b == 1 for b in bits]) if bits else z3.BoolVal(False)
def wide(n, width): return z3.ZeroExt(width - n.x.size(), n.x)
def union(w, sources): return word(any_bit(bit(w, j) for j in sources(i)) for i in range(64))
def u32(n): return Number("u32", n)
def usize(n): return Number("usize", n)
def i64(n): return Number("i64", n)
def code_of(k, l): return k.bits("u64", 1 << 3 * l)


def octant(k, levels):
    """Any octant of any level below `levels`."""
    l, code = k.bits("u32", levels), k.bits("u64")
    k.given.append(z3.ULT(code.x, z3.BitVecVal(1, 64) << 3 * z3.ZeroExt(32, l.x)))
    return l, code


def maximum(items): m = items[0]; return m if len(items) == 1 else (lambda r: z3.If(m >= r, m, r))(maximum(items[1:]))
def minimum(items): m = items[0]; return m if len(items) == 1 else (lambda r: z3.If(m <= r, m, r))(minimum(items[1:]))


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


@fact(OCTANT, ("filter(|&v| v < 1 << l)", "filter(|&v| v <= 1 << l)"), ("p[axis].checked_sub(1)?", "p[axis].checked_sub(2)?"))
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


@fact(BRICK, ("(w & low) << unit | (w & m[1]) << gap }", "(w & low) << unit | (w & m[2]) << gap }"),
      ("let (low, unit, gap) = (m[0] | m[2], 1 << axis, 7 << axis)", "let (low, unit, gap) = (m[0] | m[1], 1 << axis, 7 << axis)"))
def moved(k):
    """`moved` moves every octant by one position along an axis within the brick, and drops those that leave it, in all six directions."""
    for axis in AXES:
        for up in (False, True):
            w = k.bits("u64")
            yield k("moved", w, usize(axis), up).x == union(w, lambda i: [j for j, beyond in [beside(i, axis, not up)] if not beyond])


@fact(BRICK, ("(w & AXES[axis][3]) >> shift", "(w & AXES[axis][2]) >> shift"))
def across(k):
    """`across` moves the octants at a face of the brick to the opposite face, and drops all others, in all six directions."""
    for axis in AXES:
        for up in (False, True):
            w = k.bits("u64")
            yield k("across", w, usize(axis), up).x == union(w, lambda i: [j for j, beyond in [beside(i, axis, not up)] if beyond])


@fact(BRICK, ("along(w, Z, 4, 28)", "along(w, Z, 4, 27)"), ("(w >> gap & m[1])", "(w >> gap & m[3])"))
def spread_faces(k):
    """`spread_faces` is the union of the octants and their face neighbours in the brick: a step of the flood."""
    w = k.bits("u64")
    yield k("spread_faces", w).x == union(w, lambda i: [i] + [j for a in AXES for up in (False, True) for j, beyond in [beside(i, a, up)] if not beyond])


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


@fact(TILE, ("for s in (0..=2 * r).filter(|s| *s != r)", "for s in (1..=2 * r).filter(|s| *s != r)"), ("for to in z - r..=z + r {", "for to in z - r..=z {"),
      ("*row |= (four >> (4 * dy) & 15) << shift;", "*row |= (four >> (4 * dy) & 7) << shift;"), ("out.copy_from_slice(rows);", ""))
def bricks_dilated(k):
    """`put` and `dilate_lanes`: the tile then has exactly the octants within r of one of the brick, along all three axes, for all 2^64 bricks
    at two places of a tile, one with r = 1 and one with r = 2."""
    def ones(run, bits): return [u32(i) for i in range(64) if plain(bits) >> i & 1]
    for at, r in (((0, 7, 7), 1), ((7, 0, 3), 2)):
        margin, side = 8, 48
        w = k.bits("u64")
        low = [16 + 4 * at[0], margin + 4 * at[1], margin + 4 * at[2]]
        def reached(z, y):
            near = [i for i, p in enumerate(OCTANTS) if max(abs(low[1] + p[1] - y), abs(low[2] + p[2] - z)) <= r]
            return word(any_bit(bit(w, i) for i in near if abs(low[0] + OCTANTS[i][0] - x) <= r) for x in range(64)) if near else z3.BitVecVal(0, 64)
        want = [reached(z, y) for z in range(side) for y in range(side)]
        for path, tile in k.tiles(w, sum((c >> b & 1) << 3 * b + a for a, c in enumerate(at) for b in range(3)), r, margin, side, [Number("u64", 0)] * side ** 2, ones):
            yield z3.Implies(path, z3.And([term(row, Number("u64", x)) == x for row, x in zip(tile["rows"], want)]))



# Facets


@fact(FACET, ("let cross = |u: usize, w: usize| d(1, u) * d(2, w) - d(1, w) * d(2, u);", "let cross = |u: usize, w: usize| 64 * (d(1, u) * d(2, w) - d(1, w) * d(2, u));"))
def normals(k):
    """`normal` fits i64 for all vertices in [-2^27, 2^28]: components are at most 18 * 2^54, which three times is below 2^60."""
    n = k("normal", k.facet(k.integer), file=FACET)
    yield all(k.interval(c.x) == (-18 << 54, 18 << 54) for c in n)
    yield 3 * (18 << 54) < 1 << 60


def function(name, file=FACET): return lambda run: lambda *args: run.call(name, args, file)
def abs_at_most(n, bound): return z3.And(-bound <= n.x, n.x <= bound)


@fact(FACET, ("let first = (lo - corner[axis] - 1) >> shift;", "let first = (lo - corner[axis]) >> shift;"), ("let last = (hi - corner[axis]) >> shift;", "let last = (hi - corner[axis] - 1) >> shift;"),
      ("let shift = ROOT_BITS - l;\n    let mut wide", "let shift = ROOT_BITS - l - 1;\n    let mut wide"))
def extents(k):
    """The coordinate axes of `crossed`: an octant is left out if and only if its closed cube and the facet's extent are disjoint, for all
    facets, bricks and levels up to 20."""
    every = {"separated": lambda *_: Number("u64", (1 << 64) - 1)}
    for l in range(21):
        h = ROOT >> l
        extent = [[k.integer("i64", *VERTEX), k.integer("i64", *VERTEX)] for _ in AXES]
        k.given.append(z3.And([low.x <= high.x for low, high in extent]))
        corner = [k.integer("i64", 0, ROOT) for _ in AXES]
        mask = k("crossed", Struct(), corner, u32(l), file=FACET, replaced={**every, "range": lambda run, f, axis: extent[axis]})
        meets = [[z3.And(extent[a][0].x <= corner[a].x + (i + 1) * h, extent[a][1].x >= corner[a].x + i * h) for i in range(4)] for a in AXES]
        yield z3.And([has(mask, i) == z3.And([meets[a][p[a]] for a in AXES]) for i, p in enumerate(OCTANTS)])


@fact(FACET, ("i64::from(a.max(b).max(c))", "i64::from(a.max(b).min(c))"))
def ranges(k):
    """`range` is the least and the greatest coordinate of the facet's vertices along an axis."""
    f = k.facet(k.signed)
    for axis in AXES:
        low, high = k("range", f, usize(axis), file=FACET)
        c = [z3.SignExt(32, v[axis].x) for v in f["v"]]
        yield z3.And(*[z3.And(low.x <= x, x <= high.x) for x in c], z3.Or([low.x == x for x in c]), z3.Or([high.x == x for x in c]))


@fact(FACET, ("u[k & 3] & w[2 * half + (k >> 2)]", "u[k & 3] & w[half + (k >> 2)]"))
def columns(k):
    """`COLUMNS` of an axis, half and byte is the union of the columns of octants over the squares whose bits the byte has, for every byte."""
    table = k.sources.constant("COLUMNS", FACET)
    for a in AXES:
        for half in range(2):
            yield all(plain(table[a][half][byte]) == sum(1 << i for i in range(64) if square(i, a) // 8 == half and byte >> square(i, a) % 8 & 1)
                      for byte in range(256))


def square(i, a): return OCTANTS[i][(a + 1) % 3] + 4 * OCTANTS[i][(a + 2) % 3]


def extruded(half, a):
    """The same as a function of a byte that is a term."""
    return lambda byte: Number("u64", word(bit(byte, square(i, a) % 8) if square(i, a) // 8 == half else no(i) for i in range(64)))


# The instructions of AVX-512 that the lanes use, by their manual.
def lanes_where(run, op, a, b):
    lanes = [run.compared(op, x, y) for x, y in zip(a, b)]
    return Number("u8", sum(lane << i for i, lane in enumerate(lanes)) if all(isinstance(lane, bool) for lane in lanes) else word(lanes))


AVX512 = {
    "_mm512_set1_epi64": lambda run, v: [v] * 8,
    "_mm512_setr_epi64": lambda run, *v: [coerced(x, "i64") for x in v],
    "_mm512_maskz_set1_epi64": lambda run, m, v: [v if plain(m) >> i & 1 else i64(0) for i in range(8)],
    "_mm512_add_epi64": lambda run, a, b: [run.binary("+", x, y) for x, y in zip(a, b)],
    "_mm512_cmpge_epi64_mask": lambda run, a, b: lanes_where(run, ">=", a, b),
    "_mm512_mask_cmple_epi64_mask": lambda run, m, a, b: run.binary("&", m, lanes_where(run, "<=", a, b)),
}
SHIFTS = range(7, 28)  # of octants of levels 20 to 0


def half_plane(k, lanes):
    for shift in SHIFTS:
        h = 1 << shift
        for a in AXES:
            u, w = (a + 1) % 3, (a + 2) % 3
            start = [k.integer("i64", -(1 << 28), 1 << 28) for _ in AXES]
            eu, ew = (k.integer("i64", -(3 << 27), 3 << 27) for _ in range(2))
            mask = k("half_plane", start, eu, ew, usize(a), u32(shift), function(lanes), file=FACET, replaced={**AVX512, "COLUMNS": [[extruded(half, a) for half in range(2)] for a in AXES]})
            def edge(i, j): return eu.x * (h * j - start[w].x) - ew.x * (h * i - start[u].x)
            meets = {(i, j): maximum([edge(i + di, j + dj) for di in range(2) for dj in range(2)]) >= 0 for i in range(4) for j in range(4)}
            yield z3.And([has(mask, i) == meets[p[u], p[w]] for i, p in enumerate(OCTANTS)])


@fact(FACET, ("let qw = if eu > 0 { h - from[w] }", "let qw = if eu < 0 { h - from[w] }"), ("let c = (eu * qw - ew * qu) >> shift;", "let c = -((ew * qu - eu * qw) >> shift);"),
      ("let v = ci * (k & 3) as i64 + cj * (k >> 2) as i64 + c;", "let v = cj * (k & 3) as i64 + ci * (k >> 2) as i64 + c;"))
def half_planes(k):
    """`half_plane` with `edge_lanes`: an octant's projection meets the closed half-plane if and only if some corner of its square does, and
    all terms fit i64, for all edges, starts, axes and levels up to 20."""
    yield from half_plane(k, "edge_lanes")


@fact(FACET, ("_mm512_set1_epi64(-c - 2 * cj)", "_mm512_set1_epi64(-c - cj)"), ("cj, ci + cj, 2 * ci + cj, 3 * ci + cj)", "cj, ci + cj, 2 * ci + cj, 2 * ci + cj)"))
def half_planes_avx512(k):
    """The same with the instructions of AVX-512, whose lanes wrap silently: none does."""
    yield from half_plane(k, "edge")


@fact(FACET, ("if eu.abs() + ew.abs() > best.0.abs() + best.1.abs() {", "if eu.abs() + ew.abs() > best.0.abs() + best.1.abs() + 1 {"), ("best = (eu, ew, from);", "best = (ew, eu, from);"),
      ("let mut best = (0i64, 0i64, p[0]);", "let mut best = (0i64, 1i64, p[0]);"))
def degenerate(k):
    """The line that `degenerate_mask` tests, of a facet whose projection has no area, contains all three projected vertices; it has no
    direction only if they are one point. Both half-planes of the line are tested."""
    for a in AXES:
        u, w = (a + 1) % 3, (a + 2) % 3
        p = [[k.integer("i64", -(1 << 28), 1 << 28) for _ in AXES] for _ in range(3)]
        def turn(a, b, c): return (b[u].x - a[u].x) * (c[w].x - a[w].x) - (b[w].x - a[w].x) * (c[u].x - a[u].x)
        collinear = turn(*p) == 0
        tested = []
        def half_plane(run, start, eu, ew, *_):
            tested.append((z3.And(run.path), start, eu, ew))
            return Number("u64", (1 << 64) - 1)
        k.paths("degenerate_mask", p, usize(a), u32(8), lambda run: None, file=FACET, replaced={"half_plane": half_plane})
        for (path, start, eu, ew), (_, other, *back) in zip(tested[::2], tested[1::2]):
            yield z3.Implies(z3.And(path, collinear), z3.And(
                *[eu.x * (q[w].x - start[w].x) - ew.x * (q[u].x - start[u].x) == 0 for q in p],
                z3.Implies(z3.And(eu.x == 0, ew.x == 0), z3.And([z3.And(q[u].x == p[0][u].x, q[w].x == p[0][w].x) for q in p])),
                back[0].x == -eu.x, back[1].x == -ew.x, start[u].x == other[u].x, start[w].x == other[w].x))


def plane(k, lanes):
    for shift in SHIFTS:
        h = 1 << shift
        n = [k.integer("i64", -18 << 54, 18 << 54) for _ in AXES]
        vertex = [k.integer("i64", -(1 << 28), 1 << 28) for _ in AXES]
        mask = k("plane_mask", [vertex] * 3, n, u32(shift), function(lanes), file=FACET, replaced=AVX512)
        offset = sum(n[a].x * vertex[a].x for a in AXES)
        most, least = [sum(h * each([n[a].x, z3.IntVal(0)]) for a in AXES) for each in (maximum, minimum)]
        def meets(p): at = sum(h * p[a] * n[a].x for a in AXES) - offset; return z3.And(at + most >= 0, at + least <= 0)
        yield z3.And([has(mask, i) == meets(p) for i, p in enumerate(OCTANTS)])


@fact(FACET, ("let bound = 4 * i128::from(up - down) + 4;", "let bound = 3 * i128::from(up - down) - 4;"), ("let ceil = clamp(-((-offset) >> shift));", "let ceil = clamp(offset >> shift);"),
      ("let bound = 4 * i128::from(up - down) + 4;", "let bound = 16 * i128::from(up - down) + 4;"))
def planes(k):
    """`plane_mask` with `plane_lanes`: an octant meets the facet's plane if and only if its corners are not all on one side, for all normals,
    vertices and levels up to 20. Clamping changes no answer, and all lanes fit i64."""
    yield from plane(k, "plane_lanes")


@fact(FACET, ("let base = 2 * (n[0] * (byte & 1)", "let base = 2 * (n[0] * (byte & 3)"), ("lane(0xf0, n[2])", "lane(0xf8, n[2])"))
def planes_avx512(k):
    """The same with the instructions of AVX-512, whose lanes wrap silently: none does."""
    yield from plane(k, "plane")


# Rays


@fact(RAYS, ("let side = eu * (p[w] - v(i, w)) - ew * (p[u] - v(i, u));", "let side = 32 * (eu * (p[w] - v(i, w)) - ew * (p[u] - v(i, u)));"))
def rays(k):
    """All terms of `meets` in i64, its edge functions among them, are below 2^60, and heights fit i128, for all facets and points of the root."""
    f = k.facet(k.integer)
    p = [k.integer("i64", 0, ROOT) for _ in AXES]
    for axis in AXES:
        k.paths("meets", f, p, usize(axis), file=RAYS)
    yield k.largest("i64") < 1 << 60



@fact(RAYS, ("[side, -ew, eu].into_iter().find", "[side, eu, -ew].into_iter().find"), ("[side, -ew, eu].into_iter().find", "[side, ew, eu].into_iter().find"))
def perturbation(k):
    """The sign that `meets` takes for an edge is that of the edge function at the point displaced by e = 2^-40 along the next axis and e^2
    along the one after it; only if all terms are 0 it takes none."""
    for axis in AXES:
        f, p = k.facet(k.integer), [k.integer("i64", 0, ROOT) for _ in AXES]
        u, w = (axis + 1) % 3, (axis + 2) % 3
        n = k("normal", f, file=FACET)
        def edge(i):
            a, b = f["v"][i], f["v"][(i + 1) % 3]
            eu, ew = b[u].x - a[u].x, b[w].x - a[w].x
            # In units of e^2.
            return (eu * (p[w].x - a[w].x) - ew * (p[u].x - a[u].x)) * (1 << 80) - ew * (1 << 40) + eu
        inside = z3.And([z3.And(edge(i) != 0, (edge(i) > 0) == (n[axis].x > 0)) for i in range(3)])
        some, _ = k.option("meets", f, p, usize(axis), file=RAYS)
        yield some == z3.And(n[axis].x != 0, inside)


@fact(CHECK_SIDES, ("const ONE: i128 = 1 << 62;", "const ONE: i128 = 1 << 70;"))
def rays_checked(k):
    """The second count of rays, `ray_that_meets`: its terms are below 2^122 and fit i128, for all facets and all points of the root."""
    f, p = k.facet(k.integer), [k.integer("i64", 0, ROOT) for _ in AXES]
    for axis in AXES:
        k.paths("ray_that_meets", f, p, usize(axis), file=CHECK_SIDES)
    yield k.largest() < 1 << 122


@fact(CHECK_BASE, ("axis.iter().map(|c| (sign * c).max(0))", "axis.iter().map(|c| (sign * c * c).max(0))"))
def facets_checked(k):
    """The second test of facets against octants, `touches`: its terms are below 2^93 and fit i128, for all facets and octants."""
    f, corner, h = k.facet(k.integer), [k.integer("i64", 0, ROOT) for _ in AXES], k.integer("i64", 1, ROOT)
    k.paths("touches", f, corner, h, file=CHECK_BASE)
    yield k.largest() < 1 << 93


# The lattice


@fact(LATTICE, ("let last = (b.max[axis] - corner[axis] - 1) >> shift;", "let last = (b.max[axis] - corner[axis]) >> shift;"), ("b.min[axis] >= b.max[axis]", "b.min[axis] > b.max[axis]"),
      ("self.min[a].max(corner[a]) < self.max[a].min(corner[a] + h)", "self.min[a].max(corner[a]) <= self.max[a].min(corner[a] + h)"))
def boxes(k):
    """`box_mask` has an octant if and only if `ExtentBox::meets` holds for it: interiors meet. For all boxes, bricks and levels up to 20."""
    for l in range(21):
        h = ROOT >> l
        box = Struct({end: [k.integer("i64", 0, ROOT) for _ in AXES] for end in ("min", "max")})
        # The only bricks of levels 0 and 1 have 1 and 8 octants.
        corner = [k.integer("i64", 0, ROOT) if l > 1 else i64(0) for _ in AXES]
        mask = k("box_mask", box, corner, u32(l), file=LATTICE)
        yield z3.And([has(mask, i) == k("meets", box, [Number("i64", c.x + h * p[a]) for a, c in enumerate(corner)], i64(h), file=LATTICE) for i, p in enumerate(OCTANTS[:8 ** l])])
        yield z3.And([z3.Not(has(mask, i)) for i in range(8 ** l, 64)])


@fact(LATTICE, ("(c - ROOT_EDGE as f64 * 0.5).abs()", "(c - ROOT_EDGE as f64 * 0.25).abs()"), ("let limit = ROOT_EDGE as f64 * 1.5;", "let limit = ROOT_EDGE as f64 * 1.6;"))
def nearness(k):
    """A rounded coordinate is accepted by `off_centre` and its limit if and only if it lies in [-2^27, 2^28], for every f64, infinities and
    NaN included: so the conversion to i32 is exact."""
    x = k.float()
    q = k("nearest", x, Number("f64", 0.0), Number("f64", 1.0), file=LATTICE)
    limit = k.sources.fragment("let limit = ", LATTICE)
    near = z3.fpLEQ(k("off_centre", q, file=LATTICE).x, z3.FPVal(limit.x, z3.Float64()))
    yield near == z3.And(z3.fpGEQ(q.x, z3.FPVal(VERTEX[0], z3.Float64())), z3.fpLEQ(q.x, z3.FPVal(VERTEX[1], z3.Float64())))


# Keys of sorted lists


@fact(VOXELISE, ("let first = ((lo - 1) >> SHIFT).max(0);", "let first = (lo >> SHIFT).max(0);"), ("u64::from(LEVEL_MAX - drop)", "u64::from(LEVEL_MAX + 1 - drop)"),
      ("(hi >> SHIFT).min((1 << LEVEL_MAX) - 1)", "(hi >> SHIFT).min((1 << LEVEL_MAX) - 2)"))
def containing(k):
    """`ContainingOctant::of` a facet in the root is the smallest octant that contains every closed level-19 cell that the extent meets; its
    level is at most 19, and its start is that of an octant of that level."""
    extent = [[k.signed("i64", *VERTEX), k.signed("i64", *VERTEX)] for _ in AXES]
    k.given.append(z3.And([low.x <= high.x for low, high in extent]))
    replaced = {"range": lambda run, f, axis: extent[axis], "crossed": lambda run, *_: k.bits("u64")}
    some, octant = k.option("of", Struct(), file=VOXELISE, replaced=replaced)
    in_root = z3.And([z3.And(low.x >= 0, high.x <= ROOT) for low, high in extent])
    level, start = (k(part, octant, file=VOXELISE) for part in ("level", "start"))
    corner = k("position", start)
    edge = z3.BitVecVal(1, 64) << z3.ZeroExt(32, 19 - level.x)
    def contained(c, cell): c = z3.ZeroExt(32, c.x); return z3.And(c <= cell, cell < c + edge)
    cells = [[z3.If(low.x <= 0, 0, low.x - 1 >> 8), z3.If(high.x >= ROOT, (1 << 19) - 1, high.x >> 8)] for low, high in extent]
    yield z3.Implies(in_root, z3.And(some, z3.ULE(level.x, 19), *[z3.ZeroExt(32, c.x) & edge - 1 == 0 for c in corner]))
    yield z3.Implies(in_root, z3.And([contained(c, cell) for c, pair in zip(corner, cells) for cell in pair]))
    yield z3.Implies(z3.And(in_root, level.x != 19), z3.Or([(low ^ high) & z3.LShR(edge, 1) != 0 for low, high in cells]))
    yield z3.Implies(z3.And(some, z3.Not(in_root)), z3.And(level.x == 0, start.x == 0))


@fact(VOTE, ("Self(u64::from(l) << 57 | code)", "Self(u64::from(l) << 56 | code)"), ("self.0 & ((1 << 57) - 1)", "self.0 & ((1 << 56) - 1)"))
def candidates(k):
    """A `Candidate` holds level and code of any leaf, and sorts by level and then by code."""
    def leaf():
        l, code = octant(k, 20)
        return l, code, k("new", l, code, file=VOTE)
    (l, a, v), (m, b, w) = leaf(), leaf()
    level, code = k("leaf", v, file=VOTE)
    yield z3.And(level.x == l.x, code.x == a.x)
    yield z3.ULT(v["0"].x, w["0"].x) == z3.Or(z3.ULT(l.x, m.x), z3.And(l.x == m.x, z3.ULT(a.x, b.x)))


# The digest


@fact(DIGEST, ("low += b & 0xffff_ffff;", "low += b & 0xffff_fffe;"), ("u128::from(low_top) << 32", "u128::from(low_top) << 31"), ("words.chunks(1 << 30)", "words.chunks(1 << 33)"))
def digests(k):
    """`digest_lanes` of up to three words is the sum of their `mix`, whatever the words; sums of 2^30 parts of 32 bits, as many as it takes at
    a time, fit u64."""
    # The product in `finalise` is hard, and does not matter here: any function of a word will do.
    f = z3.Function("finalise", z3.BitVecSort(64), z3.BitVecSort(64))
    finalise = {"finalise": lambda run, x: Number("u64", f(x.x))}
    for count in range(4):
        w = [k.bits("u64") for _ in range(count)]
        total = k("digest_lanes", w, file=DIGEST, replaced=finalise)
        yield term(total, Number("u128", z3.BitVecVal(0, 128))) == sum([k("mix", x, file=DIGEST, replaced=finalise).x for x in w], z3.BitVecVal(0, 128))
    yield plain(k.sources.fragment("words.chunks(", DIGEST)) * ((1 << 32) - 1) < 1 << 64
