"""Fits the times of the cost model (mesher/src/partition/cost.rs), and states its prediction error on held-out meshes.

Usage: python fit.py data.csv HELD_OUT_CASE...

The model is CPU time of sides and gradation on a rank = sum of counts times non-negative times. The fit minimises the sum of squared
relative errors, so that ranks of small meshes count as much as those of large ones.
"""

import csv
import sys
from itertools import combinations

import numpy as np

COUNTS = ["bricks", "components", "components_extra", "components_single", "neighbours"]
# The constant FITTED of cost.rs, which has it in units of 70 ns, in ns.
FITTED = np.array([140.0, 140.0, 140.0, 910.0, 16100.0])


def read(path):
    """Case names, counts (ranks x 5) and CPU times in ns (ranks), in the order of the file."""
    with open(path, newline="") as f:
        rows = list(csv.DictReader(f))
    counts = np.array([[float(r[c]) for c in COUNTS] for r in rows])
    times = np.array([float(r["sides_ns"]) + float(r["grade_ns"]) for r in rows])
    return np.array([r["case"] for r in rows]), counts, times


def nnls(a, b):
    """Non-negative least squares by trying all supports, of which there are 31."""
    best = (np.inf, None)
    for n in range(1, a.shape[1] + 1):
        for support in combinations(range(a.shape[1]), n):
            x = np.zeros(a.shape[1])
            x[list(support)] = np.linalg.lstsq(a[:, support], b, rcond=None)[0]
            if (x >= 0).all():
                best = min(best, (float(np.sum((a @ x - b) ** 2)), tuple(x)))
    return np.array(best[1])


def errors(model, counts, times):
    """Relative errors by rank. The times are scaled to the same total, as only ratios of loads matter to a partition."""
    predicted = counts @ model
    predicted *= times.sum() / predicted.sum()
    return np.abs(predicted / times - 1)


def main():
    path, *held_out = sys.argv[1:]
    cases, counts, times = read(path)
    is_fitted = ~np.isin(cases, held_out)
    assert is_fitted.any() and not is_fitted.all(), "name at least one held-out case of the data"
    a = counts[is_fitted] / times[is_fitted, None]
    refit = nnls(a, np.ones(len(a)))
    print("ns per".ljust(20) + "cost.rs".rjust(10) + "refit".rjust(10))
    for name, ours, new in zip(COUNTS, FITTED, refit):
        print(f"{name:20}{ours:10.0f}{new:10.0f}")
    print("\nrelative error per rank".ljust(33) + "cost.rs".rjust(18) + "refit".rjust(18) + "bricks only".rjust(18))
    print("case".ljust(24) + "use".ljust(8) + "    median   max" * 3)
    bricks_only = np.array([1.0, 0, 0, 0, 0])
    for case in dict.fromkeys(cases):
        rows = cases == case
        line = case.ljust(24) + ("fit" if is_fitted[rows].all() else "test").ljust(8)
        for model in FITTED, refit, bricks_only:
            e = errors(model, counts[rows], times[rows])
            line += f"{np.median(e):10.3f}{e.max():7.3f} "
        print(line)


if __name__ == "__main__":
    main()
