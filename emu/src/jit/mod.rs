//! Blocks compiled to the host's instructions (feature `jit`, on x86-64).
//!
//! A block that has run often enough is compiled. Its code takes the way that is nearly always taken; where it meets anything
//! else (`graph`), the interpreter runs the block again, from the state that it found. So both do the same, and blocks that
//! meet such things often are left to the interpreter.

mod graph;
mod host;
mod lower;
mod native;

use crate::block::Block;
use crate::machine::State;
use graph::Graph;
use lower::Scratch;
use native::Native;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use takt_isa::Effect;
use takt_isa::fp::Flags;

/// A block's code.
#[derive(Clone)]
pub(crate) struct Code(Arc<Parts>);

struct Parts {
    native: Native,
    scratch: Scratch,
    /// Numbers of the checks whose ports are watched, in order.
    watches: Box<[u32]>,
}

/// What the code leaves: the words loaded by late results, by their number, and what went to watched ports.
#[derive(Clone, Debug, Default)]
pub(crate) struct Words(Vec<u32>);

impl std::fmt::Debug for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Code")
    }
}

/// Whether this process is to do without the compiler.
static SWITCHED_OFF: AtomicBool = AtomicBool::new(false);

/// Whether blocks can be compiled for this host.
pub(crate) fn is_available() -> bool {
    !SWITCHED_OFF.load(Ordering::Relaxed) && native::target().is_some()
}

pub(crate) fn switch_off() {
    SWITCHED_OFF.store(true, Ordering::Relaxed);
}

/// Compiles a block; `None` if there is no code for it.
pub(crate) fn compile(block: &Block, depth: u32) -> Option<Code> {
    if !is_available() {
        return None;
    }
    let graph = Graph::new(&block.micros);
    let scratch = Scratch::new(&graph, block.late.len());
    let native = lower::lower(&graph, depth, scratch)?;
    Some(Code(Arc::new(Parts { native, scratch, watches: graph.watches.into() })))
}

impl Code {
    /// Runs the block. If the answer is false, the interpreter is to run it: all that it reads is as it was.
    pub(crate) fn run(
        &self,
        block: &Block,
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
        if !native.call(&mut state.registers, &mut state.memory, words) {
            for stored in words[scratch.stored..scratch.end].chunks_exact(2).rev() {
                state.memory[stored[0] as usize] = stored[1];
            }
            return false;
        }
        state.flags = Flags::from_bits(words[0] as u8);
        for (i, (late, from)) in late.iter_mut().zip(&block.late).enumerate() {
            let is_load = from.operation.effect == Effect::Load;
            *late = (Flags::NONE, is_load.then(|| words[scratch.late + i]));
        }
        writes.extend(watches.iter().copied().zip(words[scratch.watched..].iter().copied()));
        true
    }
}
