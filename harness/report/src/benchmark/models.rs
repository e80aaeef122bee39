//! Models of strong scaling on simulated ranks: their formulas, what they predicted of runs that they had not seen, and figures with bands.

use super::groups::{Subject, cells_label, range};
use super::scaling::ranks_axis;
use crate::figure::{Axis, Figure, Point, Provenance, Series};
use crate::table::Table;
use bench::experiments::entry::Comm;
use bench::experiments::group::{Group, Groups};
use bench::experiments::model::{At, Key, Kind, Tested};
use bench::order::{by_key, distinct};
use contract::number::{digits, grouped};
use std::collections::BTreeSet;

/// Points of a model's line, beside those at the ranks of runs.
const POINTS: usize = 40;
/// Runs on more than this share of the most ranks are held out: the first one that leaves enough.
const HELD_OUT: [f64; 2] = [1.0 / 16.0, 0.25];
/// Of the prediction beyond all runs.
const FAR: At = At { cells: 1e12, ranks: 1e5, facets: 0.0 };

/// A model with its subject, its runs on several simulated ranks, and those around all cases, which have the same costs and common terms.
type Modelled<'a> = (Subject<'a>, Vec<&'a Group>, Vec<&'a Group>, Tested);

/// Every model of a record.
fn models(groups: &Groups) -> Vec<Modelled<'_>> {
    let mut models = Vec::new();
    let is_sim = |g: &&Group| g.setup.comm == Comm::Sim && g.setup.ranks > 1;
    let strong = groups.all.iter().filter(|g| g.setup.experiment == "strong").filter(is_sim);
    let alike = |g: &Group| (g.setup.engine.clone(), g.setup.layer_cells_min, g.setup.division());
    for (_, all) in by_key(strong, alike) {
        for (subject, mut of) in by_key(all.iter().copied(), |group| Subject::of(&group.setup)) {
            of.sort_by_key(|group| group.setup.ranks);
            let tested = HELD_OUT.iter().find_map(|share| Tested::of(&all, subject.case, *share));
            models.extend(tested.map(|model| (subject, of, all.clone(), model)));
        }
    }
    models
}

/// Two tables of every model: its phases, and its counters.
pub fn tables(groups: &Groups) -> Vec<Table> {
    let of = |modelled @ (subject, of, _, model): &Modelled| {
        let (counters, times): (Vec<_>, Vec<_>) =
            model.formulas().into_iter().partition(|((kind, _), _)| *kind == Kind::Counter);
        let (title, notes) = (format!("model of {}", described(*subject, of)), notes(modelled));
        let times = Table { notes, ..table(format!("{title}: seconds"), &times, model) };
        [times, table(format!("{title}: counters"), &counters, model)]
    };
    models(groups).iter().flat_map(of).filter(|table| !table.rows.is_empty()).collect()
}

/// What is modelled: program, case, n and a partition that was chosen.
fn described(subject: Subject, all: &[&Group]) -> String {
    let setup = &all[0].setup;
    let division = Some(setup.division()).filter(|division| division != "default");
    let division = division.map_or(String::new(), |division| format!(", {division}"));
    format!("{subject}, n = {}{division}", setup.layer_cells_min)
}

/// The runs that were held out.
fn held_out(model: &Tested) -> Vec<At> {
    distinct(model.held_out().map(|compared| compared.at))
}

/// Formulas, and errors of what was held out, run by run.
fn table(title: String, formulas: &[(Key, [String; 2])], model: &Tested) -> Table {
    let runs = held_out(model);
    let errors = |key: &Key| {
        let error = |at: &At| {
            let of = model.held_out().find(|c| c.key == *key && c.at == *at);
            // Adding 0 removes the sign of -0.
            of.map_or("–".to_owned(), |c| format!("{:+.0}", c.errors()[1].round() + 0.0))
        };
        runs.iter().map(error).collect::<Vec<_>>().join(", ")
    };
    Table::of(
        title,
        formulas,
        &[
            ("quantity", &|(key, _)| key.1.clone()),
            ("mean of the ranks", &|(_, [mean, _])| mean.clone()),
            ("max – mean", &|(_, [_, excess])| excess.clone()),
            ("errors of\nheld-out\nmaxima / %", &|(key, _)| errors(key)),
        ],
    )
}

/// What was fitted, how well it predicted, and what it predicts beyond.
fn notes(modelled @ (_, of, _, model): &Modelled) -> Vec<String> {
    let runs = held_out(model).into_iter().map(|At { cells, ranks, .. }| {
        format!("{ranks} ranks and {} cells", grouped(cells as u64))
    });
    let mut notes = vec![format!(
        "N cells, F facets, p ranks; x is the mean of a time, and the part of a counter's mean with N or F. Fitted are runs on {} to {} simulated ranks. Errors are of these runs, which were held out: {}.",
        of.iter().map(|group| group.setup.ranks).min().unwrap_or(0),
        model.fitted,
        runs.collect::<Vec<_>>().join("; ")
    )];
    let kinds = ["counters", "times of phases", "times of runs"];
    for (what, kind) in kinds.into_iter().zip([Kind::Counter, Kind::Phase, Kind::Run]) {
        let Some(([mean, max], held, count)) = model.summary(kind) else { continue };
        notes.push(format!("Held-out {what}: means are {mean:.1} % off in the median, maxima {max:.1} %; of these, {held} of {count} are in their bands."));
    }
    notes.extend(far(modelled));
    notes
}

/// The prediction beyond all runs, by a model of all, if they are of several meshes and have smaller and larger parts.
fn far((subject, of, all, _): &Modelled) -> Option<String> {
    let is_larger = |g: &&Group| g.cells() as f64 / g.setup.ranks as f64 >= FAR.cells / FAR.ranks;
    let cells = || of.iter().map(|group| group.cells());
    let (least, most) = (cells().min()?, cells().max()?);
    if !of.iter().any(is_larger) || of.iter().all(is_larger) || most < 2 * least {
        return None;
    }
    let model = Tested::of(all, subject.case, 1.0)?;
    let (facets, network) = (of[0].typical.facets as f64, of[0].network);
    let [low, value, high] = model.run_s(&At { facets, ..FAR }, &network).map(digits);
    Some(format!(
        "A prediction, of a model of all runs on up to {} ranks: {:.0e} cells on {} ranks take {value} s ({low} to {high} s, a band for the ranks alone; parts of \
         that size were measured, of meshes with up to {} cells), with {network}.",
        model.fitted,
        FAR.cells,
        grouped(FAR.ranks as u64),
        grouped(most),
    ))
}

/// All quantities of all runs that were modelled, one per line.
pub fn csv(groups: &Groups) -> String {
    let mut out =
        "model,kind,quantity,cells,ranks,held out,predicted,low,high,measured,predicted mean,measured mean\n".to_owned();
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    for (subject, of, _, model) in models(groups) {
        let of = quoted(&described(subject, &of));
        for c in &model.compared {
            let (At { cells, ranks, .. }, kind, name) = (c.at, c.key.0, quoted(&c.key.1));
            let ([mean, predicted], [of_mean, measured]) = (c.predicted, c.measured);
            let width = model.width(c);
            let (low, high) = (predicted / width, predicted * width);
            let held_out = if ranks > model.fitted { "yes" } else { "no" };
            out += &format!(
                "{of},{kind:?},{name},{cells},{ranks},{held_out},{predicted:e},{low:e},{high:e},{measured:e},{mean:e},{of_mean:e}\n"
            );
        }
    }
    out
}

/// A figure of every model and mesh: run time over ranks.
pub fn figures(groups: &Groups) -> Vec<Figure> {
    let of_model = |(subject, of, _, model): &Modelled| {
        let mut meshes = by_key(of.iter().copied(), |group| group.cells());
        meshes.sort_by_key(|(cells, _)| *cells);
        let figure = |(cells, of): &(u64, Vec<&Group>)| figure(*subject, *cells, of, model);
        meshes.iter().map(figure).collect::<Vec<_>>()
    };
    models(groups).iter().flat_map(of_model).collect()
}

fn figure(subject: Subject, cells: u64, of: &[&Group], model: &Tested) -> Figure {
    let measured = of.iter().map(|group| group.setup.ranks);
    let ends = [of[0], of[of.len() - 1]].map(|group| (group.setup.ranks as f64).ln());
    let between = |i: usize| ends[0] + (ends[1] - ends[0]) * i as f64 / (POINTS - 1) as f64;
    // The model has steps between powers of two: at the ranks of runs the line has the values of the table.
    let ranks: BTreeSet<usize> =
        (0..POINTS).map(|i| between(i).exp().round() as usize).chain(measured).collect();
    let modelled = |ranks: &usize| {
        let ranks = *ranks as f64;
        let at = At { cells: cells as f64, ranks, facets: of[0].typical.facets as f64 };
        let [low, y, high] = model.run_s(&at, &of[0].network);
        Point { x: ranks, y, low, high }
    };
    let fitted = model.fitted;
    let (seen, later): (Vec<_>, Vec<_>) = of.iter().partition(|g| g.setup.ranks as f64 <= fitted);
    let runs = |name: &str, style: usize, of: Vec<&&Group>| {
        let points = of.iter().map(|g| Point::exact(g.setup.ranks as f64, g.time_s.value));
        let runs = Series::new(name, Provenance::Projected, style, points.collect());
        runs.drawn_as(crate::figure::Kind::Scattered)
    };
    let line = ranks.iter().map(modelled).collect();
    let line = Series::new("model and its band", Provenance::Modelled, 0, line);
    let series = vec![line, runs("fitted runs", 0, seen), runs("held-out runs", 1, later)];
    let caption = format!(
        "Run time of {}, {} cells, on {} simulated ranks, and a model that saw only the runs on up to {fitted}: laws of exact counters, and a cost of \
         each by phase. Up to {fitted} ranks the band has the width that held 90 % of such predictions in retrospect; beyond, it is widened by the distance. Projected with {}.",
        described(subject, of),
        grouped(cells),
        range(of, |g| g.setup.ranks as u64),
        Groups::networks(of.iter().copied()),
    );
    let id = format!("model-{}-{}", subject.file(), cells_label(cells));
    let title = format!("Model of the run time: {subject}, {} cells", grouped(cells));
    let (x, y) = (ranks_axis(of), Axis::log("run time / s"));
    Figure { id, title, caption, x, y, series, ..Figure::default() }
}
