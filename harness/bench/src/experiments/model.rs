//! Models of a program's phases on simulated ranks, to predict what was not measured.
//!
//! A counter is exact, so it comes first: its mean over the ranks is a [`Sum`] of `TERMS`, functions of cells N, ranks p and facets F. What
//! depends on the geometry has coefficients of that geometry, and what collective operations send has those of the program, as it is the same
//! around all geometries: so counters around all of them are fitted together. The mean time of a phase is then a sum of costs times means of
//! counters. These costs are of the program and the machine, and fitted together as well: facets, cells and ranks vary independently of each
//! other only there. The excess of a maximum over its mean is (a x + b √x + c) ln p, where x is the mean of a time, or the part of a counter's
//! mean that depends on the geometry: ranks differ in proportion to their work, by chance, and by what hits one of them, and the greatest of p
//! values with an exponential tail lies ln p above. For a counter d x√p may be added: more ranks may divide a place less than in proportion. A
//! phase takes as long as on its slowest rank, plus its messages in the latency-bandwidth model of [`pop`](super::pop), and a run as long as all
//! phases.
//!
//! [`Tested`] fits runs on few ranks and holds out those on many. The band of a prediction follows from predictions of the same quantity in
//! retrospect: of the runs that were fitted, from those on fewer ranks. Its relative width is the 90 % quantile of their errors, each divided by
//! its reach, times the prediction's reach. A cost that no fitted run shows is at most as great as the error there, and may grow in proportion
//! to the ranks, while the quantity shrinks: so the reach is the ratio of the ranks to the most that were fitted, times that of the quantity on
//! as many to the quantity itself, if this is more than 1. The quantile is that of split conformal prediction, without its guarantee, as later
//! runs are not exchangeable with earlier ones: so the share of held-out values within bands is reported beside them.
//!
//! Only positive values are compared, and a counter that is below one per rank in some fitted run around the geometry explains no time and has
//! no law; such runs around others are left out.
//!
//! Square errors have the weight of the ranks, because runs on more ranks are nearer to what is predicted. Runs on one rank are left out: they
//! have no messages, no halos and other phases.

use super::entry::{Network, Phase, Spread};
use super::group::Group;
use crate::order::distinct;
use statistics::median_of;
use statistics::sums::{Row, Sum};
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

/// The terms of the excess of a maximum over a mean, for x as above.
fn excesses(x: f64, ranks: f64) -> [f64; 4] {
    [x * ranks.ln(), x.sqrt() * ranks.ln(), ranks.ln(), x * ranks.sqrt()]
}

/// Their names.
const EXCESSES: [&str; 4] = ["x ln p", "√x ln p", "ln p", "x√p"];

/// A function of a run, with its name.
type Function = (&'static str, fn(&At) -> f64);

/// The terms of a mean over the ranks: parts of cells and of facets, the cells along the facets of a part, the boundary of a
/// part of a surface, a constant, reduction by a tree and by groups, and what an allgather sends of a fixed size per rank and of one in total.
const TERMS: [Function; 9] = [
    ("N/p", |at| at.cells / at.ranks),
    ("F/p", |at| at.facets / at.ranks),
    ("√(NF)/p", |at| (at.cells * at.facets).sqrt() / at.ranks),
    ("√(N/p)", |at| (at.cells / at.ranks).sqrt()),
    ("", |_| 1.0),
    ("⌈log₂p⌉", |at| at.ranks.log2().ceil()),
    ("⌊√p⌋", |at| at.ranks.sqrt().floor()),
    ("(p – 1)", |at| at.ranks - 1.0),
    ("(1 – 1/p)", |at| 1.0 - 1.0 / at.ranks),
];

/// So many of them, the first ones, depend on the geometry and differ from rank to rank: each geometry has coefficients of its own. What the
/// others count is taken to be the same on all ranks, and around all geometries.
const GEOMETRIC: usize = 4;

/// Terms of times beside counters.
const OTHER_CAUSES: [Function; 3] = [TERMS[1], TERMS[4], TERMS[6]];

/// The most kinds of terms of a counter, which is exact, and of a time, which is not: predictions among its runs cannot distinguish terms.
const KINDS_MAX: [usize; 2] = [3, usize::MAX];
/// How many of the first [`EXCESSES`] a counter and a time may have: the last one is not distinguished from noise.
const EXCESS_KINDS: [usize; 2] = [4, 3];
/// Counters are of runs on more ranks than these, or than the most ranks over them: few ranks communicate in other ways, such as without groups.
const FEW: f64 = 8.0;

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
pub type Ends = [f64; 2];

type Quantities = BTreeMap<Key, Ends>;

/// A term of a mean, for a run.
struct Term<'a> {
    name: &'a str,
    value: f64,
    /// Terms of one kind are chosen together.
    kind: usize,
    /// Whether it is a term of the run's geometry.
    is_own: bool,
    /// Whether it is taken to be the same on all ranks.
    is_even: bool,
}

type Terms<'a> = Vec<Term<'a>>;

fn values(terms: &Terms) -> Vec<f64> {
    terms.iter().map(|term| term.value).collect()
}

/// What is known of a run.
struct Sample {
    /// Number of its geometry, 0 for that of the model.
    geometry: usize,
    at: At,
    of: Quantities,
    network: Network,
}

/// The keys of a phase's messages and bytes begin with these words.
const TRAFFIC: [&str; 2] = ["messages of ", "bytes of "];

fn traffic(phase: &str) -> [Key; 2] {
    TRAFFIC.map(|what| (Kind::Counter, what.to_owned() + phase))
}

/// The key of a run's time.
fn run_time() -> Key {
    (Kind::Run, "run".to_owned())
}

impl Sample {
    fn of(group: &Group, geometries: &[&str]) -> Self {
        let (run, ranks) = (&group.typical, group.setup.ranks as f64);
        let at = At { cells: run.cells as f64, ranks, facets: run.facets as f64 };
        let ends = |of: &Spread| [of.sum / ranks, of.max];
        // The phases' messages are counted apart, and a greatest value counts nothing.
        let is_count = |(name, _): &(&String, &Spread)| {
            !["messages", "message_bytes"].contains(&name.as_str()) && !name.ends_with("_max")
        };
        let counters = run.counters.iter().filter(is_count);
        let counters = counters.map(|(name, of)| ((Kind::Counter, name.clone()), ends(of)));
        let mut of: Quantities = counters.collect();
        for phase in &run.phases {
            let messages = [&phase.messages, &phase.message_bytes].map(ends);
            of.extend(traffic(&phase.name).into_iter().zip(messages));
            of.insert((Kind::Phase, phase.name.clone()), ends(&phase.useful_s));
        }
        // What happens less than once on a rank explains no time.
        of.retain(|(kind, _), [mean, _]| *kind == Kind::Phase || *mean >= 1.0);
        of.insert(run_time(), [group.time_s.value; 2]);
        let geometry = geometries.iter().position(|case| *case == group.setup.case);
        Self { geometry: geometry.expect("a known one"), at, of, network: group.network }
    }
}

/// A mean over the ranks, and the excess of the maximum.
struct Law {
    /// Of the [`terms`] around one geometry.
    mean: Sum,
    /// Of [`excesses`].
    excess: Sum,
    /// Both.
    formulas: [String; 2],
}

impl Law {
    /// Of the runs that have this quantity, with all terms of each; `None` if they are too few. A counter's excess is that around its geometry.
    fn fit<'a>(samples: &[&Sample], key: &Key, of: impl Fn(&Sample) -> Terms<'a>) -> Option<Self> {
        let known = samples.iter().filter_map(|s| Some((*s, *s.of.get(key)?, of(s))));
        let known: Vec<_> = known.filter(|(_, [mean, _], _)| *mean > 0.0).collect();
        let own = &known.iter().find(|known| known.0.geometry == 0)?.2;
        let kinds: Vec<usize> = own.iter().map(|term| term.kind).collect();
        let [most, excess_kinds] = [KINDS_MAX, EXCESS_KINDS].map(|of| of[key.0 as usize]);
        let row = |(s, [mean, _], terms): &(&Sample, Ends, Terms)| -> Row {
            (s.at.ranks, 1.0, terms.iter().map(|term| term.value / mean).collect())
        };
        let mean = Sum::fit(&known.iter().map(row).collect::<Vec<Row>>(), &kinds, most)?;
        let row = |(s, [measured, max], terms): &(&Sample, Ends, Terms)| -> Row {
            let fitted = mean.at(&values(terms)).max(f64::MIN_POSITIVE);
            let all = excesses(measured * uneven(&mean, terms) / fitted, s.at.ranks);
            (s.at.ranks, 1.0 - measured / max, all.map(|term| term / max)[..excess_kinds].to_vec())
        };
        let is_fitted = |s: &Sample| key.0 == Kind::Phase || s.geometry == 0;
        let rows: Vec<Row> = known.iter().filter(|known| is_fitted(known.0)).map(row).collect();
        let excess = Sum::fit(&rows, &[0, 1, 2, 3][..excess_kinds], most)?;
        let of_own: Vec<_> = mean.terms.iter().filter(|(term, _)| own[*term].is_own).collect();
        let terms: Vec<_> = of_own.iter().map(|(term, of)| (own[*term].kind, *of)).collect();
        let names = of_own.iter().map(|(term, of)| (own[*term].name, *of));
        let of_excess = excess.terms.iter().map(|(term, of)| (EXCESSES[*term], *of));
        let formulas = [formula(names), formula(of_excess)];
        (!terms.is_empty()).then_some(Self { mean: Sum { terms }, excess, formulas })
    }

    /// Mean and maximum for the values of all terms.
    fn at(&self, terms: &Terms, at: &At) -> Ends {
        let mean = self.mean.at(&values(terms));
        let excess = self.excess.at(&excesses(uneven(&self.mean, terms), at.ranks));
        [mean, (mean + excess).min(mean * at.ranks)]
    }
}

/// A sum of terms with their names.
fn formula<'a>(terms: impl Iterator<Item = (&'a str, f64)>) -> String {
    let term = |(name, of)| format!("{of:.1e} {name}").trim().to_owned();
    terms.map(term).collect::<Vec<_>>().join(" + ")
}

/// The part of a mean that is not taken to be the same on all ranks.
fn uneven(mean: &Sum, terms: &Terms) -> f64 {
    let value = |term: &Term| if term.is_even { 0.0 } else { term.value };
    mean.at(&terms.iter().map(value).collect::<Vec<f64>>())
}

/// A model of the runs of one program around one geometry with one n, fitted with those around others.
struct Model {
    /// The most cells and ranks that were fitted.
    most: At,
    /// Of counters, then of phases in the program's order.
    laws: Vec<(Key, Law)>,
}

/// The terms of a law around one of several geometries: of a counter [`TERMS`], the geometric ones once for each; of the time of a phase the means of
/// the program's counters and of its own messages, facets per rank, a constant, and work for each group of ranks.
fn terms<'a>(
    laws: &'a [(Key, Law)],
    (kind, name): &Key,
    (geometry, geometries): (usize, usize),
    at: &At,
    of: &Quantities,
) -> Terms<'a> {
    if *kind == Kind::Counter {
        let local = (0..geometries).flat_map(|of| (0..GEOMETRIC).map(move |i| (i, of == geometry)));
        let common = (GEOMETRIC..TERMS.len()).map(|i| (i, true));
        let term = |(kind, is_own): (usize, bool)| {
            let (name, of) = TERMS[kind];
            let value = if is_own { of(at) } else { 0.0 };
            Term { name, value, kind, is_own, is_even: kind >= GEOMETRIC }
        };
        return local.chain(common).map(term).collect();
    }
    let [own, _] = traffic(name);
    let is_traffic = |key: &Key| TRAFFIC.iter().any(|what| key.1.starts_with(what));
    let is_cause = |key: &&Key| key.0 == Kind::Counter && (!is_traffic(key) || **key == own);
    let causes = laws.iter().map(|law| &law.0).filter(is_cause);
    let means = causes.map(|key| (key.1.as_str(), of.get(key).map_or(0.0, |ends| ends[0])));
    let all = means.chain(OTHER_CAUSES.map(|(name, term)| (name, term(at))));
    let term = |(kind, (name, value))| Term { name, value, kind, is_own: true, is_even: false };
    all.enumerate().map(term).collect()
}

impl Model {
    /// Fits runs, the last own one of which is on the most ranks; without those on three numbers of ranks, nothing has a law.
    fn fit(samples: &[Sample], phases: &[Phase]) -> Option<Self> {
        let own = || samples.iter().filter(|sample| sample.geometry == 0);
        let cells = own().map(|sample| sample.at.cells).fold(0.0, f64::max);
        let most = At { cells, ..own().next_back()?.at };
        let is_counter = |of: &&Key| of.0 == Kind::Counter && own().all(|s| s.of.contains_key(of));
        let counters = own().next()?.of.keys().filter(is_counter).cloned();
        let phases = phases.iter().map(|phase| (Kind::Phase, phase.name.clone()));
        let geometries = samples.iter().map(|s| s.geometry + 1).max()?;
        let mut laws = Vec::new();
        for key in counters.chain(phases) {
            let is_many = |s: &&Sample| s.at.ranks > FEW.min(most.ranks / FEW);
            let fitted = samples.iter().filter(|s| key.0 == Kind::Phase || is_many(s));
            let of = |s: &Sample| terms(&laws, &key, (s.geometry, geometries), &s.at, &s.of);
            let law = Law::fit(&fitted.collect::<Vec<_>>(), &key, of);
            laws.extend(law.map(|law| (key, law)));
        }
        Some(Self { most, laws })
    }

    /// All quantities, and the time of a run.
    fn predict(&self, at: &At, network: &Network) -> Quantities {
        let (mut all, mut run_s) = (BTreeMap::new(), 0.0);
        for (key, law) in &self.laws {
            let ends = law.at(&terms(&self.laws, key, (0, 1), at, &all), at);
            if key.0 == Kind::Phase {
                let most = |key: Key| all.get(&key).map_or(0.0, |of: &Ends| of[1]);
                let [messages, bytes] = traffic(&key.1).map(most);
                run_s += ends[1] + network.time_s(messages, bytes);
            }
            all.insert(key.clone(), ends);
        }
        all.insert(run_time(), [run_s; 2]);
        all
    }

    /// All quantities with their reach.
    fn reaching(&self, at: &At, network: &Network) -> BTreeMap<Key, (Ends, f64)> {
        let At { cells, ranks, .. } = self.most;
        let fitted = At { cells: at.cells.min(cells), ranks: at.ranks.min(ranks), ..*at };
        let (fitted, ratio) = (self.predict(&fitted, network), (at.ranks / ranks).max(1.0));
        let reach = |key: &Key, ends: Ends| ratio * (fitted[key][1] / ends[1]).max(1.0);
        let all = self.predict(at, network).into_iter();
        all.map(|(key, ends)| (key.clone(), (ends, reach(&key, ends)))).collect()
    }

    /// Every quantity of an own run with its predicted and its measured value, if both are positive.
    fn compare(&self, sample: &Sample) -> Vec<Compared> {
        let compared = |(key, (predicted, reach)): (Key, (Ends, f64))| {
            let (at, measured) = (sample.at, *sample.of.get(&key)?);
            let ratio = predicted[1] / measured[1];
            let error = (ratio.max(1.0 / ratio) - 1.0) / reach;
            let is_compared = sample.geometry == 0 && predicted[1].min(measured[1]) > 0.0;
            is_compared.then_some(Compared { key, at, predicted, measured, reach, error })
        };
        self.reaching(&sample.at, &sample.network).into_iter().filter_map(compared).collect()
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
    pub predicted: Ends,
    /// In the run.
    pub measured: Ends,
    /// How far the prediction reaches beyond the fitted runs; 1 within them.
    reach: f64,
    /// By how much the ratio of both maxima exceeds 1, relative to the reach.
    error: f64,
}

impl Compared {
    /// Errors of the mean and of the maximum, in percents.
    pub fn errors(&self) -> Ends {
        [0, 1].map(|end| 100.0 * (self.predicted[end] / self.measured[end] - 1.0))
    }
}

/// Share of values that a band should hold.
const HELD: f64 = 0.9;

/// A model and what it predicted of runs that it did not see.
pub struct Tested {
    model: Model,
    /// The greatest number of ranks that was fitted.
    pub fitted: f64,
    /// Every quantity of every run, fitted or held out, beside the model's prediction.
    pub compared: Vec<Compared>,
    /// Widths of bands: relative, per reach.
    bands: BTreeMap<Key, f64>,
}

impl Tested {
    /// Of the groups of one program and n on two and more simulated ranks, around a case; costs, and what all geometries have in common, are also of those around other cases. Held out
    /// are those on more than a `share` of the most ranks. `None` if too few are left, or if fewer than nine predictions can be made in retrospect.
    pub fn of(groups: &[&Group], case: &str, share: f64) -> Option<Self> {
        let mut groups = groups.to_vec();
        groups.sort_by_key(|group| (group.setup.ranks, group.cells()));
        let phases = &groups.iter().rfind(|group| group.setup.case == case)?.typical.phases;
        let others = groups.iter().map(|group| &*group.setup.case).filter(|other| *other != case);
        let geometries = distinct([case].into_iter().chain(others));
        let samples: Vec<Sample> = groups.iter().map(|g| Sample::of(g, &geometries)).collect();
        let own = distinct(samples.iter().filter(|s| s.geometry == 0).map(|s| s.at.ranks));
        let most = share * own.last()?;
        let up_to = |ranks: f64| &samples[..samples.partition_point(|s| s.at.ranks <= ranks)];
        let fitted = *own.iter().rfind(|ranks| **ranks <= most)?;
        let model = Model::fit(up_to(fitted), phases)?;
        let mut errors = BTreeMap::<Key, Vec<f64>>::new();
        for cut in own.into_iter().filter(|ranks| *ranks <= fitted) {
            let earlier = Model::fit(up_to(cut), phases)?;
            let later = &up_to(fitted)[up_to(cut).len()..];
            for compared in later.iter().flat_map(|sample| earlier.compare(sample)) {
                errors.entry(compared.key).or_default().push(compared.error);
            }
        }
        // No value is stored more precisely.
        let bands = errors.into_iter().map(|(key, of)| (key, quantile(of).max(1e-9)));
        let bands: BTreeMap<Key, f64> = bands.filter(|(_, width)| width.is_finite()).collect();
        let compared = samples.iter().flat_map(|s| model.compare(s));
        let compared = compared.filter(|of| bands.contains_key(&of.key)).collect();
        bands.contains_key(&run_time()).then_some(Self { model, fitted, compared, bands })
    }

    /// The factor between a prediction and either end of its band.
    pub fn width(&self, of: &Compared) -> f64 {
        1.0 + self.bands[&of.key] * of.reach
    }

    /// A run's time in seconds between the ends of its band, on a network.
    pub fn run_s(&self, at: &At, network: &Network) -> [f64; 3] {
        let ([value, _], reach) = self.model.reaching(at, network)[&run_time()];
        let width = 1.0 + self.bands[&run_time()] * reach;
        [value / width, value, value * width]
    }

    /// What the model predicted of runs that it did not see.
    pub fn held_out(&self) -> impl Iterator<Item = &Compared> {
        self.compared.iter().filter(|c| c.at.ranks > self.fitted)
    }

    /// Of the held-out quantities of a kind, if there are any: the medians of their errors without sign in percents, how many lie in their bands, and how
    /// many they are.
    pub fn summary(&self, kind: Kind) -> Option<(Ends, usize, usize)> {
        let of: Vec<&Compared> = self.held_out().filter(|c| c.key.0 == kind).collect();
        let errors = |end: usize| of.iter().map(|c| c.errors()[end].abs()).collect::<Vec<f64>>();
        let held = of.iter().filter(|c| c.error <= self.bands[&c.key]).count();
        (!of.is_empty()).then(|| ([0, 1].map(|end| median_of(&errors(end))), held, of.len()))
    }

    /// Quantities of the model with mean and excess as formulas.
    pub fn formulas(&self) -> Vec<(Key, [String; 2])> {
        let time = "sum of the phases on their slowest ranks, and messages";
        let time = (run_time(), [time, ""].map(str::to_owned));
        let laws = self.model.laws.iter().map(|(key, law)| (key.clone(), law.formulas.clone()));
        laws.chain([time]).collect()
    }
}

/// The least value that at least [`HELD`] of these and of one more do not exceed; infinite for fewer than nine.
fn quantile(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = (HELD * (values.len() + 1) as f64).ceil() as usize;
    values.get(rank.max(1) - 1).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{ASSUMED, Comm, Entry, Run};
    use crate::experiments::group::Groups;
    use crate::testing::{line, run};

    /// Work that shrinks with the ranks and messages that grow with them: on N cells, a rank counts N/p work and 3 log2 p messages, and takes
    /// a nanosecond and a microsecond for each; the slowest rank takes a tenth more for each factor e of p. Around another case, twice the work.
    fn scaled(case: &str, cells: u64, ranks: usize) -> Run {
        let p = ranks as f64;
        let factor = if case == CASE { 1.0 } else { 2.0 };
        let [work, messages] = [factor * cells as f64 / p, 3.0 * p.log2().ceil()];
        let mean = 1e-9 * work + 1e-6 * messages;
        let slowest = mean * (1.0 + 0.1 * p.ln());
        let rest = (mean * p - slowest) / (p - 1.0);
        let times: Vec<f64> = (0..ranks).map(|r| if r == 0 { slowest } else { rest }).collect();
        let mut run = run(Comm::Sim, cells, &[("work", &times)]);
        run.setup.case = case.to_owned();
        run.setup.spacing_min = 1.0 / cells as f64;
        for name in ["work", "leaf_max"] {
            run.counters.insert(name.into(), Spread::brief(&vec![work; ranks]));
        }
        run.phases[0].messages = Spread::brief(&vec![messages; ranks]);
        run
    }

    const CASE: &str = "cube";

    fn groups(cases: &[&str]) -> Groups {
        let ranks = [2, 4, 8, 16, 32, 64, 256, 1024];
        let of = |case| move |n| ranks.map(|p| scaled(case, n as u64, p));
        let runs = cases.iter().flat_map(|case| [1e9, 1e10].into_iter().flat_map(of(case)));
        Groups::of(&runs.map(|run| line(Entry::Run(Box::new(run)))).collect::<Vec<_>>())
    }

    fn tested(cases: &[&str]) -> Tested {
        Tested::of(&groups(cases).all.iter().collect::<Vec<_>>(), CASE, 1.0 / 16.0).unwrap()
    }

    #[test]
    fn laws_and_costs_are_found_again_and_predict_what_was_held_out() {
        // The costs are those around the other case, and the terms of what its ranks send.
        for cases in [&[CASE][..], &[CASE, "other"]] {
            let tested = tested(cases);
            assert_eq!(tested.fitted, 64.0);
            for (kind, held_out) in [(Kind::Counter, 8), (Kind::Phase, 4), (Kind::Run, 4)] {
                // Times are stored to the microsecond, which is more than the width of such a band.
                let (errors, _, count) = tested.summary(kind).unwrap();
                assert!(errors[0].max(errors[1]) < 1.0, "{kind:?}: {errors:?}");
                assert_eq!(count, held_out);
            }
            let formulas = tested.formulas();
            let of = |kind: Kind, name: &str| {
                &formulas.iter().find(|(key, _)| *key == (kind, name.to_owned())).unwrap().1
            };
            assert_eq!(of(Kind::Counter, "messages of work")[0], "3.0e0 ⌈log₂p⌉");
            assert!(of(Kind::Phase, "work")[1].starts_with("1.0e-1 x ln p"), "{formulas:?}");
        }
    }

    #[test]
    fn what_all_ranks_send_around_all_geometries_is_found_apart_and_has_no_excess() {
        let key: Key = (Kind::Counter, "bytes".to_owned());
        let sample = |geometry: usize, cells: f64, ranks: f64| {
            let part = [0.3, 0.1][geometry] * cells / ranks;
            let mean = part + 80.0 * (ranks - 1.0);
            let at = At { cells, ranks, facets: 12.0 };
            let of = [(key.clone(), [mean, mean + 0.1 * part * ranks.ln()])].into();
            Sample { geometry, at, of, network: ASSUMED }
        };
        // Around the first geometry alone what is sent is less than a hundredth.
        let runs = [16.0, 24.0, 32.0, 48.0, 64.0];
        let first = runs.map(|ranks| sample(0, 1e8, ranks));
        let second = runs.map(|ranks| sample(1, 1e6, ranks));
        let samples: Vec<&Sample> = first.iter().chain(&second).collect();
        let of = |s: &Sample| terms(&[], &key, (s.geometry, 2), &s.at, &s.of);
        let law = Law::fit(&samples, &key, of).unwrap();
        let of = |s: &Sample| terms(&[], &key, (0, 1), &s.at, &s.of);
        assert_eq!(law.formulas, ["3.0e-1 N/p + 8.0e1 (p – 1)", "1.0e-1 x ln p"]);
        let far = sample(0, 1e8, 1024.0);
        let [mean, max] = law.at(&of(&far), &far.at);
        let off = [mean / far.of[&key][0], max / far.of[&key][1]].map(|ratio| (ratio - 1.0).abs());
        assert!(off[0].max(off[1]) < 1e-6, "{off:?}");
    }

    #[test]
    fn a_band_widens_beyond_the_fitted_ranks() {
        let tested = tested(&[CASE]);
        let width = |at: At| {
            let [low, value, high] = tested.run_s(&at, &ASSUMED);
            assert!(0.0 < low && low <= value && value <= high);
            high / value - 1.0
        };
        let at = |cells: f64, ranks: f64| At { cells, ranks, facets: 12.0 };
        let [within, at_most] = [2.0, 64.0].map(|ranks| width(at(1e10, ranks)));
        assert!((at_most / within - 1.0).abs() < 1e-9);
        // Eight times the ranks, on which this mesh takes nearly an eighth of the time; and with a mesh that grows with them.
        assert!(width(at(1e10, 512.0)) > 50.0 * at_most);
        let weak = width(at(8e10, 512.0));
        assert!(7.0 * at_most < weak && weak < 9.0 * at_most);
    }

    #[test]
    fn runs_on_few_numbers_of_ranks_have_no_model() {
        let all = groups(&[CASE]).all;
        let few: Vec<&Group> = all.iter().filter(|g| g.setup.ranks <= 8).collect();
        assert!(Tested::of(&few, CASE, 0.25).is_none());
        assert!(Tested::of(&[], CASE, 1.0).is_none());
    }

    #[test]
    fn a_model_without_laws_of_counters_has_no_errors_of_them() {
        // Counters need three numbers of ranks above 8.
        let of = |n: f64| [2, 4, 8, 16, 64, 256].map(|p| scaled(CASE, n as u64, p));
        let runs = [1e8, 1e9, 1e10].into_iter().flat_map(of);
        let groups =
            Groups::of(&runs.map(|run| line(Entry::Run(Box::new(run)))).collect::<Vec<_>>());
        let tested = Tested::of(&groups.all.iter().collect::<Vec<_>>(), CASE, 0.25).unwrap();
        assert_eq!(tested.summary(Kind::Counter), None);
        assert!(tested.summary(Kind::Run).is_some());
    }

    #[test]
    fn a_time_that_is_too_short_to_be_kept_but_on_few_ranks_has_no_law() {
        let sample = |ranks: f64, mean: f64| Sample {
            geometry: 0,
            at: At { cells: 1e9, ranks, facets: 12.0 },
            of: [((Kind::Phase, "a".to_owned()), [mean; 2])].into(),
            network: ASSUMED,
        };
        let fit = |samples: &[Sample]| {
            Law::fit(&samples.iter().collect::<Vec<_>>(), &(Kind::Phase, "a".to_owned()), |_| {
                vec![Term { name: "", value: 1.0, kind: 0, is_own: true, is_even: false }]
            })
        };
        assert!(
            fit(&[sample(2.0, 1e-6), sample(2.0, 1e-6), sample(2.0, 1e-6), sample(4.0, 0.0)])
                .is_none()
        );
        assert!(fit(&[sample(2.0, 1e-6), sample(4.0, 1e-6), sample(8.0, 1e-6)]).is_some());
    }

    #[test]
    fn a_quantile_holds_its_share_of_values_to_come() {
        assert_eq!(quantile((1..=9).map(f64::from).collect()), 9.0);
        assert_eq!(quantile((1..=99).map(f64::from).collect()), 90.0);
        assert_eq!(quantile((1..=8).map(f64::from).collect()), f64::INFINITY);
    }
}
