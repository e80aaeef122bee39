"""VTK and pyvista read the .vtu files of `harness export`, and the hyper-tree grids of `mesher --write htg` and `harness export`. Run with:
python -m unittest discover harness/oracles

Needs target/debug/{harness,mesher,reference}, which `cargo test --workspace` builds."""

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
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersParallel import vtkExtractUnstructuredGridPiece
from vtkmodules.vtkIOParallelXML import vtkXMLPUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

import import_vtk
from built import EDGE_BITS, PROGRAMS, ROOT, decode, needs


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

    def test_a_file_in_parts_that_vtk_wrote_has_the_root_and_the_digest(self):
        reader = vtkXMLUnstructuredGridReader(file_name=self.at / "all.vtu")
        part = vtkExtractUnstructuredGridPiece(input_connection=reader.output_port, create_ghost_cells=False)
        for mode in ("SetDataModeToAscii", "SetDataModeToBinary", "SetDataModeToAppended"):
            writer = vtkXMLPUnstructuredGridWriter(input_connection=part.output_port, file_name=self.at / "parts.pvtu")
            writer.SetNumberOfPieces(3)
            writer.SetEndPiece(2)
            getattr(writer, mode)()
            writer.Write()
            _, edges, stated = import_vtk.cells(str(self.at / "parts.pvtu"), {"sides": None})
            self.assertEqual((len(edges), stated["digest"]), (reader.GetOutput().GetNumberOfCells(), self.digest), mode)
            self.assertEqual(stated["root"], json.loads((self.at / "mesh/mesh.json").read_text())["root"])

    def test_the_xml_of_a_file(self):
        self.check(self.changes_of_xml)

    def test_the_data_of_a_file(self):
        self.check(self.changes_of_data)


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
