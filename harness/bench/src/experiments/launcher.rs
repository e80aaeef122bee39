//! How ranks are started: a template, so that the same command runs on a cluster.

use run::engine::mpi;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What stands for the number of ranks in a template.
const RANKS: &str = "{ranks}";

/// A launcher's command line, as in `srun -n {ranks} --cpu-bind=cores`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launcher {
    words: Vec<String>,
}

impl Launcher {
    /// Reads a template: words with blanks between them, `{ranks}` at least once.
    ///
    /// # Errors
    /// What is missing.
    pub fn parse(text: &str) -> Result<Self, String> {
        let words: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
        match words.iter().any(|w| w.contains(RANKS)) {
            true => Ok(Self { words }),
            false => Err(format!(
                "`{text}` does not say where the number of ranks goes: write {RANKS} there"
            )),
        }
    }

    /// The launcher's program.
    pub fn program(&self) -> PathBuf {
        PathBuf::from(&self.words[0])
    }

    /// Whether that program is there to be run.
    pub fn is_found(&self) -> bool {
        let program = Path::new(&self.words[0]);
        let named = program.components().count() == 1;
        if named {
            run::engine::paths::on_path(&self.words[0]).is_some()
        } else {
            program.is_file()
        }
    }

    /// The command that runs `program` on `ranks`; its arguments are the caller's to add.
    pub fn command(&self, ranks: usize, program: impl AsRef<OsStr>) -> Command {
        let mut words = self.words.iter().map(|w| w.replace(RANKS, &ranks.to_string()));
        let mut command = Command::new(words.next().expect("a template has words"));
        command.args(words).arg(program);
        mpi::set_environment(&mut command);
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_template_is_filled_in() {
        let launcher = Launcher::parse("srun -n {ranks} --tasks={ranks}").unwrap();
        let command = launcher.command(16, "mesher");
        let words: Vec<_> = command.get_args().map(|w| w.to_string_lossy().into_owned()).collect();
        assert_eq!(words, ["-n", "16", "--tasks=16", "mesher"]);
        assert_eq!(command.get_program(), "srun");
        assert!(Launcher::parse("mpirun -n 4").unwrap_err().contains("{ranks}"));
    }
}
