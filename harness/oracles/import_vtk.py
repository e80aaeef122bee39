"""Reads a mesh of cubes in one of VTK's formats, for `harness import`. `imports` describes how it is called.

The file is a legacy .vtk file, .vtu, .pvtu, .htg, or VTKHDF with an unstructured grid or a hyper-tree grid; its first bytes decide.
A hyper-tree grid of 2^k trees along each axis states its root; masked leaves are left out, and so are ghosts and hidden cells. Files of `harness export` state their root and
the digest of their leaves. Unless another array is requested, their sides are those of the array `side`.
"""

import itertools
import os
from xml.etree import ElementTree

import numpy as np
import protocol
from imports import TOLERANCE, Refused, run

try:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkBitArray, vtkIdList, vtkLogger, vtkOutputWindow, vtkStringOutputWindow, vtkTypeInt64Array
    from vtkmodules.vtkCommonDataModel import VTK_HEXAHEDRON, VTK_VOXEL
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkIOHDF import vtkHDFReader
    from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader
    from vtkmodules.vtkIOXML import (
        vtkXMLHyperTreeGridReader,
        vtkXMLPUnstructuredGridReader,
        vtkXMLUnstructuredGridReader,
    )
except (ImportError, OSError) as error:
    protocol.missing(error)

# The orders in which the corners of a cube, 4 z + 2 y + x each, may follow each other: VTK's hexahedron in its 24 rotations, whose
# volume is positive, and its voxel. Three bits per corner.
HEXAHEDRON, VOXEL = (0, 1, 3, 2, 4, 5, 7, 6), range(8)


def code(corners):
    """The order as one number."""
    return sum(int(corner) << 3 * place for place, corner in enumerate(corners))


def rotations():
    """The codes of all rotations of a hexahedron."""
    for axes in itertools.permutations(range(3)):
        odd = sum(a > b for a, b in itertools.combinations(axes, 2)) % 2
        for mirrored in range(8):
            if (odd + mirrored.bit_count()) % 2 == 0:
                turn = lambda corner: sum((corner >> axis & 1) << place for place, axis in enumerate(axes)) ^ mirrored
                yield code(turn(corner) for corner in HEXAHEDRON)


ORDERS = {VTK_HEXAHEDRON: np.array(sorted(rotations())), VTK_VOXEL: np.array([code(VOXEL)])}
# VTK's flags of cells that are another piece's, that finer ones replace, and that are hidden.
NOT_OF_MESH = 1 | 8 | 32
# Cells that are converted at a time. Larger arrays cost a page fault per page, five times the computation.
CHUNK = 1 << 12
READERS = {
    "UnstructuredGrid": vtkXMLUnstructuredGridReader,
    "PUnstructuredGrid": vtkXMLPUnstructuredGridReader,
    "HyperTreeGrid": vtkXMLHyperTreeGridReader,
}


def reader_for(path):
    """A reader for the format of the file."""
    with open(path, "rb") as file:
        head = file.read(4096)
    if head.startswith(b"\x89HDF\r\n\x1a\n"):
        if not vtkHDFReader().CanReadFile(path):
            raise Refused("is an HDF5 file, but none of VTK's")
        return vtkHDFReader()
    if head.startswith(b"# vtk DataFile"):
        return vtkUnstructuredGridReader()
    for name, reader in READERS.items():
        if f'type="{name}"'.encode() in head or f"type='{name}'".encode() in head:
            return reader()
    raise Refused("is not a VTK file of an unstructured grid or hyper-tree grid")


def read(path):
    """The data set in the file. VTK reports errors in a window and returns what it has read until then."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader = reader_for(path)
    reader.SetFileName(path)
    if isinstance(reader, vtkUnstructuredGridReader):
        reader.ReadAllScalarsOn()
        reader.ReadAllFieldsOn()
    reader.Update()
    # A message is a line with its place in VTK's source, then the text after the name and address of an object.
    text = window.GetOutput()
    text = text.decode(errors="replace") if isinstance(text, bytes) else text
    lines = [line.strip() for line in text.splitlines()]
    errors = [line.split("): ", 1)[-1] for line in lines if line and ": In vtk" not in line]
    if text or reader.GetErrorCode():
        why = errors[0] if errors else f"error {reader.GetErrorCode()}"
        raise Refused(f"cannot be read by VTK: {why.encode('ascii', 'replace').decode()}")
    if isinstance(reader, vtkHDFReader) and reader.GetNumberOfSteps() > 1:
        raise Refused(f"has {reader.GetNumberOfSteps()} time steps: write the one that is meant to a file of its own")
    data = reader.GetOutput()
    return merged(data) if data is not None and data.IsA("vtkPartitionedDataSet") else data


def merged(partitions):
    """The partitions, which are unstructured grids, as one."""
    append = vtkAppendFilter()
    for index in range(partitions.GetNumberOfPartitions()):
        part = partitions.GetPartition(index)
        if not part.IsA("vtkUnstructuredGrid"):
            raise Refused(f"has a partition that is a {part.GetClassName()}: unstructured grids are supported")
        append.AddInputData(part)
    append.Update()
    return append.GetOutput()


def cell_array(data, name):
    """The cell array with this name."""
    array = data.GetCellData().GetArray(name)
    if array is None or array.GetNumberOfComponents() != 1:
        names = [data.GetCellData().GetArrayName(i) for i in range(data.GetCellData().GetNumberOfArrays())]
        raise Refused(f"has no cell array {name} of single numbers; its cell arrays are: {', '.join(map(str, names)) or 'none'}")
    return vtk_to_numpy(array)


def of_unstructured(grid):
    """Corners and edges of hexahedra."""
    count = grid.GetNumberOfCells()
    if count == 0:
        raise Refused("has no cells")
    kinds = vtk_to_numpy(grid.GetCellTypes())
    wrong = np.flatnonzero((kinds != VTK_HEXAHEDRON) & (kinds != VTK_VOXEL))
    if len(wrong):
        raise Refused(f"has cell {wrong[0]} of VTK's type {kinds[wrong[0]]}: hexahedra (12) and voxels (11) are supported")
    points = vtk_to_numpy(grid.GetPoints().GetData())
    connectivity = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
    if len(connectivity) != 8 * count or grid.GetCells().GetMaxCellSize() != 8:
        raise Refused(f"has {len(connectivity)} vertices for {count} cells of eight")
    if connectivity.min() < 0 or connectivity.max() >= len(points):
        raise Refused(f"has a cell with a point beyond the {len(points)} that exist")
    corners, edges = np.empty((count, 3)), np.empty(count)
    axes = [np.ascontiguousarray(points[:, axis], np.float64) for axis in range(3)]
    for first in range(0, count, CHUNK):
        part = slice(first, min(first + CHUNK, count))
        vertices = np.ascontiguousarray(connectivity[8 * part.start : 8 * part.stop].reshape(-1, 8).T)
        corners[part], edges[part], is_cube, order = cubes([axis[vertices] for axis in axes])
        if not is_cube.all():
            cell = first + int(np.flatnonzero(~is_cube)[0])
            raise Refused(f"has cell {cell}, which is not an axis-aligned cube (minimum corner {corners[cell].tolist()})")
        for kind, known in ORDERS.items():
            wrong = np.flatnonzero((kinds[part] == kind) & ~np.isin(order, known))
            if len(wrong):
                cell = first + int(wrong[0])
                raise Refused(
                    f"has cell {cell}, whose corners are not in the order of VTK's type {kind}, so that its faces or its volume "
                    f"are inverted (minimum corner {corners[cell].tolist()})"
                )
    return corners, edges


def of_export(path, grid, edges):
    """Root and digest that a file of `harness export` states; None for other files."""
    root, digest = fields(path, grid)
    arrays = ("level", "spacing", "id")
    if digest is None and (root is None or not all(grid.GetCellData().HasArray(name) for name in arrays)):
        return None, None
    if root is None or digest is None:
        lost = "root" if root is None else "digest"
        raise Refused(f"was written by harness export, but lacks its field {lost}: it is damaged")
    # The digest is that of corners, edges and sides, from which the other arrays follow.
    level, spacing, index = (cell_array(grid, name) for name in arrays)
    with np.errstate(all="ignore"):
        agrees = (np.abs(spacing / edges - 1) <= TOLERANCE) & (np.abs(root[3] / edges / 2.0**level - 1) <= TOLERANCE)
    agrees[1:] &= index[1:] > index[:-1]
    if not agrees.all():
        raise Refused(f"has cell {np.flatnonzero(~agrees)[0]}, whose level, spacing or id contradicts its vertices: it is damaged")
    return {"origin": root[:3], "edge": root[3]}, digest


def is_own_tree(path):
    """Whether the mesher or `harness export` wrote this hyper-tree grid: only they state the edge of the root, at the end of the file."""
    with open(path, "rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - 4096))
        return b"RootEdge" in file.read()


def fields(path, grid):
    """The fields `root` and `digest` of the file, or None. For a .pvtu, VTK returns the fields of a part, which are those of the whole if
    VTK has written both; other programs write them as text."""
    root, digest = grid.GetFieldData().GetArray("root"), grid.GetFieldData().GetAbstractArray("digest")
    root = vtk_to_numpy(root).ravel().tolist() if root is not None else None
    digest = digest.GetValue(0) if digest is not None and digest.IsA("vtkStringArray") and digest.GetNumberOfTuples() else None
    with open(path, "rb") as file:
        is_in_parts = b'type="PUnstructuredGrid"' in file.read(4096)
    if is_in_parts:
        arrays = {array.get("Name"): array for array in ElementTree.parse(path).iterfind("*/FieldData/*")}
        words = {name: (array.text or "").split() for name, array in arrays.items() if array.get("format", "ascii") == "ascii"}
        try:
            root = list(map(float, words["root"])) if "root" in words else root if "root" in arrays else None
            if "digest" in words:
                # VTK reads text as the codes of its characters and a zero.
                *codes, zero = map(int, words["digest"])
                digest = bytes(codes).decode() or None
                if zero:
                    raise ValueError
            elif "digest" not in arrays:
                digest = None
        except ValueError:
            raise Refused("has a root or a digest that is not of numbers: it is damaged") from None
    return root if root is not None and len(root) == 4 else None, digest


def cubes(vertices):
    """Minimum corners, mean edges, whether each cell is a cube, and the order of its corners as one number, from the coordinates of
    vertices: [axis][vertex, cell]."""
    lows, highs = ([bound(axis, axis=0) for axis in vertices] for bound in (np.min, np.max))
    # Which corner of the cell a vertex is, as one bit: a cube has all eight.
    digits = np.zeros(vertices[0].shape, np.uint8)
    with np.errstate(all="ignore"):
        edge = sum(high - low for low, high in zip(lows, highs)) / 3
        is_cube = edge > 0
        for axis, (along, low, high) in enumerate(zip(vertices, lows, highs)):
            from_corner = np.minimum(along - low, high - along).max(axis=0)
            # Written so that NaN is no cube.
            is_cube &= (from_corner <= TOLERANCE * edge) & (np.abs(high - low - edge) <= TOLERANCE * edge)
            digits |= (along - low > high - along).astype(np.uint8) << axis
    is_cube &= np.bitwise_or.reduce(np.left_shift(np.uint8(1), digits), axis=0) == 255
    order = np.zeros(digits.shape[1], np.int64)
    for place, corners in enumerate(digits):
        order |= corners.astype(np.int64) << 3 * place
    return np.column_stack(lows), edge, is_cube, order


def of_hyper_trees(grid):
    """Corners and edges of the leaves of a hyper-tree grid, their indices in cell arrays, and the root."""
    if grid.GetDimension() != 3 or grid.GetBranchFactor() != 2:
        raise Refused(
            f"has {grid.GetDimension()} dimensions and branch factor {grid.GetBranchFactor()}: an oct-tree has 3 and 2"
        )
    axes = [vtk_to_numpy(axis) for axis in (grid.GetXCoordinates(), grid.GetYCoordinates(), grid.GetZCoordinates())]
    steps = [np.diff(np.asarray(axis, np.float64)) for axis in axes]
    edge = steps[0][0]
    # Written so that NaN is no edge.
    if not all((np.abs(step - edge) <= 1e-6 * edge).all() for step in steps):
        raise Refused("has trees that are not equal cubes")
    mask = vtk_to_numpy(grid.GetMask()).astype(bool) if grid.HasMask() else None
    shape = [len(step) for step in steps]
    parts = []
    for index in range(shape[0] * shape[1] * shape[2]):
        tree = grid.GetTree(index)
        if tree is None:
            continue
        origin = [0.0] * 3
        grid.GetLevelZeroOriginFromIndex(index, origin)
        corners, edges, nodes = leaves_of_tree(tree)
        if mask is not None:
            kept = ~mask[nodes]
            corners, edges, nodes = corners[kept], edges[kept], nodes[kept]
        parts.append((np.array(origin) + corners * edge, edges * edge, nodes))
    if not parts:
        raise Refused("has no trees")
    corners, edges, nodes = (np.concatenate(columns) for columns in zip(*parts))
    is_root = shape[0] == shape[1] == shape[2] and shape[0] & (shape[0] - 1) == 0
    root = {"origin": [float(axis[0]) for axis in axes], "edge": float(edge * shape[0])} if is_root else None
    return corners, edges, nodes, root


def leaves_of_tree(tree):
    """Corners and edges of the leaves in the unit cube, and their global indices."""
    depths, split, order = vtkTypeInt64Array(), vtkBitArray(), vtkIdList()
    tree.ComputeBreadthFirstOrderDescriptor(2**31 - 1, None, depths, split, order)
    counts = vtk_to_numpy(depths)
    bits = vtk_to_numpy(split).astype(bool)
    local = np.fromiter((order.GetId(i) for i in range(order.GetNumberOfIds())), np.int64, order.GetNumberOfIds())
    digits = np.array([[d & 1, d >> 1 & 1, d >> 2 & 1] for d in range(8)])
    octants, begin, parts = np.zeros((1, 3), np.int64), 0, []
    for level, count in enumerate(counts):
        is_split = np.zeros(count, bool)
        known = bits[begin : begin + count]
        is_split[: len(known)] = known
        leaves = ~is_split
        scale = 0.5**level
        parts.append((octants[leaves] * scale, np.full(leaves.sum(), scale), local[begin : begin + count][leaves]))
        octants = (2 * octants[is_split, None] + digits).reshape(-1, 3)
        begin += count
    return tuple(np.concatenate(columns) for columns in zip(*parts))


def cells(path, request):
    """Corners and edges of the cells in a file, and what else it states."""
    data, name = read(path), request["sides"]
    if data is not None and data.IsA("vtkHyperTreeGrid"):
        corners, edges, nodes, root = of_hyper_trees(data)
        digest, name = None, name or ("side" if is_own_tree(path) else None)
    elif data is not None and data.IsA("vtkUnstructuredGrid"):
        corners, edges = of_unstructured(data)
        nodes = np.arange(len(edges))
        root, digest = of_export(path, data, edges)
        if digest is not None:
            name = name or ("side" if data.GetCellData().HasArray("side") else None)
            # That of the leaves with the sides of the export, or with none.
            digest = digest if name in ("side", None) else None
    else:
        raise Refused(f"holds {data.GetClassName() if data else 'nothing'}: unstructured and hyper-tree grids are supported")
    ghosts = data.GetCellData().GetArray("vtkGhostType")
    if ghosts is not None:
        kept = vtk_to_numpy(ghosts)[nodes] & NOT_OF_MESH == 0
        corners, edges, nodes = corners[kept], edges[kept], nodes[kept]
    sides = cell_array(data, name)[nodes] if name else None
    return corners, edges, {"root": root, "digest": digest, "sides": sides}


if __name__ == "__main__":
    run(cells)
