//! Leaks: does a path of free leaves of the base tree join two places, how wide is it, and at which spacing does it
//! close or open?
//!
//! - [`leaves`]: a base tree with neighbours; [`coarser`]: the same of a coarser level; [`ends`]: the ends of the path; [`search`]: the path through the leaves;
//! - [`clearance`]: distances to facets; [`grid`]: the same for the points of a grid;
//! - [`path`]: free widths along a path and its narrowest place; [`middle`]: the middle of a long passage;
//! - [`passage`]: the widest path; [`surface`]: whether the facets form a closed surface between the ends;
//! - [`report`]: the answer as data; [`text`]: the answer for a terminal.
//!
//! A leaf is free if no facet touches it; two free leaves are joined if they share part of a face. A ball as wide as the
//! narrower of the two passes from one to the other, so an opening that joins leaves of edge e is at least e wide. An
//! opening wider than 2 sqrt(3) e always joins leaves of edge e: the leaf that contains the centre of the ball is free.

pub mod clearance;
pub mod coarser;
pub mod ends;
pub mod grid;
pub mod leaves;
pub mod middle;
pub mod passage;
pub mod path;
pub mod report;
pub mod search;
pub mod surface;
pub mod text;

use std::fmt::Display;

use contract::case::Case;
use contract::octant::LEVEL_MAX;
use ends::Target;
use leaves::Leaves;
use report::{Destination, Meshed, Passage, Report, SCHEMA, Spacing};
use search::{Interrupted, Memory};

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
            is_separated: false,
            limit: None,
            passage: None,
            levels: Vec::new(),
        };
        let words = if report.is_leak {
            let (searched, closes) = self.coarsen(tree)?;
            report.closes = closes.map(spacing);
            report.passage = Some(self.passage(&searched)?);
            searched.words
        } else if self.is_separated(&tree)? {
            report.is_separated = true;
            tree.words
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
                let mut memory = Memory::default();
                (search::widest(&leaves, start, goal, edge, &mut memory, &stop)?.is_some(), None)
            }
            Err(why) => (false, Some(why)),
        };
        let spacing = Spacing::of(tree.level, &self.question.case.root);
        self.levels.push(Meshed { spacing, leaves: tree.words.len() as u64, is_joined, why });
        Ok(is_joined)
    }

    /// Coarsens the surface until the ends are not joined. Returns the tree to search for the widest path, and the level that
    /// closes it.
    ///
    /// The coarsest leaves that join the ends have edge e, so the widest opening is at least e wide. It joins leaves of
    /// edge e / 4 too, two levels below, and a finer tree has no wider one.
    fn coarsen(&mut self, tree: Tree) -> Result<(Tree, Option<u8>), LeakError<E>> {
        const DEEPER: usize = 2;
        let mut open = std::collections::VecDeque::from([tree]);
        let mut closes = None;
        for level in (0..self.question.case.level_surface).rev() {
            let finer = open.back().expect("at least the tree given");
            let words = coarser::coarser(&finer.words, &self.question.case.boxes, level);
            let coarser = Tree { level, words };
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
        // Finer trees, the finest first.
        let mut ahead: Vec<Tree> = Vec::new();
        while tree.level < LEVEL_MAX {
            let (level, expected) = (tree.level + 1, tree.words.len() as u64 * GROWTH);
            if expected > self.question.leaves_max {
                let max = self.question.leaves_max;
                *limit = Some(format!(
                    "level {level} would have about {expected} leaves, more than the limit of {max} (--leaves-max)"
                ));
                return Ok(tree);
            }
            if ahead.is_empty() {
                ahead = self.ahead(level, expected);
            }
            tree = match ahead.pop().map_or_else(|| self.tree(level), Ok) {
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

    /// The base trees of a level, with this number of leaves expected, and of finer ones, the finest first; none if that was not made. A
    /// small tree is made faster than the mesher starts, so several are derived from one.
    fn ahead(&mut self, level: u8, expected: u64) -> Vec<Tree> {
        /// Leaves of a tree that is small.
        const SMALL: u64 = 1 << 16;
        let small = SMALL.min(self.question.leaves_max);
        let more = (1..=LEVEL_MAX - level).take_while(|&l| expected << (2 * l) <= small).last();
        let Some(finest) = more.and_then(|more| self.tree(level + more).ok()) else {
            return Vec::new();
        };
        let mut trees = vec![finest];
        for level in (level..trees[0].level).rev() {
            let finer = &trees[trees.len() - 1].words;
            let words = coarser::coarser(finer, &self.question.case.boxes, level);
            trees.push(Tree { level, words });
        }
        trees
    }

    /// Whether a closed surface separates the centres of the leaves at the ends.
    fn is_separated(&self, tree: &Tree) -> Result<bool, LeakError<E>> {
        let leaves = Leaves::new(&tree.words).map_err(LeakError::Input)?;
        let centre = |at| leaves.octant(leaves.locate(at)).centre();
        Ok(surface::separates(self.question.case, centre(self.from), self.to.map(centre)))
    }

    fn passage(&self, tree: &Tree) -> Result<Passage, LeakError<E>> {
        self.watch.step("measuring free widths");
        let leaves = Leaves::new(&tree.words).map_err(LeakError::Input)?;
        let ends = ends::in_tree(self.from, self.to, &leaves).expect("the tree joins the ends");
        let stop = || self.watch.is_interrupted();
        Ok(passage::widest(self.question.case, tree.level, &leaves, ends, &stop)?)
    }
}
