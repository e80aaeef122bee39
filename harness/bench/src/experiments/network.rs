//! Latency and bandwidth of messages: measured by a ping-pong through the launcher, or given.

use super::entry::{ASSUMED, Network};
use super::execute::Runner;
use contract::number::number;
use run::engine::process::{self, Watch};
use serde_json::Value;
use std::fmt;
use std::fs;
use std::time::Duration;

/// Time after which the ping-pong is killed.
const PING_PONG_LIMIT: Duration = Duration::from_secs(120);

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (latency, bandwidth) = (self.latency_s * 1e6, self.bandwidth_bytes_per_s / 1e9);
        let how = match self.measured {
            true => "measured by ping-pong",
            false if *self == ASSUMED => "assumed",
            false => "given",
        };
        let [latency, bandwidth] = [latency, bandwidth].map(number);
        write!(f, "{latency} µs per message and {bandwidth} GB/s ({how})")
    }
}

/// Measures the network by ping-pongs on two ranks. Each may be disturbed, and all projections depend on the result: of three, that of
/// median latency counts.
///
/// # Errors
/// One sentence, if the ping-pong is missing or fails.
pub fn measured(runner: &Runner) -> Result<Network, String> {
    let program = runner.programs.mesher.program.with_file_name("pingpong");
    if !program.is_file() {
        let program = program.display();
        return Err(format!("{program} is missing: build the mesher with --features mpi"));
    }
    let one = |_| {
        let watch = Watch::new("pingpong", PING_PONG_LIMIT, runner.place);
        let (mut command, _shared) = runner.launcher.command(2, &program);
        let finished = process::run(&mut command, &watch);
        let printed = finished.map_err(|failure| failure.to_string())?.stdout;
        parse(&fs::read_to_string(printed).map_err(|error| error.to_string())?)
    };
    let mut three = (0..3).map(one).collect::<Result<Vec<Network>, String>>()?;
    three.sort_by(|a, b| a.latency_s.total_cmp(&b.latency_s));
    Ok(three[1])
}

/// Parses the output of `pingpong`, one-way times of messages of ascending sizes: latency from the first, bandwidth from the last.
fn parse(text: &str) -> Result<Network, String> {
    let printed: Value = serde_json::from_str(text)
        .map_err(|error| format!("the ping-pong printed no result: {error}"))?;
    let point = |of: &Value| Some([of["bytes"].as_f64()?, of["time_s"].as_f64()?]);
    let points = printed["points"].as_array().into_iter().flatten().filter_map(point);
    match points.collect::<Vec<_>>()[..] {
        [[small, latency_s], .., [large, time_s]]
            if latency_s > 0.0 && large > small && time_s > latency_s =>
        {
            let bandwidth_bytes_per_s = (large - small) / (time_s - latency_s);
            Ok(Network { latency_s, bandwidth_bytes_per_s, measured: true })
        }
        _ => Err("the ping-pong's times do not grow with the messages".to_owned()),
    }
}

/// Parses `LATENCY_SECONDS,BYTES_PER_SECOND`.
///
/// # Errors
/// The expected format.
pub fn given(text: &str) -> Result<Network, String> {
    let numbers = text.split(',').map(|word| word.trim().parse::<f64>());
    let values = numbers.collect::<Result<Vec<f64>, _>>().unwrap_or_default();
    let why = "give a latency in seconds and a bandwidth in bytes per second, as in 2e-6,1e10";
    let [latency_s, bandwidth_bytes_per_s] = values[..] else { return Err(why.to_owned()) };
    let network = Network { latency_s, bandwidth_bytes_per_s, measured: false };
    if network.is_possible() { Ok(network) } else { Err(why.to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ping_pong_output_is_parsed() {
        let text = r#"{"schema": "octree-pingpong/1", "points": [{"bytes": 0, "time_s": 1e-6}, {"bytes": 1000000, "time_s": 1.01e-4}]}"#;
        let n = parse(text).unwrap();
        assert_eq!(n.latency_s, 1e-6);
        assert!((n.bandwidth_bytes_per_s / 1e10 - 1.0).abs() < 1e-9);
        assert!(parse("{}").is_err());
        assert!(parse(&text.replace("1.01e-4", "1e-7")).unwrap_err().contains("grow"));
    }

    #[test]
    fn a_given_network_is_parsed() {
        assert_eq!(given("1e-6, 2e9").unwrap().bandwidth_bytes_per_s, 2e9);
        assert!(given("1e-6").is_err() && given("1,0").is_err());
    }
}
