"""Engines that write a mesh in another program's format are verified, and an error that is planted in their meshes is found. Run with:
python -m unittest discover harness/oracles

Needs target/debug/{harness,reference}, which `cargo test --workspace` builds."""

import itertools
import json
import os
import pathlib
import re
import tempfile
import unittest

import numpy as np
import pyvista

from built import ROOT, run

ENGINES = ROOT / "harness/engines"
# The case of the tutorial, as it stands there.
CASE = re.search(r"\n```toml\n(spacing_min = .*?)```", (ENGINES / "README.md").read_text(), re.DOTALL)[1]
# A body with the symmetries of the root.
SPHERE = 'spacing_min = 0.08\nlayer_cells_min = 1\nkeep = "all"\nroot_scale = 2.5\n[generator]\nshape = "sphere"\nfacets = 500\n'
PROMISES = '[promises]\ncomplete = true\nsurface = { tolerance_cells = 0.001 }\nbalance = "corner"\ndeterministic = true\n'
TAKES = '[takes]\nboxes = false\nkeep = ["all"]\ndrop_crossing = false\n'
LEVEL_MAX = 19
STEPS = np.array(list(itertools.product((0, 1), repeat=3)))[:, ::-1]


def leaves(mesh):
    """Minimum corners and edges of the leaves in units of the finest cell, the level of that cell, and the root."""
    words = np.load(mesh / "leaves-00000.npy")
    level = (words >> np.uint64(2) & np.uint64(31)).astype(int)
    corner = np.zeros((len(words), 3), np.int64)
    for bit, axis in itertools.product(range(LEVEL_MAX), range(3)):
        corner[:, axis] |= (words >> np.uint64(7 + 3 * bit + axis) & np.uint64(1)).astype(np.int64) << bit
    deepest = int(level.max())
    return corner >> (LEVEL_MAX - deepest), 1 << (deepest - level), deepest, json.loads((mesh / "mesh.json").read_text())["root"]


def corners(corner, edge, root, deepest, order=range(8)):
    """The points of each cell, and their numbers."""
    lattice = (corner[:, None] + STEPS[list(order)] * edge[:, None, None]).reshape(-1, 3)
    lattice, numbers = np.unique(lattice, axis=0, return_inverse=True)
    return np.array(root["origin"]) + lattice * (root["edge"] / 2**deepest), numbers.reshape(-1, 8)


def vtk(path, corner, edge, deepest, root):
    points, numbers = corners(corner, edge, root, deepest)
    cells = np.column_stack([np.full(len(edge), 8), numbers]).ravel()
    pyvista.UnstructuredGrid(cells, np.full(len(edge), pyvista.CellType.VOXEL), points).save(path)


def table(path, corner, edge, deepest, root):
    finest = root["edge"] / 2**deepest
    rows = np.column_stack([np.array(root["origin"]) + (corner + edge[:, None] / 2) * finest, edge * finest])
    np.savetxt(path, rows, "%.17g", delimiter=",", header="x,y,z,edge", comments="")


def discretize(path, corner, edge, deepest, root):
    state = {"indexes": (2 * corner + edge[:, None]).tolist(), "levels": (deepest - np.log2(edge).astype(int)).tolist()}
    widths = [root["edge"] / 2**deepest] * 2**deepest
    path.write_text(json.dumps({"h": [widths] * 3, "origin": root["origin"], "cell_state": state}))


def openfoam(path, corner, edge, deepest, root):
    """Every cell has six faces of its own, as on the boundary."""
    points, numbers = corners(corner, edge, root, deepest)
    around = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = numbers[:, around].reshape(-1, 4)
    lists = {
        "points": [f"({x!r} {y!r} {z!r})" for x, y, z in points.tolist()],
        "faces": ["4({} {} {} {})".format(*face) for face in faces.tolist()],
        "owner": [str(face // 6) for face in range(len(faces))],
        "neighbour": [],
    }
    place = path / "constant/polyMesh"
    place.mkdir(parents=True)
    for name, items in lists.items():
        head = f"FoamFile {{ version 2.0; format ascii; class {'faceList' if name == 'faces' else name}; object {name}; }}\n"
        (place / name).write_text(head + f"{len(items)}\n(\n" + "\n".join(items) + "\n)\n")


def p4est(path, corner, edge, deepest, root):
    """`harness export` writes it from a table."""
    cells = path.with_suffix(".csv")
    table(cells, corner, edge, deepest, root)
    mesh = path.with_suffix(".mesh")
    at = ",".join(map(repr, [*root["origin"], root["edge"]]))
    for words in (["import", cells, "--position", "centre", f"--root={at}", "--out", mesh], ["export", mesh, path]):
        code, _, error = run("harness", *words)
        assert code == 0, error


# The writer of each format, what follows {out} in the engine file, and further keys.
FORMATS = {
    "vtk": (vtk, ".vtu", ""),
    "table": (table, ".csv", 'position = "centre"\n'),
    "discretize": (discretize, ".json", ""),
    "openfoam": (openfoam, "", ""),
    "p4est": (p4est, ".p8est", ""),
}


class EnginesTest(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.at = pathlib.Path(directory.name)

    def mesh(self, case):
        """The leaves of the reference's mesh."""
        (self.at / "case.toml").write_text(case)
        code, _, error = run("reference", self.at / "case.toml", "--out", self.at / "mesh")
        self.assertEqual(code, 0, error)
        return leaves(self.at / "mesh")

    def verify(self, kind, name, corner, *mesh):
        """Exit code and output of the verification of an engine that copies a mesh."""
        write, extension, more = FORMATS[kind]
        path = self.at / f"{name}{extension}"
        write(path, corner, *mesh)
        words = json.dumps(["sh", "-c", 'cp -r "$1" "$2"', "{case}", str(path), "{out}" + extension])
        (self.at / f"{name}.toml").write_text(f'[run]\nserial = {words}\nformat = "{kind}"\n{more}{TAKES}{PROMISES}')
        code, printed, error = run("harness", "verify", self.at / "case.toml", "--engine", self.at / f"{name}.toml")
        return code, printed + error

    def test_an_engine_of_every_format_is_verified_and_swapped_axes_are_found(self):
        corner, *mesh = self.mesh(CASE)
        for kind in FORMATS:
            with self.subTest(kind):
                code, printed = self.verify(kind, f"{kind}-right", corner, *mesh)
                self.assertEqual(code, 0, printed)
                self.assertIn("all hold", printed)
                code, printed = self.verify(kind, f"{kind}-swapped", corner[:, ::-1], *mesh)
                self.assertEqual(code, 1, printed)
                self.assertIn("serial: surface: ", printed)

    def test_a_sphere_in_the_middle_of_the_root_does_not_show_swapped_axes(self):
        corner, *mesh = self.mesh(SPHERE)
        code, printed = self.verify("table", "sphere", corner[:, ::-1], *mesh)
        self.assertEqual(code, 0, printed)

    def test_the_case_of_the_tutorial_has_none_of_the_symmetries_of_a_cube(self):
        corner, edge, deepest, _ = self.mesh(CASE)
        cells = {(*row, size) for row, size in zip(corner.tolist(), edge.tolist())}
        images = 0
        for axes, mirrored in itertools.product(itertools.permutations(range(3)), itertools.product((False, True), repeat=3)):
            image = np.where(mirrored, (1 << deepest) - corner - edge[:, None], corner)[:, axes]
            images += cells == {(*row, size) for row, size in zip(image.tolist(), edge.tolist())}
        self.assertEqual(images, 1)

    def test_what_an_engine_did_not_write_or_wrote_wrongly_is_named_with_its_file(self):
        corner, edge, *mesh = self.mesh(CASE)
        code, printed = self.verify("table", "overlap", np.vstack([corner, corner[:1]]), np.append(edge, edge[0]), *mesh)
        self.assertEqual(code, 1, printed)
        self.assertRegex(printed, r"wrote a mesh that cannot be imported: \S*written/mesh.csv: cell \d+ .* overlaps")
        engine = self.at / "overlap.toml"
        engine.write_text(re.sub("serial = .*", 'serial = ["true", "{case}", "{out}.csv"]', engine.read_text()))
        code, printed, _ = run("harness", "verify", self.at / "case.toml", "--engine", engine)
        self.assertEqual(code, 1, printed)
        self.assertRegex(printed, r"overlap wrote no \S*written/mesh.csv, which {out} stands for in \[run\] of \S*overlap.toml")

    def test_a_file_that_is_audited_and_compared_needs_no_import(self):
        corner, *mesh = self.mesh(CASE)
        vtk(self.at / "right.vtu", corner, *mesh)
        vtk(self.at / "swapped.vtu", corner[:, ::-1], *mesh)
        audit = ["audit", self.at / "swapped.vtu", "--promises"]
        self.assertEqual(run("harness", *audit, 'complete = true, balance = "corner"')[0], 0)
        surface = "surface = { tolerance_cells = 0.001 }"
        code, printed, _ = run("harness", *audit, surface, "--case", self.at / "case.toml")
        self.assertEqual(code, 1, printed)
        finding = next(part for part in printed.split("\n") if part.startswith("surface"))
        self.assertIn("findings", finding)
        self.assertLess(printed.count("\n    "), 6)
        case = ["--case", self.at / "case.toml"]
        self.assertEqual(run("harness", "diff", self.at / "mesh", self.at / "right.vtu", *case)[0], 0)
        code, printed, error = run("harness", "diff", self.at / "right.vtu", self.at / "swapped.vtu", *case)
        self.assertEqual(code, 1, error)
        self.assertIn("the leaves differ", printed)


if __name__ == "__main__":
    unittest.main()
