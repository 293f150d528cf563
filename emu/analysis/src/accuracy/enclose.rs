// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds of every output's error, over every run whose inputs and states begin a period within their `.range`.
//!
//! Method: abstract interpretation. Every path through a section is followed, loops iteration by iteration, as in
//! [`bound`](crate::bound()); states of paths that meet are joined. The abstract values are [`Value`]s. The meaning in the rows of
//! instructions gives the results (`compute.rs`), and their `ulp` the rounding error. Conditions narrow what was computed before
//! (`refine.rs`).

use super::affine::Affine;
use super::assume::View;
use super::certificate::{self, Certificate};
use super::enclosure::{Enclosure, Hazard, OutputBound, OutputPlace, Relied};
use super::extent::{Extents, OperationExtent, join_extent};
use super::interval::Interval;
use super::memory::array_starts;
use super::node::{Made, Node};
use super::number::{Number, Problem};
use super::refine::constrained;
use super::states::{Place, is_shown, is_word_shown};
use super::value::Value;
use super::{fixed, kept, preset};
use crate::error::{BoundError, Refusal, place};
use crate::graph::{Edge, Graph};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;
use takt_isa::program::{ArrayResult, Assumption, Port};
use takt_isa::{BundleAddress, Effect, Flow, Instruction, Program, Register, SlotIndex, Type};

/// Limit on the bundles executed abstractly, over all sections.
pub const MAX_BUNDLES: u64 = 1 << 18;
/// Limit on the bundles of a loop that is followed iteration by iteration, iterations included; a larger loop is summarised.
pub const MAX_UNROLLED: u64 = 1 << 15;
/// Limit on the parts of ranges that are evaluated separately, over a whole program.
const MAX_PARTS: u32 = 1 << 14;
/// Encloses the results of every period of a program; without periods, the results of the run to its `halt`.
///
/// # Errors
/// If a program cannot be enclosed: a loop without bound, a state or an input without a range, more paths than [`MAX_BUNDLES`].
pub fn enclose(program: &Program) -> Result<Enclosure, BoundError> {
    enclose_reals(program, &Reals::default())
}

/// Numbers of a program that stand for real numbers, so that their rounding to binary32 counts as an error.
#[derive(Clone, PartialEq, Default, Debug)]
pub struct Reals {
    /// Input ports stand for real numbers in their ranges.
    pub inputs: bool,
    /// Real numbers that constants stand for. A constant without one is exact.
    pub constants: Vec<f64>,
}

/// Encloses the results like [`enclose`], with the rounding of numbers that stand for reals.
///
/// # Errors
/// The errors of [`enclose`].
pub fn enclose_reals(program: &Program, reals: &Reals) -> Result<Enclosure, BoundError> {
    match enclosed(program, MAX_UNROLLED, reals) {
        // Loops that call subroutines, and paths that do not meet, may be longer than they seem.
        Err(BoundError { refusal: Refusal::Limit { .. }, .. }) => enclosed(program, 0, reals),
        result => result,
    }
}

/// Encloses the results like [`enclose`]; loops of more than `unrolled` bundles, iterations included, are summarised.
///
/// # Errors
/// The errors of [`enclose`].
pub fn enclose_within(program: &Program, unrolled: u64) -> Result<Enclosure, BoundError> {
    enclosed(program, unrolled, &Reals::default())
}

fn enclosed(program: &Program, unrolled: u64, reals: &Reals) -> Result<Enclosure, BoundError> {
    let mut stored = BTreeSet::new();
    loop {
        // Fixpoint: assume that no store modifies a preloaded word. If a pass finds a store to an assumed word, that word counts as changed
        // in another pass.
        let mut explorer = explored(program, &stored, unrolled, reals, false)?;
        let changed: Vec<u32> =
            explorer.initial_words.intersection(&explorer.changed_words).copied().collect();
        if changed.is_empty() {
            return Ok(explorer.finish());
        }
        stored.append(&mut explorer.changed_words);
    }
}

/// Certificate of the bounds of a program whose periods have no branches. With several periods, each gives its own bounds.
///
/// # Errors
/// The errors of [`enclose`]; or the reason why the program has no certificate, as text.
pub fn certify(program: &Program) -> Result<Result<Certificate, String>, BoundError> {
    let mut stored = BTreeSet::new();
    loop {
        let mut explorer = explored(program, &stored, u64::MAX, &Reals::default(), true)?;
        let changed: Vec<u32> =
            explorer.initial_words.intersection(&explorer.changed_words).copied().collect();
        if !changed.is_empty() {
            stored.append(&mut explorer.changed_words);
            continue;
        }
        return Ok(match explorer.periods {
            _ if explorer.branches => Err("a period with branches has no certificate".to_owned()),
            0 => Err("a program without a period has no certificate".to_owned()),
            _ => Ok(certificate::derive(&explorer, &explorer.left)),
        });
    }
}

/// Follows all sections, given the data words that the program may change.
fn explored<'p>(
    program: &'p Program,
    stored: &BTreeSet<u32>,
    unrolled: u64,
    reals: &Reals,
    plain: bool,
) -> Result<Explorer<'p>, BoundError> {
    let graph = Graph::with_open_loops(program)?;
    let mut explorer = Explorer {
        program,
        graph,
        unrolled,
        plain,
        entered: Vec::new(),
        left: Vec::new(),
        branches: false,
        real_inputs: reals.inputs,
        real_constants: real_constants(&reals.constants),
        symbols: Vec::new(),
        found: Found::default(),
        once: true,
        initial: BTreeMap::new(),
        first: BTreeSet::new(),
        needed: BTreeSet::new(),
        fixed: fixed(program),
        kept: kept(program),
        left_by_once: BTreeMap::new(),
        float_outputs: numbers(program).filter(|port| port.ty == Type::F).map(|port| port.register).collect(),
        arrays: array_starts(program),
        state_symbols: BTreeMap::new(),
        ranged_words: BTreeMap::new(),
        periods: 0,
        bundles: 0,
        quiet: 0,
        parts: MAX_PARTS,
        divided: HashMap::new(),
        nested: 0,
        stored: stored.clone(),
        initial_words: BTreeSet::new(),
        changed_words: BTreeSet::new(),
    };
    let mut seen = BTreeSet::new();
    let mut sections = vec![(true, BundleAddress::RESET)];
    let mut of_once = Found::default();
    while let Some((once, address)) = sections.pop() {
        if !seen.insert((once, address)) {
            continue;
        }
        let targets = explorer.section(once, address)?;
        sections.extend(targets.iter().map(|target| (false, *target)));
        if once {
            // Bounds hold for periods: keep the outputs of `.once` apart, for programs that have no period.
            let Found { hazards, operations, relied, left, .. } = explorer.found.clone();
            explorer.initial = left;
            let found = Found { hazards, operations, relied, ..Found::default() };
            of_once = std::mem::replace(&mut explorer.found, found);
            explorer.first.extend(targets);
        }
    }
    if seen.len() == 1 {
        explorer.found = of_once;
        explorer.found.left = BTreeMap::new();
    }
    Ok(explorer)
}

/// Real numbers by the bits of the constants that stand for them: several may round to one binary32.
fn real_constants(reals: &[f64]) -> HashMap<u32, Interval> {
    let mut found: HashMap<u32, Interval> = HashMap::new();
    for real in reals {
        let at = Interval::point(*real);
        found.entry((*real as f32).to_bits()).and_modify(|known| *known = known.hull(at)).or_insert(at);
    }
    found
}

/// Abstract state at a point of the program: everything that an instruction may read.
#[derive(Clone)]
pub(super) struct State {
    pub(super) registers: BTreeMap<Register, Rc<Node>>,
    /// States not proved to be in their range at the first period's start, and not written since.
    unshown: BTreeSet<Register>,
    /// Forms that are not positive, by assumptions on the way.
    constraints: Vec<Affine>,
    /// Data words written in this period.
    pub(super) memory: BTreeMap<u32, Rc<Node>>,
    /// Return addresses, and the iteration counts of active loops.
    pub(super) calls: Vec<BundleAddress>,
    turns: BTreeMap<(usize, BundleAddress), u32>,
}

/// Progress of a path, ordered so that a path can only lead to later points.
type Position = Vec<u32>;

/// Exploration of the paths through a section, or through one iteration of a loop.
pub(super) struct Walk {
    ways: BTreeMap<Position, (BundleAddress, State)>,
    /// Loop whose iteration is followed: the depth of calls, and its head.
    scope: Option<(usize, BundleAddress)>,
    /// Targets of `wait`s.
    targets: Vec<BundleAddress>,
    /// States that begin the next iteration, and those that leave the loop.
    pub(super) back: Vec<State>,
    exits: Vec<Exit>,
}

/// Edge by which a path leaves a loop.
struct Exit {
    from: BundleAddress,
    to: BundleAddress,
    jump: bool,
    state: State,
}

impl Walk {
    pub(super) fn new(scope: Option<(usize, BundleAddress)>) -> Walk {
        Walk { ways: BTreeMap::new(), scope, targets: Vec::new(), back: Vec::new(), exits: Vec::new() }
    }
}

/// Statements about the paths that have been followed.
#[derive(Clone, Default)]
pub(super) struct Found {
    pub(super) hazards: BTreeMap<(u32, Problem), Operands>,
    outputs: BTreeMap<Place, Value>,
    /// Outputs as the period computes them, before cases are distinguished: with the operations that errors come from.
    computed: BTreeMap<Place, Value>,
    /// Operations in the histories of outputs without a range.
    open: BTreeMap<Place, BTreeSet<u32>>,
    /// Values of the states at the end of a period.
    pub(super) left: BTreeMap<Place, Value>,
    /// First array that each access touched: by its word, and the calls of its subroutine.
    pub(super) touched: BTreeMap<(u32, Vec<BundleAddress>), Option<u32>>,
    /// A path has ended.
    ended: bool,
    /// Assumptions that narrow a value: the words of their operations, with the registers that these write.
    relied: BTreeMap<u32, Register>,
    /// Operations in the histories of outputs, if there are assumptions.
    histories: BTreeMap<Place, BTreeSet<u32>>,
    /// Ranges and errors at each operation.
    extents: Extents,
    /// Operations that compute the values of outputs.
    sources: BTreeMap<Place, BTreeSet<u32>>,
    pub(super) operations: u64,
}

/// Registers that an operation reads, each with the range of its values; `None` if that is unknown.
pub(super) type Operands = Vec<(Register, Option<Interval>)>;

pub(super) struct Explorer<'p> {
    pub(super) program: &'p Program,
    pub(super) graph: Graph<'p>,
    /// Size from which loops are summarised.
    unrolled: u64,
    /// Operations are followed as they are, for a certificate: no case is distinguished, no condition narrows a value.
    pub(super) plain: bool,
    /// Symbols of the values that enter a period, for a certificate, and the values that it leaves, with the period's number.
    pub(super) entered: Vec<(u32, Place)>,
    left: Vec<(u32, Place, Rc<Node>)>,
    /// The period has a branch, whose sides a certificate would have to distinguish.
    branches: bool,
    /// The rounding of inputs counts as an error.
    pub(super) real_inputs: bool,
    /// Real numbers that constants stand for, by the constants' bits.
    real_constants: HashMap<u32, Interval>,
    pub(super) found: Found,
    /// The section from reset is followed, in which data memory holds what the loader put there.
    pub(super) once: bool,
    /// Origin of each symbol: the word whose rounding error it stands for; `None` for the value of an input or state.
    pub(super) symbols: Vec<Option<u32>>,
    /// States at the start of the first period: their values, the bundles at which it starts, and the states whose value matters then.
    pub(super) initial: BTreeMap<Place, Value>,
    first: BTreeSet<BundleAddress>,
    pub(super) needed: BTreeSet<Register>,
    /// Constant registers of the program: [`fixed`].
    pub(super) fixed: BTreeMap<Register, u32>,
    /// Registers that no period writes, and the code before the first one does: [`kept`]. The values that it leaves there.
    kept: BTreeSet<Register>,
    left_by_once: BTreeMap<Register, Value>,
    /// Output ports that carry binary32.
    float_outputs: BTreeSet<Register>,
    /// First words of arrays, by their labels, and the end of the declared data.
    pub(super) arrays: BTreeSet<u32>,
    /// Symbols of the states when a period begins, and the periods' beginnings.
    pub(super) state_symbols: BTreeMap<Place, u32>,
    /// Words of arrays with a range, as this period finds them.
    pub(super) ranged_words: BTreeMap<u32, Rc<Node>>,
    pub(super) periods: u32,
    bundles: u64,
    /// Depth of re-evaluations, during which hazards are not listed again.
    pub(super) quiet: u32,
    /// Number of parts of ranges that may still be evaluated separately.
    pub(super) parts: u32,
    /// Values of functions that parts of their arguments' ranges gave, by what [`Explorer::in_parts`] knows of the function.
    pub(super) divided: HashMap<Vec<u64>, Option<Rc<Number>>>,
    /// Number of nested selections whose conditions are assumed.
    pub(super) nested: u32,
    /// Data words that the program may change.
    pub(super) stored: BTreeSet<u32>,
    /// Words assumed to hold the loader's value, and words that stores modified.
    pub(super) initial_words: BTreeSet<u32>,
    pub(super) changed_words: BTreeSet<u32>,
}

impl Explorer<'_> {
    pub(super) fn symbol(&mut self, word: Option<u32>) -> u32 {
        self.symbols.push(word);
        (self.symbols.len() - 1) as u32
    }

    pub(super) fn error(&self, address: BundleAddress, refusal: Refusal) -> BoundError {
        BoundError::new(self.program, address, refusal)
    }

    /// Value of a constant: with the rounding error of the real number that it stands for, if there is one.
    pub(super) fn constant(&self, bits: u32) -> Value {
        let value = f64::from(f32::from_bits(bits));
        match self.real_constants.get(&bits) {
            Some(real) if *real != Interval::point(value) => {
                Value::Float(Rc::new(Number::rounded_constant(value, *real)))
            }
            _ => Value::bits(bits),
        }
    }

    /// Abstract state at the start of a section.
    fn begin(&mut self, once: bool, address: BundleAddress) -> State {
        let program = self.program;
        // After `.once`, a register that the program writes may no longer hold its preset.
        let constants = if once { preset(program).collect() } else { self.fixed.clone() };
        let constant = |bits| Node::leaf(self.constant(bits));
        let mut registers: BTreeMap<Register, Rc<Node>> =
            constants.into_iter().map(|(register, bits)| (register, constant(bits))).collect();
        registers.insert(Register::ZERO, constant(0));
        for (register, value) in self.left_by_once.clone() {
            let value = match value {
                // Every period begins with the run's value, which counts as exact.
                Value::Float(number) => {
                    let symbol = self.symbol(None);
                    Value::Float(Rc::new(Number::of(number.actual, symbol, number.grid)))
                }
                value => value,
            };
            registers.insert(register, Node::leaf(value));
        }
        let mut unshown = BTreeSet::new();
        self.periods += u32::from(!once);
        (self.once, self.found.ended) = (once, false);
        self.ranged_words.clear();
        for range in &program.ranges {
            let input = program.machine.is_input(range.register);
            if once && !input {
                continue;
            }
            let place = Place::Register(range.register);
            let value = self.ranged(place, range.ty, range.ends());
            registers.insert(range.register, Node::leaf(value));
            if !input && self.first.contains(&address) && !is_shown(range, self.initial.get(&place)) {
                unshown.insert(range.register);
            }
        }
        State {
            registers,
            unshown,
            constraints: Vec::new(),
            memory: BTreeMap::new(),
            calls: Vec::new(),
            turns: BTreeMap::new(),
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
                let value = self.ranged(Place::Register(range.register), range.ty, range.ends());
                state.registers.insert(range.register, Node::leaf(value));
            }
        }
    }

    /// Follows every path from a section's start. Returns the targets of its `wait`s.
    fn section(&mut self, once: bool, address: BundleAddress) -> Result<Vec<BundleAddress>, BoundError> {
        let mut walk = Walk::new(None);
        let begin = self.begin(once, address);
        self.join(&mut walk, address, begin)?;
        Ok(self.follow(walk)?.targets)
    }

    /// The path enters a loop that is too long to be followed iteration by iteration.
    fn enters_long_loop(&self, walk: &Walk, address: BundleAddress, state: &State) -> bool {
        let place = (state.calls.len(), address);
        walk.scope != Some(place)
            && state.turns.get(&place) == Some(&1)
            && self.unrolled_size(address) > self.unrolled
    }

    /// Follows every path of a walk to its end.
    pub(super) fn follow(&mut self, mut walk: Walk) -> Result<Walk, BoundError> {
        let walk_on = &mut walk;
        while let Some((_, (address, state))) = walk_on.ways.pop_first() {
            if self.enters_long_loop(walk_on, address, &state) {
                let Walk { targets, exits, .. } = self.summary(address, state)?;
                walk_on.targets.extend(targets);
                for Exit { from, to, jump, state } in exits {
                    self.go(walk_on, from, to, jump, state)?;
                }
                continue;
            }
            self.step(walk_on, address, state)?;
        }
        Ok(walk)
    }

    /// Executes a bundle and follows its edges.
    fn step(&mut self, walk: &mut Walk, address: BundleAddress, mut state: State) -> Result<(), BoundError> {
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
        if !self.execute(address, &mut state)? {
            return Ok(());
        }
        let next = address.next();
        match flow {
            Flow::Next | Flow::Publish | Flow::Loop { .. } => self.go(walk, address, next, false, state)?,
            Flow::LoopEnd => {
                let Some(head) = self.graph.node(address)?.closes else { return Ok(()) };
                let turn = state.turns.get(&(state.calls.len(), head)).copied().unwrap_or(1);
                let is_any = walk.scope == Some((state.calls.len(), head));
                if is_any || turn >= self.graph.loops[&head].least {
                    self.go(walk, address, next, false, state.clone())?;
                }
                self.go(walk, address, head, true, state)?;
            }
            Flow::Jump(target) => self.go(walk, address, target, true, state)?,
            Flow::Branch { zero, target, .. } => {
                let Some(condition) = before else { return Ok(()) };
                self.branches |= !matches!(condition.value, Value::Patterns(_))
                    || condition.value.tested() == (true, true);
                for (holds, to, jump) in [(zero, next, false), (!zero, target, true)] {
                    if let Some(state) = self.assumed(&state, &condition, holds) {
                        self.go(walk, address, to, jump, state)?;
                    }
                }
            }
            Flow::Call(target) => {
                if state.calls.len() as u32 >= self.program.machine.stack_depth {
                    let depth = self.program.machine.stack_depth;
                    return Err(self.error(address, Refusal::StackOverflow { needed: depth + 1, depth }));
                }
                state.calls.push(next);
                self.join(walk, target, state)?;
            }
            Flow::Return => {
                let Some(target) = state.calls.pop() else {
                    return Err(self.error(address, Refusal::StackUnderflow));
                };
                let depth = state.calls.len();
                state.turns.retain(|(level, _), _| *level <= depth);
                self.join(walk, target, state)?;
            }
            Flow::Wait(target) => {
                if !state.calls.is_empty() {
                    return Err(self.error(address, Refusal::WaitInSubroutine));
                }
                walk.targets.push(target);
                self.end(&state);
            }
            Flow::Halt => self.end(&state),
        }
        Ok(())
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
        walk: &mut Walk,
        from: BundleAddress,
        to: BundleAddress,
        jump: bool,
        mut state: State,
    ) -> Result<(), BoundError> {
        let depth = state.calls.len();
        if let Some((_, head)) = walk.scope.filter(|(outer, _)| *outer == depth) {
            if !self.graph.loops[&head].body.contains(&to) {
                walk.exits.push(Exit { from, to, jump, state });
                return Ok(());
            }
            if to == head && jump && to <= from {
                walk.back.push(state);
                return Ok(());
            }
        }
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
        self.join(walk, to, state)
    }

    /// Adds a path to the worklist, joining its state with the state of a path at the same position.
    pub(super) fn join(
        &mut self,
        walk: &mut Walk,
        address: BundleAddress,
        state: State,
    ) -> Result<(), BoundError> {
        let position = self.position(address, &state);
        match walk.ways.get_mut(&position) {
            None => {
                walk.ways.insert(position, (address, state));
            }
            Some((_, known)) => {
                for (register, node) in &state.registers {
                    let unknown = || Node::leaf(Value::Unknown);
                    let joined = known.registers.get(register).map_or_else(unknown, |known| known.join(node));
                    known.registers.insert(*register, joined);
                }
                known.registers.retain(|register, _| state.registers.contains_key(register));
                known.unshown.extend(&state.unshown);
                known.constraints.retain(|constraint| state.constraints.contains(constraint));
                let words: BTreeSet<u32> = known.memory.keys().chain(state.memory.keys()).copied().collect();
                for word in words {
                    let mut initial = || self.initial_word(word);
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

    /// Executes the operations of a bundle. Returns false if no run executes it: an assumption does not hold.
    fn execute(&mut self, address: BundleAddress, state: &mut State) -> Result<bool, BoundError> {
        let Some(Ok(instructions)) = self.program.bundle(address) else { return Ok(true) };
        let machine = self.program.machine;
        let mut written = Vec::new();
        for ((number, slot), instruction) in machine.numbered_slots().zip(&instructions) {
            let node = self.operation(address, number, instruction, state)?;
            if let (Some(register), Some(node)) = (instruction.writes(slot), node) {
                if self.float_outputs.contains(&register)
                    && node.value.float().is_err_and(|problem| problem != Problem::Told)
                {
                    self.found
                        .hazards
                        .entry((self.word(address, number), Problem::Output))
                        .or_insert_with(|| vec![(register, None)]);
                }
                written.push((register, self.word(address, number), node));
            }
        }
        let mut kept = Vec::new();
        for (register, word, node) in written {
            state.unshown.remove(&register);
            kept.extend(
                self.program.assumption(word).map(|assumption| (*assumption, register, Rc::clone(&node))),
            );
            state.registers.insert(register, node);
        }
        Ok(kept
            .into_iter()
            .all(|(assumption, register, node)| self.rely(&assumption, register, &node, state)))
    }

    /// Narrows the values of a state by an assumption. Returns false if no run keeps it.
    fn rely(
        &mut self,
        assumption: &Assumption,
        register: Register,
        node: &Rc<Node>,
        state: &mut State,
    ) -> bool {
        let (low, high) = assumption.ends();
        let (view, known) = match assumption.ty {
            Type::F => (View::Float, node.value.float().ok().map(|number| number.both())),
            Type::I | Type::B => (View::Integer, Some(node.value.whole().actual)),
        };
        let promised = Interval::new(low, high);
        if self.plain {
            return true;
        }
        if known.is_none_or(|known| known.within(promised)) {
            return true;
        }
        self.found.relied.insert(assumption.word, register);
        let Some(mut scene) = self.scene(|context| context.promise(node, promised, view)) else {
            return false;
        };
        for node in state.registers.values_mut().chain(state.memory.values_mut()) {
            *node = self.under(node, &mut scene);
        }
        scene.add_to(&mut state.constraints);
        true
    }

    pub(super) fn word(&self, address: BundleAddress, slot: SlotIndex) -> u32 {
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
        self.found.operations += u64::from(instruction.effect() != Effect::Nothing);
        Ok(match instruction.effect() {
            Effect::Compute => {
                let made = Made { word, instruction: *instruction, operands };
                let node = constrained(self.apply(&made), &state.constraints);
                if let Some(extent) = OperationExtent::of(&made, &node) {
                    join_extent(&mut self.found.extents, word, extent);
                }
                Some(node)
            }
            Effect::Immediate => Some(Node::leaf(self.constant(instruction.constant))),
            Effect::Load => {
                let words = self.addresses(word, instruction, &operands[0].value, (address, &state.calls))?;
                Some(self.load(state, words, address)?)
            }
            Effect::Store => {
                let words = self.addresses(word, instruction, &operands[0].value, (address, &state.calls))?;
                let value = self.settled(&operands[1]);
                self.store(state, words, &value);
                None
            }
            Effect::ReadFlags => Some(Node::leaf(Value::Any)),
            // Control and flag operations write no register.
            Effect::ClearFlags | Effect::Nothing | Effect::Publish | Effect::Wait | Effect::Halt => None,
            Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => None,
            Effect::Call | Effect::Return | Effect::Loop => None,
        })
    }

    /// Ends a period: joins the values of outputs and states into the values over all paths.
    fn end(&mut self, state: &State) {
        if self.plain {
            return self.end_plainly(state);
        }
        for register in numbers(self.program).map(|port| port.register) {
            if let Some(node) = state.registers.get(&register).filter(|node| node.value != Value::Unknown) {
                self.leaves(Place::Register(register), &Rc::clone(node));
            }
        }
        let program = self.program;
        for word in program.results.iter().flat_map(ArrayResult::span) {
            let node = self.word_of(state, word);
            self.leaves(Place::Word(word), &node);
        }
        if self.once {
            for register in &self.kept {
                let value = state.registers.get(register).map_or(&Value::Unknown, |node| &node.value);
                join_into(&mut self.left_by_once, *register, value);
            }
        }
        // Unread states pass to the next period, which may read them.
        self.needed.extend(&state.unshown);
        for range in &program.ranges {
            let Some(node) = state.registers.get(&range.register) else { continue };
            let kept = is_shown(range, Some(&node.value)) || node.value == Value::Unknown;
            let value = if kept { node.value.clone() } else { self.by_cases(node) };
            join_into(&mut self.found.left, Place::Register(range.register), &value);
        }
        for range in &program.array_ranges {
            for word in range.span() {
                let place = Place::Word(word);
                let is_written = state.memory.contains_key(&word);
                if !is_written && !self.found.left.contains_key(&place) {
                    continue;
                }
                let node = self.word_of(state, word);
                let value =
                    if is_word_shown(range, &node.value) { node.value.clone() } else { self.by_cases(&node) };
                if self.found.ended && !self.found.left.contains_key(&place) {
                    // Paths that ended before have not written the word.
                    let initial = self.initial_word(word);
                    join_into(&mut self.found.left, place, &initial.value);
                }
                join_into(&mut self.found.left, place, &value);
            }
        }
        self.found.ended = true;
    }

    /// Ends a period that is followed for a certificate: notes the values that it leaves in outputs and states.
    fn end_plainly(&mut self, state: &State) {
        if self.once {
            for register in &self.kept {
                let value = state.registers.get(register).map_or(&Value::Unknown, |node| &node.value);
                join_into(&mut self.left_by_once, *register, value);
            }
            // Values of states at the beginning of the first period.
            let registers =
                state.registers.iter().map(|(register, node)| (Place::Register(*register), &node.value));
            let words = state.memory.iter().map(|(word, node)| (Place::Word(*word), &node.value));
            let left = registers.chain(words).map(|(place, value)| (place, value.clone()));
            self.found.left.extend(left);
            return;
        }
        let program = self.program;
        let states = program.ranges.iter().map(|range| range.register);
        let states = states.filter(|register| !program.machine.is_input(*register));
        let registers: BTreeSet<Register> =
            numbers(program).map(|port| port.register).chain(states).collect();
        let period = self.periods;
        let registers = registers.into_iter();
        let left = registers.filter_map(|register| Some((register, state.registers.get(&register)?)));
        self.left.extend(left.map(|(register, node)| (period, Place::Register(register), Rc::clone(node))));
        let arrays = program.array_ranges.iter().flat_map(|range| range.span());
        let words: BTreeSet<u32> = arrays.chain(program.results.iter().flat_map(ArrayResult::span)).collect();
        let left = words.into_iter().filter_map(|word| Some((word, state.memory.get(&word)?)));
        self.left.extend(left.map(|(word, node)| (period, Place::Word(word), Rc::clone(node))));
    }

    /// Joins the value that a path leaves in an output.
    fn leaves(&mut self, place: Place, node: &Rc<Node>) {
        let value = self.by_cases(node);
        if value.float().is_err() {
            let words = self.found.open.entry(place).or_default();
            node.each_operation(&mut |made| _ = words.insert(made.word));
        }
        if !self.program.assumptions.is_empty() {
            let words = self.found.histories.entry(place).or_default();
            node.each_operation(&mut |made| _ = words.insert(made.word));
        }
        self.found.sources.entry(place).or_default().extend(node.from());
        join_into(&mut self.found.outputs, place, &value);
        join_into(&mut self.found.computed, place, &node.value);
    }

    /// Assumptions that narrow a value, with the outputs whose histories contain it.
    fn relied(&self) -> Vec<Relied> {
        let relied = |(word, register): (&u32, &Register)| {
            let depends = |place: &Place| self.found.histories.get(place).is_some_and(|of| of.contains(word));
            let ports = numbers(self.program).filter(|port| depends(&Place::Register(port.register)));
            let arrays = self.program.results.iter();
            let arrays = arrays.filter(|array| array.span().any(|word| depends(&Place::Word(word))));
            let names = arrays.filter_map(|array| self.program.element_text(array.first));
            let outputs = ports.map(|port| port.name.clone()).chain(names).collect();
            let assumption = *self.program.assumption(*word)?;
            Some(Relied { assumption, register: *register, outputs })
        };
        self.found.relied.iter().filter_map(relied).collect()
    }

    fn finish(self) -> Enclosure {
        let converging = self.converging();
        let hazard = |((word, problem), operands): (&(u32, Problem), &Vec<_>)| Hazard {
            word: *word,
            problem: *problem,
            operands: operands.clone(),
        };
        Enclosure {
            outputs: numbers(self.program)
                .filter_map(|port| self.port(port))
                .chain(self.program.results.iter().filter_map(|array| self.array(array)))
                .collect(),
            hazards: self.found.hazards.iter().map(hazard).collect(),
            assumed: self.unproved(&converging),
            relied: self.relied(),
            converging,
            operations: self.found.operations,
            extents: self.found.extents,
        }
    }

    /// Range and error of an output port; `None` if no path writes it.
    fn port(&self, port: &Port) -> Option<OutputBound> {
        let place = Place::Register(port.register);
        self.output(port.name.clone(), OutputPlace::Port(port.register), place, port.ty)
    }

    /// Range of an array, with the error of its worst element: one without a bound, or that with the largest.
    fn array(&self, array: &ArrayResult) -> Option<OutputBound> {
        let name = |word| self.program.element_text(word).unwrap_or_default();
        let shown = OutputPlace::Array(array.first);
        let element = |word| self.output(name(word), shown, Place::Word(word), array.ty);
        let elements: Vec<OutputBound> = array.span().filter_map(element).collect();
        let ranges: Option<Vec<Interval>> = elements.iter().map(|element| element.range).collect();
        let range = ranges.and_then(|ranges| ranges.into_iter().reduce(Interval::hull));
        let size = |element: &OutputBound| element.range.map_or(f64::INFINITY, Interval::magnitude);
        let error = |element: &OutputBound| element.error.unwrap_or_else(|| size(element));
        let worst = elements.into_iter().reduce(|a, b| if error(&b) > error(&a) { b } else { a })?;
        Some(OutputBound { range, ..worst })
    }

    fn output(&self, name: String, shown: OutputPlace, place: Place, ty: Type) -> Option<OutputBound> {
        let value = self.found.outputs.get(&place)?;
        let is_float = ty == Type::F;
        let range = match is_float {
            true => value.float().ok().map(|number| number.actual),
            false => integers(value),
        };
        let number = value.float().ok().filter(|_| is_float);
        let computed = self.found.computed.get(&place).filter(|_| is_float);
        let mut shares: BTreeMap<u32, f64> = BTreeMap::new();
        if let Some(number) = computed.and_then(|value| value.float().ok()) {
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
            name,
            place: shown,
            ty,
            error: number.map(|number| number.error_range().magnitude()),
            parts,
            open: if range.is_none() { self.open(place) } else { Vec::new() },
            from: self.found.sources.get(&place).cloned().unwrap_or_default(),
            range,
        })
    }

    /// Hazards that leave an output open: those that its history names, or all if that is not known.
    fn open(&self, place: Place) -> Vec<u32> {
        let opens = self.found.hazards.keys().filter(|(_, problem)| !problem.is_defined());
        let all: BTreeSet<u32> = opens.map(|(word, _)| *word).collect();
        let known = self.found.open.get(&place);
        let named: Vec<u32> =
            all.iter().copied().filter(|word| known.is_some_and(|of| of.contains(word))).collect();
        if named.is_empty() { all.into_iter().collect() } else { named }
    }
}

/// Output ports that carry binary32 or integers.
fn numbers(program: &Program) -> impl Iterator<Item = &Port> {
    program.outputs.iter().filter(|port| port.ty != Type::B)
}

/// Range of a value as a signed integer; `None` if a listed hazard leaves it open.
fn integers(value: &Value) -> Option<Interval> {
    let is_open = matches!(value, Value::Broken | Value::Unknown);
    (!is_open).then(|| value.whole().actual)
}

fn join_into<K: Ord>(values: &mut BTreeMap<K, Value>, key: K, value: &Value) {
    let joined = values.get(&key).map_or_else(|| value.clone(), |known| known.join(value));
    values.insert(key, joined);
}
