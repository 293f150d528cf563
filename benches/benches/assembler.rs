// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the assembler as the source grows, and of the scheduler as a block grows.
#![allow(missing_docs, clippy::print_stdout)]

use criterion::Criterion;
use std::fmt::Write as _;
use takt_asm::{MemoryLoader, Options};
use takt_benches::{DEEP, FastestTimes, source};

/// A straight-line block of `operations` operations, with dependence chains as in a controller. With `memory`, every third operation
/// loads or stores at an address known only at run time.
fn block(operations: usize, memory: bool) -> String {
    let mut text = String::from(
        ".input x, y, n:int\n.output F\n.schedule on\n.data\ntable: .space 64\n.period\nperiod:\n",
    );
    let names = 24;
    for r in 0..names {
        let _ = writeln!(text, ".reg r{r}, p{r}:int\n fmul r{r}, x, {r}\n iadd p{r}, n, {r}");
    }
    for i in 0..operations.saturating_sub(2 * names + 2) {
        let (d, a, b) = (i * 7 % names, i * 13 % names, i * 29 % names);
        let _ = match (i % 6, memory) {
            (0, true) => writeln!(text, " ld r{d}, {}[p{a}]", i % 50),
            (3, true) => writeln!(text, " st {}[p{a}], r{b}", i % 50),
            (5, true) => writeln!(text, " iadd p{d}, n, {}", i % 40),
            (0 | 5, _) => writeln!(text, " fmul r{d}, r{a}, r{b}"),
            (2, _) => writeln!(text, " fsub r{d}, r{a}, r{b}"),
            (3, _) => writeln!(text, " fmax r{d}, r{a}, r{b}"),
            _ => writeln!(text, " fadd r{d}, r{a}, r{b}"),
        };
    }
    text.push_str(" mov F, r1\n wait period\n");
    text
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = FastestTimes::new(&mut criterion, "assembler");
    let mut rows = Vec::new();
    for lines in [10_000, 100_000, 1_000_000] {
        let loader = MemoryLoader::of("source.s", source(lines));
        let options = Options { machine: &DEEP, ..Options::default() };
        let seconds = group.seconds(&format!("{lines} lines"), lines as u64, || {
            let assembled = takt_asm::assemble("source.s", &loader, &options);
            assembled.expect("the source is well formed").program.bundles()
        });
        rows.push((lines, seconds));
    }
    let shortest = rows[0].1 / rows[0].0 as f64;
    let mut blocks = Vec::new();
    for (operations, memory) in
        [1_000, 10_000, 100_000].into_iter().flat_map(|operations| [(operations, false), (operations, true)])
    {
        let loader = MemoryLoader::of("block.s", block(operations, memory));
        let options = Options { machine: &DEEP, ..Options::default() };
        let start = std::time::Instant::now();
        let assembled = takt_asm::assemble("block.s", &loader, &options).expect("the block is well formed");
        let seconds = start.elapsed().as_secs_f64();
        let block =
            assembled.blocks.into_iter().max_by_key(|block| block.operations).expect("there is a block");
        blocks.push((memory, block.operations, block.cycles, block.bound.cycles(), seconds));
    }
    println!(
        "\n{:>12}{:>10}{:>10}{:>10}{:>18}   scheduled, default effort",
        "operations", "cycles", "bound", "s", "us per operation"
    );
    for (memory, operations, cycles, bound, seconds) in blocks {
        let each = seconds * 1e6 / f64::from(operations);
        let what = if memory { "a third loads and stores" } else { "registers only" };
        println!("{operations:>12}{cycles:>10}{bound:>10}{seconds:>10.2}{each:>18.0}   {what}");
    }
    println!(
        "\n{:>12}{:>16}{:>14}{:>30}",
        "lines", "M lines/s", "ns per line", "per line, times 10,000 lines"
    );
    for (lines, seconds) in rows {
        let per_line = seconds / lines as f64;
        println!("{lines:>12}{:>16.2}{:>14.0}{:>30.2}", 1e-6 / per_line, per_line * 1e9, per_line / shortest);
    }
}
