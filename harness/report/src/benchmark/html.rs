//! One page with everything on it: no script, nothing from the network, light and dark, narrow and wide.

use super::figure::Figure;
use super::latex::{commands, machines};
use super::lint::{Finding, RULES, Verdict};
use bench::experiments::cause::sentence;
use bench::experiments::entry::{Comm, Line, What};
use bench::experiments::group::{Group, Groups};
use bench::experiments::pop;
use bench::experiments::table::{division, grouped};
use std::fmt::Write;

const STYLE: &str = include_str!("page.css");

/// A figure with its drawing and its numbers.
#[derive(Clone, Debug)]
pub struct Drawn<'a> {
    /// What it shows.
    pub figure: &'a Figure,
    /// The SVG document.
    pub svg: String,
    /// The numbers.
    pub csv: String,
}

/// The page; `trend` tells where tracked numbers changed.
pub fn page(
    groups: &Groups,
    drawn: &[Drawn],
    findings: &[Finding],
    lines: &[Line],
    trend: Option<&str>,
) -> String {
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, \
         initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n<title>Oct-tree meshing: scaling and load \
         balance</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>Scaling and load balance</h1>\n"
    );
    summary(&mut out, groups, lines, trend.is_some());
    out.push_str("<h2 id=\"figures\">Figures</h2>\n<p>Solid points were measured on as many cores as ranks; hollow ones were measured with \
        more ranks than cores, projected from simulated ranks, or are the paper's.</p>\n");
    drawn.iter().for_each(|d| figure(&mut out, d));
    out.push_str("<h2 id=\"tables\">Tables</h2>\n");
    tables(&mut out, groups);
    projections(&mut out, groups);
    phases(&mut out, groups);
    if let Some(told) = trend {
        let told = escape(told);
        let _ = writeln!(out, "<h2 id=\"trend\">Changes over commits</h2>\n<pre>{told}</pre>");
    }
    rules(&mut out, findings);
    machine(&mut out, lines);
    out.push_str("</main>\n</body>\n</html>\n");
    out
}

fn summary(out: &mut String, groups: &Groups, lines: &[Line], trend: bool) {
    let runs: usize = groups.all.iter().map(|g| g.runs.len()).sum();
    let failed = lines.iter().filter(|l| matches!(l.what, What::Failure(_))).count();
    let _ = writeln!(
        out,
        "<p>{runs} runs of {} setups{}. Where ranks are simulated, time is the critical path: the sum over phases of the slowest rank's CPU \
         time, plus {:.2} µs per message and {:.2} GB/s ({}).</p>\n<nav><a href=\"#figures\">figures</a> <a href=\"#tables\">tables</a> \
         {}<a href=\"#rules\">twelve rules</a> <a href=\"#machine\">machine and commands</a></nav>\n<h2>Why efficiency falls</h2>\n<ul>",
        groups.all.len(),
        if failed > 0 { format!(", {failed} failed") } else { String::new() },
        groups.network.latency_s * 1e6,
        groups.network.bandwidth_bytes_per_s / 1e9,
        if groups.network.measured { "measured by a ping-pong" } else { "given" },
        if trend { "<a href=\"#trend\">changes over commits</a> " } else { "" }
    );
    for group in groups.all.iter().filter(|g| is_told(g)) {
        let network = &groups.network;
        let told = sentence(&group.typical, &groups.reference(group).typical, network);
        let _ = writeln!(
            out,
            "<li><b>{}</b>, {} scaling, {} cells: {}</li>",
            escape(&group.setup.case),
            escape(&group.setup.experiment),
            grouped(group.cells()),
            code(&told)
        );
    }
    out.push_str("</ul>\n");
}

/// Scaling on many simulated ranks is worth a sentence up here.
fn is_told(group: &Group) -> bool {
    let scales = ["strong", "weak"].contains(&group.setup.experiment.as_str());
    scales && group.setup.comm == Comm::Sim && group.setup.ranks >= 16
}

fn figure(out: &mut String, drawn: &Drawn) {
    let f = drawn.figure;
    let _ = writeln!(
        out,
        "<figure id=\"{id}\">\n<h3>{title}</h3>\n<div class=\"plot\">{svg}</div>\n<figcaption>{caption} <a download=\"{id}.csv\" \
         href=\"data:text/csv;charset=utf-8,{csv}\">CSV</a></figcaption>\n</figure>",
        id = f.id,
        title = escape(&f.title),
        svg = inline(&drawn.svg, &f.title),
        caption = escape(&f.caption),
        csv = percent(&drawn.csv)
    );
}

/// An SVG document as part of the page: its ink is the page's, and it is named for those who do not see it.
fn inline(svg: &str, title: &str) -> String {
    let start = svg.find("<svg").unwrap_or(0);
    let mut svg = svg[start..].replace("#000000", "currentColor");
    if let Some(end) = svg.find('>') {
        let open = format!(
            "<svg role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {} {}\" xmlns=\"http://www.w3.org/2000/svg\">",
            escape(title),
            super::canvas::WIDTH,
            super::canvas::HEIGHT
        );
        svg.replace_range(..=end, &open);
    }
    svg
}

fn tables(out: &mut String, groups: &Groups) {
    let mut experiments: Vec<&str> = Vec::new();
    for group in &groups.all {
        if !experiments.contains(&group.setup.experiment.as_str()) {
            experiments.push(&group.setup.experiment);
        }
    }
    for experiment in experiments {
        let _ = writeln!(
            out,
            "<h3>{}</h3>\n<div class=\"scroll\"><table><thead><tr><th>case<th>cells<th>n<th>division<th>ranks<th>how<th>time / \
             s<th>interval<th>coverage<th>runs<th>λ time<th>λ cells<th>load bal.<th>serialis.<th>transfer<th>parallel<th>comp. \
             scaling<th>global<th>M cells/s/rank<th>B/cell</tr></thead><tbody>",
            escape(experiment)
        );
        for group in groups.all.iter().filter(|g| g.setup.experiment == experiment) {
            row(out, groups, group);
        }
        out.push_str("</tbody></table></div>\n");
    }
}

fn row(out: &mut String, groups: &Groups, group: &Group) {
    let (s, t) = (&group.setup, group.time_s);
    let e = group.efficiency(groups.reference(group), &groups.network);
    let leaves = group.typical.counters.get("leaves");
    let _ = writeln!(
        out,
        "<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{:.3}<td>{:.3} – {:.3}<td>{:.0} %<td>{}<td>{:.3}<td>{}<td>{:.3}<td>{:.3}<td>{:.3}\
         <td>{:.3}<td>{:.3}<td>{:.3}<td>{:.2}<td>{:.2}</tr>",
        escape(&s.case),
        grouped(group.cells()),
        s.layer_cells_min,
        division(s),
        s.ranks,
        group.how(),
        t.value,
        t.low,
        t.high,
        t.coverage * 100.0,
        t.count,
        e.lambda,
        leaves.map_or("–".to_owned(), |l| format!("{:.3}", l.lambda(s.ranks))),
        e.load_balance,
        e.serialisation,
        e.transfer,
        e.parallel(),
        e.computation_scaling,
        e.global(),
        group.rate() / 1e6,
        group.bytes_per_cell().value
    );
}

fn projections(out: &mut String, groups: &Groups) {
    let pairs = groups.projections();
    if pairs.is_empty() {
        return;
    }
    out.push_str("<h3>projection against MPI</h3>\n<div class=\"scroll\"><table><thead><tr><th>case<th>experiment<th>cells<th>ranks<th>projected \
        / s<th>measured / s<th>error<th>error of CPU times</tr></thead><tbody>\n");
    for p in pairs {
        let _ = writeln!(
            out,
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{:.3}<td>{:.3}<td>{:+.1} %<td>{:+.1} %</tr>",
            escape(&p.sim.setup.case),
            p.sim.setup.experiment,
            grouped(p.sim.cells()),
            p.sim.setup.ranks,
            p.sim.time_s.value,
            p.measured.time_s.value,
            p.error() * 100.0,
            p.path_error() * 100.0
        );
    }
    out.push_str("</tbody></table></div>\n");
}

/// Phases of the largest simulated run of every strong or weak study.
fn phases(out: &mut String, groups: &Groups) {
    let mut shown: Vec<&Group> = Vec::new();
    for group in groups.all.iter().filter(|g| is_told(g)) {
        let same = |o: &&mut &Group| {
            let weak = group.setup.experiment == "weak";
            o.setup.experiment == group.setup.experiment
                && o.setup.case == group.setup.case
                && (weak || o.cells() == group.cells())
        };
        match shown.iter_mut().find(same) {
            Some(before) if before.setup.ranks < group.setup.ranks => *before = group,
            Some(_) => {}
            None => shown.push(group),
        }
    }
    for group in shown {
        let (run, network) = (&group.typical, &groups.network);
        let reference = &groups.reference(group).typical;
        let total: f64 =
            run.phases.iter().map(|p| p.useful_s.max + pop::messages_s(p, network)).sum();
        let _ = writeln!(
            out,
            "<h3>phases: {}, {} scaling, {} cells, {} simulated ranks</h3>\n<div class=\"scroll\"><table><thead><tr><th>phase<th>mean useful / \
             s<th>max useful / s<th>λ<th>load bal.<th>transfer<th>parallel<th>comp. scaling<th>share of time<th>messages, max<th>MB, max\
             </tr></thead><tbody>",
            escape(&run.setup.case),
            run.setup.experiment,
            grouped(run.cells),
            run.setup.ranks
        );
        for p in &run.phases {
            let e = pop::phase_efficiency(run, p, reference, network);
            let _ = writeln!(
                out,
                "<tr><td>{}<td>{:.4}<td>{:.4}<td>{:.2}<td>{:.2}<td>{:.2}<td>{:.2}<td>{:.2}<td>{:.1} %<td>{:.0}<td>{:.3}</tr>",
                escape(&p.name),
                p.useful_s.sum / run.setup.ranks as f64,
                p.useful_s.max,
                e.lambda,
                e.load_balance,
                e.transfer,
                e.parallel(),
                e.computation_scaling,
                100.0 * e.time_s / total,
                p.messages.max,
                p.message_bytes.max / 1e6
            );
        }
        out.push_str("</tbody></table></div>\n");
    }
}

fn rules(out: &mut String, findings: &[Finding]) {
    out.push_str("<h2 id=\"rules\">Against the twelve rules of Hoefler and Belli</h2>\n<div class=\"scroll\"><table class=\"words\"><thead><tr>\
        <th>rule<th>verdict<th>where<th>why</tr></thead><tbody>\n");
    for (i, rule) in RULES.iter().enumerate() {
        for verdict in [Verdict::Broken, Verdict::Kept] {
            let of = findings.iter().filter(|f| f.rule == i + 1 && f.verdict == verdict);
            let mut whys: Vec<(&str, Vec<&str>)> = Vec::new();
            for f in of {
                match whys.iter_mut().find(|(why, _)| *why == f.why) {
                    Some((_, places)) => places.push(&f.about),
                    None => whys.push((&f.why, vec![&f.about])),
                }
            }
            for (why, places) in whys {
                let word =
                    if verdict == Verdict::Kept { "kept" } else { "<strong>broken</strong>" };
                let places = if places.len() > 3 {
                    format!("{} figures", places.len())
                } else {
                    places.join(", ")
                };
                let _ = writeln!(
                    out,
                    "<tr><td>{}. {}<td>{word}<td>{}<td>{}</tr>",
                    i + 1,
                    escape(rule),
                    escape(&places),
                    escape(why)
                );
            }
        }
    }
    out.push_str("</tbody></table></div>\n");
}

fn machine(out: &mut String, lines: &[Line]) {
    out.push_str("<h2 id=\"machine\">Machine and commands</h2>\n");
    for m in machines(lines) {
        let _ = writeln!(
            out,
            "<p>{}; {} cores; {:.1} GiB; {}; {}; {}; commit {}</p>",
            escape(&m.cpu),
            m.cores,
            m.memory_bytes as f64 / f64::from(1u32 << 30),
            escape(&m.kernel),
            escape(if m.mpi.is_empty() { "no MPI" } else { &m.mpi }),
            escape(&m.compiler),
            escape(if m.commit.is_empty() { "unknown" } else { &m.commit })
        );
    }
    out.push_str("<pre>");
    commands(lines).iter().for_each(|c| _ = writeln!(out, "{}", escape(c)));
    out.push_str("</pre>\n");
}

/// Words as HTML wants them.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Words between backquotes as code.
fn code(text: &str) -> String {
    let parts: Vec<String> = text.split('`').map(escape).collect();
    let tagged = |(i, part): (usize, &String)| {
        if i % 2 == 1 { format!("<code>{part}</code>") } else { part.clone() }
    };
    parts.iter().enumerate().map(tagged).collect()
}

/// Text as a URL wants it.
fn percent(text: &str) -> String {
    let mut out = String::with_capacity(text.len() * 2);
    for byte in text.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'.' | b'-' | b'_' => out.push(byte as char),
            _ => _ = write!(out, "%{byte:02X}"),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ink_is_the_pages_and_the_drawing_is_named() {
        let svg = inline(
            "<?xml version=\"1.0\"?>\n<svg width=\"9\" height=\"9\"><text fill=\"#000000\">a</text></svg>",
            "A < B",
        );
        assert!(
            svg.starts_with("<svg role=\"img\" aria-label=\"A &lt; B\" viewBox=\"0 0 1600 1040\"")
        );
        assert!(svg.contains("fill=\"currentColor\"") && !svg.contains("width="));
    }

    #[test]
    fn text_is_made_safe() {
        assert_eq!(code("a `b<c` d"), "a <code>b&lt;c</code> d");
        assert_eq!(percent("a,b\n"), "a%2Cb%0A");
    }
}
