//! Stands in for the compiler of blocks: there is no code for any.

use crate::block::Block;
use crate::machine::State;
use takt_isa::fp::Flags;

/// A block's code.
#[derive(Clone, Debug)]
pub(crate) enum Code {}

#[derive(Clone, Debug, Default)]
pub(crate) struct Words;

/// Whether blocks can be compiled.
pub(crate) fn is_available() -> bool {
    false
}

pub(crate) fn switch_off() {}

pub(crate) fn compile(_: &Block, _: u32) -> Option<Code> {
    None
}

impl Code {
    pub(crate) fn run(
        &self,
        _: &Block,
        _: &mut State,
        _: &mut Words,
        _: &mut [(Flags, Option<u32>)],
        _: &mut Vec<(u32, u32)>,
    ) -> bool {
        match *self {}
    }
}
