// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images with a random change: each that behaves differently in the emulator is refused.

#![allow(clippy::print_stdout)]

use crate::common::{build, check, set_random_inputs};
use crate::random::number;
use crate::random_source::{Random, source, source_with_loops};
use crate::shipped::{loader, shipped};
use takt_asm::plain::PlainProgram;
use takt_asm::{AssembledProgram, Contract, MemoryLoader, Options};
use takt_emu::Emulator;
use takt_isa::shape::OPCODE;
use takt_isa::{Instruction, Program, T1, T3, T4};
use takt_verify::verify;

const PERIODS: usize = 6;
const RUNS: u64 = 8;

/// Number of mutants: `TAKT_MUTANTS`, by default 200. `TAKT_SEED` selects others.
fn mutants() -> u64 {
    number("TAKT_MUTANTS").unwrap_or(200)
}

/// Applies a random change and describes it.
fn mutate(program: &mut Program, random: &mut Random) -> String {
    let slots = program.machine.slots.len();
    let bundles = program.code.len() / slots;
    let nop = Instruction::NOP.encode().expect("it has no operands");
    loop {
        let bundle = random.below(bundles as u64) as usize;
        let word = bundle * slots + random.below(slots as u64) as usize;
        let before = program.code.clone();
        let what = match random.below(8) {
            0 => {
                for slot in 0..slots {
                    program.code.swap(bundle * slots + slot, (bundle + 1) % bundles * slots + slot);
                }
                format!("bundles {bundle} and the next are swapped")
            }
            1 => {
                program.code[bundle * slots..(bundle + 1) * slots].fill(nop);
                format!("bundle {bundle} is dropped")
            }
            2 => {
                program.code[word] = nop;
                format!("word {word} is dropped")
            }
            3 => {
                program.code.swap(word, bundle * slots + random.below(slots as u64) as usize);
                format!("word {word} is in another slot")
            }
            4 if !program.constants.is_empty() => {
                let at = random.below(program.constants.len() as u64) as usize;
                program.constants[at].1 ^= 1 << random.below(32);
                return format!("constant {at} is another");
            }
            5 => {
                program.code[word] ^= OPCODE.put(1 << random.below(4));
                format!("word {word} has another opcode")
            }
            _ => {
                program.code[word] ^= 1 << random.below(41);
                format!("word {word} has another bit")
            }
        };
        let drops = what.contains("dropped");
        if program.code != before && (drops || program.code[word] != nop) {
            return what;
        }
        program.code = before;
    }
}

/// Observable behaviour of a run on inputs from a seed: values of each declared output in order, memory and flags; and whether it failed.
fn observe(program: &Program, plain: &PlainProgram, seed: u64) -> (Vec<String>, bool) {
    let Ok(mut emulator) = Emulator::new(program) else { return (vec!["not loaded".to_owned()], true) };
    emulator.set_cycle_limit(2_000_000);
    emulator.set_watched(program.outputs.iter().map(|port| port.register));
    let random = &mut Random::new(seed);
    let mut seen = Vec::new();
    for _ in 0..PERIODS {
        set_random_inputs(&mut emulator, program, random);
        let fault = emulator.run_period(&[]).err();
        let writes = emulator.take_port_writes();
        for port in &program.outputs {
            let of_port = writes.iter().filter(|write| write.register == port.register);
            let values: Vec<u32> = of_port.map(|write| write.value).collect();
            seen.push(format!("{} {values:x?}", port.name));
        }
        if fault.is_some() {
            seen.push("a fault".to_owned());
            return (seen, true);
        }
        let words = plain.machine.data_depth as usize;
        let memory = &emulator.memory()[..words];
        seen.push(format!("flags {:?} memory {memory:x?}", emulator.flags()));
    }
    (seen, false)
}

fn victims() -> Vec<(String, AssembledProgram, PlainProgram)> {
    let mut victims = Vec::new();
    for (folder, name) in shipped() {
        let wanted = folder.ends_with("examples") || folder.ends_with("hybrid") || folder.ends_with("arm");
        let small = ["fir.s", "dot.s", "table.s", "matvec.s", "iir.s", "fir2dim.s", "minver.s", "ludcmp.s"];
        if !(wanted || small.contains(&name.as_str())) {
            continue;
        }
        for machine in [&T1, &T3, &T4] {
            let options = Options { machine, contract: Contract::All, effort: 0, ..Options::default() };
            let built = build(&name, &loader(&folder), &options);
            let built = built.filter(|(_, plain)| !plain.bundles.is_empty());
            victims.extend(
                built.map(|(assembled, plain)| (format!("{name} on {}", machine.name), assembled, plain)),
            );
        }
    }
    for seed in 0..12 {
        let loader =
            MemoryLoader::of("random.s", if seed % 2 == 0 { source(seed) } else { source_with_loops(seed) });
        let built =
            build("random.s", &loader, &Options { contract: Contract::All, effort: 0, ..Options::default() });
        victims.extend(built.map(|(assembled, plain)| (format!("random {seed}"), assembled, plain)));
    }
    victims
}

#[test]
fn rejects_every_different_mutant() {
    let victims = victims();
    let random = &mut Random::new(number("TAKT_SEED").unwrap_or(38));
    let (mut refused, mut differing, mut alike, mut placed) = (0, 0, 0, 0);
    for (_, assembled, plain) in &victims {
        check(assembled, plain).expect("it is its source before it is changed");
    }
    for number in 0..mutants() {
        let (name, assembled, plain) = &victims[random.below(victims.len() as u64) as usize];
        let mut program = assembled.program.clone();
        let what = mutate(&mut program, random);
        let verdict = verify(&program, plain, &assembled.contractions);
        let differs = (0..RUNS).any(|seed| {
            let (expected, faults) = observe(&assembled.program, plain, seed);
            let (found, _) = observe(&program, plain, seed);
            match faults {
                // Behaviour after a fault of the source, and just before it, is undefined.
                true => false,
                false => expected != found,
            }
        });
        match &verdict {
            Ok(_) => {
                assert!(!differs, "mutant {number}: {name}: {what}: accepted, but it does something else")
            }
            Err(difference) => {
                refused += 1;
                placed += usize::from(difference.place.is_some());
                alike += usize::from(!differs);
            }
        }
        differing += usize::from(differs);
    }
    let figures = format!(
        "{} mutants: {differing} do something else; {refused} refused, {alike} of them alike in {RUNS} runs, {placed} with a line",
        mutants()
    );
    println!(
        "figures: mutants={} differing={differing} refused={refused} refused_but_alike={alike} with_a_line={placed}",
        mutants()
    );
    assert!(differing as u64 > mutants() / 3 && placed > refused / 2, "{figures}");
}
