// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ports, ticks, deadlines and periods, as a host uses them.

use crate::common::{at, input, latency, program};
use std::num::NonZeroU64;
use takt_emu::{Emulator, Event, Number, PeriodError, PortError, Stop};
use takt_isa::{F1, F3, Function, Program, Register};

/// Program that squares its input in a period of three bundles: the product, a filler, the `wait`.
fn square() -> Program {
    program(
        &F3,
        ".input x i0
         .input n i1 int
         .output F m224
         .output k x224 int
         wait 1
         period: fmul m224, i0, i0 || mov x224, i1
         nop
         wait 1",
    )
}

/// Cycles of a period of [`square`]: the `wait` issues when the product is written.
fn cycles() -> u64 {
    1 + latency(&F3, Function::Multiply)
}

#[test]
fn a_period_runs_from_tick_to_wait() {
    let mut emulator = Emulator::new(&square()).unwrap();
    for i in 1..100 {
        let x = i as f32;
        let report = emulator.run_period(&[("x", x.into()), ("n", i.into())]).unwrap();
        assert_eq!(report.cycles, cycles());
        assert_eq!(report.wait, report.tick + cycles());
        assert_eq!(report.start, report.tick);
        assert!(!report.missed && report.lost == 0);
        assert_eq!(emulator.output("F"), Ok(Some(Number::Float(x * x))));
        assert_eq!(emulator.output("k"), Ok(Some(Number::Integer(i))));
    }
    // The refill is hidden: only the first period charges cycles to the front end.
    let statistics = emulator.statistics();
    assert_eq!(statistics.stalls()[0], u64::from(F3.refill));
    assert_eq!(statistics.ticks, 99);
}

#[test]
fn ports_have_names_and_types() {
    let mut emulator = Emulator::new(&square()).unwrap();
    let unknown = |name: &str, kind| PortError::Unknown { name: name.to_owned(), kind };
    assert_eq!(emulator.set_input("y", 1.0.into()), Err(unknown("y", "input")));
    assert_eq!(emulator.set_input("F", 1.0.into()), Err(unknown("F", "input")));
    assert_eq!(emulator.output("x"), Err(unknown("x", "output")));
    assert_eq!(emulator.output("F"), Ok(None));
    assert_eq!(emulator.set_input("x", 1.into()).unwrap_err().to_string(), "port x carries binary32 values");
    assert!(emulator.set_input("n", Number::Float(1.0)).is_err());
    assert!(emulator.set_input("n", Number::Bits(1)).is_ok());
    let m0 = F3.register_address("m0").unwrap();
    assert!(emulator.set_input_bits(m0, 1).is_err() && emulator.set_input_bits(Register::ZERO, 1).is_err());
    // An invalid input leaves the state unchanged.
    let error = emulator.run_period(&[("x", 1.0.into()), ("z", 1.0.into())]).unwrap_err();
    assert_eq!(error, PeriodError::Port(unknown("z", "input")));
    assert_eq!((emulator.now(), emulator.register(input(&F3, 0))), (0, None));
}

#[test]
fn regular_ticks_start_after_the_first_wait() {
    let mut emulator = Emulator::new(&square()).unwrap();
    emulator.set_tick_period(NonZeroU64::new(100));
    for i in 1..10 {
        let report = emulator.run_period(&[("x", 1.0.into()), ("n", i.into())]).unwrap();
        assert_eq!((report.tick, report.cycles), (100 * i as u64, cycles()));
    }
    // The host's own tick comes in addition.
    emulator.tick_at(950);
    assert_eq!(emulator.run_period(&[]).unwrap().tick, 950);
    assert_eq!(emulator.run_period(&[]).unwrap().tick, 1000);
    emulator.set_tick_period(None);
    assert_eq!(emulator.run(), Ok(Stop::Idle));
}

/// A tick period set while the machine waits takes effect at the next multiple, which may be the current cycle.
#[test]
fn regular_ticks_can_begin_while_the_machine_waits() {
    let mut emulator = Emulator::new(&square()).unwrap();
    assert_eq!(emulator.run(), Ok(Stop::Idle));
    emulator.set_tick_period(NonZeroU64::new(100));
    assert_eq!(emulator.run_period(&[("x", 1.0.into()), ("n", 1.into())]).unwrap().tick, 100);
}

/// The tick comes every 8 cycles, but a period takes longer. Each period then starts late, with the remembered tick, and the other ticks
/// are lost.
#[test]
fn missed_deadlines_are_remembered_once() {
    assert_eq!(F3.refill, 6, "the numbers below are worked out for this");
    let source = "wait 1\nnop\nnop\nnop\nnop\nnop\nnop\nnop\nnop\nnop\nwait 1";
    let mut emulator = Emulator::new(&program(&F3, source)).unwrap();
    emulator.set_tick_period(NonZeroU64::new(8));
    // The first `wait` issues in cycle 6, the tick comes in 8, the first bundle of the period issues in 13.
    let report = emulator.run_period(&[]).unwrap();
    assert_eq!((report.tick, report.start, report.wait, report.cycles), (8, 8, 22, 14));
    assert!(report.missed && report.lost == 0, "16 was too early and is remembered");
    let report = emulator.run_period(&[]).unwrap();
    // The tick in cycle 24 is remembered, the one in cycle 32 is lost.
    assert_eq!((report.tick, report.start, report.wait, report.cycles), (16, 22, 38, 16));
    assert_eq!((report.missed, report.lost), (true, 1));
    let report = emulator.run_period(&[]).unwrap();
    // The tick in cycle 40 is remembered, the one in cycle 48 is lost.
    assert_eq!((report.tick, report.start, report.wait), (24, 38, 54));
    let statistics = emulator.statistics();
    assert_eq!((statistics.ticks, statistics.missed, statistics.lost), (6, 3, 2));
    assert!(emulator.deadline_missed());
}

#[test]
fn events_describe_a_period_completely() {
    let mut emulator = Emulator::new(&square()).unwrap();
    emulator.run_to_wait().unwrap();
    let mut events = Vec::new();
    emulator
        .observed(&mut |event| events.push(event.clone()))
        .run_period(&[("x", 3.0.into()), ("n", 4.into())])
        .unwrap();
    let text: Vec<String> = events
        .iter()
        .map(|event| match event {
            Event::Tick { cycle } => format!("{cycle} tick"),
            Event::Issue { cycle, address } => format!("{cycle} issue {address}"),
            Event::Retire(retire) => format!(
                "{} {} from {} = {:x} to {}",
                retire.cycle,
                retire.op.row().mnemonic,
                retire.issued,
                retire.value,
                retire.register.map_or("-".to_owned(), |register| register.to_string())
            ),
            Event::PortWrite(write) => format!("{} port {} = {:x}", write.cycle, write.register, write.value),
            Event::Wait { cycle, address } => format!("{cycle} wait {address}"),
            other => format!("{other:?}"),
        })
        .collect();
    let (tick, first) = (2 * u64::from(F3.refill), 2 * u64::from(F3.refill) + 1);
    let (moved, last) = (first + latency(&F3, Function::Alu), first + latency(&F3, Function::Multiply));
    assert_eq!(
        text,
        [
            format!("{tick} tick"),
            format!("{first} issue 1"),
            format!("{} issue 2", first + 1),
            format!("{moved} mov from {first} = 4 to 736"),
            format!("{moved} port 736 = 4"),
            format!("{last} fmul from {first} = 41100000 to 224"),
            format!("{last} port 224 = 41100000"),
            format!("{last} issue 3"),
            format!("{last} wait from {last} = 0 to -"),
            format!("{last} wait 3"),
        ]
    );
}

#[test]
fn nans_on_ports_are_reported() {
    for machine in [&F3, &F1] {
        // Binary32 ports, one without a name; an integer port may hold any bits.
        let source = if machine.name == "f3" {
            ".output F x224\n.output k x225 int\n.preset x0 nan\n.preset x1 -1\nwait 1
             fneg x224, x0\nmov x225, x1\nfmin x226, x0, x0\nmov x227, x0\nfabs x224, zero\nwait 1"
        } else {
            ".output F r480\n.output k r481 int\n.preset r0 nan\n.preset r1 -1\nwait 1
             fneg r480, r0\nmov r481, r1\nfmin r482, r0, r0\nmov r483, r0\nfabs r480, zero\nwait 1"
        };
        let mut emulator = Emulator::new(&program(machine, source)).unwrap();
        let mut observed = emulator.clone();
        let report = emulator.run_period(&[]).unwrap();
        let mut heard = Vec::new();
        let again = observed.observed(&mut |event| heard.push(event.clone())).run_period(&[]).unwrap();
        assert_eq!(report, again);
        let at = report.tick + 1 + latency(machine, Function::Alu);
        let ports: Vec<_> = report
            .nan_writes
            .iter()
            .map(|write| {
                (write.cycle - at, machine.register_name(write.register).unwrap(), write.value, write.nan)
            })
            .collect();
        let bank = if machine.name == "f3" { ("x224", "x226") } else { ("r480", "r482") };
        assert_eq!(
            ports,
            [(0, bank.0.to_owned(), 0xffc0_0000, true), (2, bank.1.to_owned(), 0x7fc0_0000, true)]
        );
        let writes: Vec<_> = heard
            .iter()
            .filter_map(|event| match event {
                Event::PortWrite(write) => Some(*write),
                _ => None,
            })
            .collect();
        assert_eq!(writes.len(), 5);
        assert_eq!(writes.into_iter().filter(|write| write.nan).collect::<Vec<_>>(), report.nan_writes);
        assert_eq!(emulator.statistics().nan_writes, 2);
        assert!(emulator.run_period(&[]).unwrap().nan_writes.len() == 2);
        assert!(emulator.take_nan_writes().is_empty());
    }
}

/// `run_period` completes a period that was begun by single steps; after a halt it returns an error.
#[test]
fn periods_can_be_stepped_into() {
    let mut emulator = Emulator::new(&square()).unwrap();
    emulator.run_period(&[("x", 1.0.into()), ("n", 1.into())]).unwrap();
    emulator.tick_at(50);
    assert!(!emulator.tick_at(emulator.now() - 1));
    assert_eq!(emulator.step_bundle(), Ok(Stop::Issued { cycle: 51, address: at(1) }));
    let report = emulator.run_period(&[]).unwrap();
    assert_eq!((report.tick, report.cycles), (50, cycles()));

    let mut halting = Emulator::new(&program(&F3, "wait 1\nhalt")).unwrap();
    assert_eq!(halting.run_period(&[]), Err(PeriodError::Halted));
    let mut faulting = Emulator::new(&program(&F3, "wait 1\nret")).unwrap();
    assert!(matches!(faulting.run_period(&[]), Err(PeriodError::Fault(_))));
}
