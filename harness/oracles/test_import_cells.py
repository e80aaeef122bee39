"""Tables and meshes of discretize and OpenFOAM are read as their programs state them, and damaged ones are refused in a sentence. Run with:
python -m unittest discover harness/oracles"""

import itertools
import json
import pathlib
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import import_cells
from built import samples
from imports import Refused

FOAM = ("points", "faces", "owner", "neighbour", "cellLevel")
# Every sample, the table of its cells, and the root that it states.
KNOWN = {
    "cube.json": ("cube.csv", [-1.0, 2.0, 0.5, 2.0]),
    "cube.msh": ("cube.csv", [-1.0, 2.0, 0.5, 2.0]),
    "flat.json": ("flat.csv", [0.0, 0.0, -1.0, 8.0]),
    "flat.msh": ("flat.csv", [0.0, 0.0, -1.0, 8.0]),
    "rounded.json": ("rounded.csv", [0.0, 0.0, 0.0, 0.25]),
    "foam-ascii": ("foam.csv", None),
    "foam-binary": ("foam.csv", None),
    "unitcube.csv": ("unitcube.csv", None),
}


def read(path, sides=None, root=None, position="corner"):
    """Corners, edges and what else is known of the cells in a file."""
    kind = {".csv": "table", ".npy": "table", ".json": "discretize", ".msh": "discretize"}.get(path.suffix, "openfoam")
    corners, edges, more = import_cells.READERS[kind](str(path), {"sides": sides, "root": root, "position": position})
    for values in (corners, edges, more.get("levels"), more.get("sides")):
        assert values is None or len(values) == len(edges)
    return np.asarray(corners, float), np.asarray(edges, float), more


def root_of(numbers):
    return {"origin": numbers[:3], "edge": numbers[3]}


class CellsTest(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.at = pathlib.Path(directory.name)

    def edited(self, name, file, change):
        """A copy of a sample in which the content of one file was changed."""
        copy = self.at / name
        shutil.rmtree(copy, ignore_errors=True)
        if (samples() / name).is_dir():
            shutil.copytree(samples() / name, copy)
        else:
            shutil.copy(samples() / name, copy)
        path = copy / file if file else copy
        path.write_bytes(change(path.read_bytes()))
        return copy

    def refused(self, path, **options):
        with self.assertRaises((Refused, OSError)) as caught:
            read(path, **options)
        return str(caught.exception)

    def replaced(self, name, file, before, after):
        """The sentence with which a sample is refused after a text in it was replaced."""

        def change(content):
            self.assertIn(before, content)
            return content.replace(before, after, 1)

        return self.refused(self.edited(name, file, change))

    def table(self, text):
        path = self.at / "table.csv"
        path.write_text(text)
        return path

    def test_every_sample_has_the_cells_that_its_program_states(self):
        for name, (table, root) in KNOWN.items():
            with self.subTest(name):
                corners, edges, more = read(samples() / name)
                expected, sizes, _ = read(samples() / table)
                order, same = np.lexsort(corners.round(9).T), np.lexsort(expected.round(9).T)
                np.testing.assert_allclose(corners[order], expected[same], atol=1e-9)
                np.testing.assert_allclose(edges[order], sizes[same], atol=1e-9)
                self.assertEqual("levels" in more and more["levels"] is not None, name.startswith("foam") or ".json" in name)
                if root:
                    np.testing.assert_allclose([*more["root"]["origin"], more["root"]["edge"]], root, atol=1e-9)

    def test_the_last_cell_of_a_foam_need_not_own_a_face(self):
        """Of 3 x 3 x 3 cubes the one in the middle comes last, as cells do that snappyHexMesh has split."""
        cells = sorted(itertools.product(range(3), repeat=3), key=lambda cell: (cell == (1, 1, 1), cell))
        around = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
        faces = {}
        for number, (x, y, z) in enumerate(cells):
            for face in around:
                points = [(x + (p & 1)) + 4 * (y + (p >> 1 & 1)) + 16 * (z + (p >> 2)) for p in face]
                faces.setdefault(frozenset(points), [points]).append(number)
        faces = sorted(faces.values(), key=lambda face: len(face) == 2)
        lists = {
            "points": ["({} {} {})".format(p % 4, p // 4 % 4, p // 16) for p in range(64)],
            "faces": ["4({} {} {} {})".format(*face[0]) for face in faces],
            "owner": [str(face[1]) for face in faces],
            "neighbour": [str(face[2]) for face in faces if len(face) == 3],
        }
        for name, items in lists.items():
            (self.at / name).write_text(f"FoamFile {{ format ascii; class {name}; }}\n{len(items)}\n(\n" + "\n".join(items) + "\n)\n")
        corners, edges, _ = read(self.at)
        self.assertEqual((corners.tolist(), set(edges.tolist())), ([list(map(float, cell)) for cell in cells], {1.0}))

    def test_a_given_root_replaces_one_that_the_file_rounded(self):
        exact = root_of([0.0, 0.0, 0.0, 0.25])
        corners, edges, more = read(samples() / "rounded.msh", root=exact)
        self.assertIs(more["root"], exact)
        expected, sizes, _ = read(samples() / "rounded.csv")
        order, same = np.lexsort(corners.round(9).T), np.lexsort(expected.round(9).T)
        np.testing.assert_allclose(corners[order], expected[same], atol=1e-9)
        np.testing.assert_allclose(edges[order], sizes[same], atol=1e-9)
        # This root is not the file's: cells stay where they are.
        _, _, more = read(samples() / "rounded.msh", root=root_of([0.0, 0.0, 0.0, 0.3]))
        self.assertNotEqual(more["root"]["edge"], 0.3)

    def test_columns_are_found_by_name_or_by_place(self):
        root = root_of([1.0, 2.0, 3.0, 8.0])
        for text in ("1 2 3 1\n5 2 3 3\n", "# comment\n\n1;2;3;1\n5;2;3;3", '"X","y","z","LEVEL","side"\n1,2,3,1,0\n5,2,3,3,2'):
            corners, edges, more = read(self.table(text), root=root)
            self.assertEqual((corners.tolist(), edges.tolist(), more["root"]), ([[1, 2, 3], [5, 2, 3]], [4, 1], root))
        _, _, more = read(self.table(text), root=root, sides="side")
        self.assertEqual(more["sides"].tolist(), [0, 2])
        corners, edges, _ = read(self.table("0 0 0 1\n7 0 0 3\n"), root=root, position="index")
        self.assertEqual(corners.tolist(), [[1, 2, 3], [8, 2, 3]])
        self.assertIn("give it with --root", self.refused(self.table("0 0 1 1"), position="index"))
        corners, edges, more = read(self.table("edge,z,y,x\n2,3,2,1"), position="centre")
        self.assertEqual((corners.tolist(), edges.tolist(), more["root"]), ([[0, 1, 2]], [2], None))

    def test_a_comment_above_the_cells_names_the_columns_as_numpy_writes_it(self):
        root = root_of([1.0, 2.0, 3.0, 8.0])
        for names, expected in (("z y x level", [[3, 2, 1], [3, 2, 5]]), ("made by hand", [[1, 2, 3], [5, 2, 3]])):
            np.savetxt(self.at / "table.csv", [[1, 2, 3, 1], [5, 2, 3, 3]], header=f"cubes\n{names}")
            corners, _, _ = read(self.at / "table.csv", root=root)
            self.assertEqual(corners.tolist(), expected)
        np.savetxt(self.at / "table.csv", [[1, 2, 3, 1]], header="k,j,i,level", delimiter=",")
        self.assertIn("has no column x: its columns are k, j, i, level", self.refused(self.at / "table.csv", root=root))
        self.at.joinpath("table.csv").write_bytes(b"\xef\xbb\xbfx,y,z,edge\r\n1,2,3,4\r\n")
        corners, _, _ = read(self.at / "table.csv")
        self.assertEqual(corners.tolist(), [[1, 2, 3]])

    def test_arrays_of_numpy_are_tables(self):
        root, path = root_of([0.0, 0.0, 0.0, 1.0]), self.at / "table.npy"
        rows = [(0.0, 0.5, 0.0, 1), (0.5, 0.5, 0.0, 2)]
        plain = np.array(rows)
        structured = np.array(rows, [("x", ">f4"), ("y", "<f8"), ("z", "<f2"), ("level", "u1")])
        for array in (plain, np.asfortranarray(plain), plain.astype(">f8"), structured):
            np.save(path, array)
            corners, edges, _ = read(path, root=root)
            self.assertEqual((corners.tolist(), edges.tolist()), ([[0, 0.5, 0], [0.5, 0.5, 0]], [0.5, 0.25]))
        for array in (plain[:, :3], plain[None], plain.astype(complex), np.array(5.0), plain.astype("U9"), np.zeros(2, [("x", "f8", 2)]), np.zeros(2, [(name, "f8") for name in ("x", "y", "z", "edge", "X")])):
            np.save(path, array)
            self.refused(path, root=root)
        content = (np.save(path, plain), path.read_bytes())[1]
        for length in range(0, len(content), 7):
            path.write_bytes(content[:length])
            self.refused(path, root=root)
        path.write_bytes(b"\x93NUMPY\x02\x00\xff\xff\xff\xff" + content)
        self.refused(path, root=root)

    def test_tables_that_cannot_be_read_are_refused(self):
        root = root_of([0.0, 0.0, 0.0, 1.0])
        sentences = {
            "": "has no cells",
            ",,\n": "has no cells",
            "x,y,z,level\n": "has no cells",
            "x,y,level\n0,0,1\n": "has no column z",
            "x,y,z\n0,0,1\n": "has no column level",
            "x;y;z;level\n0;0;0;1\n0,5;0;0;1": "has decimal commas or several separators in line 3",
            "0,5\t0,5\t0,5\t1": "has decimal commas or several separators in line 1",
            '"0,5","0,5","0,5","1"': "has decimal commas or several separators in line 1",
            "0;0;0;,5": "has decimal commas or several separators in line 1",
            "x,y,z,level,Level\n0,0,0,1,2": "has more than one column level",
            "0 0 0 one\n": "no table of numbers",
            "0 0 0 1\n0 0 0\n": "no table of numbers: the number of columns changed from 4 to 3 at row 2 (comments",
            "x,y,z,level,side\n0,0,0,1\n": "4 fields in a line, but 5 names",
            "0 0 0 0.5": "cell 0 has the level 0.5",
            "0 0 0 1\n0 0 0 20": "cell 1 has the level 20",
            "0 0 0 nan": "has the level nan",
            "x,y,z,level,edge\n0,0,0,1,0.5\n.5,0,0,1,1": "cell 1 has the level 1, which is an edge of 0.5, and the edge 1.0",
        }
        for text, sentence in sentences.items():
            self.assertIn(sentence, self.refused(self.table(text), root=root))
        for table in ("0 0 0 1", "x,y,z,level,edge\n0,0,0,1,1"):
            self.assertIn("has a column level, which needs a root", self.refused(self.table(table)))
        self.assertIn("need a column level", self.refused(self.table("x,y,z,edge\n0,0,0,1"), position="index"))
        self.assertIn("has no column body", self.refused(self.table("0 0 0 1"), root=root, sides="body"))

    def test_cells_that_cannot_be_written_are_no_fault_of_the_file(self):
        request = json.dumps({"format": "table", "sides": None, "root": root_of([0, 0, 0, 1]), "position": "corner"})
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
        for cells, environment in ((self.at / "absent/cells", {}), (self.at / "cells", {"preexec_fn": limit})):
            command = [sys.executable, "-B", import_cells.__file__, self.table("0 0 0 0"), cells, request]
            done = subprocess.run(command, capture_output=True, text=True, **environment)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn("was read, but its cells cannot be written to a temporary file", done.stderr)

    def test_an_empty_field_is_named(self):
        for text in ("0,0,0,1\n1,,0,1,1\n", "x;y;z;level\n0;;0;1\n", ",0,0,1\n"):
            self.assertIn("has an empty field in line", self.refused(self.table(text)))
        read(self.table("x,y,z,level,\n0,0,0,0,\n"), root=root_of([0, 0, 0, 1]))

    def test_a_case_with_another_mesh_is_refused(self):
        copy = self.edited("foam-ascii", "points", lambda content: content)
        asked = {"sides": None, "is_case": True}

        def with_cells(mesh, count):
            shutil.copytree(copy, mesh)
            owner = (copy / "owner").read_text()
            self.assertRegex(owner, r"nCells:\s*\d+")
            (mesh / "owner").write_text(re.sub(r"nCells:\s*\d+", f"nCells: {count}", owner))
            return str(mesh)

        for case, other in (("time", "2/polyMesh"), ("parallel", "processor1/constant/polyMesh")):
            mesh = with_cells(self.at / case / "constant/polyMesh", 8)
            import_cells.openfoam(mesh, asked)
            newer = with_cells(self.at / case / other, 9)
            with self.assertRaisesRegex(Refused, f"has another mesh than .*{other}"):
                import_cells.openfoam(mesh, asked)
            import_cells.openfoam(mesh, asked | {"is_case": False})
            import_cells.openfoam(newer, asked) if case == "time" else None
        # As decomposePar leaves it.
        mesh = with_cells(self.at / "whole/constant/polyMesh", 8)
        for part in (3, 5):
            with_cells(self.at / f"whole/processor{part}/constant/polyMesh", part)
        import_cells.openfoam(mesh, asked)

    def test_sides_of_an_openfoam_mesh_are_a_list_of_labels(self):
        copy = self.edited("foam-ascii", "cellLevel", lambda content: content)
        shutil.copy(copy / "cellLevel", copy / "body")
        _, _, more = read(copy, sides="body")
        self.assertEqual(set(more["sides"].tolist()), {0, 1})
        self.assertIn("absent", self.refused(copy, sides="absent"))
        for name in ("cube.json", "cube.msh"):
            self.assertIn("omit --sides", self.refused(samples() / name, sides="body"))

    def test_a_compressed_or_missing_file_is_named(self):
        copy = self.edited("foam-binary", "points", lambda content: content)
        (copy / "points").rename(copy / "points.gz")
        self.assertIn("points.gz: is compressed: decompress it with gunzip", self.refused(copy))
        copy = self.edited("foam-binary", "points", lambda content: content)
        (copy / "owner").unlink()
        self.assertIn("owner", self.refused(copy))

    def files(self):
        singles = [(name, "") for name in KNOWN if not name.startswith("foam") and name != "rounded.json"]
        return singles + [("rounded.msh", "")] + [(name, file) for name in ("foam-ascii", "foam-binary") for file in FOAM]

    def test_an_incomplete_file_is_an_error(self):
        for name, file in self.files():
            for part in (0, 0.1, 0.5, 0.9):
                if name == "unitcube.csv" and part > 0:
                    continue
                self.refused(self.edited(name, file, lambda content: content[: int(len(content) * part)]))

    def test_no_damage_is_fatal(self):
        chance, refusals = random.Random(1), 0

        def change(content):
            begin, content = chance.randrange(len(content) - 8), bytearray(content)
            match chance.randrange(3):
                case 0:
                    content[begin] = chance.randrange(256)
                case 1:
                    content[begin : begin + 8] = chance.choice([b"\0", b"\x7f", b"\xff", b"9"]) * 8
                case _:
                    del content[begin : begin + 1 + chance.randrange(7)]
            return bytes(content)

        for name, file in self.files():
            for _ in range(60):
                try:
                    read(self.edited(name, file, change))
                except (Refused, OSError, MemoryError):
                    refusals += 1
        self.assertGreater(refusals, 250)

    def test_counts_beyond_the_file_are_errors(self):
        for count in (b"999999999999", b"18446744073709551615", b"99999999999999999999999999"):
            for name, file, before, after in (
                ("foam-binary", "points", b"\n462\n", b"\n%s\n"),
                ("foam-ascii", "owner", b"\n960\n(", b"\n%s\n("),
            ):
                self.replaced(name, file, before, after % count)
        self.assertIn("states 600 items", self.replaced("foam-binary", "points", b"\n462\n", b"\n600\n"))

    def test_each_error_of_a_mesh_names_its_cell(self):
        moved = self.replaced("foam-ascii", "points", b"(0 -1 -1)", b"(0.2 -1 -1)")
        self.assertIn("cell 0 (corner [-1.0, -1.0, -1.0]) is not a cube: its bounds", moved)
        # The points have the numbers 0 to 461.
        self.assertIn("none of 462 points", self.replaced("foam-ascii", "faces", b"6(1 6 158", b"6(1 6 462"))

        def collapse(content):
            at = content.index(b"\n4(")
            end = content.index(b")", at)
            return content[: at + 3] + b" ".join([content[at + 3 : end].split()[0]] * 4) + content[end:]

        self.assertIn("is not a cube: its faces enclose", self.refused(self.edited("foam-ascii", "faces", collapse)))

        def lengthen(content):
            return content[: content.index(b"\n720\n(")] + b"\n961\n(" + b"0 " * 961 + b")"

        why = self.refused(self.edited("foam-ascii", "neighbour", lengthen))
        self.assertIn("960 faces with 960 owners and 961 neighbours: its files belong to different meshes", why)

    def test_a_cell_that_lacks_a_face_is_refused(self):
        """A face at a low side of a cell is one that only `neighbour` gives it, and any part of that list may be lost."""

        def shorten(count):
            def change(content):
                head, _, rest = content.partition(b"\n720\n(")
                return head + b"\n%d\n(" % count + b" ".join(rest.split(b")")[0].split()[:count]) + b")"

            return self.edited("foam-ascii", "neighbour", change)

        self.assertEqual(len(read(shorten(720))[1]), 256)
        for count in (719, 700, 360, 1, 0):
            self.assertRegex(self.refused(shorten(count)), r"cell \d+ .* is not a cube: its faces, with 0\.\d+ of a cube's area, do not close it")

    def test_cells_of_discretize_have_whole_numbers_within_the_mesh(self):
        def changed(change):
            mesh = json.loads((samples() / "cube.json").read_text())
            change(mesh)
            path = self.at / "changed.json"
            path.write_text(json.dumps(mesh))
            return self.refused(path)

        for name in ("indexes", "levels"):
            why = changed(lambda mesh: mesh["cell_state"].update({name: (np.array(mesh["cell_state"][name]) + 0.6).tolist()}))
            self.assertIn("must be whole numbers", why)
        why = changed(lambda mesh: mesh.update(h=[along[: len(along) // 2] for along in mesh["h"]]))
        self.assertIn("smallest cells along the axes", why)

    def test_widths_that_vary_are_an_error(self):
        for width in (b"0.25", b"0.1250005"):
            why = self.replaced("cube.json", "", b"[[0.125, 0.125", b"[[0.125, " + width)
            self.assertIn(f"widths 0.125 and {width.decode()} along x", why)
        self.assertIn("only cubes", self.replaced("cube.msh", "", b"0.125 0.125 0.125", b"0.125 0.250 0.125"))


if __name__ == "__main__":
    unittest.main()
