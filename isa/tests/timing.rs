// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scoreboard by itself, rule by rule, with bundles of one or two operations.

use takt_isa::spec::units::{ARCTANGENT, DIVROOT, MULTIPLY, RECURRENCE, SINE};
use takt_isa::timing::{
    Bundle, Cause, Cycle, Reservation, Resource, Scoreboard, after_loop, after_not_taken, after_redirect,
    after_reset, after_sequential, after_tick,
};
use takt_isa::{
    BankIndex, BundleAddress, F1, F3, Function, Instruction, Machine, Op, Register, Slot, SlotIndex, Unit,
};

fn register(number: usize) -> Register {
    Register::new(number).unwrap()
}

fn slot(index: usize) -> SlotIndex {
    SlotIndex::all().nth(index).unwrap()
}

fn nop() -> Instruction {
    operation(Op::nop, 0, [0, 0])
}

fn operation(op: Op, dest: usize, [a, b]: [usize; 2]) -> Instruction {
    let sources = [register(a), register(b), Register::ZERO];
    Instruction { op, dest: BankIndex::new(dest).unwrap(), sources, constant: 0 }
}

/// A bundle for the machine f3.
fn bundle(instructions: [Instruction; 3]) -> Bundle {
    Bundle::new(&F3, &instructions)
}

fn issue(board: &mut Scoreboard, bundle: &Bundle, at: u32, earliest: Cycle) -> (Cycle, Vec<(Cause, u32)>) {
    let issue = board.issue(bundle, BundleAddress::new(at), earliest);
    (issue.cycle, issue.stalls().to_vec())
}

#[test]
fn kinds_of_stalls_follow_from_intervals() {
    let only = |unit: Unit| -> Machine {
        let slot = Slot { units: vec![unit].leak(), ..F1.slots[0] };
        Machine { slots: vec![slot].leak(), ..F1 }
    };
    for (interval, expected) in [(1, false), (2, true), (6, true)] {
        let machine = only(Unit { interval, ..SINE });
        let kinds: Vec<_> = Cause::kinds_of(&machine).collect();
        assert_eq!(kinds.contains(&"unit"), expected, "interval {interval}");
        assert_eq!(kinds.len(), 6 + usize::from(expected));
    }
}

#[test]
fn reservations_number_units_over_all_slots() {
    let of = |slot: usize, function, writes| Reservation::new(&F3, self::slot(slot), function, writes);
    assert_eq!((of(0, Function::Multiply, true).unit, of(0, Function::Sine, true).unit), (Some(0), Some(2)));
    assert_eq!((of(1, Function::Add, true).unit, of(2, Function::Alu, true).unit), (Some(5), Some(6)));
    let root = of(2, Function::Divide, true);
    assert_eq!(
        (root.unit, root.interval, root.writeback),
        (Some(7), DIVROOT.interval, Some(DIVROOT.latency))
    );
    assert_eq!(of(2, Function::Divide, false).writeback, None);
    let none = of(1, Function::Multiply, true);
    assert_eq!((none.unit, none.interval, none.writeback), (None, 1, None));
    let arctangent = of(0, Function::Arctangent, true);
    let held: Vec<_> = arctangent.held().collect();
    let (interval, latency) = (ARCTANGENT.interval, ARCTANGENT.latency);
    assert_eq!(
        held,
        [
            (Resource::Slot(slot(0)), 0..1),
            (Resource::Unit(3), 0..interval),
            (Resource::WritePort(slot(0)), latency..latency + 1)
        ]
    );
}

/// A result can be read in the cycle in which it is on the bus; then no stall is recorded, not one of zero cycles.
#[test]
fn operands_are_awaited_to_the_cycle() {
    let product = bundle([operation(Op::fmul, 1, [768, 768]), nop(), nop()]);
    let reader = bundle([nop(), operation(Op::fadd, 0, [1, 768]), nop()]);
    let ready = 10 + Cycle::from(MULTIPLY.latency);
    for (earliest, at) in [(11, ready), (ready - 1, ready), (ready, ready), (ready + 1, ready + 1)] {
        let mut board = Scoreboard::new(&F3);
        assert_eq!(issue(&mut board, &product, 4, 10), (10, vec![]));
        assert_eq!((board.ready(register(1)), board.drained()), ((ready, BundleAddress::new(4)), ready));
        let cause = Cause::Operand { register: register(1), producer: BundleAddress::new(4) };
        let stalls = if at == earliest { vec![] } else { vec![(cause, (at - earliest) as u32)] };
        assert_eq!(issue(&mut board, &reader, 5, earliest), (at, stalls));
    }
}

/// Two causes that end together are charged to the first.
#[test]
fn the_first_of_two_equal_causes_is_named() {
    let mut board = Scoreboard::new(&F3);
    let both = bundle([operation(Op::fmul, 1, [768, 768]), nop(), nop()]);
    issue(&mut board, &both, 0, 10);
    let reads_twice = bundle([nop(), operation(Op::fadd, 0, [1, 1]), nop()]);
    let (_, stalls) = issue(&mut board, &reads_twice, 1, 11);
    assert!(matches!(stalls[..], [(Cause::Operand { .. }, _)]), "{stalls:?}");
    // Two units of different slots, both busy until cycle 19.
    let mut board = Scoreboard::new(&F3);
    let arctangent = operation(Op::fatan2, 1, [768, 768]);
    let slow = bundle([arctangent, nop(), operation(Op::fdiv, 1, [768, 768])]).with_unit(slot(0), 3, 20, 9);
    let slow = slow.with_unit(slot(2), 1, 25, 9);
    issue(&mut board, &slow, 0, 10);
    let again = bundle([operation(Op::fatan2, 2, [768, 768]), nop(), operation(Op::fdiv, 2, [768, 768])]);
    let (cycle, stalls) = issue(&mut board, &again, 1, 11);
    assert_eq!((cycle, stalls), (19, vec![(Cause::Unit { slot: slot(0), unit: 3 }, 8)]));
}

/// Another latency and interval for a single unit of a single slot.
#[test]
fn one_unit_can_be_timed_otherwise() {
    let two = || bundle([operation(Op::fmul, 1, [768, 768]), operation(Op::fadd, 1, [768, 768]), nop()]);
    let writes = |bundle: &Bundle| bundle.writebacks().map(|(_, after)| after).collect::<Vec<_>>();
    let usual = writes(&two());
    assert_eq!(usual[0], MULTIPLY.latency);
    assert_eq!(writes(&two().with_unit(slot(0), 0, 33, 7)), [33, usual[1]]);
    assert_eq!(writes(&two().with_unit(slot(1), 0, 33, 7)), [usual[0], 33]);
    // A unit that the bundle does not use, and a unit in another slot.
    assert_eq!(writes(&two().with_unit(slot(0), 1, 33, 7)), usual);
    assert_eq!(writes(&two().with_unit(slot(2), 0, 33, 7)), usual);
    let mut board = Scoreboard::new(&F3);
    let slow = two().with_unit(slot(0), 0, 33, 7);
    issue(&mut board, &slow, 0, 10);
    let next = bundle([operation(Op::fmul, 2, [768, 768]), nop(), nop()]);
    assert_eq!(issue(&mut board, &next, 1, 11), (17, vec![(Cause::Unit { slot: slot(0), unit: 0 }, 6)]));
}

/// The residue of an issue after some cycles, and a scoreboard resumed from it.
#[test]
fn residues_end_with_the_last_cycle_that_matters() {
    assert!(Scoreboard::new(&F1).residue(0).is_empty());
    let mut board = Scoreboard::new(&F1);
    let quotient = Bundle::new(&F1, &[operation(Op::fdiv, 1, [768, 768])]);
    issue(&mut board, &quotient, 0, 100);
    let (latency, interval) = (Cycle::from(RECURRENCE.latency), Cycle::from(RECURRENCE.interval));
    let reader = Bundle::new(&F1, &[operation(Op::fadd, 2, [1, 768])]);
    let again = Bundle::new(&F1, &[operation(Op::fdiv, 2, [768, 768])]);
    let last = latency.max(interval);
    for after in 0..=last + 1 {
        let residue = board.residue(100 + after);
        assert_eq!(residue.is_empty(), after >= last, "{after} cycles after");
        assert_eq!(board.residue(100).later(after as u16), residue, "{after} cycles after");
        let resumed = Scoreboard::resume(&F1, &residue);
        for bundle in [&reader, &again] {
            let (there, here) = (board.plan(bundle, 100 + after), resumed.plan(bundle, 0));
            assert_eq!(there.cycle - 100 - after, here.cycle, "{after} cycles after");
        }
        assert_eq!(resumed.residue(0), residue);
    }
}

/// Draining waits for the last writeback; on an empty machine it does not wait.
#[test]
fn draining_waits_for_the_last_result() {
    let wait = bundle([nop(), nop(), operation(Op::wait, 0, [0, 0])]);
    assert_eq!(issue(&mut Scoreboard::new(&F3), &wait, 0, 0), (0, vec![]));
    let mut board = Scoreboard::new(&F3);
    issue(&mut board, &bundle([operation(Op::fsin, 1, [768, 768]), nop(), nop()]), 0, 10);
    issue(&mut board, &bundle([operation(Op::fmul, 2, [768, 768]), nop(), nop()]), 1, 11);
    let until = 10 + Cycle::from(SINE.latency);
    let (cycle, stalls) = issue(&mut board, &wait, 2, 12);
    assert_eq!((cycle, stalls), (until, vec![(Cause::Drain, (until - 12) as u32)]));
}

/// First issue after each kind of flow: `docs/timing.md`, with f3's refill of 6 and its resolve of 2 cycles.
#[test]
fn next_bundle_issues_in_the_predicted_cycle() {
    assert_eq!((after_reset(&F3), after_sequential(20), after_not_taken(&F3, 20)), (6, 21, 23));
    assert_eq!((after_redirect(&F3, 20), after_tick(&F3, 20, 0)), (27, 27));
    assert_eq!((after_tick(&F3, 20, 26), after_tick(&F3, 20, 27)), (27, 28));
    // A body of five bundles is shorter than the refill, one of six is not.
    let after = |end: u32| after_loop(&F3, BundleAddress::new(10), BundleAddress::new(end), 20);
    assert_eq!((after(11), after(16), after(17), after(30)), (27, 27, 21, 21));
}
