//! Which runs a series and a row need: their cases, written for the programs, and how often each is repeated.

use super::file::{EXPERIMENT, Experiment, Series, Study};
use crate::experiments::entry::{Network, Setup};
use crate::experiments::execute::Runner;
use crate::experiments::network;
use crate::experiments::sizing::Sizes;
use crate::experiments::variant::Base;
use clap::Args;
use contract::case::Case;
use contract::failure::Failure;
use run::engine::launcher::Launcher;
use run::verify::options::whole_seconds;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The options of a session, as on the command line.
#[derive(Args, Clone, Debug)]
pub struct SessionOptions {
    /// No runs on MPI
    #[arg(long)]
    pub no_mpi: bool,
    /// Repetitions of every run; 95 % intervals of a median need six
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    pub repeat: Option<u16>,
    /// Command that starts ranks; {ranks} is replaced by their number
    #[arg(long, default_value = "mpirun -n {ranks}", value_parser = Launcher::parse)]
    pub launcher: Launcher,
    /// Latency and bandwidth of messages in the projection [default: measured by a ping-pong]
    #[arg(long, value_name = "SECONDS,BYTES/S", value_parser = network::given)]
    pub network: Option<Network>,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value_t = 1800, value_parser = whole_seconds)]
    pub timeout: u64,
}

impl SessionOptions {
    /// Returns how often a run is repeated that the file repeats so often.
    fn repeats(&self, of_file: usize) -> usize {
        self.repeat.map_or(of_file, usize::from)
    }
}

/// A run to be repeated.
pub(super) struct Planned {
    pub setup: Setup,
    pub case: PathBuf,
    pub repeats: usize,
    /// Whether an uncounted run of its mesh comes first.
    pub warm_up: bool,
    /// Why the program declines the case.
    pub declined: Option<String>,
    /// Whether a run failed, or none is possible.
    pub failed: bool,
}

impl Planned {
    /// The program and the case.
    pub fn mesh(&self) -> (String, PathBuf) {
        (self.setup.engine.clone(), self.case.clone())
    }
}

/// Plans runs.
pub(super) struct Plan<'a> {
    pub study: &'a Study,
    pub options: &'a SessionOptions,
    pub runner: Runner<'a>,
    pub progress: &'a dyn Fn(&str),
    /// Geometries read so far, by case, with the known sizes of their meshes by n.
    pub bases: BTreeMap<String, (Base, BTreeMap<u32, Sizes>)>,
}

impl Plan<'_> {
    /// Plans the runs of a series by one engine at one size.
    pub fn series(
        &mut self,
        series: &Series,
        engine: &str,
        cells: Option<f64>,
    ) -> Result<Vec<Planned>, Failure> {
        let description = self.runner.programs.labelled(engine).description();
        let layouts = series.layouts(description, self.mpi_left_out().is_some());
        if layouts.is_empty() {
            let experiment = series.experiment;
            (self.progress)(&format!("{engine} cannot run the series {experiment}"));
        }
        let key = &series.case;
        self.base(key)?;
        let of_case = [self.bases[key].0.layer_cells_min];
        let layers = if series.layers.is_empty() { &of_case[..] } else { &series.layers };
        let mut points = Vec::new();
        for (&n, &(comm, ranks)) in layers.iter().flat_map(|n| layouts.iter().map(move |l| (n, l)))
        {
            for spacing in self.spacings(key, series.experiment, cells, ranks)? {
                let base = &self.bases[key].0;
                let case = base.variant(spacing, n)?;
                let declined = description.declines(&Case::read(&case)?);
                points.extend(series.choices().iter().map(|&choice| Planned {
                    setup: Setup {
                        experiment: series.experiment.to_string(),
                        engine: engine.to_owned(),
                        ranks,
                        comm,
                        weights: choice.0.to_owned(),
                        partitioner: choice.1.to_owned(),
                        series_cells: cells.filter(|_| series.experiment.has_several_meshes()),
                        ..Setup::serial(&base.name, spacing, n)
                    },
                    case: case.clone(),
                    repeats: self.options.repeats(series.repeats),
                    warm_up: true,
                    failed: declined.is_some(),
                    declined: declined.clone(),
                }));
            }
        }
        Ok(points)
    }

    /// Returns the spacings of the meshes of a series for a number of ranks.
    fn spacings(
        &mut self,
        key: &str,
        experiment: Experiment,
        cells: Option<f64>,
        ranks: usize,
    ) -> Result<Vec<f64>, Failure> {
        let base = &self.bases[key].0;
        let (Some(cells), n) = (cells, base.layer_cells_min) else {
            return Ok(vec![base.spacing_min]);
        };
        let target = if experiment == Experiment::Weak { cells * ranks as f64 } else { cells };
        let finest = self.spacing(key, n, target)?;
        if experiment != Experiment::Spacing {
            return Ok(vec![finest]);
        }
        // Coarser by factors of two, while there are enough cells to measure.
        let halvings = (target / 1e5).log(4.0).max(0.0) as i32;
        Ok((0..=halvings).rev().map(|k| finest * 2f64.powi(k)).collect())
    }

    /// Returns the spacing that gives about this number of cells.
    fn spacing(&mut self, key: &str, n: u32, cells: f64) -> Result<f64, Failure> {
        let (base, sizes) = self.bases.get_mut(key).expect("the geometry was read");
        let runner = &self.runner;
        sizes.entry(n).or_default().spacing(cells, base.coarse(), |s| runner.count(base, s, n))
    }

    /// Plans the run of this name, and writes its case.
    pub fn run(&mut self, name: &str) -> Result<Planned, Failure> {
        let spec = &self.study.run[name];
        let mesh = &self.study.mesh[&spec.mesh];
        let key = &mesh.case;
        self.base(key)?;
        let base = self.bases[key].0.clone();
        let n = mesh.layer_cells_min.unwrap_or(base.layer_cells_min);
        let (case, spacing) = match mesh.cells {
            None => {
                let spacing = mesh.spacing_min.unwrap_or(base.spacing_min);
                (base.in_own_root(spacing, n), spacing)
            }
            Some(cells) => {
                (self.progress)(&format!("{}: looking for the spacing", spec.mesh));
                let spacing = self.spacing(key, n, cells)?;
                (base.variant(spacing, n), spacing)
            }
        };
        let repeats = self.options.repeats(spec.repeats);
        let setup = Setup {
            experiment: EXPERIMENT.to_owned(),
            ranks: spec.ranks,
            comm: spec.comm,
            partitioner: spec.partitioner.clone(),
            weights: spec.weights.clone(),
            level_base: spec.level_base,
            ..Setup::serial(&spec.mesh, spacing, n)
        };
        let warm_up = repeats > 1;
        Ok(Planned { setup, case: case?, repeats, warm_up, failed: false, declined: None })
    }

    /// Returns the reason why runs on MPI are skipped; `None` if they are not.
    pub fn mpi_left_out(&self) -> Option<&'static str> {
        match self.options.no_mpi {
            true => Some("--no-mpi was given"),
            false => (!self.options.launcher.is_found()).then_some("the launcher is missing"),
        }
    }

    /// Writes the geometry of a case as a binary STL file, once.
    fn base(&mut self, case: &str) -> Result<(), Failure> {
        if self.bases.contains_key(case) {
            return Ok(());
        }
        (self.progress)(&format!("{case}: reading the geometry"));
        let catalogue = &self.runner.programs.paths.catalogue;
        let path = catalogue.case_file(case, &self.study.directory)?;
        let base = Base::read(&path, self.runner.place)?;
        self.bases.insert(case.to_owned(), (base, BTreeMap::new()));
        Ok(())
    }
}
