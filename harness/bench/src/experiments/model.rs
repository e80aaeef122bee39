//! Models of a program's phases on simulated ranks, to predict what was not measured.
//!
//! A counter is exact, so it comes first: its mean over the ranks is a [`Sum`] of [`TERMS`], functions of cells N, ranks p and facets F. The mean
//! time of a phase is then a sum of costs times means of counters. Of both, the maximum exceeds the mean by a factor a p^b. A phase takes as
//! long as on its slowest rank, plus its messages in the latency-bandwidth model of [`pop`](super::pop), and a run as long as all phases.
//!
//! [`Tested`] fits runs on few ranks and holds out those on many. The band of a prediction follows from predictions of the same kind in
//! retrospect: of the runs that were fitted, from those on fewer ranks. Its relative width is the 90 % quantile of their errors, pooled over all
//! quantities of a kind and each divided by its reach (the ratio of the ranks to the most that were fitted), times the prediction's reach. The
//! quantile is that of split conformal prediction, without its guarantee, as later runs are not exchangeable with earlier ones: so the share
//! of held-out values within bands is reported beside them.
//!
//! Only positive values are compared, and a counter that is below one per rank in some fitted run explains no time and has no law.
//!
//! Square errors have the weight of the ranks, because runs on more ranks are nearer to what is predicted. Runs on one rank are left out: they
//! have no messages, no halos and other phases.

use super::entry::{Comm, Network, Spread};
use super::group::Group;
use crate::order::distinct;
use statistics::median_of;
use statistics::sums::Sum;
use std::collections::BTreeMap;

/// Cells, ranks and facets of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct At {
    /// N.
    pub cells: f64,
    /// p.
    pub ranks: f64,
    /// F.
    pub facets: f64,
}

/// A function of a run, with its name.
type Term = (&'static str, fn(&At) -> f64);

/// The terms of a mean over the ranks: shares of cells and of facets, the boundary of a part of a surface, a constant, a collective operation by
/// a tree, and one in which every rank receives from all others.
const TERMS: [Term; 6] = [
    ("N/p", |at| at.cells / at.ranks),
    ("F/p", |at| at.facets / at.ranks),
    ("√(N/p)", |at| (at.cells / at.ranks).sqrt()),
    ("", |_| 1.0),
    ("⌈log₂p⌉", |at| at.ranks.log2().ceil()),
    ("(p – 1)", |at| at.ranks - 1.0),
];

/// Kinds of quantities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A counter of the program, or messages and bytes of a phase.
    Counter,
    /// The time of a phase outside of communication, in seconds.
    Phase,
    /// The time of a run, in seconds.
    Run,
}

/// A kind and a name.
pub type Key = (Kind, String);

/// Mean over the ranks and maximum.
type Ends = [f64; 2];

/// What is known of a run.
struct Sample {
    at: At,
    of: BTreeMap<Key, Ends>,
    network: Network,
}

/// The keys of a phase's messages and bytes begin with these words.
const TRAFFIC: [&str; 2] = ["messages of ", "bytes of "];

fn traffic(phase: &str) -> [Key; 2] {
    TRAFFIC.map(|what| (Kind::Counter, what.to_owned() + phase))
}

/// The key of facets per rank, which need no law.
fn facets() -> Key {
    (Kind::Counter, "facets per rank".to_owned())
}

impl Sample {
    fn of(group: &Group) -> Self {
        let (run, ranks) = (&group.typical, group.setup.ranks as f64);
        let at = At { cells: run.cells as f64, ranks, facets: run.facets as f64 };
        let ends = |of: &Spread| [of.sum / ranks, of.max];
        // The phases' messages are counted apart.
        let is_own = |name: &str| !["messages", "message_bytes"].contains(&name);
        let own = run.counters.iter().filter(|(name, _)| is_own(name));
        let mut of: BTreeMap<Key, Ends> =
            own.map(|(name, of)| ((Kind::Counter, name.clone()), ends(of))).collect();
        of.insert(facets(), [at.facets / ranks; 2]);
        for phase in &run.phases {
            let messages = [&phase.messages, &phase.message_bytes].map(ends);
            of.extend(traffic(&phase.name).into_iter().zip(messages));
        }
        // What happens less than once on a rank explains no time.
        of.retain(|_, [mean, _]| *mean >= 1.0);
        let times = run.phases.iter().map(|phase| (phase.name.clone(), ends(&phase.useful_s)));
        of.extend(times.map(|(name, ends)| ((Kind::Phase, name), ends)));
        of.insert((Kind::Run, "run".to_owned()), [group.time_s.value; 2]);
        Self { at, of, network: group.network }
    }
}

/// A mean over the ranks, and the factor by which the maximum exceeds it.
#[derive(Clone, Debug)]
struct Law {
    mean: Sum,
    /// a and b of a p^b.
    imbalance: [f64; 2],
}

impl Law {
    /// Of the runs that have this quantity, with all terms of each; `None` if they are too few.
    fn fit(samples: &[Sample], key: &Key, terms: impl Fn(&Sample) -> Vec<f64>) -> Option<Self> {
        let of = |sample: &Sample| sample.of.get(key).copied().filter(|ends| ends[0] > 0.0);
        let known: Vec<(&Sample, Ends)> =
            samples.iter().filter_map(|sample| Some((sample, of(sample)?))).collect();
        let row = |(s, [mean, _]): &(&Sample, Ends)| (s.at.ranks, *mean, terms(s));
        let mean = Sum::fit(&known.iter().map(row).collect::<Vec<_>>())?;
        let logs = known.iter().map(|(s, [mean, max])| [s.at.ranks.ln(), (max / mean).ln()]);
        let is_known = distinct(known.iter().map(|(sample, _)| sample.at.ranks)).len() > 1;
        is_known.then(|| Self { mean, imbalance: power(&logs.collect::<Vec<_>>()) })
    }

    /// Mean and maximum for the values of all terms.
    fn at(&self, terms: &[f64], ranks: f64) -> Ends {
        let ([a, b], mean) = (self.imbalance, self.mean.at(terms));
        [mean, mean * (a * ranks.powf(b)).clamp(1.0, ranks)]
    }

    /// The mean as a sum of terms with these names, and the imbalance.
    fn formulas(&self, names: &[&str]) -> [String; 2] {
        let term = |(term, coefficient): &(usize, f64)| {
            format!("{coefficient:.1e} {}", names[*term]).trim().to_owned()
        };
        let [a, b] = self.imbalance;
        let terms: Vec<String> = self.mean.terms.iter().map(term).collect();
        [terms.join(" + "), format!("{a:.2} p^{b:.2}")]
    }
}

/// a and b of y = a x^b, from logarithms, by least squares with the weights x.
fn power(logs: &[[f64; 2]]) -> [f64; 2] {
    let total = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        logs.iter().map(|[x, y]| x.exp() * of(*x, *y)).sum()
    };
    let count = total(&|_, _| 1.0);
    let [x, y] = [total(&|x, _| x) / count, total(&|_, y| y) / count];
    let b = total(&|of, at| (of - x) * (at - y)) / total(&|of, _| (of - x).powi(2));
    [(y - b * x).exp(), b]
}

/// The least numbers of ranks to fit.
const RANKS_MIN: usize = 3;

/// A model of the runs of one program around one geometry with one n.
#[derive(Clone, Debug)]
struct Model {
    counters: BTreeMap<Key, Law>,
    /// By phases, in the program's order. The terms are [`causes`].
    phases: Vec<(String, Law)>,
}

/// What the time of a phase may depend on: means of the program's counters and of its own messages, and a constant.
fn causes<'a>(phase: &str, counters: impl Iterator<Item = &'a Key>) -> Vec<&'a Key> {
    let own = traffic(phase);
    let is_own = |key: &Key| !TRAFFIC.iter().any(|what| key.1.starts_with(what));
    counters.filter(|key| is_own(key) || own.contains(key)).collect()
}

impl Model {
    /// Fits runs, which are on at least three numbers of ranks.
    fn fit(samples: &[Sample], phases: &[String]) -> Option<Self> {
        if distinct(samples.iter().map(|s| s.at.ranks)).len() < RANKS_MIN {
            return None;
        }
        let terms = |sample: &Sample| TERMS.iter().map(|(_, term)| term(&sample.at)).collect();
        let is_counter = |key: &&Key| {
            key.0 == Kind::Counter && samples.iter().all(|sample| sample.of.contains_key(key))
        };
        let law = |key: &Key| Some((key.clone(), Law::fit(samples, key, terms)?));
        let counters: BTreeMap<Key, Law> =
            samples[0].of.keys().filter(is_counter).filter_map(law).collect();
        let law = |name: &String| {
            let causes = causes(name, counters.keys());
            let terms =
                |sample: &Sample| causes.iter().map(|key| sample.of[key][0]).chain([1.0]).collect();
            Some((name.clone(), Law::fit(samples, &(Kind::Phase, name.clone()), terms)?))
        };
        let phases = phases.iter().filter_map(law).collect();
        Some(Self { counters, phases })
    }

    /// All quantities, and the time of a run.
    fn predict(&self, at: &At, network: &Network) -> BTreeMap<Key, Ends> {
        let terms: Vec<f64> = TERMS.iter().map(|(_, term)| term(at)).collect();
        let ends = |(key, law): (&Key, &Law)| (key.clone(), law.at(&terms, at.ranks));
        let mut all: BTreeMap<Key, Ends> = self.counters.iter().map(ends).collect();
        all.insert(facets(), [at.facets / at.ranks; 2]);
        let mut run_s = 0.0;
        for (name, law) in &self.phases {
            let causes = causes(name, self.counters.keys());
            let means: Vec<f64> = causes.iter().map(|key| all[*key][0]).chain([1.0]).collect();
            let useful_s = law.at(&means, at.ranks);
            let [messages, bytes] = traffic(name).map(|key| all.get(&key).map_or(0.0, |of| of[1]));
            run_s += useful_s[1] + network.time_s(messages, bytes);
            all.insert((Kind::Phase, name.clone()), useful_s);
        }
        all.insert((Kind::Run, "run".to_owned()), [run_s; 2]);
        all
    }

    /// Every quantity of a run with its predicted and its measured value, if both are positive.
    fn compare(&self, sample: &Sample) -> Vec<Compared> {
        let compared = |(key, [_, predicted]): (Key, Ends)| {
            let measured = sample.of.get(&key).map_or(0.0, |ends| ends[1]);
            let at = sample.at;
            (predicted.min(measured) > 0.0).then_some(Compared { key, at, predicted, measured })
        };
        self.predict(&sample.at, &sample.network).into_iter().filter_map(compared).collect()
    }
}

/// A predicted value beside the measured one.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// The quantity.
    pub key: Key,
    /// The run.
    pub at: At,
    /// By the model.
    pub predicted: f64,
    /// In the run.
    pub measured: f64,
}

impl Compared {
    /// Relative error of the prediction.
    pub fn error(&self) -> f64 {
        self.predicted / self.measured - 1.0
    }

    /// The greater of both values over the lesser.
    fn off(&self) -> f64 {
        (self.predicted / self.measured).max(self.measured / self.predicted)
    }
}

/// Share of values that a band should hold.
const HELD: f64 = 0.9;

/// How far a prediction reaches beyond the ranks that were fitted: what was too rare there to be seen grows in proportion.
fn reach(ranks: f64, fitted: f64) -> f64 {
    (ranks / fitted).max(1.0)
}

/// A model and what it predicted of runs that it did not see.
#[derive(Clone, Debug)]
pub struct Tested {
    model: Model,
    /// The greatest number of ranks that was fitted.
    pub fitted: f64,
    /// Every quantity of every run, fitted or held out, beside the model's prediction.
    pub compared: Vec<Compared>,
    /// Widths of bands by [`Kind`]: relative, per reach.
    bands: [f64; 3],
}

impl Tested {
    /// Of the groups of one program, geometry and n on simulated ranks, of which those on more than a `share` of the most ranks are held out.
    /// `None` if too few are left, or if fewer than nine predictions can be made in retrospect.
    pub fn of(groups: &[&Group], share: f64) -> Option<Self> {
        let mut sims: Vec<&&Group> =
            groups.iter().filter(|g| g.setup.comm == Comm::Sim && g.setup.ranks > 1).collect();
        sims.sort_by_key(|group| (group.setup.ranks, group.cells()));
        let phases = &sims.last()?.typical.phases;
        let phases: Vec<String> = phases.iter().map(|phase| phase.name.clone()).collect();
        let samples: Vec<Sample> = sims.iter().map(|group| Sample::of(group)).collect();
        let most = samples.last()?.at.ranks;
        let up_to = |ranks: f64| &samples[..samples.partition_point(|s| s.at.ranks <= ranks)];
        let fitted = up_to(share * most).last()?.at.ranks;
        let model = Model::fit(up_to(fitted), &phases)?;
        let in_retrospect = |cut: f64| {
            let of = |c: Compared| (c.key.0, (c.off() - 1.0) / reach(c.at.ranks, cut));
            let model = Model::fit(up_to(cut), &phases)?;
            let later = &up_to(fitted)[up_to(cut).len()..];
            Some(later.iter().flat_map(|s| model.compare(s)).map(of).collect::<Vec<_>>())
        };
        let cuts = distinct(up_to(fitted).iter().map(|s| s.at.ranks));
        let all: Vec<(Kind, f64)> = cuts.into_iter().filter_map(in_retrospect).flatten().collect();
        let bands = [Kind::Counter, Kind::Phase, Kind::Run]
            .map(|kind| quantile(all.iter().filter(|error| error.0 == kind).map(|error| error.1)));
        let compared = samples.iter().flat_map(|s| model.compare(s)).collect();
        let is_tested = bands.iter().all(|width| width.is_finite());
        is_tested.then_some(Self { model, fitted, compared, bands })
    }

    /// The factor between a prediction and either end of its band.
    pub fn width(&self, kind: Kind, ranks: f64) -> f64 {
        1.0 + self.bands[kind as usize] * reach(ranks, self.fitted)
    }

    /// A run's time in seconds between the ends of its band, on a network.
    pub fn run_s(&self, at: &At, network: &Network) -> [f64; 3] {
        let width = self.width(Kind::Run, at.ranks);
        let [value, _] = self.model.predict(at, network)[&(Kind::Run, "run".to_owned())];
        [value / width, value, value * width]
    }

    /// What the model predicted of runs that it did not see.
    pub fn held_out(&self) -> impl Iterator<Item = &Compared> {
        self.compared.iter().filter(|c| c.at.ranks > self.fitted)
    }

    /// Of the held-out quantities of a kind: the median of their errors without sign, how many lie in their bands, and how many they are.
    pub fn summary(&self, kind: Kind) -> (f64, usize, usize) {
        let of: Vec<&Compared> = self.held_out().filter(|c| c.key.0 == kind).collect();
        let errors: Vec<f64> = of.iter().map(|c| c.error().abs()).collect();
        let held = of.iter().filter(|c| c.off() <= self.width(kind, c.at.ranks)).count();
        (median_of(&errors), held, of.len())
    }

    /// Quantities of the model with mean and imbalance as formulas: phases, the run, then counters.
    pub fn formulas(&self) -> Vec<(Key, [String; 2])> {
        let Model { counters, phases, .. } = &self.model;
        let of_phase = |(name, law): &(String, Law)| {
            let causes = causes(name, counters.keys());
            let names: Vec<&str> = causes.iter().map(|key| key.1.as_str()).chain([""]).collect();
            ((Kind::Phase, name.clone()), law.formulas(&names))
        };
        let terms = TERMS.map(|(name, _)| name);
        let of_counter = |(key, law): (&Key, &Law)| (key.clone(), law.formulas(&terms));
        let counters = counters.iter().filter(|(key, _)| **key != facets());
        let run = ["sum of the phases on their slowest ranks, and messages", ""].map(str::to_owned);
        let run = ((Kind::Run, "run".to_owned()), run);
        phases.iter().map(of_phase).chain([run]).chain(counters.map(of_counter)).collect()
    }
}

/// The least value that at least [`HELD`] of these and of one more do not exceed; infinite for fewer than nine.
fn quantile(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let rank = (HELD * (values.len() + 1) as f64).ceil() as usize;
    values.get(rank.max(1) - 1).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{Entry, Run};
    use crate::experiments::group::Groups;
    use crate::experiments::network::ASSUMED;
    use crate::testing::{line, run};

    /// Work that shrinks with the ranks and messages that grow with them: on N cells, a rank counts N/p work and 3 log2 p messages, and takes
    /// a nanosecond and a microsecond for each; the slowest rank takes p^0.1 times as long.
    fn scaled(cells: u64, ranks: usize) -> Run {
        let p = ranks as f64;
        let [work, messages] = [cells as f64 / p, 3.0 * p.log2().ceil()];
        let mean = 1e-9 * work + 1e-6 * messages;
        let slowest = (mean * p.powf(0.1)).min(mean * p);
        let rest = (mean * p - slowest) / (p - 1.0);
        let times: Vec<f64> = (0..ranks).map(|r| if r == 0 { slowest } else { rest }).collect();
        let mut run = run(Comm::Sim, cells, &[("work", &times)]);
        run.setup.spacing_min = 1.0 / cells as f64;
        run.counters.insert("work".into(), Spread::brief(&vec![work; ranks]));
        run.phases[0].messages = Spread::brief(&vec![messages; ranks]);
        run
    }

    fn groups() -> Groups {
        let ranks = [2, 4, 8, 16, 32, 64, 256, 1024];
        let runs = [1e9, 1e10].into_iter().flat_map(|n| ranks.map(|p| scaled(n as u64, p)));
        Groups::of(&runs.map(|run| line(Entry::Run(Box::new(run)))).collect::<Vec<_>>())
    }

    fn tested() -> Tested {
        Tested::of(&groups().all.iter().collect::<Vec<_>>(), 1.0 / 16.0).unwrap()
    }

    #[test]
    fn laws_and_costs_are_found_again_and_predict_what_was_held_out() {
        let tested = tested();
        assert_eq!(tested.fitted, 64.0);
        for kind in [Kind::Counter, Kind::Phase, Kind::Run] {
            // Times are stored to the microsecond, which is more than the width of such a band.
            let (error, _, count) = tested.summary(kind);
            assert!(error < 0.01 && count >= 4, "{kind:?}: {error} of {count}");
        }
        let formulas = tested.formulas();
        let of = |name: &str| &formulas.iter().find(|(key, _)| key.1 == name).unwrap().1;
        assert_eq!(of("messages of work")[0], "3.0e0 ⌈log₂p⌉");
        assert_eq!(formulas[0].1[1], "1.00 p^0.10");
    }

    #[test]
    fn a_band_widens_beyond_the_fitted_ranks() {
        let tested = tested();
        let at = |ranks: f64| At { cells: 1e10, ranks, facets: 12.0 };
        let [low, value, high] = tested.run_s(&at(1e5), &ASSUMED);
        assert!(0.0 < low && low <= value && value <= high);
        assert!(tested.width(Kind::Run, 1024.0) > tested.width(Kind::Run, 64.0));
    }

    #[test]
    fn runs_on_few_numbers_of_ranks_have_no_model() {
        let all = groups().all;
        let few: Vec<&Group> = all.iter().filter(|g| g.setup.ranks <= 8).collect();
        assert!(Tested::of(&few, 0.25).is_none());
        assert!(Tested::of(&[], 1.0).is_none());
    }

    #[test]
    fn a_time_that_is_too_short_to_be_kept_but_on_few_ranks_has_no_law() {
        let sample = |ranks: f64, mean: f64| Sample {
            at: At { cells: 1e9, ranks, facets: 12.0 },
            of: [((Kind::Phase, "a".to_owned()), [mean; 2])].into(),
            network: ASSUMED,
        };
        let fit =
            |samples: &[Sample]| Law::fit(samples, &(Kind::Phase, "a".to_owned()), |_| vec![1.0]);
        assert!(
            fit(&[sample(2.0, 1e-6), sample(2.0, 1e-6), sample(2.0, 1e-6), sample(4.0, 0.0)])
                .is_none()
        );
        assert!(fit(&[sample(2.0, 1e-6), sample(4.0, 1e-6), sample(8.0, 1e-6)]).is_some());
    }

    #[test]
    fn a_quantile_holds_its_share_of_values_to_come() {
        assert_eq!(quantile((1..=9).map(f64::from)), 9.0);
        assert_eq!(quantile((1..=99).map(f64::from)), 90.0);
        assert_eq!(quantile((1..=8).map(f64::from)), f64::INFINITY);
    }
}
