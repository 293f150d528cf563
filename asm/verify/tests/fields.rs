// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images with one changed field outside their code: each is rejected, and the message names the field.

#![allow(clippy::print_stdout)]

use crate::common::{build, check, set_random_inputs};
use crate::random::{number, text};
use crate::random_source::Random;
use std::collections::{BTreeMap, BTreeSet};
use takt_asm::plain::{PlainKind, PlainProgram};
use takt_asm::{AssembledProgram, MemoryLoader, Options};
use takt_emu::{Emulator, Event};
use takt_isa::program::{LoopBound, Port, Range, Space, Symbol};
use takt_isa::{BundleAddress, Machine, Program, Register, T1, T3, T4, Type};
use takt_verify::verify;

/// A change of a field: the field, words that the message may contain, and the change, which does nothing without such a field.
struct Change {
    field: &'static str,
    names: &'static [&'static str],
    make: fn(&mut Program, &PlainProgram, &mut Random),
}

fn pick(random: &mut Random, length: usize) -> usize {
    random.below(length as u64) as usize
}

fn other_type(ty: Type, random: &mut Random) -> Type {
    let others = [Type::F, Type::I, Type::B].into_iter().filter(|other| *other != ty);
    others.collect::<Vec<_>>()[pick(random, 2)]
}

fn change_port(ports: &mut [Port], random: &mut Random, change: fn(&mut Port, &mut Random)) {
    if !ports.is_empty() {
        let at = pick(random, ports.len());
        change(&mut ports[at], random);
    }
}

fn rename(port: &mut Port, _: &mut Random) {
    port.name.push('_');
}

fn retype(port: &mut Port, random: &mut Random) {
    port.ty = other_type(port.ty, random);
}

/// Gives a port a free number.
fn renumber(ports: &mut [Port], machine: &Machine, random: &mut Random) {
    if ports.is_empty() {
        return;
    }
    let at = pick(random, ports.len());
    let register = ports[at].register;
    let banks = machine.slots.iter().map(|slot| &slot.bank).chain([&machine.inputs]);
    let bank = banks.into_iter().find(|bank| bank.contains(register)).expect("it lies in a bank");
    let is_free = |place: &Register| {
        let number = |register: Register| (machine.input_number(register), machine.output_number(register));
        number(*place) != (None, None) && ports.iter().all(|port| number(port.register) != number(*place))
    };
    let places: Vec<Register> = bank.registers().filter(is_free).collect();
    if !places.is_empty() {
        ports[at].register = places[pick(random, places.len().min(5))];
    }
}

fn swap(ports: &mut [Port], random: &mut Random) {
    if ports.len() > 1 {
        let at = pick(random, ports.len() - 1);
        let register = ports[at].register;
        ports[at].register = ports[at + 1].register;
        ports[at + 1].register = register;
    }
}

fn lose<T>(list: &mut Vec<T>, random: &mut Random) {
    if !list.is_empty() {
        let at = pick(random, list.len());
        list.remove(at);
    }
}

fn twice<T: Clone>(list: &mut Vec<T>, random: &mut Random) {
    if !list.is_empty() {
        let at = pick(random, list.len());
        list.insert(at, list[at].clone());
    }
}

fn change_bound(program: &mut Program, random: &mut Random, change: fn(&mut LoopBound, &mut Random)) {
    if !program.loop_bounds.is_empty() {
        let at = pick(random, program.loop_bounds.len());
        change(&mut program.loop_bounds[at], random);
    }
}

fn change_range(program: &mut Program, random: &mut Random, change: fn(&mut Range, &mut Random)) {
    if !program.ranges.is_empty() {
        let at = pick(random, program.ranges.len());
        change(&mut program.ranges[at], random);
    }
}

fn change_symbol(
    program: &mut Program,
    random: &mut Random,
    space: Space,
    change: fn(&mut Symbol, &mut Random),
) {
    let mut symbols: Vec<&mut Symbol> =
        program.symbols.iter_mut().filter(|symbol| symbol.space == space).collect();
    if !symbols.is_empty() {
        let at = pick(random, symbols.len());
        change(symbols[at], random);
    }
}

/// Named registers of a source other than ports; the assembler's own registers are for debuggers.
fn own<'p>(program: &'p mut Program, plain: &PlainProgram) -> Vec<&'p mut Port> {
    let is_own = |port: &&mut Port| {
        let named = |register: &&takt_asm::plain::PlainRegister| {
            register.name == port.name && !port.name.contains('.')
        };
        plain.registers.iter().find(named).is_some()
    };
    program.registers.iter_mut().filter(is_own).collect()
}

const CHANGES: &[Change] = &[
    Change {
        field: "machine",
        names: &["the image is for"],
        make: |program, _, _| {
            program.machine =
                Machine::from_name(&format!("{},data=8192", program.machine.name)).expect("it has an option");
        },
    },
    Change {
        field: "data: a bit",
        names: &["data word"],
        make: |program, _, random| {
            if !program.data.is_empty() {
                let at = pick(random, program.data.len());
                program.data[at] ^= 1 << random.below(32);
            }
        },
    },
    Change { field: "data: a word more", names: &["data word"], make: |program, _, _| program.data.push(7) },
    Change {
        field: "inputs: a name",
        names: &["input"],
        make: |program, _, random| change_port(&mut program.inputs, random, rename),
    },
    Change {
        field: "inputs: a type",
        names: &["input"],
        make: |program, _, random| change_port(&mut program.inputs, random, retype),
    },
    Change {
        field: "inputs: a number",
        names: &["input"],
        make: |program, _, random| renumber(&mut program.inputs, program.machine, random),
    },
    Change {
        field: "inputs: two numbers",
        names: &["input"],
        make: |program, _, random| swap(&mut program.inputs, random),
    },
    Change {
        field: "inputs: one less",
        names: &["input"],
        make: |program, _, random| lose(&mut program.inputs, random),
    },
    Change {
        field: "inputs: one more",
        names: &["input"],
        make: |program, _, random| twice(&mut program.inputs, random),
    },
    Change {
        field: "outputs: a name",
        names: &["output"],
        make: |program, _, random| change_port(&mut program.outputs, random, rename),
    },
    Change {
        field: "outputs: a type",
        names: &["output"],
        make: |program, _, random| change_port(&mut program.outputs, random, retype),
    },
    Change {
        field: "outputs: a number",
        names: &["output"],
        make: |program, _, random| renumber(&mut program.outputs, program.machine, random),
    },
    Change {
        field: "outputs: two numbers",
        names: &["output"],
        make: |program, _, random| swap(&mut program.outputs, random),
    },
    Change {
        field: "outputs: one less",
        names: &["output"],
        make: |program, _, random| lose(&mut program.outputs, random),
    },
    Change {
        field: "outputs: one more",
        names: &["output"],
        make: |program, _, random| twice(&mut program.outputs, random),
    },
    Change {
        field: "latched",
        names: &["latched"],
        make: |program, _, _| program.latched = !program.latched,
    },
    Change {
        field: "registers: a name",
        names: &["register"],
        make: |program, plain, random| {
            let mut own = own(program, plain);
            if !own.is_empty() {
                let at = pick(random, own.len());
                rename(own[at], random);
            }
        },
    },
    Change {
        field: "registers: a type",
        names: &["register"],
        make: |program, plain, random| {
            let mut own = own(program, plain);
            if !own.is_empty() {
                let at = pick(random, own.len());
                retype(own[at], random);
            }
        },
    },
    Change {
        field: "registers: a place",
        names: &["register", "range"],
        make: |program, _, _| {
            // Two registers with different initial values.
            let place = |name: &str| program.registers.iter().position(|port| port.name == name);
            if let (Some(at), Some(other)) = (place("s0"), place("s1")) {
                let register = program.registers[at].register;
                program.registers[at].register = program.registers[other].register;
                program.registers[other].register = register;
            }
        },
    },
    Change {
        field: "registers: a state less",
        names: &["register"],
        make: |program, plain, _| {
            let states: Vec<&str> = plain
                .registers
                .iter()
                .filter(|register| register.kind == PlainKind::State)
                .map(|register| register.name.as_str())
                .collect();
            if let Some(at) = program.registers.iter().position(|port| states.contains(&port.name.as_str())) {
                program.registers.remove(at);
            }
        },
    },
    Change {
        field: "symbols: a name",
        names: &["label"],
        make: |program, _, random| {
            let space = if random.below(2) == 0 { Space::Code } else { Space::Data };
            change_symbol(program, random, space, |symbol, _| symbol.name.push('_'));
        },
    },
    Change {
        field: "symbols: a data word",
        names: &["label"],
        make: |program, _, random| {
            change_symbol(program, random, Space::Data, |symbol, _| symbol.address += 1);
        },
    },
    Change {
        field: "symbols: one more",
        names: &["label"],
        make: |program, _, random| twice(&mut program.symbols, random),
    },
    Change {
        field: "sections: the first bundle of a period",
        names: &["section", "label"],
        make: |program, _, random| {
            if let [once, period] = &mut program.sections[..] {
                let at = BundleAddress::new(if random.below(2) == 0 {
                    period.start.get() + 1
                } else {
                    period.start.get() - 1
                });
                (once.end, period.start) = (at, at);
            }
        },
    },
    Change {
        field: "sections: a name",
        names: &["section", "label"],
        make: |program, _, _| {
            if let [period] = &mut program.sections[..] {
                period.name = if period.name == "once" { "period" } else { "once" }.to_owned();
            }
        },
    },
    Change {
        field: "loop_bounds: more iterations",
        names: &["bound"],
        make: |program, _, random| {
            change_bound(program, random, |bound, random| bound.most += 1 + random.below(4) as u32)
        },
    },
    Change {
        field: "loop_bounds: fewer iterations",
        // A loop that ends earlier may begin another one that the source does not.
        names: &["bound", "counted loops"],
        make: |program, _, random| change_bound(program, random, |bound, _| bound.most -= 1),
    },
    Change {
        field: "loop_bounds: a total",
        names: &["bound"],
        make: |program, _, random| {
            change_bound(program, random, |bound, random| {
                bound.total = match bound.total {
                    Some(_) if random.below(2) == 0 => None,
                    Some(total) => Some(if random.below(2) == 0 { total + 1 } else { total - 1 }),
                    None => Some(9),
                };
            });
        },
    },
    Change {
        field: "loop_bounds: one less",
        names: &["bound"],
        make: |program, _, random| lose(&mut program.loop_bounds, random),
    },
    Change {
        field: "loop_bounds: one more",
        names: &["bound"],
        make: |program, _, random| {
            let address = BundleAddress::new(random.below(u64::from(program.bundles())) as u32);
            if program.loop_bounds.iter().all(|bound| bound.address != address) {
                program.loop_bounds.push(LoopBound { address, most: 77, total: None });
            }
        },
    },
    Change {
        field: "loop_bounds: a place",
        names: &["bound"],
        make: |program, _, random| {
            let taken: Vec<BundleAddress> = program.loop_bounds.iter().map(|bound| bound.address).collect();
            let end = program.bundles();
            if !taken.is_empty() {
                let bound = &mut program.loop_bounds[pick(random, taken.len())];
                let next = BundleAddress::new((bound.address.get() + 1) % end);
                if !taken.contains(&next) {
                    bound.address = next;
                }
            }
        },
    },
    Change {
        field: "ranges: an end",
        names: &["range"],
        make: |program, _, random| {
            change_range(program, random, |range, random| {
                if random.below(2) == 0 { range.low ^= 1 } else { range.high ^= 1 }
            });
        },
    },
    Change {
        field: "ranges: a type",
        names: &["range"],
        make: |program, _, random| {
            change_range(program, random, |range, _| {
                range.ty = if range.ty == Type::I { Type::F } else { Type::I }
            });
        },
    },
    Change {
        field: "ranges: a register",
        names: &["range"],
        make: |program, _, random| {
            let ports: Vec<Register> =
                program.inputs.iter().chain(&program.registers).map(|port| port.register).collect();
            let taken: Vec<Register> = program.ranges.iter().map(|range| range.register).collect();
            let other = ports[pick(random, ports.len())];
            if !taken.is_empty() && !taken.contains(&other) {
                program.ranges[pick(random, taken.len())].register = other;
            }
        },
    },
    Change {
        field: "ranges: one less",
        names: &["range"],
        make: |program, _, random| lose(&mut program.ranges, random),
    },
    Change {
        field: "ranges: one more",
        names: &["range"],
        make: |program, _, random| {
            let port = &program.inputs[pick(random, program.inputs.len())];
            if program.ranges.iter().all(|range| range.register != port.register) {
                program.ranges.push(Range { register: port.register, ty: Type::I, low: 0, high: 1 });
            }
        },
    },
];

/// Programs with all fields, each with the seed of its source.
fn victims(first: u64, count: u64) -> Vec<(u64, AssembledProgram, PlainProgram)> {
    let mut victims = Vec::new();
    for seed in (first..first + 4 * count).filter(|seed| seed % 4 >= 2) {
        let machine = [&T3, &T1, &T4][seed as usize % 3];
        let options = Options { machine, effort: 0, ..Options::default() };
        let built = build("random.s", &MemoryLoader::of("random.s", text(seed)), &options);
        let built = built.filter(|(assembled, plain)| check(assembled, plain).is_ok());
        victims.extend(built.map(|(assembled, plain)| (seed, assembled, plain)));
    }
    victims
}

/// Periods of a run, and runs, that look for a difference.
const PERIODS: usize = 20;
const RUNS: u64 = 8;

/// Runs a program on random inputs; calls `look` at the end of every period, and returns the bundles that issue.
fn watch(program: &Program, mut look: impl FnMut(&Emulator)) -> BTreeSet<BundleAddress> {
    let mut issued = BTreeSet::new();
    for run in 0..RUNS {
        let mut emulator = Emulator::new(program).expect("it fits");
        emulator.set_cycle_limit(1_000_000);
        let random = &mut Random::new(run);
        for _ in 0..PERIODS {
            set_random_inputs(&mut emulator, program, random);
            let mut sink = |event: &Event| {
                if let Event::Issue { address, .. } = event {
                    issued.insert(*address);
                }
            };
            if emulator.observed(&mut sink).run_period(&[]).is_err() {
                break;
            }
            look(&emulator);
        }
    }
    issued
}

/// The change makes no difference in any run: it exchanges the places of states that are equal whenever a period ends, or moves the
/// bound of a loop that no run enters.
fn is_alike(program: &Program, changed: &Program) -> bool {
    let places = program.registers.iter().zip(&changed.registers).map(|(a, b)| (a.register, b.register));
    let moved: Vec<(Register, Register)> = places.filter(|(a, b)| a != b).collect();
    let bounds = program.loop_bounds.iter().zip(&changed.loop_bounds);
    let bounds: Vec<BundleAddress> =
        bounds.filter(|(a, b)| a.address != b.address).flat_map(|(a, b)| [a.address, b.address]).collect();
    // The change undone.
    let mut same = changed.clone();
    for (port, original) in same.registers.iter_mut().zip(&program.registers) {
        port.register = original.register;
    }
    for (bound, original) in same.loop_bounds.iter_mut().zip(&program.loop_bounds) {
        bound.address = original.address;
    }
    if same != *program {
        return false;
    }
    let mut are_equal = true;
    let issued = watch(program, |emulator| {
        are_equal &= moved.iter().all(|(a, b)| emulator.register(*a) == emulator.register(*b));
    });
    are_equal && bounds.iter().all(|address| !issued.contains(address))
}

#[test]
fn every_changed_field_is_refused_by_name() {
    let seed = number("TAKT_SEED").unwrap_or(5);
    let mutants = number("TAKT_MUTANTS").unwrap_or(1500);
    let victims = victims(seed, (mutants / 50).clamp(8, 200));
    let random = &mut Random::new(seed);
    let mut refused: BTreeMap<&str, u64> = BTreeMap::new();
    let mut accepted = Vec::new();
    let (mut made, mut alike) = (0, 0);
    while made < mutants {
        let (of, assembled, plain) = &victims[random.below(victims.len() as u64) as usize];
        let Change { field, names, make } = &CHANGES[random.below(CHANGES.len() as u64) as usize];
        let mut program = assembled.program.clone();
        make(&mut program, plain, random);
        if program == assembled.program {
            continue;
        }
        made += 1;
        match verify(&program, plain, &assembled.contractions) {
            Ok(_) if is_alike(&assembled.program, &program) => alike += 1,
            Ok(_) => accepted.push(format!("{field} of the program {of}")),
            Err(difference) => {
                let what = &difference.what;
                assert!(names.iter().any(|name| what.contains(name)), "{field} of the program {of}: {what}");
                *refused.entry(field).or_default() += 1;
            }
        }
    }
    assert!(accepted.is_empty(), "{} of {mutants} accepted:\n{}", accepted.len(), accepted.join("\n"));
    println!(
        "figures: mutants={made} refused={} alike={alike} fields={}",
        refused.values().sum::<u64>(),
        refused.len()
    );
    assert!(refused.len() == CHANGES.len() || mutants < 1000, "{refused:?}");
}

/// The count is known at run time but not to the assembler, so only one copy of the pipelined loop runs; both copies have bounds.
#[test]
fn bounds_of_both_copies_of_a_loop_are_compared() {
    for count in [2, 8] {
        let source = format!(
            ".schedule on\n.array A[9]\n.input x\n.output y\n.state n:int\n.preset n = {count}\n.once\n wait p\n.period\n\
             p: .for i, 1, n max 8\n A[i] = A[i]*x + x\n .endfor\n y = A[1]\n mov n, {count}\n wait p\n"
        );
        let options = Options { machine: &T3, effort: 0, ..Options::default() };
        let loader = MemoryLoader::of("copies.s", source);
        let (assembled, plain) = build("copies.s", &loader, &options).expect("it is right");
        let loops = assembled.program.loop_bounds.len();
        assert!(check(&assembled, &plain).is_ok() && loops >= 2, "{loops} loops");
        for at in 0..loops {
            let less = |change: fn(&mut Vec<LoopBound>, usize)| {
                let mut program = assembled.program.clone();
                change(&mut program.loop_bounds, at);
                verify(&program, &plain, &assembled.contractions)
            };
            assert!(less(|bounds, at| bounds[at].most -= 1).is_err(), "count {count}, bound {at}");
            let without = |bounds: &mut Vec<LoopBound>, at| {
                bounds.remove(at);
            };
            assert!(less(without).is_err(), "count {count}, no bound {at}");
        }
    }
}

/// Two adjacent loops with bounds of their own: an image without one of the bounds is rejected.
#[test]
fn a_bound_does_not_stand_for_the_loop_before() {
    let source = ".schedule on\n.input m:int\n.output y\n.state a b\n.preset a = 1\n.preset b = 1\n.reg n:int k:int\n.once\n wait p\n.period\n\
                  p: iand n, m, 3\n iadd n, n, 1\n iadd k, n, 1\n.loop_bound 4\nfirst: a = a*0.5\n isub n, n, 1\n bnz n, first\n\
                  .loop_bound 6\nsecond: b = b*0.5 + a\n isub k, k, 1\n bnz k, second\n y = b\n wait p\n";
    let options = Options { machine: &T3, effort: 0, ..Options::default() };
    let (assembled, plain) =
        build("two.s", &MemoryLoader::of("two.s", source), &options).expect("it is right");
    assert!(check(&assembled, &plain).is_ok());
    let bounds = assembled.program.loop_bounds.len();
    assert_eq!(bounds, 2);
    for at in 0..bounds {
        let mut program = assembled.program.clone();
        program.loop_bounds.remove(at);
        assert!(verify(&program, &plain, &assembled.contractions).is_err(), "bound {at}");
    }
}
