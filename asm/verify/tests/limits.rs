// SPDX-License-Identifier: MIT OR Apache-2.0
//! Termination of the check: an image that would keep it running is rejected at the limit of steps.

use crate::common::{build, check};
use takt_asm::{MemoryLoader, Options};
use takt_isa::{Instruction, Op, T3};
use takt_verify::{MAX_STEPS, verify};

/// A loop on known numbers, which the check follows iteration by iteration.
const SOURCE: &str = "\
.input a
.output y
.once
.reg n:int
    li n, 10
back:
    isub n, n, 1
    bnz n, back
    wait p
.period
p:
    mov y, a
    wait p
";

#[test]
fn an_image_that_never_ends_is_refused_at_the_limit() {
    let options = Options { machine: &T3, ..Options::default() };
    let (assembled, plain) = build("a.s", &MemoryLoader::of("a.s", SOURCE), &options).expect("it assembles");
    assert!(check(&assembled, &plain).expect("it is its source").steps < MAX_STEPS / 1000);
    let mut program = assembled.program.clone();
    let counts = |instruction: &Instruction| matches!(instruction.op, Op::isub | Op::iadd);
    let decoded =
        program.addresses().flat_map(|at| program.bundle(at).expect("it is there").expect("it is legal"));
    let (word, mut instruction) =
        decoded.enumerate().find(|(_, instruction)| counts(instruction)).expect("it counts");
    // The register alternates between two nonzero numbers, so that the loop never ends.
    instruction.op = Op::ixor;
    program.code[word] = instruction.encode().expect("it has an encoding");
    let difference = verify(&program, &plain, &assembled.contractions).expect_err("it does something else");
    let limit = format!("the checker's limit of {MAX_STEPS} steps is reached");
    assert!(difference.what.starts_with(&limit), "{}", difference.what);
    assert!(difference.place.is_some());
}

/// A loop in which each iteration takes the constant of one more register, before many branches: the check follows these once the loop's
/// facts are settled, not after each iteration.
#[test]
fn code_behind_a_loop_is_checked_once_the_loop_is() {
    use std::fmt::Write as _;
    const SHIFTED: u32 = 16;
    const BRANCHES: u32 = 40;
    let mut text =
        ".input x, n:int\n.output y\n.reg c:int\n.period\np: iand c, n, 15\n iadd c, c, 1\n".to_owned();
    for k in 0..=SHIFTED {
        let _ = writeln!(text, ".reg v{k}\n v{k} = {k}");
    }
    text += ".loop_bound 16\nagain:\n";
    for k in (1..=SHIFTED).rev() {
        let _ = writeln!(text, " mov v{k}, v{}", k - 1);
    }
    text += " v0 = x\n isub c, c, 1\n bnz c, again\n y = 0\n";
    for k in 0..BRANCHES {
        let _ = writeln!(text, " iand c, n, {}\n bz c, b{k}\n y = v{}*x\nb{k}:", 1 << (k % 31), k % SHIFTED);
    }
    text += " wait p\n";
    let options = Options { machine: &T3, ..Options::default() };
    let (assembled, plain) = build("a.s", &MemoryLoader::of("a.s", text), &options).expect("it assembles");
    let found = check(&assembled, &plain).expect("it is its source");
    assert!(found.cuts as u32 > 2 * BRANCHES, "{} cuts", found.cuts);
    // Otherwise the check takes about 830,000.
    assert!(found.steps < 400_000, "{} steps", found.steps);
}
