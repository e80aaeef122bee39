"""Facts about facets, rays, the lattice, sorted keys and the digest."""
import z3
from kernels import (
    AXES, CHECK_SPLITS, CHECK_SIDES, DIGEST, FACET, LATTICE, OCTANTS, RAYS, ROOT, VERTEX, VERDICT, REFINE, bit, fact, has, i64, maximum,
    minimum, no, octant, u32, usize, word)
from rust import Number, plain, Struct, term


# Facets


@fact(FACET, ("let cross = |u: usize, w: usize| d(1, u) * d(2, w) - d(1, w) * d(2, u);", "let cross = |u: usize, w: usize| 64 * (d(1, u) * d(2, w) - d(1, w) * d(2, u));"))
def normals(k):
    """`normal` fits i64 for all vertices in [-2^27, 2^28]: components are at most 18 * 2^54, which three times is below 2^60."""
    n = k("normal", k.facet(k.integer), file=FACET)
    yield all(k.interval(c.x) == (-18 << 54, 18 << 54) for c in n)
    yield 3 * (18 << 54) < 1 << 60


def abs_at_most(n, bound): return z3.And(-bound <= n.x, n.x <= bound)


@fact(FACET, ("let first = (lo - corner[axis] - 1) >> shift;", "let first = (lo - corner[axis]) >> shift;"), ("let last = (hi - corner[axis]) >> shift;", "let last = (hi - corner[axis] - 1) >> shift;"),
      ("let shift = ROOT_BITS - l;\n        let mut wide", "let shift = ROOT_BITS - l - 1;\n        let mut wide"))
def extents(k):
    """The coordinate axes of `octants`: an octant is left out if and only if its closed cube and the facet's extent are disjoint, for all
    facets, bricks and levels up to 20."""
    every = {"separated": lambda *_: Number("u64", (1 << 64) - 1)}
    for l in range(21):
        h = ROOT >> l
        extent = [[k.integer("i64", *VERTEX), k.integer("i64", *VERTEX)] for _ in AXES]
        k.given.append(z3.And([low.x <= high.x for low, high in extent]))
        corner = [k.integer("i64", 0, ROOT) for _ in AXES]
        mask = k("octants", Struct(), Struct(), corner, u32(l), k.bits("u64"), file=FACET, replaced={**every, "prepared": lambda *_: Struct(), "range": lambda run, f, axis: extent[axis]})
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


@fact(FACET, ("(k & 3, 2 * half + (k >> 2))", "(k & 3, half + (k >> 2))"))
def columns(k):
    """`COLUMNS` of an axis, half and byte is the union of the columns of octants over the squares whose bits the byte has, for every byte."""
    table = k.sources.constant("COLUMNS", FACET)
    for a in AXES:
        for half in range(2):
            yield all(plain(table[a][half][byte]) == sum(1 << i for i in range(64) if square(i, a) // 8 == half and byte >> square(i, a) % 8 & 1)
                      for byte in range(256))


def square(i, a): return OCTANTS[i][(a + 1) % 3] + 4 * OCTANTS[i][(a + 2) % 3]


SHIFTS = range(7, 28)  # of octants of levels 20 to 0


@fact(FACET, ("+ i64::from(side.growth);", "+ i64::from(side.growth) - 1;"), ("ci * ((k & 3) - 1) + cj * ((k >> 2) - 1)", "cj * ((k & 3) - 1) + ci * ((k >> 2) - 1)"),
      ("ci * ((k & 3) - 1) + cj * ((k >> 2) - 1)", "ci * ((k & 3) - 2) + cj * ((k >> 2) - 2)"), ("u32::from(s & t & r)", "u32::from(s & t | r)"), ("u32::from(s & t & r)", "u32::from(s ^ t ^ r)"))
def half_planes(k):
    """`squares` of what `half_plane` returns, whichever of the three sides it is: a square meets the closed half-plane if and only if some corner
    of it does, and all terms fit their types, for all edges, starts, corners of bricks, and levels up to 20; and all three count."""
    for bits in range(8):
        sides = [[Number("i32", 0), Number("i32", 0), Number("i32", bits >> s & 1)] for s in range(3)]
        yield plain(k("squares", sides, file=FACET)) == (0 if bits else 0xffff)
    for shift in SHIFTS:
        h = 1 << shift
        ci, cj = (k.integer("i32", -(3 << 27), 3 << 27) for _ in range(2))
        start, corner = [k.integer("i64", *VERTEX) for _ in range(2)], [k.integer("i64", 0, ROOT) for _ in range(2)]
        growth = ci.x + cj.x + maximum([ci.x, z3.IntVal(0)]) + maximum([cj.x, z3.IntVal(0)])
        side = Struct(ci=ci, cj=cj, at_origin=Number("i64", -(ci.x * start[0].x) - cj.x * start[1].x), growth=Number("i32", growth))
        half, whole = k("half_plane", side, corner, u32(shift), file=FACET), [Number("i32", 0)] * 3
        def edge(i, j): return ci.x * (h * i + corner[0].x - start[0].x) + cj.x * (h * j + corner[1].x - start[1].x)
        for at in range(3):
            mask = k("squares", [half if s == at else whole for s in range(3)], file=FACET)
            for i in range(4):
                for j in range(4):
                    yield has(mask, i + 4 * j) == (maximum([edge(i + di, j + dj) for di in range(2) for dj in range(2)]) >= 0)


def projected(k): return [[k.integer("i32", *VERTEX) for _ in AXES] for _ in range(3)]
def value(side, q, u, w): return side["ci"].x * q[u].x + side["cj"].x * q[w].x + side["at_origin"].x


@fact(FACET, ("let (ci, cj) = (-ew * sign, eu * sign);", "let (ci, cj) = (ew * sign, eu * sign);"), ("ci.max(0) + cj.max(0)", "ci.max(0) + cj.min(0)"), ("at_origin: -at(ci, u) - at(cj, w)", "at_origin: -at(ci, w) - at(cj, u)"))
def edges(k):
    """The `sides` of a facet whose projection has an area are the edge functions of its edges, with the sign that makes them positive
    inside; `growth` is what `half_planes` takes it for, and coefficients are at most 3 * 2^27."""
    for sign in (1, -1):
        for a in AXES:
            (u, w), v, q = ((a + 1) % 3, (a + 2) % 3), projected(k), [k.integer("i64", *VERTEX) for _ in AXES]
            for i, side in enumerate(k("sides", v, i64(sign), usize(a), file=FACET)):
                start, to, ci, cj = v[i], v[(i + 1) % 3], side["ci"].x, side["cj"].x
                yield value(side, q, u, w) == sign * ((to[u].x - start[u].x) * (q[w].x - start[w].x) - (to[w].x - start[w].x) * (q[u].x - start[u].x))
                yield side["growth"].x == ci + cj + z3.If(ci > 0, ci, 0) + z3.If(cj > 0, cj, 0)
                yield z3.And([z3.And(-(3 << 27) <= c, c <= 3 << 27) for c in (ci, cj)])


@fact(FACET, ("max_by_key(|e| e.0.abs() + e.1.abs())", "max_by_key(|e| e.0.abs())"), ("max_by_key(|e| e.0.abs() + e.1.abs())", "max_by_key(|e| e.0 + e.1)"),
      ("[side(longest, 1), side(longest, -1), side(longest, -1)]", "[side(longest, 1), side(longest, 1), side(longest, -1)]"))
def degenerate(k):
    """The line of the `sides` of a facet whose projection has no area contains all three projected vertices; it has no direction only if
    they are one point. Both of its half-planes are among the sides."""
    for a in AXES:
        (u, w), p = ((a + 1) % 3, (a + 2) % 3), projected(k)
        def turn(a, b, c): return (b[u].x - a[u].x) * (c[w].x - a[w].x) - (b[w].x - a[w].x) * (c[u].x - a[u].x)
        collinear = turn(*p) == 0
        for path, (side, other, last) in k.paths("sides", p, i64(0), usize(a), file=FACET):
            yield z3.Implies(z3.And(path, collinear), z3.And(
                *[value(side, q, u, w) == 0 for q in p],
                z3.Implies(z3.And(side["ci"].x == 0, side["cj"].x == 0), z3.And([z3.And(q[u].x == p[0][u].x, q[w].x == p[0][w].x) for q in p])),
                *[back[of].x == -side[of].x for of in ("ci", "cj", "at_origin") for back in (other, last)]))


def slab_of(n, most, span):
    """The octants (i, j, k) where `n.(i, j, k) + most` lies in 0..=span."""
    return word(z3.And(0 <= at, at <= span.x) for at in (sum((p[a] * n[a].x for a in AXES), most.x) for p in OCTANTS))


@fact(FACET, ("let base = most.wrapping_add(2 * low[byte]);", "let base = most.wrapping_add(low[byte]);"), ("<< (8 * byte + i)", "<< (8 * i + byte)"), ("(i >> a & 1)", "(i >> (2 - a) & 1)"))
def slabs(k):
    """`slab` has an octant if and only if `n.(i, j, k) + most` is at least 0 and at most `span`, for all normals, and all `most` and `span` with which
    no lane overflows."""
    n = [k.integer("i64", -18 << 54, 18 << 54) for _ in AXES]
    most, span = k.integer("i64", -5 << 60, 5 << 60), k.integer("u64", 0, 1 << 63)
    yield k("slab", n, most, span, file=FACET).x == slab_of(n, most, span)


@fact(FACET, ("floor.abs() <= 4 * i128::from(up - down)", "floor.abs() <= 3 * i128::from(up - down)"), ("let ceil = (offset + ((1 << shift) - 1)) >> shift;", "let ceil = offset >> shift;"),
      ("floor.abs() <= 4 * i128::from(up - down)", "floor.abs() <= 16 * i128::from(up - down)"), ("most.wrapping_sub(least) as u64", "most as u64"), ("u64::from(is_near).wrapping_neg()", "u64::MAX"))
def planes(k):
    """`plane_mask`: an octant meets the facet's plane if and only if its corners are not all on one side, for all normals, vertices and levels up
    to 20. What is decided without lanes is decided so, and where they decide, `most` and `span` are within the bounds of `slabs`."""
    def slab(run, n, most, span):
        return Number("u64", z3.If(z3.And(-5 << 60 <= most.x, most.x <= 5 << 60, span.x <= 1 << 63), slab_of(n, most, span), z3.FreshConst(z3.BitVecSort(64))))
    for shift in SHIFTS:
        h = 1 << shift
        n = [k.integer("i64", -18 << 54, 18 << 54) for _ in AXES]
        vertex = [k.integer("i64", -(1 << 28), 1 << 28) for _ in AXES]
        mask = k("plane_mask", vertex, n, u32(shift), file=FACET, replaced={"slab": slab})
        offset = sum(n[a].x * vertex[a].x for a in AXES)
        most, least = [sum(h * each([n[a].x, z3.IntVal(0)]) for a in AXES) for each in (maximum, minimum)]
        def meets(p): at = sum(h * p[a] * n[a].x for a in AXES) - offset; return z3.And(at + most >= 0, at + least <= 0)
        # Always so, which is lost where products become unknowns.
        is_plane = z3.Or([offset == 0] + [c.x != 0 for c in n])
        yield z3.Implies(is_plane, z3.And([has(mask, i) == meets(p) for i, p in enumerate(OCTANTS)]))


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


@fact(CHECK_SPLITS, ("axis.iter().map(|c| (sign * c).max(0))", "axis.iter().map(|c| (sign * c * c).max(0))"))
def facets_checked(k):
    """The second test of facets against octants, `touches`: its terms are below 2^93 and fit their types, for all facets and octants."""
    f, corner, h = k.facet(k.integer), [k.integer("i64", 0, ROOT) for _ in AXES], k.integer("i64", 1, ROOT)
    k.paths("touches", f, corner, h, file=CHECK_SPLITS)
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
    q = k("rounded", x, Number("f64", 0.0), Number("f64", 1.0), file=LATTICE)
    limit = k.sources.fragment("let limit = ", LATTICE)
    near = z3.fpLEQ(k("off_centre", q, file=LATTICE).x, z3.FPVal(limit.x, z3.Float64()))
    yield near == z3.And(z3.fpGEQ(q.x, z3.FPVal(VERTEX[0], z3.Float64())), z3.fpLEQ(q.x, z3.FPVal(VERTEX[1], z3.Float64())))


# Keys of sorted lists


@fact(REFINE, ("let first = ((lo - 1) >> SHIFT).max(0);", "let first = (lo >> SHIFT).max(0);"), ("u64::from(LEVEL_MAX - drop)", "u64::from(LEVEL_MAX + 1 - drop)"),
      ("(hi >> SHIFT).min((1 << LEVEL_MAX) - 1)", "(hi >> SHIFT).min((1 << LEVEL_MAX) - 2)"))
def containing(k):
    """`ContainingOctant::of` a facet in the root is the smallest octant that contains every closed level-19 cell that the extent meets; its
    level is at most 19, and its start is that of an octant of that level."""
    extent = [[k.signed("i64", *VERTEX), k.signed("i64", *VERTEX)] for _ in AXES]
    k.given.append(z3.And([low.x <= high.x for low, high in extent]))
    replaced = {"range": lambda run, f, axis: extent[axis], "crossed": lambda run, *_: k.bits("u64")}
    some, octant = k.option("of", Struct(), file=REFINE, replaced=replaced)
    in_root = z3.And([z3.And(low.x >= 0, high.x <= ROOT) for low, high in extent])
    level, start = (k(part, octant, file=REFINE) for part in ("level", "start"))
    corner = k("position", start)
    edge = z3.BitVecVal(1, 64) << z3.ZeroExt(32, 19 - level.x)
    def contained(c, cell): c = z3.ZeroExt(32, c.x); return z3.And(c <= cell, cell < c + edge)
    cells = [[z3.If(low.x <= 0, 0, low.x - 1 >> 8), z3.If(high.x >= ROOT, (1 << 19) - 1, high.x >> 8)] for low, high in extent]
    yield z3.Implies(in_root, z3.And(some, z3.ULE(level.x, 19), *[z3.ZeroExt(32, c.x) & edge - 1 == 0 for c in corner]))
    yield z3.Implies(in_root, z3.And([contained(c, cell) for c, pair in zip(corner, cells) for cell in pair]))
    yield z3.Implies(z3.And(in_root, level.x != 19), z3.Or([(low ^ high) & z3.LShR(edge, 1) != 0 for low, high in cells]))
    yield z3.Implies(z3.And(some, z3.Not(in_root)), z3.And(level.x == 0, start.x == 0))


@fact(VERDICT, ("Self(u64::from(l) << 57 | code)", "Self(u64::from(l) << 56 | code)"), ("self.0 & ((1 << 57) - 1)", "self.0 & ((1 << 56) - 1)"))
def candidates(k):
    """A `Candidate` holds level and code of any leaf, and sorts by level and then by code."""
    def leaf():
        l, code = octant(k, 20)
        return l, code, k("new", l, code, file=VERDICT)
    (l, a, v), (m, b, w) = leaf(), leaf()
    level, code = k("leaf", v, file=VERDICT)
    yield z3.And(level.x == l.x, code.x == a.x)
    yield z3.ULT(v["0"].x, w["0"].x) == z3.Or(z3.ULT(l.x, m.x), z3.And(l.x == m.x, z3.ULT(a.x, b.x)))


# The digest


@fact(DIGEST, ("low = low.wrapping_add(b);", "low = low.wrapping_add(b | 1);"), ("u128::from(top) << 32", "u128::from(top) << 31"), ("words.chunks(1 << 30)", "words.chunks(1 << 33)"))
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
