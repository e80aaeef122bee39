"""CGNS's own library and VTK read the .cgns files of `harness export`, and MFEM its .mfem files. Run with:
python -m unittest discover harness/oracles

Needs target/debug/{harness,reference}, which `cargo test --workspace` builds; for one test `cgnscheck` (Debian's cgns-convert), and for
another MFEM: pip install mfem numba scipy."""

import importlib.util
import itertools
import re
import shutil
import subprocess
import unittest

import h5py
import numpy as np
import pyvista

import export_cgns
from built import ROOT, InDirectory, decode, needs, run
from export_cgns import shortened
from export_mfem import CORNERS, DEPTH, FACES, forest, packed


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

    def test_names_of_more_than_32_bytes_are_cut_between_characters(self):
        names = list(itertools.islice(shortened(17 * "ä" + "x"), 2))
        self.assertEqual(names, [16 * "ä", 15 * "ä" + "_2"])

    def test_patches_may_have_the_names_of_other_nodes_and_of_all_languages(self):
        solids = ["Zone", "DataClass", 17 * "ä" + "x", 17 * "ä" + "y"]
        foam = self.at / "case/constant/polyMesh"
        code, _, why = run("harness", "export", self.at / "mesh", foam, "--side", "outside")
        self.assertEqual(code, 0, why)
        boundary = (foam / "boundary").read_text()
        for patch, solid in zip(["xMin", "xMax", "yMin", "yMax"], solids):
            boundary = boundary.replace(patch, solid)
        (foam / "boundary").write_text(boundary, "utf-8")
        with h5py.File(self.at / "named.cgns", "w", track_order=True, libver="earliest") as file:
            export_cgns.write(foam, file)
            conditions = file["Base/Zone/ZoneBC"]
            self.assertEqual(list(conditions)[:4], ["Zone_2", "DataClass_2", 16 * "ä", 15 * "ä" + "_2"])
            for name in conditions:
                self.assertEqual(bytes(conditions[name].attrs["name"]).rstrip(b"\0"), name.encode())
                self.assertLessEqual(len(name.encode()), 32)
                self.assertIn(name, file["Base"])

    @unittest.skipUnless(shutil.which("cgnscheck"), "cgnscheck is not installed: it is in Debian's package cgns-convert")
    def test_cgns_finds_no_error(self):
        done = subprocess.run(["cgnscheck", "-v", self.at / "mesh.cgns"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("checking complete", done.stdout)
        self.assertNotIn("ERROR", done.stdout + done.stderr)


@needs("harness", "reference")
class MfemTest(InDirectory):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for program, *arguments in [
            ("reference", ROOT / "geometries/cube-small.toml", "--out", cls.at / "mesh"),
            ("harness", "export", cls.at / "mesh", cls.at / "mesh.p8est"),
            ("harness", "export", cls.at / "mesh", cls.at / "mesh.mfem"),
        ]:
            code, _, why = run(program, *arguments)
            assert code == 0, why
        cls.corners, levels, cls.data, low, high = forest(cls.at / "mesh.p8est")
        cls.sizes, cls.edge = 1 << DEPTH - levels, (high - low)[0]

    def elements(self):
        lines = iter((self.at / "mesh.mfem").read_text().splitlines())
        next(line for line in lines if line == "elements")
        return [[int(word) for word in next(lines).split()] for _ in range(int(next(lines)))]

    def hanging(self):
        """All vertices, and those in the middle of an edge or a face of a leaf: levels of neighbours differ by one at most."""
        vertices = np.unique(packed(self.corners[:, None] + CORNERS * self.sizes[:, None, None]))
        halves = np.stack(np.meshgrid(*3 * [range(3)], indexing="ij"), axis=-1).reshape(-1, 3)
        inner = halves[(halves == 1).any(axis=1)]
        points = packed(self.corners[:, None] + inner * (self.sizes // 2)[:, None, None])
        return vertices, np.intersect1d(vertices, points)

    def test_every_octant_is_a_leaf_or_has_eight_children_that_no_other_has(self):
        elements = self.elements()
        children = [child for row in elements if row[3] == 7 for child in row[4:]]
        self.assertEqual(sorted(children), list(range(1, len(elements))))
        leaves = [row for row in elements if row[3] == 0]
        self.assertEqual(len(leaves), len(self.corners))
        count = lambda values: np.bincount(values, minlength=6).tolist()
        self.assertEqual(count([row[1] for row in leaves]), count(self.data + 1))

    @unittest.skipUnless(importlib.util.find_spec("mfem"), "MFEM is not installed: pip install mfem numba scipy")
    def test_mfem_finds_the_cells_their_volume_the_boundary_and_the_hanging_nodes(self):
        import mfem.ser as mfem

        mesh = mfem.Mesh(str(self.at / "mesh.mfem"), 1, 1, False)
        self.assertEqual(mesh.GetNE(), len(self.corners))
        volumes = {}
        for element in range(mesh.GetNE()):
            attribute = mesh.GetAttribute(element)
            volumes[attribute] = volumes.get(attribute, 0) + mesh.GetElementVolume(element)
        cubes = (self.sizes / (1 << DEPTH) * self.edge) ** 3
        for attribute, volume in volumes.items():
            self.assertAlmostEqual(volume, cubes[self.data + 1 == attribute].sum(), 9)
        self.assertAlmostEqual(sum(volumes.values()), self.edge**3, 9)

        # Each boundary attribute lies on its side of the root.
        vertices, faces = np.array(mesh.GetVertexArray()), {}
        for face in range(mesh.GetNBE()):
            faces.setdefault(mesh.GetBdrAttribute(face), []).extend(mesh.GetBdrElementVertices(face))
        self.assertEqual(sorted(faces), list(range(1, 7)))
        for attribute, nodes in faces.items():
            corners = CORNERS[list(FACES[attribute - 1])]
            axis = int(np.argmax((corners == corners[0]).all(axis=0)))
            self.assertEqual(len(set(vertices[nodes][:, axis])), 1)

        vertices, hanging = self.hanging()
        collection = mfem.H1_FECollection(1, 3)
        space = mfem.FiniteElementSpace(mesh, collection)
        self.assertEqual((space.GetNDofs(), space.GetTrueVSize()), (len(vertices), len(vertices) - len(hanging)))


if __name__ == "__main__":
    unittest.main()
