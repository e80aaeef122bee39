//! A LaTeX fragment with all figures; machines and commands of a record.

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::samples::{figure, series};
    use crate::figure::{Body, Provenance};

    #[test]
    fn the_fragment_has_captions_and_labels() {
        let text = fragment(&[figure(Body::points(vec![series(Provenance::Measured)]))]);
        assert!(
            text.contains("\\label{fig:speedup}")
                && text.contains("\\input{\\figures/speedup.tex}")
        );
        assert!(text.contains("Speedup \\& \\textless{}more\\textgreater{}"));
    }
}
