//! The runs of a study: meshes by spacing and n, with every requested partition.

use super::execute::{self, Failed};
use super::plan::{Experiment, Layout, Study};
use super::session::{Bench, BenchError, Point};
use super::sizing::Sizes;
use super::variant::Base;
use crate::experiments::entry::{Comm, Setup};
use contract::case::Case;
use std::collections::BTreeMap;
use std::path::Path;

/// Cells that an exposed face weighs in the experiment `weights`.
const WEIGHT_EXPOSED: u32 = 10;

impl Bench<'_> {
    /// Returns the runs of a study; `sizes` has the known sizes of the case by n.
    pub(crate) fn points(
        &mut self,
        study: &Study,
        base: &Base,
        sizes: &mut BTreeMap<u32, Sizes>,
    ) -> Result<Vec<Point>, BenchError> {
        let own = [base.layer_cells_min];
        let layers = if study.layers.is_empty() { &own[..] } else { &study.layers };
        let mut points = Vec::new();
        for &n in layers {
            for layout in &study.layouts {
                for spacing in self.spacings(study, base, layout, sizes)? {
                    let case = base.variant(spacing, n).map_err(BenchError::Input)?;
                    if let Some(why) = self.declined(study, &case)? {
                        let setup = setup(study, base, layout, spacing, n, Choice::default());
                        self.leave_out(setup, why)?;
                        continue;
                    }
                    for choice in choices(study) {
                        let setup = setup(study, base, layout, spacing, n, choice);
                        points.push(Point { setup, case: case.clone(), failed: false });
                    }
                }
            }
        }
        Ok(points)
    }

    /// Returns the reason in the engine's description for which it is not run on a case.
    fn declined(&self, study: &Study, case: &Path) -> Result<Option<String>, BenchError> {
        let engine = self.runner.programs.labelled(&study.engine);
        let case = Case::read(case).map_err(|error| BenchError::Input(error.to_string()))?;
        Ok(engine.description().declines(&case))
    }

    /// Returns the spacings of a study's meshes for a number of ranks.
    fn spacings(
        &mut self,
        study: &Study,
        base: &Base,
        layout: &Layout,
        sizes: &mut BTreeMap<u32, Sizes>,
    ) -> Result<Vec<f64>, BenchError> {
        let Some(cells) = study.cells else { return Ok(vec![base.spacing_min]) };
        let n = base.layer_cells_min;
        let known = sizes.entry(n).or_default();
        let target = match study.experiment {
            Experiment::Weak => cells as f64 * layout.ranks as f64,
            _ => cells as f64,
        };
        let coarse = base.coarse();
        let finest = known.spacing(target, coarse, |spacing| self.count(base, spacing, n))?;
        Ok(match study.experiment {
            Experiment::Spacing => {
                // Coarser by factors of two, while there are enough cells to measure.
                let halvings = (target / 1e5).log(4.0).max(0.0) as i32;
                (0..=halvings).rev().map(|k| finest * 2f64.powi(k)).collect()
            }
            _ => vec![finest],
        })
    }

    /// Returns the number of cells of a mesh, generated on one rank.
    pub(crate) fn count(&self, base: &Base, spacing: f64, n: u32) -> Result<u64, BenchError> {
        let case = base.variant(spacing, n).map_err(BenchError::Input)?;
        let setup = Setup {
            experiment: String::new(),
            engine: "mesher".to_owned(),
            case: base.name.clone(),
            spacing_min: spacing,
            layer_cells_min: n,
            ranks: 1,
            comm: Comm::Solo,
            partitioner: String::new(),
            weights: String::new(),
            weight_exposed: None,
        };
        match self.runner.run(&setup, &case, 0, true) {
            Ok(run) => Ok(run.cells),
            Err(Failed::Interrupted) => Err(BenchError::Interrupted),
            Err(Failed::Reason(why)) => Err(BenchError::Input(format!("{}: {why}", base.name))),
        }
    }
}

fn setup(
    study: &Study,
    base: &Base,
    layout: &Layout,
    spacing_min: f64,
    layer_cells_min: u32,
    choice: Choice,
) -> Setup {
    Setup {
        experiment: study.experiment.to_string(),
        engine: study.engine.clone(),
        case: base.name.clone(),
        spacing_min,
        layer_cells_min,
        ranks: layout.ranks,
        comm: layout.comm,
        partitioner: choice.partitioner.to_owned(),
        weights: choice.weights.to_owned(),
        weight_exposed: choice.weight_exposed,
    }
}

/// Returns, for every mesh of every engine, the index of the point that warms it up: the one on the most ranks that reports
/// a message matrix, otherwise the first.
pub(crate) fn warmers(points: &[Point]) -> Vec<usize> {
    let worth = |point: &Point| match execute::has_message_matrix(&point.setup) {
        true => point.setup.ranks,
        false => 0,
    };
    let mut best: Vec<usize> = Vec::new();
    for (index, point) in points.iter().enumerate() {
        let mesh = |p: &Point| (p.setup.engine.clone(), p.case.clone());
        match best.iter_mut().find(|b| mesh(&points[**b]) == mesh(point)) {
            Some(chosen) if worth(point) > worth(&points[*chosen]) => *chosen = index,
            Some(_) => {}
            None => best.push(index),
        }
    }
    best
}

/// What determines the partition of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Choice<'a> {
    weights: &'a str,
    partitioner: &'a str,
    weight_exposed: Option<u32>,
}

/// Returns all combinations except `rebalance` with METIS, which is identical to `area`. The experiment `weights` counts exposed faces, and has
/// the repartition that they weigh in beside the one by cells alone.
fn choices(study: &Study) -> Vec<Choice<'_>> {
    let counted = (study.experiment == Experiment::Weights).then_some(0);
    let mut all = Vec::new();
    for weights in &study.weights {
        for partitioner in &study.partitioners {
            let is_repartition = weights == "rebalance";
            if is_repartition && partitioner == "metis" && study.partitioners.len() > 1 {
                continue;
            }
            let choice = Choice { weights, partitioner, weight_exposed: counted };
            let weighted = Choice { weight_exposed: Some(WEIGHT_EXPOSED), ..choice };
            all.push(choice);
            all.extend((is_repartition && counted.is_some()).then_some(weighted));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::plan;
    use super::*;

    fn point(comm: Comm, ranks: usize, case: &str) -> Point {
        let setup = crate::testing::run(comm, 1, &[("a", &vec![0.0; ranks])]).setup;
        Point { setup, case: case.into(), failed: false }
    }

    #[test]
    fn the_experiment_on_weights_counts_exposed_faces_and_weighs_them_in_the_repartition() {
        let of = |experiment| {
            let all = plan::studies(plan::Preset::Small, &plan::Overrides::default());
            all.into_iter().find(|study| study.experiment == experiment).unwrap()
        };
        let weights = of(Experiment::Weights);
        let shown: Vec<_> = choices(&weights)
            .iter()
            .map(|c| (c.weights, c.partitioner, c.weight_exposed))
            .collect();
        let [counted, weighed] = [Some(0), Some(WEIGHT_EXPOSED)];
        let expected = [
            ("unit", "metis", counted),
            ("unit", "morton", counted),
            ("area", "metis", counted),
            ("area", "morton", counted),
            ("rebalance", "morton", counted),
            ("rebalance", "morton", weighed),
        ];
        assert_eq!(shown, expected);
        assert_eq!(choices(&of(Experiment::Strong)), [Choice::default()]);
    }

    #[test]
    fn a_mesh_is_warmed_up_once_on_the_layout_with_a_message_matrix() {
        let points = [
            point(Comm::Sim, 1, "a"),
            point(Comm::Sim, 64, "a"),
            point(Comm::Sim, 16, "a"),
            point(Comm::Sim, 1024, "a"),
            point(Comm::Mpi, 2, "b"),
            point(Comm::Mpi, 4, "b"),
        ];
        assert_eq!(warmers(&points), [1, 4]);
        let mut weak = points;
        weak.iter_mut().for_each(|p| p.setup.experiment = "weak".into());
        assert_eq!(warmers(&weak), [0, 4]);
        weak[2].setup.engine = "another".into();
        assert_eq!(warmers(&weak), [0, 2, 4]);
    }
}
