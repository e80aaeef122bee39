"""Proves facts about kernels, or shows that planted faults break the proofs. Started by ci/kernels, which describes it.

    prove.py [--mutants | --values] [NAME...]
"""
import sys
import time
from multiprocessing import Pool
from pathlib import Path

import facts_bricks  # noqa: F401  (its facts are entered in FACTS)
import facts_geometry  # noqa: F401
import values
import z3
from kernels import FACTS, FILES, Kernels
from rust import MESHER, Sources

VALUES = Path(__file__).with_name("values.txt")
# Beside other work: ci/kernels alone takes seconds per fact.
TIMEOUT_S = 600


def unknowns(e):
    """The names of the unknowns of a term."""
    names, stack, seen = set(), [e], set()
    while stack:
        x = stack.pop()
        if x.get_id() not in seen:
            seen.add(x.get_id())
            stack += x.children()
            if z3.is_const(x) and x.decl().kind() == z3.Z3_OP_UNINTERPRETED:
                names.add(str(x))
    return names


def verdict(given, goal):
    """Whether z3 finds the opposite of a goal impossible, and how it answers otherwise. Only what is given about its unknowns matters."""
    if isinstance(goal, bool):
        return "unsat" if goal else "sat"
    solver, names = z3.Solver(), unknowns(goal)
    solver.set("timeout", 1000 * TIMEOUT_S)
    solver.add(z3.Not(goal), *[g for g, of in given if of & names])
    return str(solver.check())


def proven(fact, sources):
    """Whether a fact holds, or the verdict on the first part that does not; and the number of parts."""
    k, parts = Kernels(sources), 0
    given = []
    def holds(goals):
        nonlocal parts
        given.extend((g, unknowns(g)) for g in k.given[len(given):])
        goals = [goals] if isinstance(goals, bool) else [k.linear(z3.And(goals))]
        parts += 1
        return verdict(given, goals[0])
    for goal in fact(k):
        answer = holds(goal if isinstance(goal, bool) else [goal])
        if answer != "unsat":
            return answer, parts
    # What intervals do not decide.
    open_ranges = [z3.Implies(path, z3.And(low <= x, x <= high)) for path, low, x, high in k.ranges if not (low <= k.interval(x)[0] and k.interval(x)[1] <= high)]
    checks = k.checks + open_ranges
    for i in range(0, len(checks), 40):
        answer = holds(checks[i:i + 40])
        if answer != "unsat":
            return f"{answer}, overflow", parts
    return "unsat", parts


def row(name):
    """The line of a fact, and whether it is proven."""
    fact, start = next(f for f in FACTS if f.__name__ == name), time.process_time()
    answer, parts = proven(fact, Sources(FILES))
    return f"{name:20} {time.process_time() - start:5.1f} s  {parts:3}  {answer:8} {' '.join(fact.__doc__.split())} [{fact.file}]", answer == "unsat"


def planted(mutant):
    """The line of a fault, and whether the proof fails. A fault may also make an index, a shift or a sum of known numbers impossible."""
    name, change = mutant
    impossible = OverflowError, IndexError
    fact, start, sources = next(f for f in FACTS if f.__name__ == name), time.process_time(), Sources(FILES, change)
    try:
        answer = proven(fact, sources)[0]
    except impossible as e:
        answer = type(e).__name__
    try:
        recorded = VALUES.read_text().splitlines()
        tested = "values differ" if any(line not in recorded for line in values.lines(sources, [change[0]])) else "values agree"
    except impossible:
        tested = "values differ"
    old, new = (" ".join(text.split()) for text in change[1:])
    return f"{name:20} {time.process_time() - start:5.1f} s  {answer:14} {tested:14} {old}  ->  {new}", answer not in ("unsat", "unknown", "unknown, overflow")


def table(rows, tasks):
    """Prints the lines of all tasks, of which each core takes one after the other. Returns how many failed."""
    failed = 0
    with Pool() as pool:
        for line, is_right in pool.imap(rows, tasks):
            print(line if is_right else f"{line}  NOT PROVEN" if rows is row else f"{line}  NOT FOUND", flush=True)
            failed += not is_right
    return failed


def compared():
    """Whether values.txt has the values of these sources, and a test compares those of every file."""
    sources = Sources(FILES)
    if VALUES.read_text().splitlines() != list(values.lines(sources)):
        print("values.txt is not of these sources: ci/kernels --values writes it")
        return 1
    missing = [f for f in sorted({file for file, _ in values.INPUTS}) if not any(f'"{f}"' in test.read_text() for test in (MESHER / f, MESHER / f.replace(".rs", "/tests.rs")) if test.exists())]
    if missing:
        print(f"no test compares the values of {missing}")
    return len(missing)


def main(options):
    names = [o for o in options if not o.startswith("--")]
    chosen = [f for f in FACTS if not names or f.__name__ in names]
    if names and len(chosen) != len(names) or not set(options) - set(names) <= {"--mutants", "--values"}:
        print(f"prove.py: the facts are {', '.join(f.__name__ for f in FACTS)}", file=sys.stderr)
        return 2
    if "--values" in options:
        VALUES.write_text("".join(f"{line}\n" for line in values.lines(Sources(FILES))))
        return 0
    began = time.time()
    if "--mutants" in options:
        tasks = [(f.__name__, change) for f in chosen for change in f.mutants]
        failed = table(planted, tasks)
        print(f"{len(tasks) - failed} of {len(tasks)} faults break the proof of their fact, in {time.time() - began:.0f} s")
    else:
        failed = table(row, [f.__name__ for f in chosen])
        print(f"{len(chosen) - failed} of {len(chosen)} facts are proven, in {time.time() - began:.0f} s")
        failed += 0 if names else compared()
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
