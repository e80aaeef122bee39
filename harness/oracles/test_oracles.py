"""Bodies whose sides every oracle must find. Run with: python -m unittest discover harness/oracles"""

import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import protocol

HERE = pathlib.Path(__file__).parent
ORACLES = ["trimesh", "open3d", "pyvista"]


def torus(rings=48, sides=24, large=1.0, small=0.3):
    """A closed torus about the z axis: facets of shape (2 * rings * sides, 3, 3)."""
    u, v = np.meshgrid(np.arange(rings + 1) % rings, np.arange(sides + 1) % sides, indexing="ij")
    u, v = 2 * np.pi * u / rings, 2 * np.pi * v / sides
    reach = large + small * np.cos(v)
    grid = np.stack([reach * np.cos(u), reach * np.sin(u), small * np.sin(v)], axis=-1)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])


def write_stl(path, facets):
    """Write binary STL with normals of zero."""
    records = np.zeros(len(facets), protocol.STL_FACET)
    records["vertices"] = facets
    with open(path, "wb") as file:
        file.write(bytes(80) + np.uint32(len(facets)).tobytes() + records.tobytes())


def ask(oracle, points, facets):
    """Run the oracle as the harness does and return its answer."""
    with tempfile.TemporaryDirectory() as name:
        directory = pathlib.Path(name)
        np.asarray(points, "<f8").tofile(directory / "points")
        write_stl(directory / "body.stl", facets)
        question = json.dumps([str(directory / name) for name in ("points", "body.stl", "sides")])
        command = [sys.executable, "-B", HERE / "sides.py", oracle]
        ended = subprocess.run(command, input=f"[]\n{question}\n", check=True, capture_output=True, text=True)
        # A question that fails costs only itself.
        assert ended.stdout == "1\n0\n", ended
        return np.fromfile(directory / "sides", np.uint8)


class OracleTest(unittest.TestCase):
    def each(self):
        for oracle in ORACLES:
            with self.subTest(oracle):
                yield oracle

    def points_and_truth(self):
        """Random points away from the surface of the torus, and whether each is inside."""
        points = np.random.default_rng(7).uniform(-1.5, 1.5, (5000, 3))
        points[:, 2] /= 3
        tube = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1.0, points[:, 2])
        clear = np.abs(tube - 0.3) > 0.02
        return points[clear], tube[clear] < 0.3

    def test_sides_of_a_torus(self):
        points, truth = self.points_and_truth()
        for oracle in self.each():
            answer = ask(oracle, points, torus())
            self.assertEqual(answer.dtype, np.uint8)
            self.assertTrue((answer == truth).all())

    def test_sides_do_not_depend_on_orientation(self):
        points, truth = self.points_and_truth()
        facets = torus()
        flipped = np.random.default_rng(8).random(len(facets)) < 0.5
        facets[flipped] = facets[flipped][:, ::-1]
        for oracle in self.each():
            self.assertTrue((ask(oracle, points, facets) == truth).all())

    def test_sides_of_a_body_far_from_the_origin(self):
        points, truth = self.points_and_truth()
        offset = np.array([4096.0, -8192.0, 1024.0])
        facets = (torus() + offset).astype(np.float32)
        for oracle in self.each():
            self.assertTrue((ask(oracle, points + offset, facets) == truth).all())

    def test_facets_or_points_may_be_missing(self):
        for oracle in self.each():
            self.assertFalse(ask(oracle, np.ones((3, 3)), torus()[:0]).any())
            self.assertEqual(ask(oracle, np.ones((0, 3)), torus()).shape, (0,))

    def test_a_truncated_file_is_refused(self):
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory) / "short.stl"
            write_stl(path, torus())
            path.write_bytes(path.read_bytes()[:-10])
            with self.assertRaises(ValueError):
                protocol.read_facets(path)


if __name__ == "__main__":
    unittest.main()
