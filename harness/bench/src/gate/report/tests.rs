use super::*;
use proptest::prelude::*;

fn report(layers: Vec<Layer>) -> GateReport {
    GateReport { layers, ..GateReport::new(None, Measures::default()) }
}

fn layer(findings: &[GateFinding]) -> Layer {
    let cases = vec!["a".to_owned(), "b".to_owned()];
    Layer { findings: findings.to_vec(), ..Layer::new(LayerName::Counters, cases) }
}

fn equal(case: &str) -> GateFinding {
    GateFinding::of_values(case, "rays", Verdict::Unchanged, [7.0, 7.0], String::new())
}

#[test]
fn a_gate_that_compared_nothing_of_a_case_does_not_hold() {
    let both = layer(&[equal("a"), equal("b")]);
    assert_eq!(report(vec![both.clone()]).end(), End::Holds(NonZeroU64::new(2).unwrap()));
    let is_incomplete = |layers: Vec<Layer>| matches!(report(layers).end(), End::Incomplete(_));
    assert!(is_incomplete(vec![]), "no layer");
    assert!(is_incomplete(vec![Layer::new(LayerName::Time, vec![])]), "no case");
    assert!(is_incomplete(vec![layer(&[equal("a")])]), "nothing of b");
    let missing = GateFinding::noted("b", "rays", Verdict::Missing, "not in the record");
    assert!(is_incomplete(vec![layer(&[equal("a"), missing.clone()])]), "nothing of b");
    assert!(is_incomplete(vec![layer(&[equal("a"), equal("b"), missing])]), "one of two of b");
    let new = GateFinding::noted("b", "rays", Verdict::Changed, "new");
    assert!(is_incomplete(vec![layer(&[equal("a"), new])]), "no shared quantity of b");
    let out = GateFinding::noted("b", "rays", Verdict::LeftOut, "no boxes");
    let some = report(vec![layer(&[equal("a"), out.clone()])]);
    assert!(matches!(some.end(), End::Holds(_)));
    assert!(matches!(GateReport { require_layers: true, ..some }.end(), End::Incomplete(_)));
    let all = GateFinding { case: "a".into(), ..out.clone() };
    assert!(is_incomplete(vec![layer(&[all, out])]), "all left out");
    let skipped = Layer { left_out: Some("no valgrind".into()), ..layer(&[]) };
    assert!(is_incomplete(vec![skipped.clone()]), "the only layer is left out");
    assert!(matches!(report(vec![both, skipped]).end(), End::Holds(_)));
}

proptest! {
    /// Whatever the findings are: a gate that holds compared something of every case that has a finding other than left out.
    #[test]
    fn a_gate_holds_only_on_comparisons(drawn in prop::collection::vec((0..3usize, 0..8usize), 0..12)) {
        use Verdict::*;
        let verdicts = [LeftOut, Measured, Improvement, Unchanged, Changed, Inconclusive, Missing, Regression];
        let finding = |&(case, verdict): &(usize, usize)| {
            let name = ["a", "b", "c"][case];
            let compared = u64::from(!matches!(verdicts[verdict], LeftOut | Missing));
            GateFinding { compared, ..GateFinding::noted(name, "m", verdicts[verdict], "why") }
        };
        let findings: Vec<GateFinding> = drawn.iter().map(finding).collect();
        let cases = ["a", "b", "c"].map(str::to_owned).to_vec();
        let layer = Layer { findings: findings.clone(), ..Layer::new(LayerName::Memory, cases) };
        if let End::Holds(total) = report(vec![layer]).end() {
            prop_assert_eq!(total.get(), findings.iter().map(|f| f.compared).sum::<u64>());
            for case in ["a", "b", "c"] {
                let of_case: Vec<_> = findings.iter().filter(|f| f.case == case).collect();
                prop_assert!(!of_case.is_empty());
                prop_assert!(of_case.iter().all(|f| !matches!(f.verdict, Missing | Regression)));
            }
        }
    }
}

fn planted(fault: impl FnOnce(&mut GateFinding)) {
    let mut wrong =
        GateFinding::of_values("a", "rays", Verdict::Regression, [10.0, 12.0], String::new());
    fault(&mut wrong);
    report(vec![layer(&[wrong, equal("b")])]).check_invariants();
}

#[test]
#[should_panic(expected = "the change is that of the values")]
fn a_change_that_its_values_do_not_have_is_noticed() {
    planted(|finding| finding.change_percent = Some(-1.0));
}

#[test]
#[should_panic(expected = "the verdict has the sign of the change")]
fn a_regression_towards_less_is_noticed() {
    planted(|finding| finding.verdict = Verdict::Improvement);
}

#[test]
#[should_panic(expected = "nothing was compared")]
fn a_missing_quantity_that_counts_is_noticed() {
    planted(|finding| {
        *finding = GateFinding { compared: 1, ..GateFinding::noted("a", "m", Verdict::Missing, "") }
    });
}

#[test]
#[should_panic(expected = "has no finding")]
fn a_case_without_a_finding_is_noticed() {
    report(vec![layer(&[equal("a")])]).check_invariants();
}

#[test]
fn a_record_and_a_report_read_back() {
    let mut measures = Measures::of_program(Measured { named: "m".into(), ..Measured::default() });
    measures.case("cube").exact.insert("rays".into(), u64::MAX);
    assert_eq!(Measures::parse(measures.json().as_bytes()).unwrap(), measures);
    let text = serde_json::to_vec(&GateReport::new(None, measures.clone())).unwrap();
    assert_eq!(Measures::parse(&text).unwrap(), measures);
    assert!(Measures::parse(b"{\"cells\": 1}").is_err());
    let other = measures.json().replace("measures/1", "measures/9");
    assert!(Measures::parse(other.as_bytes()).unwrap_err().contains("measures/9"));
}
