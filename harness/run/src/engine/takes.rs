//! The cases that an engine supports: the tables `[takes]` and `[limits]` of its file. No command runs it on any other.

use super::description::Description;
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

impl Description {
    /// Why the engine is not run on a case; `None` if it is.
    pub fn declines(&self, case: &Case) -> Option<String> {
        let (level, facets) = (case.level_deepest(), case.facets.len() as u64);
        let name = &self.name;
        if level > self.limits.level_max {
            let limit = self.limits.level_max;
            return Some(format!(
                "{name} supports levels up to {limit}, and the case needs {level}"
            ));
        }
        if facets > self.limits.facets_max {
            let limit = self.limits.facets_max;
            return Some(format!("{name} supports {limit} facets, and the case has {facets}"));
        }
        if !case.boxes.is_empty() && !self.takes.boxes {
            return Some(format!("{name} does not support extent boxes"));
        }
        if !self.takes.keep.contains(&case.keep) {
            return Some(format!("{name} does not support keep = {:?}", case.keep).to_lowercase());
        }
        if !case.keep_crossing && !self.takes.drop_crossing {
            return Some(format!("{name} does not support keep_crossing = false"));
        }
        if !case.seeds.is_empty() && !self.takes.seeds {
            return Some(format!("{name} does not support seeds"));
        }
        if case.enclosed == Enclosed::Keep && !self.takes.keep_enclosed {
            return Some(format!("{name} does not support enclosed = keep"));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_beyond_the_capabilities_is_declined_with_the_reason() {
        let least = "[run]\nserial = ['m', '{case}', '{out}']\n";
        let text =
            format!("{least}[takes]\nboxes = false\nkeep = ['all']\n[limits]\nlevel_max = 3\n");
        let engine = Description::parse(&text).unwrap();
        let root = "[root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n";
        let declines = |case: &str| {
            engine.declines(&Case::from_parts(&case.replace("ROOT", root), vec![]).unwrap())
        };
        assert_eq!(declines("spacing_min = 1.0\nkeep = 'all'\nROOT"), None);
        let deep = declines("spacing_min = 0.5\nkeep = 'all'\nROOT").unwrap();
        assert!(deep.contains("levels up to 3"), "{deep}");
        assert!(declines("spacing_min = 1.0\nROOT").unwrap().contains("outside"));
        let seeds = declines("spacing_min = 1.0\nkeep = 'all'\nseeds = [[1, 1, 1]]\nROOT").unwrap();
        assert!(seeds.ends_with("does not support seeds"), "{seeds}");
        let enclosed =
            declines("spacing_min = 1.0\nkeep = 'all'\nenclosed = 'keep'\nROOT").unwrap();
        assert!(enclosed.ends_with("enclosed = keep"), "{enclosed}");
        let boxed = "spacing_min = 1.0\nkeep = 'all'\nROOT[[box]]\nmin = [0.0, 0.0, 0.0]\n\
                     max = [1.0, 1.0, 1.0]\nspacing = 1.0";
        assert!(declines(boxed).unwrap().contains("boxes"));
    }
}
