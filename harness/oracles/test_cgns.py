"""CGNS's own library and VTK read the .cgns files of `harness export`. Run with: python -m unittest discover harness/oracles

Needs target/debug/{harness,reference}, which `cargo test --workspace` builds, and `cgnscheck` for one test (Debian's cgns-convert)."""

import itertools
import re
import shutil
import subprocess
import unittest

import numpy as np
import pyvista

from built import InDirectory, needs
from export_cgns import shortened
from test_import import ROOT, run
from test_vtu import decode


@needs("harness", "reference")
class CgnsTest(InDirectory):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for program, *arguments in [
            ("reference", ROOT / "geometries/cube-small.toml", "--out", cls.at / "mesh"),
            ("harness", "export", cls.at / "mesh", cls.at / "mesh.cgns", "--side", "outside"),
        ]:
            code, cls.printed, why = run(program, *arguments)
            assert code == 0, why
        words = np.concatenate([np.load(part) for part in sorted((cls.at / "mesh").glob("leaves-*.npy"))])
        cls.words = words[words & np.uint64(3) == 0]

    def test_vtk_finds_the_cells_and_the_boundaries(self):
        reader = pyvista.CGNSReader(self.at / "mesh.cgns")
        reader.load_boundary_patch = True
        internal, patches = reader.read()[0][0]
        corners, levels, _ = decode(self.words)
        self.assertTrue((internal.cell_data["level"] == levels).all())
        self.assertTrue((internal.cell_data["side"] == 0).all())
        volumes = internal.compute_cell_sizes()["Volume"]
        np.testing.assert_allclose(volumes * 8.0 ** levels, volumes[0] * 8.0 ** levels[0])
        # As the command prints them: "faces of each patch: xMin 16, ..., cut 24".
        printed = re.search("faces of each patch: (.*)", self.printed)[1].split(", ")
        expected = {name: int(count) for name, count in map(str.split, printed) if count != "0"}
        self.assertIn("xMin", expected)
        self.assertEqual({name: patches[name].n_cells for name in patches.keys()}, expected)

    def test_names_that_share_32_characters_stay_apart(self):
        name = 30 * "a" + "bcd"
        names = list(itertools.islice(shortened(name), 11))
        self.assertEqual(names[:2] + names[-1:], [name[:32], 30 * "a" + "_2", 29 * "a" + "_11"])

    @unittest.skipUnless(shutil.which("cgnscheck"), "cgnscheck is not installed: it is in Debian's package cgns-convert")
    def test_cgns_finds_no_error(self):
        done = subprocess.run(["cgnscheck", "-v", self.at / "mesh.cgns"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("checking complete", done.stdout)
        self.assertNotIn("ERROR", done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
