"""The protocol of all oracles.

    python sides.py ORACLE

An oracle stays, because its packages take seconds to import. Each line of its standard input is a question, a JSON array of three
paths: POINTS contains three float64 coordinates for each of N points, and BODY.stl is a binary STL file. The oracle writes N bytes to
SIDES, 1 for each point that it finds inside the body and 0 for each point outside, and answers with a line: 0, or 1 if it failed,
with the reason on the standard error. It ends with its input, or with exit code 3 if its package is missing.

An oracle is a function sides(points, facets) -> array of N bools. Points and facets are translated so that the
bounding box of the body is centred on the origin. embree and open3d compute in float32, which would lose digits for a
body far from the origin; the translation here is in float64.
"""

import json
import sys
import traceback

import numpy as np

STL_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])


def read_facets(path):
    """The vertices of a binary STL file, as float64 of shape (facets, 3, 3)."""
    with open(path, "rb") as file:
        file.seek(80)
        count = int(np.fromfile(file, "<u4", 1)[0])
        facets = np.fromfile(file, STL_FACET, count)
    if len(facets) != count:
        raise ValueError(f"{path} contains {len(facets)} of the {count} facets of its header")
    return facets["vertices"].astype(np.float64)


def answer(sides, points, body, out):
    """Answers one question with the function `sides`."""
    points = np.fromfile(points, "<f8").reshape(-1, 3)
    facets = read_facets(body)
    centre = (facets.min(axis=(0, 1)) + facets.max(axis=(0, 1))) / 2 if len(facets) else np.zeros(3)
    inside = np.zeros(len(points), np.uint8)
    if len(facets) and len(points):
        inside[:] = sides(points - centre, facets - centre)
    inside.tofile(out)


def run(sides):
    """The main function of an oracle: answers questions with its function `sides`."""
    # Packages print where they like.
    answers, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        code = 0
        try:
            answer(sides, *json.loads(line))
        except Exception:
            traceback.print_exc()
            code = 1
        print(code, file=answers, flush=True)


def missing(error):
    """Reports that the package of an oracle cannot be imported, and exits."""
    print(f"{error.name or error} cannot be imported: {error}; ci/setup installs it", file=sys.stderr)
    raise SystemExit(3)
