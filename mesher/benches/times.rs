//! Times of the mesher's kernels one by one, and of whole meshes on one rank, nothing written, in cells per second:
//! `cargo bench -p mesher-library --bench times [-- NAME]`, where a NAME is `kernels`, `mesh` or a part of one of theirs.
#![allow(missing_docs)]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use mesher::record::Recorder;
use mesher::{Job, mesh};
use ranks::Solo;
use std::time::Duration;

fn kernels(c: &mut Criterion) {
    let mut group = c.benchmark_group("kernels");
    group.sample_size(20);
    for mut kernel in support::kernels() {
        group.throughput(Throughput::Elements(kernel.elements));
        group.bench_function(kernel.name, |b| b.iter(&mut kernel.run));
    }
    group.finish();
}

fn meshes(c: &mut Criterion) {
    let mut group = c.benchmark_group("mesh");
    group.sample_size(10).warm_up_time(Duration::from_secs(1));
    for (shape, facets, finer, layer_cells_min) in [
        ("sphere", 5_000, 9, 4),
        ("uav", 20_000, 10, 4),
        ("uav", 20_000, 10, 10),
        ("fighter", 100_000, 9, 4),
    ] {
        let case = support::case(shape, facets, finer, layer_cells_min);
        let run = || {
            let (options, mut record) = (support::options(), Recorder::default());
            let mut job = Job::new(&options, &Solo, &mut record);
            mesh(&case, &mut job, |_, _| Ok(())).expect("a good case").cells
        };
        group.throughput(Throughput::Elements(run()));
        let name = format!("{shape}-{facets}-1/2^{finer}-n{layer_cells_min}").replace('/', "_");
        group.bench_function(name, |b| b.iter(run));
    }
    group.finish();
}

criterion_group!(benches, kernels, meshes);
criterion_main!(benches);
