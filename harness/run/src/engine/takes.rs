//! What an engine supports: the tables `[takes]` and `[limits]` of its file. No command runs it on any other case.

use super::description::Description;
use check::promises::{Independence, Touching};
use contract::case::Case;
use contract::manifest::{Enclosed, Keep};
use contract::octant::LEVEL_MAX;
use contract::plain::StlForm;
use serde::Deserialize;

/// What an engine lacks whose meshes depend on the number of ranks.
pub const EQUAL_RANKS: &str = "equal meshes on any number of ranks";

/// What an engine lacks that is not deterministic.
pub const EQUAL_RUNS: &str = "equal meshes from equal runs";

/// Features of a case file that an engine supports.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Takes {
    /// `[generator]` and `root_scale`. If not, the engine is given an STL file and an explicit root.
    pub generator: bool,
    /// Extent boxes.
    pub boxes: bool,
    /// Values of `keep`.
    pub keep: Vec<Keep>,
    /// `keep_crossing = false`.
    pub drop_crossing: bool,
    /// `seeds`.
    pub seeds: bool,
    /// `enclosed = "keep"`. The default, `delete`, cannot be declined: whether anything is enclosed is known after
    /// meshing only.
    pub keep_enclosed: bool,
    /// The form of its STL file.
    pub stl: StlForm,
}

impl Default for Takes {
    fn default() -> Self {
        Self {
            generator: false,
            boxes: true,
            keep: vec![Keep::Outside, Keep::Inside, Keep::All],
            drop_crossing: true,
            seeds: false,
            keep_enclosed: false,
            stl: StlForm::Any,
        }
    }
}

/// Limits: the engine is not run on a case beyond them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Deepest level.
    pub level_max: u8,
    /// Greatest number of facets.
    pub facets_max: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { level_max: LEVEL_MAX, facets_max: u64::MAX }
    }
}

impl Description {
    /// Why the engine is not run on a case; `None` if it is.
    pub fn declines(&self, case: &Case) -> Option<String> {
        let (takes, limits) = (&self.takes, &self.limits);
        let (level, facets) = (case.inputs().level_deepest(), case.facets.len() as u64);
        let feature = |name: &str| format!("does not support {name} in [takes])");
        let keep = format!("keep = {:?} (keep", case.keep).to_lowercase();
        let beyond = [
            (
                level > limits.level_max,
                format!(
                    "supports levels up to {} (level_max in [limits]), and the case needs {level}",
                    limits.level_max
                ),
            ),
            (
                facets > limits.facets_max,
                format!(
                    "supports {} facets (facets_max in [limits]), and the case has {facets}",
                    limits.facets_max
                ),
            ),
            (!case.boxes.is_empty() && !takes.boxes, feature("extent boxes (boxes")),
            (
                !case.keep_crossing && !takes.drop_crossing,
                feature("keep_crossing = false (drop_crossing"),
            ),
            (!case.seeds.is_empty() && !takes.seeds, feature("seeds (seeds")),
            (
                case.enclosed == Enclosed::Keep && !takes.keep_enclosed,
                feature("enclosed = keep (keep_enclosed"),
            ),
            (!takes.keep.contains(&case.keep), feature(&keep)),
        ];
        let (_, why) = beyond.into_iter().find(|(is_beyond, _)| *is_beyond)?;
        Some(format!("{} {why}", self.name))
    }

    /// What the engine does not do or promise, in a few words each, for comparisons; empty if it keeps the whole definition on any
    /// number of ranks.
    pub fn lacks(&self) -> Vec<String> {
        let (promises, takes) = (&self.promises, &self.takes);
        let promised = |has: bool| has || promises.definition;
        let parallel = self.run.parallel.is_some();
        let of_ranks = promises.is_independent_of(Independence::Ranks);
        let features = [
            (promised(promises.complete), "meshes without holes"),
            (promised(promises.surface.is_some()), "the asked level at the surface"),
            (promised(promises.balance.is_some()), "2:1 balance over faces"),
            (promised(promises.balance == Some(Touching::Corner)), "2:1 balance over corners"),
            (promised(promises.layers), "layers"),
            (takes.boxes && promised(promises.boxes), "extent boxes"),
            (promised(promises.sides.is_some()), "inside and outside"),
            (takes.keep.iter().any(|keep| *keep != Keep::All), "deletion of either side"),
            (takes.seeds, "seeds"),
            (promises.is_deterministic(), EQUAL_RUNS),
            (parallel, "MPI"),
            (!parallel || of_ranks, EQUAL_RANKS),
        ];
        let missing = features.into_iter().filter(|(has, _)| !has).map(|(_, name)| name.to_owned());
        let level = self.limits.level_max;
        missing.chain((level < LEVEL_MAX).then(|| format!("levels beyond {level}"))).collect()
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

    #[test]
    fn a_case_beyond_the_capabilities_is_declined_with_the_reason() {
        let text = "[run]\nserial = ['m', '{case}', '{out}']\n\
                    [takes]\nboxes = false\nkeep = ['all']\n[limits]\nlevel_max = 3\n";
        let engine = Description::parse(text).unwrap();
        let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n";
        let declines = |case: &str| {
            engine.declines(&Case::from_parts(&case.replace("ROOT", root), vec![]).unwrap())
        };
        assert_eq!(declines("spacing_min = 1.0\nkeep = 'all'\nROOT"), None);
        let deep = declines("spacing_min = 0.5\nkeep = 'all'\nROOT").unwrap();
        assert!(deep.contains("levels up to 3 (level_max in [limits])"), "{deep}");
        assert!(declines("spacing_min = 1.0\nROOT").unwrap().contains("outside"));
        let seeds = declines("spacing_min = 1.0\nkeep = 'all'\nseeds = [[1, 1, 1]]\nROOT").unwrap();
        assert!(seeds.ends_with("does not support seeds (seeds in [takes])"), "{seeds}");
        let enclosed =
            declines("spacing_min = 1.0\nkeep = 'all'\nenclosed = 'keep'\nROOT").unwrap();
        assert!(enclosed.ends_with("enclosed = keep (keep_enclosed in [takes])"), "{enclosed}");
        let boxed = "spacing_min = 1.0\nkeep = 'all'\nROOT[[box]]\nmin = [0.0, 0.0, 0.0]\n\
                     max = [1.0, 1.0, 1.0]\nspacing = 1.0";
        assert!(declines(boxed).unwrap().contains("boxes"));
    }
}
