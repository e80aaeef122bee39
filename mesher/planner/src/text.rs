//! A plan for people: a table, a line, and the sentence that refuses a run.

use super::{Limit, Plan, Source, Tightest};
use mesher::error::Error;
use mesher::output::report::grouped;
use std::fmt;

impl Plan {
    /// The error that refuses a run that does not fit.
    pub fn refusal(&self) -> Error {
        let Some(tightest) = self.tightest else { return Error::memory("the run does not fit") };
        let needed = bytes(tightest.needed_bytes as f64);
        let left = bytes(tightest.left_bytes as f64);
        let limit = match tightest.limit {
            Limit::AddressSpace => {
                format!("the limit on its address space leaves a process {left}")
            }
            Limit::ControlGroup => format!("the control group has {left} left"),
            Limit::Machine => format!("the machine has {left} available"),
        };
        let fitting = match (self.spacing_factor_fits, self.spacing_min_fits) {
            (Some(factor), Some(spacing)) => {
                format!("multiply all spacings by {factor}, which fits (spacing_min = {spacing})")
            }
            _ => "no spacing of this case fits".into(),
        };
        Error::memory(format!(
            "the mesh would have {} cells and need {needed} of memory, but {limit}: {fitting}, use more machines, or try with --force",
            self.about(),
        ))
    }

    /// The number of cells, to the precision of its source.
    fn about(&self) -> String {
        match self.source {
            Source::Mesh => grouped(self.cells),
            Source::Pilots => format!("about {:.1e}", self.cells as f64),
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for p in &self.pilots {
            let (cells, time) = (grouped(p.cells), seconds(p.time_cpu_s));
            let spacings = match p.spacing_factor {
                1.0 => "the run itself".to_owned(),
                factor => format!("run at {factor} times the spacings"),
            };
            writeln!(f, "pilot          {spacings}: {cells} cells, {time} of CPU time")?;
        }
        writeln!(f, "cells          {}", self.about())?;
        let ranks = match self.ranks {
            1 => "on one rank".to_owned(),
            ranks => format!("over {ranks} ranks"),
        };
        writeln!(f, "time           {} of CPU time {ranks}", seconds(self.time_cpu_s))?;
        let (all, most) =
            self.memory_peak_bytes.iter().fold((0, 0), |(sum, most), &n| (sum + n, n.max(most)));
        let [all, most, words, tree] =
            [all, most, self.words_bytes[0], self.tree_bytes].map(|n| bytes(n as f64));
        writeln!(f, "peak memory    {all} over all ranks, {most} on a rank at most")?;
        writeln!(f, "files          leaf words of {words} per rank; or a tree of {tree}")?;
        let Some(Tightest { limit, left_bytes, needed_bytes }) = self.tightest else {
            return write!(f, "limit          none is known");
        };
        if !self.fits {
            return write!(f, "fits           no");
        }
        let what = match limit {
            Limit::AddressSpace => "address space of a process",
            Limit::ControlGroup => "control group",
            Limit::Machine => "memory of the machine",
        };
        let [needed, left] = [needed_bytes, left_bytes].map(|n| bytes(n as f64));
        write!(f, "fits           yes: ")?;
        match needed_bytes {
            0 => {
                write!(f, "needs no more than this program holds already; {left} are left ({what})")
            }
            _ => write!(f, "needs {needed} more, of {left} that are left ({what})"),
        }
    }
}

/// A number of bytes with three digits.
fn bytes(n: f64) -> String {
    let units = ["bytes", "kB", "MB", "GB", "TB", "PB", "EB"];
    let power = ((n.max(1.0).log10() / 3.0) as usize).min(units.len() - 1);
    let value = n / 1000f64.powi(power as i32);
    let digits = if power == 0 || value >= 100.0 { 0 } else { 1 };
    format!("{value:.digits$} {}", units[power])
}

fn seconds(s: f64) -> String {
    let digits = if s < 10.0 { 2 } else { 0 };
    format!("{s:.digits$} s")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PilotEntry;

    #[test]
    fn bytes_have_units() {
        let shown = [0.0, 999.0, 1500.0, 99.9e3, 100e3, 448e6, 2.5e13, 5e22].map(bytes);
        assert_eq!(
            shown,
            [
                "0 bytes",
                "999 bytes",
                "1.5 kB",
                "99.9 kB",
                "100 kB",
                "448 MB",
                "25.0 TB",
                "50000 EB"
            ]
        );
    }

    #[test]
    fn short_times_have_hundredths_of_a_second() {
        assert_eq!([9.75, 10.0, 12.6].map(seconds), ["9.75 s", "10 s", "13 s"]);
    }

    fn plan() -> Plan {
        let pilot = |spacing_factor| PilotEntry { spacing_factor, cells: 12_345, time_cpu_s: 0.5 };
        Plan {
            schema: "",
            program: "",
            ranks: 2,
            source: Source::Pilots,
            pilots: vec![pilot(4.0), pilot(1.0)],
            cells: 1_234_567,
            time_cpu_s: 12.6,
            memory_peak_bytes: vec![2_000_000, 3_500_000],
            words_bytes: vec![4_100_000; 2],
            tree_bytes: 1234,
            tightest: Some(Tightest {
                limit: Limit::Machine,
                left_bytes: 900_000_000,
                needed_bytes: 5_000_000,
            }),
            fits: true,
            spacing_factor_fits: Some(4.0),
            spacing_min_fits: Some(0.125),
        }
    }

    #[test]
    fn a_plan_says_all_that_a_run_takes() {
        let mut plan = plan();
        let fits = |plan: &Plan| plan.to_string().lines().last().map(str::to_owned);
        assert_eq!(
            plan.to_string(),
            "pilot          run at 4 times the spacings: 12,345 cells, 0.50 s of CPU time\n\
             pilot          the run itself: 12,345 cells, 0.50 s of CPU time\n\
             cells          about 1.2e6\n\
             time           13 s of CPU time over 2 ranks\n\
             peak memory    5.5 MB over all ranks, 3.5 MB on a rank at most\n\
             files          leaf words of 4.1 MB per rank; or a tree of 1.2 kB\n\
             fits           yes: needs 5.0 MB more, of 900 MB that are left (memory of the machine)"
        );
        let limits = [
            (Limit::AddressSpace, "address space of a process"),
            (Limit::ControlGroup, "control group"),
        ];
        for (limit, name) in limits {
            plan.tightest = Some(Tightest { limit, left_bytes: 7, needed_bytes: 0 });
            let want = format!(
                "fits           yes: needs no more than this program holds already; 7 bytes are left ({name})"
            );
            assert_eq!(fits(&plan), Some(want));
        }
        plan.tightest = None;
        assert_eq!(fits(&plan).as_deref(), Some("limit          none is known"));
        let mesh = Plan { ranks: 1, source: Source::Mesh, ..plan };
        let shown = ["cells          1,234,567\n", "time           13 s of CPU time on one rank\n"];
        assert!(shown.iter().all(|line| mesh.to_string().contains(line)), "{mesh}");
    }

    #[test]
    fn a_refusal_names_the_limit_and_the_spacing_that_fits() {
        let mut plan = Plan { fits: false, ..plan() };
        let refused = "the mesh would have about 1.2e6 cells and need 5.0 MB of memory, but the machine has 900 MB available: \
                       multiply all spacings by 4, which fits (spacing_min = 0.125), use more machines, or try with --force";
        assert_eq!(plan.refusal(), Error::memory(refused));
        let last = plan.to_string().lines().last().map(str::to_owned);
        assert_eq!(last.as_deref(), Some("fits           no"));
        plan.spacing_factor_fits = None;
        for (limit, phrase) in [
            (
                Limit::AddressSpace,
                "but the limit on its address space leaves a process 8 bytes: no spacing of this case fits, use",
            ),
            (
                Limit::ControlGroup,
                "but the control group has 8 bytes left: no spacing of this case fits, use",
            ),
        ] {
            plan.tightest = Some(Tightest { limit, left_bytes: 8, needed_bytes: 9 });
            let text = plan.refusal().to_string();
            assert!(text.contains(phrase), "{text}");
        }
        plan.tightest = None;
        assert_eq!(plan.refusal(), Error::memory("the run does not fit"));
    }
}
