//! The mesher's kernels one by one: `cargo bench -p mesher-library --bench kernels [-- NAME]`.
#![allow(missing_docs)]

mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};

fn kernels(c: &mut Criterion) {
    let mut group = c.benchmark_group("kernels");
    group.sample_size(20);
    for mut kernel in support::kernels() {
        group.throughput(Throughput::Elements(kernel.elements));
        group.bench_function(kernel.name, |b| b.iter(&mut kernel.run));
    }
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
