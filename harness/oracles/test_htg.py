"""VTK reads the hyper-tree grids of `mesher --write htg` and `harness export`. Run with: python -m unittest discover harness/oracles

Needs target/debug/{harness,mesher}, which `cargo test --workspace` builds."""

import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy

import import_vtk
from built import PROGRAMS, ROOT, needs
from test_vtu import EDGE_BITS, decode


@needs("harness", "mesher")
class TreeTest(unittest.TestCase):
    def run_program(self, program, *arguments):
        environment = {**os.environ, "HARNESS_PYTHON": "/nowhere/python"}
        subprocess.run([PROGRAMS / program, *arguments], check=True, capture_output=True, env=environment)

    def meshed(self, keep, *options):
        """A mesh of words and tree in a temporary directory."""
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        at = pathlib.Path(directory.name)
        (at / "case.toml").write_text(f'keep = "{keep}"\n' + (ROOT / "geometries/cube-small.toml").read_text())
        self.run_program("mesher", at / "case.toml", "--out", at / "mesh", "--write", "words,htg", *options)
        return at

    def check(self, at, file):
        """Compares the cells of a file with the words of the mesh; returns VTK's grid."""
        words = np.sort(np.concatenate([np.load(path) for path in sorted((at / "mesh").glob("leaves-*.npy"))]))
        root = json.loads((at / "mesh/mesh.json").read_text())["root"]
        corners, levels, sides = decode(words)
        grid = import_vtk.read(str(file))
        found, edges, nodes, stated = import_vtk.of_hyper_trees(grid)
        order = np.lexsort(np.rint((found - root["origin"]) / root["edge"] * 2**EDGE_BITS).T)
        expected = np.lexsort(corners.T)
        scale = root["edge"] / 2**EDGE_BITS
        np.testing.assert_allclose(found[order], np.array(root["origin"]) + scale * corners[expected])
        np.testing.assert_allclose(edges[order], root["edge"] * 0.5 ** levels[expected])
        side = vtk_to_numpy(grid.GetCellData().GetArray("side"))[nodes]
        self.assertTrue((side[order] == sides[expected]).all())
        self.assertEqual(stated["origin"], root["origin"])
        self.assertAlmostEqual(stated["edge"], root["edge"])
        return grid

    def test_the_mesher_writes_the_leaves_of_its_words(self):
        for keep in ["outside", "inside", "all"]:
            at = self.meshed(keep)
            grid = self.check(at, at / "mesh/mesh.vtkhdf")
            self.assertEqual(grid.HasMask(), keep != "all")

    def test_the_harness_writes_the_leaves_of_any_mesh(self):
        at = self.meshed("outside", "--comm", "sim:2")
        self.run_program("harness", "export", at / "mesh", at / "again.vtkhdf")
        self.check(at, at / "again.vtkhdf")


if __name__ == "__main__":
    unittest.main()
