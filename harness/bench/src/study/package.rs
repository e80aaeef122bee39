//! A study with its cases, geometries and engines in one directory, so that it can be executed elsewhere.

use super::Study;
use super::judge::of_last_origin;
use crate::experiments::cases::Base;
use crate::experiments::entry::{Line, Run};
use crate::experiments::machine::digest_of_scripts;
use crate::read_toml;
use contract::failure::{Failure, Result};
use contract::files::{self, write_atomically};
use run::engine::paths::Paths;
use run::engine::runner::Engine;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use toml::{Table, Value};

/// Name of the study's file in the directory.
pub const STUDY: &str = "study.toml";

/// Copies a study, and the cases, geometry files and engine files that it names, into a directory. Cases that generate their geometry
/// have none; of an engine's programs and scripts, those in the directory of its file and below are copied.
///
/// # Errors
/// If the study is invalid, a file cannot be read or written, or two files have one name.
pub fn package(study: &Path, paths: &Paths, out: &Path) -> Result<()> {
    let directory = Study::read(study)?.directory;
    let mut table: Table = read_toml(study)?;
    for (key, value) in &mut table {
        let parts: Vec<&mut Value> = match (key.as_str(), value) {
            ("mesh", Value::Table(meshes)) => meshes.iter_mut().map(|(_, mesh)| mesh).collect(),
            ("series", Value::Array(series)) => series.iter_mut().collect(),
            _ => Vec::new(),
        };
        for value in parts {
            let engines = value.get_mut("engines").and_then(Value::as_array_mut);
            for engine in engines.into_iter().flatten() {
                if let Value::String(file) = engine
                    && file.ends_with(".toml")
                {
                    let path = directory.join(&*file);
                    copy_engine(&path, paths, out)?;
                    *file = file_name(&path);
                }
            }
            let Some(Value::String(case)) = value.get_mut("case") else { continue };
            let path = paths.catalogue.case_file(case, &directory)?;
            *case = file_name(&path);
            let mut of_case: Table = read_toml(&path)?;
            if let Some(Value::String(geometry)) = of_case.get_mut("geometry") {
                let body = path.with_file_name(&*geometry);
                *geometry = file_name(&body);
                copy(&body, &out.join(&*geometry))?;
            }
            put(&out.join(&*case), of_case.to_string().as_bytes())?;
        }
    }
    put(&out.join(STUDY), table.to_string().as_bytes())
}

/// Requires that a study made a record: that it asks for all of its runs, and that the last of them were of the cases, geometries and scripts
/// that it names. Returns the runs that it asks for and the record lacks, a sentence each.
///
/// # Errors
/// One sentence with a run of another study, or with a case or a program that is not the same.
pub fn require_made(study: &Study, lines: &[Line], paths: &Paths) -> Result<Vec<String>> {
    if let Some(setup) = lines.iter().find_map(|line| study.unasked(line)) {
        let why = "the record has a run that the study does not ask for";
        return Err(Failure::input(format!("{why}, {setup}: give the study that made it")));
    }
    let place = tempfile::tempdir()?;
    let last = of_last_origin(lines);
    let of_run = |run: &Run| {
        let (case, ..) = study.source(&run.setup).expect("the study asks for it");
        (case, run.setup.experiment.clone(), run.inputs.clone())
    };
    let made: BTreeSet<_> = last.iter().filter_map(Line::run).map(of_run).collect();
    for (case, experiment, inputs) in made {
        let path = paths.catalogue.case_file(case, &study.directory)?;
        let base = Base::read(&path, None, place.path())?;
        let why = format!("{case}: runs of {experiment} have other rules or geometry: repeat them");
        Failure::unless(base.inputs == inputs, why)?;
    }
    for name in study.engines().iter().filter(|name| name.ends_with(".toml")) {
        let Ok(engine) = Engine::find(name, None, paths) else { continue };
        let scripts = digest_of_scripts(&engine);
        let is_other = |run: &Run| run.setup.engine == engine.label() && run.scripts != scripts;
        let is_other = last.iter().filter_map(Line::run).any(is_other);
        Failure::unless(!is_other, format!("{name}: its program is not that of the record"))?;
    }
    study.lacking(&last, paths)
}

/// Copies an engine file with the program and the scripts beside it. What it runs from elsewhere is of the machine.
fn copy_engine(path: &Path, paths: &Paths, out: &Path) -> Result<()> {
    copy(path, &out.join(file_name(path)))?;
    let engine = Engine::find(&path.to_string_lossy(), None, paths)?;
    for file in engine.files() {
        let Ok(below) = file.strip_prefix(&engine.description.here) else { continue };
        let to = out.join(below);
        fs::create_dir_all(to.parent().unwrap_or(out))?;
        copy(&file, &to)?;
        fs::set_permissions(&to, fs::metadata(&file)?.permissions())?;
    }
    Ok(())
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Copies a file, which must be no pipe: it would be waited for.
///
/// # Errors
/// If it cannot be read or written, or the place has another file.
pub fn copy(from: &Path, to: &Path) -> Result<()> {
    put(to, &files::read(from).map_err(|error| Failure::at(from, error))?)
}

/// Writes a file unless another one is there.
fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    let why = format!("{}: two files of the study have this name: rename one", file_name(path));
    Failure::unless(fs::read(path).map_or(true, |before| before == bytes), why)?;
    write_atomically(path, |out| out.write_all(bytes)).map_err(|error| Failure::at(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::entry::{Comm, Entry, NoResult, Setup};
    use crate::experiments::machine::digest_of;
    use crate::testing::{line, run};
    use contract::catalogue::Catalogue;

    fn paths(place: &Path) -> Paths {
        Paths { catalogue: Catalogue { path: place.join("none.toml") }, ..Paths::find() }
    }

    #[test]
    fn a_study_elsewhere_has_its_own_cases() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let (here, there) = (at("here"), at("there"));
        fs::create_dir_all(here.join("bodies")).unwrap();
        fs::create_dir(&there).unwrap();
        let put = |name: &str, text: &str| fs::write(here.join(name), text).unwrap();
        put("bodies/a wing.stl", "solid");
        put("a wing.toml", "spacing_min = 0.1\ngeometry = \"bodies/a wing.stl\"\n");
        put("ball.toml", "spacing_min = 0.1\n[generator]\nshape = \"sphere\"\nfacets = 80\n");
        put(
            "s.toml",
            "[[series]]\nexperiment = \"strong\"\ncase = \"a wing.toml\"\n[[series]]\nexperiment = \"spacing\"\ncase = \"a wing.toml\"\ncells = [1e6]\n\
             [mesh.ball]\ncase = \"ball.toml\"\n",
        );
        package(&here.join("s.toml"), &paths(place.path()), &there).unwrap();
        fs::remove_dir_all(&here).unwrap();
        let study = Study::read(&there.join(STUDY)).unwrap();
        assert_eq!((study.series.len(), study.series[1].case.as_str()), (2, "a wing.toml"));
        assert_eq!(study.mesh["ball"].case, "ball.toml");
        assert_eq!(fs::read_to_string(there.join("a wing.stl")).unwrap(), "solid");
        assert!(
            read_toml::<Table>(&there.join("a wing.toml")).unwrap()["geometry"].as_str()
                == Some("a wing.stl")
        );
        assert!(there.join("ball.toml").is_file());
    }

    #[test]
    fn a_study_elsewhere_has_its_own_engines() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir_all(at("here/bin")).unwrap();
        fs::create_dir(at("there")).unwrap();
        let put = |name: &str, text: &str| fs::write(at(name), text).unwrap();
        put("here/ball.toml", "spacing_min = 0.1\n[generator]\nshape = \"sphere\"\nfacets = 80\n");
        put("here/bin/mesh.sh", "true");
        put("here/e.toml", "[run]\nserial = ['sh', '{here}/bin/mesh.sh', '{case}', '{out}']\n");
        put(
            "here/s.toml",
            "[[series]]\nexperiment = 'strong'\ncase = 'ball.toml'\nengines = ['mesher', 'e.toml']\n",
        );
        package(&at("here/s.toml"), &paths(place.path()), &at("there")).unwrap();
        fs::remove_dir_all(at("here")).unwrap();
        let study = Study::read(&at("there").join(STUDY)).unwrap();
        let engine = Engine::find(&study.series[0].engines[1], None, &Paths::find()).unwrap();
        assert!(engine.files().contains(&at("there/bin/mesh.sh").canonicalize().unwrap()));
    }

    /// The lines of runs of the generated case `ball`.
    /// Runs of `ball.toml` in a directory.
    fn of_ball(place: &Path, runs: &[Run]) -> Vec<Line> {
        let Base { inputs, .. } = Base::read(&place.join("ball.toml"), None, place).unwrap();
        let of = |run: &Run| {
            let run = Run { inputs: inputs.clone(), ..run.clone() };
            let case = if run.setup.case == "a" { "a" } else { "ball" }.to_owned();
            line(Entry::Run(Box::new(Run { setup: Setup { case, ..run.setup.clone() }, ..run })))
        };
        runs.iter().map(of).collect()
    }

    const BALL: &str = "spacing_min = 0.1\n[generator]\nshape = \"sphere\"\nfacets = 80\n";

    #[test]
    fn runs_that_a_record_lacks_are_named() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("ball.toml"), BALL).unwrap();
        let series = |of: &str| format!("[[series]]\ncase = 'ball.toml'\nexperiment = {of}\n");
        let strong = series("'strong'\ncells = [1e4, 1e5]\nsim = [1, 2]");
        let rows = "[mesh.a]\ncase = 'ball.toml'\n[run]\none = { mesh = 'a' }\ntwo = { mesh = 'a' }\n\
                    [[row]]\nname = 'r'\nrun = 'one'\nmeasure = 'seconds'\n";
        let file = place.path().join("s.toml");
        let spacing = series("'spacing'\ncells = [4e5]");
        let same = strong.replace("[1, 2]", "[2, 1]");
        fs::write(&file, strong + &same + &spacing + rows).unwrap();
        let study = Study::read(&file).unwrap();
        let mesh = |ranks: usize, spacing_min: f64, cells| {
            let mut run = run(Comm::Sim, cells, &[("a", &vec![1.0; ranks])]);
            (run.setup.weights, run.setup.partitioner) = Default::default();
            Run { setup: Setup { spacing_min, ..run.setup }, ..run }
        };
        let spaced = |spacing_min: f64| {
            let mut run = mesh(1, spacing_min, 400_000);
            (run.setup.experiment, run.setup.comm) = ("spacing".into(), Comm::Solo);
            run.setup.series_cells = Some(4e5);
            run
        };
        let mut row = mesh(1, 0.1, 9);
        row.setup = Setup { case: "a".into(), ..study.run["one"].setup(0.1, 4) };
        let strong = [[1, 2].map(|n| mesh(n, 0.1, 10_000)), [1, 2].map(|n| mesh(n, 0.03, 100_000))];
        let all = [&strong.concat()[..], &[spaced(0.1), spaced(0.05)]].concat();
        let lacking = |runs: &[Run]| {
            let lines = of_ball(place.path(), &[runs, std::slice::from_ref(&row)].concat());
            require_made(&study, &lines, &paths(place.path())).unwrap()
        };
        assert_eq!(lacking(&all), [""; 0]);
        let is_not = |of: &str| format!("{of} is not in the record");
        assert_eq!(
            lacking(&all[..3]),
            [
                "mesher ball strong n=4 sim:2 default",
                "mesher ball spacing of 4e5 n=4 solo:1 default",
                "mesher ball spacing of 4e5 n=4 solo:1 default"
            ]
            .map(is_not)
        );
        // A warm-up is no result.
        let warm = Run { warm_up: true, ..spaced(0.05) };
        let with_warm = [&all[..5], &[warm]].concat();
        assert_eq!(lacking(&with_warm), [is_not("mesher ball spacing of 4e5 n=4 solo:1 default")]);
        let without_row =
            require_made(&study, &of_ball(place.path(), &all), &paths(place.path())).unwrap();
        assert_eq!(without_row, [is_not("the run one")]);
        // What failed is named as such.
        let failed = NoResult { setup: row.setup.clone(), why: "no memory".into() };
        let lines = [of_ball(place.path(), &all), vec![line(Entry::Failure(failed))]].concat();
        assert_eq!(require_made(&study, &lines, &paths(place.path())), Ok(vec![]));
    }

    /// A program of this machine is another one elsewhere.
    #[test]
    fn a_script_that_was_edited_is_not_that_of_the_record() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let put = |name: &str, text: &str| fs::write(at(name), text).unwrap();
        put("ball.toml", BALL);
        put("mesh.sh", "true");
        put(
            "s.toml",
            "[[series]]\nexperiment = 'strong'\ncase = 'ball.toml'\nengines = ['e.toml']\n",
        );
        let made = |words: &str, edited: &str| {
            put("e.toml", &format!("{words}, '{{case}}', '{{out}}']\n"));
            put("mesh.sh", "true");
            let study = Study::read(&at("s.toml")).unwrap();
            let engine = Engine::find(&study.series[0].engines[0], None, &Paths::find()).unwrap();
            let mut run = run(Comm::Solo, 9, &[("a", &[1.0])]);
            (run.setup.weights, run.setup.partitioner) = Default::default();
            (run.setup.engine, run.program) = ("e".into(), digest_of(engine.files()));
            run.scripts = digest_of_scripts(&engine);
            put("mesh.sh", edited);
            require_made(&study, &of_ball(place.path(), &[run]), &paths(place.path()))
        };
        let own = "program = '{here}/mesh.sh'\n[run]\nserial = ['{program}'";
        let interpreted = "[run]\nserial = ['sh', '{here}/mesh.sh'";
        for words in [own, interpreted] {
            assert_eq!(made(words, "true"), Ok(vec![]));
            let why = made(words, "false").unwrap_err().why;
            assert!(why.contains("e.toml: its program is not that of the record"), "{why}");
        }
    }

    #[test]
    fn two_files_of_one_name_are_refused() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for directory in ["a", "b", "out"] {
            fs::create_dir(at(directory)).unwrap();
        }
        fs::write(at("a/ball.toml"), "spacing_min = 0.1\n").unwrap();
        fs::write(at("b/ball.toml"), "spacing_min = 0.2\n").unwrap();
        let package = |second: &str| {
            let mesh =
                |name: &str, case: &str| format!("[mesh.{name}]\ncase = '{case}/ball.toml'\n");
            let series = "[[series]]\nexperiment = 'strong'\ncase = 'a/ball.toml'\n";
            let text = series.to_owned() + &mesh("one", "a") + &mesh("two", second);
            fs::write(at("s.toml"), text).unwrap();
            package(&at("s.toml"), &paths(place.path()), &at("out"))
        };
        assert_eq!(package("a"), Ok(()));
        assert!(package("b").unwrap_err().why.contains("rename one"));
    }
}
