//! The options of a verification, and the prerequisites, each tried once before the first case.

use super::report::{CaseReport, Check, Missing, Outcome, RUNS};
use crate::engine::description::Description;
use crate::engine::failure::{End, Failure};
use crate::engine::layout::{Layout, Ranks};
use crate::engine::runner::Programs;
use crate::engine::service::Services;
use crate::python::{ORACLES, start};
use check::promises::Independence;
use clap::Parser;
use clap::builder::{PathBufValueParser, RangedU64ValueParser, TypedValueParser};
use contract::catalogue::Size;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;

/// A prerequisite of a verification that a machine may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Need {
    /// `mpirun`. A mesher that was built without MPI fails.
    Mpi,
    /// Python with the packages of all three oracles.
    Oracles,
    /// The p4est program.
    P4est,
    /// The proven checker of reference/proof.
    Proof,
    /// The geometries that are downloaded and not kept in the repository.
    Geometries,
    /// At least one check of every case.
    Checks,
}

impl Need {
    /// Its name, as on the command line.
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// The options, as on the command line.
#[derive(Parser, Clone, Debug)]
pub struct Options {
    /// Names in geometries/catalogue.toml or paths of case files [default: all of --size]
    pub cases: Vec<String>,
    /// Sizes of the catalogue's cases
    #[arg(long, value_delimiter = ',', default_value = "small", conflicts_with = "cases")]
    pub size: Vec<Size>,
    /// Rank counts of the runs on MPI; given, they require it [default: 1,2,3,4,7,8,16,32,64]
    #[arg(long, value_delimiter = ',', value_parser = RangedU64ValueParser::<usize>::new().range(1..=1_000_000))]
    pub ranks: Option<Vec<usize>>,
    /// Partitioners of the runs on MPI, each at every rank count [default: metis,morton]
    #[arg(long, value_delimiter = ',')]
    pub partitioners: Option<Vec<String>>,
    /// Base depths of the runs on MPI, each with every partitioner [default: auto,3]
    #[arg(long, value_delimiter = ',')]
    pub level_bases: Option<Vec<String>>,
    /// Directory for reports and for results that are kept [default: a temporary one]
    #[arg(short, long, value_name = "DIR", value_parser = PathBufValueParser::new().try_map(|out| files::name_output(&out).map(|()| out)))]
    pub out: Option<PathBuf>,
    /// Also keep the results of passing cases
    #[arg(long)]
    pub keep: bool,
    /// Time limit of every single run
    #[arg(long, value_name = "SECONDS", default_value = TIMEOUT_S, value_parser = whole_seconds)]
    pub timeout: Duration,
    /// Leave out the runs on MPI
    #[arg(long)]
    pub no_mpi: bool,
    /// Leave out trimesh, open3d and pyvista
    #[arg(long)]
    pub no_oracles: bool,
    /// Leave out the comparison with p4est
    #[arg(long)]
    pub no_p4est: bool,
    /// Leave out the proof of the serial mesh
    #[arg(long)]
    pub no_proof: bool,
    /// Required components: exit code 3 if one is missing
    #[arg(long, value_delimiter = ',')]
    pub require: Vec<Need>,
}

/// Time limit without `--timeout`, in seconds.
pub(super) const TIMEOUT_S: &str = "600";
/// Rank counts without `--ranks`.
const RANKS: [usize; 9] = [1, 2, 3, 4, 7, 8, 16, 32, 64];

/// Parses a whole number of seconds: at least 1, and at most a week.
pub fn whole_seconds(text: &str) -> Result<Duration, String> {
    const WEEK: u64 = 7 * 86_400;
    let number = text.trim().parse().ok().filter(|n| (1..=WEEK).contains(n));
    let limit = number.map(Duration::from_secs);
    limit.ok_or_else(|| format!("give a whole number of seconds from 1 to {WEEK}"))
}

impl Options {
    /// A verification by reference and checks only, without MPI, oracles, p4est and proof.
    pub fn of_leaves_alone(cases: Vec<String>) -> Self {
        let words = ["verify", "--no-mpi", "--no-oracles", "--no-p4est", "--no-proof"];
        Self { cases, ..Self::parse_from(words) }
    }

    /// Rank counts of the runs on MPI, each once: a run has one directory. They are those that were asked for, or all of which the
    /// engine is capable.
    pub(super) fn rank_counts(&self, engine: &Description) -> Vec<usize> {
        if self.no_mpi || (self.ranks.is_none() && engine.run.parallel.is_empty()) {
            return Vec::new();
        }
        let counts = self.ranks.as_deref().unwrap_or(&RANKS).iter().copied();
        BTreeSet::from_iter(counts).into_iter().collect()
    }

    /// Every layout of a run on MPI, in the order of rank counts. The partition is varied as far as the engine offers a choice
    /// and promises that its mesh does not depend on it.
    pub(super) fn layouts(&self, engine: &Description) -> Vec<Layout> {
        let [partitioners, level_bases] = self.choices(engine).map(|(_, values)| values);
        let mut layouts = Vec::new();
        for ranks in self.rank_counts(engine).into_iter().map(Ranks::Mpi) {
            for partitioner in &partitioners {
                for level_base in &level_bases {
                    let (partitioner, level_base) = (partitioner.clone(), level_base.clone());
                    let layout = Layout { partitioner, level_base, ..Layout::on(ranks) };
                    // A run has one directory.
                    if !layouts.contains(&layout) {
                        layouts.push(layout);
                    }
                }
            }
        }
        layouts
    }

    /// Partitioners and base depths, and whether some were asked for that do not vary.
    fn choices(&self, engine: &Description) -> [(bool, Vec<Option<String>>); 2] {
        let run = &engine.run;
        let independent = engine.promises.is_independent_of(Independence::Partitioner);
        let all = [
            (&self.partitioners, &run.partitioner, ["metis", "morton"]),
            (&self.level_bases, &run.level_base, ["auto", "3"]),
        ];
        all.map(|(asked, offered, default)| match independent && !offered.is_empty() {
            true => {
                let asked = asked.clone().unwrap_or_else(|| default.map(str::to_owned).into());
                (false, asked.into_iter().map(Some).collect())
            }
            false => (asked.is_some(), vec![None]),
        })
    }
}

/// Name of the check of a case whose geometry is absent.
pub(super) const GEOMETRY: &str = "geometry";

/// The programs that stay for the whole verification, and why others are not used.
#[derive(Default)]
pub(super) struct Needs {
    pub services: Services,
    /// Why something is not used.
    absent: BTreeMap<Need, String>,
    /// Oracles that gave no answer.
    pub silent: RefCell<Vec<Failure>>,
    /// What the files of a mesh lack for the proven checker.
    pub unproven: RefCell<Option<String>>,
}

impl Needs {
    /// Tries the prerequisites of these options, and starts what stays while the first case is meshed serially.
    pub fn probe(options: &Options, programs: &Programs) -> Self {
        let (engine, paths) = (&programs.engine.description, &programs.paths);
        let unused = (!engine.promises.definition)
            .then(|| format!("{} does not promise the definition", engine.name));
        let p4est = (!paths.p4est.is_file())
            .then(|| format!("{} is missing (ci/setup compiles it)", paths.p4est.display()));
        let all = [
            (Need::Mpi, options.no_mpi, None, programs.engine.lacks_mpi()),
            (Need::Oracles, options.no_oracles, unused.clone(), None),
            (Need::P4est, options.no_p4est, unused.clone(), p4est),
            (Need::Proof, options.no_proof, unused, paths.lacks_checker()),
        ];
        let why = |(need, is_declined, unused, missing): (Need, bool, Option<_>, Option<_>)| {
            let declined = is_declined.then(|| format!("--no-{} was given", need.name()));
            Some((need, unused.or(declined).or(missing)?))
        };
        let needs = Self { absent: all.into_iter().filter_map(why).collect(), ..Self::default() };
        if needs.lacks(Need::Mpi).is_none() {
            let counts = options.rank_counts(engine).into_iter();
            counts.for_each(|ranks| programs.engine.start_ranks(ranks, &needs.services));
        }
        if needs.lacks(Need::Oracles).is_none() {
            // Their packages take seconds to import. Those that cannot be started are found when they are asked.
            ORACLES.iter().for_each(|of| drop(start(of, &needs.services, paths)));
        }
        needs
    }

    /// Why something is not used, if it is not.
    pub fn lacks(&self, need: Need) -> Option<&str> {
        self.absent.get(&need).map(String::as_str)
    }

    /// Whether an oracle is missing, or has hung, which costs the whole time limit.
    pub fn lacks_oracle(&self, oracle: &str) -> bool {
        let is_silent = |end: &End| matches!(end, End::Missing(_) | End::TimedOut { .. });
        self.silent.borrow().iter().any(|of| of.program == oracle && is_silent(&of.end))
    }

    /// Everything that is missing, once each. A check of a case that was named, or of any case at all, is always required.
    pub fn missing(
        self,
        options: &Options,
        engine: &Description,
        cases: &[CaseReport],
        interrupted: bool,
    ) -> Vec<Missing> {
        let Self { mut absent, silent, unproven, .. } = self;
        // The vote needs all oracles, so one that is missing, or gave no answer on a case, counts as all.
        if let Some(failure) = silent.into_inner().first() {
            absent.entry(Need::Oracles).or_insert(failure.to_string());
        }
        if let Some(why) = unproven.into_inner() {
            absent.insert(Need::Proof, why);
        }
        let lacks_geometry = |case: &&CaseReport| case.checks.iter().any(|c| c.name == GEOMETRY);
        let geometries = cases.iter().filter(lacks_geometry).count();
        if geometries > 0 {
            let fix = "ci/setup --geometries fetches those that can be fetched";
            absent.insert(Need::Geometries, format!("{geometries} geometries are missing ({fix})"));
        }
        // That an interrupt left the last ones without checks is no news.
        let unchecked =
            |case: &&CaseReport| !interrupted && !case.is_checked() && case.input_error.is_none();
        let unchecked: Vec<&str> = cases.iter().filter(unchecked).map(|case| &*case.name).collect();
        if !unchecked.is_empty() {
            absent.insert(Need::Checks, format!("no check was run on {}", unchecked.join(", ")));
        }
        // A program that cannot be started, or a reader of its files.
        let is_unrun = |check: &Check| {
            (&*check.subject, &*check.name) == ("serial", RUNS)
                && matches!(check.outcome, Outcome::LeftOut { .. })
        };
        let lacks_a_run = cases.iter().any(|case| case.checks.iter().any(is_unrun));
        let of_definition = engine.promises.definition.then_some(false);
        let (ranks, parallel) = (options.ranks.is_some(), !engine.run.parallel.is_empty());
        let of_ranks = match parallel {
            true => engine.promises.is_independent_of(Independence::Ranks),
            // By the definition alone, a program without ranks promises nothing of them.
            false => engine.promises.independent_of.contains(&Independence::Ranks),
        };
        // Without `--require`, whether it is required; `None` if the engine has no use of it.
        let required = |need| match need {
            Need::Mpi => {
                (ranks || parallel || of_ranks).then_some(!options.no_mpi && (ranks || of_ranks))
            }
            Need::Oracles | Need::P4est | Need::Proof => of_definition,
            Need::Geometries => Some(false),
            Need::Checks => {
                Some(unchecked.len() == cases.len() || lacks_a_run || !options.cases.is_empty())
            }
        };
        let missing = absent.into_iter().filter_map(|(need, why)| {
            let required = if options.require.contains(&need) { true } else { required(need)? };
            Some(Missing { what: need.name(), why, required })
        });
        let names = ["partitioners", "level-bases"].into_iter().zip(options.choices(engine));
        let ignored = names.filter(|(_, (is_ignored, _))| *is_ignored).map(|(name, _)| {
            let why = format!("--{name} was given, and {} offers no such choice, or does not promise that its mesh does not depend on it", engine.name);
            Missing { what: name.to_owned(), why, required: true }
        });
        missing.chain(ignored).collect()
    }
}
