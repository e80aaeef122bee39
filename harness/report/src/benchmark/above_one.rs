//! Why an efficiency exceeds 1: a reason for every caption, table and sentence that shows one.

use bench::experiments::pop::Efficiency;

/// Efficiencies up to this one are shown as 1.
const SHOWN_AS_ONE: f64 = 1.0005;

/// The reasons why factors of these efficiencies exceed 1, as sentences; `None` if none does. Parallel and global efficiency are
/// products of the factors.
pub fn reasons(of: &[Efficiency], experiment: &str) -> Option<String> {
    let exceeds = |factor: fn(&Efficiency) -> f64| of.iter().any(|e| factor(e) > SHOWN_AS_ONE);
    let mut reasons = Vec::new();
    if exceeds(|e| e.computation_scaling) {
        let why = match experiment {
            "weak" => "the cost of the facets does not grow with the mesh",
            _ => "smaller parts of a mesh fit into caches better, or the base case was disturbed",
        };
        reasons.push(format!(
            "Computation scaling is above 1 where all ranks together take less CPU time per cell than the base case: {why}."
        ));
    }
    if exceeds(|e| e.serialisation) {
        reasons.push(
            "Serialisation is above 1 where CPU time outside of the phases is on the slowest rank."
                .to_owned(),
        );
    }
    if exceeds(|e| e.transfer) {
        reasons.push(
            "Transfer is above 1 where the clocks disagree: CPU times of the ranks exceed the wall time of the run."
                .to_owned(),
        );
    }
    (!reasons.is_empty()).then(|| reasons.join(" "))
}

/// The same for speedups above the ideal line, as the end of a caption; empty if none is.
pub fn reasons_of_speedups(of: &[Efficiency], is_above: bool) -> String {
    let why = reasons(of, "strong").filter(|_| is_above);
    let disturbed = "A speedup per rank above 1 means that the base case was disturbed.".to_owned();
    why.or(is_above.then_some(disturbed)).map_or(String::new(), |why| format!(" {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDEAL: Efficiency = Efficiency {
        load_balance: 1.0,
        serialisation: 1.0,
        transfer: 1.0,
        computation_scaling: 1.0,
        lambda: 1.0,
        time_s: 1.0,
    };

    #[test]
    fn an_efficiency_above_one_has_a_reason() {
        let weak = Efficiency { computation_scaling: 9.2, ..IDEAL };
        assert!(reasons_of_speedups(&[IDEAL], true).contains("disturbed"));
        assert_eq!(reasons_of_speedups(&[weak], false), "");
        let early = Efficiency { transfer: 1.003, serialisation: 1.1, ..IDEAL };
        assert_eq!(reasons(&[IDEAL], "weak"), None);
        assert!(reasons(&[IDEAL, weak], "weak").unwrap().contains("the facets"));
        assert!(reasons(&[weak], "strong").unwrap().contains("caches"));
        let both = reasons(&[early], "strong").unwrap();
        assert!(both.contains("Transfer") && both.contains("Serialisation"), "{both}");
    }
}
