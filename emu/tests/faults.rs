// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every fault: its address, its message, and that the faulting bundle has had no effect.

use crate::common::{at, input, latency, program};
use takt_emu::{Emulator, Event, Fault, FaultKind, LoadError, Status, Step, Stop};
use takt_isa::{F1, F3, Function, Program, Register, SlotIndex, T3};

/// Runs a program as blocks and with the stepper, checks that both agree, and returns the fault.
fn fault(program: &Program) -> (Fault, Emulator) {
    let mut blocks = Emulator::new(program).unwrap();
    let mut stepper = blocks.clone();
    stepper.set_blocks(false);
    let fault = blocks.run().unwrap_err();
    assert_eq!(stepper.run(), Err(fault.clone()));
    assert_eq!(blocks.now(), stepper.now());
    assert_eq!(blocks.statistics(), stepper.statistics());
    assert_eq!(*blocks.status(), Status::Faulted(fault.clone()));
    // Further steps return the same fault.
    assert_eq!(blocks.step_cycle(), Err(fault.clone()));
    (fault, blocks)
}

#[test]
fn faults_name_place_and_cause() {
    let refill = u64::from(F3.refill);
    // Source; cycle of the fault from the first issue; message after `test.s:line`.
    let cases: &[(&str, u64, &str)] = &[
        ("nop\nmov x0, x1", 1, ":2: bundle 1, slot aux, cycle {}: reads x1, which was never written"),
        (
            ".input knob i7\nnop || fadd a0, i7, zero",
            0,
            ":2: bundle 0, slot add, cycle {}: reads knob, which was never written",
        ),
        (
            "nop\nld x0, 4095[zero]",
            1,
            ":2: bundle 1, slot aux, cycle {}: reads data word 4095, but the data memory has words 0 to 1023",
        ),
        (
            ".preset a0 -1\nst 0[a0], zero",
            0,
            ":2: bundle 0, slot aux, cycle {}: writes data word -1, but the data memory has words 0 to 1023",
        ),
        (
            ".preset a0 2147483647\nst 1[a0], zero",
            0,
            ":2: bundle 0, slot aux, cycle {}: writes data word 2147483648, but the data memory has words 0 to 1023",
        ),
        ("ret", 0, ":1: bundle 0, slot aux, cycle {}: return with the return stack empty"),
        (
            "again: call again",
            16 * (1 + refill),
            ":1: bundle 0, slot aux, cycle {}: call with the return stack full (16 entries)",
        ),
        ("jmp 65535", 1 + refill, "bundle 65535, cycle {}: execution left the program, which has 1 bundle"),
        ("nop", 1, "bundle 1, cycle {}: execution left the program, which has 1 bundle"),
        // The stall for the operand comes first, since the address depends on the operand.
        (
            ".preset a0 5000\nmov x0, a0\nld x1, 0[x0]",
            latency(&F3, Function::Alu),
            ":3: bundle 1, slot aux, cycle {}: reads data word 5000, but the data memory has words 0 to 1023",
        ),
    ];
    for (source, cycle, text) in cases {
        let (fault, emulator) = fault(&program(&F3, source));
        assert_eq!(fault.cycle, refill + cycle, "{source}");
        let text = text.replace("{}", &fault.cycle.to_string());
        let text = if text.starts_with(':') { format!("test.s{text}") } else { text };
        assert_eq!(fault.show(emulator.program()).to_string(), text);
        assert_eq!(emulator.now(), fault.cycle);
        assert_eq!(emulator.next_address(), fault.address);
    }
}

/// Counts from 1 to 65,535 are allowed.
#[test]
fn loops_keep_their_promised_counts() {
    for (count, may) in [(-1, false), (0, false), (1, true), (65_535, true), (65_536, false)] {
        let source = format!(".preset a0 {count}\nloop a0, end\niadd x0, i0, zero\nend: halt");
        let mut emulator = Emulator::new(&program(&T3, &source)).unwrap();
        emulator.set_input_bits(input(&T3, 0), 7).unwrap();
        match emulator.run() {
            Ok(stop) => assert!(may && stop == Stop::Halted, "{count}: {stop:?}"),
            Err(fault) => {
                assert!(!may, "{count}: {fault:?}");
                assert_eq!(fault.kind, FaultKind::LoopCount { count });
            }
        }
    }
}

#[test]
fn illegal_words_fault_where_they_are_reached() {
    assert_eq!(F3.refill, 6, "the numbers below are worked out for this");
    let mut program = program(&F3, "jmp 2\nnop\nnop || fadd a0, zero, zero\nnop");
    let cases = [
        (7, 0, "bundle 2, slot add, cycle 13: illegal word: word 0 is unwritten memory, not an instruction"),
        (7, 0x7f << 41, "slot add, cycle 13: illegal word: opcode 0x7f is not an instruction"),
        (7, 1 << 48, "slot add, cycle 13: illegal word: 0x1000000000000 is longer than a word of 48 bits"),
        (
            7,
            u64::MAX,
            "slot add, cycle 13: illegal word: 0xffffffffffffffff is longer than a word of 48 bits",
        ),
        (
            6,
            program.code[7],
            "slot mul, cycle 13: illegal word: slot mul of f3 has no unit for fadd (slot add has)",
        ),
        (7, program.code[7] | 0x1ff << 32, "destination 511 is out of reach"),
    ];
    for (word, bits, text) in cases {
        let old = std::mem::replace(&mut program.code[word], bits);
        let (fault, _) = fault(&program);
        assert!(fault.show(&program).to_string().contains(text), "{fault}");
        assert_eq!((fault.cycle, fault.address, fault.slot), (13, at(2), SlotIndex::new(word % 3)));
        program.code[word] = old;
    }
    // An illegal word that is not reached does no harm.
    program.code[3] = 0;
    program.code[11] = 0;
    let (fault, _) = fault(&program);
    assert_eq!(fault.address, at(3));
}

#[test]
fn a_faulting_bundle_does_nothing() {
    // The bundle stores, adds and faults; results of earlier bundles still appear in their cycles.
    let source = ".preset m0 1.0
                  .preset x9 7
                  fmul m1, m0, m0 || mov x0, x9
                  st 3[zero], x9
                  mov x1, x9 || fadd a1, m0, m0
                  ld x2, 0[zero] || fadd a2, m9, m0";
    let (fault, emulator) = fault(&program(&F3, source));
    assert_eq!((fault.address, fault.slot), (at(3), SlotIndex::new(1)));
    let register = |name| emulator.register(F3.register_address(name).unwrap());
    assert_eq!(register("x0"), Some(7));
    assert_eq!(emulator.memory()[3], 7);
    assert_eq!([register("x1"), register("m1"), register("a2"), register("x2")], [None; 4]);
    let in_flight: Vec<_> = emulator.in_flight().map(|retire| retire.address).collect();
    assert_eq!(in_flight, [0, 2, 2].map(at));
}

/// A fault undoes the block's effects so far: registers, memory, flags, NaNs written to ports.
#[test]
fn fault_in_a_block_undoes_later_operations() {
    // The block increments a word in memory, then divides by i1 and loads from i0. If it ran twice, it would increment twice; when the
    // load faults, the division's flag is still in flight.
    let source = ".output F x224
                  .preset x0 1
                  .preset m0 1.0
                  .preset x1 nan
                  period: ld x4, 9[zero]
                  iadd x4, x4, x0
                  st 9[zero], x4
                  fmin x224, x1, m0
                  fdiv x5, m0, i1
                  nop
                  ld x3, 0[i0]
                  wait 0";
    let mut blocks = Emulator::new(&program(&F3, source)).unwrap();
    let [i0, i1] = [0, 1].map(|i| input(&F3, i));
    blocks.set_input_bits(i0, 0).unwrap();
    blocks.set_input_bits(i1, 1.0f32.to_bits()).unwrap();
    blocks.run_to_wait().unwrap();
    assert_eq!((blocks.memory()[9], blocks.take_nan_writes().len()), (1, 1));
    blocks.set_input_bits(i0, 5000).unwrap();
    blocks.set_input_bits(i1, 0).unwrap();
    let tick = blocks.now() + 20;
    blocks.tick_at(tick);
    let mut stepper = blocks.clone();
    stepper.set_blocks(false);
    let fault = blocks.run().unwrap_err();
    assert_eq!(stepper.run(), Err(fault.clone()));
    assert!(matches!(fault.kind, FaultKind::DataAddress { address: 5000, .. }));
    assert_eq!(blocks.memory()[9], 2);
    assert!(blocks.flags().is_empty());
    assert_eq!(blocks.take_nan_writes().len(), 1);
    assert_eq!(blocks.memory(), stepper.memory());
    assert_eq!(blocks.statistics(), stepper.statistics());
    assert_eq!(blocks.in_flight().count(), stepper.in_flight().count());
}

/// Likewise for a result in flight at the block's entry with its writeback before the block's end.
#[test]
fn a_fault_in_a_block_undoes_results_of_earlier_blocks() {
    let source = ".preset m0 1.0
                  fdiv x1, m0, zero
                  jmp 2
                  ld x3, 0[i0]
                  mov x4, x1
                  halt";
    let mut emulator = Emulator::new(&program(&F3, source)).unwrap();
    emulator.set_input_bits(input(&F3, 0), 5000).unwrap();
    let fault = emulator.run().unwrap_err();
    assert_eq!((fault.address, fault.cycle), (at(2), 2 + 2 * u64::from(F3.refill)));
    assert!(emulator.flags().is_empty());
    let x1 = F3.register_address("x1").unwrap();
    assert_eq!(emulator.register(x1), None);
    assert_eq!(emulator.in_flight().map(|retire| retire.register).collect::<Vec<_>>(), [Some(x1)]);
}

#[test]
fn the_cycle_limit_is_exact_and_the_hosts() {
    for source in
        ["again: jmp again", ".preset x0 1.0\nagain: fdiv x0, x0, x0\nfmul m1, x0, x0\njmp again", "wait 0"]
    {
        for limit in 0..60 {
            let mut blocks = Emulator::new(&program(&F3, source)).unwrap();
            blocks.tick_at(1000);
            blocks.set_cycle_limit(limit);
            let mut stepper = blocks.clone();
            stepper.set_blocks(false);
            let fault = blocks.run().unwrap_err();
            assert_eq!(stepper.run(), Err(fault.clone()));
            assert_eq!((fault.cycle, &fault.kind), (limit, &FaultKind::CycleLimit { limit }));
            assert_eq!(
                fault.to_string().split(": ").last(),
                Some(&*format!("limit of {limit} cycles reached"))
            );
            assert_eq!(blocks.now(), limit);
            let statistics = blocks.statistics();
            assert_eq!(statistics, stepper.statistics());
            assert_eq!(statistics.cycles, statistics.bundles + statistics.stalled());
            // The limit is the host's, not a fault of the machine: with a higher limit, the run continues.
            blocks.set_cycle_limit(limit + 1);
            assert!(blocks.step_cycle().is_ok());
        }
    }
}

#[test]
fn faults_are_events_too() {
    let mut events = Vec::new();
    let mut emulator = Emulator::new(&program(&F1, "ret")).unwrap();
    let fault = emulator.observed(&mut |event| events.push(event.clone())).run().unwrap_err();
    assert_eq!(events, [Event::Fault(fault)]);
}

#[test]
fn a_halted_machine_stays_so() {
    let mut emulator = Emulator::new(&program(&F1, ".preset r0 1.0\nfadd r1, r0, r0\nhalt")).unwrap();
    assert_eq!(emulator.run(), Ok(Stop::Halted));
    let now = emulator.now();
    assert_eq!(emulator.step_cycle(), Ok(Step::Halted));
    assert_eq!(emulator.step_bundle(), Ok(Stop::Halted));
    assert_eq!(emulator.run_until(now + 100), Ok(Stop::Halted));
    assert_eq!(emulator.now(), now);
    emulator.reset();
    assert_eq!((emulator.now(), emulator.run()), (0, Ok(Stop::Halted)));
    assert_eq!(emulator.now(), now);
}

#[test]
fn programs_that_do_not_fit_are_refused() {
    let good = program(&F3, "nop");
    let refuse = |change: &dyn Fn(&mut Program), text: &str| {
        let mut program = good.clone();
        change(&mut program);
        let error: LoadError = Emulator::new(&program).err().expect(text);
        assert_eq!(error.to_string(), text);
    };
    refuse(&|p| p.code = vec![0; 3 * 1025], "the program has 1025 bundles; f3 holds 1024");
    refuse(&|p| p.code = vec![0; 4], "4 words are not a whole number of bundles of 3");
    refuse(&|p| p.data = vec![0; 1025], "the program has 1025 words of data; f3 holds 1024");
    let register = |name| F3.register_address(name).unwrap();
    refuse(
        &|p| p.constants = vec![(Register::ZERO, 1)],
        "constant for register address 1023, which f3 keeps at zero",
    );
    let port = |name| takt_isa::program::Port {
        name: "p".to_owned(),
        register: register(name),
        ty: takt_isa::Type::F,
    };
    refuse(&|p| p.inputs = vec![port("m3")], "port p at register address 3, where f3 has no input port");
    refuse(&|p| p.outputs = vec![port("m3")], "port p at register address 3, where f3 has no output port");
    let mut on_t1 = good.clone();
    (on_t1.machine, on_t1.constants) = (&F1, vec![(register("x88"), 1)]);
    assert_eq!(
        Emulator::new(&on_t1).err().unwrap().to_string(),
        "constant for register address 600, which f1 does not have"
    );
    // Execution leaves an empty program at once.
    let (fault, _) = fault(&program(&F3, ""));
    assert_eq!(fault.kind, FaultKind::ProgramCounter { bundles: 0 });
}

/// Tables that do not match the code must not cause a panic: images may come from anywhere.
#[test]
fn nonsense_in_a_program_does_not_panic() {
    let mut program = program(&F3, "ret");
    program.lines.clear();
    let (fault, _) = fault(&program);
    assert_eq!(fault.location(&program), None);
    program.lines = vec![Some(takt_isa::program::Location { file: 9, line: 1 }); 1];
    assert!(Emulator::new(&program).unwrap().run().is_err());
}
