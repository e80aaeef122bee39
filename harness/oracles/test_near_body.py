"""pyvista, NumPy and `harness geometry` read the surfaces of `harness export`. Run with: python -m unittest discover harness/oracles

The faces and areas are compared with those found by brute force from the leaf words and the geometry. Needs
target/debug/{harness,reference}, which `cargo test --workspace` builds."""

import base64
import json
import pathlib
import re
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree

import numpy as np
import pyvista

from built import EDGE_BITS, InDirectory, PROGRAMS, ROOT, decode, needs

EDGE, FINEST = 4.0, 5
CASE = f"""geometry = "body.stl"
spacing_min = {EDGE / 2 ** (FINEST - 1)}
layer_cells_min = 1
[root]
origin = [-2.0, -2.0, -2.0]
edge = {EDGE}
[[box]]
min = [0.0, -1.0, -1.0]
max = [1.0, 1.0, 0.3]
spacing = {EDGE / 2**FINEST}
"""
UNIT = EDGE / 2**FINEST
TRIANGLE = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])


def polygons(path):
    """The corners of each polygon in the file, read without VTK, which may not survive damaged numbers."""
    piece = xml.etree.ElementTree.parse(path).find(".//Piece")
    arrays = {}
    for array in piece.iter("DataArray"):
        kind = {"Float64": "<f8", "Int64": "<i8", "UInt64": "<u8", "UInt32": "<u4", "UInt8": "<u1"}[array.get("type")]
        text = base64.b64decode(array.text.strip(), validate=True)
        values = np.frombuffer(text, kind, offset=8)
        name = array.get("Name", "points")
        if int.from_bytes(text[:8], "little") != values.nbytes:
            raise ValueError(f"{name}: has not the size that it states")
        arrays[name] = values
    corners, ends = arrays["connectivity"], arrays["offsets"].astype(int)
    sizes = np.diff(ends, prepend=0)
    if not (len(ends) == int(piece.get("NumberOfPolys")) and (sizes >= 4).all() and ends[-1] == len(corners)):
        raise ValueError("the polygons have not as many corners as the file states")
    return np.split(arrays["points"].reshape(-1, 3)[corners], ends[:-1])


def outline(points):
    """Area, centre of the bounding box, and unit normal of a plane polygon."""
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2
    area = np.linalg.norm(normal)
    return area, (points.min(axis=0) + points.max(axis=0)) / 2, normal / area


@needs("harness", "reference")
class NearBodyTest(InDirectory):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        pyvista.Sphere(radius=0.7, theta_resolution=20, phi_resolution=14).save(cls.at / "body.stl")
        (cls.at / "case.toml").write_text(CASE)
        for program, *arguments in [
            ("reference", "case.toml", "--out", "mesh"),
            ("harness", "export", "mesh", "a.stl"),
            ("harness", "export", "mesh", "a.vtp"),
        ]:
            done = subprocess.run([PROGRAMS / program, *arguments], cwd=cls.at, check=True, capture_output=True, text=True)
        cls.faces, cls.area = re.match(r"a.vtp: (\d+) faces, .*\n  a surface of area ([\d.]+), closed\n", done.stdout).groups()
        words = np.concatenate([np.load(path) for path in sorted((cls.at / "mesh").glob("leaves-*.npy"))])
        corners, cls.levels, cls.sides = decode(words)
        # The leaf in each cell of the finest level, -1 where leaves were deleted.
        cls.leaf = np.full((2**FINEST,) * 3, -1)
        for index, (corner, level) in enumerate(zip(corners >> (EDGE_BITS - FINEST), cls.levels)):
            cls.leaf[tuple(slice(c, c + 2 ** (FINEST - level)) for c in corner)] = index
        cls.on_a_side = (cls.leaf >= 0) & (cls.sides[cls.leaf] != 2)

    def exposed(self):
        """The exposed faces of cells of the finest level: for each axis and side of the leaf, whether the lower face of a cell is one."""
        faces = np.zeros((3, 2) + self.leaf.shape, bool)
        for axis in range(3):
            low, high = np.delete(self.on_a_side, -1, axis), np.delete(self.on_a_side, 0, axis)
            inner = [slice(None)] * 3
            inner[axis] = slice(1, None)
            faces[axis, 0][tuple(inner)] = low & ~high
            faces[axis, 1][tuple(inner)] = high & ~low
        return faces

    def covered(self, centre, area, normal):
        """The places of a square in the array of `exposed`, and the cell of its leaf in the middle."""
        axis = int(np.argmax(np.abs(normal)))
        self.assertEqual(np.abs(normal).max(), 1)
        half = np.full(3, np.sqrt(area) / 2)
        half[axis] = 0
        low, high = (np.rint((centre + sign * half + EDGE / 2) / UNIT).astype(int) for sign in (-1, 1))
        np.testing.assert_allclose(low * UNIT - EDGE / 2, centre - half, atol=1e-6)
        high[axis] += 1
        cell = (low + high) // 2
        is_above = int(normal[axis] > 0)
        cell[axis] = low[axis] - 1 + is_above
        return (axis, is_above, *map(slice, low, high)), tuple(cell)

    def check_vtp(self, path):
        corners = polygons(path)
        surface = pyvista.read(path)
        self.assertEqual((len(corners), surface.n_cells), (int(self.faces),) * 2)
        count = np.zeros(self.exposed().shape, int)
        areas = []
        for index, face in enumerate(surface.irregular_faces):
            points = surface.points[face]
            np.testing.assert_array_equal(points, corners[index])
            area, centre, normal = outline(points)
            places, cell = self.covered(centre, area, normal)
            count[places] += 1
            leaf = self.leaf[cell]
            for name, expected in [
                ("level", self.levels[leaf]),
                ("side", self.sides[leaf]),
                ("spacing", EDGE / 2 ** self.levels[leaf]),
            ]:
                self.assertEqual(surface.cell_data[name][index], expected, name)
            areas.append(area)
        np.testing.assert_array_equal(count, self.exposed())
        # The area is printed with three digits.
        np.testing.assert_allclose(sum(areas), float(self.area), rtol=5e-3)

    def check_stl(self, path):
        surface = pyvista.read(path)
        self.assertEqual((surface.n_open_edges, surface.is_manifold), (0, True))
        enclosed = (~self.on_a_side).sum() * UNIT**3
        np.testing.assert_allclose([surface.area, surface.volume], [self.exposed().sum() * UNIT**2, enclosed], rtol=1e-6)
        data = path.read_bytes()
        triangles = np.frombuffer(data, TRIANGLE, offset=84)
        self.assertEqual(len(triangles), int.from_bytes(data[80:84], "little"))
        self.assertEqual(surface.n_cells, len(triangles))
        self.assertFalse(triangles["attribute"].any())
        exposed = self.exposed()
        for normal, points in zip(triangles["normal"], triangles["points"].astype(float)):
            np.testing.assert_array_equal(normal, outline(points)[2])
            # The cell of the finest level in which the centroid is; those of fans are not at the edges of a face.
            middle = (points.mean(axis=0) + EDGE / 2) / UNIT
            middle[np.argmax(np.abs(normal))] += 0.5
            place = int(np.argmax(np.abs(normal))), int(normal.sum() > 0), *np.floor(middle).astype(int)
            self.assertTrue(exposed[place], place)
        with tempfile.TemporaryDirectory() as directory:
            out = pathlib.Path(directory) / "geometry.json"
            command = [PROGRAMS / "harness", "geometry", path, "--json", out]
            subprocess.run(command, check=True, capture_output=True)
            diagnosis = json.loads(out.read_text())
        self.assertEqual((diagnosis["facets"], diagnosis["shells"]["closed"]), (len(triangles), 1))

    def test_the_polygons_are_the_exposed_faces(self):
        self.check_vtp(self.at / "a.vtp")
        levels = pyvista.read(self.at / "a.vtp").cell_data["level"]
        self.assertGreater(len(np.unique(levels)), 1, "faces of one level only")

    def test_the_triangles_are_the_exposed_faces(self):
        self.check_stl(self.at / "a.stl")

    def damaged(self, name, check, changes):
        """Requires `check` to fail after each change of a file."""
        content = (self.at / name).read_bytes()
        path = self.at / f"damaged-{name}"
        for what, changed in changes(content):
            with self.subTest(what):
                self.assertNotEqual(changed, content)
                path.write_bytes(changed)
                with self.assertRaises(Exception):
                    check(path)

    def test_every_damage_to_the_polygons_is_noticed(self):
        def changes(content):
            for array in re.finditer(rb'type="[A-Z]\w+?(\d+)"[^>]*>([A-Za-z0-9+/=]{16,})', content):
                data = base64.b64decode(array[2])
                size = int(array[1]) // 8
                # The most significant byte of the size in bytes, of a value in the middle, and of the last one.
                for position in (7, 8 + (len(data) - 8) // size // 2 * size + size - 1, len(data) - 1):
                    changed = data[:position] + bytes([data[position] ^ 1]) + data[position + 1 :]
                    text = base64.b64encode(changed)
                    yield f"{array[0][:40]}, {position}", content[: array.start(2)] + text + content[array.end(2) :]
            for part in (0.1, 0.5, 0.99):
                yield part, content[: int(part * len(content))]
            faces = self.faces.encode()
            yield "number of polygons", content.replace(b'"' + faces + b'"', b'"%d"' % (int(faces) - 1))

        self.damaged("a.vtp", self.check_vtp, changes)

    def test_every_damage_to_the_triangles_is_noticed(self):
        def changes(content):
            for position in (80, 84 + 8, 84 + 12, 84 + 50 * 7 + 17, len(content) - 3, len(content) - 1):
                yield position, content[:position] + bytes([content[position] ^ 64]) + content[position + 1 :]
            triangles = np.frombuffer(content, TRIANGLE, offset=84).copy()
            triangles["points"][5] = triangles["points"][5][::-1]
            yield "winding", content[:84] + triangles.tobytes()
            fewer = len(triangles) - 1
            yield "one triangle less", content[:80] + fewer.to_bytes(4, "little") + content[84:-50]
            yield "truncated", content[:-25]

        self.damaged("a.stl", self.check_stl, changes)


if __name__ == "__main__":
    unittest.main()
