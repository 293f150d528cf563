// SPDX-License-Identifier: MIT OR Apache-2.0
//! Counted loops and calls: registers that the assembler makes for a loop outlive the loops of called subroutines, in any order of
//! the text.

use crate::common;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use takt_asm::{AssembledProgram, MemoryLoader, Options, Schedule, assemble};
use takt_emu::{Emulator, Stop};
use takt_isa::{F1, F3, MACHINES, Machine, T3};

fn machines() -> impl Iterator<Item = &'static Machine> {
    MACHINES.iter().copied().chain([&F1, &F3])
}

fn assembled(text: &str, machine: &'static Machine, schedule: Schedule) -> AssembledProgram {
    let options = Options { machine, schedule, effort: 0, ..Options::default() };
    match assemble("test.s", &MemoryLoader::of("test.s", text), &options) {
        Ok(assembled) => assembled,
        Err(mistakes) => panic!("{}\n{text}", mistakes.render(false)),
    }
}

/// The integer output `y` where a program that begins with `body` halts, on every machine, as written and scheduled.
#[track_caller]
fn gives(declared: &str, body: &str, subroutines: &str, expected: i32) {
    // Subroutines after their callers, and before them.
    for text in [
        format!("{declared}.output y:int\n.once\n{body} halt\n{subroutines}"),
        format!("{declared}.output y:int\n.once\n jmp begin\n{subroutines}begin:\n{body} halt\n"),
    ] {
        for machine in machines() {
            for schedule in [Schedule::None, Schedule::All] {
                let program = assembled(&text, machine, schedule).program;
                let mut emulator = Emulator::new(&program).expect("it fits");
                emulator.set_cycle_limit(1_000_000);
                assert_eq!(emulator.run(), Ok(Stop::Halted), "{} {schedule:?}\n{text}", machine.name);
                let found = emulator.output_bits(program.outputs[0].register).map(u32::cast_signed);
                assert_eq!(found, Some(expected), "{} {schedule:?}\n{text}", machine.name);
            }
        }
    }
}

const DECLARED: &str = ".array A[40], B[8]:int = 1, 2, 3, 4, 5, 6, 7, 8\n.reg k:int n:int m:int u\n";
const CLEAR: &str = "clear:\n .for j, 1, 9\n A[2*j] = 1.0\n A[j] = 2.0\n .endfor\n ret\n";

#[test]
fn keeps_the_index_across_a_call() {
    let body = " k = 0\n .for i, 1, 6\n call clear\n k = k + i\n .endfor\n y = k\n";
    gives(DECLARED, body, CLEAR, 21);
    let counted = "clear:\n n = 3\n .for j, 1, n max 8\n A[j] = 1.0\n .endfor\n ret\n";
    gives(DECLARED, body, counted, 21);
    // An element of an array, a nest, and a call of a call.
    gives(DECLARED, " k = 0\n .for i, 1, 8\n call clear\n k = k + B[i]\n .endfor\n y = k\n", CLEAR, 36);
    let nest = " k = 0\n .for i, 1, 5\n .for h, i, 6\n call clear\n k = k + h\n .endfor\n .endfor\n y = k\n";
    gives(DECLARED, nest, CLEAR, 1 + 2 * 2 + 3 * 3 + 4 * 4 + 5 * 5 + 5 * 6);
    let deep = format!("deep:\n .for q, 1, 5\n call clear\n k = k + q\n .endfor\n ret\n{CLEAR}");
    gives(DECLARED, " k = 0\n .for i, 1, 6\n call deep\n k = k + i\n .endfor\n y = k\n", &deep, 6 * 15 + 21);
}

#[test]
fn keeps_sums_and_rests_across_calls() {
    // A sum that is a loop, in the subroutine and around the call.
    let sums = "clear:\n .for j, 1, 5\n m = sum(t, 1, j, B[t])\n .endfor\n ret\n";
    let body = " k = 0\n .for i, 1, 6\n call clear\n k = k + sum(t, 1, i, B[t]) + m\n .endfor\n y = k\n";
    gives(DECLARED, body, sums, 1 + 3 + 6 + 10 + 15 + 21 + 6 * 15);
    // The rest of an unrolled loop goes on from the registers of the loop, and the subroutine has a rest, too.
    let rest = "clear:\n m = 7\n .for j, 1, m max 8 unroll 2\n A[j] = 1.0\n .endfor\n ret\n";
    let body =
        " k = 0\n n = 7\n .for i, 1, n max 8 unroll 4\n call clear\n k = k + B[i] + i\n .endfor\n y = k\n";
    gives(DECLARED, body, rest, 28 + 28);
}

#[test]
fn loop_count_is_the_registers_initial_value() {
    for unroll in ["", " unroll 2", " unroll 4"] {
        let body = format!(
            " k = 0\n n = 7\n .for i, 1, n max 8{unroll}\n k = k + i\n n = n - 1\n .endfor\n y = k\n"
        );
        gives(DECLARED, &body, "", 28);
        let body = format!(
            " k = 0\n n = 7\n .for i, 0, n max 8{unroll}\n k = k + i\n call less\n .endfor\n y = k\n"
        );
        gives(DECLARED, &body, "less:\n n = n - 1\n ret\n", 28);
    }
}

/// The number of registers made for a program's loops.
fn made(text: &str, machine: &'static Machine) -> usize {
    let program = assembled(text, machine, Schedule::None).program;
    let names: BTreeSet<&str> = program.registers.iter().map(|named| named.name.as_str()).collect();
    names.iter().filter(|name| name.ends_with(".count") || name.ends_with(".offset")).count()
}

#[test]
fn loops_one_after_another_share_their_registers() {
    let mut text = format!("{DECLARED}.output y:int\n.once\n k = 0\n");
    for _ in 0..30 {
        text.push_str(" .for i, 1, 9\n A[2*i] = 1.0\n A[i] = 2.0\n k = k + i\n .endfor\n");
    }
    text.push_str(" y = k\n halt\n");
    let few = made(&text, &T3);
    assert!(few <= 3, "{few} registers");
    // Loops that call share registers too, apart from the subroutine's.
    let calling = text.replace(" k = k + i\n", " k = k + i\n call clear\n") + CLEAR;
    let more = made(&calling, &T3);
    assert!(few < more && more <= few + 2, "{few} and {more} registers");
    assert!(made(&calling, &F3) <= more + 2);
}

#[test]
fn nests_that_are_too_deep_by_calls_are_errors() {
    let mut text = String::from(".array A[8]\n.output y\n.period\np:\n");
    for index in ["i", "j", "k", "l"] {
        let _ = writeln!(text, " .for {index}, 1, 2 unroll 1");
    }
    text.push_str(
        " call sub\n .endfor\n .endfor\n .endfor\n .endfor\n y = A[1]\n wait p\nsub:\n call deep\n ret\n",
    );
    text.push_str("deep:\n .for m, 1, 8\n A[m] = 1.0\n .endfor\n ret\n");
    insta::assert_snapshot!(common::bad(&text, &T3).render(false));
    // Without loops of the sequencer nothing is too deep.
    for machine in [&F1, &F3] {
        assembled(&text, machine, Schedule::AsWritten);
    }
    // If the loop is written out, the nest is one level less deep.
    assembled(&text.replace(".for l, 1, 2 unroll 1", ".for l, 1, 2"), &T3, Schedule::AsWritten);
    let shallow: &Machine = Box::leak(Box::new(Machine { name: "shallow", loop_depth: 2, ..T3 }));
    let two = " .for i, 1, 9\n .for h, 1, 9\n call clear\n .endfor\n .endfor\n halt\n";
    let mistakes = common::bad(&format!("{DECLARED}.once\n{two}{CLEAR}"), shallow).render(false);
    assert!(mistakes.contains("nest 3 deep by calls: shallow counts 2"), "{mistakes}");
}

#[test]
fn loops_that_call_themselves_are_errors() {
    let text = ".array A[8]\n.reg c:int\n.once\n c = 2\n call sub\n halt\n\
                sub:\n .for m, 1, 8\n call other\n .endfor\n ret\nother:\n c = c - 1\n bz c, end\n call sub\nend: ret\n";
    insta::assert_snapshot!(common::bad(text, &T3).render(false));
    common::bad(text, &F1);
    // Recursion outside of loops is allowed.
    common::good(&text.replace(" .for m, 1, 8\n", "").replace(" .endfor\n", ""));
}

/// An index is an integer of 32 bits, also where an iteration is written out and its value is known: equal lines mean the same in the loop
/// and in its rest.
#[test]
fn the_index_of_an_iteration_that_is_written_out_has_32_bits() {
    type Function = fn(i32) -> i32;
    let parts: [(&str, Function); 9] = [
        ("(v*100000000)/256", |v| v.wrapping_mul(100_000_000) / 256),
        ("(v << 24) >> 24", |v| (v << 24) >> 24),
        ("(v*100000000) >> 3", |v| v.wrapping_mul(100_000_000) >> 3),
        ("v*100000000", |v| v.wrapping_mul(100_000_000)),
        ("(v << 26) < 0", |v| i32::from((v << 26) < 0)),
        ("(v*100000000 & -256) == (v << 26)", |v| i32::from(v.wrapping_mul(100_000_000) & -256 == v << 26)),
        ("halved(v << 27)", |v| (v << 27) >> 1),
        ("halved(halved(v*100000000))", |v| v.wrapping_mul(100_000_000) >> 2),
        ("halved(twice(v << 26))", |v| (v << 27) >> 1),
    ];
    let macros =
        ".macro halved d:int, a:int\n d = a >> 1\n.endm\n.macro twice d:int, a:int\n d = a << 1\n.endm\n";
    for (text, function) in parts {
        let expected = (1..=145).step_by(2).fold(0_i32, |sum, v| sum.wrapping_add(function(v)));
        for unroll in ["", " unroll 1", " unroll 8"] {
            let body =
                format!(" k = 0\n .for v, 1, 145 step 2{unroll}\n k = k + ({text})\n .endfor\n y = k\n");
            gives(&format!("{macros}{DECLARED}"), &body, "", expected);
        }
    }
}

/// Two loops with a label of the same name, and with declarations, however many of their iterations are written out.
#[test]
fn labels_of_a_body_are_local_to_an_iteration() {
    let last = |count: i64| count * (count + 1) / 2;
    for (count, unroll) in
        [(1, ""), (3, ""), (4, ""), (5, ""), (9, ""), (4, " unroll 1"), (9, " unroll 4"), (9, " unroll 9")]
    {
        let once = format!(
            " .for i, 1, {count}{unroll}\n.reg t:int v[2]:int\n.array D[3]:int\n.const by = 10\n.preset v = 1\n t = m\n bz t, skip\n \
             k = k + 100\nskip: k = k + i\n D[2] = k\n v[2] = D[2] + by\n .endfor\n"
        );
        let again = once.replace(".reg t:int v[2]:int\n.array D[3]:int\n.const by = 10\n.preset v = 1\n", "");
        let body = format!(" m = 0\n k = 0\n{once}{again} y = v[2]\n");
        gives(DECLARED, &body, "", 2 * last(count) as i32 + 10);
    }
    let text = " .for i, 1, 2\n bz k, skip\n k = 1\nskip: k = 2\n .endfor\n halt\n";
    let program = assembled(&format!("{DECLARED}.once\n k = 0\n{text}"), &T3, Schedule::None).program;
    let names: Vec<&str> = program.symbols.iter().map(|symbol| symbol.name.as_str()).collect();
    assert!(names.contains(&"skip.1") && names.contains(&"skip.2"), "{names:?}");
    // A label with the index in its name is distinct in each iteration, and known everywhere.
    let called = " call s2\n y = k\n halt\n .for i, 1, 3\ns{i}: k = 10*i\n ret\n .endfor\n";
    gives(DECLARED, called, "", 20);
    // A constant that depends on the index cannot be declared for all iterations.
    let differs = format!("{DECLARED}.once\n .for i, 1, 3\n.const c = 2*i\n k = c\n .endfor\n halt\n");
    let mistakes = common::bad(&differs, &T3).render(false);
    assert!(mistakes.contains("error[declared-twice]"), "{mistakes}");
}

#[test]
fn a_body_is_not_called() {
    let text = ".reg c:int\n.once\n call within\n .for i, 1, 9\n c = 1\nwithin:\n c = 2\n .endfor\n halt\n";
    insta::assert_snapshot!(common::bad(text, &T3).render(false));
    let number = ".reg c:int\n.once\n call 4\n .for i, 1, 9\n c = 1\n c = 2\n .endfor\n halt\n";
    let mistakes = common::bad(number, &F3).render(false);
    assert!(mistakes.contains("this calls into the body of a counted loop"), "{mistakes}");
    // A jump to a loop's first bundle is an error, too, rather than a further iteration.
    let head = ".reg c:int\n.once\n c = 0\n .for i, 1, 9\n c = c + 1\n .endfor\n bz c, 2\n halt\n";
    let mistakes = common::bad(head, &T3).render(false);
    assert!(mistakes.contains("this leads into the body of a counted loop"), "{mistakes}");
}

#[test]
fn merged_loop_registers_are_not_reported_unused() {
    let text = ".array A[8]\n.array B[8]\n.input n:int, x\n.output y\n.period\np:\n .for i, 1, n max 8\n A[i] = x\n .endfor\n \
                .for j, 1, n max 8\n B[j] = x\n .endfor\n y = A[1] + B[2]\n wait p\n";
    let warnings = assembled(text, &T3, Schedule::None).warnings;
    assert!(warnings.is_empty(), "{}", warnings.render(false));
}
