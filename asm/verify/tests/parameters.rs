// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters of images: each field is compared, and no value of a parameter is taken for known.

use crate::common::{build, check, text};
use takt_asm::{MemoryLoader, Options};
use takt_isa::{Instruction, Program, T1, T3, T4, Type};

/// A word of the refusal, and the change.
type Change = (&'static str, fn(&mut Program));

const SOURCE: &str = ".param kp = 2 range 0..50\n.param ki = 2 range 0..50\n.param n:int = 3\n.input x\n.output F, G, k:int\n.state s\n\
                      .once\n s = kp*ki\n wait p\n.period\np: F = kp*x + s\n G = ki*x\n k = n\n wait p\n";

#[test]
fn changed_parameters_are_refused_by_name() {
    let changes: [Change; 9] = [
        ("parameter", |program| program.parameters[0].name.push('_')),
        ("parameter", |program| program.parameters[2].ty = Type::F),
        ("parameter", |program| _ = program.parameters.pop()),
        ("parameter", |program| program.parameters.push(program.inputs[0].clone())),
        ("input", |program| {
            let moved = program.parameters.remove(0);
            program.inputs.push(moved);
        }),
        ("parameter", |program| {
            let register = program.parameters[0].register;
            program.parameters[0].register = program.parameters[1].register;
            program.parameters[1].register = register;
        }),
        ("value at the start", |program| {
            let register = program.parameters[1].register;
            program
                .constants
                .iter_mut()
                .filter(|constant| constant.0 == register)
                .for_each(|constant| constant.1 = 0);
        }),
        ("range", |program| program.ranges[0].high = 60f32.to_bits()),
        ("range", |program| _ = program.ranges.remove(1)),
    ];
    for machine in [&T1, &T3, &T4] {
        let loader = MemoryLoader::of("a.s", SOURCE);
        let (assembled, plain) =
            build("a.s", &loader, &Options { machine, ..Options::default() }).expect("it assembles");
        check(&assembled, &plain)
            .unwrap_or_else(|found| panic!("{}: {}", machine.name, text(&plain, &found)));
        for (number, (word, change)) in changes.iter().enumerate() {
            let mut changed = assembled.clone();
            change(&mut changed.program);
            let refused = text(&plain, &check(&changed, &plain).expect_err("a changed field"));
            assert!(refused.contains(word), "{}: change {number}: {refused}", machine.name);
        }
        // Both parameters begin with the same value: reading the wrong one is a difference in `.once` and in the period.
        let [one, other] = [0, 1].map(|at| assembled.program.parameters[at].register);
        let mut mutants = 0;
        for word in 0..assembled.program.code.len() {
            let Ok(mut instruction) = Instruction::decode(assembled.program.code[word]) else { continue };
            let Some(source) = instruction.sources.iter_mut().find(|source| [one, other].contains(source))
            else {
                continue;
            };
            *source = if *source == one { other } else { one };
            let mut changed = assembled.clone();
            changed.program.code[word] = instruction.encode().expect("it is legal");
            assert!(
                check(&changed, &plain).is_err(),
                "{}: word {word} reads another parameter",
                machine.name
            );
            mutants += 1;
        }
        assert!(mutants >= 3, "{}: {mutants}", machine.name);
    }
}
