//! Comparison of the mesh with the oracles and with exact rays.
//!
//! Every point has a side in the mesh, an answer of each oracle, and the result of the harness's own six exact
//! rays, which decide if they agree. On a watertight body they always agree, and the mesh fails if the rays or,
//! unless facets coincide, three unanimous oracles contradict it. On any other body the side belongs to a component and not to a point,
//! so contradictions are reported only. So are all contradictions of a case with seeds, which decide instead of rays.

/// One oracle's answers.
pub struct Answer {
    /// The oracle's name.
    pub name: String,
    /// Whether each point lies inside.
    pub inside: Vec<bool>,
}

/// All answers about the points.
pub struct Ballot<'a> {
    /// Whether each point lies inside by the mesh.
    pub mesh: &'a [bool],
    /// Whether each point lies inside by the six exact rays; `None` if they disagree.
    pub exact: &'a [Option<bool>],
    /// The oracles' answers.
    pub oracles: &'a [Answer],
    /// Whether the body is watertight.
    pub watertight: bool,
    /// Whether facets coincide: then the oracles may contradict rays, which decide.
    pub doubled: bool,
    /// Whether seeds and not rays determine the sides. Then no vote can contradict the mesh.
    pub seeds: bool,
}

/// Minimum number of oracles whose unanimity counts.
const MAJORITY: usize = 3;

impl Ballot<'_> {
    /// Why no vote can fail the mesh; `None` if one can.
    pub fn advisory(&self) -> Option<&'static str> {
        match (self.seeds, self.watertight) {
            (true, _) => Some("seeds determine the sides"),
            (false, false) => Some(
                "the body is not watertight, and another leaf determines the side of the component",
            ),
            (false, true) => None,
        }
    }

    /// Number of points where a vote can fail the mesh.
    pub fn decisive(&self) -> u64 {
        let by_oracles = self.oracles.len() >= MAJORITY && !self.doubled;
        let by_rays = || self.exact.iter().flatten().count();
        if by_oracles { self.mesh.len() as u64 } else { by_rays() as u64 }
    }

    /// Indices of points that satisfy a predicate.
    fn points(&self, predicate: impl Fn(usize) -> bool) -> Vec<usize> {
        (0..self.mesh.len()).filter(|&point| predicate(point)).collect()
    }

    /// Indices of points where all six exact rays contradict the mesh.
    fn exact_against(&self) -> Vec<usize> {
        self.points(|point| self.exact[point] == Some(!self.mesh[point]))
    }

    /// Indices of points where all oracles contradict the mesh.
    fn all_against(&self) -> Vec<usize> {
        let is_against = |point| self.oracles.iter().all(|of| of.inside[point] != self.mesh[point]);
        self.points(|point| self.oracles.len() >= MAJORITY && is_against(point))
    }

    /// The reason why the mesh fails; `None` if it does not. `places` are the coordinates of the points.
    pub fn failure(&self, places: &[[f64; 3]]) -> Option<String> {
        if self.advisory().is_some() {
            return None;
        }
        let sentence = |subject: &str, against: &[usize]| {
            let first = *against.first()?;
            let (count, place) = (against.len(), places[first]);
            let side = if self.mesh[first] { "inside" } else { "outside" };
            Some(format!(
                "{subject} contradict the mesh at {count} points, first at {place:?}, which is {side} in the mesh"
            ))
        };
        let exact = sentence("all six exact rays", &self.exact_against());
        let oracles = (!self.doubled).then(|| sentence("all oracles", &self.all_against()));
        let reasons: Vec<String> = exact.into_iter().chain(oracles.flatten()).collect();
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }

    /// Remarks that are not failures, one sentence each.
    pub fn notes(&self) -> Vec<String> {
        let all = self.mesh.len();
        let sentence = |Answer { name, inside }: &Answer| {
            let differing = self.points(|point| inside[point] != self.mesh[point]);
            let rays = |agree| {
                let votes = differing.iter().map(|&point| (self.exact[point], self.mesh[point]));
                votes.filter(|&(exact, mesh)| exact == Some(agree == mesh)).count()
            };
            let (points, right, wrong) = (differing.len(), rays(false), rays(true));
            let undecided = points - right - wrong;
            let note = format!(
                "{name} differs from the mesh at {points} of {all} points: exact rays confirm it at {right}, refute it at {wrong}, and \
                 disagree at {undecided}"
            );
            (points > 0).then_some(note)
        };
        let mut notes: Vec<String> = self.oracles.iter().filter_map(sentence).collect();
        let (exact, oracles) = (self.exact_against().len(), self.all_against().len());
        if self.doubled && oracles > 0 {
            notes.push(format!("at {oracles} points all oracles contradict the mesh: facets coincide, and rays decide"));
        }
        if let Some(why) = self.advisory().filter(|_| exact > 0) {
            notes.push(format!("at {exact} points all six exact rays contradict the mesh: {why}"));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answers(all: [&[u8]; 3]) -> Vec<Answer> {
        let answer = |(index, inside): (usize, &&[u8])| Answer {
            name: format!("oracle {index}"),
            inside: inside.iter().map(|&side| side == 1).collect(),
        };
        all.iter().enumerate().map(answer).collect()
    }

    /// Where exact rays contradict the mesh, the failure and the notes of a ballot on three points, which the mesh places outside,
    /// inside, inside.
    fn vote(
        exact: [Option<bool>; 3],
        all: [&[u8]; 3],
        watertight: bool,
    ) -> (Vec<usize>, Option<String>, Vec<String>) {
        vote_with_seeds(exact, all, watertight, false)
    }

    fn vote_with_seeds(
        exact: [Option<bool>; 3],
        all: [&[u8]; 3],
        watertight: bool,
        seeds: bool,
    ) -> (Vec<usize>, Option<String>, Vec<String>) {
        let (oracles, mesh) = (answers(all), [false, true, true]);
        let doubled = false;
        let ballot =
            Ballot { mesh: &mesh, exact: &exact, oracles: &oracles, watertight, doubled, seeds };
        let places = [[0.0; 3], [1.0; 3], [2.0; 3]];
        (ballot.exact_against(), ballot.failure(&places), ballot.notes())
    }

    const TRUE: [Option<bool>; 3] = [Some(false), Some(true), Some(true)];
    const YES: &[u8] = &[0, 1, 1];

    #[test]
    fn unanimous_answers_have_no_failure_and_no_notes() {
        let (_, failure, notes) = vote(TRUE, [YES, YES, YES], true);
        assert_eq!((failure, notes), (None, vec![]));
    }

    #[test]
    fn oracles_that_count_doubled_facets_do_not_fail_the_mesh() {
        let (oracles, mesh) = (answers([&[1, 1, 1]; 3]), [false; 3]);
        let exact = [Some(false); 3];
        let ballot = |doubled| Ballot {
            mesh: &mesh,
            exact: &exact,
            oracles: &oracles,
            watertight: true,
            doubled,
            seeds: false,
        };
        let judged = |doubled| {
            let ballot = ballot(doubled);
            (ballot.failure(&[[0.0; 3]; 3]).is_some(), ballot.notes().len())
        };
        assert_eq!((judged(false), judged(true)), ((true, 3), (false, 4)));
    }

    #[test]
    fn one_wrong_oracle_is_noted_and_does_not_fail() {
        let (_, failure, notes) = vote(TRUE, [YES, &[1, 1, 0], YES], true);
        let expected = "oracle 1 differs from the mesh at 2 of 3 points: exact rays confirm it at 0, refute it at 2, \
            and disagree at 0";
        assert_eq!((failure, notes), (None, vec![expected.to_owned()]));
    }

    #[test]
    fn a_note_counts_where_the_exact_rays_support_an_oracle() {
        let (_, _, notes) = vote([Some(true), Some(true), None], [YES, &[1, 0, 0], YES], true);
        let expected = "oracle 1 differs from the mesh at 3 of 3 points: exact rays confirm it at 1, refute it at 1, \
            and disagree at 1";
        assert_eq!(notes, [expected]);
    }

    #[test]
    fn exact_rays_that_contradict_the_mesh_are_a_failure() {
        let exact = [Some(false), Some(false), Some(true)];
        let (against, failure, notes) = vote(exact, [YES, &[0, 0, 1], YES], true);
        assert!(
            against == [1] && notes[0].contains("confirm it at 1, refute it at 0"),
            "{notes:?}"
        );
        assert_eq!(
            failure.unwrap(),
            "all six exact rays contradict the mesh at 1 points, first at [1.0, 1.0, 1.0], which is inside in the mesh"
        );
    }

    #[test]
    fn three_unanimous_oracles_that_contradict_the_mesh_are_a_failure_and_two_are_not() {
        let no: &[u8] = &[1, 1, 1];
        let undecided = [None, Some(true), Some(true)];
        let (_, failure, _) = vote(undecided, [no, no, no], true);
        assert!(failure.unwrap().starts_with("all oracles contradict the mesh at 1 points"));
        assert_eq!(vote(undecided, [no, no, YES], true).1, None);
    }

    #[test]
    fn contradictions_on_a_body_that_is_not_watertight_are_noted_and_do_not_fail() {
        let exact = [Some(true), Some(true), None];
        let no: &[u8] = &[1, 1, 0];
        let (_, failure, notes) = vote(exact, [no, no, no], false);
        assert_eq!((failure, notes.len()), (None, 4));
        assert!(
            notes[0].ends_with("confirm it at 1, refute it at 0, and disagree at 1"),
            "{}",
            notes[0]
        );
    }

    #[test]
    fn with_seeds_no_vote_fails_the_mesh_and_every_contradiction_is_noted() {
        let no: &[u8] = &[1, 1, 0];
        let exact = [Some(true), Some(true), Some(false)];
        let (against, failure, notes) = vote_with_seeds(exact, [no, no, no], true, true);
        assert_eq!((against.len(), failure, notes.len()), (2, None, 4));
        assert!(
            notes[0].ends_with("confirm it at 2, refute it at 0, and disagree at 0"),
            "{}",
            notes[0]
        );
        assert_eq!(
            notes[3],
            "at 2 points all six exact rays contradict the mesh: seeds determine the sides"
        );
        assert!(vote(exact, [no, no, no], true).1.is_some());
    }
}
