//! What an engine does not do or promise, in a few words each: for comparisons.

use super::description::Description;
use check::promises::{Independence, Touching};
use contract::manifest::Keep;
use contract::octant::LEVEL_MAX;

/// What an engine lacks whose mesh depends on the number of ranks.
pub const EQUAL_RANKS: &str = "equal meshes on any number of ranks";
/// What an engine lacks that is not deterministic.
pub const EQUAL_RUNS: &str = "equal meshes from equal runs";

impl Description {
    /// Returns what the engine does not do or promise; empty if it keeps the whole definition on any number of ranks.
    pub fn lacks(&self) -> Vec<String> {
        let (promises, takes) = (&self.promises, &self.takes);
        let promised = |has: bool| has || promises.definition;
        let parallel = self.run.parallel.is_some();
        let deletes = takes.keep.iter().any(|keep| *keep != Keep::All);
        let of_ranks = promises.is_independent_of(Independence::Ranks);
        let features = [
            (promised(promises.complete), "meshes without holes"),
            (promised(promises.surface.is_some()), "the asked level at the surface"),
            (promised(promises.balance.is_some()), "2:1 balance over faces"),
            (promised(promises.balance == Some(Touching::Corner)), "2:1 balance over corners"),
            (promised(promises.layers), "layers"),
            (takes.boxes && promised(promises.boxes), "extent boxes"),
            (promised(promises.sides.is_some()), "inside and outside"),
            (deletes, "deletion of either side"),
            (takes.seeds, "seeds"),
            (promises.is_deterministic(), EQUAL_RUNS),
            (parallel, "MPI"),
            (!parallel || of_ranks, EQUAL_RANKS),
        ];
        let missing = features.into_iter().filter(|(has, _)| !has).map(|(_, name)| name.to_owned());
        let level = self.limits.level_max;
        let deep = (level < LEVEL_MAX).then(|| format!("levels beyond {level}"));
        missing.chain(deep).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_mesher_lacks_nothing_and_a_simple_one_what_it_does_not_promise() {
        let own = Description::parse(include_str!("../../../engines/mesher.toml")).unwrap();
        assert_eq!(own.lacks(), [""; 0]);
        let text = "[run]\nserial = ['m', '{case}', '{out}']\n[takes]\nboxes = false\nkeep = ['all']\n[limits]\nlevel_max = 14\n\
                    [promises]\ncomplete = true\nsurface = { tolerance_cells = 0.0 }\nbalance = 'edge'\ndeterministic = true\n";
        let lacks = Description::parse(text).unwrap().lacks().join("; ");
        let expected = "2:1 balance over corners; layers; extent boxes; inside and outside; deletion of either side; \
                        seeds; MPI; levels beyond 14";
        assert_eq!(lacks, expected);
    }
}
