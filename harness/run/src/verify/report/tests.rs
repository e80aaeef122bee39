use super::*;
use crate::testing::{of_layout, report};
use proptest::prelude::*;

#[test]
fn exit_codes_have_an_order_of_precedence() {
    let mut report = crate::testing::report();
    assert_eq!(report.exit_code(), EXIT_FAILED);
    report.cases[0].checks.remove(2);
    assert_eq!(report.exit_code(), EXIT_HOLDS);
    report.missing[0].required = true;
    assert_eq!(report.exit_code(), EXIT_MISSING);
    report.cases[0].input_error = Some("spacing_min is negative".into());
    assert_eq!(report.exit_code(), EXIT_INPUT);
    report.interrupted = true;
    assert_eq!(report.exit_code(), EXIT_INTERRUPTED);
}

/// The message with which the invariants refuse a report that was changed in this way; empty if they hold.
fn refusal(change: impl Fn(&mut Report) + std::panic::UnwindSafe) -> String {
    let checked = std::panic::catch_unwind(move || {
        let mut report = report();
        change(&mut report);
        report.check_invariants();
    });
    checked.err().map_or(String::new(), |why| *why.downcast::<String>().unwrap())
}

#[test]
fn every_planted_wrong_report_is_refused() {
    assert_eq!(refusal(|_| ()), "");
    let green = |report: &mut Report| drop(report.cases[0].checks.remove(2));
    assert_eq!(refusal(green), "");
    assert!(refusal(|r| r.asked.cases.push("plate".into())).contains("asked for"));
    assert!(refusal(|r| r.cases[0].checks.clear()).contains("has no check"));
    assert!(refusal(|r| r.asked.ranks.push(7)).contains("7 ranks were asked for"));
    assert!(refusal(|r| drop(r.cases[0].checks.pop())).contains("p4est was asked for"));
    assert!(refusal(|r| r.cases[0].runs[1].digest.clear()).contains("no digest"));
    assert!(refusal(|r| drop(r.cases[0].checks.remove(1))).contains("a run without its check"));
    assert!(refusal(|r| drop(r.cases[0].runs.pop())).contains("ended well, and runs"));
    let differs = |report: &mut Report| {
        let case = &mut report.cases[0];
        for name in [identical::NAME, manifest::NAME] {
            case.checks.push(Check { name: name.into(), ..case.checks[1].clone() });
        }
        for name in [manifest::NAME, DETERMINISTIC] {
            case.checks.push(Check::new("serial", name, Outcome::held(7600)));
        }
        case.runs[1].digest = "1".repeat(32);
    };
    assert!(refusal(differs).contains("is not identical"));
    // The run whose mesh is compared is another than the timed one, and may differ.
    let undetermined = |report: &mut Report| {
        differs(report);
        drop(report.cases[0].checks.pop());
    };
    assert_eq!(refusal(undetermined), "");
    let unchecked = move |report: &mut Report| {
        green(report);
        report.cases[0].checks.remove(0);
    };
    assert!(refusal(unchecked).contains("green, but 0 cases were checked"));
    let interrupted = |report: &mut Report| {
        (report.interrupted, report.asked.cases) = (true, vec!["cube_small".into(), "b".into()]);
    };
    assert_eq!(refusal(interrupted), "");
    let stranger = |report: &mut Report| {
        (report.interrupted, report.asked.cases) = (true, vec!["plate".into()]);
    };
    assert!(refusal(stranger).contains("cube_small"));
}

/// A report of drawn cases, in which every rank count has a run and its checks.
fn drawn() -> impl Strategy<Value = Report> {
    let ranks = prop::collection::btree_set(1usize..65, 1..4);
    let cases = prop::collection::vec((1u64..1_000_000, any::<u128>(), 0u64..3), 1..4);
    (ranks, cases).prop_map(|(ranks, cases)| {
        let mut all = report();
        all.missing.clear();
        let (name, of_case) = (|i| format!("case-{i}"), all.cases.pop().unwrap());
        let case = |(i, (cells, digest, failures)): (usize, (u64, u128, u64))| {
            let of = Run { cells, digest: format!("{digest:032x}"), ..of_case.runs[0].clone() };
            let layouts: Vec<_> =
                ranks.iter().map(|&n| Layout::on(crate::engine::layout::Ranks::Mpi(n))).collect();
            let on_ranks = layouts.iter().map(|l| Run { layout: Some(l.clone()), ..of.clone() });
            let runs = std::iter::once(of.clone()).chain(on_ranks).collect();
            let names = [RUNS, identical::NAME, manifest::NAME];
            let checks_of = |l| names.map(|name| of_layout(l, name, Outcome::held(cells)));
            let mut checks: Vec<_> = layouts.iter().flat_map(checks_of).collect();
            let of_serial = [manifest::NAME, DETERMINISTIC];
            checks.extend(of_serial.map(|name| Check::new("serial", name, Outcome::held(cells))));
            checks.extend(
                (0..failures).map(|_| Check::new("serial", "balance", Outcome::fail("one"))),
            );
            checks.push(Check::new("p4est", "balance", Outcome::held(cells)));
            CaseReport { name: name(i), runs, checks, ..of_case.clone() }
        };
        all.cases = cases.into_iter().enumerate().map(case).collect();
        all.asked = Asked {
            cases: all.cases.iter().map(|case| case.name.clone()).collect(),
            named: true,
            ranks: ranks.iter().copied().collect(),
            subjects: vec!["p4est".into()],
        };
        all
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 128, ..ProptestConfig::default() })]

    /// A drawn report satisfies the invariants, and each of these changes to one of its cases violates one.
    #[test]
    fn drawn_reports_are_accepted_and_changed_ones_refused(report in drawn(), at in any::<prop::sample::Index>(), wrong in 0usize..8) {
        report.check_invariants();
        let mut changed = report.clone();
        let at = at.index(report.cases.len());
        let case = &mut changed.cases[at];
        let is_on_ranks = |check: &Check| check.ranks.is_some();
        match wrong {
            0 => drop(changed.cases.remove(at)),
            1 => case.checks.clear(),
            2 => case.checks.retain(|check| !is_on_ranks(check)),
            3 => case.checks.retain(|check| check.subject != "p4est"),
            4 => case.runs[1].digest = "other".into(),
            5 => case.runs[0].cells += 1,
            6 => drop(case.runs.pop()),
            _ => changed.asked.ranks.push(65),
        }
        let refused = std::panic::catch_unwind(move || changed.check_invariants()).is_err();
        prop_assert!(refused, "change {wrong} of {report:?}");
    }
}
