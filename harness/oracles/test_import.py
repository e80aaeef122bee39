"""VTK writes meshes in its formats, and `harness import` reads them. Run with: python -m unittest discover harness/oracles

Needs target/debug/{harness,reference}, which `cargo test --workspace` builds."""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np
import pyvista
import vtk
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from built import PROGRAMS, ROOT, needs, run, samples

ORIGIN, EDGE, DEPTH = np.array([-1.0, 2.0, 0.5]), 4.0, 4


def leaves():
    """Indices and levels of the leaves of a small oct-tree, level by level."""
    octants, rows = np.zeros((1, 3), np.int64), []
    for level in range(DEPTH + 1):
        split = (octants[:, 0] == 0) & (level < DEPTH)
        rows.append(np.column_stack([octants[~split], np.full((~split).sum(), level)]))
        digits = np.array([[d & 1, d >> 1 & 1, d >> 2 & 1] for d in range(8)])
        octants = (2 * octants[split, None] + digits).reshape(-1, 3)
    return np.concatenate(rows)


def words_of(rows, sides):
    """Sorted leaf words (morton57 << 7 | level << 2 | side)."""
    morton = np.zeros(len(rows), np.uint64)
    for bit in range(19):
        for axis in range(3):
            cell = rows[:, axis] << (19 - rows[:, 3])
            morton |= (cell >> bit & 1).astype(np.uint64) << np.uint64(3 * bit + axis)
    return np.sort(morton << np.uint64(7) | rows[:, 3].astype(np.uint64) << np.uint64(2) | sides.astype(np.uint64))


def hexahedra(rows, sides, dtype=np.float64, cell_type=pyvista.CellType.HEXAHEDRON):
    """The leaves as an unstructured grid without duplicate points."""
    order = [0, 1, 3, 2, 4, 5, 7, 6] if cell_type == pyvista.CellType.HEXAHEDRON else range(8)
    steps = np.array([[d & 1, d >> 1 & 1, d >> 2 & 1] for d in order])
    size = (1 << DEPTH) >> rows[:, 3]
    corners = ((rows[:, None, :3] + steps) * size[:, None, None]).reshape(-1, 3)
    lattice, vertices = np.unique(corners, axis=0, return_inverse=True)
    cells = np.column_stack([np.full(len(rows), 8), vertices.reshape(-1, 8)])
    points = (ORIGIN + lattice * (EDGE / (1 << DEPTH))).astype(dtype)
    grid = pyvista.UnstructuredGrid(cells.ravel(), np.full(len(rows), cell_type), points)
    grid.cell_data["body"] = sides.astype(np.int32)
    return grid


def widen_labels(place):
    """Makes the labels of 32 bits in a polyMesh those of 64 bits that an export of a large mesh has."""
    for path in place.iterdir():
        head, rest = path.read_bytes().split(b"}\n\n", 1)
        lists, is_of_labels = b"", b"labelList" in head or b"faceCompactList" in head
        while rest and is_of_labels:
            count, rest = rest.split(b"\n(", 1)
            size = 4 * int(count)
            lists += count + b"\n(" + np.frombuffer(rest[:size], "<i4").astype("<i8").tobytes() + b")\n"
            rest = rest[size + 2 :]
        path.write_bytes(head.replace(b"label=32", b"label=64") + b"}\n\n" + lists + rest)


def hyper_trees(rows, sides, trees, masked):
    """The leaves as a hyper-tree grid of `trees` trees along each axis, with the leaves of side 1 masked or not."""
    side_of = {tuple(row): side for row, side in zip(rows.tolist(), sides.tolist())}
    base = trees.bit_length() - 1
    grid = vtk.vtkHyperTreeGrid()
    grid.Initialize()
    grid.SetDimensions([trees + 1] * 3)
    grid.SetBranchFactor(2)
    for axis, put in enumerate((grid.SetXCoordinates, grid.SetYCoordinates, grid.SetZCoordinates)):
        values = vtk.vtkDoubleArray()
        for i in range(trees + 1):
            values.InsertNextValue(ORIGIN[axis] + i * EDGE / trees)
        put(values)
    array, mask = vtk.vtkDoubleArray(), vtk.vtkBitArray()
    array.SetName("body")
    cursor = vtk.vtkHyperTreeGridNonOrientedCursor()

    def visit(at, level):
        index, side = cursor.GetGlobalNodeIndex(), side_of.get((*at, level))
        array.InsertValue(index, -1 if side is None else side)
        mask.InsertValue(index, side == 1)
        if side is None:
            cursor.SubdivideLeaf()
            for digit in range(8):
                cursor.ToChild(digit)
                visit([2 * at[axis] + (digit >> axis & 1) for axis in range(3)], level + 1)
                cursor.ToParent()

    begin = 0
    for tree in range(trees**3):
        grid.InitializeNonOrientedCursor(cursor, tree, True)
        cursor.SetGlobalIndexStart(begin)
        visit([tree % trees, tree // trees % trees, tree // trees**2], base)
        begin += cursor.GetTree().GetNumberOfVertices()
    grid.GetCellData().AddArray(array)
    if masked:
        grid.SetMask(mask)
    return grid


def write(data, writer, path, **settings):
    """Writes a file with one of VTK's writers."""
    writer = getattr(vtk, writer)()
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    for name, values in settings.items():
        getattr(writer, name)(*values)
    writer.Write()


def unstructured_files(at, grid):
    """Files of an unstructured grid in every format and encoding."""
    grid.save(at / "ascii.vtk", binary=False)
    grid.save(at / "binary.vtk", binary=True)
    grid.save(at / "ascii.vtu", binary=False)
    settings = {
        "raw": {"SetCompressorTypeToNone": (), "EncodeAppendedDataOff": ()},
        "base64": {"SetCompressorTypeToNone": (), "SetDataModeToBinary": ()},
        "zlib": {"SetCompressorTypeToZLib": (), "SetHeaderTypeToUInt32": ()},
        "lz4": {"SetCompressorTypeToLZ4": (), "SetDataModeToBinary": ()},
        "lzma": {"SetCompressorTypeToLZMA": ()},
    }
    for name, setting in settings.items():
        write(grid, "vtkXMLUnstructuredGridWriter", at / f"{name}.vtu", **setting)
    write(grid, "vtkXMLPUnstructuredGridWriter", at / "parallel.pvtu", SetNumberOfPieces=(1,))
    write(grid, "vtkHDFWriter", at / "grid.vtkhdf")
    return sorted(path for path in at.iterdir() if path.suffix != ".json" and not path.name.startswith("parallel_"))


@needs("harness", "reference")
class ImportTest(unittest.TestCase):
    def setUp(self):
        self.directory = tempfile.TemporaryDirectory()
        self.addCleanup(self.directory.cleanup)
        self.at = pathlib.Path(self.directory.name)
        self.rows = leaves()
        self.sides = np.arange(len(self.rows)) % 3

    def imported(self, path, *options):
        """Words and manifest of an imported mesh."""
        with tempfile.TemporaryDirectory() as out:
            code, _, error = run("harness", "import", path, "--out", pathlib.Path(out) / "mesh", *options)
            self.assertEqual((code, "Traceback" in error), (0, False), f"{path}: {error}")
            mesh = pathlib.Path(out) / "mesh"
            return np.load(mesh / "leaves-00000.npy"), json.loads((mesh / "mesh.json").read_text())

    def check(self, path, rows, sides):
        """The mesh in the file has these leaves, with the sides and without."""
        words, manifest = self.imported(path, "--sides", "body")
        np.testing.assert_array_equal(words, words_of(rows, sides), str(path))
        self.assertNotIn("sides", manifest)
        np.testing.assert_allclose(manifest["root"]["origin"], ORIGIN, atol=1e-6)
        self.assertAlmostEqual(manifest["root"]["edge"], EDGE, places=6)
        words, manifest = self.imported(path)
        np.testing.assert_array_equal(words, words_of(rows, 0 * sides))
        self.assertEqual(manifest["sides"], "unknown")

    def refused(self, path, *options):
        """The sentence with which a file is refused."""
        out = self.at / "refused"
        code, output, error = run("harness", "import", path, "--out", out, *options)
        self.assertEqual((code, output, error.count("\n")), (2, "", 1), f"{path}: {error}")
        self.assertFalse(out.exists())
        return error

    def test_unstructured_grids_in_every_encoding(self):
        files = unstructured_files(self.at, hexahedra(self.rows, self.sides))
        self.assertEqual(len(files), 10)
        for path in files:
            self.check(path, self.rows, self.sides)

    def test_voxels_and_single_precision(self):
        hexahedra(self.rows, self.sides, np.float32).save(self.at / "single.vtu")
        hexahedra(self.rows, self.sides, cell_type=pyvista.CellType.VOXEL).save(self.at / "voxel.vtu")
        for name in ("single", "voxel"):
            self.check(self.at / f"{name}.vtu", self.rows, self.sides)

    def test_hyper_tree_grids(self):
        kept = self.sides != 1
        for trees in (1, 2):
            for masked in (False, True):
                grid = hyper_trees(self.rows, self.sides, trees, masked)
                which = kept if masked else slice(None)
                for writer, suffix in (("vtkXMLHyperTreeGridWriter", "htg"), ("vtkHDFWriter", "vtkhdf")):
                    path = self.at / f"{trees}-{masked}.{suffix}"
                    write(grid, writer, path)
                    self.check(path, self.rows[which], self.sides[which])

    def test_an_exported_mesh_is_imported_with_its_digest(self):
        case = (ROOT / "geometries/cube-small.toml").read_text()
        for keep in ("outside", "inside", "all"):
            case_file, mesh = self.at / f"{keep}.toml", self.at / keep
            case_file.write_text(f'keep = "{keep}"\n' + case)
            self.assertEqual(run("reference", case_file, "--out", mesh)[0], 0)
            expected = json.loads((mesh / "mesh.json").read_text())
            for suffix, *options in [("vtu", "--sides", "side", "--case", case_file), ("vtu",)]:
                file = self.at / f"{keep}.{suffix}"
                self.assertEqual(run("harness", "export", mesh, file)[0], 0)
                _, manifest = self.imported(file, *options)
                keys = ["digest", "root", "leaves_by_level", "leaves_by_side"]
                for key in keys + ["level_surface", "keep"] * bool(options):
                    self.assertEqual(manifest[key], expected[key], key)
            # In another root, VTK reads the tree, and the sides are known as well.
            file, root = self.at / f"{keep}.vtkhdf", expected["root"]
            self.assertEqual(run("harness", "export", mesh, file)[0], 0)
            _, manifest = self.imported(file, "--root", ",".join(map(repr, [*root["origin"], 2 * root["edge"]])))
            self.assertEqual(manifest["leaves_by_side"], expected["leaves_by_side"])

    def test_sides_that_another_program_adds_to_an_exported_mesh(self):
        mesh, file = self.at / "mesh", self.at / "mesh.vtu"
        self.assertEqual(run("harness", "import", samples() / "unitcube.p8est", "--out", mesh)[0], 0)
        self.assertEqual(run("harness", "export", mesh, file)[0], 0)
        grid = pyvista.read(file)
        grid.cell_data["body"] = np.ones(grid.n_cells, np.int32)
        grid.save(file)
        words, manifest = self.imported(file, "--sides", "body")
        self.assertNotIn("sides", manifest)
        self.assertTrue((words & 3 == 1).all())

    def test_part_of_a_mesh_is_imported_with_the_root_of_the_whole(self):
        mesh = self.at / "whole"
        self.assertEqual(run("reference", ROOT / "geometries/cube-small.toml", "--out", mesh)[0], 0)
        whole = np.load(mesh / "leaves-00000.npy")
        file = self.at / "part.vtu"
        self.assertEqual(run("harness", "export", mesh, file, "--side", "outside", "--level-max", "4")[0], 0)
        words, manifest = self.imported(file)
        np.testing.assert_array_equal(words, whole[(whole & 3 == 0) & ((whole >> 2 & 31) <= 4)])
        self.assertEqual(manifest["root"], json.loads((mesh / "mesh.json").read_text())["root"])

    def test_meshes_of_other_programs(self):
        for name, table in (("cube.json", "cube.csv"), ("flat.msh", "flat.csv"), ("foam-ascii", "foam.csv"), ("foam-binary", "foam.csv")):
            words, manifest = self.imported(samples() / name)
            root = manifest["root"]
            expected, _ = self.imported(samples() / table, "--root", ",".join(map(repr, [*root["origin"], root["edge"]])))
            np.testing.assert_array_equal(words, expected, name)
        code, output, error = run("harness", "import", samples() / "foam-binary", "--out", self.at / "foam")
        self.assertEqual((code, error.count("\n")), (0, 1))
        self.assertIn("the root -1,-1,-1,4 is the least that holds the cells", error)
        self.assertIn("256 cells", output)
        self.assertIn("cube.csv: cell 0 (corner", self.refused(samples() / "cube.csv", "--root", "0,0,0,1"))
        level = self.at / "level"
        shutil.copytree(samples() / "foam-ascii", level)
        text = (level / "cellLevel").read_text()
        (level / "cellLevel").write_text(text.replace("(\n0\n0\n0\n", "(\n0\n0\n1\n", 1))
        self.assertIn("cell 2 has level 1 and edge 1, but cell 0 has level 0 and edge 1", self.refused(level))

    def test_an_exported_polymesh_has_the_leaves_of_the_mesh(self):
        mesh = self.at / "mesh"
        self.assertEqual(run("reference", ROOT / "geometries/cube-small.toml", "--out", mesh)[0], 0)
        expected = json.loads((mesh / "mesh.json").read_text())
        root = ",".join(map(repr, [*expected["root"]["origin"], expected["root"]["edge"]]))
        target = self.at / "case/constant/polyMesh"
        code, _, error = run("harness", "export", mesh, target)
        self.assertEqual(code, 0, error)
        for widen in (lambda _: None, widen_labels):
            widen(target)
            _, manifest = self.imported(target, "--sides", "side", "--root", root)
            self.assertEqual(manifest["digest"], expected["digest"], widen)

    def test_an_audit_of_a_file_needs_no_manifest(self):
        path = self.at / "mesh.vtu"
        hexahedra(self.rows, self.sides).save(path)
        code, output, error = run("harness", "audit", path)
        self.assertEqual(code, 0, output + error)
        self.assertIn(f"{len(self.rows)} leaves", output)
        # A cell without its neighbours leaves a hole, and a level between is missing.
        hexahedra(self.rows[1:], self.sides[1:]).save(path)
        code, output, _ = run("harness", "audit", path, "--root", "-1,2,0.5,4")
        self.assertEqual(code, 1, output)

    def test_damaged_files_are_refused_in_one_sentence(self):
        files = unstructured_files(self.at, hexahedra(self.rows, self.sides))
        htg = self.at / "tree.htg"
        write(hyper_trees(self.rows, self.sides, 1, True), "vtkXMLHyperTreeGridWriter", htg)
        for path in [*files, htg]:
            content = path.read_bytes()
            for part in (0.1, 0.5):
                damaged = self.at / f"damaged{path.suffix}"
                damaged.write_bytes(content[: int(len(content) * part)])
                self.refused(damaged, "--format", "vtk")

    def test_cells_that_are_not_cubes_are_named(self):
        grid = hexahedra(self.rows, self.sides)
        grid.points[5] += [0.03, 0, 0]
        grid.save(self.at / "moved.vtu")
        self.assertRegex(self.refused(self.at / "moved.vtu"), r"has cell \d+, which is not an axis-aligned cube")
        tetrahedron = pyvista.UnstructuredGrid([4, 0, 1, 2, 3], [pyvista.CellType.TETRA], np.eye(4, 3))
        tetrahedron.save(self.at / "tetrahedron.vtu")
        self.assertIn("has cell 0 of VTK's type 10", self.refused(self.at / "tetrahedron.vtu"))
        message = self.refused(self.at / "moved.vtu", "--sides", "absent")
        self.assertIn("not an axis-aligned cube", message)

    def test_names_of_columns_in_comments_are_used_or_refused(self):
        path = self.at / "cells.txt"
        cells = [" ".join(map(str, row)) for row in ([0, 0, 0, 1], [2, 0, 0, 1], [0, 2, 0, 1], [2, 2, 0, 1])]
        heads = {
            "x y z level": 0, "z y x level": 2, "Z Y X Level\n# exported by mytool 1.2": 2, "four words of prose\n# z y x level": 2,
            "of a case, x y z level in this order": 0, "made by mytool": 0,
        }
        found = {}
        for head, axis in heads.items():
            path.write_text(f"# {head}\n" + "\n".join(cells))
            words, _ = self.imported(path, "--root", "0,0,0,4")
            found.setdefault(axis, []).append(words.tolist())
        self.assertNotEqual(found[0][0], found[2][0])
        for same in found.values():
            self.assertTrue(all(words == same[0] for words in same))
        for head in ("z [m],y [m],x [m],level", "columns: z y x level", "z:y:x:level", "the columns x y z edge"):
            path.write_text(f"# {head}\n" + "\n".join(cells))
            self.assertIn("has a comment that is no list of 4 names", self.refused(path, "--root", "0,0,0,4"))
        np.save(self.at / "empty.npy", np.zeros((0, 4)))
        self.assertIn("has no cells", self.refused(self.at / "empty.npy", "--root", "0,0,0,4"))

    def test_cells_without_a_size_or_a_place_are_named(self):
        path = self.at / "cells.csv"
        for cell in ("1,0,0,0", "1,0,0,-1", "1,0,nan,1", "inf,0,0,1"):
            path.write_text(f"x,y,z,edge\n0,0,0,1\n{cell}\n")
            self.assertIn("has cell 1 with the corner", self.refused(path))
        grid = hyper_trees(self.rows, self.sides, 1, False)
        grid.GetYCoordinates().SetTuple1(1, np.nan)
        write(grid, "vtkHDFWriter", self.at / "nan.vtkhdf")
        self.assertIn("has trees that are not equal cubes", self.refused(self.at / "nan.vtkhdf"))
        text = (samples() / "cube.json").read_text()
        (self.at / "nan.json").write_text(re.sub(r'"(x0|origin)": \[[^,]*', r'"\1": [NaN', text))
        self.assertIn("has the corner [nan, ", self.refused(self.at / "nan.json"))

    def test_ghosts_and_hidden_cells_are_left_out(self):
        grid = hexahedra(self.rows, self.sides)
        flags = np.zeros(len(self.rows), np.uint8)
        flags[[0, 3, 7, 9]] = 1, 8, 32, 33
        grid.cell_data["vtkGhostType"] = flags
        kept = flags == 0
        for path in (self.at / "ghosts.vtu", self.at / "ghosts.pvtu"):
            writer = "vtkXMLPUnstructuredGridWriter" if path.suffix == ".pvtu" else "vtkXMLUnstructuredGridWriter"
            write(grid, writer, path)
            self.check(path, self.rows[kept], self.sides[kept])
        trees = hyper_trees(self.rows, self.sides, 1, False)
        flags = numpy_to_vtk((vtk_to_numpy(trees.GetCellData().GetArray("body")) == 1).astype(np.uint8), deep=True)
        flags.SetName("vtkGhostType")
        trees.GetCellData().AddArray(flags)
        write(trees, "vtkXMLHyperTreeGridWriter", self.at / "ghosts.htg")
        self.check(self.at / "ghosts.htg", self.rows[self.sides != 1], self.sides[self.sides != 1])

    def test_a_file_in_partitions_is_whole_and_one_in_time_steps_is_refused(self):
        parts = vtk.vtkPartitionedDataSet()
        for index in range(2):
            parts.SetPartition(index, hexahedra(self.rows[index::2], self.sides[index::2]))
        path = self.at / "parts.vtkhdf"
        write(parts, "vtkHDFWriter", path)
        self.check(path, self.rows, self.sides)
        path = self.at / "steps.vtkhdf"
        write(hexahedra(self.rows, self.sides), "vtkHDFWriter", path)
        with h5py.File(path, "r+") as file:
            steps = file["VTKHDF"].create_group("Steps")
            steps.attrs["NSteps"] = 2
            for name, values in [("Values", [0.0, 1.0]), ("PartOffsets", [0, 0]), ("NumberOfParts", [1, 1]), ("PointOffsets", [0, 0])]:
                steps[name] = np.array(values)
            steps["CellOffsets"] = steps["ConnectivityIdOffsets"] = np.zeros((2, 1), int)
            for name in ("PointDataOffsets", "CellDataOffsets", "FieldDataOffsets"):
                steps.create_group(name)
        self.assertIn("has 2 time steps", self.refused(path))

    def test_an_absent_cell_array_is_named(self):
        path = self.at / "mesh.vtu"
        hexahedra(self.rows, self.sides).save(path)
        self.assertIn("has no cell array absent of single numbers; its cell arrays are: body", self.refused(path, "--sides", "absent"))
        hexahedra(self.rows, self.sides + 1).save(path)
        self.assertIn("has the side 3", self.refused(path, "--sides", "body"))


if __name__ == "__main__":
    unittest.main()
