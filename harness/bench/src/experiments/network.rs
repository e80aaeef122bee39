//! Latency and bandwidth of messages: measured by a ping-pong through the launcher, or given.

use super::entry::{ASSUMED, Network};
use super::execute::Runner;
use super::machine::cores;
use crate::refuse;
use contract::number::number;
use run::engine::layout::node_count;
use run::engine::process::{self, Watch};
use serde_json::Value;
use std::time::Duration;
use std::{fmt, fs};

/// Time after which the ping-pong is killed.
const PING_PONG_LIMIT: Duration = Duration::from_secs(120);

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (latency, bandwidth) = (self.latency_s * 1e6, self.bandwidth_bytes_per_s / 1e9);
        let how = match self.measured {
            true => "measured by ping-pong",
            false if self.given => "given",
            false => "assumed",
        };
        let [latency, bandwidth] = [latency, bandwidth].map(number);
        write!(f, "{latency} µs per message and {bandwidth} GB/s ({how})")
    }
}

/// Measures the network by ping-pongs on two ranks. Each may be disturbed, and all projections depend on the result: of three, that of
/// median latency counts.
///
/// # Errors
/// One sentence, if both ranks would share a core, or the ping-pong is missing or fails.
pub fn measured(runner: &Runner) -> Result<Network, String> {
    let program = runner.programs.mesher.program.with_file_name("pingpong");
    let shown = program.display();
    refuse(&[
        (cores() * node_count() < 2, "the two ranks of a ping-pong would share one core"),
        (!program.is_file(), &format!("{shown} is missing: build the mesher with --features mpi")),
    ])?;
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

/// Parses the output of `pingpong`, one-way times of messages of ascending sizes: latency from the first, bandwidth from the last. The
/// longest message takes far longer than an empty one, and the others roughly what latency and bandwidth give, whatever caches and protocols add.
fn parse(text: &str) -> Result<Network, String> {
    let printed: Value = serde_json::from_str(text)
        .map_err(|error| format!("the ping-pong printed no result: {error}"))?;
    let point = |of: &Value| Some([of["bytes"].as_f64()?, of["time_s"].as_f64()?]);
    let points = printed["points"].as_array().into_iter().flatten().filter_map(point);
    let points: Vec<[f64; 2]> = points.collect();
    if let [[small, latency_s], .., [large, time_s]] = points[..] {
        let bandwidth_bytes_per_s = (large - small) / (time_s - latency_s);
        let network = Network { latency_s, bandwidth_bytes_per_s, measured: true, ..ASSUMED };
        let is_near = |[b, s]: &[f64; 2]| (0.125..8.0).contains(&(s / network.time_s(1.0, *b)));
        let grow = points.is_sorted_by(|a, b| a[0] < b[0] && 0.7 * a[1] < b[1]);
        if grow && latency_s > 0.0 && time_s > 10.0 * latency_s && points.iter().all(is_near) {
            return Ok(network);
        }
    }
    Err("the ping-pong's times do not grow with the messages".to_owned())
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
    let network = Network { latency_s, bandwidth_bytes_per_s, measured: false, given: true };
    if network.is_possible() { Ok(network) } else { Err(why.to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn ping_pong_output_is_parsed() {
        let text = r#"{"schema": "octree-pingpong/1", "points": [{"bytes": 0, "time_s": 1e-6}, {"bytes": 1000000, "time_s": 1.01e-4}]}"#;
        let n = parse(text).unwrap();
        assert_eq!(n.latency_s, 1e-6);
        assert!((n.bandwidth_bytes_per_s / 1e10 - 1.0).abs() < 1e-9);
        assert!(parse("{}").is_err());
        assert!(parse(&text.replace("1.01e-4", "1e-7")).unwrap_err().contains("grow"));
        let of = |times_s: [f64; 6]| {
            let bytes = [0, 8, 1024, 1 << 16, 1 << 20, 1 << 23].into_iter();
            let points = bytes.zip(times_s).map(|(b, s)| json!({"bytes": b, "time_s": s}));
            parse(&json!({ "points": points.collect::<Vec<_>>() }).to_string())
        };
        let quiet = [4.3e-7, 4.0e-7, 7.4e-7, 3.6e-5, 4.0e-4, 4.0e-3];
        assert!((of(quiet).unwrap().bandwidth_bytes_per_s / 2.1e9 - 1.0).abs() < 0.01);
        // Two ranks on one core, in turns of the scheduler; a disturbed point; times that fall.
        assert!(of([3.999e-3, 4e-3, 4e-3, 4e-3, 4e-3, 4.004e-3]).is_err());
        assert!(of([4.3e-7, 4.0e-7, 7.4e-7, 4e-3, 4e-3, 4e-3]).is_err());
        assert!(of([4.3e-7, 1.6e-6, 7.4e-7, 3.6e-5, 4.0e-4, 4.0e-3]).is_err());
    }

    #[test]
    fn a_given_network_is_parsed() {
        assert_eq!(given("1e-6, 2e9").unwrap().bandwidth_bytes_per_s, 2e9);
        // One that is as good as the assumed one is given all the same.
        let same = given("2e-6,1e10").unwrap();
        assert!(same.given && same.to_string().ends_with("(given)"), "{same}");
        assert!(ASSUMED.to_string().ends_with("(assumed)"));
        assert!(given("1e-6").is_err() && given("1,0").is_err());
    }
}
