//! The command line of a run, assembled from the templates of an engine file.

use super::failure::End;
use super::launcher::Launcher;
use super::layout::{Layout, Ranks};
use super::options::RunOptions;
use super::placeholders::{LAUNCHER, Values, fill};
use super::templates::Templates;
use std::path::Path;
use std::process::Command;

/// The command of a run; `values` are those of the placeholders that the engine defines.
///
/// # Errors
/// [`End::Missing`] if the engine file has no template for it.
pub(super) fn assemble(
    templates: &Templates,
    launcher: &Launcher,
    mut values: Values,
    case: &Path,
    layout: &Layout,
    options: &RunOptions,
) -> Result<Command, End> {
    add_values_of_run(&mut values, case, layout, options);
    let mut words = base_words(templates, layout.ranks, launcher)?;
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

fn add_values_of_run(values: &mut Values, case: &Path, layout: &Layout, options: &RunOptions) {
    let text = |path: &Path| path.to_string_lossy().into_owned();
    values.extend([
        ("case", text(case)),
        ("ranks", layout.ranks.count().to_string()),
        ("threads", layout.threads.unwrap_or(1).to_string()),
        ("json", text(&options.report_path())),
        ("status", text(&options.status_path())),
    ]);
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
    let mesh = options.mesh.is_some() || templates.always_writes_mesh();
    let parts = [
        (mesh, templates.out.as_ref()),
        (options.report, templates.json.as_ref()),
        (options.status, templates.status.as_ref()),
        (options.ungraded, templates.ungraded.as_ref()),
        (layout.partitioner.is_some(), templates.partitioner.as_ref()),
        (layout.level_base.is_some(), templates.level_base.as_ref()),
        (layout.weights.is_some(), templates.weights.as_ref()),
        (layout.threads.is_some(), templates.threads.as_ref()),
    ];
    let requested = parts.into_iter().filter(|(needed, _)| *needed);
    Ok(requested.filter_map(|(_, template)| template).flatten().collect())
}
