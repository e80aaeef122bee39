"""What the readers of `harness import` have in common.

    python import_<reader>.py FILE CELLS REQUEST

REQUEST is an object in JSON: "format", the format of the file; "sides", the name of the array with the sides, or null; "root", the
root that the user gave, {"origin": [x, y, z], "edge": e}, or null; and "position", what x, y and z are in a table: corner, centre or
index. CELLS becomes rows of float64, one per cell: x, y and z of the minimum corner, the edge, then the level and the side, if they
are known. Standard output is one line of JSON:

    {"root": {"origin": [x, y, z], "edge": e} | null, "has_levels": bool, "has_sides": bool, "digest": "..." | null}

Exit codes: 0 success; 2 the file cannot be read or is not such a mesh, which the last line on standard error explains; 3 a package
cannot be imported.
"""

import json
import os
import resource
import sys

import numpy as np

# Greatest difference between a cell and a cube, in edges of the cell, as in the harness.
TOLERANCE = 0.01
LEVEL_MAX = 19


class Refused(Exception):
    """Why the file is not imported, in one sentence."""


def run(read):
    """The main function of a reader: `read(path, request)` returns corners, edges, and as further results by name levels, sides, root and
    digest."""
    if len(sys.argv) != 4:
        print(f"usage: {sys.argv[0]} FILE CELLS REQUEST", file=sys.stderr)
        raise SystemExit(2)
    # A damaged file may state any size: an allocation beyond the memory of the machine fails and is reported.
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    memory = memory if most == resource.RLIM_INFINITY else min(memory, most)
    resource.setrlimit(resource.RLIMIT_AS, (memory, most))
    try:
        corners, edges, more = read(sys.argv[1], json.loads(sys.argv[3]))
        wrong = np.flatnonzero(~(np.isfinite(corners).all(axis=1) & np.isfinite(edges) & (edges > 0)))
        if len(wrong):
            cell = f"cell {wrong[0]} with the corner {corners[wrong[0]].tolist()} and the edge {edges[wrong[0]]}"
            raise Refused(f"has {cell}: coordinates must be finite, and edges positive")
    except Refused as why:
        print(str(why).replace("\n", " "), file=sys.stderr)
        raise SystemExit(2) from None
    except OSError as error:
        print(f"cannot be read: {error.strerror} ({error.filename})", file=sys.stderr)
        raise SystemExit(2) from None
    except MemoryError:
        print("needs more memory than the machine has: it is damaged or too large", file=sys.stderr)
        raise SystemExit(2) from None
    columns = [column for column in (more.get("levels"), more.get("sides")) if column is not None]
    try:
        # NumPy's `tofile` does not notice that the end was not written.
        with open(sys.argv[2], "wb") as file:
            file.write(np.column_stack([corners, edges, *columns]).astype("<f8", order="C"))
    except OSError as error:
        print(f"was read, but its cells cannot be written to a temporary file: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    known = {f"has_{name}": more.get(name) is not None for name in ("levels", "sides")}
    print(json.dumps({"root": more.get("root"), "digest": more.get("digest"), **known}))
