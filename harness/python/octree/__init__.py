"""Oct-tree meshes around an STL geometry, as NumPy arrays.

    import octree

    mesh = octree.mesh("body.stl", spacing=0.01)
    print(len(mesh.levels), "cells of", mesh.edges.min(), "to", mesh.edges.max())
    mesh.picture("body.svg")

The programs `mesher`, `harness` and `reference` are installed with this module, and do the work.
"""

from __future__ import annotations

import json
import operator
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import weakref
from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyvista

__all__ = ["OUTSIDE", "INSIDE", "CROSSING", "Failed", "Mesh", "mesh", "run"]

OUTSIDE, INSIDE, CROSSING = 0, 1, 2
"""Sides of a cell, as in `Mesh.sides`."""

LEVEL_MAX = 19


class Failed(RuntimeError):
    """A program failed. The message is the program's, `code` its exit code."""

    def __init__(self, code: int, message: str):
        super().__init__(message)
        self.code = code


def run(program: str, *arguments: str | PathLike[str]) -> str:
    """Runs one of the installed programs; returns what it printed, and prints its warnings.

    Raises `Failed` if its exit code is not 0."""
    beside = Path(sysconfig.get_path("scripts")) / program
    path = beside if beside.is_file() else shutil.which(program)
    if path is None:
        raise Failed(3, f"{program} is neither {beside} nor on the PATH: install the wheel into an environment")
    ended = subprocess.run([path, *map(fspath, arguments)], capture_output=True, text=True)
    if ended.returncode != 0:
        raise Failed(ended.returncode, (ended.stderr.strip() or ended.stdout.strip()))
    if ended.stderr:
        print(ended.stderr, end="", file=sys.stderr)
    return ended.stdout


class Mesh:
    """The cells of a mesh in Morton order. Arrays have a row per cell."""

    directory: Path
    """The leaf-set directory, which every command of `harness` takes."""
    words: NDArray[np.uint64]
    """`morton57 << 7 | level << 2 | side`, ascending."""
    manifest: dict[str, Any]
    """What `mesh.json` states: root, requirements, counts."""

    def __init__(self, directory: str | PathLike[str]):
        self.directory = Path(directory)
        self.manifest = json.loads((self.directory / "mesh.json").read_text())
        parts = [self.directory / part["file"] for part in self.manifest["parts"]]
        if not parts:
            raise FileNotFoundError(f"{self.directory} has no leaves-*.npy: mesh with --write words, which is the default")
        self.words = np.sort(np.concatenate([np.load(part) for part in parts]))

    @property
    def levels(self) -> NDArray[np.uint8]:
        """Levels; the root has level 0, and each level halves the edge."""
        return (self.words >> np.uint64(2) & np.uint64(31)).astype(np.uint8)

    @property
    def sides(self) -> NDArray[np.uint8]:
        """`OUTSIDE`, `INSIDE` or `CROSSING`: whether facets cross the cell and, if not, where it is."""
        return (self.words & np.uint64(3)).astype(np.uint8)

    @property
    def edges(self) -> NDArray[np.float64]:
        """Edges of the cells, in units of the geometry."""
        return np.ldexp(self.manifest["root"]["edge"], -self.levels.astype(np.int32))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Minimum corners, in units of the geometry; shape (cells, 3)."""
        origin, edge = np.array(self.manifest["root"]["origin"]), self.manifest["root"]["edge"]
        return origin + self._lattice() * np.ldexp(edge, -LEVEL_MAX)

    @property
    def centres(self) -> NDArray[np.float64]:
        """Centres of the cells, in units of the geometry; shape (cells, 3)."""
        return self.corners + self.edges[:, None] / 2

    def to_pyvista(self) -> pyvista.UnstructuredGrid:
        """The cells as voxels without duplicate points, with the arrays `level` and `side`."""
        import pyvista

        steps = np.array([[d & 1, d >> 1 & 1, d >> 2 & 1] for d in range(8)])
        size = 1 << (LEVEL_MAX - self.levels.astype(np.int64))
        corners = self._lattice()[:, None, :] + steps * size[:, None, None]
        keys = corners @ (np.int64(1) << np.array([0, 20, 40]))
        unique, points = np.unique(keys, return_inverse=True)
        places = np.column_stack([unique >> shift & (1 << 20) - 1 for shift in (0, 20, 40)])
        root = self.manifest["root"]
        cells = np.column_stack([np.full(len(keys), 8), points.reshape(-1, 8)])
        grid = pyvista.UnstructuredGrid(
            cells.ravel(),
            np.full(len(keys), pyvista.CellType.VOXEL),
            np.array(root["origin"]) + places * np.ldexp(root["edge"], -LEVEL_MAX),
        )
        grid.cell_data["level"], grid.cell_data["side"] = self.levels, self.sides
        return grid

    def picture(self, file: str | PathLike[str]) -> None:
        """Draws a slice through the middle as SVG, PNG or PDF, by the file's name (`harness picture`)."""
        run("harness", "picture", self.directory, "--out", file)

    def audit(self, case: str | PathLike[str] | None = None) -> str:
        """Checks the mesh by itself, or against a case; returns the report (`harness audit`).

        Raises `Failed` with exit code 1 if a check fails."""
        return run("harness", "audit", self.directory, *(["--case", case] if case else []))

    def _lattice(self) -> NDArray[np.int64]:
        """Minimum corners in cells of the finest level."""
        codes = (self.words >> np.uint64(7)).astype(np.int64)
        corners = np.zeros((len(codes), 3), np.int64)
        for bit in range(LEVEL_MAX):
            for axis in range(3):
                corners[:, axis] |= (codes >> (3 * bit + axis) & 1) << bit
        return corners


def mesh(
    body: str | PathLike[str],
    *,
    spacing: float | None = None,
    layer_cells: int | None = None,
    out: str | PathLike[str] | None = None,
    options: Sequence[str] = (),
) -> Mesh:
    """Meshes an STL file, or a case file with settings of its own.

    `spacing` is the greatest edge of the cells at the surface, `layer_cells` the least thickness of the layers of each level, in cells.
    `options` are further ones of `mesher`, as in `["--keep", "inside", "--seed", "0.1,0,0"]`. The mesh stays in the new directory `out`;
    without one it exists as long as the result. Raises `Failed` if there is no mesh."""
    if isinstance(options, str):
        raise TypeError("options are a list of words, as in ['--keep', 'inside']")
    given: list[str] = []
    if spacing is not None:
        given += ["--spacing-min", repr(float(spacing))]
    if layer_cells is not None:
        given += ["--layer-cells-min", str(operator.index(layer_cells))]
    place = None if out else tempfile.mkdtemp(prefix="octree-")
    directory = Path(out) if out else Path(place) / "mesh"
    try:
        run("mesher", body, *given, *options, "--out", directory)
        made = Mesh(directory)
    except BaseException:
        if place:
            shutil.rmtree(place)
        raise
    if place:
        weakref.finalize(made, shutil.rmtree, place)
    return made
