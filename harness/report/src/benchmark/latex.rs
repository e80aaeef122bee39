//! A LaTeX fragment with all figures, and a draft of an artifact description.

use crate::figure::Figure;
use crate::figure::tex::{PREAMBLE, escape};
use bench::experiments::entry::{Line, Machine, Session};
use bench::order::distinct;
use std::fmt::Write;

/// The figures with captions and labels, for `\input` in a document.
pub fn fragment(figures: &[Figure]) -> String {
    let mut out = format!(
        "% Made by `harness report`. Requires {PREAMBLE}.\n\
         % \\figures is the directory of the .tex files and of the .csv files that they read.\n\
         \\providecommand{{\\figures}}{{figures}}\n"
    );
    for f in figures {
        let _ = write!(
            out,
            "\n\\begin{{figure}}\n  \\centering\n  \\input{{\\figures/{id}.tex}}\n  \\caption{{{caption}}}\n  \\label{{fig:{id}}}\n\\end{{figure}}\n",
            id = f.id,
            caption = escape(&f.caption)
        );
    }
    out
}

/// The machines of a record, without repetitions.
pub fn machines(lines: &[Line]) -> Vec<Machine> {
    distinct(lines.iter().filter_map(Line::session).map(|session| session.machine.clone()))
}

/// The command lines of the sessions, without repetitions and without absolute directories.
pub fn commands<'a>(lines: &'a [Line]) -> Vec<String> {
    let without_directory = |word: &'a String| match word.starts_with('/') {
        true => word.rsplit('/').next().unwrap_or(word),
        false => word,
    };
    let command = |session: &'a Session| {
        let words = session.command.iter().map(without_directory);
        shlex::try_join(words).expect("an argument of a process has no zero bytes")
    };
    distinct(lines.iter().filter_map(Line::session).map(command))
}

/// A draft of the artifact description and evaluation that the conference SC requires, in Markdown.
pub fn artifact(figures: &[Figure], lines: &[Line]) -> String {
    let mut out = String::from(
        "# Artifact description (draft)\n\n## Contribution\n\nA parallel (MPI) off-body hexahedral oct-tree mesher and the \
        harness that verifies and measures it.\n\n## Machines and software\n\n",
    );
    for machine in machines(lines) {
        let _ = writeln!(out, "- {machine}\n");
    }
    out.push_str(
        "`Cargo.lock` has the exact versions of all libraries. The repository generates all geometry.\n\n## Building\n\n```sh\nci/setup\n\
         cargo build --release --workspace --features mesher/mpi,harness/figures\n```\n\n## Experiments\n\n```sh\n",
    );
    for command in commands(lines) {
        let _ = writeln!(out, "{command}");
    }
    out.push_str("```\n\n## Results\n\nEvery figure, with its values as CSV:\n\n");
    for f in figures {
        let _ = writeln!(out, "- `figures/{}` ({}): {}", f.id, f.title, f.caption);
    }
    out.push_str(
        "\n## Evaluation\n\nThe record has the digest of every mesh. `harness bench` reports a failure if two runs of one mesh have \
         different digests. Times depend on the machine; counters (messages, bytes, octants, leaves per rank) repeat exactly.\n",
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::samples::{figure, series};
    use crate::figure::{Body, Provenance};
    use bench::experiments::entry::Entry;

    #[test]
    fn the_fragment_has_captions_and_labels() {
        let text = fragment(&[figure(Body::points(vec![series(Provenance::Measured)]))]);
        assert!(
            text.contains("\\label{fig:speedup}")
                && text.contains("\\input{\\figures/speedup.tex}")
        );
        assert!(text.contains("Speedup \\& \\textless{}more\\textgreater{}"));
    }

    #[test]
    fn the_artifact_description_has_versions_and_commands() {
        let machine = Machine {
            cpu: "A Chip".into(),
            compiler: "rustc 1.95.0".into(),
            commit: "abc".into(),
            ..Machine::default()
        };
        let session = bench::experiments::entry::Session {
            command: vec![
                "/opt/x/harness".into(),
                "bench".into(),
                "--launcher".into(),
                "srun -n {ranks}".into(),
            ],
            machine,
            load_average: 0.0,
            lacks: Default::default(),
        };
        let line = Line {
            schema: String::new(),
            session: String::new(),
            time_utc: String::new(),
            entry: Entry::Session(Box::new(session)),
        };
        let text = artifact(&[], &[line.clone(), line]);
        assert!(text.contains("A Chip") && text.contains("rustc 1.95.0"));
        assert_eq!(text.matches("harness bench --launcher 'srun -n {ranks}'").count(), 1);
    }
}
