//! Engines, oracles and launchers that are missing, hang, flood or lie, under the commands that run them.

use crate::place::{Files, HANGS, Place, TMP};
use crate::programs::inputs;
use crate::tools::{HARNESS, is_full, program, skip};
use crate::{Row, Table};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Time for a command: several programs may hang until their limit of a second, and are then given time to end.
const LIMIT: Duration = HANGS;

/// The real program, whose output is `$out` and whose report is `$json` afterwards.
const HONEST: &str = "out=; json=; last=; for word; do case \"$last\" in --out) out=$word;; --json) json=$word;; esac; last=$word; done\n\
                      \"$REAL\" \"$@\" || exit";

/// What is wrong with a program, and a shell script that acts so.
type Lie<'a> = (&'a str, &'a str);

/// The time limit of a program that acts so, in seconds: long, unless it lasts until its limit.
fn timeout(lie: Lie) -> &'static str {
    if lie.0.contains("hangs") || lie.0.contains("floods") { "1" } else { "600" }
}

const PROGRAMS: [Lie<'static>; 7] = [
    ("hangs", "sleep 600"),
    ("hangs and ignores SIGTERM", "trap '' TERM INT HUP; while :; do sleep 1; done"),
    ("floods its standard output", "yes"),
    ("floods its standard error", "yes >&2"),
    ("ends with exit code 0 and no output", "exit 0"),
    ("is killed", "kill -9 $$"),
    ("ends with an unknown exit code", "echo strange >&2; exit 99"),
];

const MESHERS: [Lie<'static>; 6] = [
    ("wrong number of leaves", "sed -i 's/\"leaves\": [0-9]*,/\"leaves\": 7,/' \"$out/mesh.json\""),
    (
        "wrong digest",
        "sed -i 's/\"digest\": \"[0-9a-f]*\"/\"digest\": \"00000000000000000000000000000001\"/' \"$out/mesh.json\"",
    ),
    ("truncated part", "truncate -s -8 \"$out/leaves-00000.npy\""),
    ("empty part", "truncate -s 0 \"$out/leaves-00000.npy\""),
    ("no manifest", "rm -f \"$out/mesh.json\""),
    ("manifest that is no JSON", "echo '{' > \"$out/mesh.json\""),
];

/// A report that lies.
const REPORTS: [Lie<'static>; 3] = [
    ("wrong number of cells in the report", "sed -i 's/\"cells\": [0-9]*/\"cells\": 7/' \"$json\""),
    (
        "wrong digest in the report",
        "sed -i 's/\"digest\": \"[0-9a-f]*\"/\"digest\": \"00000000000000000000000000000001\"/' \"$json\"",
    ),
    ("report that is no JSON", "echo '{' > \"$json\""),
];

/// Every lie under the commands that it concerns.
pub fn family() {
    let (Some(mesher), Some(reference)) = (program("mesher"), program("reference")) else {
        return skip("programs that lie", "mesher and reference were not built");
    };
    let place = inputs(&mesher);
    let both =
        "[[case]]\nname = \"case.toml\"\nlayers = [\"correctness\", \"counters\"]\nranks = [2]\n";
    place.write("both.toml", both);
    let test =
        Test { place: &place, mesher: &mesher, reference: &reference, before: place.files() };
    let mut table = Table::new();
    for lie in PROGRAMS {
        let is_slow = timeout(lie) == "1";
        let commands = if is_slow && !is_full() { &COMMANDS[..1] } else { &COMMANDS[..] };
        commands.iter().for_each(|command| table.push(test.mesher(command, lie, lie.1)));
        table.push(test.oracle(lie));
        table.push(test.launcher(lie));
    }
    for lie in MESHERS {
        let script = format!("{HONEST}\n[ ! -d \"$out\" ] || {}", lie.1);
        table.push(test.mesher(&COMMANDS[0], lie, &script));
    }
    for lie in REPORTS {
        let script = format!("{HONEST}\n[ ! -f \"$json\" ] || {}", lie.1);
        COMMANDS[..2].iter().for_each(|command| table.push(test.mesher(command, lie, &script)));
    }
    for lie in [
        (
            "puts all points inside",
            "head -c $(($(wc -c < \"$1\") / 24)) /dev/zero | tr '\\0' '\\1' > \"$3\"",
        ),
        ("gives too few sides", "echo > \"$3\""),
    ] {
        table.push(test.oracle(lie));
    }
    table.push(test.missing());
    table.finish("programs that hang, flood or lie");
}

/// Reads a question, whose words become the arguments.
const QUESTION: &str = r#"read -r line; eval "set -- $(echo "$line" | tr '[],' '   ')""#;

/// Commands that run a mesher, with the exit codes that they may have.
const COMMANDS: [(&str, &str, &[i32]); 5] = [
    (
        "verify",
        "verify case.toml --no-mpi --no-oracles --no-p4est --timeout LIMIT --reference REFERENCE",
        &[1, 3],
    ),
    (
        "gate",
        "gate --rules both.toml --layers correctness,counters --timeout LIMIT --baseline REAL",
        &[1],
    ),
    ("leak", "leak open.toml --from 0.3,0.2,0.2 --timeout LIMIT", &[2]),
    ("picture", "picture case.toml --out p.svg --timeout LIMIT", &[2]),
    ("why", "why case.toml 0,0,0 --timeout LIMIT", &[2]),
];

struct Test<'a> {
    place: &'a Place,
    mesher: &'a Path,
    reference: &'a Path,
    before: Files,
}

impl Test<'_> {
    /// A command with a mesher that acts like this.
    fn mesher(&self, command: &(&str, &str, &[i32]), lie: Lie, script: &str) -> Row {
        let (name, arguments, codes) = *command;
        self.place.reset(&self.before);
        let liar = self.script("liar", script);
        let arguments = arguments.replace("REFERENCE", self.reference.to_str().unwrap());
        let arguments = arguments.replace("REAL", self.mesher.to_str().unwrap());
        let arguments = arguments.replace("LIMIT", timeout(lie));
        let mut command = Command::new(HARNESS);
        command.args(arguments.split(' ')).arg("--mesher").arg(liar);
        self.judge(name, &format!("the mesher {}", lie.0), command, codes)
    }

    /// `verify` with an interpreter of oracles that acts like this.
    fn oracle(&self, lie: Lie) -> Row {
        self.place.reset(&self.before);
        let script = format!("{QUESTION}\n{}\necho 0", lie.1);
        let python = self.script("python", &script);
        let mut command = self.verify("--no-mpi --no-p4est --require oracles", timeout(lie));
        command.env("HARNESS_PYTHON", python);
        self.judge("verify --require oracles", &format!("the oracle {}", lie.0), command, &[1, 3])
    }

    /// `verify` with a launcher that acts like this.
    fn launcher(&self, lie: Lie) -> Row {
        self.place.reset(&self.before);
        let launcher = self.script("bin/mpirun", lie.1);
        let options = "--ranks 2 --no-oracles --no-p4est --require mpi";
        let mut command = self.verify(options, timeout(lie));
        let path = std::env::var("PATH").unwrap_or_default();
        command.env("PATH", format!("{}:{path}", launcher.parent().unwrap().display()));
        self.judge("verify --require mpi", &format!("the launcher {}", lie.0), command, &[1, 3])
    }

    /// `verify` without a launcher.
    fn missing(&self) -> Row {
        self.place.reset(&self.before);
        let mut command = self.verify("--ranks 2 --no-oracles --no-p4est --require mpi", "600");
        command.env("PATH", "/nowhere");
        self.judge("verify --require mpi", "the launcher is missing", command, &[3])
    }

    fn verify(&self, options: &str, timeout: &str) -> Command {
        let mut command = Command::new(HARNESS);
        command.args("verify case.toml --partitioners morton --level-bases auto".split(' '));
        command.args(["--timeout", timeout]);
        command.args(options.split(' ')).arg("--mesher").arg(self.mesher);
        command.arg("--reference").arg(self.reference);
        command
    }

    /// A script outside of the place.
    fn script(&self, name: &str, text: &str) -> std::path::PathBuf {
        let path = self.place.beside(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        path
    }

    fn judge(&self, name: &str, fault: &str, mut command: Command, codes: &[i32]) -> Row {
        command.env("TMPDIR", self.place.path().join(TMP)).env("REAL", self.mesher);
        let ended = self.place.run(command, LIMIT);
        let after = self.place.files();
        let is_documented = ended.code.is_some_and(|code| codes.contains(&code));
        let kept = ended.out.contains("kept") || ended.out.contains("repeat with");
        let left: Vec<_> =
            after.keys().filter(|path| self.before.get(*path) != after.get(*path)).collect();
        // The files of a case that fails are kept on purpose, and their place is printed.
        let left = match left.is_empty() {
            true => "nothing",
            false if kept && left.iter().all(|path| path.starts_with(TMP)) => {
                "the failing case, reported"
            }
            false => "files",
        };
        let wrong = match () {
            () if ended.wrong.is_some() => ended.wrong.clone(),
            () if !is_documented => Some("not a documented exit code".to_owned()),
            () if ended.err.contains("panicked") => Some("it panicked".to_owned()),
            () if ended.out.is_empty() && ended.err.lines().count() != 1 => {
                Some("not one sentence".to_owned())
            }
            () if left == "files" => Some("files were left".to_owned()),
            () => None,
        };
        let mut row = Row::new(name, fault);
        let wrong = wrong.map(|why| format!("{why}: {:?} {}{}", ended.code, ended.out, ended.err));
        row.add(ended.code, ended.seconds, left, wrong);
        row
    }
}
