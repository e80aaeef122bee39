//! The partition: which rank owns which octants (the paper's section III).
//!
//! [`initial`] partitions T0 before it is refined, by an estimate of the leaves. [`repartition`] shifts the boundaries after
//! refinement and after gradation, when the leaves are known. Both rest on [`ownership`], which maps octants to ranks,
//! and on [`curve`], which divides the Morton curve into intervals of equal weight. METIS on the graph of *base
//! leaves* is an option of [`initial`]. No module here imports a phase of the mesher.
//!
//! Invariants:
//! - every rank has the same map from the curve to owners, and the intervals of all ranks tile the curve;
//! - a rank holds a brick if it owns part of it; all ranks hold those with part of nine or more intervals of the curve, and those of the coarsest levels (to 1 + log4 p on p ranks);
//! - after [`synchronise_replicas`](ownership::Ownership::synchronise_replicas) all replicas of a brick are equal.

pub mod area;
pub mod curve;
pub mod initial;
pub(crate) mod metis;
pub mod ownership;
pub mod repartition;

use bricks::octant::Level;

/// The method that assigns base leaves to ranks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Partitioner {
    /// METIS, as in the paper, on the graph of base leaves; ours are neighbours if they share a face
    Metis,
    /// Intervals of the Morton curve with equal weight
    #[default]
    Morton,
    /// As in the paper: METIS on every rank, for the leaves of a base mesh of fixed depth (--level-base, 7 unless given; less than the deepest
    /// level), without those on the side that is not kept, each with weight 1; or an error
    Paper,
}

/// The weight of a part of T0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Weights {
    /// 1 for each base leaf, as in the paper (section V)
    Unit,
    /// The number of leaves estimated from facet areas and from the volumes of boxes
    Area,
    /// As `area`, then repartitioned by the number of leaves, of T0 after refinement and of the mesh after gradation; the same as
    /// `area` with METIS or with a given --level-base
    #[default]
    Rebalance,
}

/// The depth of base meshes that the paper calls typical (section III).
pub const PAPER_DEPTH: Level = 7;

/// How to divide the work among ranks. Without effect on the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Division {
    /// The method that assigns base leaves to ranks.
    pub partitioner: Partitioner,
    /// The weight of a base leaf.
    pub weights: Weights,
    /// Level of the base leaves; chosen from the weights and the number of ranks if none.
    pub level_base: Option<Level>,
}

impl Division {
    /// Whether boundaries between ranks may be anywhere on the Morton curve, not only between base leaves.
    pub fn is_of_curve(&self) -> bool {
        self.level_base.is_none()
            && self.partitioner == Partitioner::Morton
            && matches!(self.weights, Weights::Area | Weights::Rebalance)
    }

    /// Whether octants are repartitioned after refinement and after gradation.
    pub fn repartitions(&self) -> bool {
        self.is_of_curve() && self.weights == Weights::Rebalance
    }
}
