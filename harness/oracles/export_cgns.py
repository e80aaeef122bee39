"""Writes the polyMesh of `harness export` as CGNS, for `harness export MESH FILE.cgns`.

    python export_cgns.py POLYMESH FILE

The cells are polyhedra (`NGON_n` and `NFACE_n`), in one base with one zone; each patch is a boundary condition with its name, and `level`,
`side` and `rank` are a solution at cell centres. CGNS keeps its tree in HDF5: a node is a group with the attributes `name`, `label`, `type`
and `flags`, and its data are a dataset named ` data` (CGNS/HDF5 mapping, "File Mapping Manual"). Arrays have Fortran's order of
dimensions there, so those of HDF5 are transposed.

Exit codes: 0 success; 2 the mesh cannot be read or is too large; 3 a package cannot be imported.
"""

import itertools
import pathlib
import re
import sys

import numpy as np

from imports import Refused
from import_cells import Foam

try:
    import h5py
except ImportError as error:
    print(error, file=sys.stderr)
    raise SystemExit(3) from None

TYPES = {np.dtype("<i4"): "I4", np.dtype("<f4"): "R4", np.dtype("<f8"): "R8", np.dtype("i1"): "C1"}
NGON, NFACE = 22, 23
PATCH = re.compile(r"(\S+)\s*\{[^}]*?\btype\s+(\w+);[^}]*?\bnFaces\s+(\d+);[^}]*?\bstartFace\s+(\d+);[^}]*\}")


def text(characters, size):
    """Characters as a field of fixed size, filled with zeros."""
    return np.array(characters.encode(), h5py.string_dtype("ascii", size))


def describe(group, name, label, kind):
    for key, value, size in [("name", name, 33), ("label", label, 33), ("type", kind, 3)]:
        group.attrs.create(key, text(value, size), dtype=h5py.string_dtype("ascii", size))


def node(parent, name, label, data=None):
    """Adds a node; data are a text, numbers or none."""
    group = parent.create_group(name, track_order=True)
    if isinstance(data, str):
        data = np.frombuffer(data.encode(), "i1")
    describe(group, name, label, "MT" if data is None else TYPES[np.asarray(data).dtype])
    group.attrs.create("flags", np.array([1], "<i4"))
    if data is not None:
        group.create_dataset(" data", data=data)
    return group


def shortened(name):
    """A name in the 32 bytes of CGNS, and further ones if it is that of another node."""
    for end in itertools.chain([""], map("_{}".format, itertools.count(2))):
        # A character that would be cut is left out.
        yield name.encode()[: 32 - len(end)].decode(errors="ignore") + end


def integers(values):
    """As numbers of 32 bits."""
    values = np.asarray(values)
    if values.max(initial=0) >= 1 << 31:
        raise Refused("needs numbers beyond 32 bits: export a part of the mesh")
    return values.astype("<i4")


def elements(zone, name, kind, first, begins, connectivity):
    group = node(zone, name, "Elements_t", integers([kind, 0]))
    node(group, "ElementRange", "IndexRange_t", integers([first, first + len(begins) - 2]))
    node(group, "ElementStartOffset", "DataArray_t", integers(begins))
    node(group, "ElementConnectivity", "DataArray_t", integers(connectivity))


def faces_of_cells(owners, neighbours):
    """Where the faces of each cell begin, and their numbers from 1, negative if the face points into the cell."""
    cells = np.concatenate([owners, neighbours])
    faces = np.concatenate([1 + np.arange(len(owners)), -1 - np.arange(len(neighbours))])
    count = int(cells.max()) + 1
    begins = np.concatenate([[0], np.cumsum(np.bincount(cells, minlength=count))])
    return begins, faces[np.argsort(cells, kind="stable")]


def write(at, file):
    with open(at / "owner", "rb") as owner:
        is_wide = b"label=64" in owner.read(4096)
    if is_wide:
        raise Refused("needs numbers beyond 32 bits: export a part of the mesh")
    points = Foam(at / "points").points()
    begins, vertices = Foam(at / "faces").faces(len(points))
    owners, neighbours = (Foam(at / name).labels() for name in ("owner", "neighbour"))
    of_cells, faces = faces_of_cells(owners, neighbours)
    cells, last = len(of_cells) - 1, len(owners)

    describe(file, "HDF5 MotherNode", "Root Node of HDF5 File", "MT")
    for name, content in [(" format", "IEEE_LITTLE_32"), (" hdf5version", "HDF5 Version " + h5py.version.hdf5_version)]:
        field = np.frombuffer(content.encode().ljust(15 if name == " format" else 33, b"\0"), "i1")
        file.create_dataset(name, data=field)
    node(file, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([3.4], "<f4"))
    base = node(file, "Base", "CGNSBase_t", integers([3, 3]))
    node(base, "DataClass", "DataClass_t", "NormalizedByUnknownDimensional")  # The units of the geometry are not known.
    zone = node(base, "Zone", "Zone_t", integers([[len(points)], [cells], [0]]))
    node(zone, "ZoneType", "ZoneType_t", "Unstructured")
    grid = node(zone, "GridCoordinates", "GridCoordinates_t")
    for axis, name in enumerate("XYZ"):
        node(grid, f"Coordinate{name}", "DataArray_t", np.ascontiguousarray(points[:, axis]))
    elements(zone, "NGON_n", NGON, 1, begins, vertices + 1)
    elements(zone, "NFACE_n", NFACE, last + 1, of_cells, faces)
    conditions = node(zone, "ZoneBC", "ZoneBC_t")
    known = set(base)  # A family is a child of the base, as the zone is.
    for name, kind, count, start in PATCH.findall((at / "boundary").read_text("utf-8")):
        if int(count):  # A range cannot be empty.
            name = next(short for short in shortened(name) if short not in known)
            known.add(name)
            # Programs assign a type to a family by its name; only walls are known here.
            node(node(base, name, "Family_t"), "FamilyBC", "FamilyBC_t", "BCWall" if kind == "wall" else "UserDefined")
            condition = node(conditions, name, "BC_t", "FamilySpecified")
            node(condition, "FamilyName", "FamilyName_t", name)
            node(condition, "PointRange", "IndexRange_t", integers([[int(start) + 1], [int(start) + int(count)]]))
            node(condition, "GridLocation", "GridLocation_t", "FaceCenter")
    solution = node(zone, "Cells", "FlowSolution_t")
    node(solution, "GridLocation", "GridLocation_t", "CellCenter")
    for name, array in [("level", "cellLevel"), ("side", "side"), ("rank", "rank")]:
        if (at / array).is_file():
            node(solution, name, "DataArray_t", integers(Foam(at / array).labels()))


if __name__ == "__main__":
    try:
        with h5py.File(sys.argv[2], "x", track_order=True, libver="earliest") as file:
            write(pathlib.Path(sys.argv[1]), file)
    except Refused as why:
        print(why, file=sys.stderr)
        raise SystemExit(2) from None
