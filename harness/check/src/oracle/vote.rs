//! Who says what, and who is right.
//!
//! Each point has the mesh's side, each oracle's answer, and the harness's own six exact rays, which
//! decide where they agree. On a watertight body they always do, and then neither they nor three
//! agreeing oracles may be against the mesh. On any other body a side is a component's, not a point's: there,
//! disagreement is told and not held against the mesh.

/// One oracle's answers.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The oracle's name.
    pub name: String,
    /// For each point, whether it lies inside.
    pub inside: Vec<bool>,
}

/// What is known of the points.
#[derive(Debug)]
pub struct Ballot<'a> {
    /// The mesh's answers.
    pub mesh: &'a [bool],
    /// The six exact rays' answer; none where they differ.
    pub exact: &'a [Option<bool>],
    /// The oracles' answers.
    pub oracles: &'a [Answer],
    /// Whether the body is watertight.
    pub watertight: bool,
}

/// Where one oracle differed from the mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Dissent {
    /// The oracle's name.
    pub name: String,
    /// Points where it differed.
    pub points: u64,
    /// Of these, points where all exact rays are with the oracle.
    pub right: u64,
    /// Of these, points where all exact rays are with the mesh.
    pub wrong: u64,
}

/// The result of a vote.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// One entry per oracle.
    pub dissents: Vec<Dissent>,
    /// Points at which the oracles are not of one mind.
    pub disputed: u64,
    /// Points at which all six exact rays are against the mesh.
    pub exact_against: Vec<usize>,
    /// Points at which all oracles are against the mesh.
    pub all_against: Vec<usize>,
    /// Points at which the exact rays differ among themselves.
    pub exact_undecided: u64,
}

/// Counts the votes.
pub fn count(ballot: &Ballot) -> Count {
    let dissent = |answer: &Answer| Dissent { name: answer.name.clone(), ..Dissent::default() };
    let mut count =
        Count { dissents: ballot.oracles.iter().map(dissent).collect(), ..Count::default() };
    for (point, (&mesh, &exact)) in ballot.mesh.iter().zip(ballot.exact).enumerate() {
        count.exact_undecided += u64::from(exact.is_none());
        if exact == Some(!mesh) {
            count.exact_against.push(point);
        }
        let mut against = 0;
        for (answer, dissent) in ballot.oracles.iter().zip(&mut count.dissents) {
            if answer.inside[point] != mesh {
                against += 1;
                dissent.points += 1;
                dissent.right += u64::from(exact == Some(!mesh));
                dissent.wrong += u64::from(exact == Some(mesh));
            }
        }
        count.disputed += u64::from(against != 0 && against != ballot.oracles.len());
        if against == ballot.oracles.len() && against >= MAJORITY {
            count.all_against.push(point);
        }
    }
    count
}

/// How many oracles it takes for "all of them" to mean anything.
const MAJORITY: usize = 3;

impl Count {
    /// Why the mesh fails the vote; nothing if it does not. Points are named by their coordinates.
    pub fn failure(&self, ballot: &Ballot, points: &[[f64; 3]]) -> Option<String> {
        if !ballot.watertight {
            return None;
        }
        let named = |who: &str, at: &[usize]| {
            let first = points[*at.first()?];
            let side = if ballot.mesh[at[0]] { "inside" } else { "outside" };
            Some(format!(
                "{who} against the mesh at {} points, first at {first:?}, there {side}",
                at.len()
            ))
        };
        let exact = named("all six exact rays", &self.exact_against);
        let oracles = named("all oracles", &self.all_against);
        let reasons: Vec<String> = exact.into_iter().chain(oracles).collect();
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }

    /// What is worth telling, a sentence each.
    pub fn notes(&self, ballot: &Ballot) -> Vec<String> {
        let all = ballot.mesh.len();
        let told = |dissent: &Dissent| {
            let Dissent { name, points, right, wrong } = dissent;
            let undecided = points - right - wrong;
            format!(
                "{name} differs from the mesh at {points} of {all} points: by exact rays right at {right}, \
                 wrong at {wrong}, rays differ at {undecided}"
            )
        };
        let mut notes: Vec<String> =
            self.dissents.iter().filter(|d| d.points > 0).map(told).collect();
        if !ballot.watertight && !self.exact_against.is_empty() {
            notes.push(format!(
                "the body is not watertight: at {} points all six rays differ from the side of the \
                 component, which another leaf decides",
                self.exact_against.len()
            ));
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

    /// The mesh says outside, inside, inside; what the count and the failure are.
    fn vote(
        exact: [Option<bool>; 3],
        all: [&[u8]; 3],
        watertight: bool,
    ) -> (Count, Option<String>, Vec<String>) {
        let oracles = answers(all);
        let ballot =
            Ballot { mesh: &[false, true, true], exact: &exact, oracles: &oracles, watertight };
        let count = count(&ballot);
        let points = [[0.0; 3], [1.0; 3], [2.0; 3]];
        let (failure, notes) = (count.failure(&ballot, &points), count.notes(&ballot));
        (count, failure, notes)
    }

    const TRUE: [Option<bool>; 3] = [Some(false), Some(true), Some(true)];
    const YES: &[u8] = &[0, 1, 1];

    #[test]
    fn unanimity_is_silent() {
        let (count, failure, notes) = vote(TRUE, [YES, YES, YES], true);
        assert_eq!((count.disputed, failure, notes), (0, None, vec![]));
    }

    #[test]
    fn one_oracle_that_is_wrong_is_told_and_does_no_harm() {
        let (count, failure, notes) = vote(TRUE, [YES, &[1, 1, 0], YES], true);
        let dissent = Dissent { name: "oracle 1".into(), points: 2, right: 0, wrong: 2 };
        assert_eq!((&count.dissents[1], count.disputed, failure), (&dissent, 2, None));
        assert_eq!(notes.len(), 1);
        assert!(
            notes[0].starts_with("oracle 1 differs from the mesh at 2 of 3 points"),
            "{}",
            notes[0]
        );
    }

    #[test]
    fn exact_rays_against_the_mesh_fail_it() {
        let exact = [Some(false), Some(false), Some(true)];
        let (count, failure, _) = vote(exact, [YES, &[0, 0, 1], YES], true);
        assert_eq!((count.exact_against, count.dissents[1].right), (vec![1], 1));
        assert_eq!(
            failure.unwrap(),
            "all six exact rays against the mesh at 1 points, first at [1.0, 1.0, 1.0], there inside"
        );
    }

    #[test]
    fn three_oracles_against_the_mesh_fail_it_and_two_do_not() {
        let no: &[u8] = &[1, 1, 1];
        let undecided = [None, Some(true), Some(true)];
        let (_, failure, _) = vote(undecided, [no, no, no], true);
        assert!(failure.unwrap().starts_with("all oracles against the mesh at 1 points"));
        assert_eq!(vote(undecided, [no, no, YES], true).1, None);
    }

    #[test]
    fn on_a_leaky_body_everything_is_told_and_nothing_fails() {
        let exact = [Some(true), Some(true), None];
        let no: &[u8] = &[1, 1, 0];
        let (count, failure, notes) = vote(exact, [no, no, no], false);
        assert_eq!((failure, count.exact_undecided, notes.len()), (None, 1, 4));
        assert!(notes[0].ends_with("right at 1, wrong at 0, rays differ at 1"), "{}", notes[0]);
    }
}
