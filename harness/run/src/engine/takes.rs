//! The cases that an engine supports: the tables `[takes]` and `[limits]` of its file. No command runs it on any other.

use contract::case::Case;
use contract::manifest::{Enclosed, Keep};
use contract::plain::StlForm;
use serde::Deserialize;

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
        let keep = vec![Keep::Outside, Keep::Inside, Keep::All];
        Self {
            generator: false,
            boxes: true,
            keep,
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
        Self { level_max: contract::octant::LEVEL_MAX, facets_max: u64::MAX }
    }
}

impl Limits {
    /// What of a case is beyond the limits, as the rest of a sentence about the engine; `None` if nothing is.
    pub fn exceeded_by(&self, case: &Case) -> Option<String> {
        let (level, facets) = (case.inputs().level_deepest(), case.facets.len() as u64);
        if level > self.level_max {
            return Some(format!(
                "supports levels up to {} (level_max in [limits]), and the case needs {level}",
                self.level_max
            ));
        }
        (facets > self.facets_max).then(|| {
            format!(
                "supports {} facets (facets_max in [limits]), and the case has {facets}",
                self.facets_max
            )
        })
    }
}

impl Takes {
    /// A feature of a case that is not supported; `None` if there is none.
    pub fn lacks(&self, case: &Case) -> Option<String> {
        let features = [
            (!case.boxes.is_empty() && !self.boxes, "extent boxes (boxes in [takes])"),
            (
                !case.keep_crossing && !self.drop_crossing,
                "keep_crossing = false (drop_crossing in [takes])",
            ),
            (!case.seeds.is_empty() && !self.seeds, "seeds (seeds in [takes])"),
            (
                case.enclosed == Enclosed::Keep && !self.keep_enclosed,
                "enclosed = keep (keep_enclosed in [takes])",
            ),
        ];
        let keep = || format!("keep = {:?} (keep in [takes])", case.keep).to_lowercase();
        let lacked =
            features.into_iter().find(|(lacked, _)| *lacked).map(|(_, name)| name.to_owned());
        lacked.or_else(|| (!self.keep.contains(&case.keep)).then(keep))
    }
}
