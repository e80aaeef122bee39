"""Readers of the formats of the fetched geometries, and a writer of binary STL, with the standard library only.

A facet is a tuple of three vertices of three numbers. Polygons are triangulated as fans around their first corner.
"""

import math
import struct


def fan(corners):
    """The triangles of a polygon."""
    return [(corners[0], b, c) for b, c in zip(corners[1:], corners[2:])]


def stl_text(data):
    """The facets of ASCII STL with any number of solids."""
    lines = (line.split() for line in data.decode().splitlines())
    vertices = [tuple(map(float, words[1:4])) for words in lines if words[:1] == ["vertex"]]
    return list(zip(vertices[0::3], vertices[1::3], vertices[2::3]))


def off(data):
    """The facets of an Object File Format file: counts, vertices, polygons by vertex index."""
    words = iter(data.decode().split())
    assert next(words) == "OFF"
    vertices, polygons, _ = (int(next(words)) for _ in range(3))
    points = [tuple(float(next(words)) for _ in range(3)) for _ in range(vertices)]
    facets = []
    for _ in range(polygons):
        corners = [points[int(next(words))] for _ in range(int(next(words)))]
        facets += fan(corners)
    return facets


def obj(data):
    """The facets of a Wavefront file: `v` and `f` lines, indices from 1."""
    points, facets = [], []
    for line in data.decode().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append(tuple(map(float, words[1:4])))
        elif words[:1] == ["f"]:
            facets += fan([points[int(word.split("/")[0]) - 1] for word in words[1:]])
    return facets


def ac3d(data):
    """The facets of an AC3D file, a tree of objects that inherit the transformations of their ancestors.

    The y axis, which points up in AC3D, is mapped to the z axis.
    """
    lines = iter(data.decode(errors="replace").splitlines())
    assert next(lines).startswith("AC3D")
    facets = []
    for line in lines:
        if line.startswith("OBJECT"):
            ac3d_object(lines, IDENTITY, facets)
    return [tuple((x, -z, y) for x, y, z in facet) for facet in facets]


IDENTITY = ((1, 0, 0, 0, 1, 0, 0, 0, 1), (0, 0, 0))


def ac3d_object(lines, parent, facets):
    """Read an object and its children, after its OBJECT line, and append its facets. `parent` is a frame."""
    rotation, location, points = IDENTITY[0], IDENTITY[1], []
    for line in lines:
        key, _, rest = line.partition(" ")
        if key == "rot":
            rotation = tuple(map(float, rest.split()))
        elif key == "loc":
            location = tuple(map(float, rest.split()))
        elif key == "data":
            next(lines)
        elif key == "numvert":
            frame = composed(parent, rotation, location)
            points = [transformed(frame, map(float, next(lines).split()[:3])) for _ in range(int(rest))]
        elif key == "numsurf":
            for _ in range(int(rest)):
                facets += ac3d_surface(lines, points)
        elif key == "kids":
            frame = composed(parent, rotation, location)
            for _ in range(int(rest)):
                assert next(lines).startswith("OBJECT")
                ac3d_object(lines, frame, facets)
            return


def ac3d_surface(lines, points):
    """The facets of one surface: those of a polygon, none for a line."""
    kind = 0
    for line in lines:
        key, _, rest = line.partition(" ")
        if key == "SURF":
            kind = int(rest, 16) & 0xF
        elif key == "refs":
            corners = [points[int(next(lines).split()[0])] for _ in range(int(rest))]
            return fan(corners) if kind == 0 else []
    raise ValueError("the file ends within a surface")


def transformed(frame, point):
    """A point in the frame of an object, transformed to world coordinates. Vectors are rows, as in the format."""
    rotation, location = frame
    x, y, z = point
    return tuple(x * rotation[a] + y * rotation[3 + a] + z * rotation[6 + a] + location[a] for a in range(3))


def composed(parent, rotation, location):
    """The frame of an object with this rotation and location in the frame of its parent."""
    rows = [transformed((parent[0], (0, 0, 0)), rotation[3 * row : 3 * row + 3]) for row in range(3)]
    return tuple(x for row in rows for x in row), transformed(parent, location)


def single(x):
    """The nearest f32."""
    return struct.unpack("<f", struct.pack("<f", x))[0]


def normal(p, q, r):
    """The unit normal by the right-hand rule; zero for a facet without area."""
    u = [q[a] - p[a] for a in range(3)]
    v = [r[a] - p[a] for a in range(3)]
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    return [x / (length or 1.0) for x in n]


def stl_binary(facets):
    """Binary STL with a header of zeros and normals computed from the vertices in f32."""
    records = []
    for facet in facets:
        facet = [tuple(map(single, vertex)) for vertex in facet]
        numbers = (*normal(*facet), *facet[0], *facet[1], *facet[2])
        records.append(struct.pack("<12fH", *numbers, 0))
    return bytes(80) + struct.pack("<I", len(records)) + b"".join(records)


READERS = {"stl": stl_text, "off": off, "obj": obj, "ac3d": ac3d}
