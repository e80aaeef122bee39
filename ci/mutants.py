"""Tries changes of one crate against its tests, for ci/mutants, which documents the use.

All changes are compiled into the same programs: the body of a function begins with a copy of itself for each of its changes, and the
environment variable MUTANT selects one. A first run of every test records the functions that it reaches; a change is then tried
by the tests that reach its function only, the shortest first, each in a process of its own, until one fails.
"""

import argparse
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

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


ROUNDS = 12  # Attempts to compile, each without the changes that the one before refused.
MEMORY = 8 << 30
FILE_SIZE = 2 << 30
REFUSED = "does not compile"
SLOW_S = 6  # A test with more CPU time than this tries no change.
# Random cases of the tests that read these variables: fewer than usual, and the same for every change.
DRAWS = {"PROPTEST_CASES": "128", "PROPTEST_MAX_SHRINK_ITERS": "0", "PROPTEST_RNG_SEED": "1"}


def fail(code, message):
    print(f"mutants: {message}", file=sys.stderr)
    sys.exit(code)


def cpu_s():
    """CPU time of this process and those that it has waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def update(tree, repository):
    """Makes `tree` a copy of the files in `repository`. Files that are equal keep their time, so that cargo compiles only what changed."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=repository, capture_output=True, text=True, check=True
    )
    files = {name for name in listed.stdout.split("\0") if name and (repository / name).is_file()}
    for path in [path for path in tree.rglob("*") if path.is_file()]:
        if str(path.relative_to(tree)) not in files:
            path.unlink()
    for name in files:
        content = (repository / name).read_bytes()
        if not (tree / name).is_file() or (tree / name).read_bytes() != content:
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            (tree / name).write_bytes(content)
            shutil.copymode(repository / name, tree / name)


def rename(tree):
    """Gives the crates of the copy another version: with the same one, cargo would take their programs for those of the repository."""
    manifest = tree / "Cargo.toml"
    manifest.write_text(re.sub(r'^(version = "[^"+]+)"', r'\1+mutants"', manifest.read_text(), count=1, flags=re.MULTILINE))


def described(mutant):
    """The change without its line, which moves with every edit."""
    return re.sub(r"^([^:]*):\d+:\d+: ", r"\1: ", mutant["name"])


def messages(command, tree):
    """The messages of cargo about the compilation, and whether it succeeded."""
    done = subprocess.run(command, cwd=tree, stdout=subprocess.PIPE, text=True)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")], done.returncode == 0


def refused(reported, tree):
    """The numbers of the changes that the compiler refuses. Fails if an error is outside all changes."""
    numbers, lines = set(), {}
    for message in reported:
        message = message.get("message", {})
        if not isinstance(message, dict) or message.get("level") != "error" or not message.get("spans"):
            continue
        found = set()
        spans = sorted(message["spans"], key=lambda span: not span["is_primary"])
        for span in spans:
            if span.get("expansion"):  # An error in a macro of another crate is where the macro is used.
                spans.append(span["expansion"]["span"])
            file = span["file_name"]
            if file not in lines:
                current, lines[file] = 0, [0]
                path = tree / file
                for line in path.read_text().splitlines() if path.is_file() else []:
                    if line.startswith("//@ "):
                        current = int(line[4:])
                    lines[file].append(current)
            if span["line_start"] < len(lines[file]) and lines[file][span["line_start"]]:
                found.add(lines[file][span["line_start"]])
                break
        if not found:
            fail(3, f"the tree does not compile, for another reason than a change:\n{message['rendered']}")
        numbers |= found
    return numbers


def limit(process, cpu_s):
    """Limits a process that was just started: `preexec_fn` would not be safe beside other threads."""
    resource.prlimit(process, resource.RLIMIT_CPU, (cpu_s, cpu_s + 5))
    resource.prlimit(process, resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.prlimit(process, resource.RLIMIT_FSIZE, (FILE_SIZE, FILE_SIZE))
    resource.prlimit(process, resource.RLIMIT_CORE, (0, 0))


def run(test, scratch, limit_cpu_s, limit_wall_s, **environment):
    """Runs one test: "passed", "failed" or "timed out", and its CPU time in seconds."""
    temporary = tempfile.mkdtemp(dir=scratch)
    child = subprocess.Popen(
        [test["program"], "--exact", test["name"], "--test-threads", "1"],
        cwd=test["package"],
        env=os.environ | {"TMPDIR": temporary, "CARGO_MANIFEST_DIR": test["package"], "RUST_MIN_STACK": str(8 << 20), **DRAWS, **environment},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    limit(child.pid, limit_cpu_s)
    late = threading.Timer(limit_wall_s, os.killpg, [child.pid, signal.SIGKILL])
    late.start()
    _, status, usage = os.wait4(child.pid, 0)
    late.cancel()
    child.returncode = code = os.waitstatus_to_exitcode(status)
    try:
        os.killpg(child.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    shutil.rmtree(temporary, ignore_errors=True)
    outcome = "passed" if code == 0 else "timed out" if code in (-signal.SIGXCPU, -signal.SIGKILL) else "failed"
    return outcome, usage.ru_utime + usage.ru_stime


def tests_of(reported):
    """All tests of the compiled test programs."""
    tests = []
    for message in reported:
        if message.get("reason") == "compiler-artifact" and message.get("executable") and message["profile"]["test"]:
            listed = subprocess.run([message["executable"], "--list", "--format", "terse"], capture_output=True, text=True)
            names = [line.removesuffix(": test") for line in listed.stdout.splitlines() if line.endswith(": test")]
            ignored = subprocess.run(
                [message["executable"], "--list", "--format", "terse", "--ignored"], capture_output=True, text=True
            ).stdout.splitlines()
            package = str(Path(message["manifest_path"]).parent)
            for name in names:
                if f"{name}: test" not in ignored:
                    tests.append({"program": message["executable"], "package": package, "name": name})
    return tests


def interval(good, count):
    """The 95 % interval of a proportion (Wilson), in percent."""
    if count == 0:
        return 0.0, 100.0
    z, p = 1.96, good / count
    middle = p + z * z / (2 * count)
    width = z * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return 100 * (middle - width) / (1 + z * z / count), 100 * (middle + width) / (1 + z * z / count)


def summary(crate, total, apart, outcomes, refused_count, known):
    """Prints the result; returns whether every survivor is explained."""
    survivors = [mutant for mutant, outcome in outcomes if outcome in ("survived", "not reached")]
    explained = [mutant for mutant in survivors if described(mutant) in known]
    unexplained = [(mutant, outcome) for mutant, outcome in outcomes if mutant in survivors and mutant not in explained]
    caught = len(outcomes) - len(survivors)
    late = sum(outcome == "timed out" for _, outcome in outcomes)
    low, high = interval(caught, len(outcomes) - len(explained))
    score = 100 * caught / max(1, len(outcomes) - len(explained))
    print(
        f"{crate}: {len(outcomes)} of {total} changes tried: {caught} noticed ({late} by the limit of time), {len(survivors)} survived,"
        f" {len(explained)} of them explained; {refused_count} do not compile, {apart} need a build of their own\n"
        f"{crate}: score {score:.1f} %, 95 % interval {low:.1f} to {high:.1f} %"
    )
    noticed = sorted({described(mutant) for mutant, outcome in outcomes if outcome not in ("survived", "not reached")} & known)
    if noticed:
        print("listed, but noticed now:", *noticed, sep="\n")
    if unexplained:
        print("survivors that are not listed in ci/mutants.known:")
        print(*(f"{mutant['name']}{' (reached by no test)' if outcome == 'not reached' else ''}" for mutant, outcome in unexplained), sep="\n")
    return not unexplained


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("crate")
    parser.add_argument("--repository", type=Path, required=True)
    parser.add_argument("--tree", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--known", type=Path, required=True)
    parser.add_argument("--sample", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--file", action="append", default=[])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--minutes", type=float, default=math.inf)
    parser.add_argument("--tests", default="")
    given = parser.parse_args()
    tree = given.tree
    update(tree, given.repository)
    rename(tree)
    known = {line for line in given.known.read_text().splitlines() if line and line[0] not in "#[ "}

    listed = subprocess.run(["cargo", "mutants", "--list", "--json", "--package", given.crate], cwd=tree, capture_output=True, text=True)
    if listed.returncode != 0:
        fail(2, f"the changes of {given.crate} cannot be listed: {listed.stderr.strip()}")
    every = json.loads(listed.stdout)
    if not every:
        fail(2, f"{given.crate} is not a package of this workspace, or has no code")
    names = {mutant["name"] for mutant in every}
    every = [mutant for mutant in every if not given.file or any(pattern in mutant["file"] for pattern in given.file)]
    if not every:
        fail(2, f"no file of {given.crate} with a change has a path that contains {' or '.join(given.file)}")
    mutants = random.Random(given.seed).sample(every, min(given.sample or len(every), len(every)))
    sources = {}
    apart = [mutant for mutant in mutants if needs_own_build(tree, mutant, sources)]
    mutants = [mutant for mutant in mutants if mutant not in apart]
    mutants.sort(key=lambda mutant: (mutant["file"], mutant["function"]["span"]["start"]["line"]))
    for number, mutant in enumerate(mutants, 1):
        mutant["id"] = number
        sources.setdefault(mutant["file"], Source(tree / mutant["file"]))

    metadata = json.loads(subprocess.run(["cargo", "metadata", "--no-deps", "--format-version", "1"], cwd=tree, capture_output=True).stdout)
    package = next(package for package in metadata["packages"] if package["name"] == given.crate)
    roots = [Path(target["src_path"]) for target in package["targets"] if target["kind"][0] in ("lib", "bin")]
    for root in roots:
        sources.setdefault(str(root.relative_to(tree)), Source(root))

    given.out.mkdir(parents=True, exist_ok=True)
    results = given.out / "changes.jsonl"
    kept = [json.loads(line) for line in results.read_text().splitlines()] if given.resume and results.exists() else []
    kept = {record["name"]: record for record in kept if record["name"] in names and record["outcome"] in ("noticed", "timed out", REFUSED)}
    viable = [mutant for mutant in mutants if kept.get(mutant["name"], {}).get("outcome") != REFUSED]
    for _ in range(ROUNDS):
        if not viable:
            fail(3, f"none of {len(apart) + len(mutants)} changes of {given.crate} compiles and can be selected at run time: take more of them")
        write_changes(tree, viable, sources, roots)
        # With all changes, a crate in one unit takes ten minutes and 9 GB to compile.
        units = f"profile.dev.package.{given.crate}.codegen-units=16"
        build = ["cargo", "test", "--quiet", "--config", units, "--no-run", "--message-format", "json", "--package", given.crate, *given.tests.split()]
        reported, is_compiled = messages(build, tree)
        if is_compiled:
            break
        numbers = refused(reported, tree)
        viable = [mutant for mutant in viable if mutant["id"] not in numbers]
        print(f"{given.crate}: {len(numbers)} changes do not compile", flush=True)
    else:
        fail(3, f"{given.crate} still does not compile after {ROUNDS} attempts")
    print(f"{given.crate}: compiled after {cpu_s():.0f} s of CPU time", flush=True)

    scratch = tempfile.mkdtemp(prefix="mutants-")
    tests = tests_of(reported)
    slow, failing = [], []

    def trace(test):
        """Adds to a test its CPU time and the functions that it reaches."""
        reached = Path(tempfile.mkdtemp(dir=scratch)) / "functions"
        outcome, test["cpu_s"] = run(test, scratch, SLOW_S, 600, MUTANT_TRACE=str(reached))
        if outcome != "passed":
            (failing if outcome == "failed" else slow).append(test)
        test["reaches"] = {int(line) for line in reached.read_text().split()} if reached.exists() else set()

    with ThreadPoolExecutor(given.jobs) as pool:
        list(pool.map(trace, tests))
    tests = sorted((test for test in tests if test not in slow + failing), key=lambda test: test["cpu_s"])
    print(f"{given.crate}: {len(tests)} tests take {sum(test['cpu_s'] for test in tests):.1f} s of CPU time", flush=True)
    for left_out, why in [(slow, f"take more than {SLOW_S} s"), (failing, "fail without a change")]:
        print(f"{given.crate}: left out because they {why}:", *[test["name"] for test in left_out] or ["none"], flush=True)

    outcomes = [(mutant, kept[mutant["name"]]["outcome"]) for mutant in viable if mutant["name"] in kept]
    untried = [mutant for mutant in viable if mutant["name"] not in kept]
    random.Random(given.seed).shuffle(untried)
    killers = defaultdict(list)
    end = time.monotonic() + 60 * given.minutes

    def tried(mutant):
        """The record of a change; `None` after the end."""
        if time.monotonic() > end:
            return None
        function, spent_s, killer = mutant["reached by"], 0.0, None
        reaching = [test for test in tests if function in test["reaches"]]
        # A test that noticed another change of the function comes first.
        reaching.sort(key=lambda test: (test["name"] not in killers[function], test["cpu_s"]))
        outcome = "survived" if reaching else "not reached"
        for test in reaching:
            result, seconds = run(test, scratch, int(2 + 5 * test["cpu_s"]), 120 + 20 * test["cpu_s"], MUTANT=str(mutant["id"]))
            spent_s += seconds
            if result != "passed":
                outcome, killer = ("noticed" if result == "failed" else result), test["name"]
                killers[function].append(killer)
                break
        return {"name": mutant["name"], "outcome": outcome, "test": killer, "cpu_s": round(spent_s, 3)}

    with open(results, "w") as log, ThreadPoolExecutor(given.jobs) as pool:
        compiled = {mutant["name"] for mutant in viable}
        kept |= {name: {"name": name, "outcome": REFUSED} for name in (mutant["name"] for mutant in mutants) if name not in compiled}
        log.writelines(json.dumps(record) + "\n" for record in kept.values())
        for mutant, record in zip(untried, pool.map(tried, untried)):
            if record:
                outcomes.append((mutant, record["outcome"]))
                log.write(json.dumps(record) + "\n")
                log.flush()
    shutil.rmtree(scratch, ignore_errors=True)
    print(f"{given.crate}: {cpu_s():.0f} s of CPU time in all")
    complete = summary(given.crate, len(every), len(apart), outcomes, len(mutants) - len(viable), known)
    if not outcomes:
        print(f"{given.crate}: no change was tried")
    sys.exit(0 if complete and outcomes else 1)


if __name__ == "__main__":
    main()
