//! Data for the fit of the cost model: the counts of [`Counts`] and the CPU time of sides and gradation on every simulated rank, as
//! CSV. `mesher/cost-model/README.md` has the commands.
//!
//! Usage: `cost_data RANKS REPEATS CASE.toml...`. Times are medians over the repeats.

use bricks::kept::Kept;
use cpu_time::ThreadTime;
use mesher::error::Error;
use mesher::input::case::Case;
use mesher::input::{ingest, quantise};
use mesher::partition::cost::Counts;
use mesher::partition::initial::{self, Partition};
use mesher::partition::repartition;
use mesher::refine::voxelise::BinnedFacets;
use mesher::{Options, grade, refine, sides};
use ranks::{Comm, sim};
use std::path::Path;

/// Phases 1 to 7 of a case on this rank: the counts, and the CPU time of sides and of gradation in nanoseconds.
fn measure(case: &Case, comm: &dyn Comm) -> Result<(Counts, [u64; 2]), Error> {
    let slice = ingest::read(&case.source, comm)?;
    let quantise::Quantised { rules, facets, .. } = quantise::quantise(case, slice, comm)?;
    let options = Options::default();
    let Partition { ownership, level_base, .. } =
        initial::partition(&facets, &rules, &options.division, comm)?;
    let binned = BinnedFacets::new(&refine::route(&facets, &ownership, comm));
    let (mut tree, _) = refine::refine(&binned, &rules, &ownership);
    let ownership = repartition::after_refinement(&tree, &ownership, level_base, comm);
    ownership.synchronise_replicas(&mut [&mut tree.split, &mut tree.crossing], comm);
    let counts = Counts::of_rank(&tree, &ownership);

    let start = ThreadTime::now();
    let sides = sides::decide(&tree, &ownership, &facets, &rules, &options, true, comm)?.sides;
    let time_sides = start.elapsed();
    let start = ThreadTime::now();
    let kept = Kept::new(sides.deleted());
    grade::grade(tree.split, &tree.crossing, &kept, &rules, &ownership, comm);
    Ok((counts, [time_sides, start.elapsed()].map(|t| t.as_nanos() as u64)))
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [ranks, repeats, cases @ ..] = &args[..] else {
        panic!("usage: cost_data RANKS REPEATS CASE.toml...");
    };
    let ranks: usize = ranks.parse().expect("a number of ranks");
    let repeats: u64 = repeats.parse().expect("a number of repeats");
    println!(
        "case,rank,bricks,components,components_extra,components_single,neighbours,sides_ns,grade_ns"
    );
    for path in cases {
        let case = program::case_file::read(Path::new(path)).expect("a good case");
        let runs: Vec<_> = (1..=repeats)
            .map(|seed| sim::run(ranks, seed, |comm| measure(&case, comm).expect("a good case")))
            .collect();
        let name = Path::new(path).file_stem().expect("a file name").to_string_lossy();
        for rank in 0..ranks {
            let c = runs[0][rank].0;
            let median = |phase: usize| {
                let mut times: Vec<u64> = runs.iter().map(|run| run[rank].1[phase]).collect();
                times.sort_unstable();
                times[times.len() / 2]
            };
            println!(
                "{name},{rank},{},{},{},{},{},{},{}",
                c.bricks,
                c.components,
                c.components_extra,
                c.components_single,
                c.neighbours,
                median(0),
                median(1)
            );
        }
    }
}
