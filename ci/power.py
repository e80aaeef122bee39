"""What ci/power computes: the line of a gate, the operating curve, and steps hidden by drifts, each beside public detectors.

The detectors, with the rules of their documentation; each is given all times of the first measurement of the gate:

- benchstat: a Mann-Whitney U test at 5 % (Go's golang.org/x/perf/cmd/benchstat), by scipy
- pyperf: the function with which `pyperf compare_to` decides, a t-test at 5 %
- criterion: a bootstrapped t-test at 5 % and an interval of the change beyond 1 % (criterion.rs, its defaults)
- alert200: github-action-benchmark, whose alert-threshold is 200 %
- otava: Apache Otava, formerly hunter (E-divisive with t-tests; its defaults, but for one window over the whole history: with windows of
  50 values it ends with a ValueError on some series)
- pelt: ruptures, PELT with the l2 model and the penalty sigma^2 log n of its guide
"""

import collections
import glob
import json
import os
import random
import statistics
import subprocess
import sys

COLUMNS = "kind percent trial red counters memory instructions time cpu wall first rounds cpu_percent wall_percent".split()
DETECTORS = ["benchstat", "pyperf", "criterion", "alert200"]
NAMES = COLUMNS + [f"{detector} {of}" for of in ("cpu", "wall") for detector in DETECTORS]


def criterion(old, new):
    """Whether criterion.rs reports a regression: significant, and the interval of the change above the noise threshold."""
    import numpy as np

    rng = np.random.default_rng(1)
    old, new, resamples = np.array(old), np.array(new), 4000

    def t(a, b):
        squared = a.var(axis=-1, ddof=1) / a.shape[-1] + b.var(axis=-1, ddof=1) / b.shape[-1]
        return (a.mean(axis=-1) - b.mean(axis=-1)) / np.sqrt(squared)

    both = np.concatenate([old, new])
    mixed = rng.choice(both, (resamples, len(both)))
    null = t(mixed[:, : len(new)], mixed[:, len(new) :])
    p = 2 * min((null > t(new, old)).mean(), (null < t(new, old)).mean())
    means = [rng.choice(of, (resamples, len(of))).mean(axis=1) for of in (new, old)]
    return p < 0.05 and np.quantile(means[0] / means[1] - 1, 0.025) > 0.01


def detectors(old, new):
    """Which detectors call the new times slower."""
    from pyperf._utils import is_significant
    from scipy.stats import mannwhitneyu

    slower = statistics.mean(new) > statistics.mean(old)
    return [
        mannwhitneyu(old, new).pvalue < 0.05 and statistics.median(new) > statistics.median(old),
        # It takes samples of one size only: the first baseline of each round.
        is_significant(old[::2], new)[0] and slower,
        criterion(old, new),
        statistics.mean(new) > 2 * statistics.mean(old),
    ]


def gates(place):
    """Prints the line of every gate that has ended."""
    for path in sorted(glob.glob(f"{place}/*/gate.json")):
        gate(os.path.dirname(path), *os.path.basename(os.path.dirname(path)).split("-"))


def gate(place, kind, percent, trial):
    """Prints the line of a gate."""
    report = json.load(open(f"{place}/gate.json"))
    layers = {layer["name"]: layer["findings"] for layer in report["layers"]}
    is_red = lambda findings: int(any(f["verdict"] == "regression" for f in findings))
    reds = {name: is_red(findings) for name, findings in layers.items()}
    line = [kind, percent, trial, int(any(reds.values()))]
    line += [reds.get(name, "") for name in ("counters", "memory", "instructions", "time")]
    if "time" not in layers:
        print(*line, *[""] * (len(NAMES) - len(line)), sep=",")
        return
    cpu, wall = layers["time"]
    runs = [line.split() for line in open(f"{place}/times")]
    # Six runs of other layers, two that warm up, and rounds of three; then the second measurement, if there was one.
    runs = runs[6 if "counters" in layers else 0 :]
    last = int(max((cpu["note"], wall["note"]), key=lambda note: "second" in note).split()[0])
    once = len(runs) == 2 + 3 * last
    rounds = (len(runs) - (2 if once else 4)) // 3
    count = rounds if once else rounds - last
    first = runs[2 : 2 + 3 * count]
    times = {label: [[float(x) for x in run[1:]] for run in first if run[0] == label] for label in ("baseline", "candidate")}
    assert count > 0 and [len(of) for of in times.values()] == [2 * count, count], place
    found = [
        int(red)
        for which in (0, 1)
        for red in detectors([t[which] for t in times["baseline"]], [t[which] for t in times["candidate"]])
    ]
    line += [is_red([cpu]), is_red([wall]), count, rounds]
    line += [f"{f['change_percent']:.2f}" for f in (cpu, wall)] + found
    print(*line, sep=",")


def table(path):
    """Prints the operating curve from the lines of all gates."""
    rows = collections.defaultdict(list)
    for line in open(path):
        line = dict(zip(NAMES, line.strip().split(",")))
        rows[line["kind"], float(line["percent"])].append(line)
    shown = ["counters", "memory", "instructions", "time"] + NAMES[len(COLUMNS) :]
    print("| planted | gates | rounds |", " | ".join(shown), "|")
    print("|---|---|---|" + "---|" * len(shown))
    for (kind, percent), lines in sorted(rows.items()):

        def count(name):
            values = [int(line[name]) for line in lines if line[name]]
            return f"{sum(values)}" if len(values) == len(lines) else f"{sum(values)} of {len(values)}"

        rounds = statistics.mean(int(line["rounds"] or 0) for line in lines)
        again = sum(line["rounds"] != line["first"] for line in lines)
        print(f"| {kind} {percent:g} % | {len(lines)}, {again} measured twice | {rounds:.0f} |", " | ".join(str(count(name)) for name in shown), "|")
        for which in ("cpu", "wall"):
            values = sorted(float(line[f"{which}_percent"] or 0) for line in lines)
            low, middle, high = (values[int(len(values) * q)] for q in (0.025, 0.5, 0.975))
            print(f"    {which} time: {middle:+.2f} % in the median, {low:+.2f} to {high:+.2f} % in 95 of 100", file=sys.stderr)


def steps_of(harness, place, values):
    """The steps that harness track, Otava and PELT find."""
    import math
    import numpy as np
    import ruptures
    from otava.analysis import compute_change_points

    path = f"{place}/history.jsonl"
    with open(path, "w") as history:
        for i, value in enumerate(values):
            record = {"schema": "octree-track/1", "commit": f"{i:040x}", "time": f"2026-01-01T00:{i // 60:02}:{i % 60:02}Z"}
            print(json.dumps({**record, "subject": "", "machine": "m", "metrics": {"c/seconds": value}}), file=history)
    subprocess.run([harness, "track", path, "--json", f"{path}.json"], check=True, capture_output=True)
    found = json.load(open(f"{path}.json"))
    ours = [change["at"] for series in found for change in series["changes"]]
    otava = [point.index for point in compute_change_points(np.array(values), window_len=2 * len(values))[0]]
    sigma = statistics.median(abs(a - b) for a, b in zip(values, values[1:])) / (0.6745 * math.sqrt(2))
    fitted = ruptures.Pelt(model="l2", min_size=2, jump=1).fit(np.array(values))
    pelt = fitted.predict(pen=sigma**2 * math.log(len(values)))[:-1]
    return {"track": ours, "otava": otava, "pelt": pelt}


def track(harness, place, trials):
    """Prints how often a step hidden by a drift is found within two commits, and how many steps are found where none is."""
    print("| history of 120 commits, noise of 1 % | detector | found | steps found elsewhere, in how many histories |")
    print("|---|---|---|---|")
    for drift, step in [(0, 0), (20, 0), (20, 3), (20, 5), (-20, 5), (-5, 5)]:
        found, wrong, histories = collections.Counter(), collections.Counter(), collections.Counter()
        for trial in range(int(trials)):
            draw = random.Random(f"{drift} {step} {trial}")
            at = draw.randrange(30, 90)
            mean = lambda i: (1 + drift / 100 * i / 120) * (1 + step / 100 * (i >= at))
            values = [mean(i) * draw.gauss(1, 0.01) for i in range(120)]
            for name, steps in steps_of(harness, place, values).items():
                near = [s for s in steps if step and abs(s - at) <= 2]
                found[name] += bool(near)
                wrong[name] += len(steps) - len(near)
                histories[name] += len(steps) > len(near)
        for name in ("track", "otava", "pelt"):
            of = f"{found[name]} of {trials}" if step else "-"
            print(f"| drift {drift:+} %, step {step:+} % | {name} | {of} | {wrong[name]} in {histories[name]} |")


if __name__ == "__main__":
    {"gates": gates, "table": table, "track": track}[sys.argv[1]](*sys.argv[2:])
