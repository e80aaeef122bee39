//! How the work is divided, by counters, which repeat exactly: dealing out anew balances the leaves on any number of
//! ranks, and nothing is counted twice or left out.
#![allow(missing_docs)]

#[path = "support/process.rs"]
mod process;

use process::{Place, run};
use serde_json::Value;

/// A ring, and a plane box beside it whose layers lie in other ranks' parts; `{n}` cells per layer.
const CASE: &str =
    "spacing_min = 0.012\nroot_scale = 4.0\nlayer_cells_min = {n}\nkeep_crossing = {c}\n
[generator]\nshape = \"torus\"\nfacets = 6400\n
[[box]]\nmin = [1.5, 0.1, -0.3]\nmax = [1.9, 0.9, 1.1]\nspacing = 0.02\n";

/// A counter by rank.
fn counter(told: &Value, name: &str) -> Vec<u64> {
    serde_json::from_value(told["counters"][name].clone()).expect("a number per rank")
}

fn sum(told: &Value, name: &str) -> u64 {
    counter(told, name).iter().sum()
}

fn lambda(all: &[u64]) -> f64 {
    let (most, sum) = (all.iter().max().unwrap(), all.iter().sum::<u64>());
    *most as f64 * all.len() as f64 / sum as f64
}

fn told(place: &Place, args: &[&str]) -> Value {
    run(place.mesher(&[&["case.toml", "--quiet", "--json", "run.json"], args].concat())).succeeds();
    let text =
        std::fs::read_to_string(place.path().join("run.json")).expect("a report was written");
    serde_json::from_str(&text).expect("the report is JSON")
}

#[test]
fn leaves_dealt_out_anew_are_balanced() {
    for (n, crossing) in [("1", "false"), ("4", "true")] {
        let place = Place::new();
        place.put("case.toml", CASE.replace("{n}", n).replace("{c}", crossing));
        let solo = told(&place, &["--comm", "solo"]);
        for ranks in [2, 7, 40] {
            let comm = format!("sim:{ranks}");
            let anew = told(&place, &["--comm", &comm]);
            assert_eq!(anew["digest"], solo["digest"]);
            let leaves = counter(&anew, "leaves");
            let heaviest = *counter(&anew, "base_leaf_cells_max").iter().max().unwrap();
            let share = leaves.iter().sum::<u64>() / ranks;
            // Shares may differ by a twentieth; the curve is cut between octants, each of which may be on the wrong side by its
            // half, on both sides; leaves of crossing ones that are left out are counted by what they were before gradation.
            let bound = share + share / 20 + heaviest + share / 50;
            assert!(leaves.iter().all(|&l| l <= bound), "{ranks} ranks: {leaves:?}, {heaviest}");
            assert!(heaviest < share / 2, "{ranks} ranks: octants of {heaviest} in {share}");
            let kept = told(&place, &["--comm", &comm, "--weights", "area"]);
            assert_eq!(kept["digest"], solo["digest"]);
            let (new, old) = (lambda(&leaves), lambda(&counter(&kept, "leaves")));
            // What is balanced well enough stays where it is.
            assert!(new < old || old < 1.05, "{ranks} ranks: lambda {new} is not below {old}");
            assert!(ranks == 2 || old > 1.1, "{ranks} ranks: lambda {old} leaves nothing to gain");
        }
    }
}

#[test]
fn what_gradation_splits_is_counted_once() {
    let place = Place::new();
    place.put("case.toml", CASE.replace("{n}", "3").replace("{c}", "true"));
    let solo = told(&place, &["--comm", "solo"]);
    let split = sum(&solo, "octants_split_graded");
    // Each split makes eight leaves of one, from those of the base tree, of which some are deleted.
    let base = told(&place, &["--comm", "solo", "--ungraded"]);
    assert!(
        split * 7 < sum(&solo, "leaves") && split * 7 + sum(&base, "leaves") > sum(&solo, "leaves")
    );
    for weights in ["unit", "area", "rebalance"] {
        for comm in ["sim:3", "sim:13", "sim:64"] {
            let ranks = told(&place, &["--comm", comm, "--weights", weights]);
            assert_eq!(sum(&ranks, "octants_split_graded"), split, "{weights} {comm}");
        }
    }
}
