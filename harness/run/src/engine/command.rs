//! The command line of a run, assembled from the templates of an engine file.

use super::description::{LAUNCHER, Templates, Values, fill};
use super::failure::End;
use super::launcher::Launcher;
use super::layout::{Layout, Ranks};
use super::runner::{Engine, RunOptions};
use std::path::Path;
use std::process::Command;

/// The command of a run.
///
/// # Errors
/// [`End::Missing`] if the engine file has no template for it.
pub(super) fn assemble(
    engine: &Engine,
    case: &Path,
    layout: &Layout,
    options: &RunOptions,
) -> Result<Command, End> {
    let templates = &engine.description().run;
    let values = values(engine, case, layout, options);
    let mut words = base_words(templates, layout.ranks, engine.launcher())?;
    words.extend(appended(templates, layout, options)?.into_iter().cloned());
    let mut words = words.iter().map(|word| fill(word, &values));
    let program = words.next().ok_or_else(|| cannot("started", "words in `serial`"))?;
    let mut command = Command::new(program);
    command.args(words);
    for (name, value) in &templates.environment {
        command.env(name, fill(value, &values));
    }
    Ok(command)
}

fn cannot(what: &str, template: &str) -> End {
    End::Missing(format!("cannot be {what}: its engine file has no {template}"))
}

fn values<'a>(engine: &Engine, case: &Path, layout: &Layout, options: &RunOptions) -> Values<'a> {
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let mut values = engine.places().clone();
    values.extend([
        ("program", text(engine.program())),
        ("case", text(case)),
        ("ranks", layout.ranks.count().to_string()),
        ("json", text(&options.report_path())),
        ("status", text(&options.status_path())),
    ]);
    if let Some(mesh) = engine.mesh_path(options) {
        values.insert("out", text(&mesh));
    }
    if let Ranks::Simulated { seed, .. } = layout.ranks {
        values.insert("seed", seed.to_string());
    }
    let choices = [
        ("partitioner", &layout.partitioner),
        ("level_base", &layout.level_base),
        ("weights", &layout.weights),
    ];
    for (name, choice) in choices {
        values.extend(choice.clone().map(|choice| (name, choice)));
    }
    values
}

/// The words that start the engine on these ranks.
fn base_words(
    templates: &Templates,
    ranks: Ranks,
    launcher: &Launcher,
) -> Result<Vec<String>, End> {
    let template = match ranks {
        Ranks::Serial => &templates.serial,
        Ranks::Simulated { .. } => {
            let simulated = templates.simulated.as_ref();
            simulated.ok_or_else(|| cannot("run on simulated ranks", "`simulated` command"))?
        }
        Ranks::Mpi(_) => {
            let parallel = templates.parallel.as_ref();
            parallel.ok_or_else(|| cannot("run on MPI", "`parallel` command"))?
        }
    };
    let expand = |word: &String| match word == LAUNCHER {
        true => launcher.words(ranks.count()).collect(),
        false => vec![word.clone()],
    };
    Ok(template.iter().flat_map(expand).collect())
}

/// The arguments for files and choices. A run report, a status or a choice that the engine does not offer is omitted.
/// A base tree is not, because the final mesh is no substitute for it.
fn appended<'a>(
    templates: &'a Templates,
    layout: &Layout,
    options: &RunOptions,
) -> Result<Vec<&'a String>, End> {
    if options.ungraded && templates.ungraded.is_none() {
        return Err(cannot("stopped at the base tree", "`ungraded`"));
    }
    let mesh = options.mesh.is_some() || templates.json.is_none();
    let parts = [
        (mesh, Some(&templates.out)),
        (options.report, templates.json.as_ref()),
        (options.report && options.message_matrix, templates.message_matrix.as_ref()),
        (options.status, templates.status.as_ref()),
        (options.ungraded, templates.ungraded.as_ref()),
        (layout.partitioner.is_some(), templates.partitioner.as_ref()),
        (layout.level_base.is_some(), templates.level_base.as_ref()),
        (layout.weights.is_some(), templates.weights.as_ref()),
    ];
    let requested = parts.into_iter().filter(|(needed, _)| *needed);
    Ok(requested.filter_map(|(_, template)| template).flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::layout::SERIAL;
    use crate::engine::programs::Programs;
    use std::time::Duration;

    fn words(engine: &Engine, layout: &Layout, options: &RunOptions) -> String {
        let command = engine.command(Path::new("a.toml"), layout, options).unwrap();
        let program = Path::new(command.get_program()).file_name().unwrap();
        let arguments = command.get_args().map(|word| word.to_string_lossy().into_owned());
        let words = arguments.map(|word| match word.ends_with("/mesher") {
            true => "mesher".to_owned(),
            false => word,
        });
        let words: Vec<String> = words.collect();
        format!("{} {}", program.to_string_lossy(), words.join(" "))
    }

    #[test]
    fn our_programs_are_started_with_the_expected_arguments() {
        let programs = Programs::find(Default::default()).unwrap();
        let mesher = programs.mesher.with_launcher(Launcher::parse("mpirun -n {ranks}").unwrap());
        let plain = RunOptions::new(Path::new("p"), Duration::from_secs(1));
        let files = RunOptions {
            mesh: Some(Path::new("mesh")),
            report: false,
            status: true,
            ungraded: true,
            ..plain
        };
        let serial = "mesher a.toml --comm solo --quiet --json p/run.json";
        assert_eq!(words(&mesher, &SERIAL, &plain), serial);
        let simulated = Layout {
            partitioner: Some("metis".into()),
            weights: Some("area".into()),
            ..Layout::on(Ranks::Simulated { ranks: 3, seed: 7 })
        };
        let matrix = RunOptions { message_matrix: true, ..plain };
        let expected = "mesher a.toml --comm sim:3:7 --quiet --json p/run.json --message-matrix \
                        --partitioner metis --weights area";
        assert_eq!(words(&mesher, &simulated, &matrix), expected);
        let on_mpi = Layout { level_base: Some("2".into()), ..Layout::on(Ranks::Mpi(3)) };
        let expected = "mpirun -n 3 mesher a.toml --comm mpi --quiet --out mesh --status p/status \
                        --ungraded --level-base 2";
        assert_eq!(words(&mesher, &on_mpi, &files), expected);
        let reference = "reference a.toml --out mesh --ungraded";
        assert_eq!(words(&programs.reference, &on_serial(&simulated), &files), reference);
    }

    /// The same choices, serially: the reference does not offer them.
    fn on_serial(layout: &Layout) -> Layout {
        Layout { ranks: Ranks::Serial, ..layout.clone() }
    }
}
