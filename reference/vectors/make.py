"""Write digest.json, the test vectors that all programs of this workspace share (DEFINITION.md, section 14).

They are computed from the definition alone. Python's integers are exact, and its floats are IEEE doubles
with rounding to even, as the definition requires. Run in this directory: python3 make.py
"""

import json
import math
import struct

MASK = (1 << 64) - 1
ROOT_EDGE = 1 << 27


def f(x):
    x ^= x >> 30
    x = x * 0xBF58476D1CE4E5B9 & MASK
    x ^= x >> 27
    x = x * 0x94D049BB133111EB & MASK
    return x ^ x >> 31


def mix(w):
    a = f((w + 0x9E3779B97F4A7C15) & MASK)
    b = f(a ^ ((w << 32 | w >> 32) & MASK))
    return a << 64 | b


def digest(words):
    return sum(map(mix, words)) % (1 << 128)


def facet_word(facet):
    w = 0
    for c in facet:
        w = f((w ^ (c & MASK)) + 0x9E3779B97F4A7C15 & MASK)
    return w


def word(level, cell, side):
    morton = 0
    for bit in range(19):
        for axis in range(3):
            morton |= (cell[axis] >> bit & 1) << (3 * bit + axis)
    return morton << 7 | level << 2 | ["outside", "inside", "crossing"].index(side)


def level(edge, spacing):
    return next((d for d in range(20) if edge / 2**d <= spacing), None)


def lattice(origin, edge, point):
    scale = ROOT_EDGE / edge
    return [round((x - o) * scale) for x, o in zip(point, origin)]


def f32(x):
    return struct.unpack("<f", struct.pack("<f", x))[0]


def root(vertices, scale):
    lo = [min(v[a] for v in vertices) for a in range(3)]
    hi = [max(v[a] for v in vertices) for a in range(3)]
    edge = scale * max(hi[a] - lo[a] for a in range(3))
    return [(lo[a] + hi[a]) * 0.5 - edge * 0.5 for a in range(3)], edge


def hex64(x):
    return f"{x:016x}"


def hex128(x):
    return f"{x:032x}"


def numbers(xs):
    """Numbers as text, because JSON readers may not round the last bit of a number correctly."""
    return [repr(x) for x in xs]


LAST = (1 << 19) - 1
WORDS = [
    (0, [0, 0, 0], "outside"),
    (0, [0, 0, 0], "crossing"),
    (1, [1 << 18, 0, 0], "outside"),
    (1, [0, 1 << 18, 0], "inside"),
    (1, [0, 0, 1 << 18], "crossing"),
    (3, [1 << 16, 1 << 17, 3 << 16], "inside"),
    (3, [7 << 16, 7 << 16, 7 << 16], "outside"),
    (10, [512, 1024, 523776], "outside"),
    (14, [123456 & ~31, 400000 & ~31, 77777 & ~31], "crossing"),
    (19, [1, 2, 4], "crossing"),
    (19, [0x2AAAA, 0x55555, 0x7FFFF], "inside"),
    (19, [LAST, 0, 0], "outside"),
    (19, [0, LAST, 0], "outside"),
    (19, [0, 0, LAST], "outside"),
    (19, [LAST, LAST, LAST], "crossing"),
]
MIX = [0, 1, 2, 1 << 32, 1 << 63, MASK, 0x0123456789ABCDEF, word(*WORDS[8]), word(*WORDS[14])]
DIGESTS = [
    [],
    [0],
    [word(1, [(i & 1) << 18, (i >> 1 & 1) << 18, (i >> 2) << 18], "crossing") for i in range(8)],
    [word(*w) for w in WORDS],
    # Enough words for the sum to wrap around modulo 2^128.
    [word(3, [x << 16, y << 16, z << 16], "outside") for z in range(8) for y in range(8) for x in range(8)],
]
LOW, HIGH = -ROOT_EDGE, 2 * ROOT_EDGE
GEOMETRIES = [
    [],
    [[0] * 9],
    [[1, 2, 3, 4, 5, 6, 7, 8, 9]],
    # The same facet from another vertex, and with the other orientation.
    [[4, 5, 6, 7, 8, 9, 1, 2, 3]],
    [[4, 5, 6, 1, 2, 3, 7, 8, 9]],
    [[LOW, HIGH, 0, HIGH, LOW, -1, ROOT_EDGE, ROOT_EDGE - 1, 1]],
    # Twice the same, and one without area.
    [[1, 2, 3, 4, 5, 6, 7, 8, 9], [-5] * 9, [1, 2, 3, 4, 5, 6, 7, 8, 9]],
    # More facets than fit into the vector lanes of a program at once.
    [[(i * i * 7919 + 104729 * k * (i - 40)) % (HIGH - LOW) + LOW for k in range(9)] for i in range(83)],
]
LEVELS = [
    (8.0, 8.0), (8.0, 9.0), (8.0, 7.999999), (8.0, 4.0), (8.0, 0.01), (1.0, 0.1), (1.0, 2.0**-19),
    (1.0, math.nextafter(2.0**-19, 0)), (0.3, 0.3 / 1024), (10.000000149011612, 0.01), (1e30, 1e25),
]
ROOTS = [
    ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]], 10.0),
    ([[0.1, -0.2, 0.3], [0.7, 0.4, -0.9], [0.25, 1.1, 0.6]], 10.0),
    ([[581310.0, 4785300.5, 937.3], [582300.0, 4786300.0, 1044.6], [581777.7, 4785555.5, 999.9]], 3.0),
    ([[-0.051487, -0.050792, -0.012517], [0.046495, 0.05471, 0.018503], [0.0, 0.0, 0.0]], 2.5),
]
QUANTISED = [
    # The lattice unit is 1 here, and halves are rounded to the even neighbour.
    ([0.0, 0.0, 0.0], float(ROOT_EDGE), [0.5, 1.5, 2.5]),
    ([0.0, 0.0, 0.0], float(ROOT_EDGE), [-0.5, -1.5, 1.4999999]),
    ([0.0, 0.0, 0.0], float(ROOT_EDGE), [-float(ROOT_EDGE), 2.0 * ROOT_EDGE, 0.0]),
    ([0.0, 0.0, 0.0], float(ROOT_EDGE), [-ROOT_EDGE - 0.5, 2.0 * ROOT_EDGE + 0.5, 0.0]),
    ([0.0, 0.0, 0.0], float(ROOT_EDGE), [-ROOT_EDGE - 0.75, 0.0, 0.0]),
    ([0.0, 0.0, 0.0], float(ROOT_EDGE), [0.0, 2.0 * ROOT_EDGE + 0.75, 0.0]),
    ([-4.0, -4.0, -4.0], 8.0, [f32(0.1), f32(-0.7), f32(3.3333333)]),
    ([-0.3, 0.1, 0.7], 0.9, [0.1, 0.2, 0.8]),
    ([580000.0, 4784000.0, -500.0], 3000.0, [f32(581777.7), f32(4785555.5), f32(999.9)]),
    ([1e-3, -2e-3, 3e-3], 1e-2, [f32(0.0012345), f32(0.0054321), f32(0.0099999)]),
]


def quantised(origin, edge, point):
    q = lattice(origin, edge, point)
    return q if all(-ROOT_EDGE <= x <= 2 * ROOT_EDGE for x in q) else None


def clamped(origin, edge, point):
    return [min(max(x, 0), ROOT_EDGE) for x in lattice(origin, edge, point)]


BOXES = [
    ([-4.0, -4.0, -4.0], 8.0, [0.0, -1.0, -1.0], [4.0, 1.0, 1.0]),
    ([-4.0, -4.0, -4.0], 8.0, [-100.0, 0.1, 3.9], [-0.3, 0.2, 1e9]),
]

vectors = {
    "schema": "octree-test-vectors/1",
    "mix": [{"word": hex64(w), "mix": hex128(mix(w))} for w in MIX],
    "digests": [{"words": list(map(hex64, ws)), "digest": hex128(digest(ws))} for ws in DIGESTS],
    "geometries": [{"facets": fs, "digest": hex128(digest(map(facet_word, fs)))} for fs in GEOMETRIES],
    "words": [
        {"level": l, "cell": c, "side": s, "word": hex64(word(l, c, s)), "octant": word(l, c, s) >> 55}
        for l, c, s in WORDS
    ],
    "levels": [{"edge": repr(e), "spacing": repr(s), "level": level(e, s)} for e, s in LEVELS],
    "roots": [
        {"vertices": [numbers(v) for v in vs], "root_scale": repr(k),
         "origin": numbers(root(vs, k)[0]), "edge": repr(root(vs, k)[1])}
        for vs, k in (([list(map(f32, v)) for v in vs], k) for vs, k in ROOTS)
    ],
    "quantised": [
        {"origin": numbers(o), "edge": repr(e), "vertex": numbers(p), "lattice": quantised(o, e, p)}
        for o, e, p in QUANTISED
    ],
    "boxes": [
        {"origin": numbers(o), "edge": repr(e), "min": numbers(p), "max": numbers(q),
         "lattice_min": clamped(o, e, p), "lattice_max": clamped(o, e, q)}
        for o, e, p, q in BOXES
    ],
}

with open("digest.json", "w", encoding="utf-8") as file:
    file.write("{\n")
    for i, (name, cases) in enumerate(vectors.items()):
        file.write(",\n" if i else "")
        if isinstance(cases, str):
            file.write(f"{json.dumps(name)}: {json.dumps(cases)}")
        else:
            lines = ",\n  ".join(map(json.dumps, cases))
            file.write(f"{json.dumps(name)}: [\n  {lines}\n]")
    file.write("\n}\n")
