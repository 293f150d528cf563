// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds of every output's error, over every run whose inputs and states begin a period within their `.range`.
//!
//! Method: abstract interpretation. Every path through a section is followed, loops iteration by iteration, as in
//! [`bound`](crate::bound()); states of paths that meet are joined. The abstract values are [`Value`]s. The meaning in the rows of
//! instructions gives the results (`compute.rs`), and their `ulp` the rounding error. Conditions narrow what was computed before
//! (`refine.rs`).

use super::converge::Linear;
use super::enclosure::{Converging, Enclosure, Hazard, Moment, OutputBound, UnprovedRange};
use super::interval::Interval;
use super::node::{Made, Node};
use super::number::{Number, Problem, float_grid};
use super::value::Value;
use super::{fixed, preset};
use crate::error::{BoundError, Refusal, place};
use crate::graph::{Edge, Graph};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use takt_isa::program::{Port, Range};
use takt_isa::{BundleAddress, Effect, Flow, Instruction, Program, Register, SlotIndex, Type};

/// Limit on the bundles executed abstractly, over all sections.
pub const MAX_BUNDLES: u64 = 1 << 18;
/// Limit on the parts of ranges that are evaluated separately, over a whole program.
const MAX_PARTS: u32 = 1 << 14;
/// Limit on the words of data memory that a load with an unknown address may read.
const MAX_WORDS: usize = 4096;

/// Encloses the results of every period of a program; without periods, the results of the run to its `halt`.
///
/// # Errors
/// If a program cannot be enclosed: a loop without bound, a state or an input without a range, more paths than [`MAX_BUNDLES`].
pub fn enclose(program: &Program) -> Result<Enclosure, BoundError> {
    let mut stored = BTreeSet::new();
    loop {
        // Fixpoint: assume that no store modifies a preloaded word. If a pass finds a store to an assumed word, that word counts as changed
        // in another pass.
        let mut explorer = explored(program, &stored)?;
        let changed: Vec<u32> =
            explorer.initial_words.intersection(&explorer.changed_words).copied().collect();
        if changed.is_empty() {
            return Ok(explorer.finish());
        }
        stored.append(&mut explorer.changed_words);
    }
}

/// Follows all sections, given the data words that the program may change.
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
        state_symbols: BTreeMap::new(),
        periods: 0,
        computed: BTreeMap::new(),
        bundles: 0,
        operations: 0,
        quiet: 0,
        parts: MAX_PARTS,
        nested: 0,
        stored: stored.clone(),
        initial_words: BTreeSet::new(),
        changed_words: BTreeSet::new(),
    };
    let mut seen = BTreeSet::new();
    let mut sections = vec![(true, BundleAddress::RESET)];
    let (mut once_outputs, mut once_computed) = (BTreeMap::new(), BTreeMap::new());
    while let Some((once, address)) = sections.pop() {
        if !seen.insert((once, address)) {
            continue;
        }
        let targets = explorer.section(once, address)?;
        sections.extend(targets.iter().map(|target| (false, *target)));
        if once {
            // Bounds hold for periods: keep the outputs of `.once` apart, for programs that have no period.
            once_outputs = std::mem::take(&mut explorer.outputs);
            once_computed = std::mem::take(&mut explorer.computed);
            explorer.initial = std::mem::take(&mut explorer.left);
            explorer.first.extend(targets);
        }
    }
    if seen.len() == 1 {
        (explorer.outputs, explorer.computed) = (once_outputs, once_computed);
    }
    Ok(explorer)
}

/// Abstract state at a point of the program: everything that an instruction may read.
#[derive(Clone)]
struct State {
    registers: BTreeMap<Register, Rc<Node>>,
    /// States not proved to be in their range at the first period's start, and not written since.
    unshown: BTreeSet<Register>,
    /// Data words written in this period.
    memory: BTreeMap<u32, Rc<Node>>,
    /// Return addresses, and the iteration counts of active loops.
    calls: Vec<BundleAddress>,
    turns: BTreeMap<(usize, BundleAddress), u32>,
}

/// Progress of a path, ordered so that a path can only lead to later points.
type Position = Vec<u32>;

/// Registers that an operation reads, each with the range of its values; `None` if that is unknown.
type Operands = Vec<(Register, Option<Interval>)>;

pub(super) struct Explorer<'p> {
    program: &'p Program,
    graph: Graph<'p>,
    /// Origin of each symbol: the word whose rounding error it stands for; `None` for the value of an input or state.
    pub(super) symbols: Vec<Option<u32>>,
    pub(super) hazards: BTreeMap<(u32, Problem), Operands>,
    outputs: BTreeMap<Register, Value>,
    /// States at the start of the first period: their values, the bundles at which it starts, and the states whose value matters then.
    initial: BTreeMap<Register, Value>,
    first: BTreeSet<BundleAddress>,
    needed: BTreeSet<Register>,
    /// Constant registers of the program: [`fixed`].
    pub(super) fixed: BTreeMap<Register, u32>,
    /// Output ports that carry binary32.
    float_outputs: BTreeSet<Register>,
    /// Values of the states at the end of a period.
    left: BTreeMap<Register, Value>,
    /// Symbols of the states when a period begins, and the periods' beginnings.
    state_symbols: BTreeMap<Register, u32>,
    periods: u32,
    /// Outputs as the period computes them, before cases are distinguished: with the operations that errors come from.
    computed: BTreeMap<Register, Value>,
    bundles: u64,
    pub(super) operations: u64,
    /// Depth of re-evaluations, during which hazards are not listed again.
    pub(super) quiet: u32,
    /// Number of parts of ranges that may still be evaluated separately.
    pub(super) parts: u32,
    /// Number of nested selections whose conditions are assumed.
    pub(super) nested: u32,
    /// Data words that the program may change.
    stored: BTreeSet<u32>,
    /// Words assumed to hold the loader's value, and words that stores modified.
    initial_words: BTreeSet<u32>,
    changed_words: BTreeSet<u32>,
}

impl Explorer<'_> {
    pub(super) fn symbol(&mut self, word: Option<u32>) -> u32 {
        self.symbols.push(word);
        (self.symbols.len() - 1) as u32
    }

    fn error(&self, address: BundleAddress, refusal: Refusal) -> BoundError {
        BoundError::new(self.program, address, refusal)
    }

    /// Abstract state at the start of a section.
    fn begin(&mut self, once: bool, address: BundleAddress) -> State {
        let program = self.program;
        // After `.once`, a register that the program writes may no longer hold its preset.
        let constants = if once { preset(program).collect() } else { self.fixed.clone() };
        let constant = |bits| Node::leaf(Value::bits(bits));
        let mut registers: BTreeMap<Register, Rc<Node>> =
            constants.into_iter().map(|(register, bits)| (register, constant(bits))).collect();
        registers.insert(Register::ZERO, constant(0));
        let mut unshown = BTreeSet::new();
        self.periods += u32::from(!once);
        for range in &program.ranges {
            let input = program.machine.is_input(range.register);
            if once && !input {
                continue;
            }
            let value = self.ranged(range);
            registers.insert(range.register, Node::leaf(value));
            self.state_symbols.insert(range.register, (self.symbols.len() - 1) as u32);
            if !input && self.first.contains(&address) && !shown(range, self.initial.get(&range.register)) {
                unshown.insert(range.register);
            }
        }
        State { registers, unshown, memory: BTreeMap::new(), calls: Vec::new(), turns: BTreeMap::new() }
    }

    fn ranged(&mut self, range: &Range) -> Value {
        let (low, high) = range.ends();
        let symbol = self.symbol(None);
        let ends = Interval::new(low, high);
        let grid = if range.ty == Type::F { float_grid(ends) } else { Some(0) };
        let number = Rc::new(Number::of(ends, symbol, grid));
        match range.ty {
            Type::F => Value::Float(number),
            Type::I | Type::B => Value::Integer(number),
        }
    }

    /// Gives new values to the input ports that a bundle reads: unless ports are latched, the host may have set them since the last read.
    /// Parameters keep their values within a period.
    fn sample(&mut self, address: BundleAddress, state: &mut State) {
        let program = self.program;
        let Some(Ok(instructions)) = program.bundle(address).filter(|_| !program.latched) else { return };
        let reads: BTreeSet<Register> = instructions.iter().flat_map(Instruction::reads).copied().collect();
        for range in program.ranges.iter().filter(|range| reads.contains(&range.register)) {
            let is_parameter = program.parameters.iter().any(|port| port.register == range.register);
            if program.machine.is_input(range.register) && !is_parameter {
                let value = self.ranged(range);
                state.registers.insert(range.register, Node::leaf(value));
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
                    let Some(condition) = before else { continue };
                    for (holds, to, jump) in [(zero, next, false), (!zero, target, true)] {
                        if let Some(state) = self.assumed(&state, &condition, holds) {
                            self.go(&mut ways, address, to, jump, state)?;
                        }
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

    /// State on the path where a condition holds, or does not; `None` if no run takes that path.
    fn assumed(&mut self, state: &State, condition: &Rc<Node>, holds: bool) -> Option<State> {
        let mut state = state.clone();
        match (condition.value.tested(), holds) {
            ((false, _), true) | ((_, false), false) => return Some(state),
            ((false, _), false) | ((_, false), true) => return None,
            _ => {}
        }
        let mut scene = self.scene(|context| context.decide(condition, holds))?;
        for node in state.registers.values_mut().chain(state.memory.values_mut()) {
            *node = self.under(node, &mut scene);
        }
        Some(state)
    }

    /// Continues a path at a bundle; a back edge starts one more iteration of the loop whose head it reaches.
    fn go(
        &mut self,
        ways: &mut BTreeMap<Position, (BundleAddress, State)>,
        from: BundleAddress,
        to: BundleAddress,
        jump: bool,
        mut state: State,
    ) -> Result<(), BoundError> {
        let depth = state.calls.len();
        // Drop the counts of loops that the path has left.
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

    /// Adds a path to the worklist, joining its state with the state of a path at the same position.
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
                for (register, node) in &state.registers {
                    let unknown = || Node::leaf(Value::Unknown);
                    let joined = known.registers.get(register).map_or_else(unknown, |known| known.join(node));
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

    /// Position of a path: calls and iterations from the outermost to the innermost, then the bundle.
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
            // The call's address precedes its return address.
            position.push(back.get() - 1);
        }
        level(state.calls.len(), &mut position);
        position.push(address.get());
        position
    }

    /// Value of a register; an error if it is unknown.
    fn read(
        &mut self,
        state: &State,
        register: Register,
        address: BundleAddress,
    ) -> Result<Rc<Node>, BoundError> {
        if state.unshown.contains(&register) {
            self.needed.insert(register);
        }
        match state.registers.get(&register).filter(|node| node.value != Value::Unknown) {
            None => {
                let name = self.program.register_text(register);
                let input = self.program.machine.is_input(register);
                Err(self.error(address, Refusal::NoRange { name, input }))
            }
            Some(node) => Ok(Rc::clone(node)),
        }
    }

    /// Value of a data word that this period has not written.
    fn initial(&mut self, word: u32) -> Rc<Node> {
        Node::leaf(match self.stored.contains(&word) {
            true => Value::Unknown,
            false => {
                self.initial_words.insert(word);
                Value::bits(self.program.data.get(word as usize).copied().unwrap_or(0))
            }
        })
    }

    fn execute(&mut self, address: BundleAddress, state: &mut State) -> Result<(), BoundError> {
        let Some(Ok(instructions)) = self.program.bundle(address) else { return Ok(()) };
        let machine = self.program.machine;
        let mut written = Vec::new();
        for ((number, slot), instruction) in machine.numbered_slots().zip(&instructions) {
            let node = self.operation(address, number, instruction, state)?;
            if let (Some(register), Some(node)) = (instruction.writes(slot), node) {
                if self.float_outputs.contains(&register)
                    && node.value.float().is_err_and(|problem| problem != Problem::Told)
                {
                    self.hazards
                        .entry((self.word(address, number), Problem::Output))
                        .or_insert_with(|| vec![(register, None)]);
                }
                written.push((register, node));
            }
        }
        for (register, node) in written {
            state.unshown.remove(&register);
            state.registers.insert(register, node);
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
    ) -> Result<Option<Rc<Node>>, BoundError> {
        let word = self.word(address, slot);
        let none = Node::leaf(Value::bits(0));
        let mut operands = [(); 3].map(|()| Rc::clone(&none));
        for (operand, register) in operands.iter_mut().zip(instruction.reads()) {
            *operand = self.read(state, *register, address)?;
        }
        self.operations += u64::from(instruction.effect() != Effect::Nothing);
        Ok(match instruction.effect() {
            Effect::Compute => Some(self.apply(&Made { word, instruction: *instruction, operands })),
            Effect::Immediate => Some(Node::leaf(Value::bits(instruction.constant))),
            Effect::Load => {
                let mut loaded: Option<Rc<Node>> = None;
                for word in self.addresses(instruction, &operands[0].value, address)? {
                    let node = state.memory.get(&word).cloned().unwrap_or_else(|| self.initial(word));
                    if node.value == Value::Unknown {
                        let word = self.program.data_text(word);
                        return Err(self.error(address, Refusal::NoRangeOfWord { word }));
                    }
                    loaded = Some(loaded.map_or_else(|| Rc::clone(&node), |known| known.join(&node)));
                }
                Some(loaded.unwrap_or_else(|| Node::leaf(Value::Broken)))
            }
            Effect::Store => {
                let words = self.addresses(instruction, &operands[0].value, address)?;
                let certain = words.len() == 1;
                for word in words {
                    self.changed_words.insert(word);
                    let node = if certain {
                        Rc::clone(&operands[1])
                    } else {
                        let known = state.memory.get(&word).cloned().unwrap_or_else(|| self.initial(word));
                        known.join(&operands[1])
                    };
                    state.memory.insert(word, node);
                }
                None
            }
            Effect::ReadFlags => Some(Node::leaf(Value::Any)),
            // Control and flag operations write no register.
            Effect::ClearFlags | Effect::Nothing | Effect::Wait | Effect::Halt => None,
            Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => None,
            Effect::Call | Effect::Return | Effect::Loop => None,
        })
    }

    /// Data words that a load or store may touch.
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
        // An address beyond the memory is a fault, which ends the run.
        let words: Vec<u32> = words.into_iter().filter(|word| *word < depth).collect();
        if words.len() > MAX_WORDS {
            let what = "data words that one operation may touch";
            return Err(self.error(address, Refusal::Limit { limit: MAX_WORDS as u64, what }));
        }
        Ok(words)
    }

    /// Ends a period: joins the values of outputs and states into the values over all paths.
    fn end(&mut self, state: &State) {
        for register in self.float_outputs.clone() {
            if let Some(node) = state.registers.get(&register).filter(|node| node.value != Value::Unknown) {
                let value = self.by_cases(node);
                join_into(&mut self.outputs, register, &value);
                join_into(&mut self.computed, register, &node.value);
            }
        }
        // Unread states pass to the next period, which may read them.
        self.needed.extend(&state.unshown);
        for range in &self.program.ranges {
            let Some(node) = state.registers.get(&range.register) else { continue };
            let kept = shown(range, Some(&node.value)) || node.value == Value::Unknown;
            let value = if kept { node.value.clone() } else { self.by_cases(node) };
            join_into(&mut self.left, range.register, &value);
        }
    }

    /// States that no single period keeps in their ranges, if their linear part proves that all of them stay there for all time.
    fn converging(&self) -> Vec<Converging> {
        let is_open = |range: &&Range| {
            let left = self.left.get(&range.register);
            !self.program.machine.is_input(range.register)
                && left.is_some_and(|value| !shown(range, Some(value)))
        };
        let open: Vec<&Range> = self.program.ranges.iter().filter(is_open).collect();
        // With several periods, each has its own symbols for the states.
        if open.is_empty() || self.periods != 1 {
            return Vec::new();
        }
        // A state whose range is proved already may converge with the others, or not (a limited integrator): try with and without these.
        let is_float = |range: &&Range| matches!(self.left.get(&range.register), Some(Value::Float(_)));
        let is_state = |range: &&Range| !self.program.machine.is_input(range.register);
        let all: Vec<&Range> = self.program.ranges.iter().filter(is_state).filter(is_float).collect();
        let is_open = |state: &Converging| open.iter().any(|range| range.register == state.range.register);
        let kept = [&all, &open].into_iter().find_map(|states| {
            let mut bounded = self.bounded_by_convergence(states)?;
            bounded.retain(is_open);
            let within = |state: &Converging| state.found.within(ends(&state.range));
            (bounded.len() == open.len() && bounded.iter().all(within)).then_some(bounded)
        });
        kept.unwrap_or_default()
    }

    fn bounded_by_convergence(&self, states: &[&Range]) -> Option<Vec<Converging>> {
        let symbols: Option<Vec<u32>> =
            states.iter().map(|range| self.state_symbols.get(&range.register).copied()).collect();
        let (symbols, mut linear) =
            (symbols?, Linear { rows: Vec::new(), added: Vec::new(), first: Vec::new() });
        for range in states {
            let Some(Value::Float(number)) = self.left.get(&range.register) else { return None };
            let (middle, radius) = (ends(range).middle(), Interval::point(ends(range).radius()));
            if radius.low <= 0.0 {
                return None;
            }
            let (row, rest) = number.form.apart(&symbols, middle);
            let added = Interval::point(rest) + Interval::point(number.error_range().magnitude());
            linear.rows.push(row.into_iter().map(|factor| Interval::point(factor) / radius).collect());
            linear.added.push((added / radius).high);
            let initial = self.initial.get(&range.register).filter(|value| shown(range, Some(value)));
            let first = initial.and_then(|value| held(range, value)).unwrap_or(ends(range));
            linear.first.push(((first - Interval::point(middle)).abs() / radius).high);
        }
        let found = states.iter().zip(linear.largest()?).map(|(range, most)| {
            let most = (Interval::point(most) * Interval::point(ends(range).radius())).high;
            Converging { range: **range, found: Interval::point(ends(range).middle()).widened(most) }
        });
        Some(found.collect())
    }

    fn finish(self) -> Enclosure {
        let output = |port: &Port| {
            let value = self.outputs.get(&port.register)?;
            let number = value.float().ok();
            let computed = self.computed.get(&port.register).and_then(|value| value.float().ok());
            let mut shares: BTreeMap<u32, f64> = BTreeMap::new();
            if let Some(number) = &computed {
                let (terms, rest) = number.error.shares();
                for (symbol, share) in terms.chain(number.error.blamed().map(|symbol| (symbol, rest))) {
                    if let Some(word) = self.symbols[symbol as usize] {
                        *shares.entry(word).or_default() += share;
                    }
                }
            }
            let mut parts: Vec<(u32, f64)> = shares.into_iter().collect();
            parts.sort_by(|a, b| b.1.total_cmp(&a.1));
            Some(OutputBound {
                name: port.name.clone(),
                register: port.register,
                range: number.as_ref().map(|number| number.actual),
                error: number.as_ref().map(|number| number.error_range().magnitude()),
                parts,
            })
        };
        let converging = self.converging();
        let states =
            self.program.ranges.iter().filter(|range| !self.program.machine.is_input(range.register));
        let assumed = |range: &Range| {
            let initial = self.initial.get(&range.register);
            let first = self.needed.contains(&range.register).then(|| UnprovedRange {
                range: *range,
                moment: Moment::First,
                found: initial.and_then(|value| held(range, value)),
            });
            let left = self.left.get(&range.register);
            let converges = converging.iter().any(|state| state.range.register == range.register);
            let later = left.filter(|value| !converges && !shown(range, Some(value))).map(|value| {
                UnprovedRange { range: *range, moment: Moment::Later, found: held(range, value) }
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
            converging: converging.clone(),
            operations: self.operations,
        }
    }
}

/// Output ports that carry binary32.
fn float_outputs(program: &Program) -> impl Iterator<Item = &Port> {
    program.outputs.iter().filter(|port| port.ty == Type::F)
}

/// Values of a state in the type of its range: binary32 or integer.
fn held(range: &Range, value: &Value) -> Option<Interval> {
    match range.ty {
        Type::F => value.float().ok().map(|number| number.actual),
        Type::I | Type::B => Some(value.whole().actual),
    }
}

fn ends(range: &Range) -> Interval {
    let (low, high) = range.ends();
    Interval::new(low, high)
}

/// The state is proved to lie in its range.
fn shown(range: &Range, value: Option<&Value>) -> bool {
    let (low, high) = range.ends();
    let found = value.and_then(|value| held(range, value));
    found.is_some_and(|found| found.within(Interval::new(low, high)))
}

fn join_into(values: &mut BTreeMap<Register, Value>, register: Register, value: &Value) {
    let joined = values.get(&register).map_or_else(|| value.clone(), |known| known.join(value));
    values.insert(register, joined);
}
