#!/usr/bin/env python3
"""Corrupts meshes in ways that the proven checker must reject, and prints one line for each.

    corrupt.py CHECK CASES OUT

CHECK is the checker, CASES the directory of meshes (NAME and NAME-base) that it accepts, OUT a directory for the corrupted ones. Counts of
the manifest follow the leaves unless they are what is corrupted: otherwise they alone would be the reason of a rejection. A corruption
that does not apply to a case is left out; each is tried on up to three cases, and on one at least. Exit codes: 0 as expected, 1 otherwise.
"""
import functools
import shutil
import subprocess
import sys
from bisect import bisect_right
from pathlib import Path

from leafset import CROSSING, INSIDE, OUTSIDE, LeafSet, key, level, side, volume, word


@functools.lru_cache(maxsize=None)
def corner(w):
    xyz = [0, 0, 0]
    for bit in range(57):
        xyz[bit % 3] |= (w >> 7 + bit & 1) << bit // 3
    return xyz


def distance(v, w):
    """Chebyshev distance of two leaves, in cells of level 19."""
    p, q, e, f = corner(v), corner(w), 1 << 19 - level(v), 1 << 19 - level(w)
    return max(0, *(max(q[a] - p[a] - e, p[a] - q[a] - f) for a in range(3)))


class Skip(Exception):
    """The corruption does not apply to this case."""


def first(items):
    for item in items:
        return item
    raise Skip


def middle(words, wanted=lambda w: True):
    """The index of a wanted leaf in the middle of the wanted ones."""
    found = [i for i, w in enumerate(words) if wanted(w)]
    if not found:
        raise Skip
    return found[len(found) // 2]


def sibling_groups(words):
    """Indices of the first of eight siblings that are leaves of one side."""
    for i in range(len(words) - 7):
        l = level(words[i])
        if l and key(words[i]) % volume(l - 1) == 0 and all(
                words[i + j] == word(key(words[i]) + j * volume(l), l, side(words[i])) for j in range(8)):
            yield i


def coarsen(words, i):
    words[i:i + 8] = [word(key(words[i]), level(words[i]) - 1, side(words[i]))]


def split(words, i):
    w = words[i]
    if level(w) == 19:
        raise Skip
    words[i:i + 1] = [word(key(w) + j * volume(level(w) + 1), level(w) + 1, side(w)) for j in range(8)]


def parent_and_others(words, i):
    parent = word(key(words[i]), level(words[i]) - 1, side(words[i]))
    return parent, words[:i] + words[i + 8:]


# Corruptions of the mesh's leaves: m is the mesh, b is T0.
def drop(m, b): del m.words[middle(m.words)]
def drop_first(m, b): del m.words[0]
def drop_last(m, b): del m.words[-1]
def duplicate(m, b): i = middle(m.words); m.words.insert(i, m.words[i])


def swap(m, b):
    i = middle(m.words)
    m.words[i], m.words[i + 1] = m.words[i + 1], m.words[i]


def level_up(m, b): i = middle(m.words, lambda w: level(w) < 19); m.words[i] += 4
def level_down(m, b): i = middle(m.words); m.words[i] -= 4
def level_31(m, b): m.words[middle(m.words)] |= 31 << 2


def misalign(m, b):
    i = middle(m.words, lambda w: level(w) < 19)
    m.words[i] += 1 << 7


def other_side(m, b):
    i = middle(m.words, lambda w: side(w) != CROSSING)
    m.words[i] ^= 1


def no_side(m, b): m.words[middle(m.words)] |= 3
def not_crossing(m, b): i = middle(m.words, lambda w: side(w) == CROSSING); m.words[i] ^= 2
def crossing_in_free_space(m, b): i = middle(m.words, lambda w: side(w) == OUTSIDE); m.words[i] |= 2


def coarsen_at_finer(m, b):
    """Siblings of level l that touch leaves of level l + 1 become one leaf: balance is broken."""
    words = m.words
    for i in sibling_groups(words):
        if level(words[i - 1]) != level(words[i]) + 1:
            continue
        parent, others = parent_and_others(words, i)
        if any(level(w) == level(words[i]) + 1 and distance(parent, w) == 0 for w in others):
            return coarsen(words, i)
    raise Skip


def coarsen_in_layer(m, b):
    """Siblings of level l near the outer end of their layer become one leaf: touching leaves still differ by one level at most."""
    words, n = m.words, m.manifest["layer_cells_min"]
    if n < 2:
        raise Skip
    for i in list(sibling_groups(words))[::5]:
        l = level(words[i])
        parent, others = parent_and_others(words, i)
        finer = [distance(parent, w) for w in others if level(w) > l]
        if finer and 0 < min(finer) < n << 19 - l and (l < m.manifest["level_surface"]):
            return coarsen(words, i)
    raise Skip


def coarsen_at_surface(m, b):
    """Siblings at the surface level near crossing leaves become one leaf."""
    words, d, n = m.words, m.manifest["level_surface"], m.manifest["layer_cells_min"]
    crossing = [w for w in words + b.words if side(w) == CROSSING and level(w) == d]
    for i in sibling_groups(words):
        if level(words[i]) == d and side(words[i]) != CROSSING:
            parent, _ = parent_and_others(words, i)
            if min(distance(parent, w) for w in crossing) < (n - 1) << 19 - d:
                return coarsen(words, i)
    raise Skip


def coarsen_base_leaf(m, b):
    """Eight leaves of T0 become one in the mesh."""
    words, leaves = m.words, set(b.words)
    coarsen(words, first(i for i in sibling_groups(words) if all(w in leaves for w in words[i:i + 8])))


def restore_deleted(m, b):
    """A leaf that was deleted is in the mesh."""
    kept = m.words
    w = first(w for w in b.words if side(w) != CROSSING and bisect_right(kept, w | 127) == bisect_right(kept, w + (volume(level(w)) << 7)))
    kept.append(w)
    kept.sort()


def restore_crossing(m, b):
    if m.manifest["keep_crossing"]:
        raise Skip
    m.words.append(first(w for w in b.words if side(w) == CROSSING))
    m.words.sort()


def unsplit_side(m, b):
    """A leaf of T0 that is crossing was split into crossing and free leaves."""
    i = middle(m.words, lambda w: side(w) == CROSSING)
    split(m.words, i)
    m.words[i] &= ~3


def needless_split(m, b):
    """A finest leaf is split where no leaf is coarser: everything but leastness stays right."""
    words, d = m.words, m.manifest["level_surface"]
    if m.manifest["keep"] == "all" or m.manifest["keep_crossing"] is False or max(map(level, words)) != d:
        raise Skip
    coarser = [w for w in words if level(w) < d]
    split(words, first(i for i, w in enumerate(words) if level(w) == d and side(w) == CROSSING and all(distance(w, v) for v in coarser)))


def too_fine(m, variant):
    """The mesh of a case of which gradation asks more. It has all properties of section 7, and is not least."""
    other = m.directory.parent / f"{m.name}-{variant}"
    if not other.exists():
        raise Skip
    m.parts = LeafSet(other).parts


def needless_patch(m, b): too_fine(m, "patch")
def needless_layer(m, b): too_fine(m, "thick")


# Corruptions of files.
def part_missing(m, b): half(m); m.parts.pop()
def part_twice(m, b): half(m); m.parts[1] = list(m.parts[0])
def parts_overlap(m, b): half(m); m.parts[1].insert(0, m.parts[0][-1])
def part_descends(m, b): m.words.reverse()
def base_part_missing(m, b): half(b); b.parts.pop()


def half(m):
    n = len(m.words) // 2
    m.parts = [m.words[:n], m.words[n:]]


# Corruptions of T0. The mesh follows where the leaf is in both.
def base_drop(m, b): del b.words[middle(b.words)]
def base_duplicate(m, b): i = middle(b.words); b.words.insert(i, b.words[i])


def base_side(m, b):
    """One leaf of a component has the other side."""
    i = middle(b.words, lambda w: side(w) == OUTSIDE)
    b.words[i] ^= 1


def base_coarse_crossing(m, b):
    """Crossing leaves of T0 that are coarser than the surface."""
    b.manifest["level_surface"] += 1
    m.manifest["level_surface"] += 1


def all_sides(m, b):
    """All sides are exchanged: with seeds, the flow has the wrong one."""
    if not m.manifest["seeds"]:
        raise Skip
    for s in m, b:
        s.parts = [[w ^ 1 if side(w) != CROSSING else w for w in part] for part in s.parts]


def base_hole_in_wall(m, b):
    """A crossing leaf between two sides becomes a free one."""
    if m.manifest["keep"] == "all":
        raise Skip
    i = middle(b.words, lambda w: side(w) == CROSSING)
    b.words[i] ^= 2


# Corruptions of what the manifests say, in both.
def both(m, b, **changes):
    for s in m, b:
        s.manifest.update(changes)


def thicker_layers(m, b):
    levels = {level(w) for w in m.words}
    if max(levels) - min(levels) < 2: raise Skip
    both(m, b, layer_cells_min=2 * m.manifest["layer_cells_min"] + 2)
def keep_everything(m, b):
    if m.manifest["keep"] == "all": raise Skip
    both(m, b, keep="all")


def keep_other(m, b):
    if m.manifest["keep"] == "all": raise Skip
    both(m, b, keep="inside" if m.manifest["keep"] == "outside" else "outside")


def crossing_dropped(m, b): both(m, b, keep_crossing=not m.manifest["keep_crossing"])


def enclosed_otherwise(m, b):
    if not m.manifest["components"]["enclosed"]["count"]: raise Skip
    both(m, b, enclosed="keep")


def enclosed_not_deleted(m, b):
    if "overlapping_keep" not in m.name: raise Skip
    both(m, b, enclosed="delete")


def seed_in_wall(m, b):
    if not m.manifest["seeds"]: raise Skip
    x = corner(first(w for w in b.words if side(w) == CROSSING))
    both(m, b, seeds=m.manifest["seeds"] + [[256 * p for p in x]])


def seed_elsewhere(m, b):
    """The seed lies in a component of the other side."""
    if not m.manifest["seeds"]: raise Skip
    flow = INSIDE if m.manifest["keep"] == "inside" else OUTSIDE
    x = corner(first(w for w in b.words if side(w) not in (CROSSING, flow)))
    both(m, b, seeds=[[256 * p for p in x]])


def seed_outside(m, b):
    if not m.manifest["seeds"]: raise Skip
    both(m, b, seeds=m.manifest["seeds"] + [[1 << 27, 0, 0]])


# Corruptions of counts.
def count_leaves(m, b): m.manifest["leaves"] += 1
def count_part(m, b): m.manifest["parts"][0]["leaves"] -= 1


def count_levels(m, b):
    levels = m.manifest["leaves_by_level"]
    i = middle(levels, lambda n: n)
    levels[i], levels[i - 1] = levels[i] - 1, levels[i - 1] + 1


def count_sides(m, b):
    sides = m.manifest["leaves_by_side"]
    sides["outside"], sides["inside"] = sides["outside"] + 1, sides["inside"] - 1


def count_base(m, b): b.manifest["leaves"] -= 1


# No corruptions: accepted.
def unchanged(m, b): pass
def two_parts(m, b): half(m); half(b)
def interleaved_parts(m, b): m.parts = [m.words[0::2], m.words[1::2], []]; b.parts = [b.words[1::3], b.words[0::3], b.words[2::3]]

def written_otherwise(m, b):
    m.manifest["root"] = dict(reversed(m.manifest["root"].items()))
    del m.manifest["geometry"]


REJECTED = [drop, drop_first, drop_last, duplicate, swap, level_up, level_down, level_31, misalign, other_side, no_side, not_crossing,
            crossing_in_free_space, coarsen_at_finer, coarsen_in_layer, coarsen_at_surface, coarsen_base_leaf, restore_deleted,
            restore_crossing, needless_split, needless_patch, needless_layer,
            unsplit_side, part_missing, part_twice, parts_overlap, part_descends, base_part_missing, base_drop,
            base_duplicate, base_side, base_coarse_crossing, all_sides, base_hole_in_wall, thicker_layers, keep_everything, keep_other,
            crossing_dropped, enclosed_otherwise, enclosed_not_deleted, seed_in_wall, seed_elsewhere, seed_outside]
COUNTS = [count_leaves, count_part, count_levels, count_sides, count_base]
ACCEPTED = [unchanged, two_parts, interleaved_parts, written_otherwise]
CASES = ["pipe-small", "cube_seeds_on_faces-small", "cube-small", "box_in_box-small", "boxes_overlapping_keep-small", "fighter-small",
         "duct_layers-small", "sphere"]


def main(check, cases, out):
    shutil.rmtree(out, ignore_errors=True)
    wrong = 0
    sets = []
    for name in CASES:
        if (cases / name / "mesh.json").exists():
            m, b = LeafSet(cases / name), LeafSet(cases / f"{name}-base")
            sets.append((m, b))
    for corruption in REJECTED + COUNTS + ACCEPTED:
        wanted = 0 if corruption in ACCEPTED else 1
        codes = {}
        for m, b in sets:
            if len(codes) == 3:
                break
            m, b = m.copy(), b.copy()
            try:
                corruption(m, b)
            except Skip:
                continue
            if corruption not in COUNTS:
                m.count()
                b.count()
            m.write(out / "mesh")
            b.write(out / "base")
            codes[m.name] = subprocess.run([check, out / "mesh", out / "base"], stdout=subprocess.DEVNULL).returncode
            shutil.rmtree(out)
        bad = [f"{name} (exit code {code})" for name, code in codes.items() if code != wanted]
        verdict = "accepted" if wanted == 0 else "rejected"
        print(f"{corruption.__name__:24} {verdict} in {len(codes) - len(bad)} of {len(codes)} cases" + "".join(f"; NOT {b}" for b in bad), flush=True)
        wrong += len(bad) + (not codes)
    return 1 if wrong else 0


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    sys.exit(main(*map(Path, sys.argv[1:])))
