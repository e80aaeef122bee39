"""Tessellate a boundary representation: `tessellate.py BODY.brep BODY.stl`, in the environment that `fetch` makes.

The tolerances, a deflection of 0.003 and an angle of 0.2 rad, are those of the file with the pinned checksum.
"""

import sys
from pathlib import Path

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent))

import facets  # noqa: E402

LINEAR, ANGULAR = 0.003, 0.2


def faces(shape):
    """The faces of a shape."""
    explorer = TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        yield TopoDS.Face(explorer.Current())
        explorer.Next()


def facets_of(face):
    """The triangles of a face, wound outward even if the face is reversed."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    move = location.Transformation()
    nodes = [mesh.Node(i + 1).Transformed(move) for i in range(mesh.NbNodes())]
    points = [(p.X(), p.Y(), p.Z()) for p in nodes]
    is_reversed = face.Orientation() == TopAbs_REVERSED
    for i in range(mesh.NbTriangles()):
        a, b, c = (points[n - 1] for n in mesh.Triangle(i + 1).Get())
        yield (c, b, a) if is_reversed else (a, b, c)


def main():
    source, target = sys.argv[1:]
    shape = TopoDS_Shape()
    if not BRepTools.Read_s(shape, source, BRep_Builder()):
        sys.exit(f"{source} is not a boundary representation: give a .brep file")
    BRepMesh_IncrementalMesh(shape, LINEAR, False, ANGULAR, False)
    soup = [facet for face in faces(shape) for facet in facets_of(face)]
    Path(target).write_bytes(facets.stl_binary(soup))


if __name__ == "__main__":
    main()
