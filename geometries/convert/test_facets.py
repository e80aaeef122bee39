"""Tests of the readers and the writer. Run with: python3 -m unittest discover -s geometries/convert"""

import struct
import subprocess
import sys
import unittest
from pathlib import Path

import facets

AC3D = b"""AC3Db
MATERIAL "m" rgb 1 1 1
OBJECT world
kids 2
OBJECT group
loc 10 0 0
rot 0 1 0 -1 0 0 0 0 1
kids 1
OBJECT poly
name "turned"
data 7
OBJECT
loc 1 0 0
numvert 3
1 0 0
0 1 0
0 0 1
numsurf 2
SURF 0x10
mat 0
refs 3
0 0 0
1 0 0
2 0 0
SURF 0x02
mat 0
refs 2
0 0 0
1 0 0
kids 0
OBJECT poly
numvert 4
0 0 0
1 0 0
1 2 0
0 2 0
numsurf 1
SURF 0x30
refs 4
0 0 0
1 0 0
2 0 0
3 0 0
kids 0
"""


class Readers(unittest.TestCase):
    def test_ac3d_objects_inherit_transformations_and_z_points_up(self):
        # The points of the inner object are translated by 1 along x, rotated from x to y, and translated by 10 along x.
        rotated = ((10, 0, 2), (9, 0, 1), (10, -1, 1))
        flat = [((0, 0, 0), (1, 0, 0), (1, 0, 2)), ((0, 0, 0), (1, 0, 2), (0, 0, 2))]
        self.assertEqual(facets.ac3d(AC3D), [rotated, *flat])

    def test_off_and_obj_polygons_are_triangulated_as_fans(self):
        off = b"OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
        obj = b"# square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng x\nf 1/1 2/1 3/1 4/1\n"
        square = [((0, 0, 0), (1, 0, 0), (1, 1, 0)), ((0, 0, 0), (1, 1, 0), (0, 1, 0))]
        self.assertEqual(facets.off(off), square)
        self.assertEqual(facets.obj(obj), square)

    def test_ascii_stl_may_contain_several_solids(self):
        solid = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
        self.assertEqual(facets.stl_text(solid * 2), [((0, 0, 0), (1, 0, 0), (0, 1, 0))] * 2)

    def test_binary_stl_has_unit_normals_or_zero_for_facets_without_area(self):
        data = facets.stl_binary([((0, 0, 0), (2, 0, 0), (0, 2, 0)), ((1, 1, 1),) * 3])
        self.assertEqual(len(data), 84 + 2 * 50)
        self.assertEqual(struct.unpack_from("<I3f", data, 80), (2, 0, 0, 1))
        self.assertEqual(struct.unpack_from("<6f", data, 134), (0, 0, 0, 1, 1, 1))


class Fetch(unittest.TestCase):
    def test_an_output_that_is_no_directory_is_an_invalid_argument(self):
        fetch = Path(__file__).resolve().parents[1] / "fetch"
        ended = subprocess.run([sys.executable, fetch, "evtol", "--into", __file__], capture_output=True, text=True)
        self.assertEqual((ended.returncode, "Traceback" in ended.stderr), (2, False), ended.stderr)


if __name__ == "__main__":
    unittest.main()
