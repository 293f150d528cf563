// SPDX-License-Identifier: MIT OR Apache-2.0
//! Directed programs for coincidences that random programs rarely or never produce: calls to every depth, faults beside results and other
//! faults, and loops across each carry of an address, beyond the program memory, or of many iterations.

use takt_emu::testing::{Options, random_program};
use takt_isa::{
    BankIndex, Effect, Function, Instruction, Machine, Operand, Program, ROWS, Register, Row, SlotIndex,
};

/// Registers of the first slot that hold the iteration counts of loops; none is an output port on any machine.
const COUNTS: [usize; 3] = [40, 41, 42];
/// Register of each slot that results are written to.
const RESULT: usize = 30;
/// Data word that every memory has.
const WORD: u32 = 65;

/// Directed program.
#[derive(Clone, Debug)]
pub struct Corner {
    /// Description of the case.
    pub name: String,
    /// The program.
    pub program: Program,
    /// Expected fault, as text; `None` if the program halts.
    pub fault: Option<&'static str>,
}

/// All directed programs of a machine.
pub fn corners(machine: &'static Machine) -> Vec<Corner> {
    let base = &random_program(0, machine, Options { bundles: 6, ..Options::TAME });
    let mut corners = calls(base);
    corners.extend(stray_accesses(base));
    corners.extend(illegal_words(base));
    if machine.loop_depth > 0 {
        corners.extend(loops_at_carries(base));
        corners.extend(loops_beyond_memory(base));
        corners.extend(faults_of_loops(base));
        corners.extend(long_loops(base));
    }
    corners
}

/// Program under construction.
struct Writer<'a> {
    base: &'a Program,
    bundles: Vec<Vec<u64>>,
    counts: [u32; COUNTS.len()],
}

/// Word of an empty slot.
fn filler() -> u64 {
    Instruction::NOP.encode().unwrap_or(0)
}

impl Writer<'_> {
    fn new(base: &Program) -> Writer<'_> {
        Writer { base, bundles: Vec::new(), counts: [0; COUNTS.len()] }
    }

    fn machine(&self) -> &'static Machine {
        self.base.machine
    }

    /// Word of a slot in a bundle; adds missing bundles up to it.
    fn word(&mut self, at: u32, slot: SlotIndex) -> &mut u64 {
        let (at, slots) = (at as usize, self.machine().slots.len());
        if self.bundles.len() <= at {
            self.bundles.resize(at + 1, vec![filler(); slots]);
        }
        &mut self.bundles[at][slot.index()]
    }

    /// Puts an operation with this effect into a slot that hosts it; if it has a source, that is register `source`.
    fn put_in(&mut self, at: u32, slot: SlotIndex, effect: Effect, constant: u32, source: Register) {
        if let Some(row) = ROWS.iter().find(|row| row.effect == effect) {
            let mut instruction = Instruction { constant, ..Instruction::bare(row.op) };
            instruction.sources[0] = if row.shape.sources() > 0 { source } else { instruction.sources[0] };
            instruction.dest = BankIndex::new(RESULT).unwrap_or(instruction.dest);
            *self.word(at, slot) = instruction.encode().unwrap_or_else(|_| filler());
        }
    }

    /// Puts an operation with this effect into the first slot that hosts it.
    fn put(&mut self, at: u32, effect: Effect, constant: u32, source: Register) {
        let row = ROWS.iter().find(|row| row.effect == effect);
        if let Some((slot, _)) = row.and_then(|row| self.machine().host(row.function)) {
            self.put_in(at, slot, effect, constant, source);
        }
    }

    fn jump(&mut self, at: u32, target: u32) {
        self.put(at, Effect::Jump, target, Register::ZERO);
    }

    fn halt(&mut self, at: u32) {
        self.put(at, Effect::Halt, 0, Register::ZERO);
    }

    /// Puts a loop of `count` iterations, whose body ends before `target`.
    fn counted(&mut self, at: u32, count: u32, target: u32) {
        let known = self.counts.iter().position(|known| *known == count);
        let free = self.counts.iter().position(|known| *known == 0);
        let place = known.or(free).unwrap_or(0);
        self.counts[place] = count;
        let register = if count == 0 { Register::ZERO } else { count_register(self.machine(), place) };
        self.put(at, Effect::Loop, target, register);
    }

    /// Fills the empty slots of a bundle with one operation each, of the slot's unit number `unit`, that gives a result; in the first
    /// bundle, the result goes to an output port.
    fn results(&mut self, at: u32, unit: usize) {
        let sources: Vec<Register> = self.base.constants.iter().map(|constant| constant.0).collect();
        for (slot, description) in self.machine().numbered_slots() {
            let functions = |function: &Function| {
                ROWS.iter().find(|row| row.shape.has_dest() && row.function == *function && is_pure(row))
            };
            let rows: Vec<&Row> = (description.units.iter())
                .filter_map(|unit| unit.functions.iter().find_map(functions))
                .collect();
            if *self.word(at, slot) != filler() || rows.is_empty() {
                continue;
            }
            let row = rows[unit % rows.len()];
            let mut instruction = Instruction::bare(row.op);
            let output = usize::from(description.bank.depth - self.machine().outputs_per_bank);
            let dest = if at == 0 { output } else { RESULT + at as usize % 4 };
            instruction.dest = BankIndex::new(dest).unwrap_or(instruction.dest);
            for (source, register) in instruction.sources.iter_mut().zip(&sources).take(row.shape.sources()) {
                *source = *register;
            }
            if row.shape.operands().contains(&Operand::Memory) {
                (instruction.sources[0], instruction.constant) = (Register::ZERO, WORD);
            }
            *self.word(at, slot) = instruction.encode().unwrap_or_else(|_| filler());
        }
    }

    fn corner(self, name: String, fault: Option<&'static str>) -> Corner {
        let machine = self.machine();
        let code: Vec<u64> = self.bundles.into_iter().flatten().collect();
        let mut constants = self.base.constants.clone();
        constants.extend((0..).map(|place| count_register(machine, place)).zip(self.counts));
        constants.sort_unstable();
        let (lines, loop_bounds, sections) = (vec![None; code.len()], Vec::new(), Vec::new());
        let program = Program { code, lines, loop_bounds, sections, constants, ..self.base.clone() };
        Corner { name, program, fault }
    }
}

/// The result depends on the operands alone, or on the data memory.
fn is_pure(row: &Row) -> bool {
    matches!(row.effect, Effect::Compute | Effect::Load)
}

fn count_register(machine: &Machine, place: usize) -> Register {
    let index = BankIndex::new(COUNTS[place % COUNTS.len()]);
    index.and_then(|index| machine.slots[0].bank.register(index)).unwrap_or(Register::ZERO)
}

/// Slot of the sequencer.
fn sequencer(machine: &Machine) -> Option<SlotIndex> {
    machine.host(Function::Control).map(|(slot, _)| slot)
}

/// Nested calls, and the fault with which each program ends: as deep as the return stack, twice; one deeper, at once and after returns; a
/// return without a call, at once and after as many returns as calls. Each call returns to a different address.
fn calls(base: &Program) -> Vec<Corner> {
    let deepest = base.machine.stack_depth.cast_signed() as isize;
    let (full, empty) = ("return stack full", "return stack empty");
    // Each course is a sequence of calls (positive) and returns (negative), which make up the whole program.
    let courses: [(&[isize], &str); 6] = [
        (&[deepest, -deepest, deepest, -deepest], "program counter"),
        (&[deepest + 1], full),
        (&[deepest, -3, 4], full),
        (&[deepest, -deepest, deepest + 1], full),
        (&[-1], empty),
        (&[deepest, -deepest - 1], empty),
    ];
    let corner = |(course, fault)| of_course(base, course).corner(format!("calls {course:?}"), Some(fault));
    courses.into_iter().map(corner).collect()
}

/// Program with runs of calls and returns in turn, of the given lengths. It ends after the last bundle of its first subroutine.
fn of_course<'a>(base: &'a Program, course: &[isize]) -> Writer<'a> {
    // For each subroutine, its calls (of other subroutines) and returns, in order. The first one is the program itself.
    let mut bodies: Vec<Vec<Option<usize>>> = vec![Vec::new()];
    let mut way = Vec::new();
    let mut at = 0;
    for step in course.iter().flat_map(|&count| std::iter::repeat_n(count > 0, count.unsigned_abs())) {
        let next = bodies.len();
        bodies[at].push(step.then_some(next));
        if step {
            bodies.push(Vec::new());
            way.push(std::mem::replace(&mut at, next));
        } else {
            at = way.pop().unwrap_or(0);
        }
    }
    // The program itself comes last, after a jump at the beginning. Each operation takes a bundle, and each subroutine one more.
    let order: Vec<usize> = (1..bodies.len()).chain([0]).collect();
    let mut end = 1;
    let mut starts = vec![0; bodies.len()];
    for &body in &order {
        starts[body] = end;
        end += 1 + bodies[body].len() as u32;
    }
    let mut writer = Writer::new(base);
    writer.jump(0, starts[0]);
    for (body, start) in bodies.iter().zip(&starts) {
        for (at, step) in (*start..).zip(body) {
            match step {
                Some(callee) => writer.put(at, Effect::Call, starts[*callee], Register::ZERO),
                None => writer.put(at, Effect::Return, 0, Register::ZERO),
            }
        }
    }
    // Bundle after the last one.
    writer.word(end - 1, SlotIndex::FIRST);
    writer
}

/// Accesses outside of the data memory, by each slot's port: beside, before and after results of every unit; before a `halt`, a `wait` or
/// a read of the flags, which must not happen; beside a fault of the sequencer, where the fault of the first slot counts; by two ports at
/// once.
fn stray_accesses(base: &Program) -> Vec<Corner> {
    let machine = base.machine;
    let address = Some("data address");
    let mut corners = Vec::new();
    let ports = |function: Function, effect: Effect| {
        machine.hosts(function).iter().map(move |slot| (slot, effect)).collect::<Vec<_>>()
    };
    let accesses = [ports(Function::Load, Effect::Load), ports(Function::Store, Effect::Store)].concat();
    let units = machine.slots.iter().map(|slot| slot.units.len()).max().unwrap_or(0);
    for &(slot, effect) in &accesses {
        let stray = |writer: &mut Writer<'_>, at| {
            writer.put_in(at, slot, effect, machine.data_depth, Register::ZERO);
        };
        let name = |what: &str| format!("{effect:?} outside of the memory in slot {}, {what}", slot.get());
        // Units that are busy with an earlier operation would not accept one beside or after the access.
        for (unit, from) in (0..units).flat_map(|unit| [(unit, 0), (unit, 2), (unit, 3)]) {
            let mut writer = Writer::new(base);
            stray(&mut writer, 2);
            (from..5).for_each(|at| writer.results(at, unit));
            corners
                .push(writer.corner(name(&format!("results of unit {unit} from bundle {from} on")), address));
        }
        for next in [Effect::Halt, Effect::Publish, Effect::Wait, Effect::ReadFlags, Effect::ClearFlags] {
            for first in [0, 1] {
                let mut writer = Writer::new(base);
                stray(&mut writer, first);
                writer.put(first + 1, next, 0, Register::ZERO);
                corners.push(writer.corner(name(&format!("before {next:?}, at {first}")), address));
            }
        }
        for &(other, other_effect) in accesses.iter().filter(|(other, _)| *other > slot) {
            let mut writer = Writer::new(base);
            stray(&mut writer, 1);
            writer.put_in(1, other, other_effect, machine.data_depth, Register::ZERO);
            (0..4).for_each(|at| writer.results(at, 0));
            let what = format!("beside {other_effect:?} of slot {}", other.get());
            corners.push(writer.corner(name(&what), address));
        }
        let Some(control) = sequencer(machine).filter(|control| *control != slot) else { continue };
        // Beside operations without a fault that would publish the written outputs, or stop.
        for own in [Effect::Publish, Effect::Wait, Effect::Halt] {
            let mut writer = Writer::new(base);
            writer.results(0, 0);
            stray(&mut writer, 1);
            writer.put(1, own, 0, Register::ZERO);
            corners.push(writer.corner(name(&format!("beside {own:?}")), address));
        }
        for (own, fault) in [(Effect::Return, "return stack empty"), (Effect::Loop, "loop count")] {
            if own == Effect::Loop && machine.loop_depth == 0 {
                continue;
            }
            let mut writer = Writer::new(base);
            stray(&mut writer, 1);
            writer.put(1, own, 20, Register::ZERO);
            (0..4).for_each(|at| writer.results(at, 0));
            let first = if slot < control { address } else { Some(fault) };
            corners.push(writer.corner(name(&format!("beside {own:?}")), first));
        }
    }
    corners
}

/// Words that are not instructions: in each set of slots, with results in flight; after a loop, where fetch has seen them before the loop
/// ends; and after a branch that is taken and one that is not.
fn illegal_words(base: &Program) -> Vec<Corner> {
    let machine = base.machine;
    let illegal = Some("illegal word");
    let mut corners = Vec::new();
    for set in 1..1_usize << machine.slots.len() {
        let mut writer = Writer::new(base);
        for (slot, _) in machine.numbered_slots().filter(|(slot, _)| set >> slot.index() & 1 == 1) {
            *writer.word(3, slot) = 0;
        }
        (0..5).for_each(|at| writer.results(at, set));
        corners.push(writer.corner(format!("illegal words in the slots {set:#b}"), illegal));
    }
    let behind = |effect: Effect, body: u32, is_taken: bool| {
        let mut writer = Writer::new(base);
        let end = 2 + body;
        match effect {
            Effect::Loop => writer.counted(1, 3, end),
            _ => writer.put(1, effect, end + 2, Register::ZERO),
        }
        writer.results(0, 0);
        *writer.word(end, SlotIndex::FIRST) = 0;
        writer.results(end + 1, 0);
        writer.halt(end + 2);
        let fault = illegal.filter(|_| !is_taken);
        writer.corner(format!("an illegal word {body} bundles behind {effect:?}"), fault)
    };
    for body in 0..9 {
        corners.push(behind(Effect::BranchZero, body, true));
        corners.push(behind(Effect::BranchNonzero, body, false));
        if machine.loop_depth > 0 && body > 0 {
            corners.push(behind(Effect::Loop, body, false));
        }
    }
    corners
}

/// Powers of two below a machine's program memory that are far enough apart.
fn carries(machine: &Machine) -> impl Iterator<Item = u32> + use<> {
    (5..machine.code_depth.ilog2()).map(|bit| 1 << bit)
}

/// Loops whose addresses lie on either side of each power of two: with short and long bodies at every position, and nested so that the
/// inner loop ends before, with or beyond the outer one.
fn loops_at_carries(base: &Program) -> Vec<Corner> {
    let machine = base.machine;
    let mut corners = Vec::new();
    for body in [1, 2, 5, 6, 7, 8, 9] {
        for shift in 0..=body + 1 {
            let mut writer = Writer::new(base);
            let mut from = 0;
            for carry in carries(machine) {
                // The loop's own bundle, and the bundle after its body.
                let (at, target) = (carry + shift - body - 2, carry + shift - 1);
                writer.jump(from, at - 1);
                writer.counted(at, 3, target);
                writer.results(target, 0);
                from = target + 1;
            }
            writer.halt(from);
            corners.push(writer.corner(format!("loops of {body} bundles, {shift} behind a carry"), None));
        }
    }
    if machine.loop_depth < 2 {
        return corners;
    }
    for carry in carries(machine) {
        for (outer, inner) in (0..4).flat_map(|outer| (0..4).map(move |inner| (outer, inner))) {
            let mut writer = Writer::new(base);
            let (outer_target, inner_target) = (carry - 1 + outer, carry - 1 + inner);
            writer.jump(0, carry - 12);
            writer.counted(carry - 11, 2, outer_target);
            writer.counted(carry - 6, 3, inner_target);
            writer.halt(carry + 4);
            let fault = (outer <= inner).then_some("loop nesting");
            corners.push(
                writer
                    .corner(format!("loops at {carry} that end at {outer_target} and {inner_target}"), fault),
            );
        }
    }
    corners
}

/// Loops that end beyond the program memory, at an address that equals a bundle's except for its upper bits: alone, with a jump in the
/// body, and around another loop.
fn loops_beyond_memory(base: &Program) -> Vec<Corner> {
    let machine = base.machine;
    let mut corners = Vec::new();
    let beyond = [1, 2, 4, 8].map(|times| machine.code_depth * times).into_iter();
    for beyond in beyond.filter(|beyond| beyond + 32 < u32::from(u16::MAX)) {
        for case in 0..3 {
            let mut writer = Writer::new(base);
            writer.counted(1, 3, beyond + 18);
            match case {
                0 => {}
                1 => writer.jump(4, 14),
                _ if machine.loop_depth > 1 => writer.counted(3, 2, 6),
                _ => continue,
            }
            writer.results(17, 0);
            writer.halt(24);
            corners.push(writer.corner(format!("a loop that ends at {}, case {case}", beyond + 18), None));
        }
    }
    corners
}

/// Loops with two simultaneous faults, of which the first in the table of docs/timing.md counts.
fn faults_of_loops(base: &Program) -> Vec<Corner> {
    let machine = base.machine;
    let depth = machine.loop_depth;
    let mut corners = Vec::new();
    // Nested loops, as deep as the sequencer allows, and one more.
    for (count, target) in [(0, 30), (2, 30), (2, 100), (0, 100)] {
        let mut writer = Writer::new(base);
        (0..depth).for_each(|level| writer.counted(level, 2, 60 - 2 * level));
        writer.counted(depth, count, target);
        writer.halt(110);
        let name = format!("a loop beyond the deepest, of {count} iterations, to {target}");
        corners.push(writer.corner(name, Some("loops too deep")));
    }
    if depth > 1 {
        let mut writer = Writer::new(base);
        writer.counted(0, 2, 20);
        writer.counted(1, 0, 30);
        writer.halt(40);
        corners.push(
            writer.corner("a loop of no iterations across another's end".to_owned(), Some("loop count")),
        );
    }
    // An operation that redirects, as a loop's last bundle, with a fault of its own.
    for effect in [Effect::Return, Effect::Loop, Effect::Call, Effect::Publish, Effect::Halt, Effect::Wait] {
        let mut writer = Writer::new(base);
        writer.counted(0, 2, 9);
        writer.put(8, effect, 20, Register::ZERO);
        writer.halt(30);
        corners.push(writer.corner(format!("{effect:?} as a loop's last bundle"), Some("loop nesting")));
    }
    // The same for a call with a full return stack.
    let mut writer = Writer::new(base);
    (0..machine.stack_depth).for_each(|at| writer.put(at, Effect::Call, at + 1, Register::ZERO));
    writer.counted(machine.stack_depth, 2, machine.stack_depth + 9);
    writer.put(machine.stack_depth + 8, Effect::Call, 0, Register::ZERO);
    corners.push(writer.corner("the deepest call as a loop's last bundle".to_owned(), Some("loop nesting")));
    corners
}

/// Loops of many iterations: each position of a count from which a borrow occurs, up to 2^9.
fn long_loops(base: &Program) -> Vec<Corner> {
    let corner = |bit: u32| {
        let mut writer = Writer::new(base);
        writer.counted(0, (1 << bit) + 1, 3);
        writer.results(2, 0);
        writer.halt(4);
        writer.corner(format!("a loop of 2^{bit} + 1 iterations"), None)
    };
    (4..10).map(corner).collect()
}
