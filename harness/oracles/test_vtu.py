"""pyvista reads the .vtu files of `harness export`. Run with: python -m unittest discover harness/oracles

Needs target/debug/{harness,reference}, which `cargo test --workspace` builds."""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import pyvista

from built import PROGRAMS, ROOT, needs

EDGE_BITS = 19


def decode(words):
    """Corners (in lattice units), levels and sides of leaf words (morton57 << 7 | level << 2 | side)."""
    morton = words >> np.uint64(7)
    corners = np.zeros((len(words), 3), np.int64)
    for bit in range(EDGE_BITS):
        for axis in range(3):
            corners[:, axis] |= ((morton >> np.uint64(3 * bit + axis)) & np.uint64(1)).astype(np.int64) << bit
    return corners, (words >> np.uint64(2) & np.uint64(31)).astype(int), (words & np.uint64(3)).astype(int)


@needs("harness", "reference")
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
        volume, whole, _ = self.check("all", "mesh.vtu")
        self.assertAlmostEqual(volume, whole)

    def test_the_kept_side_lacks_the_body(self):
        volume, whole, sides = self.check("outside", "mesh.vtu")
        self.assertFalse((sides == 1).any())
        self.assertLess(volume, whole)


@needs("harness", "reference")
class DamagedVtuTest(unittest.TestCase):
    """Every damage to a file is noticed when it is read: the file is refused, or the digest differs."""

    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.place.cleanup)
        cls.at = pathlib.Path(cls.place.name)
        for program, *arguments in [
            ("reference", ROOT / "geometries/cube-small.toml", "--out", cls.at / "mesh"),
            ("harness", "export", cls.at / "mesh", cls.at / "all.vtu"),
        ]:
            subprocess.run([PROGRAMS / program, *arguments], check=True, capture_output=True)
        cls.digest = json.loads((cls.at / "mesh/mesh.json").read_text())["digest"]

    def imported(self, path):
        """Exit code of an import, and the digest that it found."""
        with tempfile.TemporaryDirectory() as directory:
            out = pathlib.Path(directory) / "mesh"
            command = [PROGRAMS / "harness", "import", path, "--format", "vtk", "--out", out]
            environment = os.environ | {"HARNESS_PYTHON": sys.executable}
            run = subprocess.run(command, capture_output=True, text=True, env=environment)
            if run.returncode == 0:
                return 0, json.loads((out / "mesh.json").read_text())["digest"]
            self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
            return run.returncode, None

    def check(self, changes):
        """Imports the file after each change of its content."""
        path = self.at / "all.vtu"
        content = path.read_bytes()
        self.assertEqual(self.imported(path), (0, self.digest))
        try:
            for what, changed in changes(content):
                with self.subTest(what):
                    self.assertNotEqual(changed, content)
                    path.write_bytes(changed)
                    code, digest = self.imported(path)
                    self.assertTrue(code == 2 or code == 0 and digest != self.digest, (code, digest))
        finally:
            path.write_bytes(content)

    @staticmethod
    def flipped(content, position, bits=1):
        return content[:position] + bytes([content[position] ^ bits]) + content[position + 1 :]

    def changes_of_xml(self, content):
        xml = content[: content.index(b"<AppendedData")]
        # The last character of every value, and of the root and the digest. VTK ignores the name of the array of points, and the harness
        # that of the ranks, which a file may lack.
        pattern = rb'(?:NumberOf\w+|Name|type|offset)="(?!Points|rank")(\w[^"]*)"'
        values = [match.end(1) - 1 for match in re.finditer(pattern, xml)]
        values += [match.end(1) - 1 for match in re.finditer(rb">([-0-9. e]+\d) ?0?</DataArray>", xml)]
        for position in values:
            yield f"{content[max(0, position - 40) : position + 1]}", self.flipped(content, position)

    def changes_of_data(self, content):
        start = content.index(b"\n   _") + 5
        offsets = [start + int(text) for text in re.findall(rb'offset="(\d+)"', content[:start])]
        ends = offsets[1:] + [content.rindex(b"\n  </AppendedData>")]
        for begin, end in zip(offsets, ends):
            # The number of blocks, the size of the last one, and compressed data.
            for position in (begin, begin + 16, (begin + 32 + end) // 2, end - 1):
                # A single bit may be one that zlib does not use.
                yield f"byte {position - begin} of the array at {begin - start}", self.flipped(content, position, 255)
        for part in (0.01, 0.1, 0.5, 0.9, 0.999):
            yield f"{part} of the file", content[: int(part * len(content))]

    def test_a_file_without_ranks_is_read(self):
        content = (self.at / "all.vtu").read_bytes()
        path = self.at / "without_ranks.vtu"
        path.write_bytes(content.replace(b'Name="rank"', b'Name="race"'))
        self.assertNotEqual(path.read_bytes(), content)
        self.assertEqual(self.imported(path), (0, self.digest))

    def test_the_xml_of_a_file(self):
        self.check(self.changes_of_xml)

    def test_the_data_of_a_file(self):
        self.check(self.changes_of_data)


if __name__ == "__main__":
    unittest.main()
