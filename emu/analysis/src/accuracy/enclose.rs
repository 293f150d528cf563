// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds of every output's error, over every run whose inputs and states begin a period within their `.range`.
//!
//! This is abstract interpretation. Every path through a section is followed, loops iteration by iteration, as in
//! [`bound`](crate::bound()); states of paths that meet are joined. The abstract values are [`Value`]s. The meaning in the rows of
//! instructions gives the results, and their `ulp` the rounding error.

use super::affine::Affine;
use super::bits;
use super::enclosure::{Assumed, Enclosure, Hazard, Moment, OutputBound};
use super::interval::Interval;
use super::number::{Number, Problem};
use super::operand::Operand;
use super::value::{MAX_PATTERNS, Value};
use super::{LARGEST_ROUNDED, ROUNDERS, fixed, is_rounder, ulp};
use crate::error::{BoundError, Refusal, place};
use crate::graph::{Edge, Graph};
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use takt_isa::fp::{Flags, Host};
use takt_isa::program::{Port, Range};
use takt_isa::{
    BundleAddress, Effect, Flow, Instruction, Program, Register, Row, SlotIndex, Type, compute, real,
};

/// Limit on the bundles executed abstractly, over all sections.
pub const MAX_BUNDLES: u64 = 1 << 18;
/// Limit on the words of data memory that a load with an unknown address may read.
const MAX_WORDS: usize = 4096;

/// Encloses the results of every period of a program; for a program without periods, those of the run to its `halt`.
///
/// # Errors
/// If a program cannot be enclosed: a loop without bound, a state or an input without a range, more paths than [`MAX_BUNDLES`].
pub fn enclose(program: &Program) -> Result<Enclosure, BoundError> {
    let mut stored = BTreeSet::new();
    loop {
        // What the loader put into a word is there as long as no store goes to it, and where stores go is known at the end: a word that
        // was taken for unchanged and is not makes another pass necessary, in which it counts as changed.
        let mut explorer = explored(program, &stored)?;
        let changed: Vec<u32> =
            explorer.initial_words.intersection(&explorer.changed_words).copied().collect();
        if changed.is_empty() {
            return Ok(explorer.finish());
        }
        stored.append(&mut explorer.changed_words);
    }
}

/// All sections of a program followed, where these data words may not be what the loader put there.
fn explored<'p>(program: &'p Program, stored: &BTreeSet<u32>) -> Result<Explorer<'p>, BoundError> {
    let graph = Graph::new(program)?;
    let mut explorer = Explorer {
        program,
        graph,
        symbols: Vec::new(),
        hazards: BTreeMap::new(),
        outputs: BTreeMap::new(),
        initial: BTreeMap::new(),
        first: BTreeSet::new(),
        needed: BTreeSet::new(),
        fixed: fixed(program),
        float_outputs: float_outputs(program).map(|port| port.register).collect(),
        left: BTreeMap::new(),
        bundles: 0,
        operations: 0,
        stored: stored.clone(),
        initial_words: BTreeSet::new(),
        changed_words: BTreeSet::new(),
    };
    let mut seen = BTreeSet::new();
    let mut sections = vec![(true, BundleAddress::RESET)];
    let mut once_outputs = BTreeMap::new();
    while let Some((once, address)) = sections.pop() {
        if !seen.insert((once, address)) {
            continue;
        }
        let targets = explorer.section(once, address)?;
        sections.extend(targets.iter().map(|target| (false, *target)));
        if once {
            // Outputs are compared at the ends of periods.
            once_outputs = std::mem::take(&mut explorer.outputs);
            explorer.initial = std::mem::take(&mut explorer.left);
            explorer.first.extend(targets);
        }
    }
    if seen.len() == 1 {
        explorer.outputs = once_outputs;
    }
    Ok(explorer)
}

/// The abstract state at a point of the program: everything that an instruction may read.
#[derive(Clone)]
struct State {
    registers: BTreeMap<Register, Value>,
    /// States not proved to be in their range at the first period's start, and not written since.
    unshown: BTreeSet<Register>,
    /// Data words written in this period.
    memory: BTreeMap<u32, Value>,
    /// Return addresses, and the iteration counts of active loops.
    calls: Vec<BundleAddress>,
    turns: BTreeMap<(usize, BundleAddress), u32>,
}

/// The point that a path has reached, ordered so that a path can only lead to later points.
type Position = Vec<u32>;

/// The registers that an operation reads, each with the range of its values; `None` if that is unknown.
type Operands = Vec<(Register, Option<Interval>)>;

struct Explorer<'p> {
    program: &'p Program,
    graph: Graph<'p>,
    /// For each symbol, the word whose rounding error it stands for; `None` for the value of an input or state.
    symbols: Vec<Option<u32>>,
    hazards: BTreeMap<(u32, Problem), Operands>,
    outputs: BTreeMap<Register, Value>,
    /// The states' values when the first period begins, the bundles where that does, and the states whose value then matters.
    initial: BTreeMap<Register, Value>,
    first: BTreeSet<BundleAddress>,
    needed: BTreeSet<Register>,
    /// The constant registers: [`fixed`].
    fixed: BTreeMap<Register, u32>,
    /// The output ports that carry binary32.
    float_outputs: BTreeSet<Register>,
    /// The states' values at the end of a period.
    left: BTreeMap<Register, Value>,
    bundles: u64,
    operations: u64,
    /// Data words that the program may change.
    stored: BTreeSet<u32>,
    /// Those that were taken to hold what the loader put there, and those that stores went to.
    initial_words: BTreeSet<u32>,
    changed_words: BTreeSet<u32>,
}

impl Explorer<'_> {
    fn symbol(&mut self, word: Option<u32>) -> u32 {
        self.symbols.push(word);
        (self.symbols.len() - 1) as u32
    }

    fn error(&self, address: BundleAddress, refusal: Refusal) -> BoundError {
        BoundError::new(self.program, address, refusal)
    }

    /// The abstract state at the start of a section.
    fn begin(&mut self, once: bool, address: BundleAddress) -> State {
        let program = self.program;
        // Later, a register that the program writes may hold something else than its preset.
        let constants = if once { program.constants.iter().copied().collect() } else { self.fixed.clone() };
        let mut registers: BTreeMap<Register, Value> =
            constants.into_iter().map(|(register, bits)| (register, Value::bits(bits))).collect();
        registers.insert(Register::ZERO, Value::bits(0));
        let mut unshown = BTreeSet::new();
        for range in &program.ranges {
            let input = program.machine.is_input(range.register);
            if once && !input {
                continue;
            }
            let value = self.ranged(range);
            registers.insert(range.register, value);
            if !input && self.first.contains(&address) && !shown(range, self.initial.get(&range.register)) {
                unshown.insert(range.register);
            }
        }
        State { registers, unshown, memory: BTreeMap::new(), calls: Vec::new(), turns: BTreeMap::new() }
    }

    fn ranged(&mut self, range: &Range) -> Value {
        let (low, high) = range.ends();
        let symbol = self.symbol(None);
        let grid = (range.ty == Type::I).then_some(0);
        let number = Rc::new(Number::of(Interval::new(low, high), symbol, grid));
        match range.ty {
            Type::F => Value::Float(number),
            Type::I | Type::B => Value::Integer(number),
        }
    }

    /// Gives the input ports that a bundle reads new values: unless they are latched, the host may have set them since the last read.
    fn sample(&mut self, address: BundleAddress, state: &mut State) {
        let program = self.program;
        let Some(Ok(instructions)) = program.bundle(address).filter(|_| !program.latched) else { return };
        let reads: BTreeSet<Register> = instructions.iter().flat_map(Instruction::reads).copied().collect();
        for range in program.ranges.iter().filter(|range| reads.contains(&range.register)) {
            if program.machine.is_input(range.register) {
                let value = self.ranged(range);
                state.registers.insert(range.register, value);
            }
        }
    }

    /// Follows every path from a section's start. Returns the targets of its `wait`s.
    fn section(&mut self, once: bool, address: BundleAddress) -> Result<Vec<BundleAddress>, BoundError> {
        let mut ways: BTreeMap<Position, (BundleAddress, State)> = BTreeMap::new();
        let begin = self.begin(once, address);
        self.join(&mut ways, address, begin)?;
        let mut targets = Vec::new();
        while let Some((_, (address, mut state))) = ways.pop_first() {
            self.bundles += 1;
            if self.bundles > MAX_BUNDLES {
                let limit = Refusal::Limit { limit: MAX_BUNDLES, what: "bundles on the way here" };
                return Err(self.error(address, limit));
            }
            self.sample(address, &mut state);
            let flow = self.graph.node(address)?.flow;
            let before = match flow {
                Flow::Branch { register, .. } => Some(self.read(&state, register, address)?),
                _ => None,
            };
            self.execute(address, &mut state)?;
            let next = address.next();
            match flow {
                Flow::Next | Flow::Loop { .. } => self.go(&mut ways, address, next, false, state)?,
                Flow::LoopEnd => {
                    let Some(head) = self.graph.node(address)?.closes else { continue };
                    let turn = state.turns.get(&(state.calls.len(), head)).copied().unwrap_or(1);
                    if turn >= self.graph.loops[&head].least {
                        self.go(&mut ways, address, next, false, state.clone())?;
                    }
                    self.go(&mut ways, address, head, true, state)?;
                }
                Flow::Jump(target) => self.go(&mut ways, address, target, true, state)?,
                Flow::Branch { zero, target, .. } => {
                    let (may_zero, may_set) = before.map_or((true, true), |value| value.tested());
                    let (taken, not) = if zero { (may_zero, may_set) } else { (may_set, may_zero) };
                    if not {
                        self.go(&mut ways, address, next, false, state.clone())?;
                    }
                    if taken {
                        self.go(&mut ways, address, target, true, state)?;
                    }
                }
                Flow::Call(target) => {
                    if state.calls.len() as u32 >= self.program.machine.stack_depth {
                        let depth = self.program.machine.stack_depth;
                        return Err(self.error(address, Refusal::StackOverflow { needed: depth + 1, depth }));
                    }
                    state.calls.push(next);
                    self.join(&mut ways, target, state)?;
                }
                Flow::Return => {
                    let Some(target) = state.calls.pop() else {
                        return Err(self.error(address, Refusal::StackUnderflow));
                    };
                    let depth = state.calls.len();
                    state.turns.retain(|(level, _), _| *level <= depth);
                    self.join(&mut ways, target, state)?;
                }
                Flow::Wait(target) => {
                    if !state.calls.is_empty() {
                        return Err(self.error(address, Refusal::WaitInSubroutine));
                    }
                    targets.push(target);
                    self.end(&state);
                }
                Flow::Halt => self.end(&state),
            }
        }
        Ok(targets)
    }

    /// Continues a path at a bundle; a back edge is one more iteration of the loop that it heads.
    fn go(
        &mut self,
        ways: &mut BTreeMap<Position, (BundleAddress, State)>,
        from: BundleAddress,
        to: BundleAddress,
        jump: bool,
        mut state: State,
    ) -> Result<(), BoundError> {
        let depth = state.calls.len();
        // A loop that the path has left is not iterated any more.
        state.turns.retain(|(level, head), _| *level < depth || self.graph.loops[head].body.contains(&to));
        if jump && to <= from {
            let Some(turned) = self.graph.loops.get(&to) else {
                let refusal = Refusal::Unbounded { closed: place(self.program, from) };
                return Err(self.error(to, refusal));
            };
            debug_assert!(turned.exits.iter().all(|Edge { to, .. }| !turned.body.contains(to)));
            let turns = state.turns.entry((depth, to)).or_insert(1);
            *turns += 1;
            if *turns > turned.most {
                // The loop bound in the source promises that this iteration does not occur.
                return Ok(());
            }
        } else if self.graph.loops.contains_key(&to) {
            state.turns.insert((depth, to), 1);
        }
        self.join(ways, to, state)
    }

    /// Adds a path to the worklist; its state is joined with that of a path that has reached the same position.
    fn join(
        &mut self,
        ways: &mut BTreeMap<Position, (BundleAddress, State)>,
        address: BundleAddress,
        state: State,
    ) -> Result<(), BoundError> {
        let position = self.position(address, &state);
        match ways.get_mut(&position) {
            None => {
                ways.insert(position, (address, state));
            }
            Some((_, known)) => {
                for (register, value) in &state.registers {
                    let joined = known.registers.get(register).unwrap_or(&Value::Unknown).join(value);
                    known.registers.insert(*register, joined);
                }
                known.registers.retain(|register, _| state.registers.contains_key(register));
                known.unshown.extend(&state.unshown);
                let words: BTreeSet<u32> = known.memory.keys().chain(state.memory.keys()).copied().collect();
                for word in words {
                    let mut initial = || self.initial(word);
                    let a = known.memory.get(&word).cloned().unwrap_or_else(&mut initial);
                    let b = state.memory.get(&word).cloned().unwrap_or_else(initial);
                    known.memory.insert(word, a.join(&b));
                }
            }
        }
        Ok(())
    }

    /// The position of a path: calls and iterations from the outermost to the innermost, then the bundle.
    fn position(&self, address: BundleAddress, state: &State) -> Position {
        let mut position = Vec::new();
        let level = |depth: usize, position: &mut Position| {
            let turned = state.turns.iter().filter(|((level, _), _)| *level == depth);
            let mut turned: Vec<(BundleAddress, u32)> =
                turned.map(|((_, head), turns)| (*head, *turns)).collect();
            // An outer loop has the larger body.
            turned.sort_by_key(|(head, _)| std::cmp::Reverse(self.graph.loops[head].body.len()));
            for (head, turns) in turned {
                position.extend([head.get(), turns]);
            }
        };
        for (depth, back) in state.calls.iter().enumerate() {
            level(depth, &mut position);
            // The call itself lies before its return address.
            position.push(back.get() - 1);
        }
        level(state.calls.len(), &mut position);
        position.push(address.get());
        position
    }

    /// The value of a register; an error if it is unknown.
    fn read(
        &mut self,
        state: &State,
        register: Register,
        address: BundleAddress,
    ) -> Result<Value, BoundError> {
        if state.unshown.contains(&register) {
            self.needed.insert(register);
        }
        match state.registers.get(&register) {
            Some(Value::Unknown) | None => {
                let name = self.program.register_text(register);
                let input = self.program.machine.is_input(register);
                Err(self.error(address, Refusal::NoRange { name, input }))
            }
            Some(value) => Ok(value.clone()),
        }
    }

    /// The value of a data word that this period has not written.
    fn initial(&mut self, word: u32) -> Value {
        match self.stored.contains(&word) {
            true => Value::Unknown,
            false => {
                self.initial_words.insert(word);
                Value::bits(self.program.data.get(word as usize).copied().unwrap_or(0))
            }
        }
    }

    fn execute(&mut self, address: BundleAddress, state: &mut State) -> Result<(), BoundError> {
        let Some(Ok(instructions)) = self.program.bundle(address) else { return Ok(()) };
        let machine = self.program.machine;
        let mut written = Vec::new();
        for ((number, slot), instruction) in machine.numbered_slots().zip(&instructions) {
            let value = self.operation(address, number, instruction, state)?;
            if let (Some(register), Some(value)) = (instruction.writes(slot), value) {
                if self.float_outputs.contains(&register)
                    && value.float().is_err_and(|problem| problem != Problem::Told)
                {
                    self.hazards
                        .entry((self.word(address, number), Problem::Output))
                        .or_insert_with(|| vec![(register, None)]);
                }
                written.push((register, value));
            }
        }
        for (register, value) in written {
            state.unshown.remove(&register);
            state.registers.insert(register, value);
        }
        Ok(())
    }

    fn word(&self, address: BundleAddress, slot: SlotIndex) -> u32 {
        (address.index() * self.program.machine.slots.len() + slot.index()) as u32
    }

    fn operation(
        &mut self,
        address: BundleAddress,
        slot: SlotIndex,
        instruction: &Instruction,
        state: &mut State,
    ) -> Result<Option<Value>, BoundError> {
        let word = self.word(address, slot);
        let mut operands = [(); 3].map(|()| Value::bits(0));
        for (operand, register) in operands.iter_mut().zip(instruction.reads()) {
            *operand = self.read(state, *register, address)?;
        }
        self.operations += u64::from(instruction.effect() != Effect::Nothing);
        Ok(match instruction.effect() {
            Effect::Compute => Some(self.compute(word, instruction, &operands)),
            Effect::Immediate => Some(Value::bits(instruction.constant)),
            Effect::Load => {
                let mut loaded: Option<Value> = None;
                for word in self.addresses(instruction, &operands[0], address)? {
                    let value = state.memory.get(&word).cloned().unwrap_or_else(|| self.initial(word));
                    if value == Value::Unknown {
                        let word = self.program.data_text(word);
                        return Err(self.error(address, Refusal::NoRangeOfWord { word }));
                    }
                    loaded = Some(loaded.map_or(value.clone(), |known| known.join(&value)));
                }
                Some(loaded.unwrap_or(Value::Broken))
            }
            Effect::Store => {
                let words = self.addresses(instruction, &operands[0], address)?;
                let certain = words.len() == 1;
                for word in words {
                    self.changed_words.insert(word);
                    let value = if certain {
                        operands[1].clone()
                    } else {
                        let known = state.memory.get(&word).cloned().unwrap_or_else(|| self.initial(word));
                        known.join(&operands[1])
                    };
                    state.memory.insert(word, value);
                }
                None
            }
            Effect::ReadFlags => Some(Value::Any),
            // These write nothing.
            Effect::ClearFlags | Effect::Nothing | Effect::Wait | Effect::Halt => None,
            Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => None,
            Effect::Call | Effect::Return | Effect::Loop => None,
        })
    }

    /// The data words that a load or store may touch.
    fn addresses(
        &self,
        instruction: &Instruction,
        base: &Value,
        address: BundleAddress,
    ) -> Result<Vec<u32>, BoundError> {
        let depth = self.program.machine.data_depth;
        let words: Vec<u32> = match base {
            Value::Patterns(patterns) => {
                patterns.iter().map(|base| instruction.constant.wrapping_add(*base)).collect()
            }
            Value::Integer(number) => {
                let offset = f64::from(instruction.constant);
                let (low, high) = (number.actual.low + offset, number.actual.high + offset);
                let within = low.max(0.0) as u32..=high.clamp(0.0, f64::from(depth)) as u32;
                within.take(MAX_WORDS + 1).collect()
            }
            _ => (0..depth).collect(),
        };
        // An address beyond the memory is a fault, after which nothing is computed.
        let words: Vec<u32> = words.into_iter().filter(|word| *word < depth).collect();
        if words.len() > MAX_WORDS {
            let what = "data words that one operation may touch";
            return Err(self.error(address, Refusal::Limit { limit: MAX_WORDS as u64, what }));
        }
        Ok(words)
    }

    fn compute(&mut self, word: u32, instruction: &Instruction, operands: &[Value; 3]) -> Value {
        let (op, row) = (instruction.op, instruction.op.row());
        let sources = row.shape.sources();
        let integer = row.result_type() == Type::I;
        if row.ulp.is_none() || integer {
            let raises = Cell::new(false);
            let known = patterns(operands, sources, |a, b, c| {
                let value = compute::<Host>(op, a, b, c);
                raises.set(raises.get() || value.flags != Flags::NONE);
                value.bits
            });
            if let Some(value) = known.filter(|_| !raises.get()) {
                return value;
            }
        }
        let operand = |i: usize| Operand::of(operands[i].clone());
        let Some(result) = real(op, operand(0), operand(1), operand(2)) else { return Value::Any };
        let Operand { value, mut problem, terms } = result;
        let value = match value {
            value if problem.is_some() || row.result_type() != Type::F => value,
            Value::Whole(_) | Value::Float(_) => {
                let rounded =
                    value.float().and_then(|number| self.round(word, instruction, &number, terms, operands));
                rounded.unwrap_or_else(|overflow| {
                    problem = Some(overflow);
                    Value::Broken
                })
            }
            value => value,
        };
        if let Some(problem) = problem.filter(|problem| *problem != Problem::Told) {
            let value = |value: &Value| value.float().ok().map(|number| number.actual);
            let reads = instruction.reads().iter().zip(operands);
            let reads: Vec<_> = reads.map(|(register, operand)| (*register, value(operand))).collect();
            self.hazards.entry((word, problem)).or_insert(reads);
        }
        self.own(value)
    }

    /// Gives an uncorrelated value a symbol of its own, so that later values can be correlated with it.
    fn own(&mut self, value: Value) -> Value {
        match value {
            Value::Float(number) if number.form.is_free() => {
                let form = Affine::of(number.exact, self.symbol(None));
                Value::Float(Rc::new(Number { form, ..Number::clone(&number) }))
            }
            Value::Integer(number) if number.form.is_free() => {
                let form = Affine::of(number.exact, self.symbol(None));
                Value::Integer(Rc::new(Number { form, ..Number::clone(&number) }))
            }
            value => value,
        }
    }

    /// Rounds a result to binary32, given the exact result for the run's operands.
    fn round(
        &mut self,
        word: u32,
        instruction: &Instruction,
        number: &Number,
        terms: Option<[Interval; 2]>,
        operands: &[Value; 3],
    ) -> Result<Value, Problem> {
        let exact = number.exact.meet(number.form.range());
        let actual = number.actual.meet(exact + number.error.range());
        let number = Number { actual, exact, ..number.clone() };
        let rounder = |register: &Register| self.fixed.get(register).is_some_and(|bits| is_rounder(*bits));
        let terms = terms.filter(|_| instruction.reads().iter().any(rounder));
        let (may_decide, may_round) = terms.map_or((false, true), decides);
        let row = instruction.op.row();
        let result = if !may_decide {
            self.rounded(word, row, number, operands)?
        } else {
            let decided = bits::nearest(&number, self.symbol(None));
            if may_round { decided.join(&self.rounded(word, row, number, operands)?) } else { decided }
        };
        Ok(Value::Float(Rc::new(result)))
    }

    /// Rounds a result whose rounding counts as an error.
    fn rounded(
        &mut self,
        word: u32,
        row: &Row,
        mut number: Number,
        operands: &[Value; 3],
    ) -> Result<Number, Problem> {
        let actual = number.actual;
        let bound = row.ulp.unwrap_or(0.0);
        let magnitude = actual.magnitude();
        let fits = |grid: i32| grid >= -149 && magnitude <= 2f64.powi((24 + grid).min(127));
        let largest = f64::from(f32::MAX);
        if bound == 0.0 || number.grid.is_some_and(fits) {
            return if magnitude <= largest { Ok(number) } else { Err(Problem::Overflow) };
        }
        let local = bound * ulp(magnitude);
        // A NaN does not fit.
        let fits = magnitude + local <= largest && number.error.range().is_finite();
        if !fits {
            return Err(Problem::Overflow);
        }
        // If all operands are known to the bit, so is the result.
        let known = patterns(operands, row.shape.sources(), |a, b, c| compute::<Host>(row.op, a, b, c).bits);
        if let Some(Value::Patterns(known)) = &known
            && let (1, Some(bits)) = (known.len(), known.first())
        {
            let value = Interval::point(f64::from(f32::from_bits(*bits)));
            number.error = Affine::free(value - number.exact);
            number.actual = value;
            return Ok(number);
        }
        let symbol = self.symbol(Some(word));
        number.error = number.error.with(symbol, local);
        number.actual = match bound == 0.5 {
            // Rounding to nearest is monotonic.
            true => Interval::new(f64::from(actual.low as f32), f64::from(actual.high as f32)),
            false => actual.widened(local),
        };
        number.actual = number.actual.meet(number.exact + number.error.range());
        Ok(number)
    }

    /// Ends a period: joins the values of outputs and states into those of all paths.
    fn end(&mut self, state: &State) {
        for register in self.float_outputs.clone() {
            if let Some(value) = state.registers.get(&register).filter(|value| **value != Value::Unknown) {
                join_into(&mut self.outputs, register, value);
            }
        }
        // Passed on to the next period, which may read it.
        self.needed.extend(&state.unshown);
        for range in &self.program.ranges {
            if let Some(value) = state.registers.get(&range.register) {
                join_into(&mut self.left, range.register, value);
            }
        }
    }

    fn finish(self) -> Enclosure {
        let output = |port: &Port| {
            let value = self.outputs.get(&port.register)?;
            let number = value.float().ok();
            let mut shares: BTreeMap<u32, f64> = BTreeMap::new();
            for (symbol, share) in number.iter().flat_map(|number| number.error.shares().0) {
                if let Some(word) = self.symbols[symbol as usize] {
                    *shares.entry(word).or_default() += share;
                }
            }
            let mut parts: Vec<(u32, f64)> = shares.into_iter().collect();
            parts.sort_by(|a, b| b.1.total_cmp(&a.1));
            Some(OutputBound {
                name: port.name.clone(),
                register: port.register,
                range: number.as_ref().map(|number| number.actual),
                error: number.as_ref().map(|number| number.error.range().magnitude()),
                parts,
            })
        };
        let states =
            self.program.ranges.iter().filter(|range| !self.program.machine.is_input(range.register));
        let assumed = |range: &Range| {
            let initial = self.initial.get(&range.register);
            let first = self.needed.contains(&range.register).then(|| Assumed {
                range: *range,
                moment: Moment::First,
                found: initial.and_then(|value| held(range, value)),
            });
            let left = self.left.get(&range.register);
            let later = left.filter(|value| !shown(range, Some(value))).map(|value| Assumed {
                range: *range,
                moment: Moment::Later,
                found: held(range, value),
            });
            first.into_iter().chain(later)
        };
        let outputs = float_outputs(self.program).filter_map(output);
        let hazard = |((word, problem), operands): (&(u32, Problem), &Vec<_>)| Hazard {
            word: *word,
            problem: *problem,
            operands: operands.clone(),
        };
        Enclosure {
            outputs: outputs.collect(),
            hazards: self.hazards.iter().map(hazard).collect(),
            assumed: states.flat_map(assumed).collect(),
            operations: self.operations,
        }
    }
}

/// The output ports that carry binary32.
fn float_outputs(program: &Program) -> impl Iterator<Item = &Port> {
    program.outputs.iter().filter(|port| port.ty == Type::F)
}

/// A state's value in the type of its range: binary32 or integer.
fn held(range: &Range, value: &Value) -> Option<Interval> {
    match range.ty {
        Type::F => value.float().ok().map(|number| number.actual),
        Type::I | Type::B => Some(value.whole().actual),
    }
}

/// True if a state is proved to be in its range.
fn shown(range: &Range, value: Option<&Value>) -> bool {
    let (low, high) = range.ends();
    let found = value.and_then(|value| held(range, value));
    found.is_some_and(|found| found.within(Interval::new(low, high)))
}

fn join_into(values: &mut BTreeMap<Register, Value>, register: Register, value: &Value) {
    let joined = values.get(&register).map_or_else(|| value.clone(), |known| known.join(value));
    values.insert(register, joined);
}

/// Two flags: a sum of these terms may be a rounding to the nearest integer, and may be an ordinary sum. It is the former if one term is
/// of a magnitude at which binary32 has no fraction, and the other is small. [`Shadow`](super::Shadow) decides the same by the
/// terms of the run.
fn decides(terms: [Interval; 2]) -> (bool, bool) {
    let [a, b] = terms;
    let (mut may, mut must) = (false, false);
    for (rounder, small) in [(a, b), (b, a)] {
        let magnitude = small.abs();
        for value in ROUNDERS.into_iter().flat_map(|value| [value, -value]) {
            if rounder.contains(value) && magnitude.low <= LARGEST_ROUNDED {
                may = true;
                must |= rounder.low == rounder.high && magnitude.high <= LARGEST_ROUNDED;
            }
        }
    }
    (may, !must)
}

/// The results of an operation on every combination of its operands' patterns, if these are known and not too many.
fn patterns(operands: &[Value; 3], sources: usize, of: impl Fn(u32, u32, u32) -> u32) -> Option<Value> {
    let mut lists: [Vec<u32>; 3] = [vec![0], vec![0], vec![0]];
    for (list, operand) in lists.iter_mut().zip(operands).take(sources) {
        match operand {
            Value::Patterns(patterns) => *list = patterns.iter().copied().collect(),
            _ => return None,
        }
    }
    let [a, b, c] = &lists;
    if a.len() * b.len() * c.len() > MAX_PATTERNS {
        return None;
    }
    let all = a.iter().flat_map(|a| b.iter().flat_map(move |b| c.iter().map(move |c| (*a, *b, *c))));
    Some(Value::patterns(all.map(|(a, b, c)| of(a, b, c)).collect()))
}
