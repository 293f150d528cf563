// SPDX-License-Identifier: MIT OR Apache-2.0
//! Just-in-time compiler of blocks to the host's instructions (feature `jit`, on x86-64).
//!
//! A block that has run often enough is compiled, speculatively: its code handles the ordinary case only, and checks for it (`graph`). In
//! any other case, the interpreter runs the block again from the same initial state. So both modes agree. A block whose checks fail often
//! is left to the interpreter.

mod emit;
mod graph;
mod host;
mod lower;
mod native;

use crate::lane::{LANES, Row};
use crate::machine::{State, WORDS, Word};
use crate::micro::{Kind, LateResult, Micro};
use emit::{VECTOR, Width};
use graph::Graph;
use lower::Scratch;
use native::NativeBlock;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use takt_isa::Effect;
use takt_isa::fp::Flags;

/// Compiled code of a block.
#[derive(Clone)]
pub(crate) struct Code(Arc<Parts>);

struct Parts {
    native: NativeBlock,
    scratch: Scratch,
    /// Numbers of the checks whose ports are watched, in order.
    watches: Box<[u32]>,
}

/// Output of the code: the data words that late results were loaded from, by number, and values written to watched ports.
#[derive(Clone, Debug, Default)]
pub(crate) struct Words(Vec<u32>);

impl std::fmt::Debug for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Code")
    }
}

/// Turns the compiler off in this process.
static SWITCHED_OFF: AtomicBool = AtomicBool::new(false);

/// Blocks can be compiled on this host, and the compiler is not turned off.
pub(crate) fn is_available() -> bool {
    !SWITCHED_OFF.load(Ordering::Relaxed) && native::target().is_some()
}

pub(crate) fn switch_off() {
    SWITCHED_OFF.store(true, Ordering::Relaxed);
}

/// Compiles a block; `None` if the compiler cannot.
pub(crate) fn compile(micros: &[Micro], late: &[LateResult], depth: u32) -> Option<Code> {
    if !is_available() {
        return None;
    }
    let graph = Graph::new(micros);
    let scratch = Scratch::new(&graph, late.len());
    let native = lower::lower(&graph, depth, scratch, Width::One)?;
    Some(Code(Arc::new(Parts { native, scratch, watches: graph.watches.into() })))
}

/// Compiled code of a block for the lanes of a batch.
#[derive(Clone)]
pub(crate) struct LaneCode(Arc<LaneParts>);

struct LaneParts {
    native: NativeBlock,
    scratch: Scratch,
    /// Registers that the code writes at its end. If a later vector fails, they must be restored in the earlier ones.
    last: Box<[Word]>,
    flags: bool,
}

impl std::fmt::Debug for LaneCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("LaneCode")
    }
}

/// Output of the code for lanes, and its undo log.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    rows: Vec<Row>,
    last: Vec<Row>,
}

impl Rows {
    /// Data words that a late result was loaded from.
    pub(crate) fn late(&self, code: &LaneCode, number: usize) -> Row {
        self.rows[code.0.scratch.late + number]
    }
}

/// Compiles a block for the lanes of a batch; `None` if the compiler cannot.
pub(crate) fn compile_lanes(micros: &[Micro], late: &[LateResult], depth: u32) -> Option<LaneCode> {
    if !is_available() {
        return None;
    }
    // Ports of a batch are never watched.
    let micros: Vec<_> = micros.iter().copied().filter(|micro| micro.kind != Kind::Watch).collect();
    let graph = Graph::new(&micros);
    let scratch = Scratch::new(&graph, late.len());
    let native = lower::lower(&graph, depth, scratch, Width::Vector { row: LANES })?;
    let last = graph.places().1.iter().map(|&(word, _)| word).collect();
    Some(LaneCode(Arc::new(LaneParts { native, scratch, last, flags: graph.uses_flags() })))
}

impl LaneCode {
    /// Runs the block in all lanes. Returns false if the interpreter must run it instead; the state that the block reads is then
    /// unchanged.
    pub(crate) fn run(
        &self,
        registers: &mut [Row; WORDS],
        memory: &mut [Row],
        flags: &mut [Flags; LANES],
        kept: &mut Rows,
    ) -> bool {
        let LaneParts { native, scratch, last, flags: uses_flags } = &*self.0;
        let Rows { rows, last: before } = kept;
        if rows.len() < scratch.end {
            rows.resize(scratch.end, [0; LANES]);
        }
        if *uses_flags {
            rows[0] = flags.map(|flags| flags.bits().into());
        }
        before.clear();
        before.extend(last.iter().map(|word| registers[word.index()]));
        for lane in (0..LANES).step_by(VECTOR) {
            let memory_words = memory.as_flattened_mut();
            if native.call(registers.as_flattened_mut(), memory_words, rows.as_flattened_mut(), lane) {
                continue;
            }
            for lane in (0..lane + VECTOR).rev() {
                for stored in rows[scratch.stored..scratch.end].chunks_exact(2).rev() {
                    memory[stored[0][lane] as usize][lane] = stored[1][lane];
                }
            }
            for (word, row) in last.iter().zip(before) {
                registers[word.index()] = *row;
            }
            return false;
        }
        if *uses_flags {
            *flags = rows[0].map(|bits| Flags::from_bits(bits as u8));
        }
        true
    }
}

impl Code {
    /// Runs the block. Returns false if the interpreter must run it instead; the state that the block reads is then unchanged.
    pub(crate) fn run(
        &self,
        from: &[LateResult],
        state: &mut State,
        words: &mut Words,
        late: &mut [(Flags, Option<u32>)],
        writes: &mut Vec<(u32, u32)>,
    ) -> bool {
        let Parts { native, scratch, watches } = &*self.0;
        let words = &mut words.0;
        if words.len() < scratch.end {
            words.resize(scratch.end, 0);
        }
        words[0] = state.flags.bits().into();
        if !native.call(&mut state.registers[..], &mut state.memory, words, 0) {
            for stored in words[scratch.stored..scratch.end].chunks_exact(2).rev() {
                state.memory[stored[0] as usize] = stored[1];
            }
            return false;
        }
        state.flags = Flags::from_bits(words[0] as u8);
        for (i, (late, from)) in late.iter_mut().zip(from).enumerate() {
            let is_load = from.operation.effect == Effect::Load;
            *late = (Flags::NONE, is_load.then(|| words[scratch.late + i]));
        }
        writes.extend(watches.iter().copied().zip(words[scratch.watched..].iter().copied()));
        true
    }
}
