//! Removes everything that a failure does not need.
//!
//! Depth is reduced first, as that makes later trials cheaper; then facets and other lists, by delta debugging: halves, quarters and so
//! on are removed as long as the rest still fails.

use super::probe::Trial;
use crate::announce;
use contract::case::Facet;
use contract::octant::LEVEL_MAX;
use run::engine::layout::Ranks;
use toml::Value;

/// Whether a trial still fails.
pub type Fails<'a> = &'a mut dyn FnMut(&Trial) -> bool;

/// Returns the smallest trial reachable by steps that all fail.
pub fn reduce(mut smallest: Trial, fails: Fails) -> Trial {
    loop {
        let before = smallest.clone();
        smallest = facets(first(coarser(&smallest), smallest, fails), fails);
        // With all leaves kept, crossing and enclosed ones too, deletion is ruled out as a cause.
        let all = Some(Value::String("all".into()));
        for (key, value) in [("keep", all), ("keep_crossing", None), ("enclosed", None)] {
            smallest = first([with(&smallest, key, value)], smallest, fails);
        }
        smallest = first(thinner(&smallest), smallest, fails);
        smallest = first(fewer_ranks(&smallest), smallest, fails);
        // Seeds that remain stay where they are: a case in which one has come to lie in a crossing leaf is refused by every program and
        // does not fail.
        for list in ["box", "seeds"] {
            smallest = entries(smallest, fails, list);
        }
        if smallest == before {
            return smallest;
        }
        announce(&format!("harness shrink: {}", size(&smallest)));
    }
}

/// Returns the size of a trial as text.
pub fn size(trial: &Trial) -> String {
    let number = |of: &str| trial.case.table.get(of).map_or("default".to_owned(), Value::to_string);
    let [facets, boxes, seeds, _] = trial.counts();
    let (spacing, n) = (number("spacing_min"), number("layer_cells_min"));
    format!(
        "{facets} facets, spacing_min {spacing}, layer_cells_min {n}, {boxes} boxes, {seeds} seeds, {}",
        trial.ranks
    )
}

/// Returns the first changed trial that still fails, or the trial itself.
fn first(changed: impl IntoIterator<Item = Trial>, trial: Trial, fails: Fails) -> Trial {
    changed.into_iter().find(|smaller| *smaller != trial && fails(smaller)).unwrap_or(trial)
}

fn with(trial: &Trial, key: &str, value: Option<Value>) -> Trial {
    let mut changed = trial.clone();
    match value {
        Some(value) => changed.case.table.insert(key.to_owned(), value),
        None => changed.case.table.remove(key),
    };
    changed
}

/// Coarsens surface and boxes, by as many levels as possible first.
fn coarser(trial: &Trial) -> Vec<Trial> {
    let factors = (1..=LEVEL_MAX).rev().map(|levels| 2f64.powi(i32::from(levels)));
    factors.filter_map(|factor| coarsened(trial, factor)).collect()
}

/// Returns the trial with surface and boxes coarsened by a factor; `None` if the surface would be coarser than twice the root.
fn coarsened(trial: &Trial, factor: f64) -> Option<Trial> {
    let mut coarser = trial.clone();
    let edge = number(trial.case.table.get("root")?.get("edge")?)?;
    let spacing = number(trial.case.table.get("spacing_min")?)?;
    if spacing * factor > 2.0 * edge {
        return None;
    }
    coarser.case.table.insert("spacing_min".into(), Value::Float(spacing * factor));
    for one in coarser.case.table.get_mut("box").and_then(Value::as_array_mut).into_iter().flatten()
    {
        let spacing = number(one.get("spacing")?)?;
        one.as_table_mut()?.insert("spacing".into(), Value::Float(spacing * factor));
    }
    Some(coarser)
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|whole| whole as f64))
}

/// Removes facets.
fn facets(trial: Trial, fails: Fails) -> Trial {
    let of = |facets: &[Facet]| {
        let mut smaller = trial.clone();
        smaller.case.facets = facets.to_vec();
        smaller
    };
    of(&minimal(trial.case.facets.clone(), |facets| fails(&of(facets))))
}

/// Removes entries of a list of the case file.
fn entries(trial: Trial, fails: Fails, key: &str) -> Trial {
    let Some(list) = trial.case.table.get(key).and_then(Value::as_array) else { return trial };
    let of = |list: &[Value]| {
        with(&trial, key, Some(list).filter(|list| !list.is_empty()).map(|l| l.to_vec().into()))
    };
    of(&minimal(list.clone(), |list| fails(&of(list))))
}

/// Delta debugging (Zeller's ddmin, complements only). At the end no single item can be removed.
fn minimal<T: Clone>(mut kept: Vec<T>, mut fails: impl FnMut(&[T]) -> bool) -> Vec<T> {
    if !kept.is_empty() && fails(&[]) {
        return Vec::new();
    }
    let mut chunk = kept.len().div_ceil(2);
    while chunk > 0 && kept.len() > 1 {
        let mut from = 0;
        while from < kept.len() {
            let until = (from + chunk).min(kept.len());
            let rest = [&kept[..from], &kept[until..]].concat();
            match !rest.is_empty() && fails(&rest) {
                true => kept = rest,
                false => from = until,
            }
        }
        chunk = if chunk == 1 { 0 } else { chunk.div_ceil(2) };
    }
    kept
}

/// Reduces the layer to the smallest n.
fn thinner(trial: &Trial) -> Vec<Trial> {
    let now = trial.case.table.get("layer_cells_min").and_then(Value::as_integer).unwrap_or(4);
    (1..now).map(|n| with(trial, "layer_cells_min", Some(Value::Integer(n)))).collect()
}

/// Reduces the number of ranks.
fn fewer_ranks(trial: &Trial) -> Vec<Trial> {
    let fewer = |ranks| match trial.ranks {
        Ranks::Serial => Ranks::Serial,
        Ranks::Mpi(_) => Ranks::Mpi(ranks),
        Ranks::Simulated { seed, .. } => Ranks::Simulated { ranks, seed },
    };
    (2..trial.ranks.count()).map(|ranks| Trial { ranks: fewer(ranks), ..trial.clone() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::plain::PlainCase;

    fn facet(x: f32) -> Facet {
        [[x; 3], [x, 0.0, 0.0], [0.0, x, 0.0]]
    }

    fn given() -> Trial {
        let text = "spacing_min = 0.01\nlayer_cells_min = 5\nkeep = 'inside'\nkeep_crossing = false\n\
                    enclosed = 'keep'\nseeds = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]\n\
                    [root]\norigin = [0.0, 0.0, 0.0]\nedge = 8.0\n\
                    [[box]]\nmin = [1.0]\nspacing = 1.0\n[[box]]\nmin = [2.0]\nspacing = 1\n";
        let facets = (0..100).map(|x| facet(x as f32)).collect();
        let case = PlainCase { table: text.parse().unwrap(), facets };
        Trial { case, ranks: Ranks::Simulated { ranks: 16, seed: 7 } }
    }

    fn has(trial: &Trial, x: f32) -> bool {
        trial.case.facets.contains(&facet(x))
    }

    fn count(trial: &Trial, key: &str) -> i64 {
        trial.case.table[key].as_integer().unwrap()
    }

    #[test]
    fn only_the_necessary_parts_of_a_failing_case_remain() {
        let mut trials = 0;
        let mut fails = |trial: &Trial| {
            trials += 1;
            let ranks = matches!(trial.ranks, Ranks::Simulated { ranks, seed: 7 } if ranks >= 3);
            let deep = number(&trial.case.table["spacing_min"]).unwrap() < 0.5;
            let boxed = trial
                .case
                .table
                .get("box")
                .and_then(Value::as_array)
                .is_some_and(|boxes| boxes.iter().any(|b| b["min"][0].as_float() == Some(2.0)));
            let seeds = trial.case.table.get("seeds").and_then(Value::as_array);
            let seeded =
                seeds.is_some_and(|seeds| seeds.iter().any(|seed| seed[0].as_float() == Some(2.0)));
            has(trial, 17.0)
                && has(trial, 80.0)
                && seeded
                && ranks
                && deep
                && boxed
                && count(trial, "layer_cells_min") >= 2
        };
        let smallest = reduce(given(), &mut fails);
        assert_eq!(smallest.case.facets, [facet(17.0), facet(80.0)]);
        assert_eq!(smallest.ranks, Ranks::Simulated { ranks: 3, seed: 7 });
        let table = &smallest.case.table;
        assert_eq!(number(&table["spacing_min"]), Some(0.32));
        assert_eq!(
            (count(&smallest, "layer_cells_min"), table["box"].as_array().unwrap().len()),
            (2, 1)
        );
        assert_eq!((table["keep"].as_str(), table.get("keep_crossing")), (Some("all"), None));
        assert_eq!(
            (table["seeds"].to_string(), table.get("enclosed")),
            ("[[2.0, 0.0, 0.0]]".into(), None)
        );
        assert!(trials < 200, "{trials}");
    }

    #[test]
    fn a_failure_independent_of_the_case_leaves_an_empty_one() {
        let smallest = reduce(given(), &mut |_| true);
        assert!(smallest.case.facets.is_empty() && smallest.case.table.get("box").is_none());
        assert_eq!(smallest.ranks, Ranks::Simulated { ranks: 2, seed: 7 });
    }
}
