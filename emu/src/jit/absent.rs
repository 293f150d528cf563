// SPDX-License-Identifier: MIT OR Apache-2.0
//! Substitute for the block compiler where there is none: it compiles nothing.

use crate::lane::{LANES, Row};
use crate::machine::{State, WORDS};
use crate::micro::{Late, Micro};
use takt_isa::fp::Flags;

/// A block's code.
#[derive(Clone, Debug)]
pub(crate) enum Code {}

#[derive(Clone, Debug, Default)]
pub(crate) struct Words;

/// True if blocks can be compiled.
pub(crate) fn is_available() -> bool {
    false
}

pub(crate) fn switch_off() {}

pub(crate) fn compile(_: &[Micro], _: &[Late], _: u32) -> Option<Code> {
    None
}

impl Code {
    pub(crate) fn run(
        &self,
        _: &[Late],
        _: &mut State,
        _: &mut Words,
        _: &mut [(Flags, Option<u32>)],
        _: &mut Vec<(u32, u32)>,
    ) -> bool {
        match *self {}
    }
}

/// A block's code for the lanes of a batch.
#[derive(Clone, Debug)]
pub(crate) enum LaneCode {}

#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {}

impl Rows {
    pub(crate) fn late(&self, code: &LaneCode, _: usize) -> Row {
        match *code {}
    }
}

pub(crate) fn compile_lanes(_: &[Micro], _: &[Late], _: u32) -> Option<LaneCode> {
    None
}

impl LaneCode {
    pub(crate) fn run(
        &self,
        _: &mut [Row; WORDS],
        _: &mut [Row],
        _: &mut [Flags; LANES],
        _: &mut Rows,
    ) -> bool {
        match *self {}
    }
}
