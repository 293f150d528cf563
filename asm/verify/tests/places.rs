// SPDX-License-Identifier: MIT OR Apache-2.0
//! Differences are reported at the line that differs; contractions and times are reported.

use crate::common::{build, check, text as words};
use takt_asm::{Contract, MemoryLoader, Options, Schedule};
use takt_isa::{Instruction, Op, T1, T3, T4};
use takt_verify::{MAX_STEPS, verify};

const SOURCE: &str = "\
.schedule on
.input a, b
.output y, z
.state s, c:int
.data
table: .float 1.0, 2.0, 3.0, 4.0
.once
    mov s, zero
    li c, 0
    wait p
.period
p:
.reg t u v
    iand c, c, 3
    ld t, table[c]
    fmul u, a, t
    fadd v, u, b
    fadd s, s, v
    bz c, skip
    fsub s, s, a
    st table[c], s
skip:
    iadd c, c, 1
    mov y, s
    fsqrt z, v
    wait p
";

/// Message of the checker for the image of `SOURCE` against a changed source.
fn against(from: &str, to: &str) -> String {
    let options = Options { machine: &T3, ..Options::default() };
    let image = build("a.s", &MemoryLoader::of("a.s", SOURCE), &options).expect("it assembles").0;
    assert!(SOURCE.contains(from), "{from}");
    let other = SOURCE.replacen(from, to, 1);
    let (assembled, plain) = build("a.s", &MemoryLoader::of("a.s", other), &options).expect("it assembles");
    match verify(&image.program, &plain, &assembled.contractions) {
        Ok(_) => "verified".to_owned(),
        Err(difference) => words(&plain, &difference).lines().next().unwrap_or_default().to_owned(),
    }
}

#[test]
fn a_difference_has_its_line() {
    assert_eq!(against("fmul u, a, t", "fmul u, a, t"), "verified");
    let line = |from: &str, to: &str| against(from, to).split(": ").next().unwrap_or_default().to_owned();
    assert_eq!(line("fsub s, s, a", "fsub s, s, b"), "a.s:20");
    assert_eq!(line("iand c, c, 3", "iand c, c, 1"), "a.s:15");
    assert_eq!(line("fmul u, a, t", "fmul u, b, t"), "a.s:16");
    assert_eq!(line("bz c, skip", "bnz c, skip"), "a.s:20");
    assert!(against("2.0, 3.0", "2.5, 3.0").contains("data word"));
}

#[test]
fn fused_sums_and_times_are_stated() {
    let source = ".schedule on\n.contract on\n.input a, b, c\n.output y\n.period\np:\n.reg t\n fmul t, a, b\n fadd y, t, c\n wait p\n";
    let options = Options { machine: &T4, contract: Contract::AsWritten, ..Options::default() };
    let (assembled, plain) = build("a.s", &MemoryLoader::of("a.s", source), &options).expect("it assembles");
    let established = check(&assembled, &plain).expect("it is its source");
    let lines: Vec<u32> = established.fused.iter().flatten().map(|at| at.line).collect();
    assert_eq!(lines, [9]);
    let claims = takt_analysis::section_cycles(&assembled.program).expect("it has bounds");
    assert_eq!(established.compare(&claims), Ok(1));
    let mut wrong = claims.clone();
    wrong[0].cycles.worst -= 1;
    wrong[0].cycles.best -= 1;
    assert!(established.compare(&wrong).is_err());
    // Without permission to contract, the fused sum differs from the source.
    let forbidden = source.replace(".contract on\n", "\n");
    let (_, plain) = build("a.s", &MemoryLoader::of("a.s", forbidden), &options).expect("it assembles");
    assert!(verify(&assembled.program, &plain, &assembled.contractions).is_err());
    assert!(verify(&assembled.program, &plain, &[]).is_err());
}

/// A period with a loop whose count is the input `n`, followed by `last`.
fn counting(bound: u32, last: &str) -> String {
    format!(
        ".schedule on\n.input n:int, x\n.output y:int\n.state s:int\n.reg i:int a e:int f:int\n.data\nv: .space 40\n.once\n li s, 0\n wait p\n\
         .period\np:\n li i, 0\n loop n, done\n.loop_bound {bound}\n ld a, v[i]\n fmul a, a, x\n st v+20[i], a\n iadd i, i, 1\ndone:\n\
         {last}\n li s, 1\n wait p\n"
    )
}

/// Assumptions about a count end with the period: an image that differs for another count in a later period is refused.
#[test]
fn counters_do_not_carry_over_periods() {
    let options = Options { machine: &T3, ..Options::default() };
    let build = |text: &str| build("a.s", &MemoryLoader::of("a.s", text), &options).expect("it assembles");
    let last = |third: &str| format!(" ieq e, n, 3\n iand f, s, e\n mov y, {third}");
    let (honest, plain) = build(&counting(12, &last("zero")));
    assert_eq!(honest.loops.len(), 1, "it is pipelined");
    assert!(check(&honest, &plain).is_ok(), "{:?}", check(&honest, &plain));
    let (wrong, _) = build(&counting(12, &last("f")));
    assert!(verify(&wrong.program, &plain, &honest.contractions).is_err());
    // The image's loop may not have a smaller bound than the source's.
    let mut bounded = honest.program.clone();
    bounded.loop_bounds.iter_mut().for_each(|bound| bound.most = 2);
    assert!(verify(&bounded, &plain, &honest.contractions).is_err());
}

/// Images under every scheduling option are verified, with selections, unrolled loops and spilled values among them.
#[test]
fn images_of_other_schedules_are_verified() {
    let selection_in_a_called_sub = "\
.input n:int\n.output y:int\n.reg k:int c:int\n.preset k = 0\n.schedule on\n.period\np: .for i, 1, 5\n call sub\n .endfor\n y = k\n wait p\n\
sub: ilt c, k, n\n bz c, L\n iadd k, k, 1\nL: ret\n";
    let count_at_run_time = "\
.array A[6]\n.input n:int, x\n.output y\n.schedule on\n.period\np: .for i, 1, n max 2 unroll 2\n A[3-i] = x\n .endfor\n y = A[1]\n wait p\n";
    let selection = "\
.input n:int, m:int\n.output y:int\n.reg k:int c:int\n.preset k = 0\n.schedule on\n.period\np: ilt c, k, n\n bz c, L\n iadd k, k, 1\nL: y = k\n wait p\n";
    let spilled = {
        use std::fmt::Write as _;
        let mut text = ".input x[20]\n.output y\n.schedule on\n.reg y0\n.period\np: y0 = 0\n".to_owned();
        for k in 1..=300 {
            let _ = writeln!(text, ".reg v{k}\n v{k} = x[{}]*{k}.5 + x[{}]", 1 + k % 20, 1 + k % 19);
        }
        for k in 1..=300 {
            let _ = writeln!(text, " y0 = y0 + v{k}*v{}", 301 - k);
        }
        text + " y = y0\n wait p\n"
    };
    let mut has_spills = false;
    for text in [selection_in_a_called_sub, count_at_run_time, selection, &spilled] {
        for machine in [&T1, &T3, &T4] {
            for schedule in [Schedule::None, Schedule::AsWritten, Schedule::All] {
                let options = Options { machine, schedule, effort: 0, ..Options::default() };
                let built = build("a.s", &MemoryLoader::of("a.s", text), &options);
                let Some((assembled, plain)) = built else { continue };
                has_spills |= assembled.spills.iter().any(|spills| !spills.values.is_empty());
                if let Err(difference) = verify(&assembled.program, &plain, &assembled.contractions) {
                    panic!("{schedule:?} on {}: {}\n{text}", machine.name, words(&plain, &difference));
                }
            }
        }
    }
    assert!(has_spills, "no program keeps values in data memory");
}

/// A loop whose body leaves `.schedule on` in its middle: the image selects in the first copy of the body, and branches in the others, on
/// the same condition.
#[test]
fn a_selection_in_one_copy_and_branches_in_others_are_verified() {
    const SOURCE: &str = ".schedule on\n.input x, m:int\n.output y\n.state s\n.reg f b:int\n.preset s = 0.5\n.period\n\
                          p: f = s - x\n .for i, 1, 3\n iand b, m, 1\n bz b, keep\n mov s, f\nkeep:\n.schedule off\n\
                          iand b, m, 1\n .endfor\n y = s\n wait p\n";
    for machine in [&T1, &T3, &T4] {
        let options = Options { machine, effort: 0, ..Options::default() };
        let (assembled, plain) =
            build("copies.s", &MemoryLoader::of("copies.s", SOURCE), &options).expect("it is right");
        assert_eq!(assembled.selections.len(), 1, "{}", machine.name);
        if let Err(difference) = check(&assembled, &plain) {
            panic!("{}: {}", machine.name, words(&plain, &difference));
        }
        // A branch that is taken on another condition.
        let mut program = assembled.program.clone();
        let word = (0..program.code.len())
            .find(|at| Instruction::decode(program.code[*at]).is_ok_and(|found| found.op == Op::bz))
            .expect("a branch");
        let mut branch = Instruction::decode(program.code[word]).expect("a branch");
        branch.op = Op::bnz;
        program.code[word] = branch.encode().expect("it has an encoding");
        assert!(verify(&program, &plain, &assembled.contractions).is_err(), "{}", machine.name);
    }
}

/// Checks the image of a source on three machines, and images of sources in which one text is replaced by another.
fn verified_unless_changed(source: &str, changes: &[[&str; 2]]) {
    for machine in [&T1, &T3, &T4] {
        let options = Options { machine, effort: 0, ..Options::default() };
        let build = |text: &str| {
            build("a.s", &MemoryLoader::of("a.s", text.to_owned()), &options).expect("it assembles")
        };
        let (assembled, plain) = build(source);
        let found = check(&assembled, &plain)
            .unwrap_or_else(|difference| panic!("{}: {}", machine.name, words(&plain, &difference)));
        let limit = MAX_STEPS / 10;
        assert!(found.steps < limit, "{}: {} steps of {limit}", machine.name, found.steps);
        for [from, to] in changes {
            assert!(source.contains(from), "{from}");
            let other = build(&source.replacen(from, to, 1)).0;
            let verdict = verify(&other.program, &plain, &other.contractions);
            assert!(verdict.is_err(), "{}: `{to}` in place of `{from}` is accepted", machine.name);
        }
    }
}

/// Outputs are compared at the `publish` that hands them over: neither a write moved behind it, nor another value, nor its absence is accepted.
#[test]
fn published_outputs_are_compared() {
    let source = "\
.schedule on\n.ports latched\n.input x\n.output y z\n.state s\n.reg t\n.once\n s = 0.0\n wait p\n.period\n\
p: y = x * s\n z = y + s\n publish\n t = sqrt(x)\n s = t + x\n wait p\n";
    let changes = [
        ["publish\n", "\n"],
        ["z = y + s\n publish", "publish\n z = y + s"],
        ["y + s", "y - s"],
        ["t + x", "t - x"],
    ];
    verified_unless_changed(source, &changes[..1]);
    verified_unless_changed(source, &changes[2..]);
    // The assembler refuses the second; an image can have it.
    for machine in [&T1, &T3, &T4] {
        let options = Options { machine, effort: 0, ..Options::default() };
        let loader = MemoryLoader::of("a.s", source.to_owned());
        let (assembled, plain) = build("a.s", &loader, &options).expect("it assembles");
        let mut program = assembled.program.clone();
        let slots = machine.slots.len();
        let writes = |bundle: &[u64], name: &str| {
            let port = assembled.program.outputs.iter().find(|port| port.name == name).expect("a port");
            let words = bundle.iter().zip(machine.slots);
            words
                .filter_map(|(word, slot)| Instruction::decode(*word).ok()?.writes(slot))
                .any(|to| to == port.register)
        };
        let at = |found: &dyn Fn(&[u64]) -> bool| {
            program.code.chunks(slots).position(found).expect("a bundle") * slots
        };
        let publish = at(&|bundle| {
            bundle.iter().any(|word| Instruction::decode(*word).is_ok_and(|found| found.op == Op::publish))
        });
        let last = at(&|bundle| writes(bundle, "z"));
        for place in 0..slots {
            program.code.swap(last + place, publish + place);
        }
        assert!(verify(&program, &plain, &assembled.contractions).is_err(), "{}", machine.name);
    }
}

/// The check follows the copies of the body further than the count allows, to a word of the array before: the image's order of accesses
/// to both arrays is another.
#[test]
fn paths_that_leave_an_array_end_there() {
    let source = "\
.schedule on\n.input n:int, x\n.output y\n.array A[4], B[4]\n.reg k:int\n.period\np: k = n & 3\n .for i, 1, k max 3 unroll 4\n\
 B[4-i] = A[4]*x\n A[4] = x\n .endfor\n y = A[4]\n wait p\n";
    let changes = [["B[4-i] = A[4]", "B[4-i] = A[3]"], ["A[4] = x", "A[4] = x*x"], ["B[4-i] =", "B[5-i] ="]];
    verified_unless_changed(source, &changes);
}

/// The check joins the iterations of the outer loop, and follows one that never comes: the inner loop would begin with the count 0, where
/// the source faults.
#[test]
fn paths_that_begin_a_loop_of_no_iteration_end_there() {
    let source = "\
.schedule on\n.input x, m:int\n.output y\n.state s c:int\n.preset c = 0\n.preset s = 0.5\n.reg f g n:int b:int\n\
.data\ntab: .float 1.0, -2.5\n.period\np: n = m & 1\n .for i, 1, n max 7\n .endfor\n .for i, 1, 4\n .endfor\n\
 .for i, 6, 1 step -1 unroll 2\n .for j, 1, i\n iand b, m, 1\n bz b, skip\nskip:\n .endfor\n\
 .for k, 1, i unroll 1\n n = c & 1\n ld g, tab+1\n f = ((x / (1.5 + abs(g))) * sat(s, 8.0))\n .endfor\n .endfor\n\
 y = f\n wait p\n";
    verified_unless_changed(source, &[["tab+1", "tab"], ["(1.5 +", "(2.5 +"], ["y = f", "y = g"]]);
}

/// The four copies of the inner loop have counts that differ by constants, so that a case of one decides all of them.
#[test]
fn counts_that_differ_by_constants_share_their_cases() {
    let source = "\
.schedule on\n.input x, z\n.output y\n.state s\n.preset s = 0.5\n.array A[12]\n.reg f g b:int\n.period\np:\n\
 .for i, 1, 9 step 2\n .for j, 1, i unroll 4\n .for k, 1, j\n f = x*z + s\n A[12-k] = z*f\n g = f*z + s*f\n .endfor\n .endfor\n\
 flt b, s, f\n bz b, skip\n y = g\nskip:\n .endfor\n s = x\n wait p\n";
    let changes = [["A[12-k]", "A[13-k]"], [".for k, 1, j", ".for k, 1, j+1"], ["s*f", "s*x"]];
    verified_unless_changed(source, &changes);
}

/// The check knows that two registers differ by a constant in every period, and forgets that if one of them moves faster.
#[test]
fn only_constant_differences_of_registers_are_relied_on() {
    for (step, is_known) in [(1, true), (2, false)] {
        let text = |y: &str| {
            format!(
                ".output y:int\n.state c:int d:int\n.preset c = 5\n.preset d = 0\n.period\np: {y}\n iadd c, c, {step}\n iadd d, d, 1\n wait p\n"
            )
        };
        let options = Options { machine: &T3, ..Options::default() };
        let build =
            |text: String| build("a.s", &MemoryLoader::of("a.s", text), &options).expect("it assembles");
        let (_, plain) = build(text("iadd y, d, 0"));
        let (assembled, _) = build(text("iadd y, c, -5"));
        let verdict = verify(&assembled.program, &plain, &assembled.contractions);
        assert_eq!(verdict.is_ok(), is_known, "{step}: {verdict:?}");
    }
}
