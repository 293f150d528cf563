// SPDX-License-Identifier: MIT OR Apache-2.0
//! Substitute for the block compiler on hosts without one: it compiles nothing.

use crate::lane::{LANES, Row};
use crate::machine::{State, WORDS};
use crate::micro::{LateResult, Micro};
use takt_isa::fp::Flags;

/// Uninhabited code of a block.
#[derive(Clone, Debug)]
pub(crate) enum Code {}

#[derive(Clone, Debug, Default)]
pub(crate) struct Words;

/// Blocks cannot be compiled in this build.
pub(crate) fn is_available() -> bool {
    false
}

pub(crate) fn switch_off() {}

pub(crate) fn compile(_: &[Micro], _: &[LateResult], _: u32) -> Option<Code> {
    None
}

impl Code {
    pub(crate) fn run(
        &self,
        _: &[LateResult],
        _: &mut State,
        _: &mut Words,
        _: &mut [(Flags, Option<u32>)],
        _: &mut Vec<(u32, u32)>,
    ) -> bool {
        match *self {}
    }
}

/// Uninhabited code of a block for the lanes of a batch.
#[derive(Clone, Debug)]
pub(crate) enum LaneCode {}

#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {}

impl Rows {
    pub(crate) fn late(&self, code: &LaneCode, _: usize) -> Row {
        match *code {}
    }
}

pub(crate) fn compile_lanes(_: &[Micro], _: &[LateResult], _: u32) -> Option<LaneCode> {
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
