"""Sources with all changes of ci/mutants.py in them, each of which is selected at run time."""

import re
from collections import defaultdict

# Appended to the root of every library and program. `at` returns the number of the selected change, 0 for none.
RUNTIME = """
#[doc(hidden)]
mod __mutants {
    use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
    const UNKNOWN: u32 = u32::MAX;
    const TRACE: u32 = u32::MAX - 1;
    static NOW: AtomicU32 = AtomicU32::new(UNKNOWN);
    static SEEN: [AtomicBool; COUNT] = [const { AtomicBool::new(false) }; COUNT];
    #[inline]
    pub(crate) fn at(function: u32) -> u32 {
        let now = NOW.load(Relaxed);
        if now < TRACE { now } else { first(function) }
    }
    #[cold]
    fn first(function: u32) -> u32 {
        let file = std::env::var_os("MUTANT_TRACE");
        if NOW.load(Relaxed) == UNKNOWN {
            let selected = std::env::var("MUTANT").ok().and_then(|number| number.parse().ok());
            NOW.store(if file.is_some() { TRACE } else { selected.unwrap_or(0) }, Relaxed);
        }
        if let Some(file) = file
            && !SEEN[function as usize].swap(true, Relaxed)
        {
            use std::io::Write;
            let mut file = std::fs::OpenOptions::new().append(true).create(true).open(file).unwrap();
            file.write_all(format!("{function}\\n").as_bytes()).unwrap();
        }
        let now = NOW.load(Relaxed);
        if now < TRACE { now } else { 0 }
    }
}
"""
ALLOW = "#![allow(warnings, arithmetic_overflow, unconditional_panic, clippy::all)]\n"

# What must not be mistaken for a brace of the code: comments, strings, characters.
TOKEN = re.compile(
    r"//[^\n]*|/\*.*?\*/|b?r(#*)\".*?\"\1|b?\"(?:\\.|[^\"\\])*\"|b?'(?:\\[^\n]+?|[^'\\\n])'|[{}()\[\]]", re.DOTALL
)


class Source:
    """A file, and the positions of its lines."""

    def __init__(self, path):
        self.text = path.read_text()
        self.starts = [0] + [match.end() for match in re.finditer("\n", self.text)]

    def offset(self, position):
        return self.starts[position["line"] - 1] + position["column"] - 1

    def range(self, span):
        return self.offset(span["start"]), self.offset(span["end"])

    def body(self, span):
        """The positions after the opening and before the closing brace of a function's body."""
        start, end = self.range(span)
        depth = 0
        for token in TOKEN.finditer(self.text, start, end):
            if token[0] in ("(", "["):
                depth += 1
            elif token[0] in (")", "]"):
                depth -= 1
            elif token[0] == "{" and depth == 0:
                return token.end(), self.text.rindex("}", start, end)
        return None


def needs_own_build(tree, mutant, sources):
    """Whether a copy of the body cannot be selected at run time: outside functions, in constants, for types that have no name."""
    function = mutant.get("function")
    if not function:
        return True
    source = sources.setdefault(mutant["file"], Source(tree / mutant["file"]))
    body = source.body(function["span"])
    if body is None:
        return True
    head = TOKEN.sub(lambda token: token[0] if len(token[0]) == 1 else "", source.text[source.offset(function["span"]["start"]) : body[0]])
    return bool(re.search(r"\bconst\s+(unsafe\s+)?fn\b", head)) or "impl " in (function["return_type"] or "")


def write_changes(tree, mutants, sources, roots):
    """Writes the files with all of `mutants`, numbered from 1 by their field `number`."""
    functions = defaultdict(list)
    for mutant in mutants:
        span = mutant["function"]["span"]
        functions[mutant["file"], sources[mutant["file"]].body(span)].append(mutant)
    insertions = defaultdict(list)
    for (file, (start, end)), changes in functions.items():
        text = sources[file].text
        lines = [f" match crate::__mutants::at({changes[0]['id']}) {{\n"]
        for mutant in changes:
            mutant["reached by"] = changes[0]["id"]
            first, last = sources[file].range(mutant["span"])
            body = text[start:first] + mutant["replacement"] + text[last:end]
            lines.append(f"{mutant['id']} => return {{\n//@ {mutant['id']}\n{body}\n//@ 0\n}},\n")
        lines.append("_ => {}\n}\n")
        insertions[file].append((start, "".join(lines)))
    for file, source in sources.items():
        text = source.text
        for start, lines in sorted(insertions[file], reverse=True):
            text = text[:start] + lines + text[start:]
        (tree / file).write_text(text)
    for root in roots:
        text = root.read_text()
        if ALLOW not in text:
            root.write_text(ALLOW + text + RUNTIME.replace("COUNT", str(max(m["id"] for m in mutants) + 1)))
