"""Leaf words and run reports for adapters in Python."""

import json

import numpy as np


def leaf_words(corner, level):
    """The sorted leaf words (reference/DEFINITION.md, section 8) of cells without sides. `corner` has shape (cells, 3), in
    cells of level 19."""
    corner, level = np.rint(corner).astype(np.uint64), level.astype(np.uint64)
    key = np.zeros(len(level), np.uint64)
    for bit in range(19):
        for axis in range(3):
            key |= (corner[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.sort(key << np.uint64(7) | level << np.uint64(2))


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


def write(parts, out):
    """Writes one array per rank, unless `out` is None."""
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        for rank, words in enumerate(parts):
            np.save(out / f"leaves-{rank:05}.npy", words)


def report(parts, phases, path):
    """Writes the run report of phases (name, wall time, CPU time), unless `path` is None."""
    if path is not None:
        words = np.concatenate(parts)
        phases = [{"name": name, "time_wall_s": [wall], "time_cpu_s": [cpu]} for name, wall, cpu in phases]
        time_s = sum(phase["time_wall_s"][0] for phase in phases)
        path.write_text(json.dumps({"cells": len(words), "digest": digest(words), "ranks": len(parts), "time_wall_s": time_s,
                                    "phases": phases}))
