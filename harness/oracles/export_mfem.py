"""Writes the forest of `harness export` as a mesh of MFEM with hanging nodes, for `harness export MESH FILE.mfem`.

    python export_mfem.py FOREST FILE

FOREST is the .p8est file of one tree, whose quadrants have one byte of data. FILE is in MFEM's format "NC mesh v1.0" (MFEM, "Mesh Formats"): all octants
with their children, the vertices of leaves, and for each vertex but the root's corners the two between which it was made. The attribute of an element is
1 + its data: 1 outside, 2 inside, 3 crossing, 4 for what the mesh or the selection leaves out, 5 where the sides are unknown. Boundary attributes are
those of MFEM's Cartesian meshes: 1 zMin, 2 yMin, 3 xMax, 4 yMax, 5 xMin, 6 zMax.

Exit codes: 0 success; 3 a package cannot be imported.
"""

import sys

try:
    import numpy as np
except ImportError as error:
    print(error, file=sys.stderr)
    raise SystemExit(3) from None

# Coordinates of a .p8est file are in units of 1 / 2^19 of the root's edge.
DEPTH = 19
# Corners of a hexahedron, and those of its faces, in MFEM's order. Children are numbered like corners.
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
FACES = [(3, 2, 1, 0), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)]
HEXAHEDRON, SQUARE, SPLIT_XYZ = 5, 3, 7
BITS = DEPTH + 1
# Lines that are formatted at a time.
BLOCK = 1 << 16


def forest(path):
    """Minimum corners, levels and data of the quadrants, and the minimum corner and the edge of the root."""
    data = np.fromfile(path, np.uint8)
    ints = lambda at, count: data[at : at + 8 * count].view("<u8").astype(int)
    aligned = lambda at: -(-at // 32) * 32
    vertices = data[32 + 80 : 32 + 80 + 192].view("<f8").reshape(8, 3)
    header = aligned(32 + 80 + 192 + 32 + 24 + 6 + ints(32, 10)[8] + 8)
    parts = ints(header, 6)[5]
    count = ints(header + 8 * (6 + parts), 1)[0]
    begin = aligned(header + 8 * (7 + parts))
    record = np.dtype([("corner", "<i4", 3), ("level", "<i4"), ("data", "u1")])
    quadrants = data[begin : begin + count * record.itemsize].view(record)
    return quadrants["corner"].astype(np.int64), quadrants["level"].astype(int), quadrants["data"].astype(int), vertices[0], vertices[7]


def packed(points):
    """Points as single numbers."""
    return points[..., 0] | points[..., 1] << BITS | points[..., 2] << 2 * BITS


def unpacked(codes):
    return np.stack([codes >> BITS * axis & (1 << BITS) - 1 for axis in range(3)], axis=-1)


def found(codes, wanted):
    """Positions in sorted codes, in which all that is wanted must be."""
    at = np.searchsorted(codes, wanted)
    assert (codes[np.minimum(at, len(codes) - 1)] == wanted).all(), "an octant or a vertex is missing"
    return at


def parents(points):
    """The two vertices between which each vertex was made: ends of an edge, middles of two edges of a face, or of two faces of an octant."""
    bits = points[:, 0] | points[:, 1] | points[:, 2]
    step = bits & -bits
    axis = 2 - np.argmax((points & step[:, None] != 0)[:, ::-1], axis=1)
    shift = np.eye(3, dtype=np.int64)[axis] * step[:, None]
    return packed(points - shift), packed(points + shift)


def lines(file, columns):
    rows = np.column_stack(columns)
    for begin in range(0, len(rows), BLOCK):
        file.writelines(" ".join(map(str, row)) + "\n" for row in rows[begin : begin + BLOCK].tolist())


def elements(file, corners, levels, attributes, nodes):
    """All octants by level: number 0 is the root."""
    codes, first = packed(corners), 1
    file.write(f"elements\n{len(codes) + (len(codes) - 1) // 7}\n")
    for level in range(levels.max() + 1):
        size = 1 << DEPTH - level
        deeper = corners[levels > level]
        split = np.unique(packed(deeper & -size))
        is_leaf = levels == level
        octants = np.concatenate([split, codes[is_leaf]])
        order = np.argsort(octants)
        below = np.unique(packed(deeper & -(size >> 1)))
        children = found(below, packed(unpacked(split)[:, None] + CORNERS * (size >> 1))) if len(split) else np.zeros((0, 8), int)
        rows = np.zeros((len(octants), 12), int)
        rows[:, 2] = HEXAHEDRON
        rows[: len(split), 1], rows[: len(split), 3] = 1, SPLIT_XYZ
        rows[: len(split), 4:] = first + children
        rows[len(split) :, 1] = attributes[is_leaf]
        rows[len(split) :, 4:] = nodes[is_leaf]
        lines(file, [rows[order]])
        first += len(below)


def boundary(file, corners, sizes, nodes):
    rows = []
    for attribute, face in enumerate(FACES, 1):
        offsets = CORNERS[list(face)]
        axis = int(np.argmax((offsets == offsets[0]).all(axis=0)))
        high = offsets[0][axis]
        at = corners[:, axis] + sizes * high == high << DEPTH
        rows.append(np.column_stack([np.full(at.sum(), attribute), np.full(at.sum(), SQUARE), nodes[at][:, face]]))
    rows = np.concatenate(rows)
    file.write(f"\nboundary\n{len(rows)}\n")
    lines(file, [rows])


def write(source, file):
    corners, levels, data, low, high = forest(source)
    sizes = 1 << DEPTH - levels
    vertices, nodes = np.unique(packed(corners[:, None] + CORNERS * sizes[:, None, None]), return_inverse=True)
    # The root's corners come first.
    is_root = np.zeros(len(vertices), bool)
    roots = found(vertices, packed(CORNERS << DEPTH))
    is_root[roots] = True
    number = np.empty(len(vertices), int)
    number[roots] = range(8)
    number[~is_root] = range(8, len(vertices))
    nodes = number[nodes].reshape(-1, 8)

    file.write("MFEM NC mesh v1.0\n\ndimension\n3\n\n# rank, attribute, geometry, 0 and nodes, or 7 and children\n")
    elements(file, corners, levels, data + 1, nodes)
    boundary(file, corners, sizes, nodes)
    made = [number[found(vertices, codes)] for codes in parents(unpacked(vertices[~is_root]))]
    file.write(f"\nvertex_parents\n{len(vertices) - 8}\n")
    lines(file, [number[~is_root], *made])
    file.write("\ncoordinates\n8\n3\n")
    lines(file, [np.where(CORNERS, high, low)])
    file.write("\nmfem_mesh_end\n")


if __name__ == "__main__":
    with open(sys.argv[2], "x") as file:
        write(sys.argv[1], file)
