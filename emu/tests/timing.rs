// SPDX-License-Identifier: MIT OR Apache-2.0
//! Rules of `docs/timing.md`, each on a program of a few bundles, with the cycles worked out by hand. Latencies, intervals and refills
//! are taken from the machine's table, by unit; all other numbers follow from the rules.
//!
//! Every program is run in both modes, as blocks and with the stepper.

use crate::common;
use crate::common::{at, latency, program, unit};
use std::collections::BTreeMap;
use takt_emu::{Emulator, Event, Status, Step};
use takt_isa::fp::Flags;
use takt_isa::spec::units::ALU;
use takt_isa::timing::Cause;
use takt_isa::{
    Bank, BankIndex, BundleAddress, F1, F3, Function, Instruction, MACHINES, Machine, Op, Program, ROWS,
    Register, Slot, T3,
};

/// Stalled cycles, by the bundle that could not issue and the cause.
type Stalls = BTreeMap<(BundleAddress, Cause), u64>;

/// Runs a program to its end. Returns each issued bundle with its cycle, counted from the first issue, and the stalls after the first
/// issue.
fn run(program: &Program) -> (Vec<(BundleAddress, u64)>, Stalls) {
    let reset = u64::from(program.machine.refill);
    let mut stepper = Emulator::new(program).unwrap();
    let mut blocks = stepper.clone();
    let mut issues = Vec::new();
    let end = stepper
        .observed(&mut |event| {
            if let Event::Issue { cycle, address } = event {
                issues.push((*address, cycle - reset));
            }
        })
        .run();
    assert_eq!(blocks.run(), end);
    assert_eq!(blocks.statistics(), stepper.statistics());
    let statistics = stepper.statistics();
    assert_eq!(statistics.cycles, statistics.bundles + statistics.stalled());
    let mut causes = statistics.causes;
    assert_eq!(causes.remove(&(at(0), Cause::Branch { from: None })), Some(reset), "the refill after reset");
    (issues, causes)
}

/// Checks the cycles of issue, counted from the first, of the bundles in order, and all stalls.
#[track_caller]
fn check(machine: &'static Machine, source: &str, cycles: &[u64], stalls: &[((BundleAddress, Cause), u64)]) {
    let (issues, causes) = run(&program(machine, source));
    assert_eq!(issues.iter().map(|issue| issue.1).collect::<Vec<_>>(), cycles, "{source}");
    assert_eq!(causes, stalls.iter().copied().collect(), "{source}");
}

fn register(machine: &Machine, name: &str) -> Register {
    machine.register_address(name).unwrap()
}

/// Rule 2: for every instruction of every machine, the distance to a reader is its unit's latency.
#[test]
fn operand_distance_is_the_latency_of_every_unit() {
    for machine in MACHINES {
        let mut units = 0;
        for row in ROWS.iter().filter(|row| row.shape.has_dest()) {
            let Some((slot, unit)) = machine.host(row.function) else { continue };
            let latency = u64::from(unit.latency);
            let (reader, _) = machine.host(Op::mov.row().function).unwrap();
            let dest = machine.slot(slot).bank.registers().next().unwrap();
            let mut code = vec![Instruction::NOP; 3 * machine.slots.len()];
            let mut instruction = Instruction::bare(row.op);
            instruction.sources[..row.shape.sources()].fill(Register::ZERO);
            code[slot.index()] = instruction;
            let slots = machine.slots.len();
            let mut read = Instruction { dest: BankIndex::new(1).unwrap(), ..Instruction::bare(Op::mov) };
            read.sources[0] = dest;
            code[slots + reader.index()] = read;
            code[2 * slots + reader.index()] = Instruction::bare(Op::halt);
            let mut program = program(machine, "");
            program.lines = vec![None; code.len()];
            program.code = code.iter().map(|instruction| instruction.encode().unwrap()).collect();

            let (issues, causes) = run(&program);
            assert_eq!(issues[1], (at(1), latency), "{} {}", machine.name, row.mnemonic);
            let cause = Cause::Operand { register: dest, producer: at(0) };
            assert_eq!(
                causes.get(&(at(1), cause)),
                Some(&(latency - 1)),
                "{} {}",
                machine.name,
                row.mnemonic
            );
            units += 1;
        }
        assert!(units >= 30, "{}: {units} instructions", machine.name);
    }
}

/// Without a hazard, one bundle issues each cycle.
#[test]
fn independent_bundles_issue_back_to_back() {
    check(
        &F3,
        ".preset m0 1.0
         fmul m1, m0, m0 || fadd a1, m0, m0 || mov x1, m0
         fmul m2, m0, m0 || fadd a2, m0, m0 || mov x2, m0
         nop
         fmul m3, m0, m0 || fadd a3, m0, m0 || halt",
        &[0, 1, 2, 2 + latency(&F3, Function::Multiply).max(latency(&F3, Function::Add)) - 1],
        &[((at(3), Cause::Drain), latency(&F3, Function::Multiply).max(latency(&F3, Function::Add)) - 2)],
    );
}

/// Rule 2: the stall is charged to the producer whose result comes last, in whatever bank.
#[test]
fn the_last_operand_is_charged() {
    let (multiply, add) = (latency(&F3, Function::Multiply), latency(&F3, Function::Add));
    // The product is on its bus in cycle `multiply`, the sum in 1 + add.
    let last = multiply.max(1 + add);
    let from = if 1 + add > multiply { ("a1", 1) } else { ("m1", 0) };
    let cause = Cause::Operand { register: register(&F3, from.0), producer: at(from.1) };
    check(
        &F3,
        ".preset m0 1.0
         fmul m1, m0, m0
         fadd a1, m0, m0
         flt x1, m1, a1
         jmp 4
         nop",
        &[0, 1, last, last + 1, last + 2 + u64::from(F3.refill)],
        &[((at(2), cause), last - 2), ((at(4), Cause::Branch { from: Some(at(3)) }), F3.refill.into())],
    );
}

/// If two results come last together, the first operand of the first slot is charged.
#[test]
fn ties_are_charged_in_operand_order() {
    let (multiply, add) = (latency(&F3, Function::Multiply), latency(&F3, Function::Add));
    let (first, second) = if multiply < add { (0, add - multiply) } else { (multiply - add, 0) };
    for (operands, name, producer) in [("m1, a1", "m1", second), ("a1, m1", "a1", first)] {
        // Issue the producers so far apart that both results come in the same cycle.
        let mut bundles = vec!["nop".to_owned(); 1 + first.max(second) as usize];
        let place = |bundles: &mut Vec<String>, at: u64, text: &str| {
            let bundle = &mut bundles[at as usize];
            *bundle = if bundle == "nop" { text.to_owned() } else { format!("{bundle} || {text}") };
        };
        place(&mut bundles, second, "fmul m1, m0, m0");
        place(&mut bundles, first, "fadd a1, m0, m0");
        let reader = at(bundles.len());
        let source = format!(".preset m0 1.0\n{}\nflt x1, {operands}", bundles.join("\n"));
        let (_, causes) = run(&program(&F3, &source));
        let cause = Cause::Operand { register: register(&F3, name), producer: at(producer) };
        assert!(causes.contains_key(&(reader, cause)), "{source}: {causes:?}");
    }
}

/// A bundle issues as a whole, and later bundles wait for it.
#[test]
fn issue_is_in_order_and_whole() {
    let multiply = latency(&F3, Function::Multiply);
    let cause = Cause::Operand { register: register(&F3, "m1"), producer: at(0) };
    check(
        &F3,
        ".preset m0 1.0
         fmul m1, m0, m0
         mov x0, m0 || fadd a1, m1, m0
         mov x1, m0
         nop",
        &[0, multiply, multiply + 1, multiply + 2],
        &[((at(1), cause), multiply - 1)],
    );
}

/// Rule 3: a register is not written again before the earlier result is written back.
#[test]
fn destination_waits_for_the_earlier_result() {
    for (machine, source, register_name) in [
        (&F3, ".preset x1 2.0\nfdiv x0, x1, x1\nmov x0, x1\nnop", "x0"),
        (&F1, ".preset r1 2.0\nfdiv r0, r1, r1\nmov r0, r1\nnop", "r0"),
    ] {
        let divide = latency(machine, Function::Divide);
        let cause = Cause::Destination { register: register(machine, register_name), producer: at(0) };
        check(machine, source, &[0, divide, divide + 1], &[((at(1), cause), divide - 1)]);
    }
}

/// Rule 4: an iterative unit accepts an operation once per interval; other units of the slot are unaffected.
#[test]
fn unit_accepts_one_operation_every_interval() {
    let (_, interval) = unit(&F1, Function::Divide);
    assert!(interval > 1, "f1's divider is iterative");
    let (slot, _) = F1.host(Function::Divide).unwrap();
    let divider = F1.slot(slot).unit_index(Function::Divide).unwrap();
    let cause = Cause::Unit { slot, unit: divider as u8 };
    check(
        &F1,
        ".preset r0 2.0
         fdiv r1, r0, r0
         fsin r2, r0
         fdiv r3, r0, r0
         nop",
        &[0, 1, interval, interval + 1],
        &[((at(2), cause), interval - 2)],
    );
    // A square root uses the same unit.
    check(
        &F1,
        ".preset r0 2.0\nfdiv r1, r0, r0\nfsqrt r2, r0\nnop",
        &[0, interval, interval + 1],
        &[((at(1), cause), interval - 1)],
    );
    // On f3 the divider is fully pipelined.
    check(&F3, ".preset m0 2.0\nfdiv x1, m0, m0\nfdiv x2, m0, m0\nnop", &[0, 1, 2], &[]);
}

/// Rule 6: two results never reach a bank's write port in the same cycle; the later bundle stalls until the port is free.
#[test]
fn write_port_takes_one_result_a_cycle() {
    let [add, divide, sine] =
        [Function::Add, Function::Divide, Function::Sine].map(|function| latency(&F1, function));
    // The sine is written back one cycle after the quotient.
    let sine_at = divide + 1 - sine;
    // A sum issued in `at` would be written back with the quotient, a cycle later with the sine, and two cycles later alone.
    let at = divide - add;
    let nops = |count: u64| "nop\n".repeat(count as usize);
    let source = format!(
        ".preset r0 2.0\nfdiv r1, r0, r0\n{}fsin r2, r0\n{}fadd r3, r0, r0\nnop",
        nops(sine_at - 1),
        nops(at - sine_at - 1)
    );
    let cycles: Vec<u64> = (0..at).chain([at + 2, at + 3]).collect();
    let (slot, _) = F1.host(Function::Add).unwrap();
    check(&F1, &source, &cycles, &[((common::at(at), Cause::WritePort { slot }), 2)]);
    // Each bank has its own write port.
    let at = latency(&F3, Function::Divide) - latency(&F3, Function::Add);
    let nops = "nop\n".repeat(at as usize - 1);
    let source = format!(".preset m0 2.0\nfdiv x1, m0, m0\n{nops}fadd a1, m0, m0\nnop");
    check(&F3, &source, &(0..at + 2).collect::<Vec<_>>(), &[]);
}

/// Order of the rules: a stalled cycle is charged to the first rule that is not met.
#[test]
fn cycles_are_charged_in_the_order_of_the_rules() {
    let (add, (divide, interval)) = (latency(&F1, Function::Add), unit(&F1, Function::Divide));
    let (slot, _) = F1.host(Function::Divide).unwrap();
    let divider = F1.slot(slot).unit_index(Function::Divide).unwrap();
    let operand = Cause::Operand { register: register(&F1, "r2"), producer: at(1) };
    let busy = Cause::Unit { slot, unit: divider as u8 };
    check(
        &F1,
        ".preset r0 2.0
         fdiv r1, r0, r0
         fadd r2, r0, r0
         fdiv r3, r0, r2
         nop",
        &[0, 1, interval, interval + 1],
        &[((at(2), operand), add - 1), ((at(2), busy), interval - (1 + add))],
    );
    // Destination before unit: the sum's register is free in 1 + add, the divider in `interval`.
    let destination = Cause::Destination { register: register(&F1, "r2"), producer: at(1) };
    check(
        &F1,
        ".preset r0 2.0
         fdiv r1, r0, r0
         fadd r2, r0, r0
         fdiv r2, r0, r0
         nop",
        &[0, 1, interval, interval + 1],
        &[((at(2), destination), add - 1), ((at(2), busy), interval - (1 + add))],
    );
    // Operand before destination: the stall for the operand covers the stall for the same register as destination.
    let operand = Cause::Operand { register: register(&F1, "r1"), producer: at(0) };
    check(
        &F1,
        ".preset r0 2.0
         fdiv r1, r0, r0
         fadd r1, r1, r0
         nop",
        &[0, divide, divide + 1],
        &[((at(1), operand), divide - 1)],
    );
}

/// Rule 5: a draining operation waits for the last result; then no write port is busy.
#[test]
fn drain_waits_for_every_result() {
    let (divide, alu) = (latency(&F1, Function::Divide), latency(&F1, Function::Alu));
    // Without the drain, the flags and the quotient would reach the write port together.
    let at = divide - alu;
    let nops = "nop\n".repeat(at as usize - 1);
    let source = format!(".preset r0 2.0\nfdiv r1, r0, r0\n{nops}rdflags r2\nnop");
    let cycles: Vec<u64> = (0..at).chain([divide, divide + 1]).collect();
    check(&F1, &source, &cycles, &[((common::at(at), Cause::Drain), alu)]);
    let divide = latency(&F3, Function::Divide);
    for (op, next) in [("clrflags", Some(divide + 1)), ("wait 0", None), ("halt", None)] {
        let source = format!(".preset m0 2.0\nfdiv x1, m0, m0 || fmul m1, m0, m0\n{op}\nnop");
        let cycles: Vec<u64> = [0, divide].into_iter().chain(next).collect();
        check(&F3, &source, &cycles, &[((common::at(1), Cause::Drain), divide - 1)]);
    }
    // A draining operation does not wait for operations of its own bundle.
    check(&F3, ".preset m0 2.0\nfmul m1, m0, m0 || halt", &[0], &[]);
}

/// A jump costs the refill time.
#[test]
fn a_jump_refills() {
    for machine in MACHINES {
        let taken = u64::from(machine.refill);
        check(
            machine,
            "    jmp on
                 halt
             on: nop
                 halt",
            &[0, 1 + taken, 2 + taken],
            &[((at(2), Cause::Branch { from: Some(at(0)) }), taken)],
        );
    }
}

fn with_input(machine: &'static Machine, source: &str, input: u32) -> (Vec<(BundleAddress, u64)>, Emulator) {
    let mut emulator = Emulator::new(&program(machine, source)).unwrap();
    emulator.set_input_bits(common::input(machine, 0), input).unwrap();
    let mut blocks = emulator.clone();
    let mut issues = Vec::new();
    let end = emulator
        .observed(&mut |event| {
            if let Event::Issue { cycle, address } = event {
                issues.push((*address, cycle - u64::from(machine.refill)));
            }
        })
        .run();
    assert_eq!(blocks.run(), end);
    assert_eq!(blocks.statistics(), emulator.statistics());
    (issues, emulator)
}

#[test]
fn branches_are_taken_by_all_32_bits() {
    for machine in MACHINES {
        let (refill, resolve) = (u64::from(machine.refill), u64::from(machine.resolve));
        for (op, input, taken) in [
            ("bz", 0, true),
            ("bz", 0x8000_0000, false),
            ("bz", 1, false),
            ("bnz", 0, false),
            ("bnz", 0x8000_0000, true),
            ("bnz", 0x100, true),
        ] {
            let (issues, emulator) = with_input(machine, &format!("{op} i0, on\nnop\non: halt"), input);
            let expected = if taken {
                vec![(at(0), 0), (at(2), 1 + refill)]
            } else {
                vec![(at(0), 0), (at(1), 1 + resolve), (at(2), 2 + resolve)]
            };
            assert_eq!(issues, expected, "{} {op} {input:#x}", machine.name);
            let stalls = emulator.statistics().stalls()[Cause::Branch { from: Some(at(0)) }.kind()];
            assert_eq!(stalls, refill + if taken { refill } else { resolve });
        }
    }
}

/// A branch to the next bundle costs as much as any other branch.
#[test]
fn a_branch_to_the_next_bundle_refills() {
    for (input, cost) in [(0, F3.refill), (1, F3.resolve)] {
        let (issues, _) = with_input(&F3, "bz i0, 1\nhalt", input);
        assert_eq!(issues, [(at(0), 0), (at(1), 1 + u64::from(cost))]);
    }
}

#[test]
fn calls_return_behind_themselves() {
    let refill = u64::from(F3.refill);
    let (issues, emulator) = with_input(
        &F3,
        "      call outer
               halt
         outer: call inner
               ret
         inner: ret",
        0,
    );
    let step = 1 + refill;
    let expected = [(0, 0), (2, step), (4, 2 * step), (3, 3 * step), (1, 4 * step)];
    assert_eq!(issues, expected.map(|(bundle, cycle)| (at(bundle), cycle)));
    assert!(emulator.stack().is_empty());
}

/// Operations of a bundle read before any of them writes: two banks exchange a value.
#[test]
fn a_bundle_reads_before_it_writes() {
    let source = ".preset m0 3.0
                  .preset a0 5.0
                  .preset x0 1.0
                  fadd a0, m0, zero || fmul m0, a0, x0
                  fmul m0, zero, zero || bnz m0, on
                  halt
                  on: halt";
    let mut stepper = Emulator::new(&program(&F3, source)).unwrap();
    let mut blocks = stepper.clone();
    stepper.set_blocks(false);
    for emulator in [&mut stepper, &mut blocks] {
        emulator.run().unwrap();
        let value = |name| f32::from_bits(emulator.register(register(&F3, name)).unwrap());
        assert_eq!((value("a0"), value("m0")), (3.0, 0.0));
        // The branch saw the product that its own bundle overwrote.
        assert!(matches!(*emulator.status(), Status::Halted { address, .. } if address == at(3)));
    }
}

/// The same for flags in two slots: they are read, then cleared.
#[test]
fn flags_are_read_before_they_are_cleared() {
    let source = ".preset x1 1.0
                  fdiv x2, x1, zero
                  clrflags || rdflags p0
                  rdflags x0
                  halt";
    let bank = Bank { name: "p", base: 256, depth: 256 };
    let second = Slot { name: "alu", bank, units: &[ALU] };
    let slots = Box::leak(Box::new([F3.slots[2], second]));
    let machine = &*Box::leak(Box::new(Machine { slots, ..F3 }));
    let mut stepper = Emulator::new(&program(machine, source)).unwrap();
    let mut blocks = stepper.clone();
    stepper.set_blocks(false);
    for emulator in [&mut stepper, &mut blocks] {
        emulator.run().unwrap();
        let value = |name| emulator.register(register(machine, name)).unwrap();
        assert_eq!((value("p0"), value("x0")), (u32::from(Flags::DIVIDE_BY_ZERO.bits()), 0));
    }
}

/// A result becomes visible, and its flags are set, in the cycle of its writeback and not before.
#[test]
fn results_show_at_writeback() {
    let source = ".preset m0 1.0\nfdiv x1, m0, zero\nfmul m2, m0, m0\nhalt";
    let (first, divide, multiply) =
        (u64::from(F3.refill), latency(&F3, Function::Divide), latency(&F3, Function::Multiply));
    for blocks in [false, true] {
        let mut emulator = Emulator::new(&program(&F3, source)).unwrap();
        emulator.set_blocks(blocks);
        for (cycle, register_name) in [(first + 1 + multiply, "m2"), (first + divide, "x1")] {
            emulator.run_until(cycle).unwrap();
            assert_eq!(emulator.register(register(&F3, register_name)), None, "{register_name}");
            assert!(emulator.flags().is_empty());
            emulator.run_until(cycle + 1).unwrap();
            assert!(emulator.register(register(&F3, register_name)).is_some(), "{register_name}");
        }
        assert_eq!(emulator.flags(), takt_isa::fp::Flags::DIVIDE_BY_ZERO);
    }
}

/// A bundle that halts still writes the results of its other slots: registers, ports and flags, each in its cycle, in both modes.
#[test]
fn a_bundle_that_halts_writes_its_results() {
    let source = ".preset m0 3.0
                  .output out a224
                  nop
                  fmul m1, m0, m0 || fadd a224, m0, m0 || halt";
    let (multiply, add) = (latency(&F3, Function::Multiply), latency(&F3, Function::Add));
    let halt = u64::from(F3.refill) + 1;
    for blocks in [false, true] {
        let mut emulator = Emulator::new(&program(&F3, source)).unwrap();
        emulator.set_blocks(blocks);
        emulator.run().unwrap();
        assert_eq!(*emulator.status(), Status::Halted { cycle: halt, address: at(1) });
        let values = ["m1", "a224"].map(|name| emulator.register(register(&F3, name)));
        assert_eq!(values, [Some(9_f32.to_bits()), Some(6_f32.to_bits())], "blocks: {blocks}");
    }
    let mut emulator = Emulator::new(&program(&F3, source)).unwrap();
    let (mut retired, mut ports) = (Vec::new(), Vec::new());
    let mut sink = |event: &Event| match event {
        Event::Retire(retire) if retire.register.is_some() => retired.push((retire.cycle, retire.value)),
        Event::PortWrite(write) => ports.push((write.cycle, write.value)),
        _ => {}
    };
    emulator.observed(&mut sink).run().unwrap();
    let mut wanted = vec![(halt + multiply, 9_f32.to_bits()), (halt + add, 6_f32.to_bits())];
    // Within a cycle, results are in slot order.
    wanted.sort_by_key(|result| result.0);
    assert_eq!(retired, wanted);
    assert_eq!(ports, [(halt + add, 6_f32.to_bits())]);
    // Flags of a result written back after the halt are set, too.
    let mut emulator =
        Emulator::new(&program(&F3, ".preset m0 300000000000000000000.0\nfmul m1, m0, m0 || halt")).unwrap();
    emulator.run().unwrap();
    assert_eq!(emulator.flags(), Flags::OVERFLOW);
}

/// The event of an operation has the value that it wrote to a register or to memory, and 0 if it wrote none.
#[test]
fn operations_without_result_report_zero() {
    let source = ".preset m0 7.0
                      .preset x3 2
                      st 9[zero], m0
                      clrflags
                      bnz zero, on
                      call sub
                  on: loop x3, end
                      nop
                      nop
                 end: wait 9
                 sub: ret
                      halt";
    let mut emulator = Emulator::new(&program(&T3, source)).unwrap();
    assert!(emulator.tick_at(500));
    let mut seen = BTreeMap::new();
    let mut sink = |event: &Event| {
        if let Event::Retire(retire) = event
            && retire.register.is_none()
        {
            seen.insert(retire.op.row().mnemonic, retire.value);
        }
    };
    emulator.observed(&mut sink).run().unwrap();
    assert_eq!(seen.remove("st"), Some(7_f32.to_bits()));
    let names: Vec<&str> = seen.keys().copied().filter(|name| *name != "nop").collect();
    assert_eq!(names, ["bnz", "call", "clrflags", "halt", "loop", "ret", "wait"]);
    assert!(seen.values().all(|value| *value == 0), "{seen:?}");
}

/// Loads and stores access memory in order, at issue: a load sees the store of the previous bundle.
#[test]
fn memory_is_in_order() {
    for machine in MACHINES {
        let bank = machine.slot(machine.host(Function::Store).unwrap().0).bank.name;
        let source =
            format!(".preset {bank}0 42\nst 7[zero], {bank}0\nld {bank}1, 7[zero]\nst 7[zero], zero\nhalt");
        let (issues, emulator) = with_input(machine, &source, 0);
        let load = latency(machine, Function::Load);
        assert_eq!(issues.iter().map(|issue| issue.1).collect::<Vec<_>>(), [0, 1, 2, 1 + load]);
        assert_eq!(emulator.register(register(machine, &format!("{bank}1"))), Some(42));
        assert_eq!(emulator.memory()[7], 0);
    }
}

/// Bundles that issue after an input was set read its new value.
#[test]
fn inputs_show_to_later_bundles() {
    let mut emulator = Emulator::new(&program(&F3, "mov x0, i0\nmov x1, i0\nhalt")).unwrap();
    emulator.set_input_bits(register(&F3, "i0"), 1).unwrap();
    while !matches!(emulator.step_cycle().unwrap(), Step::Issued { .. }) {}
    emulator.set_input_bits(register(&F3, "i0"), 2).unwrap();
    emulator.run().unwrap();
    assert_eq!(["x0", "x1"].map(|name| emulator.register(register(&F3, name))), [Some(1), Some(2)]);
}

/// Cycle in which the bundle after a `wait` issues, for each cycle of the tick, and the causes of the stalls between.
#[test]
fn a_wait_ends_with_the_tick() {
    let source = "wait 1\nnop\nhalt";
    for machine in MACHINES {
        let (waited, refill) = (u64::from(machine.refill), u64::from(machine.refill));
        let missed = |tick: u64| tick <= waited;
        // A tick in the cycle of the `wait` or earlier is early; a later tick counts from the next cycle on.
        for tick in (0..waited + 3 * refill).chain([waited + 1000]) {
            let mut emulator = Emulator::new(&program(machine, source)).unwrap();
            assert!(emulator.tick_at(tick));
            let mut blocks = emulator.clone();
            emulator.set_blocks(false);
            assert_eq!(emulator.run(), blocks.run());
            assert_eq!(emulator.statistics(), blocks.statistics(), "tick {tick}");

            let issue = if missed(tick) { waited + 1 + refill } else { (waited + 1 + refill).max(tick + 1) };
            assert_eq!(
                *emulator.status(),
                Status::Halted { cycle: issue + 1, address: at(2) },
                "tick {tick}"
            );
            assert_eq!(emulator.deadline_missed(), missed(tick), "tick {tick}");
            let statistics = emulator.statistics();
            let waiting = if missed(tick) { 0 } else { tick - waited };
            assert_eq!(statistics.causes.get(&(at(0), Cause::Wait)).copied().unwrap_or(0), waiting);
            let refilling = issue - waited - 1 - waiting;
            let branch =
                statistics.causes.get(&(at(1), Cause::Branch { from: Some(at(0)) })).copied().unwrap_or(0);
            assert_eq!(branch, refilling, "tick {tick}");
        }
    }
}
