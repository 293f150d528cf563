// SPDX-License-Identifier: MIT OR Apache-2.0
//! Shadow execution: binary64 alongside the bit-exact run, with the rounding error of each operation propagated to first order.

use super::enclosure::OutputPlace;
use super::interval::Interval;
use super::probe::Probe;
use super::{LARGEST_ROUNDED, ROUNDERS, fixed, is_rounder, ulp};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use takt_emu::{Emulator, Fault, Status, Step};
use takt_isa::fp::Host;
use takt_isa::program::ArrayResult;
use takt_isa::timing::Cycle;
use takt_isa::{BundleAddress, Effect, Instruction, Program, Register, Type, compute, real};

/// An operation's share of an error, with its sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorShare {
    /// Word of the operation, an index into [`Program::code`].
    pub word: u32,
    /// Signed share, in the unit of the value.
    pub error: f64,
}

/// Largest error of a kind at an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LargestError {
    /// Error in the requested unit: the output's unit, ulps of the exact value, or a fraction of it.
    pub error: f64,
    /// Period, from 1; 0 is the section that runs once.
    pub period: u64,
    /// Output's value in the run.
    pub value: f64,
    /// Output's value in binary64.
    pub exact: f64,
}

/// Errors of an output at the ends of the periods.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputAccuracy {
    /// Name of the output port; of an array that is a result, that of the element with the largest absolute error.
    pub name: String,
    /// Output port, or first word of an array that is a result.
    pub place: OutputPlace,
    /// Largest error in the output's unit; `None` if the output was never a finite number.
    pub absolute: Option<LargestError>,
    /// Largest error in ulps.
    pub ulp: Option<LargestError>,
    /// Largest error relative to the exact value; periods with an exact value of zero are left out.
    pub relative: Option<LargestError>,
    /// Shares of the operations in the largest absolute error, largest first; they add up to it.
    pub parts: Vec<ErrorShare>,
    /// Periods at whose end the output was compared.
    pub periods: u64,
}

/// Effect of an operation on accuracy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OperationAccuracy {
    /// Times that the operation executed.
    pub count: u64,
    /// Largest rounding error of the operation itself, in ulps of its exact result.
    pub rounding: f64,
    /// Cancellation: most leading binary digits that the terms of its sum had in common while a term carried an error. The error relative
    /// to the result grows by as many digits.
    pub cancelled: f64,
    /// Period of the largest cancellation.
    pub cancelled_in: u64,
    /// Absorptions: executions in which a nonzero term of its sum was too small to change the result.
    pub absorbed: u64,
    /// Results.
    pub result: Seen,
    /// Values of the operands, in the order of the instruction's.
    pub reads: [Seen; 3],
}

/// Values of a run at a place in the program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Range of the values; `None` if none was a finite number.
    pub range: Option<Interval>,
    /// Largest magnitude of their errors.
    pub error: f64,
}

impl Seen {
    fn add(&mut self, value: f64, exact: f64) {
        if value.is_finite() {
            let at = Interval::point(value);
            self.range = Some(self.range.map_or(at, |range| range.hull(at)));
            self.error = self.error.max((value - exact).abs());
        }
    }
}

/// Decision of the run that binary64 would have made differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// Times that the decision differed.
    pub count: u64,
    /// First period in which it differed.
    pub period: u64,
}

/// Operation at which the comparison with binary64 was lost and started afresh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LostComparison {
    /// Times that it was lost.
    pub count: u64,
    /// First period in which it was lost.
    pub period: u64,
    /// Cause: a value was infinite or a NaN. Otherwise, an operation took the bits of a value with an error.
    pub infinite: bool,
}

/// Shadow of a register or data word.
#[derive(Clone)]
struct Cell {
    /// Bits in the run. If the machine holds other bits (an input, a value set by hand), the cell is out of date.
    bits: u32,
    real: f64,
    /// Shares of the error, ascending by word.
    parts: Rc<[ErrorShare]>,
}

/// Shadow execution: the program in binary64, beside a run.
///
/// Loads, stores, jumps and integer operations follow the run. Decisions that binary64 would have made differently are counted
/// ([`Shadow::decisions`]).
#[derive(Clone)]
pub struct Shadow {
    program: Rc<Program>,
    /// Constant registers that are added in order to round to integers.
    rounders: Rc<BTreeSet<Register>>,
    registers: BTreeMap<Register, Cell>,
    memory: BTreeMap<u32, Cell>,
    operations: BTreeMap<u32, OperationAccuracy>,
    decisions: BTreeMap<u32, Decision>,
    lost: BTreeMap<u32, LostComparison>,
    outputs: Vec<OutputAccuracy>,
    period: u64,
    /// Values count as exact at the start of each period.
    afresh: bool,
    /// Periods that break an assumption of the source are left out; this one does.
    keeping: bool,
    broken: bool,
}

/// Result of an operation.
struct Outcome {
    bits: u32,
    /// Value in binary64, and the shares of the operations in the difference; `None` if the result has no shadow.
    shadow: Option<(f64, Vec<ErrorShare>)>,
}

impl Outcome {
    fn exact(bits: u32) -> Outcome {
        Outcome { bits, shadow: None }
    }
}

/// Value in the run, in binary64, and the shares of the operations in the difference.
type Measured = (f64, f64, Rc<[ErrorShare]>);

fn finite(operand: Operand) -> Option<Measured> {
    operand.value.is_finite().then_some((operand.value, operand.real, operand.parts))
}

/// Operand in the run and in binary64.
struct Operand {
    bits: u32,
    value: f64,
    real: f64,
    parts: Rc<[ErrorShare]>,
}

impl Operand {
    fn error(&self) -> f64 {
        if self.parts.is_empty() { 0.0 } else { self.value - self.real }
    }
}

impl Shadow {
    /// Shadow for a run from reset.
    pub fn new(program: &Program) -> Shadow {
        let ports = program.outputs.iter().filter(|port| port.ty == Type::F);
        let ports = ports.map(|port| (port.name.clone(), OutputPlace::Port(port.register)));
        let arrays = program.results.iter().filter(|array| array.ty == Type::F).map(|array| {
            let name = program.element_text(array.first).unwrap_or_default();
            (name, OutputPlace::Array(array.first))
        });
        let output = |(name, place): (String, OutputPlace)| OutputAccuracy {
            name,
            place,
            absolute: None,
            ulp: None,
            relative: None,
            parts: Vec::new(),
            periods: 0,
        };
        Shadow {
            outputs: ports.chain(arrays).map(output).collect(),
            rounders: fixed(program)
                .into_iter()
                .filter(|(_, bits)| is_rounder(*bits))
                .map(|(at, _)| at)
                .collect::<BTreeSet<_>>()
                .into(),
            program: Rc::new(program.clone()),
            registers: BTreeMap::new(),
            memory: BTreeMap::new(),
            operations: BTreeMap::new(),
            decisions: BTreeMap::new(),
            lost: BTreeMap::new(),
            period: 0,
            afresh: false,
            keeping: false,
            broken: false,
        }
    }

    /// Counts values as exact at the start of each period, so that each error arises within one period, as static bounds assume.
    #[must_use]
    pub fn each_period_afresh(self) -> Shadow {
        Shadow { afresh: true, ..self }
    }

    /// Leaves out periods in which a value breaks an `.assume` of the source, in the run or in binary64, as static bounds do.
    #[must_use]
    pub fn keeping_assumptions(self) -> Shadow {
        Shadow { keeping: true, ..self }
    }

    /// Runs the machine to the next `wait` or `halt` and follows it. If the machine waits and no tick is scheduled, the tick
    /// comes when the front end has refilled, as in [`Emulator::run_period`]. The outputs are compared at the end.
    ///
    /// # Returns
    /// False once the machine has halted.
    ///
    /// # Errors
    /// The program's fault.
    pub fn run_period(&mut self, emulator: &mut Emulator) -> Result<bool, Fault> {
        if let Status::Waiting { since, .. } = *emulator.status() {
            emulator.tick_at(emulator.now().max(since + Cycle::from(emulator.machine().refill)));
        }
        self.run_period_with(emulator, |_| {})
    }

    /// Runs a period like [`Shadow::run_period`], with a scheduled tick. `act` may change the machine before each cycle.
    ///
    /// # Returns
    /// False once the machine has halted.
    ///
    /// # Errors
    /// The program's fault.
    pub fn run_period_with(
        &mut self,
        emulator: &mut Emulator,
        mut act: impl FnMut(&mut Emulator),
    ) -> Result<bool, Fault> {
        if let Status::Waiting { .. } = emulator.status() {
            self.begin_period();
        }
        loop {
            act(emulator);
            match emulator.step_cycle()? {
                Step::Halted => return Ok(false),
                Step::Stalled { .. } => {}
                Step::Issued { address, .. } => {
                    self.issued(emulator, address);
                    match emulator.status() {
                        Status::Running => {}
                        status => {
                            let halted = matches!(status, Status::Halted { .. });
                            if self.period > 0 || halted {
                                self.compare(emulator);
                            }
                            return Ok(!halted);
                        }
                    }
                }
            }
        }
    }

    /// Begins a period: counts it, and drops the shadows if each period begins afresh.
    pub fn begin_period(&mut self) {
        self.period += 1;
        self.broken = false;
        if self.afresh {
            self.registers.clear();
            self.memory.clear();
        }
    }

    /// Follows a bundle that issued in the previous cycle. Registers must still hold the values that it read.
    pub fn issued(&mut self, emulator: &Emulator, address: BundleAddress) {
        let program = Rc::clone(&self.program);
        let Some(Ok(instructions)) = program.bundle(address) else { return };
        // The interlocks ensure that a bundle reads the results of all earlier ones, so results can be written at once.
        let mut written = Vec::new();
        let machine = program.machine;
        for ((number, slot), instruction) in machine.numbered_slots().zip(&instructions) {
            let word = (address.index() * machine.slots.len() + number.index()) as u32;
            let outcome = self.execute(emulator, instruction, word);
            if let (Some(outcome), Some(assumption)) = (&outcome, program.assumption(word)) {
                let (low, high) = assumption.ends();
                let real = outcome.shadow.as_ref().map_or(low, |(real, _)| *real);
                self.broken |= !assumption.holds(outcome.bits) || real < low || real > high;
            }
            if let Some(register) = instruction.writes(slot) {
                written.push((register, outcome.unwrap_or(Outcome::exact(0))));
            }
        }
        for (register, outcome) in written {
            put(&mut self.registers, register, outcome);
        }
    }

    fn execute(&mut self, emulator: &Emulator, instruction: &Instruction, word: u32) -> Option<Outcome> {
        let mut operands = [(); 3].map(|()| Operand::exact(0));
        for (operand, &register) in operands.iter_mut().zip(instruction.reads()) {
            *operand = Operand::of(self.registers.get(&register), emulator.register(register).unwrap_or(0));
        }
        let address = instruction.constant.wrapping_add(operands[0].bits);
        match instruction.effect() {
            Effect::Compute => Some(self.compute(instruction, &operands, word)),
            Effect::Load => {
                let bits = emulator.memory().get(address as usize).copied().unwrap_or(0);
                Some(Operand::of(self.memory.get(&address), bits).outcome())
            }
            Effect::Store => {
                let [_, stored, _] = operands;
                put(&mut self.memory, address, stored.outcome());
                None
            }
            Effect::Immediate => Some(Outcome::exact(instruction.constant)),
            // Flags are an integer, and so exact.
            Effect::ReadFlags => None,
            // Control and flag operations write no register.
            Effect::ClearFlags | Effect::Nothing | Effect::Publish | Effect::Wait | Effect::Halt => None,
            Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => None,
            Effect::Call | Effect::Return | Effect::Loop => None,
        }
    }

    fn compute(&mut self, instruction: &Instruction, operands: &[Operand; 3], word: u32) -> Outcome {
        let (op, [a, b, c]) = (instruction.op, operands);
        let bits = compute::<Host>(op, a.bits, b.bits, c.bits).bits;
        let period = self.period;
        let evaluate = |shadowed: usize| {
            let probe = |i: usize| {
                let operand = &operands[i];
                Probe::new(if i < shadowed { operand.real } else { operand.value }, operand.bits)
            };
            real(op, probe(0), probe(1), probe(2))
        };
        let carries = operands.iter().any(|operand| !operand.parts.is_empty());
        let row = op.row();
        if carries && let Some(exact) = evaluate(3).and_then(|probe| probe.carried) {
            return self.carried(operands, bits, exact, word);
        }
        let (Some(plain), Some(bound)) = (evaluate(0), row.ulp) else {
            if carries {
                lose(&mut self.lost, word, period, false);
            }
            return Outcome::exact(bits);
        };
        let wholes = (0..row.shape.sources()).filter(|&i| row.source_type(i) == Type::I);
        if wholes.into_iter().any(|i| operands[i].error() != 0.0) {
            lose(&mut self.lost, word, period, false);
        }
        if row.result_type() == Type::I {
            if evaluate(3).is_some_and(|shadow| shadow.value != f64::from(bits.cast_signed())) {
                decide(&mut self.decisions, word, period);
            }
            return Outcome::exact(bits);
        }
        let value = f64::from(f32::from_bits(bits));
        let local = if bound == 0.0 { 0.0 } else { value - plain.value };
        let operation = self.operations.entry(word).or_default();
        operation.count += 1;
        for (seen, operand) in operation.reads.iter_mut().zip(operands) {
            seen.add(operand.value, operand.value - operand.error());
        }
        if let Some(terms) = plain.sum {
            let rounder = instruction.reads().iter().any(|register| self.rounders.contains(register));
            if let Some(nearest) = rounds_to_integer(terms).filter(|_| rounder) {
                // The sum counts as a decision: rounding to the nearest integer.
                let shadow = evaluate(3).and_then(|shadow| rounds_to_integer(shadow.sum?));
                if carries && shadow != Some(nearest) {
                    decide(&mut self.decisions, word, period);
                }
                operation.result.add(value, value);
                return Outcome::exact(bits);
            }
            operation.sum(terms, plain.value, value, carries, period);
        }
        if !carries && local == 0.0 {
            operation.result.add(value, value);
            return Outcome::exact(bits);
        }
        operation.rounding = operation.rounding.max((local / ulp(plain.value)).abs());
        let exact = if carries { evaluate(3).map_or(f64::NAN, |probe| probe.value) } else { plain.value };
        if !value.is_finite() || !exact.is_finite() {
            lose(&mut self.lost, word, period, true);
            return Outcome::exact(bits);
        }
        operation.result.add(value, exact);
        // Telescoping sum: replace the operands' values in the run by their values in binary64 one by one; each step is an operand's share.
        let mut parts: Vec<ErrorShare> = Vec::new();
        let mut before = plain.value;
        for (i, operand) in operands.iter().enumerate().filter(|(_, operand)| !operand.parts.is_empty()) {
            let after = evaluate(i + 1).map_or(before, |probe| probe.value);
            let error = operand.error();
            if error != 0.0 && before != after {
                parts = merge(&parts, &operand.parts, (before - after) / error);
            }
            before = after;
        }
        if local != 0.0 {
            parts = merge(&parts, &[ErrorShare { word, error: local }], 1.0);
        }
        Outcome { bits, shadow: Some((exact, parts)) }
    }

    /// Result of an operation on the bits of the only operand with an error: it keeps that error.
    fn carried(&mut self, operands: &[Operand; 3], bits: u32, exact: f64, word: u32) -> Outcome {
        let value = f64::from(f32::from_bits(bits));
        let Some(operand) = operands.iter().find(|operand| operand.error() != 0.0) else {
            return Outcome::exact(bits);
        };
        if !value.is_finite() || !exact.is_finite() {
            lose(&mut self.lost, word, self.period, true);
            return Outcome::exact(bits);
        }
        let parts = merge(&[], &operand.parts, (value - exact) / operand.error());
        Outcome { bits, shadow: Some((exact, parts)) }
    }

    /// Compares the outputs at the end of a period.
    pub fn compare(&mut self, emulator: &Emulator) {
        if self.keeping && self.broken {
            return;
        }
        let mut outputs = std::mem::take(&mut self.outputs);
        let program = Rc::clone(&self.program);
        for output in &mut outputs {
            let mut compared = false;
            let mut compare = |value: Option<Measured>, element: Option<u32>| {
                let Some((value, exact, parts)) = value else { return };
                compared = true;
                let error = (value - exact).abs();
                let worst = |error| LargestError { error, period: self.period, value, exact };
                if output.absolute.is_none_or(|known| error > known.error) {
                    output.absolute = Some(worst(error));
                    output.parts = parts.to_vec();
                    output.parts.sort_by(|a, b| b.error.abs().total_cmp(&a.error.abs()));
                    if let Some(name) = element.and_then(|word| program.element_text(word)) {
                        output.name = name;
                    }
                }
                keep(&mut output.ulp, worst(error / ulp(exact)));
                if exact != 0.0 {
                    keep(&mut output.relative, worst(error / exact.abs()));
                }
            };
            match output.place {
                OutputPlace::Port(register) => compare(self.value(emulator, register), None),
                OutputPlace::Array(first) => {
                    let array = program.results.iter().find(|array| array.first == first);
                    for word in array.into_iter().flat_map(ArrayResult::span) {
                        compare(self.word(emulator, word), Some(word));
                    }
                }
            }
            output.periods += u64::from(compared);
        }
        self.outputs = outputs;
    }

    /// Value of a data word that holds a finite number, its value in binary64, and the shares of the difference.
    fn word(&self, emulator: &Emulator, word: u32) -> Option<Measured> {
        let bits = emulator.memory().get(word as usize).copied()?;
        finite(Operand::of(self.memory.get(&word), bits))
    }

    /// Value of a register that holds a finite number, its value in binary64, and the shares of the difference.
    pub fn value(&self, emulator: &Emulator, register: Register) -> Option<(f64, f64, Rc<[ErrorShare]>)> {
        finite(Operand::of(self.registers.get(&register), emulator.register(register)?))
    }

    /// Accuracy of the outputs that carry binary32, in the order of their declaration; then of the arrays that are results.
    pub fn outputs(&self) -> &[OutputAccuracy] {
        &self.outputs
    }

    /// Executed operations with a meaning in the reals, by word.
    pub fn operations(&self) -> &BTreeMap<u32, OperationAccuracy> {
        &self.operations
    }

    /// Decisions that binary64 would have made differently, by word.
    pub fn decisions(&self) -> &BTreeMap<u32, Decision> {
        &self.decisions
    }

    /// Words at which the comparison was lost: errors are not followed beyond them.
    pub fn lost(&self) -> &BTreeMap<u32, LostComparison> {
        &self.lost
    }

    /// Number of periods begun.
    pub fn periods(&self) -> u64 {
        self.period
    }
}

impl Operand {
    fn exact(bits: u32) -> Operand {
        let value = f64::from(f32::from_bits(bits));
        Operand { bits, value, real: value, parts: Rc::default() }
    }

    fn of(cell: Option<&Cell>, bits: u32) -> Operand {
        let exact = Operand::exact(bits);
        match cell.filter(|cell| cell.bits == bits) {
            Some(cell) => Operand { real: cell.real, parts: Rc::clone(&cell.parts), ..exact },
            None => exact,
        }
    }

    fn outcome(&self) -> Outcome {
        let shadow = (!self.parts.is_empty()).then(|| (self.real, self.parts.to_vec()));
        Outcome { bits: self.bits, shadow }
    }
}

impl OperationAccuracy {
    /// Records cancellation and absorption in a sum, given its terms, its exact result and the run's result.
    fn sum(&mut self, terms: [f64; 2], exact: f64, value: f64, carries: bool, period: u64) {
        let [large, small] = if terms[0].abs() >= terms[1].abs() { terms } else { [terms[1], terms[0]] };
        if small != 0.0 && value == large && exact != large {
            self.absorbed += 1;
        }
        if carries && large != 0.0 && large.is_finite() {
            // An exact zero cancels all 24 digits.
            let digits = if exact == 0.0 { 24.0 } else { (large / exact).abs().log2() };
            if digits > self.cancelled.max(1.0) {
                (self.cancelled, self.cancelled_in) = (digits, period);
            }
        }
    }
}

/// Nearest integer to a term of a sum whose other term is a rounding constant ([`ROUNDERS`]).
fn rounds_to_integer(terms: [f64; 2]) -> Option<f64> {
    let [a, b] = terms;
    let of = |rounder: f64, value: f64| {
        let rounds = ROUNDERS.contains(&rounder.abs()) && value.abs() <= LARGEST_ROUNDED;
        rounds.then(|| value.round_ties_even())
    };
    of(a, b).or_else(|| of(b, a))
}

fn put<K: Ord>(cells: &mut BTreeMap<K, Cell>, place: K, outcome: Outcome) {
    match outcome.shadow {
        Some((real, parts)) => {
            cells.insert(place, Cell { bits: outcome.bits, real, parts: parts.into() });
        }
        None => {
            cells.remove(&place);
        }
    }
}

fn keep(known: &mut Option<LargestError>, worst: LargestError) {
    if known.is_none_or(|known| worst.error > known.error) {
        *known = Some(worst);
    }
}

fn decide(decisions: &mut BTreeMap<u32, Decision>, word: u32, period: u64) {
    decisions.entry(word).or_insert(Decision { count: 0, period }).count += 1;
}

fn lose(lost: &mut BTreeMap<u32, LostComparison>, word: u32, period: u64, infinite: bool) {
    lost.entry(word).or_insert(LostComparison { count: 0, period, infinite }).count += 1;
}

/// Sum of a list of shares and a multiple of another, both sorted by word.
fn merge(a: &[ErrorShare], b: &[ErrorShare], factor: f64) -> Vec<ErrorShare> {
    let mut merged = Vec::with_capacity(a.len() + b.len());
    let (mut i, mut j) = (0, 0);
    loop {
        let (x, y) =
            (a.get(i).copied(), b.get(j).map(|part| ErrorShare { error: part.error * factor, ..*part }));
        let take = match (x, y) {
            (None, None) => return merged,
            (Some(x), Some(y)) => x.word.cmp(&y.word),
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
        };
        i += usize::from(take != Ordering::Greater);
        j += usize::from(take != Ordering::Less);
        let error = |part: Option<ErrorShare>| part.map_or(0.0, |part| part.error);
        let part = match take {
            Ordering::Less => x,
            Ordering::Greater => y,
            Ordering::Equal => x.map(|part| ErrorShare { error: part.error + error(y), ..part }),
        };
        merged.extend(part);
    }
}
