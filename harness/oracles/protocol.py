"""The one protocol that every oracle here speaks.

    python <oracle>.py POINTS.npy BODY.stl SIDES.npy

POINTS.npy holds float64 coordinates of shape (N, 3), BODY.stl is a binary STL file, and SIDES.npy
receives N bytes: 1 where the oracle holds the point to be inside the body, 0 where outside. The oracle
prints one line, its name and version. Exit codes: 0 done; 2 wrong arguments; 3 the oracle's package
is missing; anything else is the oracle's own failure.

An oracle is a function sides(points, facets) -> array of N bools. Points and facets come to it shifted
so that the body's bounding box is centred on the origin: embree and open3d compute in float32, and a body
far from the origin would lose to cancellation what the shift, made here in float64, keeps.
"""

import sys

import numpy as np

STL_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])


def read_facets(path):
    """The vertices of a binary STL file, as float64 of shape (facets, 3, 3)."""
    with open(path, "rb") as file:
        file.seek(80)
        count = int(np.fromfile(file, "<u4", 1)[0])
        facets = np.fromfile(file, STL_FACET, count)
    if len(facets) != count:
        raise SystemExit(f"{path} holds {len(facets)} of the {count} facets that it announces")
    return facets["vertices"].astype(np.float64)


def run(name, version, sides):
    """Does what the module text says, with the given oracle; the whole of an oracle's main."""
    if len(sys.argv) != 4:
        print(f"usage: {sys.argv[0]} POINTS.npy BODY.stl SIDES.npy", file=sys.stderr)
        raise SystemExit(2)
    points = np.load(sys.argv[1])
    facets = read_facets(sys.argv[2])
    centre = (facets.min(axis=(0, 1)) + facets.max(axis=(0, 1))) / 2 if len(facets) else np.zeros(3)
    answer = np.zeros(len(points), np.uint8)
    if len(facets) and len(points):
        answer[:] = sides(points - centre, facets - centre)
    np.save(sys.argv[3], answer)
    print(f"{name} {version}")


def missing(error):
    """Ends an oracle whose package cannot be imported, in one sentence."""
    print(f"{error.name or error} cannot be imported: {error}", file=sys.stderr)
    raise SystemExit(3)
