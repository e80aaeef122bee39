"""The protocol of all oracles.

    python <oracle>.py POINTS.npy BODY.stl SIDES.npy

POINTS.npy contains float64 coordinates of shape (N, 3), and BODY.stl is a binary STL file. The oracle writes N bytes
to SIDES.npy, 1 for each point that it finds inside the body and 0 for each point outside, and prints its name and
version on one line. Exit codes: 0 success; 2 invalid arguments; 3 the package of the oracle is missing; any other
code is a failure of the oracle itself.

An oracle is a function sides(points, facets) -> array of N bools. Points and facets are translated so that the
bounding box of the body is centred on the origin. embree and open3d compute in float32, which would lose digits for a
body far from the origin; the translation here is in float64.
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
        raise SystemExit(f"{path} contains {len(facets)} of the {count} facets of its header")
    return facets["vertices"].astype(np.float64)


def run(name, version, sides):
    """The main function of an oracle: runs the protocol with its function `sides`."""
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
    """Reports that the package of an oracle cannot be imported, and exits."""
    print(f"{error.name or error} cannot be imported: {error}; ci/setup installs it", file=sys.stderr)
    raise SystemExit(3)
