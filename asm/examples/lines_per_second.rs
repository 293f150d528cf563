// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lines per second of the assembler: `cargo run --release -p takt-asm --example lines_per_second`.
//!
//! The source is like a controller's: most lines one operation with a comment, some bundles, constants, labels, comments.
#![allow(clippy::print_stdout, missing_docs)]

use std::time::Instant;
use takt_asm::{MemoryLoader, Options};
use takt_isa::{Machine, T3};

/// The fast machine with a program memory for a million lines.
static DEEP: Machine = Machine { name: "deep", code_depth: 1 << 22, ..T3 };

fn main() {
    let options = Options { machine: &DEEP, ..Options::default() };
    for lines in [10_000, 100_000, 1_000_000] {
        let text = source(lines);
        let loader = MemoryLoader::of("generated.s", text.as_str());
        let mut best = f64::INFINITY;
        let runs = (8_000_000 / lines).clamp(8, 200);
        let before = processor_seconds();
        // The best of several runs: other load on the machine only adds time.
        for _ in 0..runs {
            let start = Instant::now();
            let assembled = takt_asm::assemble("generated.s", &loader, &options);
            best = best.min(start.elapsed().as_secs_f64());
            match assembled {
                Ok(assembled) => assert!(assembled.program.bundles() as usize > lines / 2),
                Err(report) => panic!("{}", report.render(false)),
            }
        }
        let rate = |seconds: f64| format!("{:.2} M lines/s", lines as f64 / seconds / 1e6);
        let megabytes = text.len() as f64 / 1e6;
        print!(
            "{lines:>8} lines {megabytes:>5.1} MB: {:>5.0} ns/line, {}",
            best / lines as f64 * 1e9,
            rate(best)
        );
        match (before, processor_seconds()) {
            (Some(before), Some(after)) => {
                println!(", of processor time on average {}", rate((after - before) / runs as f64));
            }
            _ => println!(),
        }
    }
}

/// CPU time of this process, where the system reports it: on a busy machine a fairer measure than elapsed time.
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

/// A source of about this many lines.
pub fn source(lines: usize) -> String {
    let mut text = String::from(
        "; Generated.\n.const KP = (2*pi*80)^2  ; 1/s²\n.const KD = 2*0.7*(2*pi*80)\n.input qd, vd, n:int\n.output F\n\
         .reg q e _qprev v ev u w s t0 t1 t2 k c\n.period\n",
    );
    let mut count = text.lines().count();
    let mut block = 0;
    while count < lines {
        let body = format!(
            "\n; ---- step {block}\nstep{block}:\n        itof    q, n\n        fsub    e, qd, q\n        fmul    u, e, KP            ; proportional part\n\
             \x20       fsub    ev, vd, v           ; velocity error\n        fmul    w, ev, KD\n\
             \x20       fadd    s, u, w             ; the sum of both\n\
             \x20       fmul    t0, s, {block}.5e-3\n        fadd    t1, t0, ev  || mov _qprev, q\n\
             \x20       fmul    t0, t1, u || fadd s, s, 0.25 || ilt c, k, 100\n\
             \x20       fmul    t2, t1, 0.5*KD      ; a constant expression\n\
             \x20       ld      k, {}[zero]\n        st      4[zero], k\n        iadd    k, k, 1\n\
             \x20       fadd    F, t2, ev\n        bz      c, step0\n        sel     v, c, t1, s\n",
            block % 500
        )
        .replace(&format!("{block}.5e-3"), &format!("{}.5e-3", block % 20));
        count += body.lines().count();
        text.push_str(&body);
        block += 1;
    }
    text.push_str("        wait step0\n");
    text
}
