//! Leaks: does a path of free leaves of the base tree join two places, how wide is it, and at which spacing does it
//! close or open?
//!
//! - [`leaves`]: a base tree with neighbours; [`ends`]: the ends of the path; [`search`]: the path through the leaves;
//! - [`clearance`]: distances to facets; [`path`]: free widths along the path and the narrowest place;
//! - [`report`]: the answer as data; [`text`]: the answer for a terminal.
//!
//! A leaf is free if no facet touches it; two free leaves are joined if they share part of a face. A ball as wide as the
//! narrower of the two passes from one to the other, so an opening that joins leaves of edge e is at least e wide. An
//! opening wider than 2 sqrt(3) e always joins leaves of edge e: the leaf that contains the centre of the ball is free.

pub mod clearance;
pub mod ends;
pub mod leaves;
pub mod path;
pub mod report;
pub mod search;
pub mod text;

use std::fmt::Display;

use crate::geometry::distance::{dot, sub};
use clearance::Clearance;
use contract::case::Case;
use contract::lattice::UNITS_PER_EDGE;
use contract::octant::LEVEL_MAX;
use ends::Target;
use leaves::Leaves;
use path::Path;
use report::{Destination, Meshed, Narrowest, Passage, Point, Report, SCHEMA, Spacing};
use search::{Goal, Interrupted};

/// A question.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The case.
    pub case: &'a Case,
    /// The start, in the user's units.
    pub from: [f64; 3],
    /// The end.
    pub to: Target,
    /// Refinement ends before a base tree that would have more leaves than this.
    pub leaves_max: u64,
}

/// The answer, and the base tree that its path leads through.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The answer.
    pub report: Report,
    /// The leaves of the base tree of [`Passage::spacing`], or of the case if there is no path.
    pub words: Vec<u64>,
}

/// Why a question has no answer.
#[derive(Debug)]
pub enum LeakError<E> {
    /// The user's input, in one sentence.
    Input(String),
    /// A base tree could not be made.
    Source(E),
    /// The search was interrupted.
    Interrupted,
}

impl<E> From<Interrupted> for LeakError<E> {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

/// Events during the search.
pub trait Watch {
    /// A step begins.
    fn step(&self, what: &str);
    /// Whether the user has interrupted the search.
    fn is_interrupted(&self) -> bool;
}

/// A base tree and its level.
struct Tree {
    level: u8,
    words: Vec<u64>,
}

/// A question being answered.
struct Investigation<'a, F> {
    question: &'a Question<'a>,
    from: [i64; 3],
    /// `None` for the far field.
    to: Option<[i64; 3]>,
    base_tree: F,
    watch: &'a dyn Watch,
    levels: Vec<Meshed>,
}

/// Answers a question. `base_tree` returns the sorted leaf words of the case's base tree at another surface level.
///
/// # Errors
/// If an end is outside the root or in a crossing leaf, if a base tree cannot be made, or if `watch` is interrupted.
pub fn answer<E: Display>(
    question: &Question,
    base_tree: impl FnMut(u8) -> Result<Vec<u64>, E>,
    watch: &dyn Watch,
) -> Result<Answer, LeakError<E>> {
    let root = &question.case.root;
    if question.case.facets.is_empty() {
        return Err(LeakError::Input("the case has no facets, so nothing separates places".into()));
    }
    let from = ends::on_lattice("--from", question.from, root).map_err(LeakError::Input)?;
    let to = match question.to {
        Target::Far => None,
        Target::Point(at) => Some(ends::on_lattice("--to", at, root).map_err(LeakError::Input)?),
    };
    let levels = Vec::new();
    Investigation { question, from, to, base_tree, watch, levels }.answer()
}

impl<E: Display, F: FnMut(u8) -> Result<Vec<u64>, E>> Investigation<'_, F> {
    fn answer(mut self) -> Result<Answer, LeakError<E>> {
        let (case, level) = (self.question.case, self.question.case.level_surface);
        let tree = self.tree(level)?;
        let is_leak = self.is_joined(&tree)?;
        if self.levels[0].why.is_some() {
            return Err(LeakError::Input(self.why_not(&tree.words)));
        }
        let spacing = |level| Spacing::of(level, &case.root);
        let mut report = Report {
            schema: SCHEMA,
            case: case.name.clone(),
            facets: case.facets.len() as u64,
            root: case.root,
            from: self.question.from,
            to: match self.question.to {
                Target::Far => Destination::Far("far"),
                Target::Point(at) => Destination::Point(at),
            },
            spacing: spacing(level),
            is_leak,
            closes: None,
            opens: None,
            limit: None,
            passage: None,
            levels: Vec::new(),
        };
        let words = if report.is_leak {
            let (searched, closes) = self.coarsen(tree)?;
            report.closes = closes.map(spacing);
            report.passage = Some(self.passage(&searched)?);
            searched.words
        } else {
            let tree = self.refine(tree, &mut report.limit)?;
            if report.limit.is_none() {
                report.opens = Some(spacing(tree.level));
                report.passage = Some(self.passage(&tree)?);
            }
            tree.words
        };
        report.levels = self.levels;
        Ok(Answer { report, words })
    }

    fn tree(&mut self, level: u8) -> Result<Tree, LeakError<E>> {
        self.watch.step(&format!("meshing the base tree of level {level}"));
        let words = (self.base_tree)(level).map_err(LeakError::Source)?;
        Ok(Tree { level, words })
    }

    /// Why an end is not in a free leaf, for the user.
    fn why_not(&self, words: &[u64]) -> String {
        let root = &self.question.case.root;
        let check = || {
            let leaves = Leaves::new(words)?;
            ends::free_leaf("--from", self.from, &leaves, root)?;
            self.to.map_or(Ok(0), |to| ends::free_leaf("--to", to, &leaves, root))
        };
        check().err().unwrap_or_default()
    }

    /// Whether free leaves of a base tree join the ends. The coarsest leaves are searched first: few of them lead far.
    fn is_joined(&mut self, tree: &Tree) -> Result<bool, LeakError<E>> {
        self.watch.step(&format!("searching the base tree of level {}", tree.level));
        let leaves = Leaves::new(&tree.words).map_err(LeakError::Input)?;
        let edge = |leaf, _| leaves.octant(leaf).edge() as f32;
        let stop = || self.watch.is_interrupted();
        let (is_joined, why) = match ends::in_tree(self.from, self.to, &leaves) {
            Ok((start, goal)) => {
                (search::widest(&leaves, start, goal, edge, &stop)?.is_some(), None)
            }
            Err(why) => (false, Some(why)),
        };
        let spacing = Spacing::of(tree.level, &self.question.case.root);
        self.levels.push(Meshed { spacing, leaves: tree.words.len() as u64, is_joined, why });
        Ok(is_joined)
    }

    /// Meshes coarser until the ends are not joined. Returns the tree to search for the widest path, and the level that
    /// closes it.
    ///
    /// The coarsest leaves that join the ends have edge e, so the widest opening is at least e wide. It joins leaves of
    /// edge e / 4 too, two levels below, and a finer tree has no wider one.
    fn coarsen(&mut self, tree: Tree) -> Result<(Tree, Option<u8>), LeakError<E>> {
        const DEEPER: usize = 2;
        let mut open = std::collections::VecDeque::from([tree]);
        let mut closes = None;
        for level in (0..self.question.case.level_surface).rev() {
            let coarser = self.tree(level)?;
            if !self.is_joined(&coarser)? {
                closes = Some(level);
                break;
            }
            open.push_back(coarser);
            if open.len() > DEEPER + 1 {
                open.pop_front();
            }
        }
        Ok((open.pop_front().expect("at least the tree given"), closes))
    }

    /// Meshes finer until the ends are joined, or up to a limit. Returns the last tree.
    fn refine(&mut self, mut tree: Tree, limit: &mut Option<String>) -> Result<Tree, LeakError<E>> {
        // Halving the spacing of a surface multiplies its leaves by four.
        const GROWTH: u64 = 4;
        while tree.level < LEVEL_MAX {
            let (level, expected) = (tree.level + 1, tree.words.len() as u64 * GROWTH);
            if expected > self.question.leaves_max {
                let max = self.question.leaves_max;
                *limit = Some(format!(
                    "level {level} would have about {expected} leaves, more than the limit of {max} (--leaves-max)"
                ));
                return Ok(tree);
            }
            tree = match self.tree(level) {
                Ok(finer) => finer,
                Err(LeakError::Source(error)) if !self.watch.is_interrupted() => {
                    *limit = Some(format!("level {level} could not be meshed: {error}"));
                    return Ok(tree);
                }
                Err(error) => return Err(error),
            };
            if self.is_joined(&tree)? {
                return Ok(tree);
            }
        }
        *limit = Some(format!("level {LEVEL_MAX} is the finest"));
        Ok(tree)
    }

    /// The widest path through the free leaves of a base tree that joins the ends.
    fn passage(&self, tree: &Tree) -> Result<Passage, LeakError<E>> {
        self.watch.step("measuring free widths");
        let case = self.question.case;
        let leaves = Leaves::new(&tree.words).map_err(LeakError::Input)?;
        let clearance = Clearance::new(&case.facets_lattice);
        let (start, goal) =
            ends::in_tree(self.from, self.to, &leaves).expect("the tree joins the ends");
        let path = widest_path(&leaves, start, goal, &clearance, &|| self.watch.is_interrupted())?;
        let path = path.expect("the tree joins the ends");
        Ok(self.described(&Path::through(&leaves, &path, goal, &clearance), tree.level, &clearance))
    }

    fn described(&self, path: &Path, level: u8, clearance: &Clearance) -> Passage {
        /// Facets at the rim, in parts of the ball's radius, and for small balls in lattice units.
        const RIM: (f64, f64) = (0.02, 2.0);
        let case = self.question.case;
        let scale = case.root.edge / UNITS_PER_EDGE as f64;
        let user = |at: [f64; 3]| std::array::from_fn(|a| case.root.origin[a] + at[a] * scale);
        let throat = path.throat();
        let width = 2.0 * throat.clearance * scale;
        let rim = clearance.facets_within(throat.at, throat.clearance * (1.0 + RIM.0) + RIM.1);
        let points: Vec<Point> = path
            .spots
            .iter()
            .map(|spot| Point { at: user(spot.at), width: 2.0 * spot.clearance * scale })
            .collect();
        let length = |pair: &[Point]| {
            (0..3).map(|a| (pair[0].at[a] - pair[1].at[a]).powi(2)).sum::<f64>().sqrt()
        };
        Passage {
            spacing: Spacing::of(level, &case.root),
            narrowest: Narrowest {
                at: user(throat.at),
                width,
                width_cells: width / Spacing::of(case.level_surface, &case.root).spacing,
                direction: path.direction,
                touches: clearance.nearest(throat.at).map_or(user(throat.at), user),
                facets: rim.into_iter().map(|(facet, _)| facet).collect(),
                index: path.narrowest,
                is_end: path.is_narrowest_at_end(),
            },
            length: points.windows(2).map(length).sum(),
            points,
        }
    }
}

/// The leaves of the widest path: its narrowest leaf is found first, and the ways from there to both ends are as short as
/// the width allows. The width of a leaf is the free width at its centre.
fn widest_path(
    leaves: &Leaves,
    start: u32,
    goal: Goal,
    clearance: &Clearance,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<u32>>, Interrupted> {
    /// Exceeds the rounding of clearances to f32.
    const ROUNDING: f64 = 1.0 + 1e-6;
    let mut clearances = vec![f32::NAN; leaves.len()];
    let mut width = |leaf: u32, from: u32| {
        let known = clearances[leaf as usize];
        if !known.is_nan() {
            return known;
        }
        let at = leaves::centre(&leaves.octant(leaf));
        // A step changes the distance to the nearest facet by no more than its length.
        let step = sub(at, leaves::centre(&leaves.octant(from)));
        let bound = f64::from(clearances[from as usize]) + dot(step, step).sqrt();
        let bound = if bound.is_nan() { f64::INFINITY } else { bound * ROUNDING };
        clearances[leaf as usize] = clearance.at(at, bound) as f32;
        clearances[leaf as usize]
    };
    let Some(path) = search::widest(leaves, start, goal, &mut width, stop)? else { return Ok(None) };
    let narrowest = path.iter().copied().min_by(|&a, &b| width(a, a).total_cmp(&width(b, b)));
    let narrowest = narrowest.expect("a path has leaves");
    let least = width(narrowest, narrowest);
    let back = search::shortest(leaves, narrowest, Goal::Leaf(start), least, &mut width, stop)?;
    let on = search::shortest(leaves, narrowest, goal, least, &mut width, stop)?;
    let (Some(mut path), Some(on)) = (back, on) else { return Ok(None) };
    path.reverse();
    path.extend(&on[1..]);
    Ok(Some(path))
}
