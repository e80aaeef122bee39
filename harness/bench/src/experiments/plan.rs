//! The experiments and the two presets of studies.

use super::entry::Comm;
use std::fmt;

/// A kind of experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Experiment {
    /// The same mesh on increasingly many ranks.
    Strong,
    /// The same number of cells per rank on increasingly many ranks; the spacing is chosen accordingly.
    Weak,
    /// Spacings that differ by factors of two.
    Spacing,
    /// The same spacing with increasing minimum layer thickness n.
    Layers,
    /// Weights of base leaves and partitioners.
    Weights,
}

impl fmt::Display for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Strong => "strong",
            Self::Weak => "weak",
            Self::Spacing => "spacing",
            Self::Layers => "layers",
            Self::Weights => "weights",
        })
    }
}

/// The extent of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Preset {
    /// Every experiment and every figure, in minutes on 2 cores.
    Small,
    /// The paper's sizes and beyond: 100 M and 1e9 cells, 1,024 simulated ranks.
    Full,
}

/// A number of ranks and their means of communication.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Layout {
    /// How ranks communicate.
    pub comm: Comm,
    /// Number of ranks.
    pub ranks: usize,
}

/// One experiment on one case.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// The program, by its name in the record.
    pub engine: String,
    /// The kind of experiment.
    pub experiment: Experiment,
    /// The case's name in the catalogue, or a case file.
    pub case: String,
    /// Cells to choose the spacing for: of the mesh (strong, weights), per rank (weak), of the largest mesh
    /// (spacing), at n = 4 (layers). None: the case's own spacing.
    pub cells: Option<u64>,
    /// Values of n; empty for the n of the case.
    pub layers: Vec<u32>,
    /// Ranks of the runs.
    pub layouts: Vec<Layout>,
    /// Weights of base leaves; every combination with `partitioners` is run.
    pub weights: Vec<String>,
    /// See `weights`.
    pub partitioners: Vec<String>,
    /// Repetitions of every run, the warm-up not counted.
    pub repeats: usize,
}

/// Changes of a preset by the command line.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    /// The program, by its name in the record.
    pub engine: String,
    /// Cases instead of the preset's.
    pub cases: Vec<String>,
    /// Experiments instead of all.
    pub experiments: Vec<Experiment>,
    /// Ranks of simulated runs; of runs on MPI with `no_sim` and without `ranks_mpi`.
    pub ranks: Vec<usize>,
    /// Ranks of runs on MPI.
    pub ranks_mpi: Vec<usize>,
    /// See [`Study::cells`].
    pub cells: Vec<u64>,
    /// See [`Study::layers`].
    pub layers: Vec<u32>,
    /// Weights of the experiment of that name.
    pub weights: Vec<String>,
    /// Partitioners of the experiment `weights`.
    pub partitioners: Vec<String>,
    /// Repetitions.
    pub repeats: Option<usize>,
    /// No runs on MPI.
    pub no_mpi: bool,
    /// No runs on simulated ranks, for a program without them.
    pub no_sim: bool,
    /// Serial runs only, for a serial program.
    pub serial: bool,
    /// The program does not offer weights and partitioners.
    pub no_choice: bool,
}

const MILLION: u64 = 1_000_000;

impl Study {
    /// Whether another study has the same meshes.
    pub fn has_meshes_of(&self, other: &Self) -> bool {
        let meshes = |s: &Self| (s.experiment, s.cells, s.case.clone());
        meshes(self) == meshes(other)
    }
}

/// Returns the studies of several programs, those of the same meshes in succession.
pub fn comparison(preset: Preset, programs: &[Overrides]) -> Vec<Study> {
    let all: Vec<Study> = programs.iter().flat_map(|p| studies(preset, p)).collect();
    let mut sorted = all.clone();
    sorted.sort_by_key(|study| all.iter().position(|other| other.has_meshes_of(study)));
    sorted
}

/// Returns the studies of a preset with the overrides applied.
pub fn studies(preset: Preset, overrides: &Overrides) -> Vec<Study> {
    let is_selected = |s: &Study| {
        overrides.experiments.is_empty() || overrides.experiments.contains(&s.experiment)
    };
    let mut of_preset: Vec<Study> = match preset {
        Preset::Small => small(),
        Preset::Full => full(),
    };
    of_preset.retain(is_selected);
    of_preset.retain(|s| !(overrides.no_choice && s.experiment == Experiment::Weights));
    if !overrides.cases.is_empty() {
        of_preset = on_cases(of_preset, &overrides.cases);
    }
    if !overrides.cells.is_empty() {
        of_preset = with_cells(of_preset, &overrides.cells);
    }
    for study in &mut of_preset {
        change(study, overrides);
    }
    // A study without runs is dropped.
    of_preset.retain(|study| !study.layouts.is_empty());
    of_preset
}

/// The first study of every experiment, for every case.
fn on_cases(studies: Vec<Study>, cases: &[String]) -> Vec<Study> {
    let mut out: Vec<Study> = Vec::new();
    for case in cases {
        for study in &studies {
            let made = |s: &Study| s.experiment == study.experiment && s.case == *case;
            if !out.iter().any(made) {
                out.push(Study { case: case.clone(), ..study.clone() });
            }
        }
    }
    out
}

/// The first study of every experiment and case, for every size.
fn with_cells(studies: Vec<Study>, cells: &[u64]) -> Vec<Study> {
    let mut out: Vec<Study> = Vec::new();
    for study in studies {
        for &cells in cells {
            let made = |s: &Study| {
                s.experiment == study.experiment && s.case == study.case && s.cells == Some(cells)
            };
            if !out.iter().any(made) {
                out.push(Study { cells: Some(cells), ..study.clone() });
            }
        }
    }
    out
}

fn change(study: &mut Study, overrides: &Overrides) {
    // Without simulated ranks, the only ranks are those on MPI.
    let only_mpi = overrides.no_sim && overrides.ranks_mpi.is_empty();
    let (sim, mpi) = if only_mpi {
        (&[][..], &overrides.ranks[..])
    } else {
        (&overrides.ranks[..], &overrides.ranks_mpi[..])
    };
    if !sim.is_empty() || !mpi.is_empty() {
        let scales = matches!(study.experiment, Experiment::Strong | Experiment::Weak);
        if scales {
            study.layouts = layouts(sim, mpi);
        } else if study.experiment == Experiment::Weights && !sim.is_empty() {
            study.layouts = layouts(sim, &[]);
        }
    }
    if overrides.no_mpi {
        // A serial run replaces the measured ones.
        let serial = study.layouts.iter().any(|l| l.comm == Comm::Mpi);
        study.layouts.retain(|l| l.comm != Comm::Mpi);
        study.layouts.extend(serial.then_some(Layout { comm: Comm::Solo, ranks: 1 }));
    }
    if overrides.no_sim {
        study.layouts.retain(|l| l.comm != Comm::Sim);
    }
    if overrides.serial {
        study.layouts = vec![Layout { comm: Comm::Solo, ranks: 1 }];
        if matches!(study.experiment, Experiment::Weak | Experiment::Weights) {
            study.layouts.clear();
        }
    }
    if !overrides.layers.is_empty() && study.experiment == Experiment::Layers {
        study.layers.clone_from(&overrides.layers);
    }
    if !overrides.weights.is_empty() {
        study.weights.clone_from(&overrides.weights);
    }
    if !overrides.partitioners.is_empty() {
        study.partitioners.clone_from(&overrides.partitioners);
    }
    study.repeats = overrides.repeats.unwrap_or(study.repeats);
    study.engine.clone_from(&overrides.engine);
}

fn small() -> Vec<Study> {
    let scaling = layouts(&[1, 2, 4, 8, 16, 32, 64], &[1, 2, 4]);
    vec![
        study(Experiment::Strong, "uav-large", 20 * MILLION, &scaling, 6),
        study(Experiment::Weak, "uav-large", MILLION, &layouts(&[1, 4, 16, 64], &[1, 2]), 3),
        study(Experiment::Spacing, "uav-large", 32 * MILLION, &layouts(&[], &[1, 2]), 6),
        study(Experiment::Layers, "uav-large", 4 * MILLION, &layouts(&[], &[1, 2]), 6),
        study(Experiment::Weights, "uav-large", 20 * MILLION, &layouts(&[64], &[]), 3),
        study(Experiment::Weights, "fighter-large", 20 * MILLION, &layouts(&[64], &[]), 3),
    ]
}

fn full() -> Vec<Study> {
    let to_64 = layouts(&[1, 2, 4, 8, 16, 32, 64], &[1, 2, 4, 8, 16, 32, 64]);
    let to_1024 = layouts(&[1, 4, 16, 64, 256, 1024], &[1, 2]);
    let mut all = vec![
        study(Experiment::Strong, "uav-large", 50 * MILLION, &to_64, 6),
        study(Experiment::Strong, "uav-large", 100 * MILLION, &to_64, 3),
        study(Experiment::Strong, "uav-large", 1000 * MILLION, &to_1024, 3),
        study(Experiment::Strong, "fighter-large", 100 * MILLION, &to_64, 3),
        study(Experiment::Weak, "uav-large", MILLION, &to_1024, 3),
        study(Experiment::Spacing, "uav-large", 1600 * MILLION, &layouts(&[], &[1, 2]), 3),
        study(Experiment::Layers, "uav-large", 20 * MILLION, &layouts(&[], &[1, 2]), 6),
    ];
    for case in ["uav-large", "fighter-large"] {
        for cells in [100 * MILLION, 1000 * MILLION] {
            all.push(study(Experiment::Weights, case, cells, &layouts(&[64], &[]), 3));
        }
    }
    all
}

fn study(
    experiment: Experiment,
    case: &str,
    cells: u64,
    layouts: &[Layout],
    repeats: usize,
) -> Study {
    let words = |all: &[&str]| all.iter().map(|w| (*w).to_owned()).collect::<Vec<String>>();
    let layers = match experiment {
        Experiment::Layers => vec![1, 2, 3, 4, 6, 8, 12, 16],
        _ => Vec::new(),
    };
    let (weights, partitioners) = match experiment {
        Experiment::Weights => {
            let weights = words(&["unit", "area", "rebalance"]);
            (weights, words(&["metis", "morton"]))
        }
        // The default of the mesher.
        _ => (words(&[""]), words(&[""])),
    };
    let (engine, case, layouts) = (String::new(), case.to_owned(), layouts.to_vec());
    let cells = Some(cells);
    Study { engine, experiment, case, cells, layers, layouts, weights, partitioners, repeats }
}

/// Returns layouts of simulated runs followed by runs on MPI.
fn layouts(sim: &[usize], mpi: &[usize]) -> Vec<Layout> {
    let of = |comm: Comm| move |&ranks: &usize| Layout { comm, ranks };
    sim.iter().map(of(Comm::Sim)).chain(mpi.iter().map(of(Comm::Mpi))).collect()
}

/// Parses rank counts: `1,2,7`, or `1..64` for the powers of two.
///
/// # Errors
/// The expected format.
pub fn ranks(text: &str) -> Result<Vec<usize>, String> {
    let wrong = || "give rank counts as in 1,2,7 or 1..64, the latter for powers of two".to_owned();
    let number =
        |word: &str| word.trim().parse::<usize>().ok().filter(|r| (1..=65_536).contains(r));
    let mut all = Vec::new();
    for word in text.split(',') {
        match word.split_once("..") {
            Some((from, to)) => {
                let (from, to) = (number(from).ok_or_else(wrong)?, number(to).ok_or_else(wrong)?);
                all.extend(
                    std::iter::successors(Some(from), |r| Some(r * 2)).take_while(|&r| r <= to),
                );
            }
            None => all.push(number(word).ok_or_else(wrong)?),
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_lists_and_powers_of_two() {
        assert_eq!(ranks("1..64").unwrap(), [1, 2, 4, 8, 16, 32, 64]);
        assert_eq!(ranks("1, 7,16..40").unwrap(), [1, 7, 16, 32]);
        assert!(ranks("0").is_err() && ranks("a..4").is_err() && ranks("").is_err());
    }

    #[test]
    fn overrides_change_a_preset() {
        let overrides = Overrides {
            experiments: vec![Experiment::Strong],
            cases: vec!["cube".into(), "ball".into()],
            cells: vec![1000, 2000],
            ranks: vec![1, 3],
            repeats: Some(9),
            ..Overrides::default()
        };
        let all = studies(Preset::Full, &overrides);
        assert_eq!(all.len(), 4);
        assert_eq!((all[0].case.as_str(), all[0].cells), ("cube", Some(1000)));
        assert_eq!(all[0].layouts, layouts(&[1, 3], &[]));
        assert_eq!((all[3].repeats, all[3].layers.len()), (9, 0));
    }

    #[test]
    fn programs_take_turns_on_the_same_meshes() {
        let of = |engine: &str| Overrides {
            engine: engine.into(),
            experiments: vec![Experiment::Strong],
            cases: vec!["cube".into()],
            cells: vec![1000, 2000],
            serial: true,
            ..Overrides::default()
        };
        let all = comparison(Preset::Small, &[of("a"), of("b")]);
        let order: Vec<_> = all.iter().map(|s| (s.engine.as_str(), s.cells)).collect();
        let expected = [("a", 1000), ("b", 1000), ("a", 2000), ("b", 2000)];
        assert_eq!(order, expected.map(|(engine, cells)| (engine, Some(cells))));
        assert!(all[0].has_meshes_of(&all[1]) && !all[1].has_meshes_of(&all[2]));
    }

    #[test]
    fn without_mpi_serial_runs_replace_the_measured_ones() {
        let no_mpi = Overrides { no_mpi: true, ..Overrides::default() };
        let all = studies(Preset::Small, &no_mpi);
        assert!(all.iter().flat_map(|s| &s.layouts).all(|l| l.comm != Comm::Mpi));
        assert!(all.iter().all(|s| !s.layouts.is_empty()));
        let serial = Overrides { serial: true, ..Overrides::default() };
        let all = studies(Preset::Small, &serial);
        assert!(all.iter().flat_map(|s| &s.layouts).all(|l| l.comm == Comm::Solo && l.ranks == 1));
        assert!(all.iter().all(|s| s.experiment != Experiment::Weights));
        let real = Overrides { no_sim: true, no_choice: true, ..Overrides::default() };
        let all = studies(Preset::Small, &real);
        assert!(all.iter().flat_map(|s| &s.layouts).all(|l| l.comm == Comm::Mpi));
        assert!(!all.is_empty() && all.iter().all(|s| s.experiment != Experiment::Weights));
    }

    #[test]
    fn without_simulated_ranks_all_ranks_are_on_mpi() {
        let experiments = vec![Experiment::Strong];
        let overrides =
            Overrides { experiments, ranks: vec![1, 3], no_sim: true, ..Overrides::default() };
        let of = |overrides: &Overrides| studies(Preset::Small, overrides)[0].layouts.clone();
        assert_eq!(of(&overrides), layouts(&[], &[1, 3]));
        assert_eq!(of(&Overrides { ranks_mpi: vec![2], ..overrides }), layouts(&[], &[2]));
    }

    #[test]
    fn presets_contain_every_experiment() {
        for preset in [Preset::Small, Preset::Full] {
            let mut experiments: Vec<Experiment> =
                studies(preset, &Overrides::default()).iter().map(|s| s.experiment).collect();
            experiments.sort();
            experiments.dedup();
            assert_eq!(experiments.len(), 5);
        }
    }
}
