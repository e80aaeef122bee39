//! The drawings and the numbers of `mesher/walkthrough` are those of today's mesher.

#[path = "../../examples/walkthrough.rs"]
mod example;

use example::{directory, drawings, leaves_by_rank};
use mesher::partition::Weights;

#[test]
fn committed_drawings_are_those_of_this_mesher() {
    for (name, drawn) in drawings() {
        let path = directory().join(name);
        let committed = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            committed == drawn,
            "{} is out of date: run cargo run -p mesher-library --example walkthrough, and look at the drawing",
            path.display()
        );
    }
}

#[test]
fn leaf_counts_on_the_page_are_those_of_this_mesher() {
    let page = std::fs::read_to_string(directory().join("README.md")).expect("the page");
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    for (ungraded, weights) in
        [(true, Weights::Area), (true, Weights::Rebalance), (false, Weights::Rebalance)]
    {
        let leaves: Vec<String> =
            leaves_by_rank(ungraded, weights).iter().map(|words| thousands(words.len())).collect();
        let [a, b, c, d] = &leaves[..] else { panic!("the walk-through has four ranks") };
        let counts = format!("{a}, {b}, {c} and {d}");
        assert!(page.contains(&counts), "the page lacks the leaf counts {counts}");
    }
}

/// A number below a million with its digits in groups of three.
fn thousands(n: usize) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) }
}
