//! The rules that concern the record.

use super::{Ruling, Verdict};
use bench::experiments::entry::{Entry, Line};

/// The findings about a record.
pub fn findings(lines: &[Line]) -> Vec<Ruling> {
    let mut out = setup(lines);
    out.push(completeness(lines));
    out
}

/// Rule 9: machine and software are documented.
fn setup(lines: &[Line]) -> Vec<Ruling> {
    let session = |line: &'_ Line| match &line.entry {
        Entry::Session(session) => Some((**session).clone()),
        _ => None,
    };
    let sessions: Vec<_> = lines.iter().filter_map(session).collect();
    let is_documented = !sessions.is_empty()
        && sessions.iter().all(|s| {
            let m = &s.machine;
            [&m.cpu, &m.kernel, &m.compiler, &m.commit].iter().all(|v| !v.is_empty())
                && m.memory_bytes > 0
        });
    let mut out = vec![match is_documented {
        true => Ruling::new(
            9,
            "record",
            Verdict::Kept,
            "the record has processor, memory, kernel, compiler and commit",
        ),
        false => Ruling::new(
            9,
            "record",
            Verdict::Broken,
            "machine, compiler or commit are missing in the record",
        ),
    }];
    let mut broken = |why: String| out.push(Ruling::new(9, "record", Verdict::Broken, why));
    if sessions.iter().any(|s| s.machine.commit.ends_with("-dirty")) {
        broken("a session ran with files that differ from its commit".to_owned());
    }
    if let Some(s) = sessions.iter().find(|s| s.load_average > 0.5 * s.machine.cores as f64) {
        broken(format!(
            "other processes may have disturbed a session: the load average was {:.1} on {} cores",
            s.load_average, s.machine.cores
        ));
    }
    out
}

/// Rule 2: no run is missing without a reason.
fn completeness(lines: &[Line]) -> Ruling {
    let failures = lines.iter().filter(|l| matches!(l.entry, Entry::Failure(_))).count();
    let oversubscribed =
        lines.iter().any(|l| matches!(&l.entry, Entry::Run(r) if r.oversubscribed));
    let suffix = if oversubscribed { "; runs with more ranks than cores are marked" } else { "" };
    match failures {
        0 => {
            let why = format!("the record has every run that was started, on all cores{suffix}");
            Ruling::new(2, "record", Verdict::Kept, why)
        }
        n => {
            let why = format!("{n} runs failed and are missing in the figures{suffix}");
            Ruling::new(2, "record", Verdict::Broken, why)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::{Machine, Session};
    use bench::testing::line;

    fn session(load_average: f64, commit: &str) -> Line {
        let machine = Machine {
            cpu: "c".into(),
            cores: 2,
            memory_bytes: 1,
            kernel: "k".into(),
            mpi: String::new(),
            compiler: "r".into(),
            commit: commit.into(),
        };
        let (command, lacks) = (vec![], Default::default());
        line(Entry::Session(Box::new(Session { command, machine, load_average, lacks })))
    }

    fn is_broken(lines: &[Line]) -> bool {
        findings(lines).iter().any(|f| f.rule == 9 && f.verdict == Verdict::Broken)
    }

    #[test]
    fn a_disturbed_machine_and_uncommitted_files_break_rule_9() {
        assert!(!is_broken(&[session(0.1, "abc")]));
        assert!(is_broken(&[session(1.9, "abc")]));
        assert!(is_broken(&[session(0.1, "abc-dirty")]));
    }

    #[test]
    fn a_record_without_sessions_breaks_rule_9() {
        assert!(is_broken(&[]));
    }
}
