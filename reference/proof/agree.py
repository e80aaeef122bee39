#!/usr/bin/env python3
"""Compares the proven checker with Statement.v, read literally, on small random meshes, right and wrong ones.

    agree.py CHECK OUT [COUNT [FIRST]]

The theorem says that what the checker accepts is right. This test says that it accepts what is right, too, and that the statement is not
so strict that nothing satisfies it: right meshes are those of section 6, step by step. It also counts the rejected meshes that violate
one conjunct of `promised` and no other: the theorem needs each of them. COUNT meshes are drawn from the numbers FIRST, FIRST + 1, ...
Where layers were too thin, no mesh was least, so none is expected that violates `layers` only. Exit codes: 0 all agree, 1 one does not, or,
of at least 1000 meshes, none needs some other conjunct.
"""
import random
import shutil
import subprocess
import sys
from itertools import combinations
from pathlib import Path

from leafset import CROSSING, INSIDE, OUTSIDE, LeafSet, word

DEEPEST = 5  # coordinates are in cells of this level
ROOT = 1 << DEEPEST
SIZE = [ROOT >> l for l in range(DEEPEST + 1)]


def leaf(x, y, z, l, s): return (x, y, z, l, s)
def edge(a): return SIZE[a[3]]
def children(a): return [leaf(*(a[i] + (edge(a) // 2 if j >> i & 1 else 0) for i in range(3)), a[3] + 1, a[4]) for j in range(8)]
def cube(a): return a[:4]
def parent(a): e = 2 * edge(a); return (a[0] // e * e, a[1] // e * e, a[2] // e * e, a[3] - 1)


def gap(a, b):
    """The greatest distance of two octants along an axis, negative if they overlap."""
    e, f = SIZE[a[3]], SIZE[b[3]]
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return max(x - e, -x - f, y - e, -y - f, z - e, -z - f)


def distance(a, b): return max(0, gap(a, b))


def share_face(a, b):
    """Part of a face: the cubes meet in one plane, and their projections onto it overlap."""
    e, f = SIZE[a[3]], SIZE[b[3]]
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return (x == e or x == -f or y == e or y == -f or z == e or z == -f) and (
        (-f < x < e) + (-f < y < e) + (-f < z < e) == 2 and -f <= x <= e and -f <= y <= e and -f <= z <= e)


def within(a, b): return all(b[i] <= a[i] and a[i] + edge(a) <= b[i] + edge(b) for i in range(3))
def holds(a, p): return all(a[i] <= p[i] < a[i] + edge(a) for i in range(3))
def at_boundary(a): return any(a[i] == 0 or a[i] + edge(a) == ROOT for i in range(3))


def ancestors(leaves):
    """Octants with a leaf strictly inside."""
    found = set()
    for a in leaves:
        while a[3]:
            a = parent(a)
            if a in found:
                break
            found.add(a)
    return found


def filled(leaves):
    """Whether no unit cell is in two leaves, and whether each is in one."""
    cells, disjoint = bytearray(ROOT ** 3), True
    for x, y, z, l, _ in leaves:
        e = SIZE[l]
        for start in range(x + ROOT * y + ROOT ** 2 * z, x + ROOT * y + ROOT ** 2 * (z + e), ROOT ** 2):
            for row in range(start, start + ROOT * e, ROOT):
                disjoint = disjoint and cells.find(1, row, row + e) < 0
                cells[row:row + e] = b"\1" * e
    return disjoint, cells.find(0) < 0


def components(base):
    label = {a: i for i, a in enumerate(base)}
    pairs = [(a, b) for a, b in combinations([a for a in base if a[4] != CROSSING], 2) if share_face(a, b)]
    changed = True
    while changed:
        changed = False
        for a, b in pairs:
            if label[a] != label[b]:
                label[a] = label[b] = min(label[a], label[b])
                changed = True
    return label


def deleted_leaves(c, base, label):
    far = {label[a] for a in base if a[4] == OUTSIDE and at_boundary(a)}
    def deleted(a):
        if c["keep"] == "outside":
            return a[4] == INSIDE or (a[4] == OUTSIDE and not c["seeds"] and c["enclosed"] == "delete" and far and label[a] not in far)
        return c["keep"] == "inside" and a[4] == OUTSIDE
    return [a for a in base if deleted(a)]


def layers(c, graded):
    d, n = c["level_surface"], c["layer_cells_min"]
    for l in range(1, DEEPEST if c["keep"] == "all" else d):
        fine, coarse = [a for a in graded if a[3] > l], [b for b in graded if b[3] < l]
        if any(distance(a, b) < n * SIZE[l] for a in fine for b in coarse):
            return False
    return True


def least(c, base, gone, graded):
    """Every octant in a kept leaf of T0 is split if and only if it has a cause. Octants of the deepest level have neither."""
    d, n = c["level_surface"], c["layer_cells_min"]
    by_level = [[a for a in graded if a[3] == l] for l in range(DEEPEST + 1)]
    deepest = max((a[3] for a in graded), default=0)
    extra = [b for b in base if b[4] == CROSSING] if not c["keep_crossing"] and n < 3 else []
    split_in_base, split, early = ancestors(base), ancestors(graded), {}

    def split_early(o):
        if o not in early:
            early[o] = o in split_in_base or any(distance(a, o) == 0 for l in by_level[o[3] + 2:] for a in l) or (
                o[3] < d and any(distance(b, o) == 0 for b in extra))
        return early[o]

    sources = [[p for p in l if p[3] > 0 and split_early(parent(p))] for l in by_level]

    def right(o):
        if o[3] >= deepest:
            return True
        caused = split_early(o) or any(distance(p, o) < (n - 1) * edge(p) for p in sources[o[3] + 1])
        return caused == (o in split) and all(right(cube(k)) for k in children(o + (OUTSIDE,)))

    return all(right(cube(b)) for b in set(base) - set(gone))


def seeded(c, base, label):
    flow = INSIDE if c["keep"] == "inside" else OUTSIDE
    places = [[a for a in base if holds(a, p)] for p in c["seeds"]]
    reached = {label[a] for p in places for a in p}
    return all(places) and not any(a[4] == CROSSING for p in places for a in p) and all(
        a[4] == CROSSING or (a[4] == flow) == (label[a] in reached) for a in base)


def violated(c, base, mesh, dropped):
    """The conjuncts of [promised] that are wrong."""
    label, graded, sides = components(base), mesh + dropped, {}
    gone = deleted_leaves(c, base, label)
    homes = {cube(b): b for b in set(base) - set(gone)}

    def inherits(a):
        b = cube(a)
        while b not in homes and b[3]:
            b = parent(b)
        return b in homes and homes[b][4] == a[4]

    checks = {
        "tiles": all(filled(base)),
        "fine": all(a[4] != CROSSING or a[3] >= c["level_surface"] for a in base),
        "one_side": all(sides.setdefault(label[a], a[4]) == a[4] for a in base),
        "seeded": not c["seeds"] or seeded(c, base, label),
        "linear": filled(graded)[0],
        "without_crossing": c["keep_crossing"] or all(a[4] != CROSSING for a in mesh),
        "complete": filled(graded + gone)[1],
        "inherits": all(map(inherits, graded)),
        "least": least(c, base, gone, graded),
        "layers": layers(c, graded)}
    return {name for name, right in checks.items() if not right}


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
        kept = refined(kept, lambda a: a[3] < l and any(gap(a, b) < (n - 1) * edge(b) for b in sources))
        fine = [a for a in kept if a[3] == l]
        kept = refined(kept, lambda a: a[3] < l - 1 and any(distance(a, b) == 0 for b in fine))
    return kept


def flip(leaves, b):
    """The leaves in b have the other side."""
    return [a[:4] + (1 - a[4],) if within(a, b) else a for a in leaves]


def draw(r):
    """A case, T0, the mesh in parts and the crossing leaves that are deleted after gradation; half of the time something is wrong."""
    base = [leaf(0, 0, 0, 0, OUTSIDE)]
    chances = r.choice(((1, 0.35, 0.08), (1, 0.25, 0.06, 0.1)))
    for l, chance in enumerate(chances):
        base = [b for a in base for b in (children(a) if a[3] == l and r.random() < chance else [a])]
    walls = r.choice((0.1, 0.35, 0.6))
    base = [a[:4] + (CROSSING,) if r.random() < walls else a for a in base]
    label = components(base)
    side = {i: r.choice((OUTSIDE, OUTSIDE, INSIDE)) for i in label.values()}
    free = [a for a in base if a[4] != CROSSING]
    c = {"keep": r.choice(("outside", "outside", "inside", "all")), "keep_crossing": r.random() < 0.6, "layer_cells_min": r.choice((1, 2, 2, 3, 4)),
         "enclosed": r.choice(("delete", "delete", "keep")), "seeds": [], "level_surface": min([a[3] for a in base if a[4] == CROSSING], default=1)}
    if free and r.random() < 0.3:
        c["seeds"] = [a[:3] for a in r.sample(free, r.randint(1, min(3, len(free))))]
        flow = INSIDE if c["keep"] == "inside" else OUTSIDE
        reached = {label[a] for a in free if any(holds(a, p) for p in c["seeds"])}
        side = {i: flow if i in reached else 1 - flow for i in side}
    base = [a if a[4] == CROSSING else a[:4] + (side[label[a]],) for a in base]
    gone = set(deleted_leaves(c, base, label))
    graded = [a for a in base if a not in gone]
    how, finer = r.random(), [a for a in graded if a[3] < DEEPEST - 1]
    if how < 0.05 and finer:  # a patch that is needlessly fine, with layers and balance
        a = r.choice(finer)
        graded = grade(c, [b for b in graded if b != a] + children(a))
    elif how < 0.1:  # needlessly thick layers
        graded = grade(dict(c, layer_cells_min=c["layer_cells_min"] + 1), graded)
    elif how < 0.95:
        graded = grade(c, graded)
    mesh = [a for a in graded if c["keep_crossing"] or a[4] != CROSSING]
    parts, base_parts = [mesh], [base]
    if mesh and r.random() < 0.6:
        i = r.randrange(len(mesh))
        a, wrong = mesh[i], r.randrange(12)
        finer = children(a) if a[3] < DEEPEST else []
        if wrong < 5:
            mesh[i:i + 1] = ([], [a[:4] + ((a[4] + 1) % 3,)], finer, finer, sorted(gone)[:1] + [a])[wrong]
        elif wrong == 5:
            parts.append([a])
        elif wrong == 6:
            base_parts.append([r.choice(base)])
        elif wrong == 7:
            c["level_surface"] += 1
        elif wrong == 8 and free:
            b = r.choice([b for b in base if b[4] != CROSSING])
            base[:], mesh[:] = flip(base, b), flip(mesh, b)
        elif wrong == 9 and free:
            c["seeds"] = c["seeds"] + [r.choice(base)[:3]]
        elif wrong == 10 and not c["keep_crossing"]:
            mesh.extend(a for a in base[:9] if a[4] == CROSSING)
        elif wrong == 11:
            i = r.randrange(len(base))
            base[i] = base[i][:4] + (r.choice((OUTSIDE, INSIDE, CROSSING)),)
    dropped = []
    if not c["keep_crossing"]:  # no other crossing leaves can be those that gradation leaves
        gone = set(deleted_leaves(c, base, components(base)))
        dropped = [a for a in grade(c, [b for b in base if b not in gone]) if a[4] == CROSSING and a not in mesh]
    return c, base_parts, parts, dropped


def leaf_set(c, parts, tree):
    s = object.__new__(LeafSet)
    s.parts = []
    for part in parts:
        keys = [sum((a[i] >> bit & 1) << 3 * (bit + 19 - DEEPEST) + i for bit in range(DEEPEST) for i in range(3)) for a in part]
        s.parts.append(sorted(word(k, a[3], a[4]) for k, a in zip(keys, part)))
    s.manifest = dict(c, schema="octree-leaf-set/1", tree=tree, root={}, boxes=[], geometry={}, seeds=[[q << 27 - DEEPEST for q in p] for p in c["seeds"]])
    s.count()
    return s


def files(r, mesh, base):
    """What is wrong in files that have the right leaves."""
    s, wrong = r.choice((mesh, base)), r.randrange(4)
    if wrong == 0 and len(s.parts[0]) > 1:
        s.parts[0].reverse()
        return "words"
    if wrong == 1:
        s.manifest["leaves"] += 1
    elif wrong == 2:
        levels = s.manifest["leaves_by_level"]
        levels[r.randrange(20)] += 1
    else:
        s.manifest["leaves_by_side"]["inside"] += 1
    return "counted"


def main(check, out, count=200, start=0):
    count, start = int(count), int(start)
    verdicts = {True: 0, False: 0}
    alone = dict.fromkeys(("words", "counted", "tiles", "fine", "one_side", "seeded", "linear", "without_crossing", "complete", "inherits", "least", "layers"), 0)
    for number in range(start, start + count):
        r = random.Random(number)
        c, base, mesh, dropped = draw(r)
        wrong = violated(c, sum(base, []), sum(mesh, []), dropped)
        mesh, base = leaf_set(c, mesh, "final"), leaf_set(c, base, "base")
        if not wrong and r.random() < 0.1:
            wrong = {files(r, mesh, base)}
        shutil.rmtree(out, ignore_errors=True)
        mesh.write(out / "mesh")
        base.write(out / "base")
        code = subprocess.run([check, out / "mesh", out / "base"], stdout=subprocess.DEVNULL).returncode
        if code != (1 if wrong else 0):
            print(f"mesh {number} violates {sorted(wrong) or 'nothing'}, but the checker's exit code is {code}; it is in {out}")
            return 1
        verdicts[not wrong] += 1
        if len(wrong) == 1:
            alone[wrong.pop()] += 1
    shutil.rmtree(out, ignore_errors=True)
    print(f"{count} random meshes: {verdicts[True]} right ones accepted, {verdicts[False]} wrong ones rejected")
    print("rejected meshes that violate one conjunct only: " + ", ".join(f"{name} {n}" for name, n in alone.items()))
    return 0 if min(verdicts.values()) * 10 > count and (count < 1000 or min(n for name, n in alone.items() if name != "layers")) else 1


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 5:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:]))
