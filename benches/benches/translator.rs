// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the translator of C as a controller grows.
#![allow(missing_docs, clippy::print_stdout)]

use criterion::Criterion;
use std::fmt::Write as _;
use takt_asm::{MemoryLoader, Options};
use takt_benches::{DEEP, FastestTimes};
use takt_front::c::{self, Source, Translation};

/// A preprocessed controller of about `lines` lines: for every 25 of them, a filter and a limited integrator, each a function, with a state.
fn controller(lines: usize) -> String {
    let axes = lines.saturating_sub(12) / 24;
    let mut text = String::from("struct axis { float b[3], z[2], sum, limit; };\n");
    let _ = writeln!(
        text,
        "static struct axis axes[{axes}];\nstatic const float gains[4] = {{0.5f, 0.25f, 0.125f, 2.0f}};"
    );
    for axis in 0..axes {
        let _ = write!(
            text,
            "
static float filter_{axis}(struct axis *a, float x)
{{
    float sum = a->b[0] * x + a->z[0];
    for (int i = 0; i < 2; i++) {{
        a->z[i] = a->b[i + 1] * x - gains[(i + {axis}) % 4] * sum;
        if (i == 0)
            a->z[i] += a->z[1];
    }}
    return sum;
}}

static float control_{axis}(struct axis *a, float target, float measured)
{{
    float error = target - filter_{axis}(a, measured);
    a->sum += 0.01f * error;
    if (a->sum > a->limit)
        a->sum = a->limit;
    else if (a->sum < -a->limit)
        a->sum = -a->limit;
    return {axis}.5f * error + a->sum;
}}
"
        );
    }
    text.push_str("\nfloat step(float target, float measured)\n{\n    float u = target;\n");
    for axis in 0..axes {
        let _ = writeln!(text, "    u = control_{axis}(&axes[{axis}], u, measured);");
    }
    text.push_str("    return u;\n}\n");
    text
}

fn translated(text: &str) -> Translation {
    let options = c::Options {
        step: "step".to_owned(),
        init: None,
        set: Vec::new(),
        ignore: Vec::new(),
        loop_bound: None,
        double_is_float: false,
    };
    c::translate(&[Source { name: "axes.c".to_owned(), text: text.to_owned() }], &options)
        .expect("the C is well formed")
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = FastestTimes::new(&mut criterion, "translator");
    let mut rows = Vec::new();
    for lines in [250, 1_000, 2_000] {
        let text = controller(lines);
        let lines = text.lines().count();
        let seconds =
            group.seconds(&format!("{lines} lines of C"), lines as u64, || translated(&text).text.len());
        let program = translated(&text).text;
        let loader = MemoryLoader::of("axes.s", program);
        let options = Options { machine: &DEEP, ..Options::default() };
        let start = std::time::Instant::now();
        let assembled = takt_asm::assemble("axes.s", &loader, &options);
        let bundles = assembled
            .map(|assembled| assembled.program.bundles())
            .unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)));
        rows.push((lines, seconds, bundles, start.elapsed().as_secs_f64()));
    }
    let shortest = rows[0].1 / rows[0].0 as f64;
    println!(
        "\n{:>10}{:>12}{:>14}{:>28}{:>12}{:>16}",
        "lines", "translated", "us per line", "per line, times the first", "bundles", "assembled"
    );
    for (lines, seconds, bundles, assembled) in rows {
        let each = seconds / lines as f64;
        println!(
            "{lines:>10}{seconds:>10.2} s{:>14.0}{:>28.2}{bundles:>12}{assembled:>14.2} s",
            each * 1e6,
            each / shortest
        );
    }
}
