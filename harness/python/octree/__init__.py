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
import os
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

    In a job of MPI, every rank that calls this runs a program of its own. An interrupt also ends the program, which removes what is
    unfinished. Raises `Failed` if its exit code is not 0."""
    schemes = sysconfig.get_default_scheme(), sysconfig.get_preferred_scheme("user")
    beside, of_user = (Path(sysconfig.get_path("scripts", scheme)) / program for scheme in schemes)
    path = next((path for path in (beside, of_user) if path.is_file()), shutil.which(program))
    if path is None:
        raise Failed(3, f"{program} is neither {beside} nor {of_user} nor on the PATH: install the wheel into an environment")
    # With what a launcher of MPI jobs adds for its ranks, the program would take the place of this rank.
    of_rank = ["PMI_", "PMIX_", "MV2_COMM_", "MPI_LOCAL", "SLURM_PROCID", "SLURM_STEP_NUM_TASKS"]
    of_rank += ["OMPI_"] if "OMPI_COMM_WORLD_RANK" in os.environ else []
    environment = {name: value for name, value in os.environ.items() if not name.startswith(tuple(of_rank))}
    if path == of_user:  # No Python is beside it.
        environment.setdefault("HARNESS_PYTHON", sys.executable)
    command, pipe = [path, *map(fspath, arguments)], subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdout=pipe, stderr=pipe, text=True) as child:
        try:
            output, errors = child.communicate()
        except BaseException:
            child.terminate()
            child.communicate()
            raise
    code, said = child.returncode, errors.strip() or output.strip()
    if code != 0:
        end = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
        raise Failed(code, said if code > 0 and said else f"{program} {end}: {said or 'it printed nothing'}")
    if errors:
        print(errors, end="", file=sys.stderr)
    return output


class Mesh:
    """The cells of a mesh in Morton order. Arrays have a row per cell.

    Raises `ValueError` if the cells on disk do not have the digest that the manifest states."""

    directory: Path
    """The leaf-set directory, which every command of `harness` takes."""
    words: NDArray[np.uint64]
    """`morton57 << 7 | level << 2 | side`, ascending."""
    manifest: dict[str, Any]
    """What `mesh.json` states: root, requirements, counts."""

    def __init__(self, directory: str | PathLike[str]):
        self.directory = Path(directory).absolute()
        self.manifest = json.loads((self.directory / "mesh.json").read_text())
        parts = [self.directory / part["file"] for part in self.manifest["parts"]]
        if not parts:
            raise FileNotFoundError(f"{self.directory} has no leaves-*.npy: mesh with --write words, which is the default")
        self.words = np.sort(np.concatenate([np.load(part) for part in parts]))
        if _digest(self.words) != self.manifest["digest"]:
            raise ValueError(f"{self.directory}: its leaves do not have the digest that its manifest states: run harness audit on it")

    @property
    def levels(self) -> NDArray[np.uint8]:
        """Levels; the root has level 0, and each level halves the edge."""
        return (self.words >> np.uint64(2) & np.uint64(31)).astype(np.uint8)

    @property
    def has_sides(self) -> bool:
        """Whether the sides of the cells are known; those of an imported mesh may not be."""
        return self.manifest.get("sides") != "unknown"

    @property
    def sides(self) -> NDArray[np.uint8]:
        """`OUTSIDE`, `INSIDE` or `CROSSING`: whether facets cross the cell and, if not, where it is.

        Raises `ValueError` if `has_sides` is false."""
        if not self.has_sides:
            raise ValueError(f"{self.directory}: the sides of this mesh are unknown: import it with --sides")
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
        """The cells as voxels without duplicate points, with the arrays `level` and, if sides are known, `side`."""
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
        grid.cell_data["level"] = self.levels
        if self.has_sides:
            grid.cell_data["side"] = self.sides
        return grid

    def picture(self, file: str | PathLike[str]) -> None:
        """Draws a slice through the middle as SVG, PNG or PDF, by the file's name (`harness picture`)."""
        run("harness", "picture", self.directory, "--out", file)

    def audit(self, case: str | PathLike[str] | None = None) -> str:
        """Checks the mesh by itself, or against a case; returns the report (`harness audit`).

        Raises `Failed` with exit code 1 if a check fails."""
        return run("harness", "audit", self.directory, *([] if case is None else ["--case", case]))

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
    without one it exists as long as the result. Raises `Failed` if there is no mesh, and `FileNotFoundError` if there is one without
    leaf words (`--write htg`)."""
    if isinstance(options, str):
        raise TypeError("options are a list of words, as in ['--keep', 'inside']")
    given: list[str] = []
    if spacing is not None:
        given += ["--spacing-min", repr(float(spacing))]
    if layer_cells is not None:
        given += ["--layer-cells-min", str(operator.index(layer_cells))]
    place = tempfile.mkdtemp(prefix="octree-") if out is None else None
    directory = Path(out) if place is None else Path(place) / "mesh"
    manifest = directory / "mesh.json"
    is_other = manifest.is_file()  # Whatever makes a mesh refuses a directory that has one.
    try:
        printed = run("mesher", body, *given, *options, "--out", directory)
        if is_other or not manifest.is_file():
            raise Failed(0, f"{options} make no mesh:\n{printed}")
        made = Mesh(directory)
    except BaseException:
        if place:
            shutil.rmtree(place)
        raise
    if place:
        weakref.finalize(made, _remove, place, os.getpid())
    return made


def _remove(place: str, owner: int) -> None:
    """Removes a directory, unless this process is a fork of its owner."""
    if os.getpid() == owner:
        shutil.rmtree(place, ignore_errors=True)


def _digest(words: NDArray[np.uint64]) -> str:
    """The digest of leaf words, in the definition's terms: the sum of a * 2^64 + b. A part of the words fits in the cache."""

    def f(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
        x = (x ^ x >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ x >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
        return x ^ x >> np.uint64(31)

    total, half = 0, np.uint64(32)
    for w in np.array_split(words, 1 + len(words) // 2**15):
        a = f(w + np.uint64(0x9E3779B97F4A7C15))
        b = f(a ^ (w << half | w >> half))
        total += (int(a.sum()) << 64) + (int((b >> half).sum()) << 32) + int((b & np.uint64(2**32 - 1)).sum())
    return f"{total % 2**128:032x}"
