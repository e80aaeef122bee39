//! The leaf words of a mesh, without files.
#![allow(dead_code, missing_docs)]

use mesher::error::Error;
use mesher::input::case::Case;
use mesher::record::Recorder;
use mesher::sides::Summary;
use mesher::sides::leaks::Leak;
use mesher::{Job, Options, grow, quantised};
use ranks::Comm;

/// The leaf words that this rank owns, in order, a summary of the components and the leaks: phases 1 to 8, and no report.
/// Collective.
pub fn words(
    case: &Case,
    options: &Options,
    comm: &dyn Comm,
) -> Result<(Vec<u64>, Summary, Vec<Leak>), Error> {
    let mut record = Recorder::default();
    let job = &mut Job::new(options, comm, &mut record);
    let mesh = grow(quantised(case, job)?, job)?;
    let mut words = Vec::new();
    mesh.emit(|w| {
        words.extend_from_slice(w);
        Ok::<(), Error>(())
    })?;
    Ok((words, mesh.sides.summary, mesh.leaks.0))
}
