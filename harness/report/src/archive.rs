//! The metadata of an archive that can be replayed: an RO-Crate 1.1 (Research Object Crate).

use crate::benchmark::machines;
use bench::experiments::entry::{Line, now_utc};
use bench::order::{by_key, distinct};
use bench::replay::{Expected, TOLERANCE};
use bench::shown;
use bench::study::package;
use contract::number::duration;
use serde_json::{Value, json};

/// Name of the metadata's file, which the standard gives.
pub const METADATA: &str = "ro-crate-metadata.json";

/// All records.
pub const RECORD: &str = "record.jsonl";
/// The values that a repetition must give, with their bands.
pub const EXPECTED: &str = "expected.json";
/// Directory of the study, its cases and geometries.
pub const STUDY: &str = "study";
/// The entity of the author.
const AUTHOR: &str = "#author";

/// A file of the archive: its path, with `/` between directories, and its size in bytes.
pub type Member = (String, u64);

/// What the author says of the archive.
#[derive(Clone, Debug, clap::Args)]
pub struct About {
    /// Title of the archive
    #[arg(long, value_parser = clap::builder::NonEmptyStringValueParser::new())]
    pub title: String,
    /// Whoever made it
    #[arg(long, value_name = "NAME", value_parser = clap::builder::NonEmptyStringValueParser::new())]
    pub author: String,
    /// Its licence: an identifier of the list of SPDX, such as CC-BY-4.0, or an address
    #[arg(long, value_name = "SPDX|URL", value_parser = licence)]
    pub licence: String,
    /// The day, such as `2026-01-31`
    #[arg(skip = now_utc()[.."2026-01-31".len()].to_owned())]
    pub day: String,
}

/// An address, or an identifier, which becomes part of one.
fn licence(given: &str) -> Result<String, &'static str> {
    let marks = if given.contains("://") { "-.+:/_~%#?=&" } else { "-.+" };
    let fits = |c: char| c.is_ascii_alphanumeric() || marks.contains(c);
    let why = "it is no identifier of https://spdx.org/licenses, such as CC-BY-4.0, and no address";
    if !given.is_empty() && given.chars().all(fits) { Ok(given.to_owned()) } else { Err(why) }
}

/// The metadata: files with their sizes, sessions with command, machine and time, programs with their digests.
pub fn metadata(about: &About, members: &[Member], lines: &[Line]) -> Value {
    let place = if about.licence.contains("://") { "" } else { "https://spdx.org/licenses/" };
    let (licence, id) = (format!("{place}{}", about.licence), |id: &str| json!({ "@id": id }));
    let file = |(path, bytes): &Member| json!({"@id": address(path), "@type": "File", "name": path, "contentSize": bytes.to_string()});
    let files: Vec<Value> = members.iter().map(file).collect();
    let of_run = |line: &&Line| {
        let run = line.run().filter(|run| !run.program.is_empty())?;
        Some((run.setup.engine.clone(), run.program.clone()))
    };
    let programs = |of: &[&Line]| distinct(of.iter().filter_map(of_run));
    let program_id = |digest: &str| format!("#program-{digest}");
    let program = |(engine, digest): &(String, String)| {
        json!({"@id": program_id(digest), "@type": "SoftwareApplication", "name": engine, "identifier": digest,
            "description": "The identifier is the digest of the program's files."})
    };
    let sessions = by_key(lines, |line| line.session.as_str());
    let action = |(name, of): &(&str, Vec<&Line>)| {
        let opening = of.iter().find_map(|line| line.session())?;
        let used = programs(of).into_iter().map(|(_, digest)| id(&program_id(&digest)));
        Some(json!({
            "@id": format!("#session-{name}"), "@type": "CreateAction",
            "name": shown(&opening.command),
            "description": opening.machine.to_string(),
            "startTime": of.first()?.time_utc, "endTime": of.last()?.time_utc,
            "instrument": used.collect::<Vec<_>>(), "object": id(&format!("{STUDY}/{}", package::STUDY)), "result": id(RECORD),
        }))
    };
    let actions: Vec<Value> = sessions.iter().filter_map(action).collect();
    let ids = |of: &[Value]| of.iter().map(|e| json!({"@id": e["@id"]})).collect::<Vec<_>>();
    let root = json!({
        "@id": "./", "@type": "Dataset", "name": about.title, "datePublished": about.day, "license": id(&licence),
        "description": "Benchmarks of oct-tree meshers: the record, its figures, the study that made it, and what a repetition must give",
        "author": id(AUTHOR), "hasPart": ids(&files), "mentions": ids(&actions),
    });
    let head = json!({
        "@id": METADATA, "@type": "CreativeWork", "about": id("./"),
        "conformsTo": id("https://w3id.org/ro/crate/1.1"),
    });
    let of_licence = json!({
        "@id": licence, "@type": "CreativeWork", "name": about.licence,
        "description": "The licence of this archive; those of geometries are in study/",
    });
    let author = json!({"@id": AUTHOR, "@type": "Person", "name": about.author});
    let programs = programs(&lines.iter().collect::<Vec<_>>()).iter().map(program).collect();
    let graph = [vec![head, root, of_licence, author], files, programs, actions].concat();
    json!({"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph})
}

/// The page for whoever opens the archive.
pub fn readme(about: &About, lines: &[Line], expected: &Expected) -> String {
    let About { title, author, licence, day } = about;
    let machines = machines(lines);
    let measured = machines.iter().map(|machine| format!("Measured on {machine}.\n"));
    let commits = machines.iter().map(|machine| machine.commit.trim_end_matches("-dirty"));
    let missing = expected.missing.iter().map(|why| format!("\nMissing of the study: {why}\n"));
    format!(
        "# {title}\n\n{author}, {day}, licence {licence}.\n\n{}\nTo repeat it, in a clone of the programs' repository at commit {}:\n\n```\nharness replay THIS_DIRECTORY\n```\n\n\
         It prints expected values beside measured ones: digests, cells and counters must be equal; ratios (speedup, efficiency, load \
         imbalance, bytes per cell) lie within the interval of their repetitions and {:.0} % beyond it; times are those of a machine, and \
         are not compared. All runs took {}, and one run of each {}.\n\n\
         `study/` has the study with its cases, geometries and engines, `record.jsonl` every run, `expected.json` the values and bands.\n{}",
        measured.collect::<String>(),
        distinct(commits).join(" or "),
        TOLERANCE * 100.0,
        duration(expected.seconds),
        duration(expected.seconds_once),
        missing.collect::<String>()
    )
}

/// A path as a relative address: bytes other than `A` to `Z`, `a` to `z`, digits and `/._-` are escaped.
fn address(path: &str) -> String {
    let escape = |byte: u8| match byte.is_ascii_alphanumeric() || b"/._-".contains(&byte) {
        true => char::from(byte).to_string(),
        false => format!("%{byte:02X}"),
    };
    path.bytes().map(escape).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench::experiments::entry::{Comm, Entry, Machine, Session};
    use bench::testing::{line, run};

    #[test]
    fn a_licence_that_would_be_no_address_is_refused() {
        for good in ["CC-BY-4.0", "GPL-2.0+", "https://a.b/c_d~e?f=1#g"] {
            assert_eq!(licence(good).unwrap(), good);
        }
        for wrong in ["", "CC BY 4.0", "MIT OR Apache-2.0", "file:// a", "(c) me", "a/b"] {
            assert!(licence(wrong).unwrap_err().contains("spdx.org"), "{wrong}");
        }
    }

    #[test]
    fn every_entity_that_is_named_is_described() {
        let command = vec!["harness".into(), "bench".into(), "my study.toml".into()];
        let machine =
            Machine { cpu: "chip".into(), commit: "abc-dirty".into(), ..Machine::default() };
        let (nodes, lacks) = (String::new(), Default::default());
        let session = Session { command, machine, nodes, load_average: 0.0, lacks };
        let mut measured = run(Comm::Solo, 1000, &[("a", &[1.0])]);
        measured.program = "7".repeat(32);
        let lines = [Entry::Session(Box::new(session)), Entry::Run(Box::new(measured))].map(line);
        let about = About {
            title: "T".into(),
            author: "A".into(),
            licence: "CC-BY-4.0".into(),
            day: "2026-01-31".into(),
        };
        let members = [("record.jsonl".to_owned(), 9), ("study/a wing_1.stl".to_owned(), 8)];
        let crate_ = metadata(&about, &members, &lines);
        let graph = crate_["@graph"].as_array().unwrap();
        let ids: Vec<&str> = graph.iter().map(|entity| entity["@id"].as_str().unwrap()).collect();
        assert!(ids.contains(&"study/a%20wing_1.stl"), "{ids:?}");
        let lists = ["hasPart", "mentions"].map(|key| graph[1][key].as_array().unwrap());
        let named = lists.into_iter().flatten().chain([&graph[1]["author"]]);
        for part in named {
            assert!(ids.contains(&part["@id"].as_str().unwrap()), "{part}");
        }
        let action = graph.last().unwrap();
        assert_eq!(action["name"], "harness bench 'my study.toml'");
        assert_eq!(action["instrument"][0]["@id"], format!("#program-{}", "7".repeat(32)));
        let text = readme(&about, &lines, &Expected::of(&lines).unwrap());
        assert!(text.contains("at commit abc:") && text.contains("chip"), "{text}");
    }
}
