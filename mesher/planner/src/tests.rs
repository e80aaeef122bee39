#[path = "../../tests/support/cases.rs"]
mod cases;

use super::*;
use cases::{case, options, rules as plain_rules};
use mesher::input::lattice::{Keep, Root};
use mesher::output::write::Output;
use mesher::partition::Partitioner;
use ranks::{Solo, sim};

const ROUGH: f64 = 268_435_456.0;

/// Runs `test` with a problem of roughly [`ROUGH`] cells at level 13, and fourfold as many at each level below.
fn with_problem<T>(level_surface: Level, test: impl FnOnce(&Problem) -> T) -> T {
    let root = Root { origin: [-1.0; 3], edge: 2.0 };
    let keep = Keep::Outside;
    let rules = Rules { root, level_surface, layer_cells_min: 4, keep, ..plain_rules() };
    let rough = [ROUGH * 4f64.powi(level_surface as i32 - 13), 0.0];
    test(&Problem {
        rules: &rules,
        rough,
        times_s: [2.0, 0.0],
        tree_bytes_per_cell: TREE_BYTES_PER_CELL,
        comm: &Solo,
    })
}

/// Cells and bytes of a mesh that is coarser by some levels.
fn amounts(cells: f64, bytes: f64, shift: Level) -> Amounts {
    let part = 0.25f64.powi(shift as i32);
    let (cells, bytes_graded) = (cells * part, bytes * part);
    Amounts { cells, bytes_graded, time_fixed_s: 3.0, ..Amounts::default() }
}

/// A plan of the case, and the levels by which the pilots were coarser.
fn planned(cells: f64, bytes: f64) -> (Plan, Vec<Level>) {
    let mut asked = Vec::new();
    let mut pilot = |shift| {
        asked.push(shift);
        Ok((amounts(cells, bytes, shift), false))
    };
    let plan = with_problem(13, |problem| problem.plan(&mut pilot));
    (plan.expect("the pilots succeed"), asked)
}

#[test]
fn the_finer_pilot_takes_a_moment_or_has_a_64th_of_the_cells() {
    let (plan, asked) = planned(ROUGH, 1.0);
    assert_eq!(asked, [4, 3]);
    assert!(plan.cells.abs_diff(ROUGH as u64) <= 1, "{}", plan.cells);
    let cells: Vec<(f64, u64)> = plan.pilots.iter().map(|p| (p.spacing_factor, p.cells)).collect();
    assert_eq!(cells, [(16.0, 1 << 20), (8.0, 1 << 22)]);
    assert_eq!((plan.fits, plan.spacing_factor_fits), (true, None));
    assert_eq!((plan.time_cpu_s, plan.pilots[0].time_cpu_s), (5.0, 3.0));
    assert!(plan.words_bytes.abs_diff(ROUGH as u64 * 8 + WORDS_HEADER) <= 8);
    assert!(plan.tree_bytes.abs_diff((ROUGH * TREE_BYTES_PER_CELL) as u64 + TREE_HEADER) <= 1);
    plan.check_invariants();
    let corruptions: [&dyn Fn(&mut Plan); 4] =
        [&|p| p.words_bytes /= 3, &|p| p.time_cpu_s = f64::NAN, &|p| p.pilots.reverse(), &|p| {
            p.pilots[1].spacing_factor = 1.0
        }];
    for (number, corrupt) in corruptions.into_iter().enumerate() {
        let mut wrong = plan.clone();
        corrupt(&mut wrong);
        let check = std::panic::catch_unwind(|| wrong.check_invariants());
        assert!(check.is_err(), "corruption {number}");
    }
    // Fewer cells than the areas suggest: the next pilots are finer, and the mesh itself if it is small.
    assert_eq!(planned(ROUGH / 16.0, 1.0).1, [4, 3, 2, 1]);
    let (plan, asked) = planned(ROUGH / 64.0, 1.0);
    assert_eq!((plan.cells, asked), (1 << 22, vec![4, 3, 2, 1, 0]));
    // More cells: the finer one is one level finer in any case.
    assert_eq!(planned(ROUGH * 64.0, 1.0).1, [4, 3]);
}

/// Although few of their cells are kept. No machine has memory for all of them.
#[test]
fn boxes_in_deleted_space_are_not_made_by_a_pilot() {
    let mut asked = Vec::new();
    let mut pilot = |shift| {
        asked.push(shift);
        Ok((amounts(ROUGH / 64.0, 1.0, shift), false))
    };
    with_problem(13, |problem| Problem { rough: [ROUGH, 64e15], ..*problem }.plan(&mut pilot))
        .expect("the pilots succeed");
    assert_eq!(asked, [12, 11]);
}

#[test]
fn what_is_written_takes_time() {
    let time = |words, tree| {
        let directory = "m".into();
        let out = Some(Output { directory, words, tree });
        let options = Options { out, ..options() };
        let mut record = Recorder::default();
        let mut job = Job::new(&options, &Solo, &mut record);
        let quantised = mesher::quantised(&case(), &mut job).unwrap();
        Problem::new(&quantised, &job).times_s[1]
    };
    assert_eq!([time(true, false), time(false, true), time(true, true)], [4e-9, 2.5e-9, 6.5e-9]);
}

/// Trees of three large cases took 0.047, 0.043 and 0.071 bytes per cell, in layers of four cells, and 0.084, 0.103 and 0.128 as T0.
#[test]
fn the_tree_of_t0_takes_more_for_a_cell() {
    let bytes = |layer_cells_min, ungraded| {
        let options = Options { ungraded, ..options() };
        let mut record = Recorder::default();
        let mut job = Job::new(&options, &Solo, &mut record);
        let case = Case { layer_cells_min, ..case() };
        Problem::new(&mesher::quantised(&case, &mut job).unwrap(), &job).tree_bytes_per_cell
    };
    let of_t0 = [1, 4, 9].map(|n| bytes(n, true));
    assert_eq!(of_t0, [2.0 * TREE_BYTES_PER_CELL; 3]);
    let graded = [1, 2, 4, 9].map(|n| bytes(n, false));
    assert_eq!(graded, [4.0, 2.0, 1.0, 1.0].map(|thin| thin * TREE_BYTES_PER_CELL));
}

#[test]
fn the_least_factor_that_fits_is_found() {
    let (plan, _) = planned(ROUGH, 1e18);
    assert!(!plan.fits);
    let factor = plan.spacing_factor_fits.expect("a spacing fits");
    let left = plan.tightest.expect("memory is limited").left_bytes as f64;
    // The pilot has 1e18 / 64 bytes already.
    let more = |factor: f64| 1e18 / (factor * factor) - 1e18 / 64.0;
    assert!(more(factor) <= left && more(factor / 2.0) > left, "{factor} for {left} bytes");
    let grown = plan.memory_peak_bytes[0] as f64 / (1e18 * 63.0 / 64.0);
    assert!((grown - 1.0).abs() < 1e-6, "{grown}");
}

#[test]
fn only_runs_that_may_not_fit_are_planned_and_refused() {
    with_problem(11, |problem| {
        assert_eq!(problem.check(&mut |_| panic!("no pilot is needed")), Ok(()));
    });
    // Level 19: 4096 times as many cells as at level 13 take more than half of any memory.
    with_problem(19, |problem| {
        let mut pilots = 0;
        let few = &mut |shift| {
            pilots += 1;
            Ok((amounts(ROUGH, 1.0, shift), false))
        };
        assert_eq!(problem.check(few), Ok(()));
        assert!(pilots > 1);
        let many = &mut |shift| Ok((amounts(1e12, 1e18, shift), false));
        assert_eq!(problem.check(many).unwrap_err().exit_code, 71);
    });
    // A small case is meshed.
    let plan =
        with_problem(8, |problem| problem.plan(&mut |shift| Ok((amounts(9.0, 1.0, shift), false))))
            .unwrap();
    assert_eq!((plan.cells, plan.pilots.len(), plan.pilots[0].spacing_factor), (9, 1, 1.0));
}

#[test]
fn pilots_of_runs_that_cannot_fit_are_short() {
    let mut finest = f64::NAN;
    with_problem(19, |problem| {
        let pilot = &mut |shift| {
            let amounts = amounts(problem.rough[0], 1e18, shift);
            finest = amounts.cells;
            Ok((amounts, false))
        };
        problem.plan(pilot).unwrap();
        assert!(problem.used_rough() > USED_UNDOUBTED && finest <= CELLS_MOMENT);
    });
}

/// 1.97e11 cells in layers of 64 were planned as 7.6e9, from pilots whose layers filled the root, because 2 bytes for each did not fit.
#[test]
fn pilots_of_thick_layers_are_finer_because_their_cells_take_less() {
    let finest = |problem: &Problem, layer_cells_min| {
        let rules = Rules { layer_cells_min, ..problem.rules.clone() };
        let mut finest = 0.0;
        let pilot = &mut |shift| {
            let amounts = amounts(problem.rough[0], 1.0, shift);
            finest = amounts.cells;
            Ok((amounts, false))
        };
        Problem { rules: &rules, ..*problem }.plan(pilot).unwrap();
        finest
    };
    with_problem(18, |problem| {
        let [thin, thick] = [4, 64].map(|n| finest(problem, n));
        assert!(thick > CELLS_MOMENT, "{thick}");
        assert_eq!(thin < thick, problem.used_rough() > USED_UNDOUBTED);
    });
    let fits = with_problem(13, |problem| [4, 64].map(|n| finest(problem, n)));
    assert_eq!(fits, [ROUGH / 64.0, ROUGH / 4.0]);
}

/// The sums over the ranks of pilots that are coarser by 2, 1 and 0 levels.
fn pilots(ranks: usize) -> (Vec<Amounts>, f64) {
    let options = options();
    let on_rank = |comm: &dyn Comm| {
        let mut record = Recorder::default();
        let job = &mut Job::new(&options, comm, &mut record);
        let quantised = mesher::quantised(&case(), job).unwrap();
        let run = |shift| pilot(&quantised, shift, job).unwrap().0;
        ([2, 1, 0].map(run), boxed_in(&quantised.rules.boxes, 0, 0))
    };
    let all = match ranks {
        1 => vec![on_rank(&Solo)],
        _ => sim::run(ranks, 7, |comm| on_rank(comm)),
    };
    let sum = |i: usize| Amounts::sum(all.iter().map(|(amounts, _)| amounts[i]));
    ((0..3).map(sum).collect(), all[0].1)
}

#[test]
fn two_pilot_runs_predict_the_mesh() {
    let (amounts, cells_boxed) = pilots(1);
    let [coarse, fine, mesh] = amounts[..] else { unreachable!("three runs") };
    // A single rank has no other phases.
    assert!(mesh.time_fixed_s.abs() < 1e-9, "{mesh:?}");
    for time in [mesh.time_refine_s, mesh.time_cells_s] {
        assert!(time > 0.0 && time < 0.95 * mesh.time_cpu_s(), "{mesh:?}");
    }
    let counted =
        |a: &Amounts| [a.cells, a.cells_boxed_deleted, a.tests, a.bytes_sides, a.bytes_graded];
    // These repeat exactly: a change of what is counted shows here.
    assert_eq!(counted(&mesh), [764868.0, 27894.96431997696, 22726.6, 214338.0, 194820.0]);
    assert!(mesh.cells_boxed_deleted > 1000.0 && mesh.cells > 1e5, "{mesh:?}");
    let (coarser, part_deepest) = (Some(coarse), 1.0);
    let pilot = Pilot { shift: 1, amounts: fine, coarser, cells_boxed, part_deepest };
    let predicted = pilot.at(0);
    for (name, predicted, measured) in [
        ("cells", predicted.cells, mesh.cells),
        ("bytes", predicted.bytes(), mesh.bytes()),
        ("tests", predicted.tests, mesh.tests),
    ] {
        let error = predicted / measured - 1.0;
        assert!(error.abs() < 0.2, "{name}: {predicted} for {measured}");
    }
}

#[test]
fn pilot_runs_do_without_seeds_in_cells_that_only_they_cross() {
    let run = |x: f64, shift: Level| {
        let case = Case { seeds: vec![[x, 0.0, 0.0]], boxes: Vec::new(), ..case() };
        let (options, mut record) = (options(), Recorder::default());
        let job = &mut Job::new(&options, &Solo, &mut record);
        pilot(&mesher::quantised(&case, job)?, shift, job)
    };
    // The sphere has radius 0.5, a pilot that is coarser by three levels has cells of 0.0625.
    let [without, with] = [0.53, 0.7].map(|x| run(x, 3).unwrap().1);
    assert!(without && !with);
    // Also a pilot run of a case that is refused.
    let code = |(x, shift)| run(x, shift).unwrap_err().exit_code;
    assert_eq!([(0.5, 0), (900.0, 3)].map(code), [2, 2]);
}

/// A pilot whose base mesh is that of the run is refused as the run is; one whose base mesh is coarser is divided in another way.
#[test]
fn a_partition_that_cannot_be_made_is_not_planned() {
    let code = |level_base, shift| {
        let on_rank = |comm: &dyn Comm| {
            let partitioner = Partitioner::Paper;
            let division =
                Division { partitioner, level_base: Some(level_base), ..Division::default() };
            let (options, mut record) = (Options { division, ..options() }, Recorder::default());
            let job = &mut Job::new(&options, comm, &mut record);
            let case = Case { boxes: Vec::new(), ..case() };
            pilot(&mesher::quantised(&case, job)?, shift, job)
        };
        sim::run(9, 7, |comm| on_rank(comm).map_or_else(|why| why.exit_code, |_| 0)).remove(0)
    };
    // The surface is at level 9.
    assert_eq!(
        [(1, 0), (1, 3), (7, 0), (7, 3), (7, 6)].map(|(l, shift)| code(l, shift)),
        [2, 2, 0, 0, 0]
    );
}

#[test]
fn pilot_runs_on_several_ranks_have_the_cells_of_one() {
    let [one, three] = [1, 3].map(|ranks| pilots(ranks).0);
    for (one, three) in one.iter().zip(&three) {
        assert_eq!(one.cells, three.cells);
        // Several ranks also route facets and move boundaries.
        assert!(three.time_fixed_s > 0.0 && three.time_fixed_s < three.time_cpu_s());
        assert!((one.cells_boxed_deleted - three.cells_boxed_deleted).abs() < 1e-6);
    }
}

fn plan_for_people() -> Plan {
    let pilot = |spacing_factor| PilotEntry { spacing_factor, cells: 12_345, time_cpu_s: 0.5 };
    let (limit, left_bytes, needed_bytes) = ("machine", 900_000_000, 5_000_000);
    Plan {
        schema: "",
        ranks: 2,
        pilots: vec![pilot(4.0), pilot(2.0)],
        is_without_seeds: false,
        cells: 1_234_567,
        time_cpu_s: 12.6,
        memory_peak_bytes: vec![2_000_000, 3_500_000],
        words_bytes: 4_100_000,
        tree_bytes: 1234,
        tightest: Some(Tightest { limit, left_bytes, needed_bytes }),
        fits: true,
        spacing_factor_fits: Some(4.0),
    }
}

#[test]
fn a_plan_says_all_that_a_run_takes() {
    let mut plan = plan_for_people();
    assert_eq!(
        plan.to_string(),
        "cells          about 1.2e6\n\
         time           12.60 s of CPU time over all ranks\n\
         peak memory    5.5 MB over all ranks, 3.5 MB on a rank at most\n\
         files          leaf words of 4.1 MB per rank; or a tree up to 1.2 kB\n\
         fits           yes: needs 5.0 MB more, the machine has 900 MB left"
    );
    plan.tightest = None;
    assert!(plan.to_string().ends_with("fits           no limit is known"));
    plan.pilots[1].spacing_factor = 1.0;
    assert!(plan.to_string().contains("cells          1,234,567\n"), "{plan}");
}

#[test]
fn a_refusal_names_the_limit_and_the_factor_that_fits() {
    let mut plan = Plan { fits: false, ..plan_for_people() };
    let refused = "the mesh would have about 1.2e6 cells and need 5.0 MB of memory, but the machine has 900 MB left: \
                   multiply all spacings by 4, which fits, use more machines, or try with --force";
    assert_eq!(plan.refusal(), Error::memory(refused));
    plan.is_without_seeds = true;
    let doubt = "; seeds lie in crossing cells of a pilot run, whose sides are by rays, so this may be far off";
    assert_eq!(plan.refusal(), Error::memory(format!("{refused}{doubt}")));
    assert!(plan.to_string().starts_with(&format!("cells          about 1.2e6{doubt}\n")));
    plan.spacing_factor_fits = None;
    assert!(plan.refusal().to_string().contains("left: no spacing of this case fits, use more"));
}

#[test]
fn bytes_have_units() {
    let shown = [0, 999, 1500, 99_900, 100_000, 448_000_000, 25_000_000_000_000, u64::MAX];
    let expected =
        ["0 bytes", "999 bytes", "1.5 kB", "99.9 kB", "100 kB", "448 MB", "25.0 TB", "18.4 EB"];
    assert_eq!(shown.map(bytes), expected);
}
