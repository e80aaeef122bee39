"""pyvista reads the .vtu and .pvtu files of `harness export`. Run with: python -m unittest discover harness/oracles

Needs target/debug/{harness,reference}, which `cargo test --workspace` builds."""

import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np
import pyvista

ROOT = pathlib.Path(__file__).parent.parent.parent
PROGRAMS = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug"
EDGE_BITS = 19


def decode(words):
    """Corners (in lattice units), levels and sides of leaf words (morton57 << 7 | level << 2 | side)."""
    morton = words >> np.uint64(7)
    corners = np.zeros((len(words), 3), np.int64)
    for bit in range(EDGE_BITS):
        for axis in range(3):
            corners[:, axis] |= ((morton >> np.uint64(3 * bit + axis)) & np.uint64(1)).astype(np.int64) << bit
    return corners, (words >> np.uint64(2) & np.uint64(31)).astype(int), (words & np.uint64(3)).astype(int)


@unittest.skipUnless(
    all((PROGRAMS / name).is_file() for name in ("harness", "reference")),
    f"harness or reference is not built in {PROGRAMS}: run cargo build -p harness -p reference",
)
class VtuTest(unittest.TestCase):
    def exported(self, keep, name):
        """The words of a small mesh, its root, and its grid as pyvista reads it."""
        with tempfile.TemporaryDirectory() as directory:
            at = pathlib.Path(directory)
            case = (ROOT / "geometries/cube-small.toml").read_text()
            (at / "case.toml").write_text(f'keep = "{keep}"\n' + case)
            for program, *arguments in [
                ("reference", at / "case.toml", "--out", at / "mesh"),
                ("harness", "export", at / "mesh", at / name),
            ]:
                subprocess.run([PROGRAMS / program, *arguments], check=True, capture_output=True)
            words = np.concatenate([np.load(path) for path in sorted((at / "mesh").glob("leaves-*.npy"))])
            return words, json.loads((at / "mesh/mesh.json").read_text())["root"], pyvista.read(at / name)

    def check(self, keep, name):
        words, root, grid = self.exported(keep, name)
        corners, levels, sides = decode(words)
        scale = root["edge"] / 2**EDGE_BITS
        edges = 1 << (EDGE_BITS - levels)
        self.assertTrue((grid.celltypes == pyvista.CellType.HEXAHEDRON).all())
        for array, expected in [
            ("level", levels),
            ("side", sides),
            ("rank", 0),
            ("id", np.arange(len(words))),
            ("spacing", scale * edges),
        ]:
            self.assertTrue((grid.cell_data[array] == expected).all(), array)
        steps = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
        points = corners[:, None] + edges[:, None, None] * steps
        self.assertEqual(grid.n_points, len(np.unique(points.reshape(-1, 3), axis=0)))
        # Each cell is where its leaf is, and VTK's volume is positive only if its corners are in VTK's order.
        expected = np.array(root["origin"]) + scale * (corners + edges[:, None] / 2)
        np.testing.assert_allclose(grid.cell_centers().points, expected)
        volumes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
        np.testing.assert_allclose(volumes, (scale * edges) ** 3)
        return volumes.sum(), root["edge"] ** 3, sides

    def test_all_leaves_fill_the_root(self):
        for name in ["mesh.vtu", "mesh.pvtu"]:
            volume, whole, _ = self.check("all", name)
            self.assertAlmostEqual(volume, whole)

    def test_the_kept_side_lacks_the_body(self):
        volume, whole, sides = self.check("outside", "mesh.vtu")
        self.assertFalse((sides == 1).any())
        self.assertLess(volume, whole)


if __name__ == "__main__":
    unittest.main()
