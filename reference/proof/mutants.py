#!/usr/bin/env python3
"""Changes the program in ways that make it accept too much, and shows that the proof then fails.

    mutants.py SOURCE OUT FILE...

SOURCE is reference/proof, OUT a directory for copies in that of the compiled proof, FILE... the names of the proof's files in order. Of
the files that depend on a change, those are compiled again that lead to the one in which the proof should fail. Prints one line per
mutant with the file whose proof fails. Exit codes: 0 every mutant breaks the proof, 1 one does not, or takes too long.
"""
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

# Name, the file in which the proof fails, what is replaced, and by what.
MUTANTS = {
    "side 3 is crossing": ("Reading", "else if s =? 2 then Good (Cube Cross) (add i 1) else Bad", "else Good (Cube Cross) (add i 1)"),
    "leaves after the last octant": ("Reading", "if i =? count p then Some t else None", "Some t"),
    "overlapping parts": ("Reading", "  | _, _ => None\n  end.\n\nDefinition read", "  | _, _ => Some t\n  end.\n\nDefinition read"),
    "siblings that differ share memory": ("Octants", "if same_brood u t then u else t", "u"),
    "counts of different lengths": ("Counts", "(x =? y) && all_equal a b | _, _ => false end", "(x =? y) && all_equal a b | _, _ => true end"),
    "leaves of any edge count": ("Counts", "if z =? w then 1 else 0", "1"),
    "leaves inside count as outside": ("Counts", "Inner => Tally o (add i 1) x", "Inner => Tally (add o 1) i x"),
    "a child is not walked": ("Pairs", "pass walk n b u p q (sub x p) y z && ", ""),
    "pairs of a leaf and a finer one are skipped": ("Sources", "Definition marked_skip (t : tree) (p : Z) (u : tree) (q : Z) : bool := most t p <=? least u q", "Definition marked_skip (t : tree) (p : Z) (u : tree) (q : Z) : bool := most t p <=? mul 2 (least u q)"),
    "balance of 4:1": ("Pairs", "if w <? mul 4 (least u q)", "if w <? mul 8 (least u q)"),
    "layers of n - 1": ("Pairs", "mul n w <=? mul 2 d else 0 <? d", "mul (sub n 1) w <=? mul 2 d else 0 <? d"),
    "a face is not checked": ("Pairs", "face k n Y b d && ", ""),
    "components of two sides": ("Pairs", "| _, _ => same a b end", "| _, _ => true end"),
    "seeds open walls": ("Flood", "  | Cube k' => if same k k' then Cube Reached else t\n  | Node p q r a", "  | Cube _ => Cube Reached\n  | Node p q r a"),
    "seeds flood from outside": ("Base", "rounds kind_of_flow (Cube Cross)", "rounds kind_of_flow (Cube Reached)"),
    "leaves that the flood missed": ("Sound", "seeds_reached t && every (fun k => negb (same kind_of_flow k)) t", "seeds_reached t"),
    "seeds in walls": ("Sound", "same Reached (spot 19", "negb (same kind_of_flow (spot 19"),
    "enclosed without a far field": ("Sound", "if may_enclose && far then Empty", "if may_enclose then Empty"),
    "the far field is not flooded": ("Sound", "if may_enclose then rim Outer t else true", "true"),
    "holes in kept leaves": ("Base", "  | Cube k' => same k k'\n  | Node _ _ _ a b c d e f g h => filled k a", "  | Cube k' => same k k' || same Empty k'\n  | Node _ _ _ a b c d e f g h => filled k a"),
    "crossing leaves in the mesh": ("Sound", "every (fun k => negb (same Cross k)) m && ", ""),
    "coarse crossing leaves": ("Base", "  | Cube k => negb (same Cross k)\n", "  | Cube _ => true\n"),
    "sums that wrap": ("Reading", "(count p <=? 144115188075855872)", "true"),
    "layers without bound": ("Sound", "(1 <=? layer_cells c) && (layer_cells c <=? 4096)", "(1 <=? layer_cells c)"),
    "one process is enough": ("Least", "a tt && b tt", "a tt"),
    "what is left is not checked": ("Least", "&& rest tt)", ")"),
    # Leastness.
    "touching leaves of the next level": ("Sources", "find_around false 1 (Z.shiftr p 2) 1 p near", "find_around false 1 (Z.shiftr p 1) 1 p near"),
    "nearly touching leaves": ("Sources", "find_around false 1 (Z.shiftr p 2) 1 p near", "find_around false 1 (Z.shiftr p 2) 2 p near"),
    "the extra layer at the surface level": ("Sources", "(extra && (s <? p) &&", "(extra && (s <=? p) &&"),
    "the extra layer always": ("Least", "negb (keep_crossing c) && (layer_cells c <? 3)", "negb (keep_crossing c)"),
    "every leaf is a source": ("Sources", "if early then Cube Cross else Cube Outer", "Cube Cross"),
    "a missing leaf is marked": ("Sources", "full a && full b && full c", "full a && full c"),
    "a child is not searched": ("Sources", "sources_only a && sources_only b && sources_only c", "sources_only a && sources_only c"),
    "a far source serves": ("Sources", "find_around true w w (mul (sub n 1) w)", "find_around true w w (mul n w)"),
    "any leaf serves": ("Sources", "find_around true w w", "find_around false w w"),
    "a coarser source serves": ("Sources", "find_around true w w", "find_around true w p"),
    "a child is not served": ("Sources", "served b w p w 0 0 near && ", ""),
    "sources may be near leaves of twice their edge": ("Sources", "(Z.shiftr (most t p) 1)) <=? d", "(Z.shiftr (most t p) 2)) <=? d"),
    "leaves that are no sources may touch finer ones": ("Sources", "((0 <? d) || sources_only t)", "true"),
    "coarse leaves may touch crossing ones": ("Sources", "Cube Cross => p <=? s |", "Cube Cross => true |"),
    "sources at a wrong place": ("Near", "also k0 a b c (also k1 a' b c", "also k0 a b c (also k1 a b c"),
}
FILES = "Checker", "Check"  # the program


def imports(text):
    found = re.search(r"^From Proof Require Import (.*)\.$", text, re.MULTILINE)
    return set(found[1].split()) if found else set()


def verdict(name, source, out, files):
    """Compiles what the file in which the proof should fail needs, as far as it depends on the change, and this file."""
    expected, old, new = MUTANTS[name]
    texts = {file: (source / f"{file}.v").read_text() for file in files}
    mutant = {file: text.replace(old, new) if file in FILES else text for file, text in texts.items()}
    if name == "seeds in walls":  # one more parenthesis
        mutant["Check"] = mutant["Check"].replace("0 0 0 524288 t)) (seeds c).", "0 0 0 524288 t))) (seeds c).")
    changed = {file for file in FILES if mutant[file] != texts[file]}
    if not changed:
        return f"NOT IN THE PROGRAM: {old!r}"
    needed = {expected}
    for file in reversed(files):
        if file in needed:
            needed |= imports(texts[file])
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for file in filter(needed.__contains__, files):
        if file not in changed and not changed & imports(texts[file]):
            shutil.copy(out.parent.parent / f"{file}.vo", out)
            continue
        changed.add(file)
        (out / f"{file}.v").write_text(mutant[file])
        try:
            code = subprocess.run(["coqc", "-q", "-Q", ".", "Proof", f"{file}.v"], cwd=out, capture_output=True, timeout=600).returncode
        except subprocess.TimeoutExpired:
            return f"NOT DECIDED: {file}.v takes too long"
        if code:
            return f"the proof fails in {file}.v" if file not in FILES else "NOT A PROGRAM"
    return f"NOT NOTICED by {expected}.v"


def main(source, out, files):
    def run(name):
        answer = verdict(name, source, out / str(list(MUTANTS).index(name)), files)
        print(f"{name:48} {answer}", flush=True)
        return "NOT" in answer

    shutil.rmtree(out, ignore_errors=True)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        survived = sum(pool.map(run, MUTANTS))
    shutil.rmtree(out, ignore_errors=True)
    print(f"{len(MUTANTS) - survived} of {len(MUTANTS)} mutants break the proof")
    return 1 if survived else 0


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]))
