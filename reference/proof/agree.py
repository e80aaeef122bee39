#!/usr/bin/env python3
"""Compares the proven checker with Statement.v, read literally, on small random meshes, right and wrong ones.

    agree.py CHECK OUT [COUNT [FIRST]]

The theorem says that what the checker accepts is right. This test says that it accepts what is right, too, and that the statement is not
so strict that nothing satisfies it. COUNT meshes are drawn from the numbers FIRST, FIRST + 1, ... Exit codes: 0 all agree, 1 one does not.
"""
import functools
import random
import shutil
import subprocess
import sys
from itertools import combinations
from pathlib import Path

from corrupt import CROSSING, INSIDE, OUTSIDE, LeafSet, word

DEEPEST = 5  # coordinates are in cells of this level
ROOT = 1 << DEEPEST


def leaf(x, y, z, l, s): return (x, y, z, l, s)
def edge(a): return ROOT >> a[3]
def children(a): return [leaf(*(a[i] + (edge(a) // 2 if j >> i & 1 else 0) for i in range(3)), a[3] + 1, a[4]) for j in range(8)]


def gaps(a, b):
    """Along each axis the distance of two leaves, negative if they overlap."""
    e, f = edge(a), edge(b)
    return [max(b[i] - a[i] - e, a[i] - b[i] - f) for i in range(3)]


def distance(a, b): return max(0, *gaps(a, b))
def disjoint(a, b): return max(gaps(a, b)) >= 0
def share_face(a, b): g = sorted(gaps(a, b)); return g[2] == 0 and g[1] < 0
def within(a, b): return all(b[i] <= a[i] and a[i] + edge(a) <= b[i] + edge(b) for i in range(3))
def inside(a, o): return within(a, o) and a[3] > o[3]
def parent(a): e = 2 * edge(a); return (a[0] // e * e, a[1] // e * e, a[2] // e * e, a[3] - 1, OUTSIDE)
def holds(a, p): return all(a[i] <= p[i] < a[i] + edge(a) for i in range(3))
def at_boundary(a): return any(a[i] == 0 or a[i] + edge(a) == ROOT for i in range(3))
def volume(leaves): return sum(edge(a) ** 3 for a in leaves)


def components(base):
    label = {a: i for i, a in enumerate(base)}
    pairs = [(a, b) for a, b in combinations(base, 2) if CROSSING not in (a[4], b[4]) and share_face(a, b)]
    changed = True
    while changed:
        changed = False
        for a, b in pairs:
            if label[a] != label[b]:
                label[a] = label[b] = min(label[a], label[b])
                changed = True
    return label


def deleted_leaves(c, base):
    label = components(base)
    far = {label[a] for a in base if a[4] == OUTSIDE and at_boundary(a)}
    def deleted(a):
        if c["keep"] == "outside":
            return a[4] == INSIDE or (a[4] == OUTSIDE and not c["seeds"] and c["enclosed"] == "delete" and far and label[a] not in far)
        return c["keep"] == "inside" and a[4] == OUTSIDE
    return [a for a in base if deleted(a)]


def violations(c, graded):
    """Pairs of a finer and a coarser leaf that gradation forbids."""
    d, n = c["level_surface"], c["layer_cells_min"]
    for a, b in combinations(graded, 2):
        if a[3] < b[3]:
            a, b = b, a
        gap = distance(a, b)
        if gap == 0 and a[3] - b[3] > 1:
            yield a, b
        elif any((l < d or c["keep"] == "all") and gap < n * (ROOT >> l) for l in range(b[3] + 1, a[3])):
            yield a, b
        elif a[4] == CROSSING and b[3] < d and ((a[3] == d and gap < (n - 1) * (ROOT >> d)) or (not c["keep_crossing"] and gap == 0)):
            yield a, b


def least(c, base, gone, graded):
    """Every octant in a kept leaf of T0 is split if and only if it has a cause. Octants of the deepest level have neither."""
    d, n = c["level_surface"], c["layer_cells_min"]
    deepest = max((a[3] for a in graded), default=0)
    extra = [b for b in base if b[4] == CROSSING] if not c["keep_crossing"] and n < 3 else []

    @functools.lru_cache(maxsize=None)
    def early(o):
        return any(inside(b, o) for b in base) or any(a[3] >= o[3] + 2 and distance(a, o) == 0 for a in graded) or (
            o[3] < d and any(distance(b, o) == 0 for b in extra))

    sources = [p for p in graded if p[3] > 0 and early(parent(p))]

    def right(o):
        if o[3] == deepest:
            return True
        caused = early(o) or any(p[3] == o[3] + 1 and distance(p, o) < (n - 1) * edge(p) for p in sources)
        return any(inside(a, o) for a in graded) == caused and all(map(right, children(o)))

    return all(right(b[:4] + (OUTSIDE,)) for b in base if b not in gone)


def promised(c, base, mesh, dropped):
    label = components(base)
    if volume(base) != ROOT ** 3 or not all(disjoint(a, b) for a, b in combinations(base, 2)):
        return False
    if any(a[4] == CROSSING and a[3] < c["level_surface"] for a in base):
        return False
    sides = {}
    if any(sides.setdefault(label[a], a[4]) != a[4] for a in base):
        return False
    if c["seeds"]:
        flow = INSIDE if c["keep"] == "inside" else OUTSIDE
        places = [a for p in c["seeds"] for a in base if holds(a, p)]
        if len(places) < len(c["seeds"]) or any(a[4] == CROSSING for a in places):
            return False
        seeded = {label[a] for a in places}
        if any(a[4] != CROSSING and (a[4] == flow) != (label[a] in seeded) for a in base):
            return False
    graded = mesh + dropped
    gone = deleted_leaves(c, base)
    if not all(disjoint(a, b) for a, b in combinations(graded + gone, 2)) or volume(graded + gone) != ROOT ** 3:
        return False
    if not c["keep_crossing"] and any(a[4] == CROSSING for a in mesh):
        return False
    if any(not any(within(a, b) and a[4] == b[4] and b not in gone for b in base) for a in graded):
        return False
    return next(violations(c, graded), None) is None and least(c, base, gone, graded)


def refined(leaves, needs):
    """The least refinement in which no leaf needs to be split."""
    while any(map(needs, leaves)):
        leaves = [b for a in leaves for b in (children(a) if needs(a) else [a])]
    return leaves


def grade(c, kept):
    """Section 6, step by step. The statement does not describe a sweep: this shows that its fixed point is the result of the sweep."""
    d, n = c["level_surface"], c["layer_cells_min"]
    if not c["keep_crossing"] and n < 3:
        crossing = [b for b in kept if b[4] == CROSSING]
        kept = refined(kept, lambda a: a[3] < d and any(distance(a, b) == 0 for b in crossing))
    for l in range(max((a[3] for a in kept), default=0), 0, -1):
        sources = [a for a in kept if a[3] == l]
        kept = refined(kept, lambda a: a[3] < l and any(max(gaps(a, b)) < (n - 1) * edge(b) for b in sources))
        fine = [a for a in kept if a[3] == l]
        kept = refined(kept, lambda a: a[3] < l - 1 and any(distance(a, b) == 0 for b in fine))
    return kept


def draw(r):
    """A case, T0 and a mesh that is often right."""
    base = [leaf(0, 0, 0, 0, OUTSIDE)]
    for l in range(3):
        base = [b for a in base for b in (children(a) if a[3] == l and r.random() < (1, 0.6, 0.12)[l] else [a])]
    base = [a[:4] + (CROSSING,) if r.random() < 0.35 else a for a in base]
    label = components(base)
    side = {i: r.choice((OUTSIDE, OUTSIDE, INSIDE)) for i in label.values()}
    free = [a for a in base if a[4] != CROSSING]
    c = {"keep": r.choice(("outside", "outside", "inside", "all")), "keep_crossing": r.random() < 0.7, "layer_cells_min": r.choice((1, 1, 2, 3)),
         "enclosed": r.choice(("delete", "delete", "keep")), "seeds": [], "level_surface": min([a[3] for a in base if a[4] == CROSSING], default=1)}
    if free and r.random() < 0.3:
        c["seeds"] = [a[:3] for a in r.sample(free, r.randint(1, min(3, len(free))))]
        flow = INSIDE if c["keep"] == "inside" else OUTSIDE
        seeded = {label[a] for a in free if any(holds(a, p) for p in c["seeds"])}
        side = {i: flow if i in seeded else 1 - flow for i in side}
    base = [a if a[4] == CROSSING else a[:4] + (side[label[a]],) for a in base]
    gone = set(deleted_leaves(c, base))
    graded = [a for a in base if a not in gone]
    if r.random() < 0.8:
        graded = grade(c, graded)
    mesh = [a for a in graded if c["keep_crossing"] or a[4] != CROSSING]
    if mesh and r.random() < 0.5:
        i = r.randrange(len(mesh))
        a = mesh[i]
        mesh[i:i + 1] = r.choice(([], [a[:4] + ((a[4] + 1) % 3,)], children(a) if a[3] < DEEPEST else [], [a, a], sorted(gone)[:1] + [a]))
    if r.random() < 0.15:
        i = r.randrange(len(base))
        base[i] = base[i][:4] + (r.choice((OUTSIDE, INSIDE, CROSSING)),)
    return c, base, mesh


def leaf_set(c, leaves, tree):
    s = object.__new__(LeafSet)
    words = []
    for x, y, z, l, side in leaves:
        key = sum(((x, y, z)[a] >> bit & 1) << 3 * (bit + 19 - DEEPEST) + a for bit in range(DEEPEST) for a in range(3))
        words.append(word(key, l, side))
    s.parts = [sorted(words)]
    s.manifest = dict(c, schema="octree-leaf-set/1", tree=tree, root={}, boxes=[], geometry={}, seeds=[[q << 27 - DEEPEST for q in p] for p in c["seeds"]])
    s.count()
    return s


def main(check, out, count=200, start=0):
    verdicts = {True: 0, False: 0}
    for number in range(int(start), int(start) + int(count)):
        c, base, mesh = draw(random.Random(number))
        dropped = [] if c["keep_crossing"] else [a for a in base if a[4] == CROSSING]
        right = promised(c, base, mesh, dropped)
        shutil.rmtree(out, ignore_errors=True)
        leaf_set(c, mesh, "final").write(out / "mesh")
        leaf_set(c, base, "base").write(out / "base")
        code = subprocess.run([check, out / "mesh", out / "base"], stdout=subprocess.DEVNULL).returncode
        # Where crossing leaves are deleted, finer ones than those of T0 may have been offered.
        if code != (0 if right else 1) and not (code == 0 and dropped):
            print(f"mesh {number} is {'right' if right else 'wrong'}, but the checker's exit code is {code}; it is in {out}")
            return 1
        verdicts[right] += 1
    shutil.rmtree(out, ignore_errors=True)
    print(f"{int(count)} random meshes: {verdicts[True]} right ones accepted, {verdicts[False]} wrong ones rejected")
    return 0 if min(verdicts.values()) * 10 > int(count) else 1


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 5:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:]))
