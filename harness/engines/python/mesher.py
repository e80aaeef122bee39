"""An oct-tree mesher on a dense grid: each step of reference/DEFINITION.md as operations on whole arrays, for coarse
levels. It is the example of an external program that `harness verify --engine python` verifies."""

import argparse
import json
import sys
import tomllib
from pathlib import Path

import numpy as np

UNITS = 1 << 27  # lattice units along an edge of the root
OUTSIDE, INSIDE, CROSSING = 0, 1, 2


def read_stl(path):
    """The vertices of an STL file, binary or ASCII, as float64 of shape (facets, 3, 3)."""
    data = path.read_bytes()
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        return np.frombuffer(data[84:], facet)["corners"].astype(np.float64)
    corners = [line.split()[1:] for line in data.decode().splitlines() if line.split()[:1] == ["vertex"]]
    return np.array(corners, "f4").reshape(-1, 3, 3).astype(np.float64)


def level_for(edge, spacing):
    """The level of a spacing in a root with this edge (section 1)."""
    return next(level for level in range(20) if edge / 2**level <= spacing)


def pool(grid, level):
    """For each cell of a coarser level, whether any cell within it is set."""
    n, f = 1 << level, grid.shape[0] >> level
    return grid.reshape(n, f, n, f, n, f).any(axis=(1, 3, 5))


def spread(grid, size):
    """The values of a coarser level on a grid of `size` cells along each axis."""
    f = size // grid.shape[0]
    return grid.repeat(f, 0).repeat(f, 1).repeat(f, 2)


def dilate(grid, by):
    """The cells within a Chebyshev distance of `by` cells of a set cell."""
    for axis in range(3):
        old, new = np.moveaxis(grid, axis, 0), np.moveaxis(grid := grid.copy(), axis, 0)
        for step in range(1, min(by, len(old) - 1) + 1):
            new[step:] |= old[:-step]
            new[:-step] |= old[step:]
    return grid


def crossed(facet, edge, size):
    """The cells that a facet crosses, as index arrays: separating axes in integer arithmetic (section 2)."""
    low = np.clip(-(-facet.min(0) // edge) - 1, 0, size)
    high = np.clip(facet.max(0) // edge, -1, size - 1)
    cells = np.stack(np.meshgrid(*map(np.arange, low, high + 1), indexing="ij"), -1).reshape(-1, 3)
    corners = 2 * facet[None] - (2 * cells * edge + edge)[:, None]  # doubled, relative to the centre of the cell
    edges = facet[[1, 2, 0]] - facet
    meets = np.ones(len(cells), bool)
    for a in range(3):
        u, v = (a + 1) % 3, (a + 2) % 3
        for e in edges:
            along = corners[..., v] * e[u] - corners[..., u] * e[v]
            reach = edge * (abs(e[u]) + abs(e[v]))
            meets &= (along.min(1) <= reach) & (along.max(1) >= -reach)
    normal = np.cross(edges[0], edges[1]).astype(object)  # Python integers, as the products exceed 64 bits
    along = (corners[:, 0].astype(object) * normal).sum(1) if len(cells) else np.zeros(0)
    return tuple(cells[meets & (abs(along) <= edge * abs(normal).sum()).astype(bool)].T)


def rays(point, facets):
    """For each of the six rays from a point, whether it votes inside (section 4)."""
    votes = []
    normals = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    for a in range(3):
        u, v = (a + 1) % 3, (a + 2) % 3
        d = facets[:, [1, 2, 0]] - facets
        area = d[..., u] * (point[v] - facets[..., v]) - d[..., v] * (point[u] - facets[..., u])
        sign = np.sign(np.where(area != 0, area, np.where(d[..., v] != 0, -d[..., v], d[..., u])))
        met = (normals[:, a] != 0) & (abs(sign.sum(1)) == 3)
        to = ((facets[met, 0] - point).astype(object) * normals[met].astype(object)).sum(1)
        above = sum(1 for t, n in zip(to, normals[met, a]) if (t > 0) == (n > 0))
        votes += [above % 2 == 1, (met.sum() - above) % 2 == 1]
    return votes


def flood(region, free):
    """The free cells that are connected to the region by faces, including the region."""
    while True:
        count = region.sum()
        for axis in range(3):
            r, f = np.moveaxis(region, axis, 0), np.moveaxis(free, axis, 0)
            for i in range(1, len(r)):
                r[i] |= r[i - 1] & f[i]
            for i in range(len(r) - 2, -1, -1):
                r[i] |= r[i + 1] & f[i]
        if region.sum() == count:
            return region


def words_of(level, side, chosen):
    """The sorted leaf words (section 8) of the leaves in the chosen cells."""
    size, words = level.shape[0], [np.zeros(0, np.uint64)]
    for l in range(int(level.max()) + 1):
        index = np.argwhere(pool((level == l) & chosen, l))
        corner, key = (index << (19 - l)).astype(np.uint64), np.zeros(len(index), np.uint64)
        for bit in range(19):
            for a in range(3):
                key |= (corner[:, a] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + a)
        sides = side[tuple((index * (size >> l)).T)].astype(np.uint64)
        words.append(key << np.uint64(7) | np.uint64(l << 2) | sides)
    return np.sort(np.concatenate(words))


def centroid(word):
    """The centroid of a leaf, in lattice units."""
    half = UNITS >> (word >> 2 & 31) + 1
    return [256 * sum((word >> (7 + 3 * bit + a) & 1) << bit for bit in range(19)) + half for a in range(3)]


def at_boundary(component):
    """Whether a component has a face on the root's boundary."""
    return any(face.any() for a in range(3) for face in np.moveaxis(component, a, 0)[[0, -1]])


def sides(level, crossing, facets, root, flow, deletes_enclosed):
    """The side of every cell, by the cells with seeds, `flow`, or by rays (section 4); the cells that are enclosed
    (section 5); and the entries of the manifest about components."""
    seeds, flow_side = flow
    side = np.where(crossing, CROSSING, OUTSIDE).astype(np.uint8)
    unassigned, firsts, outside = ~crossing, [], []
    to_user = lambda c: [o + c * (root["edge"] / UNITS) for o, c in zip(root["origin"], c)]
    key = lambda word: (word >> 2 & 31, word)
    count = 0
    while unassigned.any():
        seed = np.zeros_like(unassigned)
        seed.flat[unassigned.argmax()] = True
        component = flood(seed, unassigned)
        leaves, total, count = sorted(map(int, words_of(level, side, component)), key=key), [], count + 1
        for word in leaves[:32]:
            if seeds:
                inside = any(component[seed] for seed in seeds) == (flow_side == INSIDE)
                break
            votes = rays(np.array(centroid(word)), facets)
            total += votes
            if len(set(votes)) == 1:
                inside = votes[0]
                break
        else:
            inside = 2 * sum(total) > len(total)
            firsts.append(leaves[0])
        side[component] = INSIDE if inside else OUTSIDE
        unassigned &= ~component
        if not inside:
            outside.append((at_boundary(component), leaves, component))
    far_field = any(reached for reached, _, _ in outside)
    enclosed = [o for o in outside if deletes_enclosed and far_field and not o[0]]
    place = lambda words: to_user(centroid(min(words, key=key))) if words else None
    within = np.logical_or.reduce([np.zeros_like(crossing)] + [component for _, _, component in enclosed])
    leaves = [word for _, leaves, _ in enclosed for word in leaves]
    return side, within, {
        "components": {"outside": len(outside), "inside": count - len(outside),
                       "enclosed": {"count": len(enclosed), "leaves": len(leaves), "example": place(leaves)}},
        "components_ambiguous": {"count": len(firsts), "example": place(firsts)}}


def grade(split, kept, level_of, n, deep):
    """Layers and balance, from the finest level to the coarsest (section 6)."""
    def refine(marks, level):
        """Split the ancestors of the marked cells of a level."""
        for coarser in range(level):
            split[coarser] |= pool(marks, coarser)

    for l in range(deep, 0, -1):
        within = pool(kept, l)
        refine(dilate(pool((level_of() == l) & kept, l), n - 1) & within, l)
        refine(pool(dilate(pool((level_of() == l) & kept, l), 1) & within, l - 1), l - 1)


def mesh(case, facets, ungraded):
    """The leaf words of a case, and the keys of the manifest that do not depend on them."""
    root, n = case["root"], case.get("layer_cells_min", 4)
    scale = UNITS / root["edge"]
    on_lattice = lambda x: np.rint((np.asarray(x, np.float64) - root["origin"]) * scale)
    facets = on_lattice(facets).astype(np.int64).reshape(-1, 3, 3)
    surface = level_for(root["edge"], case["spacing_min"])
    boxes = [{"min": np.clip(on_lattice(b["min"]), 0, UNITS).astype(int).tolist(),
              "max": np.clip(on_lattice(b["max"]), 0, UNITS).astype(int).tolist(),
              "level": level_for(root["edge"], b["spacing"])} for b in case.get("box", [])]
    deep = max([surface] + [b["level"] for b in boxes])
    size = 1 << deep
    touched = np.zeros((size,) * 3, bool)
    for facet in facets:
        touched[crossed(facet, UNITS >> deep, size)] = True
    split = [pool(touched, l) & (l < surface) for l in range(deep)]
    for b in boxes:
        for l in range(b["level"]):
            index, edge = np.arange(1 << l), UNITS >> l
            x, y, z = (np.maximum(index * edge, low) < np.minimum((index + 1) * edge, high) for low, high in zip(b["min"], b["max"]))
            split[l] |= x[:, None, None] & y[None, :, None] & z[None, None, :]
    level_of = lambda: sum((spread(s, size).astype(np.uint8) for s in split), np.zeros((size,) * 3, np.uint8))
    level, crossing = level_of(), np.zeros((size,) * 3, bool)
    for l in range(deep + 1):
        crossing |= (level == l) & spread(pool(touched, l), size)
    keep, keep_crossing = case.get("keep", "outside"), case.get("keep_crossing", True)
    seeds, enclosed = [on_lattice(s).astype(int).tolist() for s in case.get("seeds", [])], case.get("enclosed", "delete")
    cells = [tuple(q * size // UNITS for q in s) for s in seeds]
    for i, cell in enumerate(cells):
        if not all(0 <= c < size for c in cell) or crossing[cell]:
            print(f"seed {i} at {case['seeds'][i]} is outside the root or in a crossing leaf; move it into the flow", file=sys.stderr)
            sys.exit(2)
    deletes_enclosed = keep == "outside" and not seeds and enclosed == "delete"
    wanted = INSIDE if keep == "inside" else OUTSIDE
    side, within, components = sides(level, crossing, facets, root, (cells, wanted), deletes_enclosed)
    kept = crossing | (keep == "all") | (side == wanted) & ~within
    if ungraded:
        kept, keep_crossing = np.ones_like(kept), True
    else:
        if not keep_crossing and n < 3:
            marks = pool(dilate(crossing, 1) & kept, surface)
            for l in range(surface):
                split[l] |= pool(marks, l)
        grade(split, kept, level_of, n, deep)
    words = words_of(level_of(), side, kept if keep_crossing else kept & ~crossing)
    terms = {"level_surface": surface, "layer_cells_min": n, "keep": keep, "keep_crossing": case.get("keep_crossing", True)}
    return words, terms | components | {"root": root, "boxes": boxes, "seeds": seeds, "enclosed": enclosed}


def digest(words):
    """The digest of leaf words, as hexadecimal digits (section 8)."""
    def f(x):
        x = (x ^ x >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ x >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
        return x ^ x >> np.uint64(31)

    total = lambda x: (int((x >> np.uint64(32)).sum()) << 32) + int((x & np.uint64(0xFFFFFFFF)).sum())
    a = f(words + np.uint64(0x9E3779B97F4A7C15))
    b = f(a ^ (words << np.uint64(32) | words >> np.uint64(32)))
    return f"{((total(a) << 64) + total(b)) % (1 << 128):032x}"


def write(words, terms, out, ungraded):
    """Write a leaf-set directory (section 11)."""
    levels = np.bincount((words >> np.uint64(2) & np.uint64(31)).astype(int), minlength=20).tolist()
    counts = np.bincount((words & np.uint64(3)).astype(int), minlength=3).tolist()
    octants = (words >> np.uint64(55)).astype(int)
    part = {"file": "leaves-00000.npy", "leaves": len(words), "digest": digest(words)}
    manifest = terms | {
        "schema": "octree-leaf-set/1", "program": "python example", "tree": "base" if ungraded else "final",
        "leaves": len(words), "leaves_by_level": levels,
        "leaves_by_side": dict(zip(["outside", "inside", "crossing"], counts)), "digest": part["digest"],
        "octant_digests": [digest(words[octants == i]) for i in range(512)], "parts": [part]}
    out.mkdir(parents=True, exist_ok=True)
    np.save(out / part["file"], words.astype("<u8"))
    (out / "mesh.json").write_text(json.dumps(manifest))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", type=Path, help="case file with a geometry file and a [root] table")
    parser.add_argument("--out", type=Path, metavar="DIR", required=True, help="directory for the leaf set")
    parser.add_argument("--ungraded", action="store_true", help="stop after the base tree")
    options = parser.parse_args()
    case = tomllib.loads(options.case.read_text())
    facets = read_stl(options.case.parent / case["geometry"])
    write(*mesh(case, facets, options.ungraded), options.out, options.ungraded)
