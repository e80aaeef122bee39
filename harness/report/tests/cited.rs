//! Every number, figure and section that a sentence about the paper has is in `reports/paper.md`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

const PAGE: &str = include_str!("../../../reports/paper.md");

/// The text of a file that people read: of Rust sources comments and string literals only.
fn prose(name: &str, text: &str) -> String {
    let mut out = String::new();
    let (mut in_string, mut in_block) = (false, false);
    let is_rust = name.ends_with(".rs");
    let marks: &[&str] = if is_rust { &["//!", "///", "//"] } else { &["#"] };
    for line in text.lines() {
        let line = line.trim();
        in_block ^= line.starts_with("```");
        let comment = marks.iter().find_map(|mark| line.strip_prefix(mark));
        match comment {
            Some(comment) if !in_string => out.push_str(comment),
            _ if is_rust => {
                out.push_str(if in_string { "" } else { "\n" });
                let mut last = ' ';
                for c in line.chars() {
                    in_string ^= c == '"' && last != '\\' && last != '\'';
                    out.push(if in_string && c != '"' {
                        c
                    } else if c == '"' {
                        '\n'
                    } else {
                        ' '
                    });
                    last = c;
                }
                // A literal that goes on, whose backslash joins the lines.
                out = out.trim_end_matches('\\').to_owned();
            }
            _ => out.push_str(line),
        }
        out.push_str(if line.is_empty() || in_block || name.ends_with(".toml") {
            "\n\n"
        } else {
            " "
        });
    }
    out
}

/// The sentences about the paper.
fn sentences(text: &str) -> Vec<String> {
    let ends = [". ", "; ", ": ", "\n", " | ", ".)"];
    let marked = ends.iter().fold(text.to_owned(), |text, end| text.replace(end, "\u{0}"));
    let is_about = |s: &&str| {
        let words = s.split(|c: char| !c.is_alphanumeric());
        words.into_iter().any(|word| ["paper", "Karman", "papers"].contains(&word))
    };
    marked.split('\u{0}').filter(is_about).map(str::to_owned).collect()
}

/// Numbers, and the roman numerals of sections.
fn tokens(text: &str) -> BTreeSet<String> {
    let mut depth = 0;
    let mut without_braces = String::new();
    for c in text.chars() {
        depth += i32::from(c == '{');
        without_braces.push(if depth > 0 { 'x' } else { c });
        depth -= i32::from(c == '}');
    }
    let separates = |c: char| !(c.is_alphanumeric() || "._,-".contains(c));
    let words = without_braces.split(separates).map(|w| w.trim_matches([',', '.', '-']));
    let number = |w: &str| w.replace(',', "").parse::<f64>().ok().map(|v| v.to_string());
    let roman = |w: &str| {
        let (numeral, part) = w.split_once('.').unwrap_or((w, "A"));
        let is_numeral = !numeral.is_empty() && numeral.chars().all(|c| "IV".contains(c));
        (is_numeral && part.len() == 1 && w.len() > 1).then(|| w.to_owned())
    };
    let is_digit = |w: &&str| w.starts_with(|c: char| c.is_ascii_digit() || "IV".contains(c));
    words.filter(is_digit).filter_map(|w| number(w).or_else(|| roman(w))).collect()
}

fn uncited(name: &str, text: &str, known: &BTreeSet<String>) -> Vec<String> {
    let all = sentences(&prose(name, text));
    let wrong = |s: &String| {
        let unknown: Vec<String> = tokens(s).difference(known).cloned().collect();
        (!unknown.is_empty()).then(|| format!("{name}: {unknown:?} in {:?}", s.trim()))
    };
    all.iter().filter_map(wrong).collect()
}

#[test]
fn sentences_about_the_paper_cite_only_what_its_page_lists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let listed = Command::new("git").arg("ls-files").current_dir(&root).output();
    // The archive of a release has no history.
    let Ok(listed) = listed.map(|listed| String::from_utf8(listed.stdout).unwrap()) else { return };
    let is_ours = |name: &&str| {
        let read = [".md", ".rs", ".toml", ".py", ".cff"].iter().any(|end| name.ends_with(end));
        // The record's captions are those of its commit, and this file plants mistakes.
        let elsewhere = ["reports/record/", "harness/report/tests/cited.rs"];
        read && !elsewhere.iter().any(|start| name.starts_with(start))
    };
    let known = tokens(PAGE);
    let read = |name: &str| fs::read_to_string(root.join(name)).unwrap_or_default();
    let wrong: Vec<String> = listed
        .lines()
        .filter(is_ours)
        .flat_map(|name| uncited(name, &read(name), &known))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_number_and_a_section_that_are_not_on_the_page_are_noticed() {
    let known = tokens(PAGE);
    let of = |name: &str, text: &str| uncited(name, text, &known).len();
    assert_eq!(of("a.md", "Ours takes 47 min. The paper's takes 45 min (IV.B)."), 0);
    assert_eq!(of("a.md", "The paper's mesh takes\n47 min."), 1);
    assert_eq!(of("a.md", "It is in section VII of the paper."), 1);
    assert_eq!(of("a.rs", "/// As in the paper's\n/// Figure 24.\nlet x = 99; // paper"), 1);
    assert_eq!(of("a.rs", "let x = format!(\"{:.99} of the paper, \\\n  {x} on 33 ranks\");"), 1);
    assert_eq!(of("a.toml", "# the paper's\nx = 99"), 0);
}
