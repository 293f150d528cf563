// SPDX-License-Identifier: MIT OR Apache-2.0
//! Loads and stores at addresses known to differ are not ordered: the same memory and registers result, in fewer cycles.

use crate::common;
use crate::random_source::Random;
use std::fmt::Write as _;
use takt_asm::{MemoryLoader, Options, Schedule, assemble};
use takt_emu::Emulator;
use takt_isa::{F3, MACHINES, Machine, Program};

fn program(text: &str, machine: &'static Machine, schedule: Schedule) -> Program {
    let options = Options { machine, schedule, effort: 0, ..Options::default() };
    let assembled = assemble("random.s", &MemoryLoader::of("random.s", text), &options);
    assembled.unwrap_or_else(|errors| panic!("{text}\n{}", errors.render(false))).program
}

/// A block of loads and stores at constant addresses, at offsets from bases that stay, that change and that are copied, and of
/// arithmetic on the loaded values.
fn source(seed: u64) -> String {
    let random = &mut Random::new(seed);
    let mut text = String::from(
        ".schedule on\n.input n:int, m:int\n.output y:bits\n.state fixed:int, p:int, q:int, r:int\n\
         .preset fixed = 8\n.data\nwords: .word 3, 1, 4, 1, 5, 9, 2, 6\n .space 24\n.once\n li p, 4\n li q, 9\n li r, 12\n",
    );
    for k in 0..6 {
        let _ = writeln!(text, ".state v{k}:int\n li v{k}, {k}");
    }
    text.push_str(" wait period\n.period\nperiod:\n");
    for _ in 0..30 + random.below(40) {
        let value = format!("v{}", random.below(6));
        let base = random.pick(&["zero", "8", "fixed", "p", "q", "r", "n"]);
        let place = format!("{}[{base}]", random.below(if base == "zero" { 32 } else { 8 }));
        let _ = match random.below(12) {
            0..=3 => writeln!(text, " ld {value}, {place}"),
            4..=7 => writeln!(text, " st {place}, {value}"),
            8 => writeln!(text, " iadd {value}, {value}, v{}", random.below(6)),
            // Within the memory for any value: 0 to 15.
            9 => writeln!(text, " iand {}, {value}, 15", random.pick(&["p", "q", "r"])),
            10 => writeln!(text, " mov {}, {}", random.pick(&["p", "q"]), random.pick(&["q", "r", "fixed"])),
            _ => writeln!(text, " mov y, {value}"),
        };
    }
    text.push_str(" mov y, v0\n wait period\n");
    text
}

/// The memory, the value of each name, and the cycles.
type RunResult = (Vec<u32>, Vec<(String, Option<u32>)>, u64);

/// The memory, the value of each name that outlives the period, and the cycles, after some periods.
fn run(program: &Program, seed: u64) -> RunResult {
    let random = &mut Random::new(seed + 5);
    let mut emulator = Emulator::new(program).expect("it fits");
    let mut cycles = 0;
    for _ in 0..4 {
        for port in &program.inputs {
            emulator.set_input_bits(port.register, random.below(16) as u32).expect("it is an input");
        }
        cycles += emulator.run_period(&[]).unwrap_or_else(|error| panic!("{error}")).cycles;
    }
    let named = program.registers.iter().chain(&program.outputs).filter(|port| !port.name.contains('.'));
    let registers = named.map(|port| (port.name.clone(), emulator.register(port.register))).collect();
    (emulator.memory().to_vec(), registers, cycles)
}

#[test]
fn memory_and_registers_equal_the_sources() {
    let (mut before, mut after) = (0, 0);
    for seed in 0..common::programs(100, 1000) {
        let text = source(seed);
        for machine in MACHINES {
            let (memory, registers, plain) = run(&program(&text, machine, Schedule::None), seed);
            let found = run(&program(&text, machine, Schedule::AsWritten), seed);
            assert_eq!(found.0, memory, "seed {seed} on {}:\n{text}", machine.name);
            assert_eq!(found.1, registers, "seed {seed} on {}:\n{text}", machine.name);
            before += plain;
            after += found.2;
        }
    }
    assert!(10 * after < 9 * before, "{after} cycles scheduled, {before} as written");
}

#[test]
fn a_cascade_of_biquads_is_as_short_as_its_chain() {
    let assembled =
        common::assemble_file("kernels", "biquads.s", &F3).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
    let block = block.expect("the period is a block");
    assert_eq!((block.cycles, block.bound.cycles()), (81, 81)); // 187 with every store and load in order
}

/// Cycles of a period of stores and loads, one after the other or not.
fn cycles(body: &str) -> u32 {
    let text = format!(
        ".schedule on\n.input x, n:int\n.output y, z\n.reg a b\n.state p:int\n.data\nt: .space 8\n.once\n li p, 1\n\
         wait period\n.period\nperiod:\n{body}\n wait period\n"
    );
    let assembled = common::good(&text);
    let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
    let block = block.expect("the period is a block");
    assert!(block.bound.cycles() <= block.cycles);
    block.cycles
}

#[test]
fn only_possibly_aliasing_accesses_are_ordered() {
    // The store waits for a product; a load that need not wait for it ends long before.
    let body = |store: &str, load: &str| {
        cycles(&format!(
            " fsqrt a, x\n fmul a, a, a\n st {store}, a\n ld b, {load}\n fsqrt b, b\n fsqrt y, b"
        ))
    };
    let together = body("t", "t");
    for (store, load) in
        [("t", "t+1"), ("t[p]", "t+1[p]"), ("[p]", "7[p]"), ("t", "t[1]"), ("t+1", "t[zero]")]
    {
        assert!(body(store, load) + 10 < together, "{store} and {load}");
    }
    for (store, load) in [("t+1", "t[1]"), ("t[p]", "t"), ("t[p]", "t[p]"), ("t[n]", "t+1[n]")] {
        assert_eq!(body(store, load), together, "{store} and {load}");
    }
    // Another value of the base, and a copy of the same.
    let moved = |between: &str, load: &str| {
        cycles(&format!(
            ".reg q:int\n fsqrt a, x\n fmul a, a, a\n st t[p], a\n {between}\n ld b, {load}\n fsqrt b, b\n fsqrt y, b"
        ))
    };
    assert!(moved("iadd p, p, 1", "t+1[p]") >= together);
    assert!(moved("mov q, p", "t+1[q]") + 10 < together);
    // A result that is neither a sum nor a difference may be the same word, whatever its constant.
    assert!(moved("isar q, p, 1", "t[q]") >= together);
}

#[test]
fn port_writes_keep_their_order_with_faulting_operations() {
    // Neither of two loads waits for the other: the port must come after both, and before the next two.
    let text = "\
.schedule on
.input x, n:int, far:int
.output y, z
.reg a b c d
.data
t: .float 1
.period
period: fsqrt a, x
        fmul x1, a, a
        ftoi i1, x1
        ld a, [i1]
        ld b, [n]
        mov z, x
        ld c, [far]
        ld d, 1[n]
        mov y, x
        ld c, t
        st 1, c
        wait period
";
    let text = text.replace(".reg a", ".reg x1, i1:int, a");
    let all = common::bundles(&common::good(&text));
    let place = |what: &str| {
        all.iter().position(|bundle| bundle.contains(what)).unwrap_or_else(|| panic!("{what} in {all:?}"))
    };
    assert!(["0[i1]", "0[n]"].iter().all(|load| place(load) <= place("mov z, x")));
    assert!(["0[far]", "1[n]"].iter().all(|load| place("mov z, x") < place(load)));
    assert!(["0[far]", "1[n]"].iter().all(|load| place(load) <= place("mov y, x")));
    // An access within the memory cannot fault, so it need not wait for the ports.
    assert!(place("0[zero]") < place("mov z, x"));
}
