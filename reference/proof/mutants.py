#!/usr/bin/env python3
"""Changes the program in ways that make it accept too much, and shows that the proof then fails.

    mutants.py SOURCE OUT FILE...

SOURCE is reference/proof, OUT a directory for copies in that of the compiled proof, FILE... the names of the proof's files in order. Only
files that depend on a change are compiled again. Prints one line per mutant with the file whose proof fails. Exit codes: 0 every mutant breaks the proof, 1 one does not, or takes too long.
"""
import re
import shutil
import subprocess
import sys
from pathlib import Path

MUTANTS = {
    "side 3 is crossing": ("else if s =? 2 then Good (Cube Cross) (add i 1) else Bad", "else Good (Cube Cross) (add i 1)"),
    "leaves after the last octant": ("if i =? count p then Some t else None", "Some t"),
    "overlapping parts": ("  | _, _ => None\n  end.\n\nDefinition read", "  | _, _ => Some t\n  end.\n\nDefinition read"),
    "siblings that differ share memory": ("if same_brood u t then u else t", "u"),
    "counts of different lengths": ("(x =? y) && all_equal a b | _, _ => false end", "(x =? y) && all_equal a b | _, _ => true end"),
    "leaves of any edge count": ("if z =? w then 1 else 0", "1"),
    "leaves inside count as outside": ("Inner => Tally o (add i 1) x", "Inner => Tally (add o 1) i x"),
    "a child is not walked": ("pass walk n b u p q (sub x p) y z && ", ""),
    "pairs of a leaf and a finer one are skipped": ("Definition marked_skip (t : tree) (p : Z) (u : tree) (q : Z) : bool := most t p <=? least u q", "Definition marked_skip (t : tree) (p : Z) (u : tree) (q : Z) : bool := most t p <=? mul 2 (least u q)"),
    "balance of 4:1": ("if w <? mul 4 (least u q)", "if w <? mul 8 (least u q)"),
    "layers of n - 1": ("mul n w <=? mul 2 d else 0 <? d", "mul (sub n 1) w <=? mul 2 d else 0 <? d"),
    "a face is not checked": ("face k n Y b d && ", ""),
    "components of two sides": ("| _, _ => same a b end", "| _, _ => true end"),
    "seeds open walls": ("  | Cube k' => if same k k' then Cube Reached else t\n  | Node p q r a", "  | Cube _ => Cube Reached\n  | Node p q r a"),
    "seeds flood from outside": ("rounds kind_of_flow (Cube Cross)", "rounds kind_of_flow (Cube Reached)"),
    "leaves that the flood missed": ("seeds_reached t && every (fun k => negb (same kind_of_flow k)) t", "seeds_reached t"),
    "seeds in walls": ("same Reached (spot 19", "negb (same kind_of_flow (spot 19"),
    "enclosed without a far field": ("if may_enclose && far then Empty", "if may_enclose then Empty"),
    "the far field is not flooded": ("if may_enclose then rim Outer t else true", "true"),
    "holes in kept leaves": ("  | Cube k' => same k k'\n  | Node _ _ _ a b c d e f g h => filled k a", "  | Cube k' => same k k' || same Empty k'\n  | Node _ _ _ a b c d e f g h => filled k a"),
    "crossing leaves in the mesh": ("every (fun k => negb (same Cross k)) m && ", ""),
    "coarse crossing leaves": ("  | Cube k => negb (same Cross k)\n", "  | Cube _ => true\n"),
    "sums that wrap": ("(count p <=? 144115188075855872)", "true"),
    "layers without bound": ("(1 <=? layer_cells c) && (layer_cells c <=? 4096)", "(1 <=? layer_cells c)"),
    "one process is enough": ("a tt && b tt", "a tt"),
    "what is left is not checked": ("&& rest tt)", ")"),
    # Leastness.
    "touching leaves of the next level": ("find_around false 1 (Z.shiftr p 2) 1 p near", "find_around false 1 (Z.shiftr p 1) 1 p near"),
    "nearly touching leaves": ("find_around false 1 (Z.shiftr p 2) 1 p near", "find_around false 1 (Z.shiftr p 2) 2 p near"),
    "the extra layer at the surface level": ("(extra && (s <? p) &&", "(extra && (s <=? p) &&"),
    "the extra layer always": ("negb (keep_crossing c) && (layer_cells c <? 3)", "negb (keep_crossing c)"),
    "every leaf is a source": ("if early then Cube Cross else Cube Outer", "Cube Cross"),
    "a missing leaf is marked": ("full a && full b && full c", "full a && full c"),
    "a child is not searched": ("sources_only a && sources_only b && sources_only c", "sources_only a && sources_only c"),
    "a far source serves": ("find_around true w w (mul (sub n 1) w)", "find_around true w w (mul n w)"),
    "any leaf serves": ("find_around true w w", "find_around false w w"),
    "a coarser source serves": ("find_around true w w", "find_around true w p"),
    "a child is not served": ("served b w p w 0 0 near && ", ""),
    "sources may be near leaves of twice their edge": ("(Z.shiftr (most t p) 1)) <=? d", "(Z.shiftr (most t p) 2)) <=? d"),
    "leaves that are no sources may touch finer ones": ("((0 <? d) || sources_only t)", "true"),
    "coarse leaves may touch crossing ones": ("Cube Cross => p <=? s |", "Cube Cross => true |"),
    "sources at a wrong place": ("also k0 a b c (also k1 a' b c", "also k0 a b c (also k1 a b c"),
}
FILES = "Checker", "Causes", "Check"  # the program


def main(source, out, files):
    program = {file: (source / f"{file}.v").read_text() for file in FILES}
    survived = 0
    for name, (old, new) in MUTANTS.items():
        mutant = {file: text.replace(old, new) for file, text in program.items()}
        if mutant == program:
            print(f"{name}: the program has no {old!r}")
            survived += 1
            continue
        if name == "seeds in walls":  # one more parenthesis
            mutant["Check"] = mutant["Check"].replace("0 0 0 524288 t)) (seeds c).", "0 0 0 524288 t))) (seeds c).")
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        verdict, changed = "NOT NOTICED", {file for file in FILES if mutant[file] != program[file]}
        for file in files:
            text = mutant[file] if file in FILES else (source / f"{file}.v").read_text()
            imports = re.search(r"^From Proof Require Import (.*)\.$", text, re.MULTILINE)
            if file not in changed and not (imports and changed.intersection(imports[1].split())):
                shutil.copy(out.parent / f"{file}.vo", out)
                continue
            changed.add(file)
            (out / f"{file}.v").write_text(text)
            try:
                run = subprocess.run(["coqc", "-q", "-Q", ".", "Proof", f"{file}.v"], cwd=out, capture_output=True, timeout=200)
            except subprocess.TimeoutExpired:
                verdict = f"NOT DECIDED: {file}.v takes too long"
                break
            if run.returncode:
                verdict = f"the proof fails in {file}.v" if file not in FILES else "NOT A PROGRAM"
                break
        print(f"{name:48} {verdict}", flush=True)
        survived += "NOT" in verdict
    shutil.rmtree(out, ignore_errors=True)
    return 1 if survived else 0


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]))
