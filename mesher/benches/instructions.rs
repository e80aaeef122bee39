//! Instructions per kernel: `cargo bench -p mesher-library --bench instructions [-- NAME...]`. Counts repeat exactly,
//! unlike times. Without valgrind the bench prints that and succeeds.
//!
//! Each kernel runs once, after a warm-up, in a process of its own under callgrind, which counts only what
//! [`counted`] does. Valgrind does not support AVX-512, so other code paths than on most machines are counted.
#![allow(missing_docs)]

mod support;

use std::process::{Command, ExitCode};

/// Set in the process that runs one kernel under callgrind.
const ONE: &str = "MESHER_BENCH_KERNEL";

fn main() -> ExitCode {
    if let Ok(name) = std::env::var(ONE) {
        let mut kernels = support::kernels();
        let kernel = kernels.iter_mut().find(|k| k.name == name).expect("a kernel's name");
        (kernel.run)();
        counted(&mut kernel.run);
        return ExitCode::SUCCESS;
    }
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: valgrind is not installed");
        return ExitCode::SUCCESS;
    }
    // Arguments that begin with a dash are cargo's.
    let names: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    println!("{:<12}{:>16}{:>12}{:>20}", "kernel", "instructions", "elements", "per element");
    for k in support::kernels() {
        if !names.is_empty() && !names.iter().any(|a| k.name.contains(a.as_str())) {
            continue;
        }
        match count(k.name) {
            Ok(n) => {
                println!(
                    "{:<12}{n:>16}{:>12}{:>20.2}",
                    k.name,
                    k.elements,
                    n as f64 / k.elements as f64
                );
            }
            Err(e) => {
                eprintln!("{}: {e}", k.name);
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}

#[inline(never)]
fn counted(run: &mut dyn FnMut() -> u64) -> u64 {
    std::hint::black_box(run())
}

/// Number of instructions of one kernel.
fn count(name: &str) -> Result<u64, String> {
    let me = std::env::current_exe().map_err(|e| e.to_string())?;
    let ended = Command::new("valgrind")
        .args([
            "--tool=callgrind",
            "--callgrind-out-file=/dev/null",
            "--toggle-collect=*::counted*",
        ])
        .arg(me)
        .env(ONE, name)
        .output()
        .map_err(|e| e.to_string())?;
    let output = String::from_utf8_lossy(&ended.stderr);
    let line = output.lines().find_map(|l| l.split_once("Collected :"));
    let number = line.and_then(|(_, n)| n.trim().parse().ok());
    number.filter(|n| *n > 0).ok_or_else(|| format!("callgrind counted nothing:\n{output}"))
}
