// SPDX-License-Identifier: MIT OR Apache-2.0
//! Library `programs/library/math.s`: the error, flags and cost of each macro on every machine; and `programs/library/matrix.s`
//! ([`matrix`]).
//!
//! By default over a sample of operands; with `TAKT_FULL=1` over all 2³², which must reproduce the documented figures exactly:
//!
//! ```text
//! TAKT_FULL=1 cargo test --release -p takt-programs --test suite library:: -- --nocapture
//! ```
#![allow(clippy::print_stdout)]

mod batch;
mod cost;
mod functions;
mod kernels;
mod matrix;
mod measure;
mod pairs;

use takt_asm::{AssembledProgram, MemoryLoader, Options, Search};
use takt_isa::Machine;
use takt_programs::LIBRARY;

/// Assembles a program that includes the library. Warnings are errors.
fn assemble(machine: &'static Machine, text: &str) -> AssembledProgram {
    let program = MemoryLoader::of("test.s", format!(".include <math.s>\n.schedule on\n{text}"));
    let loader = Search::new(program).library(LIBRARY);
    let options = Options { machine, ..Options::default() };
    let assembled = takt_asm::assemble("test.s", &loader, &options);
    let assembled = assembled.unwrap_or_else(|errors| panic!("{text}{}", errors.render(false)));
    assert!(assembled.warnings.list.is_empty(), "{}", assembled.warnings.render(false));
    assembled
}

/// Program whose period is one use of a macro.
fn one_use(machine: &'static Machine, usage: &str, operands: usize, before: &str) -> AssembledProgram {
    let inputs = ["x", "x, y"][operands - 1];
    let text = format!(
        ".input {inputs}\n.output d\n.once\n wait period\n.period\nperiod: {before}\n {usage}\n wait period\n"
    );
    assemble(machine, &text)
}
