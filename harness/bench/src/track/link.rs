//! Addresses of commits on the web.

use std::path::Path;
use std::process::Command;

/// Placeholder for the hash of a commit.
pub const COMMIT: &str = "{commit}";

/// Returns the address of commits, with [`COMMIT`], from the remote `origin` of a repository; `None` without such a remote
/// or if it is not on a web host.
pub fn of_repository(repository: &Path) -> Option<String> {
    let mut git = Command::new("git");
    git.arg("-C").arg(repository).args(["remote", "get-url", "origin"]);
    let output = git.output().ok().filter(|output| output.status.success())?;
    of_remote(String::from_utf8_lossy(&output.stdout).trim())
}

/// The form of addresses that GitHub, GitLab, Gitea and others share.
fn of_remote(remote: &str) -> Option<String> {
    let remote = remote.trim_end_matches('/').trim_end_matches(".git");
    let place = match remote.split_once("://") {
        Some(("https" | "http" | "ssh", rest)) => {
            // Neither a password nor a port belongs in a link.
            let (host, path) = rest.split_once('/')?;
            let host = host.rsplit('@').next()?.split(':').next()?;
            format!("{host}/{path}")
        }
        Some(_) => return None,
        None => {
            let (host, path) = remote.split_once(':')?;
            let host = host.rsplit('@').next()?;
            if host.contains('/') {
                return None;
            }
            format!("{host}/{path}")
        }
    };
    Some(format!("https://{place}/commit/{COMMIT}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remotes_of_all_forms_have_the_same_address() {
        let expected = Some("https://host.org/a/b/commit/{commit}".to_owned());
        for remote in [
            "https://host.org/a/b.git",
            "https://name:secret@host.org/a/b",
            "git@host.org:a/b.git",
            "ssh://git@host.org:2222/a/b.git",
        ] {
            assert_eq!(of_remote(remote), expected, "{remote}");
        }
        for remote in ["/srv/git/b.git", "../b", "file:///srv/b.git", ""] {
            assert_eq!(of_remote(remote), None, "{remote}");
        }
    }
}
