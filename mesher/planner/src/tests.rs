use super::*;
use crate::cases::{case, options, rules as plain_rules};
use mesher::input::lattice::{ExtentBox, Keep, Root};
use ranks::{Solo, sim};

const ROUGH: f64 = 268_435_456.0;

fn rules(level_surface: Level) -> Rules {
    let root = Root { origin: [-1.0; 3], edge: 2.0 };
    Rules { root, level_surface, layer_cells_min: 4, keep: Keep::Outside, ..plain_rules() }
}

/// Runs `test` with the problem of half of a face of the root: at level 13, [`ROUGH`] cells.
fn with_problem<T>(
    level_surface: Level,
    boxes: &[ExtentBox],
    test: impl FnOnce(&Problem) -> T,
) -> T {
    let h = ROOT_EDGE as i32;
    let facets = [Facet { v: [[0, 0, 1], [h, 0, 1], [0, h, 1]] }];
    test(&Problem {
        rules: &rules(level_surface),
        bounds: &Bounds { lo: [-1.0; 3], hi: [1.0; 3] },
        facets: &facets,
        spacing_min: 0.5,
        volumes: &Volumes::new(boxes),
        time_cpu_s: 2.0,
        output: None,
        comm: &Solo,
    })
}

/// Cells and bytes of a mesh that is coarser by some levels.
fn amounts(cells: f64, bytes: f64, shift: Level) -> Amounts {
    let part = 0.25f64.powi(shift as i32);
    Amounts {
        cells: cells * part,
        bytes_graded: bytes * part,
        time_fixed_s: 3.0,
        ..Amounts::default()
    }
}

/// A plan of the case, and the levels by which the pilots were coarser.
fn planned(cells: f64, bytes: f64) -> (Plan, Vec<Level>) {
    let mut asked = Vec::new();
    let plan = with_problem(13, &[], |problem| {
        let rough = problem.cells_rough();
        assert_eq!(rough, [ROUGH, 0.0]);
        let mut pilot = |shift| {
            asked.push(shift);
            Ok(amounts(cells, bytes, shift))
        };
        from_pilots(problem, rough, cells_max(rough, 1.0, 0.0), &mut pilot)
    });
    (plan.expect("the pilots succeed"), asked)
}

#[test]
fn the_finer_pilot_has_a_64th_of_the_cells() {
    let (plan, asked) = planned(ROUGH, 1.0);
    assert_eq!(asked, [4, 3]);
    assert!(plan.cells.abs_diff(ROUGH as u64) <= 1, "{}", plan.cells);
    let cells: Vec<(f64, u64)> = plan.pilots.iter().map(|p| (p.spacing_factor, p.cells)).collect();
    assert_eq!(cells, [(16.0, 1 << 20), (8.0, 1 << 22)]);
    assert_eq!((plan.source, plan.fits, plan.spacing_factor_fits), (Source::Pilots, true, None));
    assert_eq!((plan.time_cpu_s, plan.pilots[0].time_cpu_s), (5.0, 3.0));
    let words = ROUGH as u64 * 8 + WORDS_HEADER;
    assert!(plan.words_bytes[0].abs_diff(words) <= 8, "{:?}", plan.words_bytes);
    assert!(plan.tree_bytes.abs_diff((ROUGH * TREE_BYTES_PER_CELL) as u64) <= 1);
    plan.check_invariants();
    let corruptions: [&dyn Fn(&mut Plan); 7] = [
        &|p| p.fits = false,
        &|p| p.spacing_factor_fits = Some(2.0),
        &|p| _ = p.memory_peak_bytes.pop(),
        &|p| p.words_bytes[0] /= 3,
        &|p| p.time_cpu_s = f64::NAN,
        &|p| p.pilots.reverse(),
        &|p| p.source = Source::Mesh,
    ];
    for (number, corrupt) in corruptions.into_iter().enumerate() {
        let mut wrong = plan.clone();
        corrupt(&mut wrong);
        let check = std::panic::catch_unwind(|| wrong.check_invariants());
        assert!(check.is_err(), "corruption {number}");
    }
    // What is written takes time.
    let output = Output { directory: "m".into(), words: true, tree: true };
    let pilot = &mut |shift| Ok(amounts(ROUGH, 1.0, shift));
    let written = with_problem(13, &[], |problem| {
        of_case(&Problem { output: Some(&output), ..copy(problem) }, pilot)
    });
    let more = written.unwrap().time_cpu_s - plan.time_cpu_s;
    assert!((more - 6.5e-9 * ROUGH).abs() < 1e-6, "{more}");
    // Fewer cells than the areas suggest: the next pilots are finer, and the mesh itself if it is small.
    assert_eq!(planned(ROUGH / 16.0, 1.0).1, [4, 2, 1]);
    let (plan, asked) = planned(ROUGH / 64.0, 1.0);
    assert_eq!((plan.source, plan.cells, asked), (Source::Mesh, 1 << 22, vec![4, 0]));
    // More cells: the finer one is one level finer in any case.
    assert_eq!(planned(ROUGH * 64.0, 1.0).1, [4, 3]);
}

#[test]
fn the_least_factor_that_fits_is_found() {
    let (plan, _) = planned(ROUGH, 1e18);
    assert!(!plan.fits);
    let factor = plan.spacing_factor_fits.expect("a spacing fits");
    assert_eq!(plan.spacing_min_fits, Some(0.5 * factor));
    let left = plan.tightest.expect("memory is limited").left_bytes as f64;
    // The pilot has 1e18 / 64 bytes already.
    let more = |factor: f64| 1e18 / (factor * factor) - 1e18 / 64.0;
    assert!(more(factor) <= left && more(factor / 2.0) > left, "{factor} for {left} bytes");
    let grown = plan.memory_peak_bytes[0] as f64 / (1e18 * 63.0 / 64.0);
    assert!((grown - 1.0).abs() < 1e-6, "{grown}");
}

#[test]
fn only_runs_that_may_not_fit_are_planned_and_refused() {
    let unasked = &mut |_| panic!("no pilot is needed");
    // The extent makes it large, but not its area.
    with_problem(10, &[], |problem| {
        assert!(!problem.is_small());
        assert_eq!(before_run(problem, unasked), Ok(()));
    });
    // Level 19: 4096 times as many cells as at level 13 take more than half of any memory.
    with_problem(19, &[], |problem| {
        let mut pilots = 0;
        let few = &mut |shift| {
            pilots += 1;
            Ok(amounts(ROUGH, 1.0, shift))
        };
        assert_eq!(before_run(problem, few), Ok(()));
        assert!(pilots > 1);
        // More cells than a pilot may have: it would be the mesh itself.
        let many = &mut |shift| Ok(amounts(CELLS_PILOT * 64.0, 1e18, shift));
        assert!(matches!(before_run(problem, many), Err(Error::Memory(_))));
    });
    // A small case is meshed.
    let plan =
        with_problem(8, &[], |problem| of_case(problem, &mut |shift| Ok(amounts(9.0, 1.0, shift))));
    let plan = plan.unwrap();
    assert_eq!((plan.source, plan.cells, plan.pilots.len()), (Source::Mesh, 9, 1));
}

fn copy<'a>(problem: &Problem<'a>) -> Problem<'a> {
    Problem { ..*problem }
}

#[test]
fn extents_and_boxes_decide_whether_a_run_is_small() {
    let is_small = |cells: [f64; 3], boxes: &[ExtentBox]| {
        let at = |cells: f64| -0.5 + cells * 2.0 / 1024.0;
        let bounds = Bounds { lo: [-0.5; 3], hi: cells.map(at) };
        let (volumes, rules) = (Volumes::new(boxes), rules(10));
        with_problem(10, &[], |problem| {
            Problem { bounds: &bounds, volumes: &volumes, rules: &rules, ..copy(problem) }
                .is_small()
        })
    };
    // Two times 32e6 cells are the limit; layers add 12 along each axis.
    assert!(is_small([305.0, 305.0, 305.0], &[]) && !is_small([305.0, 306.0, 308.0], &[]));
    // 4 x 1024 x 1024 cells of level 10 in each of eight.
    let slab = |thickness: i64| ExtentBox {
        min: [0; 3],
        max: [thickness * edge(10), ROOT_EDGE, ROOT_EDGE],
        level: 10,
    };
    assert!(is_small([0.0; 3], &[slab(30)]) && !is_small([0.0; 3], &[slab(31)]));
    assert!(!is_small([101.0; 3], &[slab(30)]), "both are added");
}

#[test]
fn pilots_of_runs_that_cannot_fit_are_short() {
    assert_eq!(cells_max([6.4e9, 0.0], 100.0, 0.0), 1e8);
    assert_eq!(cells_max([2e11, 0.0], 100.0, 0.0), 1e9);
    assert_eq!(cells_max([6.4e9, 0.0], 101.0, 0.0), 2.1e6);
    assert_eq!(cells_max([6.4e8, 0.0], 1.0, 0.0), 1e7);
    assert_eq!(cells_max([6.4e8, 0.0], 1.0, 2e7), 2e7);
    let ranks = Ranks::gather(&Solo, Amounts::default(), 0);
    let left = ranks.tightest(&[1.0]).expect("memory is limited").left_bytes as f64;
    assert!((used(&ranks, left) - BYTES_ROUGH).abs() < 1e-6);
}

/// The sums over the ranks of pilots that are coarser by 2, 1 and 0 levels.
fn pilots(ranks: usize) -> (Vec<Amounts>, f64) {
    let options = options();
    let on_rank = |comm: &dyn Comm| {
        let quantised =
            mesher::quantised(&case(), &mut Job::new(&options, comm, &mut Recorder::default()))
                .unwrap();
        let volumes = Volumes::new(&quantised.rules.boxes);
        let run = |shift| pilot(&quantised, &volumes, shift, &options, comm).unwrap();
        ([2, 1, 0].map(run), volumes.cells())
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
    for time in [mesh.time_refine_s, mesh.time_sides_s, mesh.time_leaves_s] {
        assert!(time > 0.0 && time < 0.95 * mesh.time_cpu_s(), "{mesh:?}");
    }
    let counted = |a: &Amounts| {
        [a.cells, a.cells_boxed_deleted, a.tests, a.components, a.bytes_sides, a.bytes_graded]
    };
    // These repeat exactly: a change of what is counted shows here.
    assert_eq!(counted(&mesh), [764868.0, 27894.96431997696, 22726.6, 20723.0, 313493.0, 195327.0]);
    assert!(mesh.cells_boxed_deleted > 1000.0 && mesh.cells > 1e5, "{mesh:?}");
    let pilots = Pilots { fine: (1, fine), coarse: Some((2, coarse)), cells_boxed };
    let predicted = pilots.at(0);
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
        let options = options();
        let quantised =
            mesher::quantised(&case, &mut Job::new(&options, &Solo, &mut Recorder::default()))?;
        pilot(&quantised, &Volumes::new(&[]), shift, &options, &Solo)
    };
    // The sphere has radius 0.5, a pilot that is coarser by three levels has cells of 0.0625.
    assert!(run(0.53, 3).is_ok() && run(0.7, 3).is_ok());
    assert!(matches!(run(0.5, 0), Err(Error::Input(_))));
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
