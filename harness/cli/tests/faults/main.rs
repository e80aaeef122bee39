//! Faults: calls of the system that fail, ranks that are killed or stopped, programs that hang, flood or lie, a clock that jumps, a network
//! that is cut. Every run ends in a stated time with one sentence and a documented exit code, and leaves no unfinished file.
//!
//! Each test prints a table. `ci/faults` sets `FAULTS` to a number of calls that fail per program and fault, and tries all other faults;
//! without it a sample of each kind is tried.

mod calls;
mod clock;
mod liars;
mod network;
mod phases;
mod place;
mod programs;
mod table;
mod tools;

#[test]
fn a_call_that_fails_ends_every_program_without_unfinished_files() {
    calls::family();
}

#[test]
fn a_rank_that_fails_in_any_phase_ends_its_job_without_a_mesh() {
    phases::family();
}

#[test]
fn programs_that_hang_flood_or_lie_are_ended_and_reported() {
    liars::family();
}

#[test]
fn a_clock_that_jumps_changes_neither_limits_nor_durations() {
    clock::family();
}

#[test]
fn ranks_that_a_network_cuts_off_end_without_a_mesh() {
    network::family();
}
