"""An oct-tree mesher on discretize.TreeMesh: every cell that a facet crosses has the surface level, 2:1 balance over
corners, no layers. README.md describes it as an engine."""

import argparse
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
from discretize import TreeMesh

sys.path.append(str(Path(__file__).parents[1]))
import leafset  # noqa: E402


def read_stl(path):
    """The vertices of a binary STL file, of shape (facets, 3, 3)."""
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(path.read_bytes()[84:], facet)["corners"].astype(float)


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("case", type=Path, help='case file with a binary STL file, a [root] table and keep = "all"')
parser.add_argument("--out", type=Path, metavar="DIR", help="directory for the leaf set")
parser.add_argument("--json", type=Path, metavar="FILE", help="run report")
options = parser.parse_args()
case = tomllib.loads(options.case.read_text())
root = case["root"]
level = next(level for level in range(20) if root["edge"] / 2**level <= case["spacing_min"])
facets = read_stl(options.case.parent / case["geometry"])

wall, cpu = time.perf_counter(), time.process_time()
mesh = TreeMesh([np.full(2**level, root["edge"] / 2**level)] * 3, origin=root["origin"], diagonal_balance=True)
mesh.refine_triangle(facets, level)
phases = [("refine", time.perf_counter() - wall, time.process_time() - cpu)]

levels = mesh.cell_levels_by_index(np.arange(mesh.n_cells))
half = 2.0 ** (18 - levels)
words = leafset.leaf_words((mesh.cell_centers - root["origin"]) * (2**19 / root["edge"]) - half[:, None], levels)
leafset.write([words], options.out)
leafset.report([words], phases, options.json)
