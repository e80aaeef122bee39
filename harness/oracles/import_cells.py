"""Reads a mesh of cubes in a table, in discretize's formats or in OpenFOAM's, for `harness import`. `imports` describes how it is called."""

import itertools
import json
import pathlib
import re
import warnings

import numpy as np

from imports import LEVEL_MAX, TOLERANCE, Refused, run


def numbers(text, kind=np.float64):
    """The numbers in a text, up to the first word that is none."""
    if not text.strip():  # NumPy finds a number in it.
        return np.empty(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return np.fromstring(text, kind, sep=" ")
        except ValueError as why:
            raise Refused(f"has a word where a number belongs: {why}") from None


# Tables.


def table(path, request):
    """A table of either form: the first bytes of NumPy's are known."""
    with open(path, "rb") as file:
        return (npy if file.read(6) == b"\x93NUMPY" else csv)(path, request)


def npy(path, request):
    """A NumPy array: structured, or with the columns x, y, z, level, 4, 5, ..."""
    try:
        array = np.load(path, allow_pickle=False)
    except (MemoryError, OSError):
        raise
    except Exception as why:  # A damaged header can raise any.
        raise Refused(f"is no array of NumPy: {why}") from None
    if not isinstance(array, np.ndarray):
        raise Refused("is an archive of arrays, not one")
    if array.dtype.names and array.ndim == 1:
        columns = {name: array[name] for name in array.dtype.names}
    elif array.ndim == 2 and array.shape[1] >= 4:
        columns = named(array.T)
    else:
        raise Refused(f"has shape {array.shape}: a table of cells is structured, or has rows and at least four columns")
    for name, column in columns.items():
        if column.ndim != 1 or column.dtype.kind not in "iuf":
            raise Refused(f"has a column {name} of type {column.dtype}: convert it to float64 or to integers")
    return rows([(name, column.astype(np.float64)) for name, column in columns.items()], request)


def csv(path, request):
    """Lines of fields, separated by commas, or by semicolons or white space. A first line that is not numeric names the columns, and so does a
    comment before it with as many words as there are fields, x, y and z among them, as NumPy writes it. Other lines that begin with # are comments."""
    text = read_text(path)
    for number, line in enumerate(text.splitlines(), 1):
        data = line.partition("#")[0]
        fields = [field.strip() for field in data.split(",")]
        if data.strip(" \t,;") and any(not field.strip() for mark in ",;" for field in data.split(mark)[:-1]):
            raise Refused(f"has an empty field in line {number}: fill it in, or remove it")
        quoted = "".join(line.split('"')[1::2]) if '"' in line else ""
        if "," in quoted or len(fields) > 1 and any(re.search(r"[;\s]", field) for field in fields):
            raise Refused(f"has decimal commas or several separators in line {number}: write decimal points and one separator")
    lines = [line.strip() for line in text.translate(str.maketrans(",;", "  ", '"')).splitlines() if line.strip()]
    comments = list(itertools.takewhile(lambda line: line.startswith("#"), lines))
    lines = [line for line in lines if not line.startswith("#")]
    names = lines[0].split() if lines else []
    is_named = bool(names) and not is_number(names[0])
    cells = lines[is_named:]
    if not cells:
        raise Refused("has no cells")
    if not is_named:
        names = named_in(comments, len(names)) or names
        is_named = not is_number(names[0])
    try:
        columns = np.loadtxt(cells, ndmin=2, comments=None).T
    except ValueError as why:
        # NumPy goes on with remedies of its own.
        why = str(why).partition("; use")[0]
        raise Refused(f"is no table of numbers: {why} (comments and the names of columns do not count)") from None
    if is_named and len(names) != len(columns):
        raise Refused(f"has {len(columns)} fields in a line, but {len(names)} names of columns")
    return rows(list(zip(names, columns)) if is_named else named(columns).items(), request)


def named_in(comments, count):
    """The names of this many columns that a comment states, if one does. Refuses comments that state another order than x y z level in another form."""
    stated = [words for words in (comment.lstrip("#").split() for comment in comments) if len(words) == count]
    for words in reversed(stated):
        if {"x", "y", "z"} <= {word.lower() for word in words}:
            return words
    for comment in comments:
        order = [word for word in re.findall(r"[a-z]+", comment.lower()) if word in ("x", "y", "z", "level", "edge")]
        if {"x", "y", "z"} <= set(order) and order[:4] not in (["x", "y", "z"], ["x", "y", "z", "level"]):
            raise Refused(f"has a comment that is no list of {count} names: {comment}. Give one word per column, such as # {' '.join(order)}")
    # Other names, which are refused, if they are all that the last comment says.
    last = comments[-1].lstrip("#").split() if comments else []
    return last if last in stated and not any(map(is_number, last)) else None


def is_number(field):
    try:
        return bool(float(field)) or True
    except ValueError:
        return False


def read_text(path):
    try:
        return pathlib.Path(path).read_text("utf-8-sig")
    except UnicodeDecodeError:
        raise Refused("is not text in UTF-8") from None


def named(columns):
    """The columns of a table without names."""
    return dict(zip(["x", "y", "z", "level", *map(str, range(4, len(columns)))], columns))


def rows(columns, request):
    """The cells of a table of x, y and z, and either level or edge."""
    names = [name.lower() for name, _ in columns]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise Refused(f"has more than one column {twice}: rename or remove the others")
    columns = dict(zip(names, (column for _, column in columns)))

    def column(name):
        if name.lower() not in columns:
            raise Refused(f"has no column {name}: its columns are {', '.join(columns)}")
        return columns[name.lower()]

    position, root, sides = request["position"], None, request["sides"]
    at = np.column_stack([column(axis) for axis in "xyz"])
    if not len(at):
        raise Refused("has no cells")
    if "level" not in columns and "edge" in columns:
        if position == "index":
            raise Refused("positions by index need a column level")
        edges = columns["edge"]
    else:
        level = column("level")
        root = request["root"]
        if root is None:
            raise Refused("has a column level, which needs a root: give it with --root X,Y,Z,EDGE or --case CASE")
        wrong = np.flatnonzero(~((level >= 0) & (level <= LEVEL_MAX) & (level % 1 == 0)))
        if len(wrong):
            raise Refused(f"cell {wrong[0]} has the level {level[wrong[0]]}, and levels are whole numbers from 0 to {LEVEL_MAX}")
        edges = root["edge"] / 2.0**level
        wrong = np.flatnonzero(~(np.abs(columns.get("edge", edges) / edges - 1) <= TOLERANCE))
        if len(wrong):
            cell = wrong[0]
            raise Refused(f"cell {cell} has the level {level[cell]:.0f}, which is an edge of {edges[cell]}, and the edge {columns['edge'][cell]}")
    if position == "index":
        at = np.array(root["origin"]) + at * edges[:, None]
    elif position == "centre":
        at = at - edges[:, None] / 2
    return at, edges, {"root": root, "sides": column(sides) if sides else None}


# discretize's TreeMesh: the smallest cells must be equal cubes, whose numbers along the axes may differ. The root is the least cube with
# the same origin whose edge is a power of two of them.

# Rounding errors of `write_UBC`: half a unit of the last decimal of the corner, and of the smallest edge.
ROUNDING_CORNER, ROUNDING_EDGE = 0.5e-4, 0.5e-3


def discretize(path, request):
    """The JSON of `save`, or the text of `write_UBC`."""
    if request["sides"]:
        raise Refused("discretize's file has no named cell arrays: omit --sides")
    text = read_text(path)
    return of_json(text) if text.lstrip().startswith("{") else of_ubc(text, request["root"])


def grid(shape, origin, edges):
    """The root of smallest cells, of which there are `shape` with these edges along the axes."""
    edge, origin = edges[0], list(map(float, origin))
    if not np.isfinite(origin).all():
        raise Refused(f"has the corner {origin}: coordinates must be finite")
    if not (np.isfinite(edges).all() and edge > 0) or (np.abs(np.subtract(edges, edge)) > 1e-6 * edge).any():
        raise Refused(f"has smallest cells with the edges {list(map(float, edges))}: only cubes can be leaves of an oct-tree")
    if min(shape) < 1 or max(shape) > 2**LEVEL_MAX:
        raise Refused(f"has {list(shape)} smallest cells along the axes, and from 1 to {2**LEVEL_MAX} are possible")
    return {"origin": origin, "edge": float(edge) * 2 ** (int(max(shape)) - 1).bit_length()}


def whole(given):
    """An array of integers."""
    array = np.array(given)
    if array.dtype.kind != "i":
        raise ValueError("indexes and levels of cells must be whole numbers")
    return array.astype(np.int64)


def of_json(text):
    """The centre of each cell in halves of smallest cells, and its level."""
    try:
        mesh = json.loads(text)
        widths = [np.array(h, float) for h in mesh["h"]]
        origin = np.array(mesh["origin"] if "origin" in mesh else mesh["x0"], float)
        centres, levels = (whole(mesh["cell_state"][name]) for name in ("indexes", "levels"))
        centres = centres.reshape(-1, 3)
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as why:
        raise Refused(f"is not a three-dimensional TreeMesh in JSON: {why}") from None
    if len(widths) != 3 or origin.shape != (3,) or any(w.ndim != 1 or not len(w) for w in widths):
        raise Refused("has a number of dimensions other than three")
    if levels.shape != (len(centres),):
        raise Refused(f"has {len(centres)} indexes of cells and {levels.size} levels")
    for axis, along in enumerate(widths):
        other = along[np.abs(along - along[0]) > 1e-6 * along[0]]
        if len(other):
            raise Refused(f"has widths {along[0]} and {other[0]} along {'xyz'[axis]}: an oct-tree of cubes has equal smallest cells")
    shape = [len(along) for along in widths]
    root = grid(shape, origin, [along[0] for along in widths])
    wrong = np.flatnonzero(((centres < 1) | (centres >= 2 * np.array(shape))).any(axis=1))
    if len(wrong):
        raise Refused(f"has cell {wrong[0]} with the indexes {centres[wrong[0]].tolist()}, beyond {shape} smallest cells along the axes")
    # A centre is an odd number of half edges from the origin, so its lowest bit gives the edge.
    edges = centres[:, 0] & -centres[:, 0]
    corners = origin + (centres - edges[:, None]) / 2 * widths[0][0]
    return corners, edges * widths[0][0], {"root": root, "levels": levels}


def of_ubc(text, requested):
    """The number of smallest cells along the axes, the top south-west corner, the edges of the smallest cell, the number of cells, and per
    cell its first index along each axis, from 1 and from the top downward along z, and its edge in smallest cells. The text rounds: a
    requested root that agrees with the rounded one replaces it."""
    lines = [line for line in (line.split("!")[0].strip() for line in text.splitlines()) if line]
    if len(lines) < 4:
        raise Refused("ends before the number of cells: it is not a UBC oct-tree mesh")
    # The first line may continue with the extent of a core region.
    shape, origin, edges, counted = (numbers(line) for line in lines[:4])
    if not (len(shape) >= 3 and len(origin) == len(edges) == 3 and len(counted) == 1):
        raise Refused("has a head that is not that of a UBC oct-tree mesh: three sizes, three coordinates, three edges, a number of cells")
    shape = shape[:3].tolist()
    if not all(n.is_integer() for n in shape):
        raise Refused(f"has {shape} smallest cells along the axes")
    rows = numbers(" ".join(lines[4:]))
    if any(len(line.split()) != 4 for line in lines[4:]) or len(rows) != 4 * counted[0]:
        raise Refused(f"states {counted[0]:.0f} cells and has {len(lines) - 4} lines, of four numbers each: these must agree")
    i, j, k, sizes = rows.reshape(-1, 4).T
    edge = edges[0]
    root = grid([int(n) for n in shape], [*origin[:2], origin[2] - shape[2] * edge], edges.tolist())
    if requested:
        along, moved = root["edge"] / edge, np.abs(np.subtract(requested["origin"], root["origin"]))
        vertical = ROUNDING_CORNER + shape[2] * ROUNDING_EDGE
        agrees = moved <= 1.001 * np.array([ROUNDING_CORNER, ROUNDING_CORNER, vertical])
        if agrees.all() and abs(requested["edge"] - root["edge"]) <= 1.001 * along * ROUNDING_EDGE:
            root, edge = requested, requested["edge"] / along
    first = np.column_stack([i - 1, j - 1, shape[2] + 1 - k - sizes])
    return np.array(root["origin"]) + first * edge, sizes * edge, {"root": root}


# OpenFOAM meshes (constant/polyMesh), ASCII or binary. A cell is given by its faces, of which a hanging node makes some polygons with more
# than four vertices, and splits others in four. It is a cube if its points fill a cube's bounds and its faces are closed and enclose the
# cube's volume.


class Foam:
    """A file whose dictionary FoamFile has been read."""

    def __init__(self, path):
        if not path.exists() and path.with_name(f"{path.name}.gz").exists():
            raise Refused(f"{path}.gz: is compressed: decompress it with gunzip")
        self.path, data = path, path.read_bytes()
        head = re.match(rb"(?:\s|//[^\n]*|/\*.*?\*/)*FoamFile\s*\{(.*?)\}", data, re.DOTALL)
        if not head:
            self.refuse("does not begin with a dictionary FoamFile")
        found = re.findall(rb'(\w+)\s+(?:"([^"]*)"|([^";]*))\s*;', head[1])
        entries = {key: quoted or plain for key, quoted, plain in found}
        self.is_binary, self.kind = entries.get(b"format") == b"binary", entries.get(b"class")
        architecture = entries.get(b"arch", b"").decode(errors="replace")
        for field in map(str.strip, architecture.split(";")):
            if field not in ("LSB", "label=32", "label=64", "scalar=32", "scalar=64", ""):
                self.refuse(f"has the architecture {field}, which is not supported")
        self.label = np.dtype("<i8" if "label=64" in architecture else "<i4")
        self.scalar = np.dtype("<f4" if "scalar=32" in architecture else "<f8")
        self.data = data[head.end() :]
        if not self.is_binary:
            self.data = re.sub(rb"//[^\n]*|/\*.*?\*/", b" ", self.data, flags=re.DOTALL)

    def refuse(self, why):
        raise Refused(f"{self.path}: {why}") from None

    def blanks(self):
        """Skips white space and comments before a binary list."""
        self.data = self.data[re.match(rb"(?:\s|//[^\n]*|/\*.*?\*/)*", self.data, re.DOTALL).end() :]

    def list(self, kind, width=1):
        """The next list, of items of `width` numbers. In ASCII it is `N(...)`, or `N{value}` if all items are equal; a binary one is `N`,
        white space, `(`, the items without separators, `)`."""
        self.blanks()
        count = re.match(rb"(\d{1,18})\s*", self.data)
        if not count:
            self.refuse("has no list where one belongs: it is incomplete")
        rest, count = self.data[count.end() :], int(count[1])
        if self.is_binary:
            size = count * width * kind.itemsize
            if count and (rest[:1] != b"(" or rest[size + 1 : size + 2] != b")"):
                self.refuse(f"states {count} items, but has only {len(rest)} bytes for them, or no parentheses: it is incomplete or damaged")
            self.data = rest[size + 2 :] if count else rest.removeprefix(b"()")
            return np.frombuffer(rest[1 : size + 1], kind) if count else np.empty(0, kind)
        uniform = re.match(rb"\{([^}]*)\}", rest)
        if uniform:
            self.data = rest[uniform.end() :]
            return np.full(count, numbers(uniform[1], kind)[0] if uniform[1].strip() else self.refuse("has no value"), kind)
        end = rest.find(b")") if width == 1 else len(rest)
        values = numbers(rest[:end].translate(bytes.maketrans(b"()", b"  ")), kind)
        if rest[:1] != b"(" or len(values) != count * width:
            self.refuse(f"states {count} items and has {len(values) // width}: it is incomplete")
        self.data = rest[end + 1 :]
        return values

    def labels(self, length=None):
        """A list of labels; below `length`, if that is given."""
        labels = self.list(self.label if self.is_binary else np.dtype(np.int64)).astype(np.int64)
        wrong = np.flatnonzero((labels < 0) | (labels >= length)) if length is not None else []
        if len(wrong):
            self.refuse(f"has {labels[wrong[0]]} as item {wrong[0]}, where {length} objects are possible")
        return labels

    def points(self):
        return self.list(self.scalar if self.is_binary else np.dtype(float), 3).reshape(-1, 3).astype(float)

    def faces(self, points):
        """Where the vertices of each face begin, with the end, and all vertices."""
        if self.kind == b"faceCompactList":
            begins, vertices = self.labels(), self.labels(points)
            if not len(begins) or begins[0] != 0 or begins[-1] != len(vertices) or (np.diff(begins) < 1).any():
                self.refuse("has positions of faces that do not ascend from 0 to the number of labels")
            return begins, vertices
        if self.is_binary:
            self.refuse(f"is a binary {self.kind}, and faceCompactList is supported")
        sizes = np.array(re.findall(rb"(\d{1,18})\s*\(", self.data), np.int64)
        values = numbers(self.data.translate(bytes.maketrans(b"()", b"  ")), np.int64)
        if not len(sizes) or len(sizes) != sizes[0] + 1 or (sizes[1:] < 1).any() or len(values) != len(sizes) + sizes[1:].sum():
            self.refuse("has faces that are not as many, or not as long, as it states: it is incomplete")
        begins = np.concatenate([[0], np.cumsum(sizes[1:])])
        vertices = np.delete(values, np.concatenate([[0], begins[:-1] + np.arange(1, len(sizes))]))
        if vertices.min(initial=0) < 0 or vertices.max(initial=0) >= points:
            self.refuse(f"has a vertex that is none of {points} points")
        return begins, vertices


def cells_noted(mesh):
    """The number of cells that a mesh notes at the head of its owners, which OpenFOAM writes; 0 if it does not."""
    with open(mesh / "owner", "rb") as owner:
        noted = re.search(rb"nCells:\s*(\d+)", owner.read(4096))
    return int(noted[1]) if noted else 0


def refuse_others(at):
    """The mesh in the directory `constant` of a case may be the one that another was made of, in a directory of a time or in those of processors."""
    times = [file.parent for file in at.parent.parent.glob("[0-9]*/polyMesh/faces*")]
    parts = [file.parent for file in at.parent.parent.glob("processor*/constant/polyMesh/owner")]
    is_whole = sum(map(cells_noted, parts)) in (0, cells_noted(at))
    others = sorted(map(str, times + ([] if is_whole else parts)))
    if others:
        raise Refused(f"has another mesh than {at}, {others[-1]}: give the directory polyMesh that is meant, and reconstruct a decomposed mesh")


def openfoam(path, request):
    """A mesh in a directory. Sides are a list of labels in it; `cellLevel`, if there is one, must agree with the edges."""
    at = pathlib.Path(path)
    points = Foam(at / "points").points()
    begins, vertices = Foam(at / "faces").faces(len(points))
    if request.get("is_case") and at.resolve().parent.name == "constant":
        refuse_others(at.resolve())
    faces = len(begins) - 1
    # A cell has at least four faces, and a face at most two cells.
    owners, neighbours = (Foam(at / name).labels(faces // 2 + 1) for name in ("owner", "neighbour"))
    # The last cell need not own a face.
    count = int(max(owners.max(initial=-1), neighbours.max(initial=-1))) + 1
    if len(owners) != faces or len(neighbours) > faces:
        raise Refused(
            f"has {faces} faces with {len(owners)} owners and {len(neighbours)} neighbours: its files belong to different meshes"
        )

    def per_cell(name):
        labels = Foam(at / name).labels()
        if len(labels) != count:
            raise Refused(f"{at / name}: has {len(labels)} labels for {count} cells")
        return labels

    corners, edges = cubes(points, begins, vertices, owners, neighbours, count)
    levels = per_cell("cellLevel") if (at / "cellLevel").is_file() else None
    return corners, edges, {"levels": levels, "sides": per_cell(request["sides"]) if request["sides"] else None}


def cubes(points, begins, vertices, owners, neighbours, count):
    """Minimum corners and edges of the cells with these faces, all of which must be cubes."""
    if count == 0:
        raise Refused("has no cells")
    starts, first = begins[:-1], points[vertices[begins[:-1]]]
    at = points[vertices]
    lows, highs = (bound.reduceat(at, starts) for bound in (np.minimum, np.maximum))
    # Twice the area of each polygon: the triangles of a fan around its first vertex.
    arms = at - np.repeat(first, np.diff(begins), axis=0)
    areas = np.add.reduceat(np.cross(arms, np.roll(arms, -1, axis=0)), starts)
    # The faces of each cell: those of which it is the owner, and those that point into it.
    cells = np.concatenate([owners, neighbours])
    face = np.concatenate([np.arange(len(owners)), np.arange(len(neighbours))])
    signs = np.repeat([1.0, -1.0], [len(owners), len(neighbours)])
    order = np.argsort(cells, kind="stable")
    cells, face, signs = cells[order], face[order], signs[order]
    of_cell = np.searchsorted(cells, np.arange(count + 1))
    if (np.diff(of_cell) == 0).any():
        raise Refused(f"has no faces of cell {np.flatnonzero(np.diff(of_cell) == 0)[0]}")
    low, high = np.minimum.reduceat(lows[face], of_cell[:-1]), np.maximum.reduceat(highs[face], of_cell[:-1])
    with np.errstate(all="ignore"):
        # Relative to a corner of the cell, which keeps the digits that coordinates far from the origin would lose.
        heights = ((first[face] - low[cells]) * areas[face]).sum(axis=1) * signs / 6
        extents, volumes = high - low, np.add.reduceat(heights, of_cell[:-1])
        edges = extents.mean(axis=1)
        is_long = (np.abs(extents - edges[:, None]) <= TOLERANCE * edges[:, None]).all(axis=1)
        parts = volumes / edges**3
        # A missing face at a low side encloses no volume, but leaves the sum open by at least the least face of an oct-tree's cell.
        sizes = np.linalg.norm(areas, axis=1)[face]
        gaps = np.linalg.norm(np.add.reduceat(areas[face] * signs[:, None], of_cell[:-1]), axis=1)
        outlines = np.add.reduceat(sizes, of_cell[:-1]) / (12 * edges**2)
        is_closed = (gaps <= np.minimum.reduceat(sizes, of_cell[:-1]) / 2) & (np.abs(outlines - 1) <= 2 * TOLERANCE)
    is_full = np.abs(parts - 1) <= 3 * TOLERANCE
    wrong = np.flatnonzero(~(is_long & is_full & is_closed))
    if len(wrong):
        cell = wrong[0]
        why = f"its faces, with {outlines[cell]:.3f} of a cube's area, do not close it"
        why = why if is_full[cell] else f"its faces enclose {parts[cell]:.3f} of the volume of its bounds"
        why = why if is_long[cell] else f"its bounds have the edges {extents[cell].tolist()}"
        raise Refused(f"cell {cell} (corner {low[cell].tolist()}) is not a cube: {why}")
    return low, edges


READERS = {"table": table, "discretize": discretize, "openfoam": openfoam}

if __name__ == "__main__":
    run(lambda path, request: READERS[request["format"]](path, request))
