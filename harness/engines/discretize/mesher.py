"""An oct-tree mesher on discretize.TreeMesh: every cell that a facet crosses has the surface level, 2:1 balance over
corners, no layers. README.md describes it as an engine."""

import sys
import tomllib
from pathlib import Path

import numpy as np
from discretize import TreeMesh


def read_stl(path):
    """The vertices of a binary STL file, of shape (facets, 3, 3)."""
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(path.read_bytes()[84:], facet)["corners"].astype(float)


def leaf_words(mesh, root):
    """The sorted leaf words: morton57 << 7 | level << 2, without sides."""
    level = mesh.cell_levels_by_index(np.arange(mesh.n_cells)).astype(np.uint64)
    corner = (mesh.cell_centers - root["origin"]) * (2**19 / root["edge"]) - 2.0 ** (18 - level.astype(float))[:, None]
    corner, key = np.rint(corner).astype(np.uint64), np.zeros(mesh.n_cells, np.uint64)
    for bit in range(19):
        for axis in range(3):
            key |= (corner[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.sort(key << np.uint64(7) | level << np.uint64(2))


path, out = map(Path, sys.argv[1:])
case = tomllib.loads(path.read_text())
root = case["root"]
level = next(level for level in range(20) if root["edge"] / 2**level <= case["spacing_min"])
cells = np.full(2**level, root["edge"] / 2**level)
mesh = TreeMesh([cells] * 3, origin=root["origin"], diagonal_balance=True)
mesh.refine_triangle(read_stl(path.parent / case["geometry"]), level)
out.mkdir(parents=True, exist_ok=True)
np.save(out / "leaves-00000.npy", leaf_words(mesh, root))
