"""Values of kernels on drawn inputs, as rust.py evaluates the sources. Tests of the crates compare them with the compiled functions.

A line of values.txt is `FILE FUNCTION INPUT... = OUTPUT...`; a u128 is its two halves, an f64 is in quarters, and no output
is `None`.
"""
import random

from kernels import (BRICK, CHECK_SPLITS, CHECK_SIDES, DIGEST, FACET, LATTICE, OCTANT, RAYS, ROOT, TILE, VERTEX, VERDICT, REFINE, i64, u32,
                     usize)
from rust import Number, Run, Struct

DRAWS = 16


def bits(r, width):
    """Few bits, many bits, or any."""
    a, b = r.getrandbits(width), r.getrandbits(width)
    return r.choice([a, a & b & r.getrandbits(width), a | b, (1 << width) - 1, 1 << r.randrange(width), 0])


def u64(r): return Number("u64", bits(r, 64))
def row(r): return Number("u64", bits(r, 32) << 16)


def octant(r):
    l = r.choice([0, 1, 2, 19, r.randrange(20)])
    return u32(l), Number("u64", bits(r, 3 * l) if l else 0)


def coordinate(r, low=VERTEX[0], high=VERTEX[1]):
    """Often a multiple of a large power of two, or beside one, where tests of facets change sides."""
    step = 1 << r.choice([0, 8, 20, 25, 26])
    return min(max(r.randint(low, high) // step * step + r.choice([0, 0, -1, 1]), low), high)


def facet(r, *limits):
    v = [[coordinate(r, *limits) for _ in range(3)] for _ in range(3)]
    if r.random() < 0.5:  # near a point
        v = [v[0]] + [[min(max(c + r.randint(-1, 1) * (1 << r.randrange(25)), (limits or VERTEX)[0]), (limits or VERTEX)[1]) for c in v[0]] for _ in range(2)]
    return Struct(v=[[Number("i32", c) for c in p] for p in v])


def point(r): return [i64(coordinate(r, 0, ROOT)) for _ in range(3)]


def brick(r, near):
    """The brick at a point, with its level."""
    l = r.randrange(2, 21)
    return [i64(min(max(c.x, 0), ROOT - 1) >> 29 - l << 29 - l) for c in near], u32(l)


def facet_and_brick(r, last=lambda l: l):
    """A facet about as large as a brick and near it, often with vertices on the corners of octants."""
    l = r.randrange(2, 21)
    h = ROOT >> l
    step = r.choice([1, h // 2, h])
    corner = [r.randrange(1 << l - 2) * 4 * h for _ in range(3)]
    v = [[min(max((c + r.randint(-h, 5 * h)) // step * step, VERTEX[0]), VERTEX[1]) for c in corner] for _ in range(3)]
    return [Struct(v=[[Number("i32", c) for c in p] for p in v]), [i64(c) for c in corner], last(u32(l))]


def box_and_brick(r):
    b = box(r)
    return [b, *brick(r, r.choice([b["min"], b["max"]]))]


def box(r):
    ends = [sorted([coordinate(r, 0, ROOT), coordinate(r, 0, ROOT)]) for _ in range(3)]
    return Struct(min=[i64(e[0]) for e in ends], max=[i64(e[1]) for e in ends])


def ray(r):
    """Through an edge or a vertex of a facet, or beside it."""
    f, axis = facet(r, 0, ROOT), r.randrange(3)
    a, b = r.sample(f["v"], 2)
    p = [i64((x.x + y.x) // 2) for x, y in zip(a, b)]
    p[axis] = i64(coordinate(r, 0, ROOT))
    return [f, p, usize(axis)]


def test_of_origin():
    """`FacetTest::default`."""
    side = Struct(ci=Number("i32", 0), cj=Number("i32", 0), at_origin=i64(0), growth=Number("i32", 0))
    return Struct(facet=Struct(v=[[Number("i32", 0)] * 3 for _ in range(3)]), normal=[i64(0)] * 3, sides=[[side] * 3 for _ in range(3)])


def separated(run, f, corner, shift):
    """The tests by lanes, at the width that every processor has."""
    return run.call("lanes", [f if "facet" in f else run.call("prepared", [test_of_origin(), f], FACET), corner, shift], FACET)


REPLACED = {"separated": separated, "default": lambda run: test_of_origin()}

INPUTS = {
    (OCTANT, "spread"): lambda r: [u64(r)],
    (OCTANT, "gather"): lambda r: [u64(r)],
    (OCTANT, "morton"): lambda r: [[u32(bits(r, 21)) for _ in range(3)]],
    (OCTANT, "position"): lambda r: [u64(r)],
    (OCTANT, "start57"): octant,
    (OCTANT, "corner"): octant,
    (OCTANT, "edge"): lambda r: [u32(r.randrange(21))],
    (OCTANT, "word"): lambda r: [*octant(r), Number("u64", r.randrange(3))],
    (OCTANT, "neighbour"): lambda r: [*octant(r), usize(r.randrange(3)), r.random() < 0.5],
    (BRICK, "parents"): lambda r: [u64(r)],
    (BRICK, "children"): lambda r: [Number("u8", bits(r, 8))],
    (BRICK, "to_rows"): lambda r: [u64(r)],
    (BRICK, "from_rows"): lambda r: [u64(r)],
    (BRICK, "moved"): lambda r: [u64(r), usize(r.randrange(3)), r.random() < 0.5],
    (BRICK, "across"): lambda r: [u64(r), usize(r.randrange(3)), r.random() < 0.5],
    (BRICK, "flood"): lambda r: [Number("u64", 1 << r.randrange(64)), u64(r)],
    (TILE, "dilate_row"): lambda r: [row(r), usize(r.choice([0, 1, 15, 16, r.randrange(17)]))],
    (TILE, "pairs"): lambda r: [u64(r)],
    (TILE, "transpose"): lambda r: [[u64(r) for _ in range(16)]],
    (FACET, "range"): lambda r: [facet(r), usize(r.randrange(3))],
    (FACET, "normal"): lambda r: [facet(r)],
    (FACET, "crossed"): facet_and_brick,
    (FACET, "separated"): lambda r: facet_and_brick(r, lambda l: u32(27 - l.x)),
    (DIGEST, "mix"): lambda r: [u64(r)],
    (DIGEST, "digest_lanes"): lambda r: [[u64(r) for _ in range(r.randrange(4))]],
    (LATTICE, "meets"): lambda r: [b := box(r), r.choice([b["min"], b["max"], point(r)]), i64(1 << r.randrange(28))],
    (LATTICE, "box_mask"): box_and_brick,
    (LATTICE, "rounded"): lambda r: [Number("f64", coordinate(r) / 4), Number("f64", float(r.randint(-8, 8))), Number("f64", 2.0)],
    (LATTICE, "off_centre"): lambda r: [Number("f64", float(coordinate(r)))],
    (REFINE, "of"): lambda r: [facet(r, *r.choice([VERTEX, (0, ROOT), (0, ROOT)]))],
    (RAYS, "meets"): ray,
    (VERDICT, "new"): octant,
    (VERDICT, "leaf"): lambda r: [Struct({"0": Number("u64", bits(r, 62))})],
    (CHECK_SPLITS, "touches"): lambda r: facet_and_brick(r, lambda l: i64(4 * ROOT >> l.x)),
    (CHECK_SIDES, "ray_that_meets"): ray,
}


def flat(v):
    if isinstance(v, Struct):
        v = list(v.values())
    if isinstance(v, list):
        return [x for item in v for x in flat(item)]
    if isinstance(v, Number):
        return [v.x >> 64, v.x % (1 << 64)] if v.type == "u128" else [int(4 * v.x) if v.type == "f64" else v.x]
    return [int(v)]


def lines(sources, only=None):
    for (file, name), draw in INPUTS.items():
        if only and file not in only:
            continue
        r = random.Random(name)
        for _ in range(DRAWS):
            inputs = draw(r)
            given = flat(list(inputs))
            run = Run(sources, REPLACED)
            outputs = separated(run, *inputs) if name == "separated" else run.call(name, inputs, file)
            outputs = inputs[0] if name == "transpose" else outputs
            yield " ".join(map(str, [file, name, *given, "=", *(["None"] if outputs is None else flat(outputs))]))
