// SPDX-License-Identifier: MIT OR Apache-2.0
//! Abstract value of a register or data word: the age of the input that it depends on, in periods since the read.

use super::{MAX_PERIODS, Periods};

/// The age that stands for no known dependence.
const NEVER: u16 = u16::MAX;
const CAP: u16 = MAX_PERIODS as u16;

/// The abstract value of one storage place, in terms of one input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    /// The least age of a read on which the value may depend, over all paths and operands.
    least: u16,
    /// The age that is certain: on every path, the value depends on a read at most this old.
    most: u16,
    /// True if the value may depend on a read of an earlier period.
    lasting: bool,
}

impl Cell {
    /// Independent of the input.
    pub(super) const NONE: Cell = Cell { least: NEVER, most: NEVER, lasting: false };
    /// The input itself.
    pub(super) const INPUT: Cell = Cell { least: 0, most: 0, lasting: false };
    /// The bottom element: the value of a place that no path has reached so far. Joining it changes nothing.
    pub(super) const BOTTOM: Cell = Cell { most: 0, ..Cell::NONE };

    /// The value of a result, from its operands: either of two is enough for a certain dependence, hence the minimum.
    pub(super) fn with(self, operand: Cell) -> Cell {
        Cell {
            least: self.least.min(operand.least),
            most: self.most.min(operand.most),
            lasting: self.lasting || operand.lasting,
        }
    }

    /// The join of two control-flow paths: only what is certain on both stays certain, hence the maximum.
    pub(super) fn or(self, other: Cell) -> Cell {
        Cell { most: self.most.max(other.most), ..self.with(other) }
    }

    /// Joins a control dependence: it adds to the possible reads, and nothing to the certain ones.
    pub(super) fn under(self, condition: Cell) -> Cell {
        Cell { most: self.most, ..self.with(condition) }
    }

    /// The same value with nothing certain.
    pub(super) fn uncertain(self) -> Cell {
        Cell { most: NEVER, ..self }
    }

    /// The same value one period later.
    pub(super) fn later(self) -> Cell {
        let least = if self.least == NEVER { NEVER } else { (self.least + 1).min(CAP) };
        let most = if self.most >= CAP { NEVER } else { self.most + 1 };
        Cell { least, most, lasting: least != NEVER }
    }

    pub(super) fn periods(self) -> Option<Periods> {
        (self.least != NEVER).then(|| Periods {
            least: self.least.into(),
            most: (self.most != NEVER).then(|| self.most.into()),
            lasting: self.lasting,
        })
    }
}

const _: () = assert!(MAX_PERIODS < NEVER as u32);
