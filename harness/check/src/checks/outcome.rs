//! The outcome of a check.
//!
//! Invariant: a check that held has compared something. The type cannot express the opposite, so a run in which nothing was
//! compared has nothing to show as held.

use serde::{Deserialize, Serialize};
use std::num::NonZeroU64;

/// The outcome of a check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum Outcome {
    /// It holds.
    Pass {
        /// Number of things compared: leaves, unless the check's documentation names something else.
        compared: NonZeroU64,
    },
    /// It does not hold.
    Fail {
        /// The reason.
        why: String,
    },
    /// It shows nothing about the mesh.
    LeftOut {
        /// The reason.
        why: String,
    },
}

impl Outcome {
    /// A check without findings, which was left out if it compared nothing.
    pub fn held(compared: u64) -> Self {
        match NonZeroU64::new(compared) {
            Some(compared) => Self::Pass { compared },
            None => Self::left_out("there was nothing to compare"),
        }
    }

    /// A check that failed.
    pub fn fail(why: impl Into<String>) -> Self {
        Self::Fail { why: why.into() }
    }

    /// A check that was left out.
    pub fn left_out(why: impl Into<String>) -> Self {
        Self::LeftOut { why: why.into() }
    }

    /// Whether it holds.
    pub fn holds(&self) -> bool {
        matches!(self, Self::Pass { .. })
    }

    /// Whether it failed.
    pub fn failed(&self) -> bool {
        matches!(self, Self::Fail { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_compared_nothing_holds() {
        assert!(!Outcome::held(0).holds() && Outcome::held(1).holds());
        assert!(serde_json::from_str::<Outcome>(r#"{"outcome": "pass", "compared": 0}"#).is_err());
        assert!(serde_json::from_str::<Outcome>(r#"{"outcome": "pass"}"#).is_err());
        let text = serde_json::to_string(&Outcome::held(3)).unwrap();
        assert_eq!(text, r#"{"outcome":"pass","compared":3}"#);
        let text = serde_json::to_string(&Outcome::left_out("x")).unwrap();
        assert_eq!(text, r#"{"outcome":"left_out","why":"x"}"#);
    }
}
