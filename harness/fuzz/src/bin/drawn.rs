//! The program that `ci/fuzz --drawn` runs: `fuzz-drawn COUNT FIRST`.
//!
//! Exit codes: 0 no finding; 1 a finding; 2 invalid arguments.

use std::process::ExitCode;

fn main() -> ExitCode {
    let numbers: Result<Vec<u64>, _> = std::env::args().skip(1).map(|word| word.parse()).collect();
    let Ok([count, first]) = numbers.as_deref() else {
        eprintln!("fuzz-drawn: give two numbers: the count of cases, and the number of the first");
        return ExitCode::from(2);
    };
    match fuzz::drawn::run(*first, *count) {
        Ok(counts) => {
            print!("{counts}");
            ExitCode::SUCCESS
        }
        Err(number) => {
            eprintln!("case {number} found a fault: repeat it with ci/fuzz --drawn 1 {number}");
            ExitCode::FAILURE
        }
    }
}
