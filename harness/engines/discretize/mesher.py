"""An oct-tree mesher on discretize.TreeMesh: every cell that a facet crosses has the surface level, 2:1 balance over
corners, no layers. ../README.md describes it as an engine."""

import sys
import tomllib
from pathlib import Path

import numpy as np
from discretize import TreeMesh


def read_stl(path):
    """The vertices of a binary STL file, of shape (facets, 3, 3)."""
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(path.read_bytes()[84:], facet)["corners"].astype(float)


path, out = Path(sys.argv[1]), sys.argv[2]
case = tomllib.loads(path.read_text())
root = case["root"]
level = next(level for level in range(20) if root["edge"] / 2**level <= case["spacing_min"])
cells = np.full(2**level, root["edge"] / 2**level)
mesh = TreeMesh([cells] * 3, origin=root["origin"], diagonal_balance=True)
mesh.refine_triangle(read_stl(path.parent / case["geometry"]), level)
mesh.save(out)
