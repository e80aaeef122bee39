//! A wall clock that jumps by a day at every call: durations and limits come from the monotonic clock.

use crate::place::{HANGS, Place};
use crate::programs::inputs;
use crate::tools::{HARNESS, clock, mpi, mpirun, program, skip};
use crate::{Row, Table};
use serde_json::Value;
use std::fs;
use std::process::Command;
use std::time::Duration;

/// Time for a run, and the greatest duration that it may report.
const LIMIT: Duration = HANGS;

/// Programs that measure times and have limits.
pub fn family() {
    let (Some(mesher), Some(reference)) = (program("mesher"), program("reference")) else {
        return skip("a clock that jumps", "mesher and reference were not built");
    };
    let library = match clock() {
        Ok(library) => library,
        Err(why) => return skip("a clock that jumps", &why),
    };
    let place = inputs(&mesher);
    let preloaded = |program: &str, arguments: &str| {
        let mut command = Command::new(program);
        command.args(arguments.split(' ')).env("LD_PRELOAD", &library);
        command
    };
    let dates: Vec<String> =
        (0..2).map(|_| place.run(preloaded("date", "+%s %s"), LIMIT).out).collect();
    assert!(!dates.is_empty(), "{dates:?}");
    let years = place.run(preloaded("date", "+%s"), LIMIT).out.trim().parse::<i64>().unwrap();
    let now = std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap().as_secs() as i64;
    assert!((now - years).abs() > 80_000, "the clock does not jump: {years} at {now}");

    let programs = format!("--mesher {} --reference {}", mesher.display(), reference.display());
    let mut table = Table::new();
    let mut check = |name: &str, command: Command, code: i32, report: Option<&str>| {
        let ended = place.run(command, LIMIT);
        let is_right = ended.code == Some(code) && !ended.err.contains("panicked");
        let durations = report.map_or(Ok(()), |report| sane(&place, report));
        let wrong = ended.wrong.clone().or_else(|| (!is_right).then(|| format!("{ended:?}")));
        let mut row = Row::new(name, "the wall clock jumps by a day");
        row.add(ended.code, ended.seconds, "all output", wrong.or(durations.err()));
        table.push(row);
    };
    let mesher = mesher.to_str().unwrap();
    check("mesher", preloaded(mesher, "case.toml --quiet --json m.json"), 0, Some("m.json"));
    let reference = reference.to_str().unwrap();
    check("reference", preloaded(reference, "case.toml --json r.json"), 0, Some("r.json"));
    let verify = "verify case.toml --no-mpi --no-oracles --no-p4est --timeout 600 --json v.json";
    check(
        "verify --timeout 600",
        preloaded(HARNESS, &format!("{verify} {programs}")),
        0,
        Some("v.json"),
    );
    let gate = format!(
        "gate --rules gate.toml --layers counters --json g.json --baseline {mesher} --mesher {mesher}"
    );
    check("gate", preloaded(HARNESS, &gate), 0, Some("g.json"));
    let leak = "leak open.toml --from 0.3,0.2,0.2 --timeout 600 --json l.json";
    check(
        "leak --timeout 600",
        preloaded(HARNESS, &format!("{leak} --mesher {mesher}")),
        1,
        Some("l.json"),
    );
    check("audit", preloaded(HARNESS, "audit mesh --json a.json"), 0, Some("a.json"));
    match mpi() {
        Ok(_) => {
            let mut job = mpirun(3);
            job.arg("-x").arg(format!("LD_PRELOAD={}", library.display()));
            job.arg(mesher).args("case.toml --quiet --stall-limit 600 --json p.json".split(' '));
            check("mesher on 3 ranks, --stall-limit 600", job, 0, Some("p.json"));
        }
        Err(why) => skip("a clock that jumps on MPI ranks", &why),
    }
    table.finish("a clock that jumps");
}

/// Whether no duration of a report is negative or long.
fn sane(place: &Place, report: &str) -> Result<(), String> {
    let text =
        fs::read_to_string(place.path().join(report)).map_err(|e| format!("{report}: {e}"))?;
    let value: Value = serde_json::from_str(&text).map_err(|e| format!("{report}: {e}"))?;
    let mut wrong = Vec::new();
    durations(&value, "", &mut wrong);
    if wrong.is_empty() { Ok(()) } else { Err(format!("{report}: {wrong:?}")) }
}

fn durations(value: &Value, name: &str, wrong: &mut Vec<String>) {
    match value {
        Value::Object(entries) => {
            entries.iter().for_each(|(name, value)| durations(value, name, wrong))
        }
        Value::Array(values) => values.iter().for_each(|value| durations(value, name, wrong)),
        Value::Number(number) if name.starts_with("time") && name.ends_with("_s") => {
            let is_sane = number.as_f64().is_some_and(|s| (0.0..LIMIT.as_secs_f64()).contains(&s));
            wrong.extend((!is_sane).then(|| format!("{name} = {number}")));
        }
        _ => {}
    }
}
